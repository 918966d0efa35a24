"""What one call of `compare` compares: results folders, baselines, raw logs and curves."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from contextlib import suppress
from copy import copy
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from damperfit import __version__
from damperfit.adjustment.force_at import STROKES, Sine
from damperfit.comparison.comparing import ComparisonOptions, RunComparison, compare_runs
from damperfit.comparison.measured import MeasuredTest, measured_tests
from damperfit.comparison.tolerance import Point, Tolerance, bands_met, tolerated
from damperfit.configuration.loading import load_configuration
from damperfit.configuration.options import Configuration
from damperfit.errors import ConfigurationError, DamperfitError, LogError, TimelessError
from damperfit.io import read_curves
from damperfit.io.files import open_regular, read_text
from damperfit.io.force_curves import ForceCurve
from damperfit.problem import Failure, Option, Problem, distinct, warning
from damperfit.queries.settings import positive, refuse_unfitted, speed_in
from damperfit.recording import Trace, natural_order
from damperfit.reporting import compared as shown
from damperfit.reporting.answer import Answer
from damperfit.reporting.records import entries_in
from damperfit.reporting.sheet import Sheet
from damperfit.results import Run
from damperfit.run.log_files import expand
from damperfit.run.logs import LogBatch, Purpose, read_batch
from damperfit.run.preparation import by_damper, folder_name
from damperfit.run.record import log_warnings
from damperfit.store import file_set, write_text
from damperfit.tables.columns import (
    adjusters_in,
    column_names,
    quantities_in,
    read_setting,
    setting_cells,
)
from damperfit.tables.files import LogSignals, finite, is_part, json_values, tests_in, write_table
from damperfit.tested.identity import common_identity
from damperfit.tested.setting import Setting, parse_place
from damperfit.units.shown_units import SI, parse_units

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True, repr=False, eq=False)
class Comparison(Answer):
    """What differs between results, pair by pair, and forces held against bands."""

    comparisons: tuple[RunComparison, ...] = ()  # one a pair
    alone: tuple[Problem, ...] = ()  # what has no partner
    remarks: tuple[Problem, ...] = ()  # what is missing or damaged in the runs, or was not compared
    points: tuple[Point, ...] = ()  # forces held against their bands, where a tolerance was given
    tolerance: str = ""  # as it was given

    def document(self) -> dict[str, Any]:
        """Return all of it as JSON values."""
        return {
            "comparisons": [shown.comparison_record(pair) for pair in self.comparisons],
            "tolerance": self.tolerance or None,
            "points": shown.tolerance_rows(self.points),
            "alone": json_values(self.alone),
            "remarks": json_values(self.remarks),
        }

    @property
    def markdown(self) -> str:
        """The comparison as a page of Markdown."""
        return shown.comparison_markdown(self)

    def write(self, out: Path | None, junit: Path | None) -> None:
        """Write page, Markdown, JSON and tables into a folder; the points as JUnit XML."""
        from damperfit.reporting.page import comparison_page

        if out is not None and (self.comparisons or self.points):
            document = json.dumps(self.document(), indent=2, ensure_ascii=False, allow_nan=False)
            texts = {"html": comparison_page(self), "md": self.markdown, "json": f"{document}\n"}
            tables = {"differences": shown.comparison_table(self.comparisons)}
            if self.points:
                tables["tolerance"] = shown.tolerance_table(self.points)
            with file_set(out) as files:
                for suffix, text in texts.items():
                    content = text.encode("utf-8", "backslashreplace")
                    files.path(f"comparison.{suffix}").write_bytes(content)
                for name, table in tables.items():
                    for suffix in (".csv", ".parquet"):
                        write_table(files.path(name + suffix), table, suffix=suffix)
        if junit is not None:
            with file_set(junit.parent) as files:
                report = shown.junit_report(self.points, source=self.tolerance)
                files.path(junit.name).write_bytes(report)

    @property
    def sentences(self) -> tuple[str, ...]:
        """Verdicts in words."""
        return tuple(line for pair in self.comparisons for line in pair.sentences)

    @property
    def sentence(self) -> str:  # type: ignore[override]
        """The verdicts, a line each."""
        return "\n".join(self.sentences)

    @property
    def is_met(self) -> bool:
        """Whether every force is within its band, where a tolerance was given."""
        return all(point.is_met for point in self.points)

    def to_frame(self) -> pd.DataFrame:
        """Return one row a difference: values of both, interval of the difference, verdict."""
        frame: pd.DataFrame = shown.comparison_table(self.comparisons).to_pandas()
        return frame

    def sheets(self) -> tuple[Sheet, ...]:
        """Return the forces of each pair."""
        return tuple(shown.comparison_force_sheet(pair) for pair in self.comparisons)


def comparison_options(given: Mapping[str, Any]) -> ComparisonOptions:
    """Return the options that the keywords of `compare` give."""
    speeds = sorted({abs(speed_in(velocity)) for velocity in given["velocity"] or ()})
    amplitude, frequency, units = (given[name] for name in ("amplitude", "frequency", "units"))
    if (amplitude is None) != (frequency is None):
        text = "{--amplitude} and {--frequency} make the sine together; give both or neither"
        raise ConfigurationError(text, code="not-together")
    if amplitude is not None and given["measured"]:
        text = (
            "{where} cannot be combined with {--measured}: measured forces are of the motions that "
            "were run; leave one of the two out"
        )
        where = Option("amplitude", amplitude)
        raise ConfigurationError(text, code="not-together", where=where)
    size = positive(amplitude, "length", "amplitude")
    rate = positive(frequency, "frequency", "frequency")
    sine = Sine(size, rate) if size and rate else None
    shown_units = SI if units is None else parse_units(units)
    return ComparisonOptions(sine, tuple(speeds), given["measured"], given["jobs"], shown_units)


def compare_all(  # noqa: PLR0913 - one more for the baseline that is saved on the way
    paths: Sequence[Path],
    options: ComparisonOptions,
    *,
    unsaved: Mapping[Path, Run],
    repeats: Sequence[Path] = (),
    tolerance: Tolerance | None = None,
    config: Path | None = None,
    reading: Configuration | None = None,
    save: Path | None = None,
) -> Comparison:
    """Return every pair compared; with ``save`` the first run is written as a baseline.

    ``unsaved`` are runs that are in no folder, by their names in ``paths``.
    """
    places = _Places([*paths, *repeats], options, config, reading, unsaved)
    if save is not None:
        write_text(save, baseline_text(places.only(paths[0]), is_measured=options.is_measured))
        if len(paths) == 1 and tolerance is None:
            return Comparison()
    nominal = tolerance if tolerance is not None and tolerance.bands else None
    is_single = nominal is not None and len(paths) == 1 and not places.inside(paths[0])
    pairs, alone = ([], ()) if is_single else places.pairs(paths)
    if repeats and len({first for first, _ in pairs}) > 1:
        text = "{--repeats} are of one reference, and there are several: compare one damper of them"
        raise ConfigurationError(text, code="several-results")
    roles = {second.resolve(): "what is compared with it" for _, second in pairs}
    roles |= {first.resolve(): "A itself" for first, _ in pairs}
    for place in repeats:
        if role := roles.get(place.resolve()):
            raise ConfigurationError(
                f"is {role}; give further runs of the reference, each once",
                where=Option("repeats", place),
                code="given-twice",
            )
        roles[place.resolve()] = "given twice"
    compared = list(dict.fromkeys(chain.from_iterable(pairs))) or list(paths)
    runs = {place: places.run(place) for place in dict.fromkeys([*compared, *repeats])}
    if len({run.name for run in runs.values()}) < len({run.shown_as for run in runs.values()}):
        for place, run in runs.items():  # two have one name: as much of their path
            if place not in unsaved:
                run.name = "/".join(Path(run.shown_as).resolve().parts[-2:])
    comparisons = tuple(
        compare_runs(runs[a], runs[b], options, repeats=[runs[place] for place in repeats])
        for a, b in pairs
    )
    remarks = [*places.remarks]
    for run in runs.values():
        problems = run.remarks if options.is_measured else (*run.remarks, *run.remarks_on_errors)
        remarks += [problem.of(run.shown_as) for problem in problems]
    for pair in comparisons:
        remarks += [problem.of(pair.second.shown_as) for problem in pair.remarks]
    points: list[Point] = []
    if nominal is not None:
        points = [p for place in compared for p in bands_met(runs[place], nominal, options)]
    elif tolerance is not None:
        points = [p for pair in comparisons for p in tolerated(pair, tolerance)]
    source = tolerance.source if tolerance else ""
    return Comparison(comparisons, alone, distinct(remarks), tuple(points), source)


# What a command line names: which runs, and which pairs of them


class _Places:
    """The runs in some places: raw logs, where measured curves are compared, or results."""

    def __init__(
        self,
        places: Sequence[Path],
        options: ComparisonOptions,
        config: Path | None,
        reading: Configuration | None,
        unsaved: Mapping[Path, Run],
    ) -> None:
        self.config, self.is_measured = config, options.is_measured
        self.groups: dict[Path, dict[str, Path]] = {}  # runs of logs by damper; none: of one
        self.remarks: list[Problem] = []  # folders of which no log can be used
        self._runs: dict[Path, Run] = {}
        for place, run in unsaved.items():
            loaded = _comparable(Run.load(copy(run), config=config), is_measured=self.is_measured)
            loaded.name = loaded.shown_as = str(place)
            self._runs[place], self.groups[place] = loaded, {}
        if options.is_measured:
            configuration = reading or load_configuration(config)
            for place in dict.fromkeys(path for path in places if path not in unsaved):
                self._read(place, configuration, options.jobs)

    def _read(self, place: Path, configuration: Configuration, jobs: int) -> None:
        """Read the raw logs that a place names; those of a folder of folders, each by itself."""
        folders = [place]
        if place.is_dir():
            if _is_run(place) or _runs_in(place):
                return
            if not _holds_logs(place):
                folders = [folder for folder in _listed(place) if _holds_logs(folder)]
        elif place.is_file():
            if is_baseline(place) or is_part(place):
                return
        elif str(place)[0] != "@" and not set("*?[") & set(str(place)):
            return  # no pattern and no list of logs
        runs: dict[str, Run] = {}
        for folder in folders:
            try:
                of_folder = read_log_runs(folder, configuration, jobs=jobs)
            except LogError as error:
                if folder == place:
                    raise
                self.remarks.append(error.problem)
                continue
            prefix = "" if folder == place else folder.name
            runs |= {"/".join(filter(None, (prefix, name))): run for name, run in of_folder.items()}
        if folders and not runs:
            raise NoUsableLogError(str(self.remarks[-1]))
        if runs:
            self.groups[place] = {name: Path(run.shown_as) for name, run in runs.items() if name}
            self._runs |= {self.groups[place].get(name, place): run for name, run in runs.items()}

    def run(self, place: Path) -> Run:
        """Return the run in a place."""
        run = self._runs.get(place)
        return run or read_run(place, config=self.config, is_measured=self.is_measured)

    def only(self, place: Path) -> Run:
        """Return the run in a place that holds no other."""
        if dampers := list(self.groups.get(place, {})):
            raise ConfigurationError(
                f"logs of {len(dampers)} dampers ({', '.join(dampers[:3])}"
                f"{', ...' * (len(dampers) > 3)}); a baseline is of one: give its folder",
                subject=place,
                code="several-dampers",
            )
        return self.run(place)

    def pairs(self, paths: Sequence[Path]) -> tuple[list[tuple[Path, Path]], tuple[Problem, ...]]:
        """Return the pairs that are compared, and what has no partner.

        A folder that holds results folders stands for them: one alone for all its dampers, the
        first of which is the reference; two or more for the same dampers before and after, paired
        by name. Raw logs of several dampers likewise.
        """
        for path in paths:
            if not path.exists() and path not in self.groups:
                text = "no such file or folder"
                raise ConfigurationError(text, subject=path, code="no-such-file")
        groups = [self.inside(path) for path in paths]
        if len(paths) == 1:
            if len(groups[0]) < 2:
                text = (
                    "one run alone has nothing to be compared with; give a second one, or a folder "
                    "that holds several, or {--tolerance FILE} with nominal forces"
                )
                raise ConfigurationError(text, subject=paths[0], code="one-run")
            first, *others = groups[0].values()
            return [(first, other) for other in others], ()
        if not any(groups):
            return [(paths[0], other) for other in paths[1:]], ()
        if not all(groups):
            raise ConfigurationError(
                "is one run, and others that were given hold several; give folders of "
                "several dampers, or single runs, not both",
                subject=paths[[bool(group) for group in groups].index(False)],
                code="several-results",
            )
        pairs, alone = [], []
        for path, group in zip(paths[1:], groups[1:], strict=True):
            common = [name for name in groups[0] if name in group]
            pairs += [(groups[0][name], group[name]) for name in common]
            for place, names in ((paths[0], groups[0]), (path, group)):
                alone += [
                    warning("no-partner", "only in {place}", name, place=place)
                    for name in names
                    if name not in common
                ]
        if not pairs:
            by_path = zip(paths, groups, strict=True)
            listed = "; ".join(f"{path} holds {', '.join(group)}" for path, group in by_path)
            raise ConfigurationError(f"no damper is in both: {listed}", code="no-pair")
        return pairs, distinct(alone)

    def inside(self, path: Path) -> Mapping[str, Path]:
        """Return the results folders inside a folder that is none; of raw logs, the dampers."""
        if path in self.groups:
            return self.groups[path]
        if not path.is_dir() or _is_run(path):
            return {}
        if runs := _runs_in(path):
            return runs
        files = [entry.name for entry in _listed(path) if entry.is_file()]
        if baselines := [name for name in files if is_baseline(path / name)]:
            raise ConfigurationError(
                f"{path}: {baselines[0]} in it is a baseline or passport: give the file, "
                f"{path / baselines[0]}",
                code="baseline",
            )
        advice = "; expected run.json and parameters.parquet"
        if files:
            count = f" and {len(files) - 1} more" if len(files) > 1 else ""
            advice = (
                f", but {files[0]}{count}; if these are logs, run damperfit identify on them "
                f"first, or compare them as measured: damperfit compare {path} OTHER --measured"
            )
        raise ConfigurationError(
            f"{path}: no results of damperfit identify, and no folder in it holds any{advice}",
            code="no-results",
        )


def _listed(folder: Path) -> list[Path]:
    visible = (entry for entry in folder.iterdir() if entry.name[0] != ".")
    return sorted(visible, key=lambda entry: natural_order(entry.name))


def _is_run(folder: Path) -> bool:
    """Whether a folder holds results of `identify`, or a part of a fleet."""
    marks = ("run.json", "parameters.parquet", "parameters.csv")
    return is_part(folder) or any((folder / name).is_file() for name in marks)


def _runs_in(folder: Path) -> dict[str, Path]:
    runs: dict[str, Path] = {}
    for entry in (entry for entry in _listed(folder) if entry.is_dir() and _is_run(entry)):
        tests = tests_in(entry)
        parts = {f"{entry.name}, {date}": part for date, part in tests.items()}
        runs |= parts if len(tests) > 1 else {entry.name: entry}
    return runs


def _holds_logs(folder: Path) -> bool:
    """Whether there are logs in a folder, not below it."""
    with suppress(DamperfitError):
        return folder.is_dir() and bool(expand([str(folder)]))
    return False


def read_run(path: Path, *, config: Path | None = None, is_measured: bool = False) -> Run:
    """Return a run to be compared: results, a baseline or a part; or measured curves alone."""

    def refused(text: str) -> ConfigurationError:
        return ConfigurationError(text, subject=path, code="no-results")

    if is_baseline(path):
        run = _read_baseline(path, config)
        if not run.rows("parameters") and not is_measured:
            raise refused("a baseline of measured curves, nothing was fitted; give {--measured}")
    elif is_part(path) and is_measured:
        raise refused(
            "a part of a fleet keeps no measured cycles; give {--measured} the logs, or results of "
            "damperfit identify"
        )
    elif path.is_file() and not is_part(path):
        raise refused(
            "neither a results folder nor a baseline; to compare logs and files of curves, give "
            "{--measured}"
        )
    else:
        run = Run.load(path, parts=("parameters", "responses"), config=config)
    return _comparable(run, is_measured=is_measured)


def _comparable(run: Run, *, is_measured: bool) -> Run:
    """Return a run that holds what is compared."""
    if not is_measured:
        return refuse_unfitted(run)
    if not run.tests:
        reason = (
            f" ({'; '.join(map(str, run.remarks))})" if run.remarks else "; no motion in it repeats"
        )
        raise ConfigurationError(
            f"{run.shown_as}: no measured cycles to compare{reason}", code="not-measured"
        )
    return run


# A run kept as one JSON file, to be the reference of later comparisons

_KEY, _VERSION = "damperfit_baseline", 1
# Keys of run.json that are compared, or name what is compared.
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


def baseline_text(run: Run, *, is_measured: bool = False) -> str:
    """Return a run as the text of a baseline; of measured curves alone without parameters."""

    def rounded(values: Any) -> list[float | None]:  # to as many digits as 32-bit floats have
        return [float(f"{x:.7g}") if math.isfinite(x) else None for x in values.tolist()]

    document = {
        _KEY: _VERSION,
        "version": __version__,
        "source": run.name,
        "record": compared_record(run.record),
        # The columns of adjusters are those that follow the setting.
        "parameters": [] if is_measured else run.table("parameters").to_pylist(),
        "tests": [
            {
                "setting": setting_cells(test.setting, is_whole=isinstance(test.setting.cell, int)),
                "log": test.log,
                "n_cycles": test.n_cycles,
                **{name: finite(getattr(test, name)) for name in _NUMBERS},
                **{name: rounded(getattr(test, name)) for name in _ARRAYS},
                "strokes": {k: [rounded(row) for row in rows] for k, rows in test.strokes.items()},
                "figures": {k: list(map(finite, pair)) for k, pair in test.figures.items()},
            }
            for test in run.tests
        ],
    }
    return json.dumps(json_values(document), indent=1, allow_nan=False) + "\n"


def compared_record(record: Mapping[str, Any]) -> dict[str, Any]:
    """Return what of run.json is compared, or says what is compared."""
    logs = entries_in(record, "inputs")
    inputs = [{key: log[key] for key in _OF_INPUTS if key in log} for log in logs]
    return {key: record[key] for key in _KEPT if key in record} | {"inputs": inputs}


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
        tests = tuple(map(_kept_test, document["tests"]))
    except (OSError, ArithmeticError, ValueError, TypeError, LookupError, AttributeError) as error:
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
    cells = record["setting"]
    adjusters = [name for name in cells if name != "setting" and name not in column_names()]
    n, k = len(record["force"]), len(record["speeds"])
    pairs = record["figures"]

    def array(values: Any, *shape: int) -> Any:  # None is not known
        numbers = np.array(values, dtype=np.float64)
        if numbers.shape != shape:
            raise ValueError(f"numbers of shape {numbers.shape}, expected {shape}")
        return numbers

    return MeasuredTest(
        setting=read_setting(cells, adjusters) or Setting.of(0),
        log=str(record["log"]),
        n_cycles=int(record["n_cycles"]),
        **{name: float(array(record[name])) for name in _NUMBERS},
        displacement=array(record["displacement"], n if record["displacement"] else 0),
        velocity=array(record["velocity"], n),
        force=array(record["force"], n),
        speeds=array(record["speeds"], k),
        strokes={name: array(rows, 2, k) for name, rows in record["strokes"].items()},
        figures={name: tuple(array(pair, 2).tolist()) for name, pair in pairs.items()},
    )


# Raw logs, without a fit: a folder, pattern or list of them is one run, or one a damper

_NAMELESS = Setting.of("as tested")  # of what says none


class NoUsableLogError(LogError):
    """None of the logs of a run can be used."""

    exit_code = 3


def read_log_runs(place: Path, configuration: Configuration, *, jobs: int = 1) -> dict[str, Run]:
    """Return raw logs as runs, by damper; one run without a name where they are of one.

    A log that cannot be used costs itself: the run's remarks say so.
    """
    batch = read_batch(expand([str(place)]), configuration, jobs=jobs, purpose=Purpose.COMPARE)
    groups = by_damper(batch)
    if len(groups) == 1:
        return {"": _of_logs(place, next(iter(groups.values())), configuration)}
    return {
        damper: _of_logs(place / folder_name(damper), logs, configuration)
        for damper, logs in groups.items()
    }


def _of_logs(place: Path, batch: LogBatch, configuration: Configuration) -> Run:
    timeless = [failure for failure in batch.failures if failure.kind == TimelessError.__name__]
    problems = [failure.problem for failure in batch.failures if failure not in timeless]
    findings = (*batch.notes, *batch.skipped_files, *batch.remarks, *log_warnings(batch.traces))
    notes = list(map(str, findings))
    tests: list[MeasuredTest] = []
    for trace in batch.traces:
        measured = _of_trace(trace)
        tests += measured
        if not measured:
            text = "no measured cycles to compare; no motion in it repeats"
            problems.append(warning("not-measured", text, trace.name))
    for failure in timeless:
        try:
            curves = read_curves(Path(failure.path), configuration.reading)
        except ConfigurationError:
            raise
        except DamperfitError as error:
            problems.append(error.problem)
            continue
        tests += [_of_curve(curve, None if place.is_file() else failure) for curve in curves]
        notes += [f"{failure.log}: {note}" for note in curves[0].notes]
    # Among logs that say their setting, one that does not is ambiguous.
    if labelled := [test for test in tests if test.setting != _NAMELESS]:
        text = (
            "does not say its adjuster setting, and others do; give it a line '# setting: 10', a "
            "column 'setting', a name such as setting_10.csv or a row in tests.csv"
        )
        problems += [
            warning("no-setting", text, log)
            for log in dict.fromkeys(test.log for test in tests if test.setting == _NAMELESS)
        ]
        tests = labelled
    if not tests:
        count = f" (and {len(problems) - 1} more)" if len(problems) > 1 else ""
        reason = str(problems[0]) if problems else "no log that is not damperfit's own"
        source = "" if place.is_file() else f"{place}: none of its logs can be used: "
        raise NoUsableLogError(f"{source}{reason}{count}")
    if not place.is_file() and not labelled:
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
    run = Run(record, {"parameters": ()}, place=place, remarks=problems)
    run.tests = tuple(tests)
    return run


def _of_trace(trace: Trace) -> tuple[MeasuredTest, ...]:
    time = trace.start_time + trace.interval * np.arange(len(trace.force), dtype=np.float64)
    signals = LogSignals(
        *(trace.setting or _NAMELESS, trace.name, time),
        *(trace.displacement, trace.velocity, trace.force),
        *(np.empty(0), np.empty((3, 0))),  # no model: no force, no pressures
    )
    mean = math.nan if trace.temperature is None else trace.temperature
    segments = [segment.describe(trace) for segment in trace.segments]
    return measured_tests(signals, segments, temperature=mean)


def _of_curve(curve: ForceCurve, failure: Failure | None) -> MeasuredTest:
    """Return a curve without time as a test without a motion: no errors are known."""
    speeds = np.unique(np.abs(curve.velocity[curve.velocity != 0.0]))
    setting = (failure.setting if failure is not None else None) or _NAMELESS
    if curve.label not in {curve.name, Path(curve.name).stem}:  # one of several in its file
        try:
            setting = Setting.of(parse_place(curve.label))
        except ValueError:
            setting = Setting.of(curve.label)
    forces = {side: [curve.force_at(v, side) for v in speeds.tolist()] for side in STROKES}
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
        strokes={side: np.array([row, [math.nan] * len(row)]) for side, row in forces.items()},
    )
