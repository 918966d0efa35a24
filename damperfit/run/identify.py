"""The whole of `identify` on one page: logs in, a `Run` of each damper out.

    paths -> read and condition each log -> sort, check, hold out -> fit -> judge -> Run

Failures of single logs and settings are collected; what can be done is done. Nothing is written
here but by `written`, which saves each run. What comes after reading is loaded while copies of this
process read.
"""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from damperfit.configuration.options import Configuration, unmatched
from damperfit.errors import ConfigurationError, OutputError
from damperfit.identification.fit_setting import Fit
from damperfit.identification.logs import LogFit, compare
from damperfit.identification.procedures import Campaign
from damperfit.problem import Failure, Option
from damperfit.recording import Trace
from damperfit.run.log_files import expand
from damperfit.run.logs import LogBatch, add_traces, read_batch
from damperfit.run.preparation import (
    by_damper,
    fitting,
    folder_name,
    named_files,
    note_unpredicted,
    part,
    prepare,
)
from damperfit.store import check_writable, reserved
from damperfit.tested.setting import Setting
from damperfit.workers import available_cores, executor

if TYPE_CHECKING:
    from damperfit.results import Run
    from damperfit.run.auto_model import LawChoice
    from damperfit.tables.files import LogSignals


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
            elapsed = time.perf_counter() - begin
            _LOGGER.debug("%s took %.3f s", name, elapsed)
            self._laps[f"{name}_s"] = round(self._laps.get(f"{name}_s", 0.0) + elapsed, 4)

    def read(self) -> dict[str, float]:
        """Return the seconds of each part, and of all."""
        return self._laps | {"total_s": round(time.perf_counter() - self._started, 4)}


@dataclass(slots=True, eq=False, repr=False)
class Identified:
    """One damper, identified: its serial number or name, with what it was fitted, what was found.

    `failures` are logs and settings without a result, and where internal errors happened; `folders`
    the folders of all dampers of the command, none where there is one; `error` says why it, or its
    report, is not written. `keeps_earlier`: nothing was fitted, and the folder keeps the results
    that it had.
    """

    owner: str
    configuration: Configuration
    run: Run
    failures: tuple[Failure, ...] = ()
    folders: tuple[str, ...] = ()
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
    from damperfit.tables.files import forget_others, holds_fits, spare_others

    folder = configuration.output.folder
    check_writable(folder)
    with reserved(folder):
        spare_others(folder)
        for result in identified(configuration, logs, **how):
            check_writable(result.folder)
            if not result.run.settings:
                result.keeps_earlier = not result.is_interrupted and holds_fits(result.folder)
            if result.run.settings or not (result.is_interrupted or result.keeps_earlier):
                try:
                    result.run.save(result.folder)
                    result.run.stand_in(result.folder)
                except (OutputError, ConfigurationError) as error:
                    result.error = error
            if result.run.settings and result.error is None:
                forget_others(folder, result.folders or ("",))
            yield result


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
        )
    add_traces(batch, traces, setting)
    if not batch.logs and not watch.cancelled():
        raise ConfigurationError(
            "no logs among the files given: they are all parameter tables or tables of tests",
            code="no-log",
        )
    groups = by_damper(batch, is_one=is_one)
    folders = tuple(map(folder_name, groups)) if len(groups) > 1 else ()
    options, output = configuration.hold_out, configuration.output
    if folders and not watch.cancelled():
        part(replace(batch), options, named)  # a pattern that fits no log at all is refused
    prepared = []
    for owner, mine in groups.items():
        own = configuration
        if not watch.cancelled():
            held_out = fitting(mine, options, named) if folders else options
            own = prepare(configuration, mine, held_out, named)
        if folders:
            own = replace(own, output=output.but(folder=output.folder / folder_name(owner)))
        prepared.append((owner, own, mine))
    for owner, own, mine in prepared:
        run, failures = fitted(own, mine, clock=clock, jobs=workers, watch=watch)
        if folders:
            run.record["folders_of_this_run"] = list(folders)
        yield Identified(owner, own, run, failures, folders)


def gather(
    configuration: Configuration, logs: Sequence[str] | None, **how: Any
) -> tuple[LogBatch, Mapping[str, Sequence[Path]]]:
    """Read the logs and what is held out beside them; return also the files of each pattern."""
    paths = () if logs is None else expand(logs)
    named = named_files(configuration.hold_out.patterns, paths)
    held_out = (path for several in named.values() for path in several)
    return read_batch(tuple(dict.fromkeys((*paths, *held_out))), configuration, **how), named


def fitted(
    configuration: Configuration,
    batch: LogBatch,
    *,
    clock: Clock | None = None,
    jobs: int | None = None,
    watch: Watch = Watch(),
) -> tuple[Run, tuple[Failure, ...]]:
    """Fit and judge the logs of one damper as they are: sorted, checked and parted already."""
    from damperfit.run.record import FailureLog, judge, run_of
    from damperfit.tables.rows import characteristic_rows, signals_of

    clock, jobs = clock or Clock(), jobs or available_cores()
    damper, solver = configuration.damper, configuration.identification.solver
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
    lose = failure_log.at("simulating the response of")
    speeds = configuration.output.speeds

    def rows_of(pair: tuple[Fit, LogFit]) -> list[dict[str, Any]] | None:
        fit, log = pair
        try:
            response = compare(fit.parameters, log.trace, damper, solver=solver)
            return list(characteristic_rows(fit.setting, log.trace, response, damper, speeds))
        except Exception as error:  # noqa: BLE001 - the other logs have theirs
            lose(log.trace, error)
            return None

    with clock.lap("characteristics"), executor(jobs) as pool:
        rows = list(pool.map(rows_of, logs))
    readable = [log for log, of_log in zip(logs, rows, strict=True) if of_log is not None]

    def signals() -> Iterator[LogSignals]:
        # Of each log as the fit saw it last, one by one: they are large.
        for fit, log in readable:
            response = compare(fit.parameters, log.trace, damper, solver=solver)
            yield signals_of(fit.setting, log.trace, response)

    run, failures = run_of(
        configuration,
        batch,
        campaign,
        judgement,
        failure_log,
        characteristics=[row for of_log in rows for row in of_log or ()],
        signals=signals,
        is_interrupted=is_interrupted,
    )
    run.record["timings"] = clock.read()
    return run, failures


def _fits(configuration: Configuration, batch: LogBatch, *, jobs: int, watch: Watch) -> Campaign:
    """Return the fits of all settings; none where there is no log, or the user has stopped."""
    from damperfit.identification.procedures import Campaign, identify

    damper, options = configuration.damper, configuration.identification
    if not batch.traces or watch.cancelled():
        return Campaign(options.procedure, (), quantities=damper.quantities)

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
