"""What one call of `compare` compares: results folders, baselines, raw logs and curves."""

from __future__ import annotations

import json
import math
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from damperfit import __version__, results
from damperfit.adjustment.force_at import STROKES, Sine
from damperfit.comparison import (
    ComparedRun,
    ComparisonOptions,
    MeasuredTest,
    RunComparison,
    bands_met,
    compare_runs,
    measured_tests,
    parse_tolerance,
    read_bands,
    tolerated,
)
from damperfit.configuration.loading import load_configuration
from damperfit.errors import ConfigurationError, DamperfitError, LogError, TimelessError
from damperfit.io import ForceCurve, read_curves
from damperfit.io.files import open_regular, read_text
from damperfit.problem import Option
from damperfit.queries.settings import adjuster_of
from damperfit.recording import natural_order
from damperfit.report.records import listed_in, number_in
from damperfit.run.dampers import by_damper, folder_name
from damperfit.run.log_paths import expand
from damperfit.run.logs import Purpose, read_batch
from damperfit.run.remarks import log_warnings, skipped_files
from damperfit.simulation import NAMED_SPEEDS
from damperfit.tables.columns import (
    adjusters_in,
    column_names,
    quantities_in,
    read_setting,
    setting_cells,
)
from damperfit.tables.reading import LogSignals, is_part
from damperfit.tested.identity import common_identity
from damperfit.tested.setting import Setting, parse_place
from damperfit.units.quantities import parse_quantity
from damperfit.units.shown_units import SI, parse_units

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from damperfit.comparison import Point, Tolerance
    from damperfit.configuration.options import Configuration
    from damperfit.io import ForceCurve, ReadOptions
    from damperfit.problem import Failure
    from damperfit.queries.settings import Question
    from damperfit.recording import Trace
    from damperfit.run.logs import LogBatch

__all__ = [
    "Baseline",
    "Compared",
    "LogRuns",
    "MeasuredForces",
    "NoUsableLogError",
    "Pair",
    "baseline_text",
    "compare_all",
    "compared_record",
    "comparison_options",
    "folders_of_logs",
    "holds_logs",
    "holds_runs",
    "is_baseline",
    "is_several_logs",
    "measured_forces",
    "one_run",
    "pairs_of",
    "parse_bands",
    "read_baseline",
    "read_log_runs",
    "read_run",
    "runs_of_logs",
    "with_distinct_names",
]


# A run kept as one JSON file, to be the reference of later comparisons.

_KEY, _VERSION = "damperfit_baseline", 1
# Of run.json: what is compared, or says what is compared.
_KEPT = (
    *("version", "schema_version", "test", "configuration", "procedure", "uncertainty"),
    *("speed_forces", "quantities", "adjusters"),
)
_OF_INPUTS = (
    *("log", "sha256", "setting", "reversed"),
    *("amplitude_m", "frequency_Hz", "temperature_degC"),
)
_ARRAYS = ("displacement", "velocity", "force", "simulated", "speeds")
_DIGITS = 7  # as many as 32-bit floats have


@dataclass(frozen=True, slots=True, eq=False)
class Baseline:
    """What a baseline holds.

    Attributes
    ----------
    results : ComparedRun
        Parameters and run.json, as far as they are compared.
    tests : tuple of MeasuredTest
        Mean cycles.
    """

    results: results.Run
    tests: tuple[MeasuredTest, ...]


def baseline_text(run: ComparedRun) -> str:
    """Return a run as the text of a baseline; of measured curves alone without parameters."""
    known = () if run.fitted is None else run.fitted.rows("parameters")
    rows = {Setting.of(row["setting"]): row for row in known}
    record = compared_record(run.record)
    settings = list(rows)
    is_whole = all(isinstance(one.cell, int) for one in settings)
    document = {
        _KEY: _VERSION,
        "version": __version__,
        "source": run.name,
        "record": record,
        "parameters": [
            # The columns of adjusters are those that follow the setting.
            {
                **setting_cells(setting, is_whole=is_whole),
                **{name: cell for name, cell in row.items() if name != "setting"},
            }
            for setting, row in rows.items()
        ],
        "tests": [_test_record(test) for test in run.tests],
    }
    return json.dumps(document, indent=1, allow_nan=False) + "\n"


