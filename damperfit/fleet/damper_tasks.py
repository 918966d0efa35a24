"""Logs parted into tasks, one damper each, and the key that says whether a task has been done."""

from __future__ import annotations

import hashlib
import json
import re
from collections import defaultdict
from dataclasses import dataclass
from typing import TYPE_CHECKING

from damperfit import __version__
from damperfit.errors import ConfigurationError
from damperfit.fleet.sources import brought_here, head_of
from damperfit.fleet.unchanged import AT_ONCE
from damperfit.parallel import executor
from damperfit.readers import TestsTable, is_tests_table, read_tests
from damperfit.recording import natural_order
from damperfit.run.work import sha256_of
from damperfit.tested.identity import identity_in

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence
    from pathlib import Path, PurePath

    from damperfit.configuration.options import Configuration
    from damperfit.fleet.sources import FleetLog

__all__ = [
    "UNREADABLE",
    "DamperTask",
    "Share",
    "content_key",
    "hash_of",
    "in_unicode",
    "owner_in_preamble",
    "parted",
    "share_of",
    "tasks_by_damper",
]

TABLE_OF_TESTS = "tests.csv"
UNREADABLE = "unreadable"
_ENTRY = re.compile(r"\s*[#;%/*!]*\s*([^:=\t;,]{1,40}?)\s*[:=\t;,]\s*(.+?)[\s;,]*$")
# What changes where results stand, or who is informed, and not the results.
_NOT_OF_RESULTS = {"output"}


@dataclass(frozen=True, slots=True)
class DamperTask:
    """The logs of one damper.

    Attributes
    ----------
    owner : str
        Serial number, else the damper's name, else the folder of its logs.
    logs : tuple of FleetLog
        Its logs, in order.
    tables : tuple of FleetLog
        Tables of tests that stand beside them.
    """

    owner: str
    logs: tuple[FleetLog, ...]
    tables: tuple[FleetLog, ...] = ()


@dataclass(frozen=True, slots=True)
class Share:
    """Part I of N of a fleet, as a job array does it.

    Attributes
    ----------
    number, of : int
        1 <= number <= of.
    """

    number: int
    of: int

    def takes(self, task: DamperTask) -> bool:
        """Whether a task is of this share; every task is of one, whatever other tasks there are."""
        digest = hashlib.sha256(task.owner.encode("utf-8", "surrogatepass")).digest()
        return int.from_bytes(digest[:8], "big") % self.of == self.number - 1


def share_of(text: str) -> Share:
    """Return the share that ``I/N`` says.

    Raises
    ------
    ConfigurationError
        It says none.

    Examples
    --------
    >>> share_of("3/100")
    Share(number=3, of=100)
    """
    found = re.fullmatch(r"\s*(\d+)\s*/\s*(\d+)\s*", text)
    number, of = (int(part) for part in found.groups()) if found else (0, 0)
    if not 1 <= number <= of:
        raise ConfigurationError(
            f"--part {text}: expected I/N with I from 1 to N, such as 3/100 for the third of 100"
        )
    return Share(number, of)


def tasks_by_damper(
    sources: Sequence[FleetLog], configuration: Configuration
) -> tuple[DamperTask, ...]:
    """Part logs by damper: the table of tests, else the log's preamble, else its folder says whose.

    Parameters
    ----------
    sources : sequence of FleetLog
        The logs, with tables of tests among them.
    configuration : Configuration
        Adjusters and table of tests.

    Raises
    ------
    ConfigurationError
        A table of tests is wrong, or there is no log.
    """
    named = [one for one in sources if one.file.lower() == TABLE_OF_TESTS]
    with brought_here(named) as here:
        tables = [one for one in named if is_tests_table(here.paths[one])]
        logs = [one for one in sources if one not in set(tables)]
        if not logs:
            raise ConfigurationError("no logs among the files given: they are all tables of tests")
        rows = _rows({one: here.paths[one] for one in tables}, configuration)
    owners: dict[str, list[FleetLog]] = defaultdict(list)
    # In a store each log that is not known costs the time of an answer.
    with executor(AT_ONCE if any(one.is_remote for one in logs) else 1) as pool:
        for log, owner in zip(logs, pool.map(lambda one: _owner(one, rows), logs), strict=True):
            known = owner or configuration.test.identity.owner
            owners[known or in_unicode(log.folder)].append(log)
    beside = {(_where(one), one.folder): one for one in tables}
    return tuple(
        DamperTask(owner, tuple(mine), tuple(dict.fromkeys(_beside(mine, beside))))
        for owner, mine in sorted(owners.items(), key=lambda entry: natural_order(entry[0]))
    )


