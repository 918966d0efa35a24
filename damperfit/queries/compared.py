"""What one call of `compare` compares: results folders, baselines, raw logs and curves."""

from __future__ import annotations

import math
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import chain
from json import dumps
from pathlib import Path
from typing import TYPE_CHECKING, Any

from damperfit.adjustment.force_at import STROKE_WORDS, STROKES, Sine
from damperfit.comparison import ComparisonOptions, bands_met, compare_runs, tolerated
from damperfit.configuration.loading import load_configuration
from damperfit.errors import ConfigurationError, DamperfitError, LogError
from damperfit.io import read_curves
from damperfit.problem import Option
from damperfit.queries.compared_runs import (
    NoUsableLogError,
    is_baseline,
    is_results,
    name_apart,
    read_log_runs,
    read_run,
)
from damperfit.queries.settings import positive
from damperfit.recording import natural_order
from damperfit.reporting import compared as shown
from damperfit.reporting.answer import Answer
from damperfit.reporting.inspection import curve_forces_sheet
from damperfit.reporting.records import to_record
from damperfit.run.log_files import expand
from damperfit.simulation import NAMED_SPEEDS
from damperfit.store import file_set
from damperfit.tables.files import json_values, write_table
from damperfit.tables.reading import is_part
from damperfit.units.quantities import parse_quantity
from damperfit.units.shown_units import SI, parse_units

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    import pandas as pd
    import pyarrow as pa

    from damperfit.comparison import Point, RunComparison, Tolerance
    from damperfit.configuration.options import Configuration
    from damperfit.io import ReadOptions
    from damperfit.io.force_curves import ForceCurve
    from damperfit.queries.settings import Question
    from damperfit.reporting.sheet import Sheet
    from damperfit.results import Run


# Everything that one call of `compare` compares: which pairs, at what motion, by what measure


@dataclass(frozen=True, repr=False, eq=False)
class Comparison(Answer):
    """What differs between results, pair by pair, and forces held against bands."""

    comparisons: tuple[RunComparison, ...] = ()  # one a pair
    alone: tuple[str, ...] = ()  # what has no partner
    remarks: tuple[str, ...] = ()  # what is missing or damaged in the runs, or was not compared
    points: tuple[Point, ...] = ()  # forces held against their bands, where a tolerance was given
    tolerance: str = ""  # as it was given

    def document(self) -> dict[str, Any]:
        """Return all of it as JSON values."""
        return {
            "comparisons": [shown.comparison_record(one) for one in self.comparisons],
            "tolerance": self.tolerance or None,
            "points": shown.tolerance_rows(self.points),
            "alone": list(self.alone),
            "remarks": list(self.remarks),
        }

    @property
    def markdown(self) -> str:
        """The comparison as a page of Markdown."""
        return self._told_by(shown.comparison_markdown)

    def _told_by(self, outlet: Callable[..., str]) -> str:
        return outlet(self.comparisons, self.points, source=self.tolerance, alone=self.alone)

    def write(self, out: Path | None, junit: Path | None) -> None:
        """Write page, Markdown, JSON and tables into a folder; the points as JUnit XML."""
        from damperfit.reporting.page import comparison_page

        if out is not None:
            text = dumps(self.document(), indent=2, ensure_ascii=False, allow_nan=False) + "\n"
            texts = {"html": self._told_by(comparison_page), "md": self.markdown, "json": text}
            tables = {"differences": self._table()}
            if self.points:
                tables["tolerance"] = shown.tolerance_table(shown.tolerance_rows(self.points))
            with file_set(out) as files:
                for suffix, one in texts.items():
                    path = files.path(f"comparison.{suffix}")
                    path.write_bytes(one.encode("utf-8", "backslashreplace"))
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
        return tuple(line for one in self.comparisons for line in one.sentences)

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
        frame: pd.DataFrame = self._table().to_pandas()
        return frame

    def _table(self) -> pa.Table:
        rows = [row for one in self.comparisons for row in shown.comparison_rows(one)]
        return shown.comparison_table(rows)

    def sheets(self) -> tuple[Sheet, ...]:
        """Return the forces of each pair."""
        return tuple(shown.comparison_force_sheet(one) for one in self.comparisons)


