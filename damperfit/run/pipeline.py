"""The whole story on one page: logs in, parameters and reports out.

    expand -> read and condition each log -> identify -> tables -> files

Failures of single logs and settings are collected; what can be done is done and written. What comes
after reading (`after_reading`) is loaded while copies of this process read.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from importlib import import_module
from itertools import chain
from typing import TYPE_CHECKING

from damperfit.configuration.what_is_tested import unmatched
from damperfit.damper.warmed import Warmed
from damperfit.errors import ConfigurationError
from damperfit.problem import Option
from damperfit.run.dampers import by_damper, folder_name
from damperfit.run.earlier import forget_others
from damperfit.run.given_traces import with_traces
from damperfit.run.hold_out import (
    Parted,
    fitting,
    named_files,
    part,
    with_transients,
)
from damperfit.run.log_paths import expand
from damperfit.run.logs import read_batch
from damperfit.run.unwritten import UnwrittenError
from damperfit.run.watching import Clock, Watch
from damperfit.store import check_writable, reserved
from damperfit.workers import available_cores

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from damperfit.configuration.options import Configuration
    from damperfit.recording import Trace
    from damperfit.run.result import RunResult
    from damperfit.tested.setting import Setting

__all__ = ["find_each", "run", "run_each"]


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
    ((_, result),) = run_each(
        configuration, logs,
        jobs=jobs, setting=setting, traces=traces, watch=watch, is_one=True,
    )  # fmt: skip
    return result


def run_each(  # noqa: PLR0913 - what `run` takes
    configuration: Configuration,
    logs: Sequence[str],
    *,
    jobs: int | None = None,
    setting: Setting | None = None,
    traces: Sequence[Trace] = (),
    watch: Watch = Watch(),
    is_one: bool = False,
) -> Iterator[tuple[str, RunResult]]:
    """Identify the dampers in the logs one after the other; each writes a set of its own.

    Several dampers write into folders of their own inside the results' folder, by serial number or
    name. Parameters and errors are those of `run`; each damper is yielded with its name, empty
    where there is one. With ``is_one`` logs of several are refused.
    """
    workers = jobs or available_cores()
    _check_adjusters(configuration)
    check_writable(configuration.output.folder)
    with reserved(configuration.output.folder):
        parts = _read(
            configuration, logs, jobs=workers, setting=setting, watch=watch, traces=traces
        )
        if is_one and len(parts) > 1:
            raise ConfigurationError(
                f"logs of {len(parts)} dampers: {', '.join(one.owner for one in parts)}; give the "
                "logs of one, or let damperfit identify on the command line give each a result"
            )
        for one in parts:
            try:
                result = one.run(watch)
                if result.campaign.fits:
                    forget_others(configuration.output.folder, [each.folder for each in parts])
                yield one.folder_owner, result
            except UnwrittenError as error:
                raise UnwrittenError(error, error.result, one.folder_owner) from error


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
        yield one.owner, one.find(watch)


def _check_adjusters(configuration: Configuration) -> None:
    """Refuse a joint fit in which what is declared to follow an adjuster is none of the model's."""
    damper = configuration.damper
    lost = unmatched(configuration.document["adjusters"], damper)
    if lost and configuration.identification.procedure == "joint":
        raise ConfigurationError(
            f"adjusters: {', '.join(lost)}: the model {damper.name} has no such quantity; there "
            f"are {', '.join((*damper.parts, *damper.names))}; name damper.model, or let {{model}} "
            "auto find it",
            model=Option("model"),
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
        if not self.folder_owner:
            return self._run(watch)
        check_writable(self.configuration.output.folder)
        with reserved(self.configuration.output.folder):
            return self._run(watch)

    def _run(self, watch: Watch) -> RunResult:
        from damperfit.run.after_reading import write_found

        return write_found(
            self.configuration,
            self.parted,
            clock=self.clock,
            jobs=self.jobs,
            watch=watch,
            beside=self.beside,
        )

    def find(self, watch: Watch) -> RunResult:
        """Fit and judge, and write nothing."""
        from damperfit.run.after_reading import found_in

        found, mishaps = found_in(
            self.configuration, self.parted, clock=self.clock, jobs=self.jobs, watch=watch
        )
        return found.result(mishaps.failures)


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
    if configuration.start_table is not None:
        from damperfit.run.given_starts import with_given_start

        configuration = with_given_start(configuration)
    folder = configuration.output.folder
    paths = expand(logs) if logs or not traces else ()
    named = named_files(configuration.hold_out.patterns, paths)
    paths = tuple(dict.fromkeys((*paths, *chain.from_iterable(named.values()))))
    with clock.lap("read_s"):
        batch = read_batch(
            paths,
            configuration,
            jobs=jobs,
            setting=setting,
            cancelled=watch.cancelled,
            beside=lambda: import_module("damperfit.run.after_reading"),
        )
    from damperfit.run.conditions import check_temperatures, with_reference, with_rod_remark
    from damperfit.run.duplicate_tests import (
        once_each,
        without_contradictions,
        without_contradictory_motions,
        without_copies,
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