def compared_record(record: Mapping[str, Any]) -> dict[str, Any]:
    """Return what of run.json is compared, or says what is compared."""
    inputs = record.get("inputs")
    return {key: record[key] for key in _KEPT if key in record} | {
        "inputs": [
            {key: one[key] for key in (*_OF_INPUTS, "stretches") if key in one}
            for one in (inputs if isinstance(inputs, list) else ())
            if isinstance(one, dict)
        ]
    }


def _test_record(test: MeasuredTest) -> dict[str, Any]:
    assert test.setting is not None
    return {
        "setting": setting_cells(test.setting, is_whole=isinstance(test.setting.cell, int)),
        "log": test.log,
        "n_cycles": test.n_cycles,
        **{
            name: _finite(getattr(test, name)) for name in ("amplitude", "frequency", "temperature")
        },
        **{name: _rounded(getattr(test, name)) for name in _ARRAYS},
        "strokes": {name: [_rounded(row) for row in rows] for name, rows in test.strokes.items()},
        "figures": {name: [_finite(x) for x in pair] for name, pair in test.figures.items()},
    }


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None


def _rounded(values: Any) -> list[float | None]:
    return [float(f"{x:.{_DIGITS}g}") if math.isfinite(x) else None for x in values.tolist()]


def is_baseline(path: Path) -> bool:
    """Whether a file says that it is a baseline."""
    if path.suffix.lower() != ".json":
        return False
    try:
        with open_regular(path) as file:
            return f'"{_KEY}"'.encode() in file.read(200)
    except OSError:
        return False


def read_baseline(path: Path, *, config: Path | None = None) -> Baseline:
    """Return what a baseline holds.

    Raises
    ------
    ConfigurationError
        It is damaged, or of a later damperfit.
    """
    try:
        document = json.loads(read_text(path))
        if document[_KEY] != _VERSION:
            raise ConfigurationError(
                f"a baseline of form {document[_KEY]} (damperfit "
                f"{document.get('version')}), and this damperfit knows {_VERSION}; save it again",
                subject=path,
            )
        record, rows = document["record"], document["parameters"]
        quantities = quantities_in(record, list(rows[0]) if rows else ())
        names = adjusters_in(list(rows[0]), quantities) if rows else ()
        parameters = tuple({**row, "setting": read_setting(row, names)} for row in rows)
        tests = tuple(_test(one) for one in document["tests"])
    except (OSError, ValueError, TypeError, KeyError, IndexError, AttributeError) as error:
        raise ConfigurationError(
            f"a damaged baseline ({type(error).__name__}: {error}); save it again with "
            "damperfit compare RESULTS --save FILE",
            subject=path,
        ) from error
    run = results.Run(
        record, {"parameters": parameters}, quantities=quantities, place=path, config=config
    )
    return Baseline(run, tests)


def _test(record: dict[str, Any]) -> MeasuredTest:
    cells = record["setting"]
    names = [name for name in cells if name != "setting" and name not in column_names()]
    return MeasuredTest(
        setting=read_setting(cells, names) or Setting.of(0),
        log=str(record["log"]),
        n_cycles=int(record["n_cycles"]),
        amplitude=_number(record["amplitude"]),
        frequency=_number(record["frequency"]),
        temperature=_number(record["temperature"]),
        displacement=_array(record["displacement"]),
        velocity=_array(record["velocity"]),
        force=_array(record["force"]),
        simulated=_array(record["simulated"]),
        speeds=_array(record["speeds"]),
        strokes={
            name: np.stack([_array(row) for row in rows])
            for name, rows in record["strokes"].items()
        },
        figures={
            name: (_number(value), _number(error))
            for name, (value, error) in record["figures"].items()
        },
    )


def _number(value: float | None) -> float:
    return math.nan if value is None else float(value)


def _array(values: list[float | None]) -> Any:
    return np.array([_number(value) for value in values])


# Raw logs to runs to compare: a folder, pattern or list of them is one run, or one a damper.

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
    about = (*batch.notes, *skipped_files(batch), *batch.remarks, *log_warnings(batch.traces))
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


# Curves that were measured without time, asked for forces: by curve, and which gives a force.


