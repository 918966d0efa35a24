"""A table of tests: which file is which damper, at which setting, and whatever else is known.

One row a log, with the columns ``file``, each adjuster (or ``setting``, a label), those of
`Identity`, facts of the test (`FACTS`), and any others. Written by hand or saved by a spreadsheet:
comma, semicolon or tab, UTF-8 or Latin-1.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from damperfit.errors import ConfigurationError, did_you_mean
from damperfit.io.files import IrregularFileError, open_regular, read_bytes
from damperfit.problem import FilePlace
from damperfit.tested.identity import IDENTITY_KEYS, Identity, identity_in
from damperfit.tested.setting import ADJUSTER, Place, parse_place, parse_setting
from damperfit.units.quantities import parse_quantity, says_absolute_or_gauge

# What a log was tested at, where somebody says so, and its dimension.
FACTS = {
    "gas_pressure": "absolute pressure",
    "temperature": "temperature",
    "tare": "force",
    "skew": "time",
}
# What the test was; a tare or a skew that a log itself names may have been taken off already.
_OF_PREAMBLES = ("gas_pressure", "temperature")
_FILE = ("file", "log", "filename", "datei")
_MAX_BYTES = 10_000_000
_SHORT = 4  # letters; shorter names lie near too many words


def fact_of(key: str, text: str) -> float:
    """Return what somebody says of a test, a name of `FACTS`, SI or degrees Celsius."""
    value = parse_quantity(text, FACTS[key])
    if key == "gas_pressure" and not says_absolute_or_gauge(text):
        raise ValueError("expected a unit that says what it counts from, as in 5.6bara or 80psig")
    return value


def _key(name: str) -> str:
    return re.sub(r"[\W_]+", "_", name.casefold()).strip("_")


def facts_in(preamble: Mapping[str, str]) -> tuple[dict[str, float], tuple[str, ...]]:
    """Return the facts that a log's own preamble tells, and which lines say too little."""
    facts, notes = {}, []
    for name, text in preamble.items():
        try:
            if (key := _key(name)) in _OF_PREAMBLES:
                facts[key] = fact_of(key, text)
        except ValueError as error:
            notes.append(f"{name}: {text}: not used; {error}")
    return facts, tuple(notes)


@dataclass(frozen=True, slots=True)
class TestRow:
    """What a table says of one log.

    Attributes
    ----------
    line : int
        Of the table, from 1.
    places : mapping of str to Place
        Where adjusters stand; an empty cell says nothing.
    identity : Identity
        Whose it is.
    facts : mapping of str to float
        What it was tested at, SI, temperature in degrees Celsius: a name of `FACTS`.
    """

    __test__ = False  # no test of pytest's

    line: int
    places: Mapping[str, Place] = field(default_factory=dict)
    identity: Identity = Identity()
    facts: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class TestsTable:
    """A table of tests: its rows by file name as written, with ``/`` between folders."""

    __test__ = False

    path: Path
    rows: Mapping[str, TestRow]
    notes: tuple[str, ...] = ()  # what was doubtful in it


def is_tests_table(path: Path) -> bool:
    """Whether a file called ``tests.csv`` is a table of tests: its first line names a file."""
    if path.name.casefold() != "tests.csv":
        return False
    try:
        with open_regular(path) as file:
            first = _text(file.read(4096)).splitlines()
    except OSError:
        return False
    return bool(first) and _file_column(_fields(first[0], _separator(first[0]))) is not None


