"""Raw logs to runs to compare: a folder, pattern or list of them is one run, or one a damper."""

from __future__ import annotations

import math
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from damperfit.comparison import ComparedRun, MeasuredTest, measured_tests
from damperfit.errors import ConfigurationError, DamperfitError, LogError, TimelessError
from damperfit.io import read_curves
from damperfit.recording import natural_order
from damperfit.run.dampers import by_damper, folder_name
from damperfit.run.log_paths import expand
from damperfit.run.logs import Purpose, read_batch
from damperfit.run.remarks import log_warnings, skipped_files
from damperfit.tables import LogSignals
from damperfit.tested.identity import common_identity
from damperfit.tested.setting import Setting, parse_place

if TYPE_CHECKING:
    from damperfit.configuration.options import Configuration
    from damperfit.io import ForceCurve
    from damperfit.recording import Trace
    from damperfit.report.facts import Failure
    from damperfit.run.logs import LogBatch

__all__ = ["NoUsableLogError", "folders_of_logs", "holds_logs", "is_several_logs", "read_log_runs"]

_NAMELESS = Setting.of("as tested")  # of what says none


class NoUsableLogError(LogError):
    """None of the logs of a run can be used."""

    exit_code = 3


def is_several_logs(place: Path) -> bool:
    """Whether a place is a pattern or a list of logs, no file or folder of this name."""
    text = str(place)
    return not place.exists() and (text.startswith("@") or any(one in text for one in "*?["))


def holds_logs(folder: Path) -> bool:
    """Whether there are logs in a folder, not below it."""
    with suppress(DamperfitError):
        return folder.is_dir() and bool(expand([str(folder)]))
    return False


def folders_of_logs(folder: Path) -> dict[str, Path]:
    """Return the folders in a folder that hold logs, by name."""
    inside = sorted(folder.iterdir(), key=lambda one: natural_order(one.name))
    return {one.name: one for one in inside if one.name[0] != "." and holds_logs(one)}


def read_log_runs(
    place: Path, configuration: Configuration, *, jobs: int = 1
) -> dict[str, ComparedRun]:
    """Return what raw logs tell, by damper; one run without a name where they are of one.

    A log that cannot be used costs itself: the run's remarks say so.

    Parameters
    ----------
    place : pathlib.Path
        Log, folder, pattern or ``@list.txt``.
    configuration : Configuration
        How logs are read and conditioned.
    jobs : int
        Threads.

    Raises
    ------
    NoUsableLogError
        No log can be used.
    ConfigurationError
        There is no log.
    """
    batch = read_batch(expand([str(place)]), configuration, jobs=jobs, purpose=Purpose.COMPARE)
    groups = by_damper(batch)
    if len(groups) == 1:
        return {"": _run(place, batch=next(iter(groups.values())), configuration=configuration)}
    return {
        owner: _run(place / folder_name(owner), batch=part, configuration=configuration)
        for owner, part in groups.items()
    }


def _run(place: Path, *, batch: LogBatch, configuration: Configuration) -> ComparedRun:
    timeless = [one for one in batch.failures if one.kind == TimelessError.__name__]
    lost = [one.message for one in batch.failures if one not in timeless]
    tests: list[MeasuredTest] = []
    notes = [*batch.notes, *skipped_files(batch), *batch.remarks, *log_warnings(batch.traces)]
    for trace in batch.traces:
        found = _of_trace(trace)
        tests += found
        if not found:
            lost.append(f"{trace.name}: no measured cycles to compare; no motion in it repeats")
    for failure in timeless:
        try:
            curves = read_curves(Path(failure.path), configuration.reading)
        except ConfigurationError:
            raise
        except DamperfitError as error:
            lost.append(str(error))
            continue
        tests += [_of_curve(curve, None if place.is_file() else failure) for curve in curves]
        notes += [f"{failure.log}: {said}" for said in curves[0].notes]
    tests, unsaid = _of_settings(tests)
    lost += unsaid
    if not tests:
        more = f" (and {len(lost) - 1} more)" if len(lost) > 1 else ""
        said = lost[0] if lost else "no log that is not damperfit's own"
        where = "" if place.is_file() else f"{place}: none of its logs can be used: "
        raise NoUsableLogError(f"{where}{said}{more}")
    if not place.is_file() and any(test.setting == _NAMELESS for test in tests):
        n = len({test.log for test in tests})
        notes.append(
            f"no log says its setting: {'it is' if n == 1 else f'all {n} are'} compared as tested"
        )
    return ComparedRun(
        place.resolve().name,
        str(place),
        None,
        tuple(tests),
        _record(batch, configuration),
        remarks=tuple(lost),
        notes=tuple(dict.fromkeys(notes)),
    )