@dataclass(frozen=True, slots=True, eq=False)
class MeasuredForces:
    """Forces of measured curves at some speeds, and the answer where a force was asked for.

    Attributes
    ----------
    curves : tuple of ForceCurve
        As the file has them.
    speeds : tuple of float
        m/s, positive.
    sentence : str
        Which curve gives the wanted force; empty where none was asked for.
    """

    curves: tuple[ForceCurve, ...]
    speeds: tuple[float, ...]
    sentence: str

    def rows(self) -> list[dict[str, Any]]:
        """Return the forces by curve, stroke and speed that were reached, as JSON values."""
        return [
            {"curve": curve.label, "stroke": stroke, "speed_m_per_s": speed, "force_N": force}
            for curve in self.curves
            for stroke in STROKES
            for speed in self.speeds
            if math.isfinite(force := curve.force_at(speed, stroke))
        ]


def measured_forces(
    paths: Sequence[Path], question: Question, *, reading: ReadOptions
) -> MeasuredForces:
    """Return what the curves of some files say of a question.

    Parameters
    ----------
    paths : sequence of pathlib.Path
        Points or loops of force over speed, without time.
    question : Question
        Speed, force and stroke asked for.
    reading : ReadOptions
        Units and signs.

    Raises
    ------
    LogError
        A file holds no such curves.
    ConfigurationError
        No curve reaches the speed.
    """
    curves = _file_before_label([curve for path in paths for curve in read_curves(path, reading)])
    strokes = (question.stroke,) if question.stroke else STROKES
    tops = [float(v.max()) for c in curves for s in strokes if len(v := c.points(s)[0])]
    speeds = tuple(speed for speed in NAMED_SPEEDS if speed <= max(tops, default=0.0))
    if question.speed is not None:
        speeds = (question.speed,)
    forces = [
        (force, curve.label)
        for curve in curves
        for stroke in strokes
        for speed in speeds
        if math.isfinite(force := curve.force_at(speed, stroke))
    ]
    if not forces:
        at = f"{question.speed:g} m/s" if question.speed else "the named test speeds"
        side = f" in {question.stroke}" if question.stroke else ""
        names = ", ".join(path.name for path in paths)
        raise ConfigurationError(
            f"no curve of {names} has points on both sides of it{side}; the highest "
            f"measured speed is {max(tops, default=0.0):.3g} m/s",
            subject=at,
        )
    sentence = "" if question.force is None else _answer(question, forces)
    return MeasuredForces(curves, speeds, sentence)


def _file_before_label(curves: Sequence[ForceCurve]) -> tuple[ForceCurve, ...]:
    """Put the file's name before labels that several files use."""
    files: dict[str, set[str]] = {}
    for one in curves:
        files.setdefault(one.label, set()).add(one.path)
    return tuple(
        replace(one, label=f"{one.name} {one.label}") if len(files[one.label]) > 1 else one
        for one in curves
    )


def _answer(question: Question, forces: Sequence[tuple[float, str]]) -> str:
    """Say between which curves a force lies; labels need no order for that."""
    wanted = question.force or 0.0
    asked = f"{wanted:.5g} N in {question.stroke} at {question.speed:g} m/s"
    below = max((one for one in forces if one[0] <= wanted), default=None)
    above = min((one for one in forces if one[0] >= wanted), default=None)
    if below is None or above is None:
        force, label = above or below or (math.nan, "")
        return f"{asked}: no curve gives it; the nearest is {label} with {force:.5g} N"
    if below[0] == above[0]:
        return f"{asked}: {below[1]} gives it"
    force, label = min(below, above, key=lambda one: abs(one[0] - wanted))
    return (
        f"{asked}: between {below[1]} with {below[0]:.5g} N and {above[1]} with {above[0]:.5g} N; "
        f"nearest is {label} ({force - wanted:+.3g} N)"
    )


# What a command line names, read as runs to compare: results folders, baselines, logs, curves.

_MARKS = ("run.json", "parameters.parquet", "parameters.csv")


@dataclass(frozen=True, slots=True)
class Pair:
    """What is compared with what.

    Attributes
    ----------
    first : pathlib.Path
        The reference.
    second : pathlib.Path
        The other.
    name : str
        Of the damper, where several pairs are compared.
    """

    first: Path
    second: Path
    name: str = ""


@dataclass(frozen=True, slots=True, eq=False)
class LogRuns:
    """Raw logs among what is compared.

    Attributes
    ----------
    groups : mapping of pathlib.Path to mapping of str to ComparedRun
        By place, and by damper; one without a name where they are of one.
    remarks : tuple of str
        Folders of which no log can be used.
    """

    groups: Mapping[Path, Mapping[str, ComparedRun]] = field(default_factory=dict)
    remarks: tuple[str, ...] = ()

    @property
    def by_place(self) -> dict[Path, ComparedRun]:
        """The same by where each run stands."""
        runs = {place: group[""] for place, group in self.groups.items() if "" in group}
        named = (run for group in self.groups.values() for name, run in group.items() if name)
        return runs | {Path(run.place): run for run in named}