def read_tests(path: Path, adjusters: Sequence[str]) -> TestsTable:
    """Read a table of tests of a damper with these adjusters."""
    try:
        lines = _text(read_bytes(path, max_bytes=_MAX_BYTES)).splitlines()
    except (OSError, ValueError) as error:
        reason = f"cannot be read: {getattr(error, 'strerror', None) or error}"
        if isinstance(error, IrregularFileError):
            reason = f"{error.strerror}; this is not a table of tests"
        raise ConfigurationError(reason, subject=path, code="bad-table-of-tests") from error
    head = next((k for k, line in enumerate(lines) if line.strip()), None)
    if head is None:
        text = "is empty; expected a line of names, as in 'file,setting'"
        raise ConfigurationError(text, subject=path, code="bad-table-of-tests")
    separator = _separator(lines[head])
    names = _fields(lines[head], separator)
    at = _file_column(names)
    where = FilePlace(str(path), head + 1)
    if at is None:
        raise ConfigurationError(
            f"no column 'file'; found {', '.join(names[:10])}; name the one that holds the names "
            "of the logs 'file'",
            where=where,
            code="no-column",
        )
    if doubled := [name for name in names if name and names.count(name) > 1]:
        raise ConfigurationError(
            f"two columns are named '{doubled[0]}'", where=where, code="given-twice"
        )
    rows: dict[str, TestRow] = {}
    for k, line in enumerate(lines[head + 1 :], start=head + 2):
        cells, where = _fields(line, separator), FilePlace(str(path), k)
        if not any(cells):
            continue
        if len(cells) > len(names):
            raise ConfigurationError(
                f"{len(cells)} fields, but {len(names)} names in line {head + 1}; put a text "
                "that holds the separator in quotes",
                where=where,
                code="bad-row",
            )
        filled = {name: cell for name, cell in zip(names, cells, strict=False) if name and cell}
        file = filled.pop(names[at], "").replace("\\", "/").removeprefix("./")
        if not file:
            raise ConfigurationError(
                f"no file name in column '{names[at]}'", where=where, code="bad-table-of-tests"
            )
        row = _row(filled, adjusters, where)
        before = rows.setdefault(file, row)
        if (before.places, before.identity, before.facts) != (row.places, row.identity, row.facts):
            raise ConfigurationError(
                f"'{file}' is in line {before.line} too, with other values; leave one of the two "
                "out",
                where=where,
                code="bad-table-of-tests",
            )
    return TestsTable(path, rows, tuple(_misspelt(names, adjusters, path)))


def _row(filled: dict[str, str], adjusters: Sequence[str], where: FilePlace) -> TestRow:
    places: dict[str, Place] = {}
    facts: dict[str, float] = {}
    others = {}
    for name, cell in filled.items():
        key = _key(name)
        try:
            if key == ADJUSTER:
                places |= dict(parse_setting(cell, adjusters).places)
            elif key in adjusters:
                places[key] = parse_place(cell.replace(",", "."))
            elif key in FACTS:
                facts[key] = fact_of(key, cell)
            else:
                others[name] = cell
        except ValueError as error:
            raise ConfigurationError(
                f"{name}: found '{cell}', {error}", where=where, code="bad-table-of-tests"
            ) from error
    known = identity_in(others).describe()
    more = tuple((name, cell) for name, cell in others.items() if cell not in known.values())
    return TestRow(where.line, places, Identity(**known, more=more), facts)


def _misspelt(names: Sequence[str], adjusters: Sequence[str], path: Path) -> list[str]:
    """Say which columns are nearly those of an adjuster or of the damper, and are not taken so."""
    known = (*adjusters, *IDENTITY_KEYS, *(name for name in FACTS if len(name) > _SHORT))
    notes = []
    for name in names:
        is_known = name.casefold() in known or _file_column([name]) is not None
        hint = did_you_mean(name.casefold(), known)
        if hint and not is_known and not identity_in({name: "x"}).describe():
            notes.append(f"{path}: column '{name}' is kept as a remark.{hint}")
    return notes


def _file_column(names: Sequence[str]) -> int | None:
    plain = [re.sub(r"[\W_]+", "", name.casefold()) for name in names]
    return next((plain.index(word) for word in _FILE if word in plain), None)


def _fields(line: str, separator: str) -> list[str]:
    return [cell.strip() for cell in next(csv.reader([line], delimiter=separator), [])]


def _separator(line: str) -> str:
    return max(";\t,", key=lambda mark: (line.count(mark), mark == ","))


def _text(data: bytes) -> str:
    encoding = "utf-16" if data[:2] in {b"\xff\xfe", b"\xfe\xff"} else "utf-8-sig"
    try:
        return data.decode(encoding)
    except UnicodeDecodeError:
        return data.decode("latin-1")
