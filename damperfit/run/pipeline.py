"""The whole story on one page: logs in, parameters and reports out.

    expand -> read and condition each log -> identify -> tables -> files

Failures of single logs and settings are collected; what can be done is done and written.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial
from itertools import chain
from typing import TYPE_CHECKING

from damperfit.atomic import check_writable, file_set, reserved
from damperfit.configuration.what_is_tested import unmatched
from damperfit.damper.warmed import Warmed
from damperfit.errors import ConfigurationError, OutputError
from damperfit.run.dampers import by_damper, folder_name
from damperfit.run.earlier import BESIDE, forget_figures, forget_others, holds_fits
from damperfit.run.ending import json_pieces
from damperfit.run.given_starts import with_given_start
from damperfit.run.given_traces import with_traces
from damperfit.run.hold_out import (
    Parted,
    fitting,
    named_files,
    note_unpredicted,
    part,
    with_transients,
)
from damperfit.run.judging import assessed, judge, with_profiles
from damperfit.run.like_speeds import without_contradictory_motions
from damperfit.run.log_paths import expand
from damperfit.run.logs import available_cores, read_batch
from damperfit.run.mishaps import Mishaps
from damperfit.run.result import Found, RunResult, UnwrittenError
from damperfit.run.rod_area import with_rod_remark
from damperfit.run.run_json import provenance
from damperfit.run.same_setting import once_each, without_contradictions, without_copies
from damperfit.run.warmth import check_temperatures, with_reference
from damperfit.run.work import Clock, fitted
from damperfit.run.writing import write_results
from damperfit.uncertainty import Bench

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from damperfit.configuration.options import Configuration
    from damperfit.identification import Fit
    from damperfit.recording import Trace
    from damperfit.tested.setting import Setting

__all__ = ["Watch", "find_each", "run", "run_each"]


@dataclass(frozen=True, slots=True)
class Watch:
    """Who looks on while a run goes: progress, and the wish to stop.

    Attributes
    ----------
    on_start : callable
        Called with the number of settings when all logs are read.
    on_fit : callable
        Called with each `Fit` when it is done, from any thread.
    cancelled : callable
        Asked now and then; once it says True, finished settings are written and the run ends.
    """

    on_start: Callable[[int], None] = lambda _: None
    on_fit: Callable[[Fit], None] = lambda _: None
    cancelled: Callable[[], bool] = lambda: False


def run(
    configuration: Configuration,
    logs: Sequence[str],
    *,
    jobs: int | None = None,
    setting: Setting | None = None,
    traces: Sequence[Trace] = (),
    watch: Watch = Watch(),
) -> RunResult:
    """Identify every setting in the logs of one damper and write the results as a set.

    Parameters
    ----------
    configuration : Configuration
        The complete configuration.
    logs : sequence of str
        Paths and patterns.
    jobs : int, optional
        Workers; the cores available by default. The results do not depend on it.
    setting : Setting, optional
        Setting of logs that do not give one.
    traces : sequence of Trace
        Logs that are conditioned already, fitted with those that are read.
    watch : Watch
        Progress and cancellation.

    Returns
    -------
    RunResult

    Raises
    ------
    ConfigurationError
        A path or pattern names no file, or the logs are of several dampers; nothing was touched.
    OutputError
        The results cannot be written; earlier results are untouched. At the end of a run it is an
        `UnwrittenError` that holds the result.
    """
    workers = jobs or available_cores()
    _check_adjusters(configuration)
    check_writable(configuration.output.folder)
    with reserved(configuration.output.folder):
        parts = _read(
            configuration, logs, jobs=workers, setting=setting, watch=watch, traces=traces
        )
        if len(parts) > 1:
            raise ConfigurationError(
                f"logs of {len(parts)} dampers: {', '.join(one.owner for one in parts)}; run_each "
                "gives each a result of its own"
            )
        result = parts[0].run(watch)
        if result.campaign.fits:
            forget_others(configuration.output.folder, [""])
        return result


def run_each(
    configuration: Configuration,
    logs: Sequence[str],
    *,
    jobs: int | None = None,
    setting: Setting | None = None,
    watch: Watch = Watch(),
) -> Iterator[tuple[str, RunResult]]:
    """Identify the dampers in the logs one after the other; each writes a set of its own.

    Several dampers write into folders of their own inside the results' folder, by serial number or
    name. Parameters and errors are those of `run`; each damper is yielded with its name, empty
    where there is one.
    """
    workers = jobs or available_cores()
    _check_adjusters(configuration)
    check_writable(configuration.output.folder)
    with reserved(configuration.output.folder):
        parts = _read(configuration, logs, jobs=workers, setting=setting, watch=watch)
        for one in parts:
            try:
                result = one.run(watch)
                if result.campaign.fits:
                    forget_others(configuration.output.folder, [each.folder for each in parts])
                yield one.folder_owner, result
            except UnwrittenError as error:
                raise UnwrittenError(str(error), error.result, one.folder_owner) from error


def find_each(
    configuration: Configuration,
    logs: Sequence[str],
    *,
    jobs: int | None = None,
    watch: Watch = Watch(),
) -> Iterator[tuple[str, RunResult]]:
    """Identify the dampers in the logs as `run_each` does, and write nothing.

    Yields
    ------
    str
        The damper's serial number or name, empty where no log says it.
    RunResult
        What was found.
    """
    workers = jobs or available_cores()
    for one in _read(configuration, logs, jobs=workers, setting=None, watch=watch):
        found, mishaps = _found(
            one.configuration, one.parted, clock=one.clock, jobs=one.jobs, watch=watch
        )
        yield one.owner, found.result(mishaps.failures)


def _check_adjusters(configuration: Configuration) -> None:
    """Refuse a joint fit in which what is declared to follow an adjuster is none of the model's."""
    damper = configuration.damper
    lost = unmatched(configuration.document["adjusters"], damper)
    if lost and configuration.identification.procedure == "joint":
        raise ConfigurationError(
            f"adjusters: {', '.join(lost)}: the model {damper.name} has no such quantity; there "
            f"are {', '.join((*damper.parts, *damper.names))}; name damper.model, or let --model "
            "auto find it"
        )


