"""Forces by setting, speed and stroke of fitted runs, as model or measurement tells.

At a setting where a model misses the measured force of any run by more than it may, the measured
forces of all are compared, at every speed: a model that misses one is not asked for the next, and a
difference must be of one kind. Where every run knows the offset of its rig, which is tared before
each test, forces are without it.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from damperfit.adjustment.force_at import STROKES, force_at, said_offsets
from damperfit.comparison.measured import repeat_scatter
from damperfit.comparison.reading import Reading, Topic

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from damperfit.adjustment.force_at import Force
    from damperfit.comparison.run import ComparedRun
    from damperfit.errors import OnError
    from damperfit.results import Run
    from damperfit.tested.setting import Setting

__all__ = ["force_readings", "freedom_of", "tare_notes"]

_Key = tuple["Setting", float, str]


def force_readings(
    runs: Sequence[ComparedRun],
    settings: Sequence[Setting],
    *,
    speeds: Sequence[float],
    on_error: OnError | None = None,
) -> tuple[dict[Topic, Reading], ...]:
    """Return the forces of each run at some speeds.

    Parameters
    ----------
    runs : sequence of ComparedRun
        All of them fitted.
    settings : sequence of Setting
        That all have.
    speeds : sequence of float
        m/s.
    on_error : callable, optional
        Told of a setting and the error that it met; without it such an error is raised.
    """
    bare = _known_tares(runs, settings)
    tables = [
        {
            key: one if key[0] in bare else one.with_tare
            for key, one in _forces(run, settings, speeds=speeds, on_error=on_error).items()
        }
        for run in runs
    ]
    common = [key for key in tables[0] if all(key in table for table in tables)]
    doubted = {key[0] for key in common if any(table[key].disagrees for table in tables)}
    missed = {
        key
        for key in common
        if key[0] in doubted and all(table[key].measured is not None for table in tables)
    }
    found = []
    for run, table in zip(runs, tables, strict=True):
        scatter = repeat_scatter(run)
        found.append(
            {
                Topic("force", "force", "force", "N", *key): _reading(
                    run, table[key].as_read if key in missed else table[key], scatter
                )
                for key in common
            }
        )
    return tuple(found)


def tare_notes(runs: Sequence[ComparedRun], settings: Sequence[Setting]) -> Iterator[str]:
    """Yield what became of the rigs' force offsets in the forces of fitted runs."""
    bare = _known_tares(runs, settings)
    stages = [[one for one in _fitted(run).settings if one.setting in bare] for run in runs]
    if any(one.offset for mine in stages for one in mine):
        each = "; ".join(
            f"{run.name}: {said_offsets([one.offset for one in mine])}"
            for run, mine in zip(runs, stages, strict=True)
        )
        yield f"the rigs' force offsets, their tares, are left out of the forces ({each})"
    for run in runs:
        rest = [
            one.offset
            for one in _fitted(run).settings
            if one.setting in settings and one.setting not in bare and one.offset
        ]
        if rest and _knows_gas(run):
            yield (
                f"{run.name}: its force offset ({said_offsets(rest)}), the rig's tare, is in its "
                "forces, for not every run has a known one: so much of a difference may be the tare"
            )


def _known_tares(runs: Sequence[ComparedRun], settings: Sequence[Setting]) -> set[Setting]:
    """Return the settings at which all of several runs know the offset of their rig."""
    if len(runs) < 2 or not all(_knows_gas(run) for run in runs):
        return set()
    known = [{one.setting for one in _fitted(run).settings if one.knows_offset} for run in runs]
    return {one for one in settings if all(one in mine for mine in known)}


def _knows_gas(run: ComparedRun) -> bool:
    """Without a gas of its own a model holds the gas force in its offset."""
    return _fitted(run).damper.rest_force(0.0) is not None


def _forces(
    run: ComparedRun,
    settings: Sequence[Setting],
    *,
    speeds: Sequence[float],
    on_error: OnError | None,
) -> dict[_Key, Force]:
    fitted = _fitted(run)
    stages = {stage.setting: stage for stage in fitted.settings}
    found = force_at(
        [stages[setting] for setting in settings if setting in stages],
        fitted.damper,
        speeds,
        measured=fitted.speed_forces,
        on_error=on_error,
    )
    by_place = {(one.setting, one.speed, one.stroke): one for one in found}
    order = [(a, b, c) for a in settings for b in speeds for c in STROKES]
    return {key: by_place[key] for key in order if key in by_place}


def _fitted(run: ComparedRun) -> Run:
    assert run.fitted is not None
    return run.fitted


def _reading(run: ComparedRun, level: Force, scatter: tuple[float, float]) -> Reading:
    fitted = _fitted(run)
    damping = level.force - (0.0 if math.isnan(level.gas) else level.gas)
    share, freedom = scatter
    n_logs = fitted.row(level.setting).get("n_logs") or 1
    return Reading(
        level.force,
        level.error,
        freedom_of(fitted, level.setting),
        repeat=share * abs(damping) / math.sqrt(n_logs),
        repeat_freedom=freedom,
        misfit=level.misfit,
        misses=level.difference,
        misses_error=level.measured_error,
        disagrees=level.disagrees,
        scale=damping,
        is_measured=level.is_measured,
    )


def freedom_of(fitted: Run, setting: Setting) -> float:
    """Return the degrees of freedom of a setting's errors: its cycles less one for each log.

    Infinite where the cycles are not known, or nothing repeated.
    """
    row = fitted.row(setting)
    cycles, logs = row.get("n_cycles"), row.get("n_logs") or 1
    return float(max(cycles - logs, 1)) if cycles else math.inf
