"""A table of tests: the damper and the setting of each file, and facts of its test.

One row a log, with the columns ``file``, each adjuster (or ``setting``, a label), those of
`Identity`, facts of the test (`FACTS`), and any others. Written by hand or saved by a spreadsheet:
comma, semicolon or tab, UTF-8 or Latin-1.
"""

import csv
import re
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

from damperfit.errors import ConfigurationError, LogError, did_you_mean
from damperfit.io.files import IrregularFileError, open_regular, read_bytes, to_utf8, why_unread
from damperfit.problem import FilePlace
from damperfit.tested.identity import IDENTITY_KEYS, Identity, identity_in
from damperfit.tested.setting import ADJUSTER, Place, parse_place, parse_setting
from damperfit.units.quantities import parse_quantity, says_absolute_or_gauge

# Facts of a test that a user may declare, and their dimensions.
FACTS = {
    "gas_pressure": "absolute pressure",
    "temperature": "temperature",
    "tare": "force",
    "skew": "time",
}
# Facts read from a log's preamble; a tare or a skew may have been subtracted already.
_OF_PREAMBLES = ("gas_pressure", "temperature")
# Names of the temperature of the oil in a preamble, and other words in that name.
_TEMPERATURES = {
    *("temp", "temperature", "temperatur", "température", "temperatura", "öltemperatur"),
    *("oeltemperatur", "dämpfertemperatur"),
}
_OF_OIL = {
    *("oil", "fluid", "damper", "shock", "body", "test", "öl", "huile", "olio", "aceite"),
    *("of", "de", "l", "d", "the", "amortisseur"),
}
# The same of its gas; a gauge pressure, where the unit does not say.
_GASES = {"gas", "nitrogen", "n2", "gasdruck", "stickstoff", "gaz", "azote"}
_OF_GAS = {*("pressure", "charge", "fill", "reservoir", "druck", "pression", "de", "d")}
# What a pressure counts from, in words behind its unit: bar (abs), psi gauge, bar Überdruck.
_COUNTS_FROM = re.compile(r"(bar|psi|pa)[ (]*(?:(a|abs\w*)|g|gauge|ü|über\w*)\)?$", re.IGNORECASE)
_TOO_COLD = 45.0  # degF, 7 degC: a bare number below it is degrees Celsius
_IN_BRACKETS = re.compile(r"[(\[]\s*([^()\[\]]*?)\s*[)\]]")
_FILE = ("file", "log", "filename", "datei")
_MAX_BYTES = 10_000_000
_MAX_SKEW = 0.1  # s; more is not a skew between channels but two clocks
_GAS_LIMITS = (1e4, 1e8)  # Pa, those of damper.gas_pressure
_SHORT = 4  # letters; shorter names lie near too many words


def fact_of(key: str, text: str) -> float:
    """Return the value of a fact, a name of `FACTS`, SI or degrees Celsius."""
    value = parse_quantity(text, FACTS[key])
    if key == "gas_pressure" and not says_absolute_or_gauge(text):
        raise ValueError("expected a unit that says what it counts from, as in 5.6bara or 80psig")
    if key == "gas_pressure" and not _GAS_LIMITS[0] <= value <= _GAS_LIMITS[1]:
        raise ValueError("expected 0.1 to 1000 bar absolute")
    if key == "skew" and abs(value) > _MAX_SKEW:
        raise ValueError(f"expected at most {_MAX_SKEW:g} s either way")
    return value


def _key(name: str) -> str:
    return re.sub(r"[\W_]+", "_", name.casefold()).strip("_")


def facts_in(preamble: Mapping[str, str]) -> tuple[dict[str, float], tuple[str, ...]]:
    """Return the facts in a log's own preamble, and notes on lines that are not used."""
    facts: dict[str, float] = {}
    notes = []
    for name, text in preamble.items():
        base, unit = _IN_BRACKETS.sub("", name), "".join(_IN_BRACKETS.findall(name))
        words, stated = set(_key(base).split("_")), text.replace(",", ".")
        if (key := _key(name)) in _OF_PREAMBLES:
            pass
        elif words & _TEMPERATURES and words <= _TEMPERATURES | _OF_OIL:
            key = "temperature"
            if stated[-1:].isdigit():  # degrees of some kind, and keys are in lower case
                is_cold = False
                with suppress(ValueError):  # of more than a number
                    is_cold = not unit and float(stated) < _TOO_COLD
                notes += [f"{name}: {text}: taken as degC, as it has no unit"] * is_cold
                stated += " degC" if is_cold else f" {unit.upper().replace('DEG', 'deg') or '?'}"
        elif words & _GASES and words <= _GASES | _OF_GAS:
            key = "gas_pressure"
            if re.search(r"\d,\d{3}(?!\d)", text):  # thousands, or decimals
                notes.append(f"{name}: {text}: not used; write the number without a comma")
                continue
            if stated[-1:].isdigit():
                stated += unit.replace("kp", "kP").replace("mp", "MP")
            stated = _COUNTS_FROM.sub(lambda match: match[1] + ("a" if match[2] else "g"), stated)
        else:
            continue
        if key == "gas_pressure" and says_absolute_or_gauge(f"{stated}g"):
            stated += "g"
            notes.append(f"{name}: {text}: taken as gauge pressure, {stated}")
        try:
            value = fact_of(key, stated)
        except ValueError as error:
            notes.append(f"{name}: {text}: not used; {error}")
            continue
        if facts.setdefault(key, value) != value:
            notes.append(f"{name}: {text}: not used; a line before it says {facts[key]:g}")
    return facts, tuple(notes)


