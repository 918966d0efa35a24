"""JSON: columns ``{"force_N": [...]}``, rows ``[{...}]`` or ``[[...]]``, or one row in each line.

Beside columns may stand facts of the test, ``"setting": 10``; several tables under names are tests
of their own. A column may be ``{"unit": "N", "values": [...]}`` or numbered, ``{"0": 1.5}``;
columns may stand in a list, each with its ``name``.

Traps. JSON says nothing of double names: the last one would win in silence. Python's parser takes
some thirty times the bytes of ``[[],[],...``, recursion ends it in deep nesting, and it refuses
whole numbers of some thousand digits with an error of its own.
"""

from __future__ import annotations

import json
import re
from contextlib import suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from damperfit.errors import LogError
from damperfit.io.channels import mentions_channel, visible
from damperfit.io.child_process import check_size
from damperfit.io.files import to_utf8
from damperfit.io.formats import Column, Samples, Table
from damperfit.io.options import EXTRAS
from damperfit.io.text import clock_seconds, is_stamp
from damperfit.recording import Finding

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from numpy.typing import NDArray

    from damperfit.io.files import Source
    from damperfit.io.options import ReadOptions

    FloatArray = NDArray[np.float64]

__all__ = ["read_json"]

# Two numbers in a row that are text.
_QUOTED = re.compile(rb'"\s*[-+]?\d[\d.eE+-]*\s*"\s*,\s*"\s*[-+]?\d[\d.eE+-]*\s*"\s*[,\]]')
_VALUE_BYTES, _LIST_BYTES = 32, 64  # what a number and a list or object take in memory
_MAX_TABLES = 1_000
_DEPTH = 2  # names above a table
_EXPECTED = (
    'expected columns {"time_s": [...], "displacement_mm": [...], "force_N": [...]}, a list of rows'
)


def read_json(source: Source, options: ReadOptions) -> tuple[Table, ...]:
    """Return the tables of a JSON log.

    Raises
    ------
    LogError
        It is damaged, needs more memory than the limit, or holds no columns or rows.
    """
    name = source.name
    data, notes = to_utf8(source.data, name=name, encoding=options.encoding)
    n_lists = data.count(b"[") + data.count(b"{")
    claimed = _VALUE_BYTES * data.count(b",") + _LIST_BYTES * n_lists
    check_size(claimed, limit=options.max_bytes, what="the JSON", name=name)
    document = _parsed(data.decode("utf-8", "replace"), name)
    tables = list(_tables(document, {}, name))
    if not tables and _QUOTED.search(data):
        raise LogError(
            "the numbers of this JSON are in quotes and so are text; write them "
            "without, as in 0.012",
            subject=name,
        )
    if not tables:
        raise LogError(
            f"this is JSON without columns or rows of numbers; {_EXPECTED}", subject=name
        )
    if len(tables) > _MAX_TABLES:
        raise LogError(f"{len(tables)} tables, more than the limit of {_MAX_TABLES}", subject=name)
    return tuple(
        _Values(name, columns, options.bad_rows == "drop").table(
            metadata, (*notes, "format: JSON"), part
        )
        for part, columns, metadata in tables
    )


def _parsed(text: str, name: str) -> Any:
    def once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        found = dict(pairs)
        if len(found) < len(pairs):
            keys = [key for key, _ in pairs]
            double = next(key for key in keys if keys.count(key) > 1)
            raise LogError(f"this is JSON with two values for {visible(double)}", subject=name)
        return found

    decoder = json.JSONDecoder(parse_int=float, object_pairs_hook=once)
    try:
        try:
            return decoder.decode(text)
        except json.JSONDecodeError as error:
            lines = [line for line in text.splitlines() if line.strip()]
            if not error.msg.startswith("Extra data") or error.lineno == len(lines) == 1:
                raise
            with suppress(json.JSONDecodeError):  # why the whole is none says more
                return [decoder.decode(line) for line in lines]
            raise
    except json.JSONDecodeError as error:
        place = f"line {error.lineno}, column {error.colno}"
        raise LogError(
            f"this is JSON, damaged in {place}: {error.msg}; copy the log again", subject=name
        ) from error
    except RecursionError as error:
        raise LogError(
            f"this is JSON, nested too deep for a log; {_EXPECTED}", subject=name
        ) from error


