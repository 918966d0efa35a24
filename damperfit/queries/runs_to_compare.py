"""What a command line names, read as runs to compare: results folders, baselines, logs, curves."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from damperfit.comparison import FittedRun, MeasuredTest, Run, measured_tests
from damperfit.conditioning import condition
from damperfit.configuration.loading import load_configuration
from damperfit.errors import ConfigurationError, TimelessError
from damperfit.queries.adjuster_results import adjuster_in
from damperfit.queries.baseline import is_baseline, read_baseline
from damperfit.queries.fleet_part import is_part, read_part
from damperfit.readers import read_curves, read_logs
from damperfit.recording import natural_order
from damperfit.report.json_records import listed_in, number_in
from damperfit.tables import LogSignals, Results, read_results
from damperfit.tested.setting import Setting, parse_place

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from damperfit.readers import ForceCurve
    from damperfit.recording import Recording

__all__ = ["Pair", "holds_runs", "named_apart", "pairs_of", "read_run"]

_MARKS = ("run.json", "parameters.parquet", "parameters.csv")
_NAMELESS = "as tested"  # the setting of what says none


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


def pairs_of(paths: Sequence[Path]) -> tuple[tuple[Pair, ...], tuple[str, ...]]:
    """Return what is compared with what, and what has no partner, a sentence each.

    A folder that holds results folders stands for them: one alone for all its dampers, the first
    of which is the reference; two or more for the same dampers before and after, paired by name.

    Parameters
    ----------
    paths : sequence of pathlib.Path
        As the command line names them; the first is the reference.

    Raises
    ------
    ConfigurationError
        There are fewer than two, a folder holds no results, or no name is in both.
    """
    for path in paths:
        if not path.exists():
            raise ConfigurationError(f"{path}: no such file or folder")
    groups = [_inside(path) for path in paths]
    if len(paths) == 1:
        if len(groups[0]) < 2:
            raise ConfigurationError(
                f"{paths[0]}: one run alone has nothing to be compared with; give a second one, "
                "or a folder that holds several, or --tolerance FILE with nominal forces"
            )
        first, *others = groups[0].values()
        return tuple(Pair(first, other, other.name) for other in others), ()
    if not any(groups):
        return tuple(Pair(paths[0], other) for other in paths[1:]), ()
    for path, group in zip(paths, groups, strict=True):
        if not group:
            raise ConfigurationError(
                f"{path}: is one run, and others that were given hold several; give folders of "
                "several dampers, or single runs, not both"
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


def _inside(path: Path) -> dict[str, Path]:
    """Return the results folders inside a folder that is none itself."""
    if not path.is_dir() or _is_run(path):
        return {}
    inside = sorted(path.iterdir(), key=lambda one: natural_order(one.name))
    found = {one.name: one for one in inside if one.is_dir() and _is_run(one)}
    if not found:
        raise ConfigurationError(_no_results(path, inside))
    return found


def _no_results(folder: Path, inside: Sequence[Path]) -> str:
    """Say what a folder without results holds, and what to do if it is logs."""
    files = [one.name for one in inside if one.is_file() and not one.name.startswith(".")]
    said = f"{folder}: no results of damperfit identify, and no folder in it holds any"
    if not files:
        return f"{said}; expected run.json and parameters.parquet"
    more = f" and {len(files) - 1} more" if len(files) > 1 else ""
    return (
        f"{said}, but {files[0]}{more}; if these are logs, run damperfit identify on them first, "
        f"or give single files: damperfit compare {folder / files[0]} OTHER --measured"
    )


def holds_runs(path: Path) -> bool:
    """Whether a path is a folder of results folders."""
    return bool(_inside(path))


def _is_run(folder: Path) -> bool:
    return _is_results(folder) or is_part(folder)


def _is_results(folder: Path) -> bool:
    return any((folder / name).is_file() for name in _MARKS)


def read_run(path: Path, *, config: Path | None = None, is_measured: bool = False) -> Run:
    """Return a run to be compared.

    Parameters
    ----------
    path : pathlib.Path
        Results folder, baseline or a fleet's part; with ``is_measured`` also a log or a file of
        curves.
    config : pathlib.Path, optional
        How logs are read; the damper of results that do not tell theirs.
    is_measured : bool
        Measured curves alone.

    Raises
    ------
    ConfigurationError
        There is nothing of the kind.
    LogError
        A log cannot be read.
    """
    if is_part(path):
        return _of_results(read_part(path), path, (), config=config, is_measured=is_measured)
    if path.is_dir():
        return _of_folder(path, config, is_measured=is_measured)
    if not path.is_file():
        raise ConfigurationError(f"{path}: no such file or folder")
    if is_baseline(path):
        baseline = read_baseline(path)
        return _of_results(
            baseline.results, path, baseline.tests, config=config, is_measured=is_measured
        )
    if not is_measured:
        raise ConfigurationError(
            f"{path}: neither a results folder nor a baseline; to compare logs and files of "
            "curves, give --measured"
        )
    return _of_log(path, config)


def _of_folder(folder: Path, config: Path | None, *, is_measured: bool) -> Run:
    if not _is_results(folder):
        raise ConfigurationError(
            f"{folder}: holds no results of damperfit identify; expected run.json and "
            "parameters.parquet"
        )
    results = read_results(folder, parts=("parameters", "responses"))
    return _of_results(
        results, folder, tuple(_tests(results)), config=config, is_measured=is_measured
    )


def _of_results(
    results: Results,
    place: Path,
    tests: tuple[MeasuredTest, ...],
    *,
    config: Path | None,
    is_measured: bool,
) -> Run:
    name = place.resolve().name
    if is_measured:
        return _with_tests(Run(name, str(place), None, tests, results.record, results.remarks))
    adjuster = adjuster_in(results, place, config=config)
    rows = {Setting.of(row["setting"]): row for row in results.parameters}
    fitted = FittedRun(
        adjuster.damper,
        adjuster.stages,
        adjuster.sine,
        adjuster.forces,
        rows,
        results.quantities,
        adjuster.solver,
    )
    return Run(name, str(place), fitted, tests, results.record, adjuster.remarks)


def _with_tests(run: Run) -> Run:
    if not run.tests:
        raise ConfigurationError(
            f"{run.place}: no measured cycles to compare"
            + (f" ({'; '.join(run.remarks)})" if run.remarks else "; no motion in it repeats")
        )
    return run


def _tests(results: Results) -> Iterator[MeasuredTest]:
    """Yield the steady motions of all logs of a results folder."""
    known = {
        str(entry.get("log")): entry
        for entry in listed_in(results.record, "inputs")
        if isinstance(entry, dict)
    }
    for signals in results.logs:
        facts = known.get(signals.log, {})
        told = [one for one in listed_in(facts, "stretches") if isinstance(one, dict)]
        warmth = number_in(facts, "temperature_degC")
        temperature = math.nan if warmth is None else warmth
        if not told and len(signals.time) > 1:  # older results tell one motion a log
            step = float(signals.time[-1] - signals.time[0]) / (len(signals.time) - 1)
            ends = {
                "start_s": float(signals.time[0]),
                "stop_s": float(signals.time[-1]) + step,
            }
            told = [{**facts, **ends}]
        yield from measured_tests(signals, told, temperature=temperature)


def _of_log(path: Path, config: Path | None) -> Run:
    """Return a log, or a file of curves, as a run without a fit."""
    configuration = load_configuration(config)
    try:
        recordings = read_logs(path, configuration.reading)
    except TimelessError:
        curves = read_curves(path, configuration.reading)
        tests = tuple(_of_curve(curve) for curve in curves)
        record: dict[str, Any] = {"inputs": []}
    else:
        tests = tuple(
            test
            for recording in recordings
            for test in _of_recording(recording, configuration.conditioning)
        )
        record = {"inputs": [{"log": r.name, "sha256": r.sha256} for r in recordings]}
    return _with_tests(Run(path.name, str(path), None, tests, record))


def _of_recording(recording: Recording, options: Any) -> tuple[MeasuredTest, ...]:
    trace = condition(recording, options)
    n = len(trace.force)
    nothing = np.full(n, np.nan)
    signals = LogSignals(
        trace.setting or Setting.of(_NAMELESS),
        trace.name,
        trace.start_time + trace.interval * np.arange(n, dtype=np.float64),
        trace.displacement,
        trace.velocity,
        trace.force,
        nothing,
        np.stack([nothing] * 3),
    )
    told = [stretch.describe(trace) for stretch in trace.stretches]
    warmth = math.nan if trace.temperature is None else trace.temperature
    return measured_tests(signals, told, temperature=warmth)


def _of_curve(curve: ForceCurve) -> MeasuredTest:
    """Return a curve without time as a test without a motion: no errors are known."""
    speeds = np.unique(np.abs(curve.velocity[curve.velocity != 0.0]))
    nothing = np.empty(0)
    strokes = {}
    for stroke in ("rebound", "bump"):
        forces = np.array([curve.force_at(float(speed), stroke) for speed in speeds])
        strokes[stroke] = np.stack([forces, np.full(len(speeds), np.nan)])
    return MeasuredTest(
        setting=_setting_of(curve),
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


def _setting_of(curve: ForceCurve) -> Setting:
    """Return the setting that a curve's label names; a file of one curve calls it after itself."""
    if curve.label in {curve.name, Path(curve.name).stem}:
        return Setting.of(_NAMELESS)
    try:
        return Setting.of(parse_place(curve.label))
    except ValueError:
        return Setting.of(curve.label)


def named_apart(runs: Sequence[Run]) -> tuple[Run, ...]:
    """Return the runs with names that differ: where two are alike, with as much of their path."""
    names = [run.name for run in runs]
    if len(set(names)) == len({run.place for run in runs}):
        return tuple(runs)
    return tuple(replace(run, name="/".join(Path(run.place).resolve().parts[-2:])) for run in runs)