@dataclass(frozen=True, slots=True, eq=False)
class _OneDamper:
    """The logs of one damper, read, and where its results go."""

    owner: str
    folder_owner: str
    configuration: Configuration
    parted: Parted
    clock: Clock
    jobs: int
    beside: tuple[str, ...] = ()  # folders of all dampers of the command, where these are several

    @property
    def folder(self) -> str:
        """Name of its folder inside of the results' folder; empty where it is that."""
        return folder_name(self.folder_owner) if self.folder_owner else ""

    def run(self, watch: Watch) -> RunResult:
        fit = partial(_run, self, watch=watch)
        if not self.folder_owner:
            return fit()
        check_writable(self.configuration.output.folder)
        with reserved(self.configuration.output.folder):
            return fit()


def _read(
    configuration: Configuration,
    logs: Sequence[str],
    *,
    jobs: int,
    setting: Setting | None,
    watch: Watch,
    traces: Sequence[Trace] = (),
) -> list[_OneDamper]:
    """Read the logs and part them by damper; what is held out is parted from each."""
    clock = Clock()
    configuration = with_given_start(configuration)
    folder = configuration.output.folder
    paths = expand(logs) if logs or not traces else ()
    named = named_files(configuration.hold_out.patterns, paths)
    paths = tuple(dict.fromkeys((*paths, *chain.from_iterable(named.values()))))
    with clock.lap("read_s"):
        batch = read_batch(
            paths, configuration, jobs=jobs, setting=setting, cancelled=watch.cancelled
        )
    batch = with_traces(batch, traces, setting)
    if not batch.logs and not watch.cancelled():
        raise ConfigurationError(
            "no logs among the files given: they are all parameter tables or tables of tests"
        )
    groups = by_damper(batch)
    is_averaging = configuration.rig.is_averaging
    beside = tuple(map(folder_name, groups)) if len(groups) > 1 else ()
    found = []
    for owner, mine in groups.items():
        parted = Parted(mine)
        if not watch.cancelled():
            options = configuration.hold_out
            if len(groups) > 1:
                part(batch, options, named)  # a pattern that fits no log at all is refused
                options = fitting(mine, options, named)
            parted = part(mine, options, named)
            once = once_each(parted.batch)
            check_temperatures(configuration, once.traces, parted.held_out)
            is_warmed = isinstance(configuration.damper, Warmed)
            left = without_contradictions(once, is_averaging=is_averaging, is_warmed=is_warmed)
            left = without_contradictory_motions(left, configuration)
            left, held_out = without_copies(left, parted.held_out)
            left = with_rod_remark(left, configuration.damper)
            parted = with_transients(replace(parted, batch=left, held_out=held_out), options)
        own = with_reference(configuration, parted.batch.traces, parted.held_out)
        if len(groups) > 1:
            output = replace(configuration.output, folder=folder / folder_name(owner))
            own = replace(own, output=output)
        whose = owner if beside else ""
        found.append(_OneDamper(owner, whose, own, parted, clock, jobs, beside))
    return found