def _where(source: FleetLog) -> str:
    place = source.place if source.is_remote else source.place.replace("\\", "/")
    return place.rsplit("/", 1)[0] if "/" in place else ""


def _beside(
    logs: Iterable[FleetLog], tables: Mapping[tuple[str, str], FleetLog]
) -> Iterable[FleetLog]:
    for log in logs:
        if table := tables.get((_where(log), log.folder)):
            yield table


def _rows(
    tables: Mapping[FleetLog, Path], configuration: Configuration
) -> dict[tuple[str, str], str]:
    """Return whose a log is, by its folder and name, as far as tables of tests say it."""
    adjusters = configuration.reading.adjusters
    found: dict[tuple[str, str], str] = {}
    given = configuration.test.table
    if given is not None:  # then it alone speaks, as in `identify`
        return {("", name): owner for name, owner in _owners(read_tests(given, adjusters))}
    for source, path in tables.items():
        for name, owner in _owners(read_tests(path, adjusters)):
            found.setdefault((_where(source), name), owner)
    return found


def _owners(table: TestsTable) -> Iterable[tuple[str, str]]:
    return ((name, row.identity.owner) for name, row in table.rows.items() if row.identity.owner)


def _owner(log: FleetLog, rows: Mapping[tuple[str, str], str]) -> str:
    folder = _where(log)
    owner = rows.get((folder, log.file)) or rows.get(("", log.file)) or rows.get(("", log.name))
    if not owner:
        owner = owner_in_preamble(head_of(log)) if log.seen is None else log.seen.owner
    return owner


def in_unicode(name: str) -> str:
    r"""Return a name with bytes that are no UTF-8 as escapes: no table takes them as they are.

    Examples
    --------
    >>> print(in_unicode("D\udce4mpfer"))
    D\xe4mpfer
    """
    return name.encode("utf-8", "surrogateescape").decode("utf-8", "backslashreplace")


def owner_in_preamble(head: bytes) -> str:
    """Return whose a log of text says it is, in the lines before its numbers.

    Parameters
    ----------
    head : bytes
        Its first bytes, from `head_of`.
    """
    text = head.decode("utf-8", "replace")
    if "\0" in text:
        return ""
    entries = (_ENTRY.match(line) for line in text.splitlines()[:60])
    return identity_in({one[1]: one[2] for one in entries if one}).owner


def parted(tasks: Iterable[DamperTask], share: Share | None) -> tuple[DamperTask, ...]:
    """Return the tasks of a share; all of them where none is asked for."""
    return tuple(task for task in tasks if share is None or share.takes(task))


def content_key(entries: Iterable[tuple[PurePath, str]], configuration: Configuration) -> str:
    """Return the key of what a task's result depends on.

    It depends on the files' bytes and names, on which stand in one folder (a table of tests speaks
    for those), the configuration and the version of damperfit; not on the folders' names.

    Parameters
    ----------
    entries : iterable of (pathlib.PurePath, str)
        Logs and tables of tests, each with its hash from `hash_of`.
    configuration : Configuration
        What is done with them.
    """
    folders: dict[PurePath, list[tuple[str, str]]] = defaultdict(list)
    for path, digest in entries:
        folders[path.parent].append((path.name, digest))
    document = {k: v for k, v in configuration.document.items() if k not in _NOT_OF_RESULTS}
    table = configuration.test.table
    facts = {
        "version": __version__,
        "configuration": document,
        "checks": list(configuration.output.checks),
        "max_mse_percent": configuration.output.max_mse_percent,
        "table": None if table is None else hash_of(table),
        "folders": sorted(sorted(entries) for entries in folders.values()),
    }
    text = json.dumps(facts, sort_keys=True, default=str)
    return hashlib.sha256(text.encode()).hexdigest()[:24]


def hash_of(path: Path) -> str:
    """Return the SHA-256 of a file, hexadecimal; `UNREADABLE` where it cannot be opened."""
    try:
        # Whoever opens a pipe waits for somebody to write.
        return sha256_of(path) if path.is_file() else UNREADABLE
    except OSError:
        return UNREADABLE