def pairs_of(
    paths: Sequence[Path], logs: LogRuns = LogRuns()
) -> tuple[tuple[Pair, ...], tuple[str, ...]]:
    """Return what is compared with what, and what has no partner, a sentence each.

    A folder that holds results folders stands for them: one alone for all its dampers, the first
    of which is the reference; two or more for the same dampers before and after, paired by name.
    Raw logs of several dampers likewise.

    Parameters
    ----------
    paths : sequence of pathlib.Path
        As the command line names them; the first is the reference.
    logs : LogRuns
        Which of them are raw logs.

    Raises
    ------
    ConfigurationError
        There are fewer than two, a folder holds no results, or no name is in both.
    """
    for path in paths:
        if not path.exists() and path not in logs.groups:
            raise ConfigurationError("no such file or folder", subject=path)
    groups = [_inside(path, logs) for path in paths]
    if len(paths) == 1:
        if len(groups[0]) < 2:
            raise ConfigurationError(
                f"{paths[0]}: one run alone has nothing to be compared with; give a second one, "
                "or a folder that holds several, or {tolerance} with nominal forces",
                tolerance=Option("tolerance", "FILE"),
            )
        first, *others = groups[0].values()
        return tuple(Pair(first, other, other.name) for other in others), ()
    if not any(groups):
        return tuple(Pair(paths[0], other) for other in paths[1:]), ()
    for path, group in zip(paths, groups, strict=True):
        if not group:
            raise ConfigurationError(
                "is one run, and others that were given hold several; give folders of "
                "several dampers, or single runs, not both",
                subject=path,
            )
    return _paired(paths, groups)


def _paired(
    paths: Sequence[Path], groups: Sequence[dict[str, Path]]
) -> tuple[tuple[Pair, ...], tuple[str, ...]]:
    found, lost = [], []
    for path, group in zip(paths[1:], groups[1:], strict=True):
        common = [name for name in groups[0] if name in group]
        found += [Pair(groups[0][name], group[name], name) for name in common]
        for where, names in ((paths[0], groups[0]), (path, group)):
            lost += [f"{name}: only in {where}" for name in names if name not in common]
    if not found:
        said = "; ".join(
            f"{path} holds {', '.join(group)}" for path, group in zip(paths, groups, strict=True)
        )
        raise ConfigurationError(f"no damper is in both: {said}")
    return tuple(found), tuple(dict.fromkeys(lost))


def _inside(path: Path, logs: LogRuns) -> dict[str, Path]:
    """Return the results folders inside a folder that is none itself; of raw logs, the dampers."""
    if path in logs.groups:
        return {name: Path(run.place) for name, run in logs.groups[path].items() if name}
    if not path.is_dir() or _is_run(path):
        return {}
    found = _runs_in(path)
    if not found:
        raise ConfigurationError(_no_results(path))
    return found


def _runs_in(folder: Path) -> dict[str, Path]:
    inside = sorted(folder.iterdir(), key=lambda one: natural_order(one.name))
    return {one.name: one for one in inside if one.is_dir() and _is_run(one)}


def _no_results(folder: Path) -> str:
    """Say what a folder without results holds, and what to do if it is logs."""
    inside = sorted(folder.iterdir(), key=lambda one: natural_order(one.name))
    files = [one.name for one in inside if one.is_file() and not one.name.startswith(".")]
    said = f"{folder}: no results of damperfit identify, and no folder in it holds any"
    if not files:
        return f"{said}; expected run.json and parameters.parquet"
    more = f" and {len(files) - 1} more" if len(files) > 1 else ""
    return (
        f"{said}, but {files[0]}{more}; if these are logs, run damperfit identify on them first, "
        f"or compare them as measured: damperfit compare {folder} OTHER --measured"
    )


