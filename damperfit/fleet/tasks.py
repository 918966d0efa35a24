"""Logs parted into tasks, one damper each, and the key that says whether a task has been done."""

from __future__ import annotations

import hashlib
import json
import re
from collections import defaultdict
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from damperfit import __version__
from damperfit.errors import ConfigurationError
from damperfit.fleet.sources import brought_here, head_of
from damperfit.identity import identity_in
from damperfit.readers import TestsTable, is_tests_table, read_tests
from damperfit.recording import natural_order

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from damperfit.configuration.options import Configuration
    from damperfit.fleet.sources import Source

__all__ = ["UNREADABLE", "Share", "Task", "content_key", "parted", "share_of", "tasks_of"]

TABLE_OF_TESTS = "tests.csv"
UNREADABLE = "unreadable"
_ENTRY = re.compile(r"\s*[#;%/*!]*\s*([^:=\t;,]{1,40}?)\s*[:=\t;,]\s*(.+?)[\s;,]*$")
# What changes where results stand, or who is told, and not the results.
_NOT_OF_RESULTS = {"output"}


@dataclass(frozen=True, slots=True)
class Task:
    """The logs of one damper.

    Attributes
    ----------
    owner : str
        Serial number, else the damper's name, else the folder of its logs.
    logs : tuple of Source
        Its logs, in order.
    tables : tuple of Source
        Tables of tests that stand beside them.
    """

    owner: str
    logs: tuple[Source, ...]
    tables: tuple[Source, ...] = ()


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

    def takes(self, task: Task) -> bool:
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


def tasks_of(sources: Sequence[Source], configuration: Configuration) -> tuple[Task, ...]:
    """Part logs by damper: the table of tests, else the log's preamble, else its folder says whose.

    Parameters
    ----------
    sources : sequence of Source
        The logs, with tables of tests among them.
    configuration : Configuration
        Adjusters and table of tests.

    Raises
    ------
    ConfigurationError
        A table of tests is wrong, or there is no log.
    """
    tables = [one for one in sources if one.file.lower() == TABLE_OF_TESTS and _is_table(one)]
    logs = [one for one in sources if one not in set(tables)]
    if not logs:
        raise ConfigurationError("no logs among the files given: they are all tables of tests")
    rows = _rows(tables, configuration)
    owners: dict[str, list[Source]] = defaultdict(list)
    for log in logs:
        owners[_owner(log, rows) or configuration.test.identity.owner or log.folder].append(log)
    beside = {(_where(one), one.folder): one for one in tables}
    return tuple(
        Task(owner, tuple(mine), tuple(dict.fromkeys(_beside(mine, beside))))
        for owner, mine in sorted(owners.items(), key=lambda entry: natural_order(entry[0]))
    )


def _where(source: Source) -> str:
    place = source.place if source.is_remote else source.place.replace("\\", "/")
    return place.rsplit("/", 1)[0] if "/" in place else ""


def _beside(logs: Iterable[Source], tables: Mapping[tuple[str, str], Source]) -> Iterable[Source]:
    for log in logs:
        if table := tables.get((_where(log), log.folder)):
            yield table


def _is_table(source: Source) -> bool:
    if source.is_remote:
        with brought_here([source]) as here:
            return is_tests_table(here[source])
    return is_tests_table(Path(source.place))


def _rows(tables: Sequence[Source], configuration: Configuration) -> dict[tuple[str, str], str]:
    """Return whose a log is, by its folder and name, as far as tables of tests say it."""
    adjusters = configuration.reading.adjusters
    found: dict[tuple[str, str], str] = {}
    given = configuration.test.table
    if given is not None:  # then it alone speaks, as in `identify`
        return {("", name): owner for name, owner in _told(read_tests(given, adjusters))}
    with brought_here(tables) as here:
        for source, path in here.items():
            for name, owner in _told(read_tests(path, adjusters)):
                found.setdefault((_where(source), name), owner)
    return found


def _told(table: TestsTable) -> Iterable[tuple[str, str]]:
    return ((name, row.identity.owner) for name, row in table.rows.items() if row.identity.owner)


def _owner(log: Source, rows: Mapping[tuple[str, str], str]) -> str:
    folder = _where(log)
    owner = rows.get((folder, log.file)) or rows.get(("", log.file)) or rows.get(("", log.name))
    return owner or _in_preamble(log)


def _in_preamble(log: Source) -> str:
    """Return whose a log of text says it is, in the lines before its numbers."""
    text = head_of(log).decode("utf-8", "replace")
    if "\0" in text:
        return ""
    entries = (_ENTRY.match(line) for line in text.splitlines()[:60])
    return identity_in({one[1]: one[2] for one in entries if one}).owner


def parted(tasks: Iterable[Task], share: Share | None) -> tuple[Task, ...]:
    """Return the tasks of a share; all of them where none is asked for."""
    return tuple(task for task in tasks if share is None or share.takes(task))


def content_key(files: Sequence[Path], configuration: Configuration) -> tuple[str, dict[Path, str]]:
    """Return the key of what a task's result depends on, and the hash of each file.

    Parameters
    ----------
    files : sequence of pathlib.Path
        Logs and tables of tests.
    configuration : Configuration
        What is done with them.

    Returns
    -------
    str
        Of the files' bytes and names, of which stand in one folder (a table of tests speaks for
        those), the configuration and the version of damperfit; not of the folders' names.
    dict of pathlib.Path to str
        SHA-256 of each file, hexadecimal; `UNREADABLE` where it cannot be opened.
    """
    hashes = {path: _hash(path) for path in files}
    folders: dict[Path, list[tuple[str, str]]] = defaultdict(list)
    for path, digest in hashes.items():
        folders[path.parent].append((path.name, digest))
    document = {k: v for k, v in configuration.document.items() if k not in _NOT_OF_RESULTS}
    table = configuration.test.table
    told = {
        "version": __version__,
        "configuration": document,
        "checks": list(configuration.output.checks),
        "max_mse_percent": configuration.output.max_mse_percent,
        "table": None if table is None else _hash(table),
        "folders": sorted(sorted(entries) for entries in folders.values()),
    }
    text = json.dumps(told, sort_keys=True, default=str)
    return hashlib.sha256(text.encode()).hexdigest()[:24], hashes


def _hash(path: Path) -> str:
    try:
        with path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except OSError:
        return UNREADABLE
