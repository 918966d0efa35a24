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
from typing import TYPE_CHECKING, Any

from damperfit.configuration.schema import unmatched
from damperfit.errors import ConfigurationError, OutputError
from damperfit.problem import Option
from damperfit.run.log_files import expand
from damperfit.run.logs import LogBatch, add_traces, read_batch
from damperfit.run.parting import (
    by_damper,
    fitting,
    folder_name,
    named_files,
    note_unpredicted,
    part,
    prepare,
)
from damperfit.store import check_writable, reserved
from damperfit.workers import apart, available_cores, told_here

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping, Sequence
    from contextlib import AbstractContextManager
    from pathlib import Path

    from damperfit.configuration.options import Configuration
    from damperfit.identification import Campaign, Fit, LogFit
    from damperfit.problem import Failure
    from damperfit.recording import Trace
    from damperfit.results import Run
    from damperfit.run.auto_model import LawChoice
    from damperfit.run.record import FailureLog
    from damperfit.tables.reading import LogSignals
    from damperfit.tested.setting import Setting


_LOGGER = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class Watch:
    """Who looks on while a run goes: progress, and the wish to stop.

    `on_start` is called with the number of settings when all logs are read, `on_fit` with each
    `Fit`, log or damper when it is done, from any thread. `cancelled` is asked now and then; once
    it says True, finished settings are written and the run ends. Where the logs choose the law,
    `on_law` is called with the name of each that was tried, `on_choice` with the choice, what was
    asked for, and what is fitted. `during_work` makes a context for the time of the work.
    """

    on_start: Callable[[int], None] = lambda _: None
    on_fit: Callable[[object], None] = lambda _: None
    cancelled: Callable[[], bool] = lambda: False
    on_law: Callable[[str], None] = lambda _: None
    on_choice: Callable[[LawChoice, Configuration, Configuration], None] = lambda *_: None
    during_work: Callable[[], AbstractContextManager[object]] = nullcontext


class Clock:
    """Seconds spent in each part of a run."""

    def __init__(self, started: float | None = None) -> None:
        self._laps: dict[str, float] = {}
        self._started = time.perf_counter() if started is None else started

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
    """One damper, identified: its serial number or name, with what it was fitted, what was found.

    `failures` are logs and settings without a result, and where internal errors happened; `beside`
    the folders of all dampers of the command, none where there is one; `error` says why it, or its
    report, is not written. `keeps_earlier`: nothing was fitted, and the folder keeps the results
    that it had.
    """

    owner: str
    configuration: Configuration
    run: Run
    failures: tuple[Failure, ...] = ()
    beside: tuple[str, ...] = ()
    error: Exception | None = None
    keeps_earlier: bool = False

    @property
    def folder(self) -> Path:
        """Where its results go."""
        folder: Path = self.configuration.output.folder
        return folder

    @property
    def is_interrupted(self) -> bool:
        """Whether the user has stopped it."""
        return bool(self.run.record["ending"] == "interrupted")

    @property
    def is_written(self) -> bool:
        """Whether its folder has the results."""
        return self.run.place is not None


def written(configuration: Configuration, logs: Sequence[str], **how: Any) -> Iterator[Identified]:
    """Identify the dampers in the logs and write each: `identified`, with its parameters, saved.

    Several dampers get folders of their own inside the results' folder, by serial number or name.
    What cannot be written is not lost: `Identified.error` says why. Without a fit a run is written
    only where no earlier results are lost.

    Raises
    ------
    OutputError
        The folder cannot be written to, or another run is at work there; nothing was touched.
    """
    from damperfit.results import forget_others, holds_fits, spare_others

    folder = configuration.output.folder
    check_writable(folder)
    with reserved(folder):
        spare_others(folder)
        for one in identified(configuration, logs, **how):
            check_writable(one.folder)
            if not one.run.settings:
                one.keeps_earlier = not one.is_interrupted and holds_fits(one.folder)
            if one.run.settings or not (one.is_interrupted or one.keeps_earlier):
                try:
                    one.run.save(one.folder)
                    one.run.stand_in(one.folder)
                except (OutputError, ConfigurationError) as error:
                    one.error = error
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
    started: float | None = None,
) -> Iterator[Identified]:
    """Identify the dampers in the logs one after the other, and write nothing.

    ``logs`` are paths and patterns, ``traces`` logs that are conditioned already, fitted with those
    that are read; ``setting`` is that of logs that do not give one. The results do not depend on
    ``jobs``. With ``is_one`` logs of several dampers are refused. ``started`` is when the work
    began, on `time.perf_counter`.

    Raises
    ------
    ConfigurationError
        A path or pattern names no file, or the logs are of several dampers and may not be.
    """
    damper, clock, workers = configuration.damper, Clock(started), jobs or available_cores()
    lost = unmatched(configuration.document["adjusters"], damper)
    if lost and configuration.identification.procedure == "joint":
        raise ConfigurationError(
            f"adjusters: {', '.join(lost)}: the model {damper.name} has no such quantity; there "
            f"are {', '.join((*damper.parts, *damper.names))}; name damper.model, or let {{model}} "
            "auto find it",
            model=Option("model"),
            code="unknown-quantity",
        )
    if configuration.start_table is not None:
        from damperfit.run.given_starts import with_given_start

        configuration = with_given_start(configuration)
    with clock.lap("read"):
        batch, named = gather(
            configuration,
            logs if logs or not traces else None,
            jobs=workers,
            setting=setting,
            cancelled=watch.cancelled,
            beside=lambda: import_module("damperfit.run.record"),
        )
    add_traces(batch, traces, setting)
    if not batch.logs and not watch.cancelled():
        raise ConfigurationError(
            "no logs among the files given: they are all parameter tables or tables of tests",
            code="no-log",
        )
    groups = by_damper(batch, is_one=is_one)
    beside = tuple(map(folder_name, groups)) if len(groups) > 1 else ()
    options, output = configuration.hold_out, configuration.output
    if beside and not watch.cancelled():
        part(replace(batch), options, named)  # a pattern that fits no log at all is refused
    prepared = []
    for owner, mine in groups.items():
        own = configuration
        if not watch.cancelled():
            held_out = fitting(mine, options, named) if beside else options
            own = prepare(configuration, mine, held_out, named)
        if beside:
            own = replace(own, output=output.but(folder=output.folder / folder_name(owner)))
        prepared.append((owner, own, mine))
    for owner, own, mine in prepared:
        run, failures = _fitted(own, mine, clock=clock, jobs=workers, watch=watch)
        if beside:
            run.record["folders_of_this_run"] = list(beside)
        yield Identified(owner, own, run, failures, beside)


