"""What was fitted, compared: forces at speeds, parameters, MSE and distance from cavitation.

At a setting where a model misses the measured force of any run by more than it may, the measured
forces of all are compared, at every speed: a model that misses one is not asked for the next, and a
difference must be of one kind. Where every run knows the offset of its rig, which is tared before
each test, forces are without it.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from damperfit.adjustment.force_at import STROKES, force_at
from damperfit.comparison.measured import repeat_scatter
from damperfit.comparison.verdict import Difference, Reading, Sameness, Topic, compared
from damperfit.identification import Status

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from damperfit.damper.quantity import Quantity
    from damperfit.errors import OnError
    from damperfit.results import Run
    from damperfit.tested.setting import Setting

    Readings = dict[Topic, Reading]

_OBJECTIONS = {
    Status.AT_BOUND.value: "it is at a bound of its range",
    Status.NOT_IDENTIFIABLE.value: "the logs do not determine it",
    Status.ABSENT.value: "the law is fitted without it there",
}
_ONCE = {Status.SHARED.value, Status.FIXED.value, Status.NOT_IDENTIFIABLE.value}


def settings_of(run: Run, *, is_bare: bool) -> tuple[Setting, ...]:
    """Return the settings that were measured, or those that have parameters."""
    if is_bare:
        return tuple(sorted({test.setting for test in run.tests}))
    return tuple(stage.setting for stage in run.settings)


def force_readings(
    runs: Sequence[Run],
    settings: Sequence[Setting],
    *,
    speeds: Sequence[float],
    on_error: OnError | None = None,
) -> tuple[Readings, ...]:
    """Return the forces of fitted runs at speeds, m/s, of settings that all have.

    Without `on_error` an error that a setting has met is raised.
    """
    bare = known_tares(runs, settings)
    tables = []
    for run in runs:
        stages = [stage for stage in run.settings if stage.setting in settings]
        forces = force_at(stages, run.damper, speeds, measured=run.speed_forces, on_error=on_error)
        tables.append(
            {
                (one.setting, one.speed, one.stroke): one if one.setting in bare else one.with_tare
                for one in forces
            }
        )
    order = [
        (setting, speed, stroke) for setting in settings for speed in speeds for stroke in STROKES
    ]
    common = [key for key in order if all(key in table for table in tables)]
    doubted = {key[0] for key in common if any(table[key].disagrees for table in tables)}
    readings: list[Readings] = []
    for run, table in zip(runs, tables, strict=True):
        share, repeat_freedom = repeat_scatter(run)
        readings.append({})
        for key in common:
            force = table[key]
            if key[0] in doubted and all(other[key].measured is not None for other in tables):
                force = force.as_read
            n_logs = run.row(force.setting).get("n_logs") or 1
            readings[-1][Topic("force", "force", "force", "N", *key)] = Reading(
                force.force,
                force.error,
                freedom_of(run, force.setting),
                repeat=share * abs(force.damping) / math.sqrt(n_logs),
                repeat_freedom=repeat_freedom,
                misfit=force.misfit,
                misses=force.difference,
                misses_error=force.measured_error,
                disagrees=force.disagrees,
                scale=force.damping,
                is_measured=force.is_measured,
            )
    return tuple(readings)


def known_tares(runs: Sequence[Run], settings: Sequence[Setting]) -> set[Setting]:
    """Return the settings at which all of several runs know the offset of their rig."""
    if len(runs) < 2 or not all(map(knows_gas, runs)):
        return set()
    known = [{stage.setting for stage in run.settings if stage.knows_offset} for run in runs]
    return set(settings).intersection(*known)


def knows_gas(run: Run) -> bool:
    """Without a gas of its own a model holds the gas force in its offset."""
    return run.damper.rest_force(0.0) is not None


def shifted(reading: Reading, shift: float, error: float) -> Reading:
    """Return a force with a zero shift taken off.

    A model without an offset of its own has taken up a part of the shift, between none and all.
    """
    if shift and not reading.is_measured:
        shift, error = 0.5 * shift, math.hypot(0.5 * error, shift / math.sqrt(12.0))
    return replace(reading, value=reading.value - shift, repeat=math.hypot(reading.repeat, error))


def freedom_of(run: Run, setting: Setting) -> float:
    """Return the degrees of freedom of a setting's errors: its cycles less one for each log.

    Infinite where the cycles are not known, or nothing repeated.
    """
    row = run.row(setting)
    cycles, logs = row.get("n_cycles"), row.get("n_logs") or 1
    return float(max(cycles - logs, 1)) if cycles else math.inf


def comparable_quantities(runs: Sequence[Run]) -> tuple[Quantity, ...]:
    """Return the quantities that all runs have: none where they are of different models."""
    if len({run.damper.name for run in runs}) > 1:
        return ()
    units = [{one.name: one.unit for one in run.quantities} for run in runs[1:]]
    return tuple(
        one for one in runs[0].quantities if all(known.get(one.name) == one.unit for known in units)
    )


def parameter_readings(runs: Sequence[Run], settings: Sequence[Setting]) -> tuple[Readings, ...]:
    """Return the parameters of each run that was fitted in at least one of them.

    What all settings share is one number, and stands once.
    """
    tables: tuple[Readings, ...] = tuple({} for _ in runs)
    for quantity in comparable_quantities(runs):
        status = f"{quantity.name}_status"
        by_run = [[run.row(setting) for setting in settings] for run in runs]
        is_shared = all(
            len({row.get(quantity.name) for row in rows}) == 1
            and {row.get(status) for row in rows} <= _ONCE
            for rows in by_run
        )
        for k, setting in enumerate(settings[:1] if is_shared else settings):
            rows = [rows[k] for rows in by_run]
            if all(row.get(status) == Status.FIXED.value for row in rows):
                continue
            topic = Topic(
                *("parameter", quantity.name, quantity.symbol, quantity.unit),
                setting=None if is_shared else setting,
                is_logarithmic=quantity.is_logarithmic,
            )
            for table, run, row in zip(tables, runs, rows, strict=True):
                counted = settings if is_shared else (setting,)
                freedom = sum(freedom_of(run, one) for one in counted)
                table[topic] = _parameter_reading(row, quantity, freedom)
    return tables


def _parameter_reading(row: Mapping[str, Any], quantity: Quantity, freedom: float) -> Reading:
    name = quantity.name
    status = str(row.get(f"{name}_status"))
    if row.get(name) is None:
        return Reading(math.nan, objection="it has no value")
    return Reading(
        float(row[name]),
        0.0 if status == Status.FIXED.value else _number(row.get(f"{name}_se")),
        freedom,
        misfit=float(row.get(f"{name}_misfit_se") or 0.0),
        scale=math.nan if quantity.is_logarithmic else quantity.size,
        objection=_OBJECTIONS.get(status, ""),
    )


def figure_lines(first: Run, second: Run, settings: Sequence[Setting]) -> Iterator[Difference]:
    """Yield MSE and distance from cavitation by setting: numbers without errors, told in words."""

    def in_words(topic: Topic, values: Sequence[float], words: Sequence[str]) -> Difference:
        is_same = words[0] == words[1]
        line = compared(topic, *map(Reading, values))
        return Difference(
            *(topic, line.first, line.second, line.difference),
            verdict=Sameness.SAME if is_same else Sameness.DIFFERENT,
            words=f"both {words[0]}" if is_same else f"{words[0]}, now {words[1]}",
        )

    for setting in settings:
        rows = (first.row(setting), second.row(setting))
        yield in_words(
            Topic("figure", "mse", "MSE", "%", setting),
            [_number(row.get("mse_percent")) for row in rows],
            [str(row.get("grade") or "no grade") for row in rows],
        )
        margins = [100.0 * _number(row.get("r_m3_cavitation_margin")) for row in rows]
        is_empty = [bool(row.get("cavitation_fraction")) for row in rows]
        if any(map(math.isfinite, margins)) or any(is_empty):
            yield in_words(
                Topic("figure", "cavitation_margin", "R_m3 below cavitation", "%", setting),
                margins,
                ["cavitates" if empty else "full" for empty in is_empty],
            )


def _number(value: Any) -> float:
    return math.nan if value is None else float(value)