def comparison_options(
    *,
    velocities: Sequence[str | float] = (),
    amplitude: str | float | None = None,
    frequency: str | float | None = None,
    is_measured: bool = False,
    jobs: int = 1,
    units: str | None = None,
) -> ComparisonOptions:
    """Return what the texts of a command line ask."""
    speeds = sorted({abs(parse_quantity(v, "velocity", option="--velocity")) for v in velocities})
    if speeds and speeds[0] == 0.0:
        raise ConfigurationError(
            "expected a speed other than zero", where=Option("velocity", "0"), code="out-of-range"
        )
    if (amplitude is None) != (frequency is None):
        raise ConfigurationError(
            "{amplitude} and {frequency} make the sine together; give both or neither",
            amplitude=Option("amplitude"),
            frequency=Option("frequency"),
            code="not-together",
        )
    if amplitude is not None and is_measured:
        raise ConfigurationError(
            "{amplitude} cannot be combined with {measured}: measured forces are "
            "of the motions that were run; leave one of the two out",
            amplitude=Option("amplitude", amplitude),
            measured=Option("measured"),
            code="not-together",
        )
    size = positive(amplitude, "length", "amplitude")
    rate = positive(frequency, "frequency", "frequency")
    sine = Sine(size, rate) if size and rate else None
    wanted = SI if units is None else parse_units(units)
    return ComparisonOptions(sine, tuple(speeds), is_measured, jobs, wanted)


def compare_all(
    paths: Sequence[Path],
    options: ComparisonOptions,
    *,
    repeats: Sequence[Path] = (),
    tolerance: Tolerance | None = None,
    config: Path | None = None,
    reading: Configuration | None = None,
) -> Comparison:
    """Return every pair compared."""
    logs = _LogRuns([*paths, *repeats], options, config, reading)
    nominal = tolerance is not None and bool(tolerance.bands)
    is_single = nominal and len(paths) == 1 and not _inside(paths[0], logs)
    pairs, alone = ([], ()) if is_single else _pairs_of(paths, logs)
    if repeats and len({first for first, _ in pairs}) > 1:
        raise ConfigurationError(
            "{repeats} are of one reference, and there are several; compare one damper at a time",
            repeats=Option("repeats"),
            code="several-results",
        )
    taken = {second.resolve(): "what is compared with it" for _, second in pairs}
    taken |= {first.resolve(): "A itself" for first, _ in pairs}
    for place in repeats:
        if word := taken.setdefault(place.resolve(), ""):
            raise ConfigurationError(
                f"is {word}; give further runs of the reference, each once",
                where=Option("repeats", place),
                code="given-twice",
            )
        taken[place.resolve()] = "given twice"
    places = list(dict.fromkeys(chain.from_iterable(pairs))) or list(paths)
    known = {
        place: logs.by_place.get(place)
        or read_run(place, config=config, is_measured=options.is_measured)
        for place in dict.fromkeys([*places, *repeats])
    }
    name_apart(list(known.values()))
    for place, name in options.names.items():
        if place in known:
            known[place].name = known[place].shown_as = name
    comparisons = tuple(
        compare_runs(known[a], known[b], options, repeats=[known[place] for place in repeats])
        for a, b in pairs
    )
    remarks = [*logs.remarks]
    for run in known.values():
        own = run.remarks if options.is_measured else (*run.remarks, *run.remarks_on_errors)
        remarks += [f"{run.shown_as}: {remark}" for remark in own]
    remarks += [f"{one.second.shown_as}: {remark}" for one in comparisons for remark in one.remarks]
    points: list[Point] = []
    if tolerance is not None and nominal:
        points = [p for place in places for p in bands_met(known[place], tolerance, options)]
    elif tolerance is not None:
        points = [p for one in comparisons for p in tolerated(one, tolerance)]
    told = tuple(dict.fromkeys(remarks))
    return Comparison(
        comparisons, alone, told, tuple(points), tolerance.source if tolerance else ""
    )


def one_run(
    place: Path,
    options: ComparisonOptions,
    *,
    config: Path | None = None,
    reading: Configuration | None = None,
) -> Run:
    """Return a single run, to be kept; arguments as of `compare_all`."""
    logs = _LogRuns([place], options, config, reading)
    named = [name for name in logs.groups.get(place, {}) if name]
    if named:
        raise ConfigurationError(
            f"logs of {len(named)} dampers ({', '.join(named[:3])}"
            f"{', ...' * (len(named) > 3)}); a baseline is of one: give its folder",
            subject=place,
            code="several-dampers",
        )
    known = logs.by_place.get(place)
    return known or read_run(place, config=config, is_measured=options.is_measured)


