"""Which logs and cycles are kept from the fit: patterns to traces.

A pattern picks among the logs by name or path. One that picks none names further files, which are
read for prediction only. A range, as in `4Hz-10Hz` or `0.2m/s-`, holds out the segments whose
frequency or peak speed lies within it. The word `transients` stands for what moves beside the
steady cycles of the logs that are fitted: run-up, coast-down, changes of speed. Where nothing else
is held out, they are, in the logs that have them.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from fnmatch import fnmatchcase
from typing import TYPE_CHECKING

from damperfit.conditioning import TRANSIENTS, transients
from damperfit.errors import ConfigurationError, mishap_of
from damperfit.problem import Failure, Option, Problem
from damperfit.run.log_paths import expand, real_path
from damperfit.run.logs import LogBatch, failure_of
from damperfit.uncertainty import SegmentRange, split_cycles

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence
    from pathlib import Path

    from damperfit.identification import Campaign
    from damperfit.recording import Trace
    from damperfit.uncertainty import HoldOutOptions, Prediction


_NO_FIT = (
    "has no fit, and no joint fit of others that have its clicks; fit settings that have them "
    "together{joint}, give another log of it to fit, or hold out some of its cycles{cycles}"
)


@dataclass(frozen=True, slots=True, eq=False)
class Parted:
    """Logs in two parts.

    Attributes
    ----------
    batch : LogBatch
        All logs; its traces are those to fit, its failures hold the logs that could not be parted.
    held_out : tuple of Trace
        To be predicted.
    names : frozenset of str
        Logs that are held out as a whole.
    is_asked : bool
        Whether the user said what to hold out; else it is what moves beside the steady cycles.
    """

    batch: LogBatch
    held_out: tuple[Trace, ...] = ()
    names: frozenset[str] = frozenset()
    is_asked: bool = True


def named_files(patterns: Iterable[str], paths: Sequence[Path]) -> dict[str, tuple[Path, ...]]:
    """Return the files that each pattern names: among the logs, else beside them.

    A pattern that names neither is not refused here: it may fit one test of a file of several.

    Parameters
    ----------
    patterns : iterable of str
        What to hold out.
    paths : sequence of pathlib.Path
        The logs.
    """
    return {one: _named(one, paths) for one in patterns if _is_of_files(one)}


def _is_of_files(pattern: str) -> bool:
    return pattern != TRANSIENTS and SegmentRange.parse(pattern) is None


def _named(pattern: str, paths: Sequence[Path]) -> tuple[Path, ...]:
    among = tuple(path for path in paths if _fits(pattern, path.name, str(path)))
    if among:
        return among
    known = {real_path(path): path for path in paths}
    try:
        return tuple(known.get(real_path(path), path) for path in expand([pattern]))
    except ConfigurationError:
        return ()


def fitting(
    batch: LogBatch, options: HoldOutOptions, named: Mapping[str, Sequence[Path]]
) -> HoldOutOptions:
    """Return the options with the patterns alone that fit a log of the batch."""
    patterns = tuple(
        one
        for one in options.patterns
        if one == TRANSIENTS or _hits(one, batch, named) or _segments(batch.traces, one)[1]
    )
    return replace(options, patterns=patterns)


def _hits(pattern: str, batch: LogBatch, named: Mapping[str, Sequence[Path]]) -> set[str]:
    files = {str(path) for path in named.get(pattern, ())}
    return {log.log for log in batch.logs if log.path in files or _fits(pattern, log.log)}


def part(batch: LogBatch, options: HoldOutOptions, named: Mapping[str, Sequence[Path]]) -> Parted:
    """Part what was read into what is fitted and what is predicted, but for transients.

    Parameters
    ----------
    batch : LogBatch
        Everything that was read.
    options : HoldOutOptions
        What to hold out.
    named : mapping of str to sequence of pathlib.Path
        What `named_files` found for the patterns; all of it was read.

    Raises
    ------
    ConfigurationError
        A pattern fits nothing, or no log is left to fit.
    """
    names: set[str] = set()
    for pattern in filter(_is_of_files, options.patterns):
        hits = _hits(pattern, batch, named)
        if not hits:
            raise ConfigurationError(
                "matches no log and names no other file; quote a pattern, as "
                "in {hold_out}, and leave the held-out logs among LOGS or out of them",
                hold_out=Option("hold_out", "'*_16mm.csv'"),
                where=Option("hold_out", pattern),
            )
        names |= hits
    if names and names == {log.log for log in batch.logs}:
        raise ConfigurationError("hold-out: every log is held out; none is left to fit")
    held_out = [trace for trace in batch.traces if trace.name in names]
    remaining = [trace for trace in batch.traces if trace.name not in names]
    for pattern in options.patterns:
        if pattern == TRANSIENTS or _is_of_files(pattern):
            continue
        remaining, within = _segments(remaining, pattern)
        if not within:
            raise ConfigurationError(
                "no log has a segment within these limits", where=Option("hold_out", pattern)
            )
        held_out += within
    if held_out and not remaining:
        raise ConfigurationError("hold-out: every log is held out; none is left to fit")
    fitted: list[Trace] = []
    failures: list[Failure] = []
    for trace in remaining:
        try:
            rest, last = split_cycles(trace, options.cycles) if options.cycles else (trace, None)
        except Exception as error:  # noqa: BLE001 - the other logs go on
            mishap = mishap_of(error, f"holding out cycles of {trace.name}")
            failures.append(_failure(batch, trace, mishap))
            continue
        fitted.append(rest)
        held_out.extend([last] if last is not None else [])
    left = replace(batch, traces=tuple(fitted), failures=(*batch.failures, *failures))
    return Parted(left, tuple(held_out), frozenset(names))


def _segments(traces: Sequence[Trace], pattern: str) -> tuple[list[Trace], list[Trace]]:
    """Return the logs without the segments of a range, and with these alone."""
    limits = SegmentRange.parse(pattern)
    if limits is None:
        return list(traces), []
    parts = [limits.split(trace) for trace in traces]
    fitted, held = ([trace for trace in side if trace] for side in zip(*parts, strict=True))
    return fitted, held


def with_transients(parted: Parted, options: HoldOutOptions) -> Parted:
    """Hold out what moves beside the steady cycles of the logs that are left to fit.

    After copies and contradictions are gone, for a log that is not fitted has no rest to predict.

    Parameters
    ----------
    parted : Parted
        The logs that are fitted, and what is held out besides.
    options : HoldOutOptions
        What to hold out.

    Raises
    ------
    ConfigurationError
        Transients are asked for, and no log has any.
    """
    is_asked = TRANSIENTS in options.patterns
    if not is_asked and (options.patterns or options.cycles):
        return parted
    fitted = parted.batch.traces
    beside = tuple(one for one in map(transients, fitted) if one is not None)
    if is_asked and fitted and not beside:
        raise ConfigurationError(
            "hold-out transients: no log has a run-up or coast-down from or to rest, or changes "
            "its speed between steady cycles; give one that does, or hold out another log"
        )
    return replace(parted, held_out=(*parted.held_out, *beside), is_asked=is_asked)


def note_unpredicted(
    parted: Parted,
    campaign: Campaign,
    predictions: Sequence[Prediction],
    known: Sequence[Failure] = (),
) -> LogBatch:
    """Return the batch with the held-out logs that could not be predicted among its failures.

    Logs of which it is known already why are not said again. What nobody asked to hold out is no
    failure: a remark says so, where the setting is fitted.
    """
    done = {id(prediction.trace) for prediction in predictions}
    failed = {failure.log for failure in known}
    fitted = {fit.setting for fit in campaign.fits}
    if not parted.is_asked:
        said = tuple(
            f"{trace.name}: the motion beside its steady cycles cannot be simulated with the "
            "fitted parameters, so it is not predicted"
            for trace in parted.held_out
            if id(trace) not in done and trace.setting in fitted
        )
        return replace(parted.batch, remarks=(*parted.batch.remarks, *said))
    lost = tuple(
        _failure(
            parted.batch,
            trace,
            _unpredicted(trace, is_fitted=trace.setting in fitted),
        )
        for trace in parted.held_out
        if id(trace) not in done and trace.name not in failed
    )
    return replace(parted.batch, failures=(*parted.batch.failures, *lost))


def _unpredicted(trace: Trace, *, is_fitted: bool) -> Failure:
    kind, why = (
        ("SimulationError", "cannot be simulated on it")
        if is_fitted
        else ("PredictionError", _NO_FIT)
    )
    text = f"held out, but cannot be predicted: setting {trace.setting} {why}"
    ways = {"joint": Option("procedure", "joint", is_aside=True)}
    ways |= {"cycles": Option("hold_out_cycles", is_aside=True)}
    return Failure(Problem("not-predicted", text, subject=trace.name, values=ways), kind)


def _failure(batch: LogBatch, trace: Trace, mishap: Failure) -> Failure:
    path = next((log.path for log in batch.logs if log.log == trace.name), "")
    return failure_of(mishap, trace.name, path, trace.setting)


def _fits(pattern: str, *names: str) -> bool:
    return any(name == pattern or fnmatchcase(name, pattern) for name in names)