def gather(
    configuration: Configuration, logs: Sequence[str] | None, **how: Any
) -> tuple[LogBatch, Mapping[str, Sequence[Path]]]:
    """Read the logs and what is held out beside them; return also the files of each pattern."""
    paths = () if logs is None else expand(logs)
    named = named_files(configuration.hold_out.patterns, paths)
    held_out = (path for several in named.values() for path in several)
    return read_batch(tuple(dict.fromkeys((*paths, *held_out))), configuration, **how), named


def _fitted(
    configuration: Configuration, batch: LogBatch, *, clock: Clock, jobs: int, watch: Watch
) -> tuple[Run, tuple[Failure, ...]]:
    """Fit and judge the logs of one damper."""
    from damperfit.run.record import FailureLog, judge, run_of

    watch.on_start(len({trace.setting for trace in batch.traces}))
    with clock.lap("fit"):
        campaign = _fits(configuration, batch, jobs=jobs, watch=watch)
    failure_log = FailureLog(batch)
    if campaign.failure is not None:
        failure_log.add(campaign.failure)
    campaign, judgement = judge(
        configuration,
        batch,
        campaign,
        failure_log,
        clock=clock,
        cancelled=watch.cancelled,
        jobs=jobs,
    )
    if not (is_interrupted := watch.cancelled()):
        note_unpredicted(batch, campaign, judgement.predictions, failure_log.failures)
    logs = [(fit, log) for fit in campaign.fits for log in fit.logs]
    with clock.lap("characteristics"):
        rows = _characteristics(configuration, logs, failure_log, jobs=jobs)
    readable = [log for log, of_log in zip(logs, rows, strict=True) if of_log is not None]
    run, failures = run_of(
        configuration,
        batch,
        campaign,
        judgement,
        failure_log,
        characteristics=[row for of_log in rows for row in of_log or ()],
        signals=lambda: _signals(configuration, readable),
        is_interrupted=is_interrupted,
    )
    run.record["timings"] = clock.read()
    return run, failures


def _fits(configuration: Configuration, batch: LogBatch, *, jobs: int, watch: Watch) -> Campaign:
    """Return the fits of all settings; none where there is no log, or the user has stopped."""
    from damperfit.identification import Campaign, identify

    damper, options = configuration.damper, configuration.identification
    if not batch.traces or watch.cancelled():
        return Campaign(options.procedure, (), named=damper.quantities)

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
        batch.traces, damper, options, jobs=jobs, on_fit=note, cancelled=watch.cancelled
    )


def _characteristics(
    configuration: Configuration,
    logs: Sequence[tuple[Fit, LogFit]],
    failure_log: FailureLog,
    *,
    jobs: int,
) -> list[list[dict[str, Any]] | None]:
    """Return the characteristics of each log; None where it cannot be simulated."""
    from damperfit.tables.rows import characteristic_rows

    damper, solver = configuration.damper, configuration.identification.solver
    unseen = told_here(failure_log.at("simulating the response of"))
    unread = told_here(failure_log.at("reading the characteristics of"))

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

    return list(apart(rows_of, logs, jobs=jobs))


def _signals(
    configuration: Configuration, logs: Sequence[tuple[Fit, LogFit]]
) -> Iterator[LogSignals]:
    """Yield the signals of each log as the fit saw it last, one by one: they are large."""
    from damperfit.tables.rows import signals_of

    damper, solver = configuration.damper, configuration.identification.solver
    for fit, log in logs:
        yield signals_of(fit.setting, log.trace, log.compared(fit.parameters, damper, solver))
