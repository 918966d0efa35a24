"""The whole of `identify` on one page: logs in, a `Run` of each damper out.

    paths -> read and condition each log -> fit -> judge -> Run

Failures of single logs and settings are collected; what can be done is done. Nothing is written
here but by `written`, which saves each run. What comes after reading is loaded while copies of this
process read.
"""

from __future__ import annotations

import logging
import time
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass, replace
from importlib import import_module
from itertools import chain
from typing import TYPE_CHECKING, Any

from damperfit.configuration.what_is_tested import unmatched
from damperfit.damper.warmed import Warmed
from damperfit.errors import ConfigurationError, OutputError
from damperfit.problem import Option
from damperfit.run.log_files import expand
from damperfit.run.logs import read_batch, with_traces
from damperfit.run.parting import (
    Parted,
    by_damper,
    check_temperatures,
    fitting,
    folder_name,
    named_files,
    note_unpredicted,
    of_one_damper,
    once_each,
    part,
    with_reference,
    with_rod_remark,
    with_transients,
    without_contradictions,
    without_contradictory_motions,
    without_copies,
)
from damperfit.store import check_writable, reserved
from damperfit.workers import apart, available_cores, told_here

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence
    from contextlib import AbstractContextManager
    from pathlib import Path

    from damperfit.configuration.options import Configuration
    from damperfit.identification import Campaign, Fit, LogFit
    from damperfit.problem import Failure
    from damperfit.recording import Trace
    from damperfit.results import Run
    from damperfit.run.auto_model import LawChoice
    from damperfit.run.judging import Mishaps
    from damperfit.run.logs import LogBatch
    from damperfit.tables.reading import LogSignals
    from damperfit.tested.setting import Setting
    from damperfit.uncertainty import HoldOutOptions


_LOGGER = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class Watch:
    """Who looks on while a run goes: progress, and the wish to stop.

    Attributes
    ----------
    on_start : callable
        Called with the number of settings when all logs are read.
    on_fit : callable
        Called with each `Fit`, log or damper when it is done, from any thread.
    cancelled : callable
        Asked now and then; once it says True, finished settings are written and the run ends.
    on_law : callable
        Called with the name of each law that was tried, where the logs choose it.
    on_choice : callable
        Called with the choice, what was asked for, and what is fitted.
    during_work : callable
        Makes a context that is entered while logs are read and fitted.
    """

    on_start: Callable[[int], None] = lambda _: None
    on_fit: Callable[[object], None] = lambda _: None
    cancelled: Callable[[], bool] = lambda: False
    on_law: Callable[[str], None] = lambda _: None
    on_choice: Callable[[LawChoice, Configuration, Configuration], None] = lambda *_: None
    during_work: Callable[[], AbstractContextManager[object]] = nullcontext


class _Clock:
    """Seconds spent in each part of a run."""

    def __init__(self) -> None:
        self._laps: dict[str, float] = {}
        self._started = time.perf_counter()

    @contextmanager
    def lap(self, name: str) -> Iterator[None]:
        """Add the time spent inside to a part."""
        begin = time.perf_counter()
        try:
            yield
        finally:
            spent = time.perf_counter() - begin
            _LOGGER.debug("%s took %.3f s", name, spent)
            self._laps[f"{name}_s"] = round(self._laps.get(f"{name}_s", 0.0) + spent, 4)

    def read(self) -> dict[str, float]:
        """Return the seconds of each part, and of all."""
        return self._laps | {"total_s": round(time.perf_counter() - self._started, 4)}


@dataclass(slots=True, eq=False, repr=False)
class Identified:
    """One damper, identified.

    Attributes
    ----------
    owner : str
        Its serial number or name; empty where no log says it.
    folder : pathlib.Path
        Where its results go.
    configuration : Configuration
        With what it was fitted.
    run : Run
        What was found.
    failures : tuple of Failure
        Logs and settings without a result, and where internal errors happened.
    beside : tuple of str
        Folders of all dampers of the command; empty where there is one.
    error : Exception or None
        Why it, or its report, is not written.
    keeps_earlier : bool
        Nothing was fitted, and nothing written: the folder keeps the results that it had.
    """

    owner: str
    folder: Path
    configuration: Configuration
    run: Run
    failures: tuple[Failure, ...] = ()
    beside: tuple[str, ...] = ()
    error: Exception | None = None
    keeps_earlier: bool = False

    @property
    def is_interrupted(self) -> bool:
        """Whether the user has stopped it."""
        return bool(self.run.record["ending"] == "interrupted")

    @property
    def is_written(self) -> bool:
        """Whether its folder has the results."""
        return self.run.place is not None

    def save(self) -> None:
        """Write it to its folder; without a fit only where no earlier results are lost."""
        from damperfit.results import holds_fits

        if not self.run.settings:
            self.keeps_earlier = not self.is_interrupted and holds_fits(self.folder)
            if self.is_interrupted or self.keeps_earlier:
                return
        try:
            self.run.save(self.folder)
            self.run.stand_in(self.folder)
        except OutputError as error:
            self.error = error


