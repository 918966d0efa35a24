"""Runs to be compared, read: results folders, parts of fleets, baselines and raw logs."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from damperfit import __version__
from damperfit.adjustment.force_at import STROKES
from damperfit.comparison import MeasuredTest, measured_tests
from damperfit.errors import ConfigurationError, DamperfitError, LogError, TimelessError
from damperfit.io import read_curves
from damperfit.io.files import open_regular, read_text
from damperfit.problem import Option
from damperfit.queries.settings import refuse_unfitted
from damperfit.results import Run
from damperfit.run.log_files import expand
from damperfit.run.logs import Purpose, read_batch
from damperfit.run.parting import by_damper, folder_name
from damperfit.run.record import log_warnings
from damperfit.tables.columns import (
    adjusters_in,
    column_names,
    quantities_in,
    read_setting,
    setting_cells,
)
from damperfit.tables.files import json_values
from damperfit.tables.reading import LogSignals, is_part
from damperfit.tested.identity import common_identity
from damperfit.tested.setting import Setting, parse_place

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from damperfit.configuration.options import Configuration
    from damperfit.io.force_curves import ForceCurve
    from damperfit.problem import Failure
    from damperfit.recording import Trace
    from damperfit.run.logs import LogBatch

    FloatArray = NDArray[np.float64]


# Results folders, parts of fleets and baselines

_MARKS = ("run.json", "parameters.parquet", "parameters.csv")


def is_results(folder: Path) -> bool:
    """Whether a folder holds results of `identify`."""
    return any((folder / name).is_file() for name in _MARKS)


def read_run(path: Path, *, config: Path | None = None, is_measured: bool = False) -> Run:
    """Return a run to be compared: results, a baseline or a part; or measured curves alone."""

    def wrong(text: str) -> ConfigurationError:
        return ConfigurationError(
            text, measured=Option("measured"), subject=path, code="no-results"
        )

    if is_part(path):
        if is_measured:
            raise wrong(
                "a part of a fleet keeps no measured cycles; give {measured} the logs, or "
                "results of damperfit identify"
            )
        return refuse_unfitted(Run.load(path, config=config))
    if path.is_dir() and is_results(path):
        run = Run.load(path, parts=("parameters", "responses"), config=config)
    elif path.is_dir():
        raise wrong(
            "holds no results of damperfit identify; expected run.json and parameters.parquet"
        )
    elif not path.is_file():
        raise wrong("no such file or folder")
    elif not is_baseline(path):
        raise wrong(
            "neither a results folder nor a baseline; to compare logs and files of "
            "curves, give {measured}"
        )
    else:
        run = _read_baseline(path, config)
        if not run.rows("parameters") and not is_measured:
            raise wrong("a baseline of measured curves, nothing was fitted; give {measured}")
    if not is_measured:
        return refuse_unfitted(run)
    if not run.tests:
        why = f" ({'; '.join(run.remarks)})" if run.remarks else "; no motion in it repeats"
        raise ConfigurationError(
            f"{run.place}: no measured cycles to compare{why}", code="not-measured"
        )
    return run


# A run kept as one JSON file, to be the reference of later comparisons

_KEY, _VERSION = "damperfit_baseline", 1
# Of run.json: what is compared, or says what is compared.
_KEPT = (
    *("version", "schema_version", "test", "configuration", "procedure", "uncertainty"),
    *("speed_forces", "quantities", "adjusters"),
)
_OF_INPUTS = (
    *("log", "sha256", "setting", "reversed", "stretches"),
    *("amplitude_m", "frequency_Hz", "temperature_degC"),
)
_NUMBERS = ("amplitude", "frequency", "temperature")
_ARRAYS = ("displacement", "velocity", "force", "speeds")
_DIGITS = 7  # as many as 32-bit floats have


def baseline_text(run: Run, *, is_measured: bool = False) -> str:
    """Return a run as the text of a baseline; of measured curves alone without parameters."""
    rows = () if is_measured else run.rows("parameters")
    is_whole = all(isinstance(row["setting"].cell, int) for row in rows)
    document = {
        _KEY: _VERSION,
        "version": __version__,
        "source": run.name,
        "record": compared_record(run.record),
        # The columns of adjusters are those that follow the setting.
        "parameters": [
            {**setting_cells(row["setting"], is_whole=is_whole)}
            | {name: cell for name, cell in row.items() if name != "setting"}
            for row in rows
        ],
        "tests": [_test_record(test) for test in run.tests],
    }
    return json.dumps(json_values(document), indent=1, allow_nan=False) + "\n"


def compared_record(record: Mapping[str, Any]) -> dict[str, Any]:
    """Return what of run.json is compared, or says what is compared."""
    inputs = record.get("inputs")
    logs = [one for one in inputs if isinstance(one, dict)] if isinstance(inputs, list) else []
    return {key: record[key] for key in _KEPT if key in record} | {
        "inputs": [{key: one[key] for key in _OF_INPUTS if key in one} for one in logs]
    }


def _test_record(test: MeasuredTest) -> dict[str, Any]:
    def finite(value: float) -> float | None:
        return value if math.isfinite(value) else None

    def rounded(values: FloatArray) -> list[float | None]:
        return [float(f"{x:.{_DIGITS}g}") if math.isfinite(x) else None for x in values.tolist()]

    return {
        "setting": setting_cells(test.setting, is_whole=isinstance(test.setting.cell, int)),
        "log": test.log,
        "n_cycles": test.n_cycles,
        **{name: finite(getattr(test, name)) for name in _NUMBERS},
        **{name: rounded(getattr(test, name)) for name in _ARRAYS},
        "strokes": {name: [rounded(row) for row in rows] for name, rows in test.strokes.items()},
        "figures": {name: [finite(x) for x in pair] for name, pair in test.figures.items()},
    }


def is_baseline(path: Path) -> bool:
    """Whether a file says that it is a baseline."""
    if path.suffix.lower() != ".json":
        return False
    try:
        with open_regular(path) as file:
            return f'"{_KEY}"'.encode() in file.read(200)
    except OSError:
        return False


def _read_baseline(path: Path, config: Path | None) -> Run:
    try:
        document = json.loads(read_text(path))
        if document[_KEY] != _VERSION:
            raise ConfigurationError(
                f"a baseline of form {document[_KEY]} (damperfit "
                f"{document.get('version')}), and this damperfit knows {_VERSION}; save it again",
                subject=path,
                code="other-version",
            )
        record, rows = document["record"], document["parameters"]
        quantities = quantities_in(record)
        names = adjusters_in(list(rows[0]), quantities) if rows else ()
        parameters = tuple({**row, "setting": read_setting(row, names)} for row in rows)
        tests = tuple(_kept_test(one) for one in document["tests"])
    except (OSError, ValueError, TypeError, KeyError, IndexError, AttributeError) as error:
        raise ConfigurationError(
            f"a damaged baseline ({type(error).__name__}: {error}); save it again with "
            "damperfit compare RESULTS --save FILE",
            subject=path,
            code="damaged",
        ) from error
    rows_of = {"parameters": parameters}
    run = Run(record, rows_of, quantities=quantities, place=path, config=config)
    run.tests = tests
    return run


def _kept_test(record: dict[str, Any]) -> MeasuredTest:
    def number(value: float | None) -> float:
        return math.nan if value is None else float(value)

    def array(values: list[float | None]) -> Any:
        return np.array([number(value) for value in values])

    kept: dict[str, Any] = {name: number(record[name]) for name in _NUMBERS}
    kept |= {name: array(record[name]) for name in _ARRAYS}
    cells = record["setting"]
    names = [name for name in cells if name != "setting" and name not in column_names()]
    strokes, figures = record["strokes"].items(), record["figures"].items()
    return MeasuredTest(
        setting=read_setting(cells, names) or Setting.of(0),
        log=str(record["log"]),
        n_cycles=int(record["n_cycles"]),
        strokes={name: np.stack([array(row) for row in rows]) for name, rows in strokes},
        figures={name: (number(value), number(error)) for name, (value, error) in figures},
        **kept,
    )


# Raw logs, without a fit: a folder, pattern or list of them is one run, or one a damper

_NAMELESS = Setting.of("as tested")  # of what says none


class NoUsableLogError(LogError):
    """None of the logs of a run can be used."""

    exit_code = 3


def read_log_runs(place: Path, configuration: Configuration, *, jobs: int = 1) -> dict[str, Run]:
    """Return what raw logs tell, by damper; one run without a name where they are of one.

    A log that cannot be used costs itself: the run's remarks say so.
    """
    batch = read_batch(expand([str(place)]), configuration, jobs=jobs, purpose=Purpose.COMPARE)
    groups = by_damper(batch)
    if len(groups) == 1:
        return {"": _of_logs(place, next(iter(groups.values())), configuration)}
    return {
        owner: _of_logs(place / folder_name(owner), part, configuration)
        for owner, part in groups.items()
    }


def _of_logs(place: Path, batch: LogBatch, configuration: Configuration) -> Run:
    timeless = [one for one in batch.failures if one.kind == TimelessError.__name__]
    lost = [one.message for one in batch.failures if one not in timeless]
    tests: list[MeasuredTest] = []
    about = (*batch.notes, *batch.skipped_files, *batch.remarks, *log_warnings(batch.traces))
    notes = list(map(str, about))
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
        notes += [f"{failure.log}: {note}" for note in curves[0].notes]
    # Beside settings, what says none cannot be told apart.
    if named := [test for test in tests if test.setting != _NAMELESS]:
        lost += [
            f"{log}: does not say its adjuster setting, and others do; give it a line "
            "'# setting: 10', a column 'setting', a name such as setting_10.csv or a row in "
            "tests.csv"
            for log in dict.fromkeys(test.log for test in tests if test.setting == _NAMELESS)
        ]
        tests = named
    if not tests:
        more = f" (and {len(lost) - 1} more)" if len(lost) > 1 else ""
        first = lost[0] if lost else "no log that is not damperfit's own"
        where = "" if place.is_file() else f"{place}: none of its logs can be used: "
        raise NoUsableLogError(f"{where}{first}{more}")
    if not place.is_file() and not named:
        n = len({test.log for test in tests})
        notes.append(
            f"no log says its setting: {'it is' if n == 1 else f'all {n} are'} compared as tested"
        )
    document = configuration.document
    record = {  # what run.json would say of what else may differ
        "inputs": [
            {"log": log.log, "sha256": log.sha256}
            | {"setting": (log.facts.get("setting") or _NAMELESS).cell}
            | {key: log.facts[key] for key in ("reversed",) if key in log.facts}
            for log in batch.logs
        ],
        "test": common_identity(log.identity for log in batch.logs).describe(),
        "configuration": {name: document.get(name, {}) for name in ("rig", "conditioning")},
        "notes": list(dict.fromkeys(notes)),
    }
    run = Run(record, {"parameters": ()}, place=place, remarks=lost)
    run.tests = tuple(tests)
    return run


def _of_trace(trace: Trace) -> tuple[MeasuredTest, ...]:
    nothing = np.full(len(trace.force), np.nan)
    signals = LogSignals(
        trace.setting or _NAMELESS,
        trace.name,
        trace.start_time + trace.interval * np.arange(len(trace.force), dtype=np.float64),
        trace.displacement,
        trace.velocity,
        trace.force,
        nothing,
        np.stack([nothing] * 3),
    )
    segments = [stretch.describe(trace) for stretch in trace.stretches]
    mean = math.nan if trace.temperature is None else trace.temperature
    return measured_tests(signals, segments, temperature=mean)


def _of_curve(curve: ForceCurve, known: Failure | None) -> MeasuredTest:
    """Return a curve without time as a test without a motion: no errors are known."""
    speeds = np.unique(np.abs(curve.velocity[curve.velocity != 0.0]))
    strokes = {}
    for stroke in STROKES:
        forces = np.array([curve.force_at(float(speed), stroke) for speed in speeds])
        strokes[stroke] = np.stack([forces, np.full(len(speeds), np.nan)])
    setting = (known.setting if known is not None else None) or _NAMELESS
    if curve.label not in {curve.name, Path(curve.name).stem}:  # one of several in its file
        try:
            setting = Setting.of(parse_place(curve.label))
        except ValueError:
            setting = Setting.of(curve.label)
    return MeasuredTest(
        setting=setting,
        log=curve.name,
        amplitude=math.nan,
        frequency=math.nan,
        n_cycles=0,
        displacement=np.empty(0),
        velocity=curve.velocity,
        force=curve.force,
        speeds=speeds,
        strokes=strokes,
    )


def name_apart(runs: Sequence[Run]) -> None:
    """Give runs names that differ: where two are alike, as much of their path."""
    if len({run.name for run in runs}) < len({run.shown_as for run in runs}):
        for run in runs:
            run.name = "/".join(Path(run.shown_as).resolve().parts[-2:])