def runs_of_logs(places: Sequence[Path], configuration: Configuration, *, jobs: int = 1) -> LogRuns:
    """Return what the raw logs among some places tell, without a fit.

    Parameters
    ----------
    places : sequence of pathlib.Path
        Folders, files, patterns, ``@list.txt``; what is no raw log is left out.
    configuration : Configuration
        How logs are read and conditioned.
    jobs : int
        Threads.

    Raises
    ------
    LogError
        No log of a place can be used.
    ConfigurationError
        A pattern or a list names none.
    """
    groups: dict[Path, dict[str, ComparedRun]] = {}
    remarks: list[str] = []
    for place in dict.fromkeys(places):
        is_file = place.is_file() and not is_baseline(place) and not is_part(place)
        is_folder = place.is_dir() and not _is_run(place) and not _runs_in(place)
        if is_file or is_several_logs(place) or (is_folder and holds_logs(place)):
            groups[place] = read_log_runs(place, configuration, jobs=jobs)
        elif is_folder and (folders := folders_of_logs(place)):
            groups[place] = {}
            for name, folder in folders.items():
                try:
                    found = read_log_runs(folder, configuration, jobs=jobs)
                except LogError as error:
                    remarks.append(str(error))
                    continue
                groups[place] |= {
                    f"{name}/{key}" if key else name: one for key, one in found.items()
                }
            if not groups[place]:
                raise NoUsableLogError(remarks[-1])
    return LogRuns(groups, tuple(remarks))


def holds_runs(path: Path, logs: LogRuns = LogRuns()) -> bool:
    """Whether a path is a folder of results folders, or of the logs of several dampers."""
    return bool(_inside(path, logs))


def _is_run(folder: Path) -> bool:
    return _is_results(folder) or is_part(folder)


def _is_results(folder: Path) -> bool:
    return any((folder / name).is_file() for name in _MARKS)


def read_run(path: Path, *, config: Path | None = None, is_measured: bool = False) -> ComparedRun:
    """Return a run to be compared.

    Parameters
    ----------
    path : pathlib.Path
        Results folder, baseline or a fleet's part.
    config : pathlib.Path, optional
        The damper of results that do not tell theirs.
    is_measured : bool
        Measured curves alone.

    Raises
    ------
    ConfigurationError
        There is nothing of the kind.
    """
    if is_part(path):
        if is_measured:
            raise ConfigurationError(
                "a part of a fleet keeps no measured cycles; give {measured} the logs, or "
                "results of damperfit identify",
                measured=Option("measured"),
                subject=path,
            )
        return _of_run(results.Run.load(path, config=config), (), is_measured=False)
    if path.is_dir():
        return _of_folder(path, config, is_measured=is_measured)
    if not path.is_file():
        raise ConfigurationError("no such file or folder", subject=path)
    if is_baseline(path):
        baseline = read_baseline(path, config=config)
        if not baseline.results.rows("parameters") and not is_measured:
            raise ConfigurationError(
                "a baseline of measured curves, nothing was fitted; give {measured}",
                measured=Option("measured"),
                subject=path,
            )
        return _of_run(baseline.results, baseline.tests, is_measured=is_measured)
    raise ConfigurationError(
        "neither a results folder nor a baseline; to compare logs and files of "
        "curves, give {measured}",
        measured=Option("measured"),
        subject=path,
    )


def _of_folder(folder: Path, config: Path | None, *, is_measured: bool) -> ComparedRun:
    if not _is_results(folder):
        raise ConfigurationError(
            "holds no results of damperfit identify; expected run.json and parameters.parquet",
            subject=folder,
        )
    run = results.Run.load(folder, parts=("parameters", "responses"), config=config)
    return _of_run(run, tuple(_tests(run)), is_measured=is_measured)


def _of_run(run: results.Run, tests: tuple[MeasuredTest, ...], *, is_measured: bool) -> ComparedRun:
    name = run.folder.resolve().name
    if is_measured:
        return _with_tests(ComparedRun(name, str(run.place), None, tests, run.record, run.remarks))
    adjuster = adjuster_of(run)
    return ComparedRun(name, str(run.place), run, tests, run.record, adjuster.remarks)


def _with_tests(run: ComparedRun) -> ComparedRun:
    if not run.tests:
        raise ConfigurationError(
            f"{run.place}: no measured cycles to compare"
            + (f" ({'; '.join(run.remarks)})" if run.remarks else "; no motion in it repeats")
        )
    return run