_Columns = dict[str, tuple[str | None, list[Any]]]  # name -> unit and values


def _tables(
    node: Any, above: Mapping[str, str], name: str, part: str = "", depth: int = 0
) -> Iterator[tuple[str, _Columns, Mapping[str, str]]]:
    """Yield title, columns and facts of each table; a table may stand two names deep."""
    if isinstance(node, list):
        if rows := _from_columns(node) or _from_rows(node, name):
            yield part, rows, above
        return
    if not isinstance(node, dict):
        return
    facts = {**above, **_facts(node)}
    names, data = node.get("columns"), node.get("data")
    if isinstance(names, list) and _are(str, names) and isinstance(data, list) and data:
        yield part, _from_rows([names, *data], name), facts  # as pandas splits a table
        return
    found = {key.strip(): column for key, value in node.items() if (column := _column(value))}
    inner = [(key, one) for key, one in node.items() if isinstance(one, dict | list)]
    if not mentions_channel(found) and depth < _DEPTH:
        for _, value in inner:
            facts |= _facts(value) if isinstance(value, dict) and not _column(value) else {}
        tables = [t for key, one in inner for t in _tables(one, facts, name, key, depth + 1)]
        if tables:
            yield from tables
            return
    if found:
        yield part, found, facts


def _facts(node: Mapping[str, Any]) -> dict[str, str]:
    return {
        key.strip().lower(): f"{value:.15g}" if isinstance(value, float) else str(value)
        for key, value in node.items()
        if isinstance(value, str | float | bool)
    }


def _are(kind: type, values: Sequence[Any]) -> bool:
    return bool(values) and all(isinstance(value, kind) for value in values)


def _column(value: Any) -> tuple[str | None, list[Any]] | None:
    """Return the unit and values of a column, or None where it is none."""
    if isinstance(value, list):
        first = next((one for one in value if one is not None), None)
        is_value = isinstance(first, float) or (isinstance(first, str) and is_stamp(first))
        return (None, value) if is_value else None
    if not isinstance(value, dict) or not value:
        return None
    values = value.get("values", value.get("data"))
    if isinstance(values, list) and (found := _column(values)):
        unit = value.get("unit", value.get("units"))
        return (unit.strip() or None if isinstance(unit, str) else None), found[1]
    if all(key == str(i) for i, key in enumerate(value)):  # as pandas numbers a column
        return _column(list(value.values()))
    return None


def _from_columns(listed: list[Any]) -> _Columns:
    """Return columns that stand in a list, each an object with its name; none where they do not."""
    if not _are(dict, listed):
        return {}
    found = [(_name_in(one), _column(one)) for one in listed]
    if len({name for name, _ in found}) < len(found):
        return {}
    named = {name: column for name, column in found if name and column}
    return named if len(named) == len(found) else {}


def _name_in(column: Mapping[str, Any]) -> str:
    name = next((column[key] for key in ("name", "channel", "label") if key in column), "")
    return name.strip() if isinstance(name, str) else ""