@dataclass(frozen=True, slots=True)
class TestRow:
    """The facts of one log in a table."""

    __test__ = False  # no test of pytest's

    line: int  # of the table, from 1
    places: Mapping[str, Place] = field(default_factory=dict)  # of adjusters; empty cells say none
    identity: Identity = Identity()
    facts: Mapping[str, float] = field(default_factory=dict)  # by name of `FACTS`, SI, degC


@dataclass(frozen=True, slots=True)
class TestsTable:
    """A table of tests: its rows by file name as written, with ``/`` between folders."""

    __test__ = False

    path: Path
    rows: Mapping[str, TestRow]
    notes: tuple[str, ...] = ()  # on doubtful columns


def is_tests_table(path: Path) -> bool:
    """Whether a file called ``tests.csv`` is a table of tests: its first line names a file."""
    if path.name.casefold() != "tests.csv":
        return False
    try:
        with open_regular(path) as file:
            head = _text(file.read(4096)).splitlines()
    except (OSError, LogError):
        return False
    return bool(head) and _file_column(_fields(head[0], _separator(head[0]))) is not None


def read_tests(path: Path, adjusters: Sequence[str]) -> TestsTable:  # noqa: C901, PLR0912 - by row
    """Read a table of tests of a damper with these adjusters."""

    def refused(text: str, line: int = 0, code: str = "bad-table-of-tests") -> ConfigurationError:
        place = FilePlace(str(path), line) if line else None
        return ConfigurationError(text, where=place, subject="" if line else path, code=code)

    try:
        lines = _text(read_bytes(path, max_bytes=_MAX_BYTES)).splitlines()
    except (OSError, ValueError, LogError) as error:
        reason = why_unread(error)
        if isinstance(error, IrregularFileError):
            reason = f"{error.strerror}; this is not a table of tests"
        raise refused(reason) from error
    head = next((k for k, line in enumerate(lines, start=1) if line.strip()), 0)
    if not head:
        raise refused("is empty; expected a line of names, as in 'file,setting'")
    separator = _separator(lines[head - 1])
    names = _fields(lines[head - 1], separator)
    at = _file_column(names)
    if at is None:
        text = (
            f"no column 'file'; found {', '.join(names[:10])}; name the one that holds the names "
            "of the logs 'file'"
        )
        raise refused(text, head, "no-column")
    if doubled := [name for name in names if name and names.count(name) > 1]:
        raise refused(f"two columns are named '{doubled[0]}'", head, "given-twice")
    rows: dict[str, TestRow] = {}
    for k, line in enumerate(lines[head:], start=head + 1):
        cells = _fields(line, separator)
        if not any(cells):
            continue
        if len(cells) > len(names):
            text = (
                f"{len(cells)} fields, but {len(names)} names in line {head}; put a text "
                "that holds the separator in quotes"
            )
            raise refused(text, k, "bad-row")
        filled = {name: cell for name, cell in zip(names, cells, strict=False) if name and cell}
        file = filled.pop(names[at], "").replace("\\", "/").removeprefix("./")
        if not file:
            raise refused(f"no file name in column '{names[at]}'", k)
        try:
            row = _row(filled, adjusters, k)
        except ValueError as error:
            raise refused(str(error), k) from error.__cause__
        before = rows.setdefault(file, row)
        if (before.places, before.identity, before.facts) != (row.places, row.identity, row.facts):
            text = f"'{file}' is in line {before.line} too, with other values; leave one of the two"
            raise refused(f"{text} out", k)
    # Columns that are nearly those of an adjuster or of the damper are not taken so.
    meanings = (*adjusters, *IDENTITY_KEYS, *(name for name in FACTS if len(name) > _SHORT))
    notes = []
    for name in names:
        has_meaning = name.casefold() in meanings or _file_column([name]) is not None
        hint = did_you_mean(name.casefold(), meanings)
        if hint and not has_meaning and not identity_in({name: "x"}).describe():
            notes.append(f"{path}: column '{name}' is kept as a note.{hint}")
    return TestsTable(path, rows, tuple(notes))


def _row(filled: dict[str, str], adjusters: Sequence[str], line: int) -> TestRow:
    places: dict[str, Place] = {}
    facts: dict[str, float] = {}
    unknown = {}
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
                unknown[name] = cell
        except ValueError as error:
            raise ValueError(f"{name}: found '{cell}', {error}") from error
    identity = identity_in(unknown).describe()
    more = tuple((name, cell) for name, cell in unknown.items() if cell not in identity.values())
    return TestRow(line, places, Identity(**identity, more=more), facts)


def _file_column(names: Sequence[str]) -> int | None:
    plain = [re.sub(r"[\W_]+", "", name.casefold()) for name in names]
    return next((plain.index(key) for key in _FILE if key in plain), None)


def _fields(line: str, separator: str) -> list[str]:
    return [cell.strip() for cell in next(csv.reader([line], delimiter=separator), [])]


def _separator(line: str) -> str:
    return max(";\t,", key=lambda mark: (line.count(mark), mark == ","))


def _text(data: bytes) -> str:
    return to_utf8(data)[0].decode("utf-8")