def written(configuration: Configuration, logs: Sequence[str], **how: Any) -> Iterator[Identified]:
    """Identify the dampers in the logs and write each: `identified`, with its parameters, saved.

    Several dampers get folders of their own inside the results' folder, by serial number or name.
    What cannot be written is not lost: `Identified.error` says why.

    Raises
    ------
    OutputError
        The folder cannot be written to, or another run is at work there; nothing was touched.
    """
    from damperfit.results import forget_others

    folder = configuration.output.folder
    check_writable(folder)
    with reserved(folder):
        for one in identified(configuration, logs, **how):
            check_writable(one.folder)
            one.save()
            if one.run.settings and one.error is None:
                forget_others(folder, one.beside or ("",))
            yield one


def identified(  # noqa: PLR0913 - what is asked of it
    configuration: Configuration,
    logs: Sequence[str],
    *,
    jobs: int | None = None,
    setting: Setting | None = None,
    traces: Sequence[Trace] = (),
    watch: Watch = Watch(),
    is_one: bool = False,
) -> Iterator[Identified]:
    """Identify the dampers in the logs one after the other, and write nothing.

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
    is_one : bool
        Whether logs of several dampers are refused.

    Raises
    ------
    ConfigurationError
        A path or pattern names no file, or the logs are of several dampers and may not be.
    """
    damper, clock, workers = configuration.damper, _Clock(), jobs or available_cores()
    lost = unmatched(configuration.document["adjusters"], damper)
    if lost and configuration.identification.procedure == "joint":
        raise ConfigurationError(
            f"adjusters: {', '.join(lost)}: the model {damper.name} has no such quantity; there "
            f"are {', '.join((*damper.parts, *damper.names))}; name damper.model, or let {{model}} "
            "auto find it",
            model=Option("model"),
        )
    if configuration.start_table is not None:
        from damperfit.run.given_starts import with_given_start

        configuration = with_given_start(configuration)
    paths = expand(logs) if logs or not traces else ()
    named = named_files(configuration.hold_out.patterns, paths)
    with clock.lap("read"):
        batch = read_batch(
            tuple(dict.fromkeys((*paths, *chain.from_iterable(named.values())))),
            configuration,
            jobs=workers,
            setting=setting,
            cancelled=watch.cancelled,
            beside=lambda: [import_module(f"damperfit.run.{name}") for name in _AFTER_READING],
        )
    batch = with_traces(batch, traces, setting)
    if not batch.logs and not watch.cancelled():
        raise ConfigurationError(
            "no logs among the files given: they are all parameter tables or tables of tests"
        )
    if is_one:
        of_one_damper(batch)
    groups = by_damper(batch)
    beside = tuple(map(folder_name, groups)) if len(groups) > 1 else ()
    folder = configuration.output.folder
    prepared = []
    for owner, mine in groups.items():
        own, parted = configuration, Parted(mine)
        if not watch.cancelled():
            options = configuration.hold_out
            if beside:
                part(batch, options, named)  # a pattern that fits no log at all is refused
                options = fitting(mine, options, named)
            own, parted = _prepared(configuration, part(mine, options, named), options)
        if beside:
            own = replace(own, output=own.output.but(folder=folder / folder_name(owner)))
        prepared.append((owner, own, parted))
    for owner, own, parted in prepared:
        run, failures = _fitted(own, parted, clock=clock, jobs=workers, watch=watch)
        if beside:
            run.record["folders_of_this_run"] = list(beside)
        yield Identified(owner, own.output.folder, own, run, failures, beside)


_AFTER_READING = ("judging", "record")


def _prepared(
    configuration: Configuration, parted: Parted, options: HoldOutOptions
) -> tuple[Configuration, Parted]:
    """Leave out copies and contradictions among the logs of one damper; find its temperature."""
    batch = once_each(parted.batch)
    check_temperatures(configuration, (*batch.traces, *parted.held_out))
    batch = without_contradictions(
        batch,
        is_averaging=configuration.rig.is_averaging,
        is_warmed=isinstance(configuration.damper, Warmed),
    )
    batch = without_contradictory_motions(batch, configuration)
    batch, held_out = without_copies(batch, parted.held_out)
    batch = with_rod_remark(batch, configuration.damper)
    parted = with_transients(replace(parted, batch=batch, held_out=held_out), options)
    return with_reference(configuration, batch.traces), parted