def _from_rows(rows: list[Any], name: str) -> _Columns:
    """Return the columns of rows that are objects, or lists with or without names above them."""
    if _are(dict, rows):
        names = list(rows[0])
        for number, row in enumerate(rows, start=1):
            if row.keys() != rows[0].keys():
                odd = min(row.keys() ^ rows[0].keys())
                has = "has" if odd in row else "lacks"
                raise LogError(f"{name}, row {number}: {has} {visible(odd)}, unlike row 1")
        return {one.strip(): (None, [row[one] for row in rows]) for one in names}
    if not _are(list, rows):
        return {}
    names, n = [], len(rows[0])
    units: list[str] = []
    start = 0
    if _are(str, rows[0]) and not any(is_stamp(text) for text in rows[0]):
        names, start = [text.strip() for text in rows[0]], 1
        if len(rows) > 1 and _are(str, rows[1]) and not any(is_stamp(text) for text in rows[1]):
            units, start = [text.strip("()[] ") for text in rows[1]], 2
    if len(set(names)) < len(names):
        double = next(one for one in names if names.count(one) > 1)
        raise LogError(f"two columns are named {visible(double)}", subject=name)
    for number, row in enumerate(rows[1:], start=2):
        if len(row) != n:
            raise LogError(
                f"{name}, row {number}: found {len(row)} values, expected {n} as in row 1"
            )
    keys = names or [f"\0{i}" for i in range(n)]
    return {
        key: (units[i] or None if units else None, [row[i] for row in rows[start:]])
        for i, key in enumerate(keys)
    }


@dataclass(frozen=True, slots=True, eq=False)
class _Values:
    """Columns as parsed, which become arrays when they are asked for."""

    name: str
    columns: _Columns
    drops_bad_rows: bool

    def table(self, metadata: Mapping[str, str], notes: tuple[str, ...], part: str) -> Table:
        columns = tuple(
            Column("" if name.startswith("\0") else name, unit, is_clock=_is_clock(values))
            for name, (unit, values) in self.columns.items()
        )
        hint = "this is JSON" if any(column.name for column in columns) else ""
        return Table(columns, self.load, metadata, notes, part, hint=hint)

    def load(self, wanted: Mapping[str, int]) -> Samples:
        """Return the channels; rows that cannot be read are refused, or dropped where asked for."""
        raw = [(name, values) for name, (_, values) in self.columns.items()]
        lengths = {raw[i][0]: len(raw[i][1]) for i in wanted.values()}
        if len(set(lengths.values())) > 1:
            shown = ", ".join(f"{visible(one)} {n}" for one, n in lengths.items())
            raise LogError(f"columns of different length: {shown} values", subject=self.name)
        is_bad = np.zeros(next(iter(lengths.values())), dtype=bool)
        channels, first = {}, ""
        for channel, index in wanted.items():
            channels[channel], bad = _floats(raw[index][1])
            if self.drops_bad_rows and channel not in EXTRAS:
                bad |= ~np.isfinite(channels[channel])
            if bad.any():
                at = int(np.flatnonzero(bad)[0])
                shown = visible(str(raw[index][1][at]))
                said = f"{self.name}, row {at + 1}: {channel} is {shown}, expected a number"
                if not self.drops_bad_rows:
                    raise LogError(f"{said}; repair it, or drop such rows by rig.bad_rows = 'drop'")
                first = first or said
                is_bad |= bad
        n_bad = int(np.count_nonzero(is_bad))
        if not n_bad:
            return Samples(channels, lambda i: f"row {i + 1}")
        kept = np.flatnonzero(~is_bad)
        said = f"{n_bad} row{'s' * (n_bad != 1)} that cannot be read dropped; {first}"
        found = Finding("rows_dropped", "warning", said, float(n_bad))
        channels = {channel: values[kept] for channel, values in channels.items()}
        return Samples(channels, lambda i: f"row {kept[i] + 1}", findings=(found,))


def _is_clock(values: Sequence[Any]) -> bool:
    return _are(str, values[:1]) and is_stamp(values[0])


def _floats(values: Sequence[Any]) -> tuple[FloatArray, NDArray[np.bool_]]:
    """Return values, and which of them are none; null is NaN."""
    is_clock = _is_clock(values)

    def is_value(one: Any) -> bool:
        if one is None:
            return True
        return isinstance(one, str) and is_stamp(one) if is_clock else type(one) is float

    is_none = [not is_value(one) for one in values]
    bad = np.array(is_none, dtype=bool)
    if bad.any():
        values = [None if wrong else one for one, wrong in zip(values, is_none, strict=True)]
    if not is_clock:
        return np.array(values, dtype=np.float64), bad
    import pyarrow as pa

    return clock_seconds(pa.array(values, pa.string())), bad
