"""What a worker does: the logs of one damper to the rows of its part, written where they belong."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from pathlib import Path, PurePath
from typing import TYPE_CHECKING, Any

import pyarrow as pa

from damperfit import __version__
from damperfit.damper.warmed import Warmed
from damperfit.errors import DamperfitError, mishap_of
from damperfit.fleet.damper_tasks import (
    UNREADABLE,
    content_key,
    hash_of,
    in_unicode,
    owner_in_preamble,
)
from damperfit.fleet.parts import (
    SYMBOL,
    part_path,
    read_facts_of,
    renew_facts,
    touch,
    write_part,
)
from damperfit.fleet.sources import FleetLog, brought_here, head_of
from damperfit.fleet.stores import UnreachableError
from damperfit.queries.baseline import compared_record
from damperfit.run.labelling import labels_for
from damperfit.simulation.characteristics import NAMED_SPEEDS
from damperfit.tested.setting import ADJUSTER

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from damperfit.configuration.options import Configuration
    from damperfit.fleet.damper_tasks import DamperTask
    from damperfit.fleet.sources import Brought
    from damperfit.run.result import RunResult

__all__ = ["Done", "Job", "State", "do", "known", "try_log"]

_WORK = "the work on the logs of one damper"
_REFERENCE = "reference_temperature_degC"


class State(Enum):
    """How a task ended."""

    FITTED = "fitted"
    FAILED = "failed"  # no setting could be fitted; a part says why
    KNOWN = "known"  # a part of an earlier run was there
    LATER = "later"  # nothing was written; the next run tries again


@dataclass(frozen=True, slots=True)
class Done:
    """What became of one task.

    Attributes
    ----------
    owner : str
        Whose logs.
    state : State
        How it ended.
    n_logs : int
        Logs of the task.
    n_settings : int
        Settings with a fit.
    failures : tuple of str
        One sentence each; of a part that was there they are not said again.
    gates : tuple of str
        Gates that were missed, likewise.
    n_failures, n_gates : int
        How many, said or not.
    """

    owner: str
    state: State
    n_logs: int
    n_settings: int = 0
    failures: tuple[str, ...] = ()
    gates: tuple[str, ...] = ()
    n_failures: int = 0
    n_gates: int = 0

    @classmethod
    def later(cls, task: DamperTask, said: str) -> Done:
        """Return a task that was not done, with the reason."""
        return cls(task.owner, State.LATER, len(task.logs), failures=(said,), n_failures=1)


@dataclass(frozen=True, slots=True)
class Job:
    """A task as it goes to a worker; everything in it can be pickled.

    Attributes
    ----------
    task : DamperTask
        The logs.
    configuration : Configuration
        What is done with them.
    folder : pathlib.Path
        Of the fleet.
    dead : tuple of (str, str)
        Place of each log that has ended a worker, and the sentence that says so; it is left out.
    """

    task: DamperTask
    configuration: Configuration
    folder: Path
    dead: tuple[tuple[str, str], ...] = ()


def do(job: Job) -> Done:
    """Fit one damper and write its part, unless the part is there.

    Never raises for anything that is wrong with the logs: that becomes rows of the part.

    Raises
    ------
    OutputError
        The part cannot be written.
    """
    task = job.task
    try:
        with brought_here((*task.logs, *task.tables)) as here:
            return _done(job, here)
    except UnreachableError as error:
        return Done.later(task, str(error))


def known(job: Job) -> Done | None:
    """Return what the part of a task says, where it is there; nothing is fetched for that."""
    task = job.task
    # Nothing is hashed, once here and once by the worker, where there can be no part.
    if not part_path(job.folder, task.owner, "").parent.is_dir():
        return None
    entries: list[tuple[PurePath, str]] = []
    for one in (*task.logs, *task.tables):
        if not one.is_remote:
            entries.append((Path(one.place), hash_of(Path(one.place))))
        elif one.seen is not None:
            entries.append((one.fetched_to, one.seen.sha256))
        else:
            return None
    return _known(task, part_path(job.folder, task.owner, content_key(entries, job.configuration)))


def _known(task: DamperTask, path: Path) -> Done | None:
    if not path.exists() or not (facts := read_facts_of(path)):
        return None
    touch(path)
    n_settings, n_failures, n_gates = (
        facts.get(name, 0) for name in ("settings", "failures", "gates")
    )
    return Done(
        *(task.owner, State.KNOWN, len(task.logs), n_settings),
        n_failures=n_failures,
        n_gates=n_gates,
    )


def _done(job: Job, brought: Brought) -> Done:
    task, configuration, here = job.task, job.configuration, brought.paths
    hashes = {one: hash_of(path) for one, path in here.items()}
    key = content_key(((here[one], digest) for one, digest in hashes.items()), configuration)
    path = part_path(job.folder, task.owner, key)
    seen = _seen(brought, hashes)
    if before := _known(task, path):
        if seen:  # another time of change, the same bytes: not to be fetched each time from now on
            renew_facts(path, seen=seen)
        return before
    facts: dict[str, Any] = {
        "key": key,
        "version": __version__,
        "logs": sorted({hashes[one] for one in task.logs} - {UNREADABLE}),
        "places": sorted(one.place for one in task.logs),
        **({"seen": seen} if seen else {}),
    }
    dead = {place for place, _ in job.dead}
    rows: list[dict[str, Any]] = []
    gates: list[str] = []
    records: list[dict[str, Any]] = []
    failed = list(_dead_rows(job, here))
    living = [str(here[one]) for one in task.logs if one.place not in dead]
    try:
        for owner, result in _results(configuration, living):
            rows += list(_rows(result, owner or task.owner))
            gates += result.facts.gates
            records.append(compared_record(result.record))
            failed += [
                _failure(one.log, one.kind, one.message, owner or task.owner, one.setting)
                for one in result.facts.failures
            ]
    except (MemoryError, OSError):
        raise  # of the machine, not of the logs: tried again another time
    except DamperfitError as error:
        failed.append(_failure("", type(error).__name__, str(error)))
    except Exception as error:  # noqa: BLE001 - the other dampers of the fleet go on
        bug = mishap_of(error, _WORK)
        failed.append(_failure("", bug.kind, bug.message))
    for one in failed:
        one["error"] = _named(str(one["error"]), task, here)
    facts |= {"settings": len(rows), "failures": len(failed), "gates": len(gates)}
    schema = _schema(configuration)
    table = pa.Table.from_pylist(
        [{"damper": task.owner, **row} for row in (*rows, *failed)], schema
    )
    # Rows of several dampers are no one run.
    write_part(path, table, facts, records[0] if len(records) == 1 and rows else None)
    return Done(
        task.owner,
        State.FITTED if rows else State.FAILED,
        len(task.logs),
        len(rows),
        tuple(str(one["error"]) for one in failed),
        tuple(gates),
        len(failed),
        len(gates),
    )


def _seen(brought: Brought, hashes: Mapping[FleetLog, str]) -> dict[str, tuple[str, str, str]]:
    """Return what the next run needs to know of objects that it then need not fetch."""
    found = {}
    for one, stamp in brought.stamps.items():
        if stamp:
            owner = owner_in_preamble(head_of(FleetLog(str(brought.paths[one]), one.name)))
            found[one.place] = (stamp, hashes[one], owner)
    return found


def _dead_rows(job: Job, here: Mapping[FleetLog, Path]) -> Iterator[dict[str, Any]]:
    """Yield the rows of logs that have ended a worker, with the setting as far as it is known."""
    if not job.dead:
        return
    said = dict(job.dead)
    labels = labels_for([here[one] for one in job.task.logs], job.configuration, setting=None)
    for one in job.task.logs:
        if one.place in said:
            setting = labels.unread(here[one], job.configuration.reading)
            yield _failure(one.file, "WorkerDied", said[one.place], setting=setting)


def _named(message: str, task: DamperTask, here: Mapping[FleetLog, Path]) -> str:
    """Return a message with logs by their names, wherever they were when they were read."""
    for log in task.logs:
        for spelled in (str, in_unicode):
            message = message.replace(spelled(str(here[log])), in_unicode(log.name))
    return in_unicode(message)


def _results(configuration: Configuration, logs: Sequence[str]) -> Iterator[tuple[str, RunResult]]:
    from damperfit.run.pipeline import find_each

    return find_each(configuration, logs, jobs=1) if logs else iter(())


def try_log(job: Job) -> Done:
    """Do the work on one log alone and write nothing: it tells whether the log ends its worker."""
    task = job.task
    with brought_here((*task.logs, *task.tables)) as here:
        try:
            for _ in _results(job.configuration, [str(here.paths[one]) for one in task.logs]):
                pass
        except Exception:  # noqa: BLE001, S110 - the whole task says what is wrong with it
            pass
    return Done(task.owner, State.LATER, len(task.logs))


def _failure(
    log: str, kind: str, message: str, damper: str | None = None, setting: object = None
) -> dict[str, Any]:
    row = {"log": in_unicode(log), "error_kind": kind, "error": message}
    row |= {} if damper is None else {"damper": damper}
    return row | ({} if setting is None else {"setting": str(setting)})


def _rows(result: RunResult, damper: str) -> Iterator[dict[str, Any]]:
    """Yield one row a setting: parameters, whose it is, forces at named speeds."""
    from damperfit.tables.columns import adjusters_in

    known = result.record["test"]
    forces: dict[str, dict[str, float]] = {}
    for row in result.tables.adjustment.to_pylist():
        name = _force_column(row["stroke"], row["speed_m_per_s"])
        forces.setdefault(str(row["setting"]), {})[name] = row["force_N"]
    for row in result.tables.parameters.to_pylist():
        names = adjusters_in(list(row), result.tables.quantities)
        places = {name: str(row[name]) for name in names}
        setting = str(row["setting"])
        yield {
            **row,
            **places,
            **forces.get(setting, {}),
            "setting": setting,
            "damper": damper,
            "date": known.get("date"),
            _REFERENCE: result.record["configuration"]["damper"]["reference_temperature"],
        }


def _force_column(stroke: str, speed: float) -> str:
    return f"force_{stroke}_{1000.0 * speed:.0f}_mm_per_s_N"


def _schema(configuration: Configuration) -> pa.Schema:
    """Return the columns of a part: the same for every damper of one configuration.

    A setting is text here, as labels of some dampers are numbers and of others words.
    """
    from damperfit.tables.columns import table_schema

    names = configuration.reading.adjusters
    own = table_schema("parameters", {}, settings=(), quantities=configuration.damper.quantities)
    symbols = {one.name: one.symbol for one in configuration.damper.quantities}
    quantities = [_with_symbol(one, symbols) for one in own if one.name != ADJUSTER]
    places = [] if names == (ADJUSTER,) else [pa.field(name, pa.string()) for name in names]
    forces = [
        pa.field(_force_column(stroke, speed), pa.float64())
        for stroke in ("rebound", "bump")
        for speed in NAMED_SPEEDS
    ]
    texts = [pa.field(name, pa.string()) for name in ("log", "error_kind", "error")]
    first = [pa.field(name, pa.string()) for name in ("damper", "date", "setting")]
    # Of a damper that follows the temperature: where its resistances and forces hold.
    is_warmed = isinstance(configuration.damper, Warmed)
    warmth = [pa.field(_REFERENCE, pa.float64())] if is_warmed else []
    return pa.schema([*first, *places, *quantities, *warmth, *forces, *texts])


def _with_symbol(field: pa.Field, symbols: Mapping[str, str]) -> pa.Field:
    """Return a column that tells its symbol: of all metadata a column's own is collected."""
    if field.name not in symbols:
        return field
    return field.with_metadata({**(field.metadata or {}), SYMBOL: symbols[field.name].encode()})