def _fitted(
    configuration: Configuration, parted: Parted, *, clock: _Clock, jobs: int, watch: Watch
) -> tuple[Run, tuple[Failure, ...]]:
    """Fit and judge the logs of one damper."""
    from damperfit.run.judging import Mishaps, assessed, judge, with_profiles
    from damperfit.run.record import run_of
    from damperfit.uncertainty import Bench

    batch = parted.batch
    watch.on_start(len({trace.setting for trace in batch.traces}))
    with clock.lap("fit"):
        campaign = _fits(configuration, batch, jobs=jobs, watch=watch)
    mishaps = Mishaps(batch)
    if campaign.mishap is not None:
        mishaps.add(campaign.mishap)
    bench = Bench(configuration.damper, configuration.identification.solver, watch.cancelled, jobs)
    with clock.lap("judge"):
        assessment = assessed(campaign, bench, mishaps)
    if (names := configuration.profile) and campaign.fits and not watch.cancelled():
        with clock.lap("profile"):
            assessment = with_profiles(campaign, assessment, bench, mishaps, names)
    with clock.lap("judge"):
        campaign, judgement = judge(configuration, parted, campaign, assessment, mishaps, jobs=jobs)
    if not watch.cancelled():
        batch = note_unpredicted(parted, campaign, judgement.predictions, mishaps.failures)
    is_interrupted = watch.cancelled()
    with clock.lap("characteristics"):
        rows = _characteristics(configuration, campaign, mishaps, jobs=jobs)
    run, failures = run_of(
        configuration,
        batch,
        campaign,
        judgement,
        mishaps,
        characteristics=[row for of_log in rows for row in of_log or ()],
        is_interrupted=is_interrupted,
    )
    run.keep_signals(lambda: _signals(configuration, campaign, rows))
    run.record["timings"] = clock.read()
    return run, failures


def _fits(configuration: Configuration, batch: LogBatch, *, jobs: int, watch: Watch) -> Campaign:
    """Return the fits of all settings; none where there is no log, or the user has stopped."""
    from damperfit.identification import Campaign, identify

    options = configuration.identification
    if not batch.traces or watch.cancelled():
        return Campaign(options.procedure, (), named=configuration.damper.quantities)

    def note(fit: Fit) -> None:
        _LOGGER.debug(
            "setting %s: MSE %.4g %%, %s, %d evaluations, %d samples of %d cycles; %s",
            fit.setting,
            fit.mse_percent,
            fit.outcome.value,
            fit.evaluations,
            fit.n_samples,
            fit.n_cycles,
            fit.parameters,
        )
        watch.on_fit(fit)

    return identify(
        batch.traces,
        configuration.damper,
        options,
        jobs=jobs,
        on_fit=note,
        cancelled=watch.cancelled,
    )


def _characteristics(
    configuration: Configuration, campaign: Campaign, mishaps: Mishaps, *, jobs: int
) -> list[list[dict[str, Any]] | None]:
    """Return the characteristics of each log; None where it cannot be simulated."""
    from damperfit.tables.rows import characteristic_rows

    damper, solver = configuration.damper, configuration.identification.solver
    unseen = told_here(mishaps.at("simulating the response of"))
    unread = told_here(mishaps.at("reading the characteristics of"))

    def rows_of(pair: tuple[Fit, LogFit]) -> list[dict[str, Any]] | None:
        fit, log = pair
        try:
            seen = log.compared(fit.parameters, damper, solver)
        except Exception as error:  # noqa: BLE001 - the other logs have their signals
            unseen(log.trace, error)
            return None
        try:
            speeds = configuration.output.speeds
            return list(characteristic_rows(fit.setting, log.trace, seen, damper, speeds))
        except Exception as error:  # noqa: BLE001 - the other logs have theirs
            unread(log.trace, error)
            return []

    logs = [(fit, log) for fit in campaign.fits for log in fit.logs]
    return list(apart(rows_of, logs, jobs=jobs))


def _signals(
    configuration: Configuration, campaign: Campaign, rows: Sequence[list[dict[str, Any]] | None]
) -> Iterator[LogSignals]:
    """Yield the signals of each log as the fit saw it last, one by one: they are large."""
    from damperfit.tables.rows import signals_of

    damper, solver = configuration.damper, configuration.identification.solver
    logs = [(fit, log) for fit in campaign.fits for log in fit.logs]
    for (fit, log), of_log in zip(logs, rows, strict=True):
        if of_log is not None:
            seen = log.compared(fit.parameters, damper, solver)
            yield signals_of(fit.setting, log.trace, seen)