def _run(one: _OneDamper, *, watch: Watch) -> RunResult:
    """Fit, judge and write what was read."""
    configuration, clock, jobs = one.configuration, one.clock, one.jobs
    found, mishaps = _found(configuration, one.parted, clock=clock, jobs=jobs, watch=watch)
    if not found.campaign.fits and watch.cancelled():
        return found.result(mishaps.failures)
    if not found.campaign.fits and holds_fits(configuration.output.folder):
        return replace(found.result(mishaps.failures), keeps_earlier=True)
    try:
        with file_set(configuration.output.folder) as files:
            with clock.lap("write_s"):
                result, hashes = write_results(files, found, mishaps, jobs=jobs)
            record = result.record
            record["files"] = hashes
            record["timings"] = clock.read()
            if one.beside:
                record[BESIDE] = list(one.beside)
            with files.path("run.json").open("wb") as file:
                for piece in json_pieces(record):
                    file.write(piece.encode("utf-8", "backslashreplace"))
    except OutputError as error:
        raise UnwrittenError(str(error), found.result(mishaps.failures)) from error
    forget_figures(configuration.output.folder)
    return result


def _found(
    configuration: Configuration, parted: Parted, *, clock: Clock, jobs: int, watch: Watch
) -> tuple[Found, Mishaps]:
    """Fit and judge what was read."""
    batch = parted.batch
    watch.on_start(len({trace.setting for trace in batch.traces}))
    with clock.lap("fit_s"):
        campaign = fitted(
            configuration,
            batch.traces,
            jobs=jobs,
            on_fit=watch.on_fit,
            cancelled=watch.cancelled,
        )
    mishaps = Mishaps(batch)
    if campaign.mishap is not None:
        mishaps.add(campaign.mishap)
    bench = Bench(configuration.damper, configuration.identification.solver, watch.cancelled, jobs)
    with clock.lap("judge_s"):
        assessment = assessed(campaign, bench, mishaps)
    if configuration.profile and campaign.fits and not watch.cancelled():
        with clock.lap("profile_s"):
            assessment = with_profiles(
                campaign, assessment, bench, mishaps, names=configuration.profile
            )
    with clock.lap("judge_s"):
        campaign, judgement = judge(configuration, parted, campaign, assessment, mishaps, jobs=jobs)
    if not watch.cancelled():
        batch = note_unpredicted(parted, campaign, judgement.predictions, mishaps.failures)
    origin = provenance(configuration, batch, campaign, judgement.predictions)
    is_interrupted = watch.cancelled()
    return Found(configuration, batch, campaign, judgement, origin, is_interrupted), mishaps
