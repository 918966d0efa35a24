"""What a command line names, read as runs to compare: results folders, baselines, logs, curves."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING

from damperfit import results
from damperfit.comparison import ComparedRun, MeasuredTest, measured_tests
from damperfit.errors import ConfigurationError, LogError
from damperfit.problem import Option
from damperfit.queries.adjuster_results import adjuster_of
from damperfit.queries.baseline import is_baseline, read_baseline
from damperfit.queries.logs_to_compare import (
    NoUsableLogError,
    folders_of_logs,
    holds_logs,
    is_several_logs,
    read_log_runs,
)
from damperfit.recording import natural_order
from damperfit.report.records import listed_in, number_in
from damperfit.tables.reading import is_part

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from damperfit.configuration.options import Configuration

__all__ = [
    "LogRuns",
    "Pair",
    "holds_runs",
    "pairs_of",
    "read_run",
    "runs_of_logs",
    "with_distinct_names",
]

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