# What a command line names: which runs, and which pairs of them


class _LogRuns:
    """Raw logs among some places: runs by place and damper, "" where they are of one.

    None where fitted runs are compared; remarks tell folders of which no log can be used.
    """

    def __init__(
        self,
        places: Sequence[Path],
        options: ComparisonOptions,
        config: Path | None,
        reading: Configuration | None,
    ) -> None:
        self.groups: dict[Path, dict[str, Run]] = {}
        self.remarks: list[str] = []
        if options.is_measured:
            configuration = reading or load_configuration(config)
            for place in dict.fromkeys(places):
                self._read(place, configuration, options.jobs)
        self.by_place = {
            Path(run.shown_as) if name else place: run
            for place, group in self.groups.items()
            for name, run in group.items()
        }

    def _read(self, place: Path, configuration: Configuration, jobs: int) -> None:
        is_file = place.is_file() and not is_baseline(place) and not is_part(place)
        is_folder = place.is_dir() and not _is_run(place) and not _runs_in(place)
        # A pattern or a list of logs is no file or folder of this name.
        is_several = not place.exists() and (str(place)[0] == "@" or set("*?[") & set(str(place)))
        if is_file or is_several or (is_folder and _holds_logs(place)):
            self.groups[place] = read_log_runs(place, configuration, jobs=jobs)
            return
        folders = [one for one in _listed(place) if _holds_logs(one)] if is_folder else []
        for folder in folders:
            group = self.groups.setdefault(place, {})
            try:
                found = read_log_runs(folder, configuration, jobs=jobs)
            except LogError as error:
                self.remarks.append(str(error))
                continue
            names = {key: f"{folder.name}/{key}" if key else folder.name for key in found}
            group |= {names[key]: one for key, one in found.items()}
        if folders and not self.groups[place]:
            raise NoUsableLogError(self.remarks[-1])


def _pairs_of(
    paths: Sequence[Path], logs: _LogRuns
) -> tuple[list[tuple[Path, Path]], tuple[str, ...]]:
    """Return what is compared with what, and what has no partner, a sentence each.

    A folder that holds results folders stands for them: one alone for all its dampers, the first
    of which is the reference; two or more for the same dampers before and after, paired by name.
    Raw logs of several dampers likewise.
    """
    for path in paths:
        if not path.exists() and path not in logs.groups:
            raise ConfigurationError("no such file or folder", subject=path, code="no-such-file")
    groups = [_inside(path, logs) for path in paths]
    if len(paths) == 1:
        if len(groups[0]) < 2:
            raise ConfigurationError(
                f"{paths[0]}: one run alone has nothing to be compared with; give a second one, "
                "or a folder that holds several, or {tolerance} with nominal forces",
                tolerance=Option("tolerance", "FILE"),
                code="one-run",
            )
        first, *others = groups[0].values()
        return [(first, other) for other in others], ()
    if not any(groups):
        return [(paths[0], other) for other in paths[1:]], ()
    for path, group in zip(paths, groups, strict=True):
        if not group:
            raise ConfigurationError(
                "is one run, and others that were given hold several; give folders of "
                "several dampers, or single runs, not both",
                subject=path,
                code="several-results",
            )
    pairs, alone = [], []
    for path, group in zip(paths[1:], groups[1:], strict=True):
        common = [name for name in groups[0] if name in group]
        pairs += [(groups[0][name], group[name]) for name in common]
        for where, names in ((paths[0], groups[0]), (path, group)):
            alone += [f"{name}: only in {where}" for name in names if name not in common]
    if not pairs:
        named = zip(paths, groups, strict=True)
        held = "; ".join(f"{path} holds {', '.join(group)}" for path, group in named)
        raise ConfigurationError(f"no damper is in both: {held}", code="no-pair")
    return pairs, tuple(dict.fromkeys(alone))