def _record(batch: LogBatch, configuration: Configuration) -> dict[str, Any]:
    """Return what run.json would say of what else may differ."""
    inputs = []
    for log in batch.logs:
        setting = log.facts.get("setting") or _NAMELESS
        known = {"reversed": log.facts["reversed"]} if "reversed" in log.facts else {}
        of_log = {"log": log.log, "sha256": log.sha256, "setting": setting.cell}
        inputs.append(of_log | known)
    return {
        "inputs": inputs,
        "test": common_identity(batch.identities.values()).describe(),
        "configuration": {
            section: configuration.document.get(section, {}) for section in ("rig", "conditioning")
        },
    }


def _of_settings(tests: list[MeasuredTest]) -> tuple[list[MeasuredTest], list[str]]:
    """Return the tests that can be told apart: beside settings, what says none is left out."""
    named = [test for test in tests if test.setting != _NAMELESS]
    if not named:
        return tests, []
    lost = dict.fromkeys(test.log for test in tests if test.setting == _NAMELESS)
    return named, [
        f"{log}: does not say its adjuster setting, and others do; give it a line '# setting: 10', "
        "a column 'setting', a name such as setting_10.csv or a row in tests.csv"
        for log in lost
    ]


def _of_trace(trace: Trace) -> tuple[MeasuredTest, ...]:
    n = len(trace.force)
    nothing = np.full(n, np.nan)
    signals = LogSignals(
        trace.setting or _NAMELESS,
        trace.name,
        trace.start_time + trace.interval * np.arange(n, dtype=np.float64),
        trace.displacement,
        trace.velocity,
        trace.force,
        nothing,
        np.stack([nothing] * 3),
    )
    stretches = [stretch.describe(trace) for stretch in trace.stretches]
    warmth = math.nan if trace.temperature is None else trace.temperature
    return measured_tests(signals, stretches, temperature=warmth)


def _of_curve(curve: ForceCurve, known: Failure | None) -> MeasuredTest:
    """Return a curve without time as a test without a motion: no errors are known."""
    speeds = np.unique(np.abs(curve.velocity[curve.velocity != 0.0]))
    nothing = np.empty(0)
    strokes = {}
    for stroke in ("rebound", "bump"):
        forces = np.array([curve.force_at(float(speed), stroke) for speed in speeds])
        strokes[stroke] = np.stack([forces, np.full(len(speeds), np.nan)])
    return MeasuredTest(
        setting=_setting_of(curve, known),
        log=curve.name,
        amplitude=math.nan,
        frequency=math.nan,
        n_cycles=0,
        displacement=nothing,
        velocity=curve.velocity,
        force=curve.force,
        simulated=nothing,
        speeds=speeds,
        strokes=strokes,
    )


def _setting_of(curve: ForceCurve, known: Failure | None) -> Setting:
    """Return the setting that a curve's label names; of the only one of a file, what is known."""
    if curve.label in {curve.name, Path(curve.name).stem}:
        return _NAMELESS if known is None or known.setting is None else known.setting
    try:
        return Setting.of(parse_place(curve.label))
    except ValueError:
        return Setting.of(curve.label)