def _tests(run: results.Run) -> Iterator[MeasuredTest]:
    """Yield the steady motions of all logs of a results folder."""
    known = {
        str(entry.get("log")): entry
        for entry in listed_in(run.record, "inputs")
        if isinstance(entry, dict)
    }
    for signals in run.signals:
        facts = known.get(signals.log, {})
        stretches = [one for one in listed_in(facts, "stretches") if isinstance(one, dict)]
        warmth = number_in(facts, "temperature_degC")
        temperature = math.nan if warmth is None else warmth
        if not stretches and len(signals.time) > 1:  # older results tell one motion a log
            step = float(signals.time[-1] - signals.time[0]) / (len(signals.time) - 1)
            ends = {
                "start_s": float(signals.time[0]),
                "stop_s": float(signals.time[-1]) + step,
            }
            stretches = [{**facts, **ends}]
        yield from measured_tests(signals, stretches, temperature=temperature)


def with_distinct_names(runs: Sequence[ComparedRun]) -> tuple[ComparedRun, ...]:
    """Return the runs with names that differ: where two are alike, with as much of their path."""
    names = [run.name for run in runs]
    if len(set(names)) == len({run.place for run in runs}):
        return tuple(runs)
    return tuple(replace(run, name="/".join(Path(run.place).resolve().parts[-2:])) for run in runs)


# Everything that one call of `compare` compares: which pairs, at what motion, by what measure.


@dataclass(frozen=True, slots=True, eq=False)
class Compared:
    """What was compared.

    Attributes
    ----------
    comparisons : tuple of RunComparison
        One a pair.
    alone : tuple of str
        What has no partner.
    remarks : tuple of str
        What is missing or damaged in the runs, or could not be compared.
    points : tuple of Point
        Forces held against their bands, where a tolerance was given.
    """

    comparisons: tuple[RunComparison, ...]
    alone: tuple[str, ...]
    remarks: tuple[str, ...]
    points: tuple[Point, ...] = ()


def comparison_options(
    *,
    velocities: Sequence[str | float] = (),
    amplitude: str | float | None = None,
    frequency: str | float | None = None,
    is_measured: bool = False,
    jobs: int = 1,
    units: str | None = None,
) -> ComparisonOptions:
    """Return what the texts of a command line ask.

    Raises
    ------
    ConfigurationError
        A quantity cannot be understood, or amplitude and frequency do not go together.
    """
    read = partial(parse_quantity, option="--velocity")
    speeds = sorted({abs(read(text, "velocity")) for text in velocities})
    if speeds and speeds[0] == 0.0:
        raise ConfigurationError("expected a speed other than zero", where=Option("velocity", "0"))
    if (amplitude is None) != (frequency is None):
        raise ConfigurationError(
            "{amplitude} and {frequency} make the sine together; give both or neither",
            amplitude=Option("amplitude"),
            frequency=Option("frequency"),
        )
    sine = None
    if amplitude is not None and frequency is not None:
        if is_measured:
            raise ConfigurationError(
                "{amplitude} cannot be combined with {measured}: measured forces are "
                "of the motions that were run; leave one of the two out",
                amplitude=Option("amplitude", amplitude),
                measured=Option("measured"),
            )
        sine = Sine(
            parse_quantity(amplitude, "length", option="--amplitude"),
            parse_quantity(frequency, "frequency", option="--frequency"),
        )
        for option, value in (("--amplitude", sine.amplitude), ("--frequency", sine.frequency)):
            if value <= 0.0:
                raise ConfigurationError(f"{option} {value:g}: expected more than 0")
    return ComparisonOptions(
        sine, tuple(speeds), is_measured, jobs, SI if units is None else parse_units(units)
    )