def _inside(path: Path, logs: _LogRuns) -> Mapping[str, Path]:
    """Return the results folders inside a folder that is none itself; of raw logs, the dampers."""
    if path in logs.groups:
        return {name: Path(run.shown_as) for name, run in logs.groups[path].items() if name}
    if not path.is_dir() or _is_run(path):
        return {}
    if found := _runs_in(path):
        return found
    files = [one.name for one in _listed(path) if one.is_file()]
    for name in files:
        if is_baseline(path / name):
            raise ConfigurationError(
                f"{path}: {name} in it is a baseline or passport: give the file, {path / name}",
                code="baseline",
            )
    sentence = f"{path}: no results of damperfit identify, and no folder in it holds any"
    if not files:
        raise ConfigurationError(
            f"{sentence}; expected run.json and parameters.parquet", code="no-results"
        )
    more = f" and {len(files) - 1} more" if len(files) > 1 else ""
    raise ConfigurationError(
        f"{sentence}, but {files[0]}{more}; if these are logs, run damperfit identify on them "
        f"first, or compare them as measured: damperfit compare {path} OTHER --measured",
        code="no-results",
    )


def _listed(folder: Path) -> list[Path]:
    visible = (one for one in folder.iterdir() if one.name[0] != ".")
    return sorted(visible, key=lambda one: natural_order(one.name))


def _is_run(folder: Path) -> bool:
    return is_results(folder) or is_part(folder)


def _runs_in(folder: Path) -> dict[str, Path]:
    return {one.name: one for one in _listed(folder) if one.is_dir() and _is_run(one)}


def _holds_logs(folder: Path) -> bool:
    """Whether there are logs in a folder, not below it."""
    with suppress(DamperfitError):
        return folder.is_dir() and bool(expand([str(folder)]))
    return False


# Curves that were measured without time, asked for forces: by curve, and which gives a force


@dataclass(frozen=True, repr=False, eq=False)
class CurveForces(Answer):
    """Forces of measured curves at some speeds, and the answer where one is asked."""

    paths: tuple[Path, ...]
    question: Question
    curves: tuple[ForceCurve, ...]  # as the files have them
    speeds: tuple[float, ...]  # m/s, positive
    sentence: str  # which curve gives the wanted force; empty where none was asked for

    @property
    def notes(self) -> tuple[str, ...]:
        """What to know of the curves."""
        return tuple(dict.fromkeys(note for one in self.curves for note in one.notes))

    def document(self) -> dict[str, Any]:
        """Return the forces by curve, stroke and speed that were reached, as JSON values."""
        asked = self.question
        document: dict[str, Any] = json_values(
            {
                "source": ", ".join(map(str, self.paths)),
                "question": None if asked.force is None else to_record(asked),
                "sentence": self.sentence or None,
                "forces": [
                    {"curve": one.label, "stroke": side, "speed_m_per_s": speed, "force_N": force}
                    for one in self.curves
                    for side in STROKES
                    for speed in self.speeds
                    if math.isfinite(force := one.force_at(speed, side))
                ],
            }
        )
        return document

    def to_frame(self) -> pd.DataFrame:
        """Return a row a curve, stroke and speed."""
        import pandas as pd

        return pd.DataFrame(self.document()["forces"])

    def sheets(self) -> tuple[Sheet, ...]:
        """Return the forces of the fastest speeds by curve."""
        return (curve_forces_sheet(self.curves, self.speeds[-5:]),)


def measured_forces(
    paths: Sequence[Path], question: Question, *, reading: ReadOptions
) -> CurveForces:
    """Return what the curves of some files, without time, say of a question."""
    read = [curve for path in paths for curve in read_curves(path, reading)]
    files: dict[str, set[str]] = {}
    for one in read:
        files.setdefault(one.label, set()).add(one.path)
    curves = tuple(  # the file's name before labels that several files use
        replace(one, label=f"{one.name} {one.label}") if len(files[one.label]) > 1 else one
        for one in read
    )
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
        side = f" in {STROKE_WORDS[question.stroke]}" if question.stroke else ""
        names = ", ".join(path.name for path in paths)
        raise ConfigurationError(
            f"no curve of {names} has points on both sides of it{side}; the highest "
            f"measured speed is {max(tops, default=0.0):.3g} m/s",
            subject=at,
            code="no-speed",
        )
    sentence = "" if question.force is None else _answer(question, question.force, forces)
    return CurveForces(tuple(paths), question, curves, speeds, sentence)


def _answer(question: Question, wanted: float, forces: Sequence[tuple[float, str]]) -> str:
    """Say between which curves a force lies; labels need no order for that."""
    asked = (
        f"{wanted:.5g} N in {STROKE_WORDS[question.stroke or 'rebound']} at {question.speed:g} m/s"
    )
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
