"""A whole run of `fleet`: logs -> tasks -> parts; what ends a worker costs itself alone."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from damperfit.errors import ConfigurationError, mishap_of
from damperfit.fleet.damper_tasks import DamperTask, parted, tasks_by_damper
from damperfit.fleet.one_damper import Done, Job, do, known, try_log
from damperfit.fleet.parts import forget_earlier, tidy
from damperfit.fleet.sources import find_sources
from damperfit.fleet.unchanged import recognised
from damperfit.parallel import Died

if TYPE_CHECKING:
    from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
    from pathlib import Path

    from damperfit.configuration.options import Configuration
    from damperfit.fleet.damper_tasks import Share
    from damperfit.fleet.sources import FleetLog
    from damperfit.parallel import Executor

__all__ = ["planned", "run_fleet"]

_DIED = (
    "{}: reading or fitting this log killed its worker process twice; it is left out: check the "
    "log and the machine's memory"
)


def planned(
    configuration: Configuration, logs: Sequence[str], folder: Path, share: Share | None = None
) -> tuple[DamperTask, ...]:
    """Return the tasks of a fleet: one damper each, of the share that is asked for.

    Parameters
    ----------
    configuration : Configuration
        Adjusters, table of tests.
    logs : sequence of str
        Folders, files, patterns, addresses in object stores.
    folder : pathlib.Path
        Of the fleet; what stands in it is no log.
    share : Share, optional
        Part I of N.

    Raises
    ------
    ConfigurationError
        There is no log, or a table of tests is wrong.
    """
    own = folder.resolve()
    sources = tuple(one for one in find_sources(logs) if not _is_inside(one, own))
    if not sources:
        raise ConfigurationError(f"{', '.join(logs)}: no log there but in {folder} itself")
    return parted(tasks_by_damper(recognised(sources, folder), configuration), share)


def _is_inside(source: FleetLog, folder: Path) -> bool:
    from pathlib import Path

    return not source.is_remote and folder in Path(source.place).parents


@dataclass(frozen=True, slots=True, eq=False)
class _Fleet:
    engine: Executor
    configuration: Configuration
    folder: Path
    cancelled: Callable[[], bool]

    def job(self, task: DamperTask) -> Job:
        return Job(task, self.configuration, self.folder)

    def tried(self, jobs: Iterable[Job]) -> Generator[Done, None, list[Job]]:
        """Yield what became of jobs, and return those that ended their worker."""
        died = []
        for job, found in self.engine.each(do, jobs, cancelled=self.cancelled):
            if isinstance(found, Died):
                died.append(job)
            elif isinstance(found, Exception):  # of the disk, or a bug
                yield Done.later(job.task, mishap_of(found, "the work on one damper").message)
            else:
                yield found
        return died

    def rescued(self, job: Job) -> Iterator[Done]:
        """Yield a job whose worker dies, done without the logs that end it."""
        died = yield from self.tried([self.without_what_kills(job)])
        for one in died:
            yield Done.later(
                one.task, "its workers die, though no single log is the cause; nothing was written"
            )

    def without_what_kills(self, job: Job) -> Job:
        """Return a job that leaves out the logs that end a worker by themselves."""
        alone = [replace(job, task=replace(job.task, logs=(log,))) for log in job.task.logs]
        for _ in range(2):
            found = self.engine.each(try_log, alone, cancelled=self.cancelled)
            alone = [one for one, result in found if isinstance(result, Died)]
        # Where none does it alone something else ended the workers, as too little memory does.
        logs = [one.task.logs[0] for one in alone]
        return replace(job, dead=tuple((log.place, _DIED.format(log.file)) for log in sorted(logs)))


def run_fleet(
    configuration: Configuration,
    tasks: Sequence[DamperTask],
    folder: Path,
    engine: Executor,
    *,
    cancelled: Callable[[], bool] = lambda: False,
) -> Iterator[Done]:
    """Do the tasks of a fleet whose parts are not there, in any order, and yield each when done.

    A task whose worker dies is given to another one. Where that dies too, each of its logs is tried
    alone, those that end their worker are left out with a row that says so, and the others are
    fitted.

    Parameters
    ----------
    configuration : Configuration
        What is done with the logs.
    tasks : sequence of DamperTask
        From `planned`.
    folder : pathlib.Path
        Where the parts go.
    engine : Engine
        Who does the work.
    cancelled : callable
        Once it says True nothing more is begun.
    """
    tidy(folder)
    fleet = _Fleet(engine, configuration, folder, cancelled)
    waiting: list[Job] = []
    for task in tasks:
        if cancelled():
            return
        # Asked here, so that no worker is started where there is nothing to do.
        try:
            before = known(fleet.job(task))
        except (OSError, ValueError) as error:
            yield Done.later(task, mishap_of(error, "looking for its part").message)
            continue
        if before:
            yield before
        else:
            waiting.append(fleet.job(task))
    for _ in range(2):
        waiting = yield from fleet.tried(waiting)
    for job in waiting:
        if not cancelled():
            yield from fleet.rescued(job)
    forget_earlier(folder)