def compare_all(
    paths: Sequence[Path],
    options: ComparisonOptions,
    *,
    repeats: Sequence[Path] = (),
    tolerance: Tolerance | None = None,
    config: Path | None = None,
    reading: Configuration | None = None,
) -> Compared:
    """Return every pair compared.

    Parameters
    ----------
    paths : sequence of pathlib.Path
        Runs, or folders of several; the first is the reference.
    options : ComparisonOptions
        What is compared.
    repeats : sequence of pathlib.Path
        Further runs of the reference.
    tolerance : Tolerance, optional
        Bands that the forces are held against; with nominal ones a single run will do.
    config : pathlib.Path, optional
        The damper of results that do not tell theirs.
    reading : Configuration, optional
        How raw logs are read and conditioned; without it as ``config`` says.

    Raises
    ------
    ConfigurationError
        There is nothing to compare.
    LogError
        No log of a run can be used.
    """
    logs = _logs([*paths, *repeats], options, config, reading)
    nominal = tolerance is not None and bool(tolerance.bands)
    is_single = nominal and len(paths) == 1 and not holds_runs(paths[0], logs)
    pairs, alone = ((), ()) if is_single else pairs_of(paths, logs)
    if repeats and len({pair.first for pair in pairs}) > 1:
        raise ConfigurationError(
            "{repeats} are of one reference, and there are several; compare one damper at a time",
            repeats=Option("repeats"),
        )
    _refuse_repeats(repeats, pairs)
    places = list(dict.fromkeys(p for pair in pairs for p in (pair.first, pair.second)))
    places = places or list(paths)
    wanted = [*places, *(one for one in repeats if one not in places)]
    raw = logs.by_place
    found = with_distinct_names(
        [
            raw[place]
            if place in raw
            else read_run(place, config=config, is_measured=options.is_measured)
            for place in wanted
        ]
    )
    called = options.names
    found = tuple(
        replace(run, name=called[place], place=called[place]) if place in called else run
        for place, run in zip(wanted, found, strict=True)
    )
    known: dict[Path, ComparedRun] = dict(zip(wanted, found, strict=True))
    comparisons = tuple(
        compare_runs(
            known[pair.first],
            known[pair.second],
            options,
            repeats=[known[place] for place in repeats],
        )
        for pair in pairs
    )
    remarks = [*logs.remarks]
    remarks += [f"{run.place}: {remark}" for run in found for remark in run.remarks]
    remarks += [f"{one.second.place}: {remark}" for one in comparisons for remark in one.remarks]
    points: tuple[Point, ...] = ()
    if tolerance is not None and nominal:
        held = [known[place] for place in places]
        points = tuple(p for run in held for p in bands_met(run, tolerance, options))
    elif tolerance is not None:
        points = tuple(p for one in comparisons for p in tolerated(one, tolerance))
    return Compared(comparisons, alone, tuple(dict.fromkeys(remarks)), points)


def one_run(
    place: Path,
    options: ComparisonOptions,
    *,
    config: Path | None = None,
    reading: Configuration | None = None,
) -> ComparedRun:
    """Return a single run, to be kept.

    Parameters
    ----------
    place : pathlib.Path
        Results folder, baseline, or raw logs.
    options : ComparisonOptions
        Whether measured curves alone are meant.
    config, reading
        As of `compare_all`.

    Raises
    ------
    ConfigurationError
        There is none, or there are several.
    LogError
        No log can be used.
    """
    logs = _logs([place], options, config, reading)
    named = [name for name in logs.groups.get(place, {}) if name]
    if named:
        raise ConfigurationError(
            f"logs of {len(named)} dampers ({', '.join(named[:3])}"
            f"{', ...' * (len(named) > 3)}); a baseline is of one: give its folder",
            subject=place,
        )
    if place in logs.by_place:
        return logs.by_place[place]
    return read_run(place, config=config, is_measured=options.is_measured)


def _logs(
    places: Sequence[Path],
    options: ComparisonOptions,
    config: Path | None,
    reading: Configuration | None,
) -> LogRuns:
    """Return the raw logs among some places; none where fitted runs are compared."""
    if not options.is_measured:
        return LogRuns()
    return runs_of_logs(places, reading or load_configuration(config), jobs=options.jobs)


def _refuse_repeats(repeats: Sequence[Path], pairs: Sequence[Pair]) -> None:
    """Refuse runs that are no further ones of the reference."""
    taken = {
        one.resolve(): word
        for pair in pairs
        for one, word in ((pair.second, "what is compared with it"), (pair.first, "A itself"))
    }
    seen: set[Path] = set()
    for place in repeats:
        word = taken.get(place.resolve(), "given twice" if place.resolve() in seen else "")
        if word:
            raise ConfigurationError(
                f"is {word}; give further runs of the reference, each once",
                where=Option("repeats", place),
            )
        seen.add(place.resolve())


def parse_bands(text: str | None) -> Tolerance | None:
    """Return the tolerance that the text of a command line means: a file, or per cent and newtons.

    Raises
    ------
    ConfigurationError
        It is neither.
    """
    if text is None:
        return None
    path = Path(text)
    # "2.5%" has a suffix too, as pathlib sees it.
    is_file = path.is_file() or path.suffix[1:2].isalpha()
    return read_bands(path) if is_file else parse_tolerance(text)
