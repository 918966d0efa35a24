"""JSON: columns ``{"force_N": [...]}``, rows ``[{...}]`` or ``[[...]]``, or one row in each line.

Beside columns may stand facts of the test, ``"setting": 10``; several tables under names are tests
of their own. A column may be ``{"unit": "N", "values": [...]}`` or numbered, ``{"0": 1.5}``;
columns may stand in a list, each with its ``name``.

Traps. JSON says nothing of double names: the last one would win in silence. Python's parser takes
some thirty times the bytes of ``[[],[],...``, recursion ends it in deep nesting, and it refuses
whole numbers of some thousand digits with an error of its own.
"""

import json
import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from typing import Any

import numpy as np

from damperfit.errors import LogError
from damperfit.io.child_process import check_size
from damperfit.io.columns import mentions_channel, visible
from damperfit.io.files import Source, to_utf8
from damperfit.io.formats import Column, Samples, Table
from damperfit.io.options import EXTRAS, ReadOptions
from damperfit.io.text import clock_seconds, is_stamp, rows_dropped

# Two numbers in a row that are text.
_QUOTED = re.compile(rb'"\s*[-+]?\d[\d.eE+-]*\s*"\s*,\s*"\s*[-+]?\d[\d.eE+-]*\s*"\s*[,\]]')
_VALUE_BYTES, _LIST_BYTES = 32, 64  # what a number and a list or object take in memory
_MAX_TABLES = 1_000
_DEPTH = 2  # names above a table
_EXPECTED = (
    'expected columns {"time_s": [...], "displacement_mm": [...], "force_N": [...]}, a list of rows'
)
_Columns = dict[str, tuple[str | None, list[Any]]]  # name -> unit and values


def read_json(source: Source, options: ReadOptions) -> tuple[Table, ...]:
    """Return the tables of a JSON log."""
    data, notes = to_utf8(source.data, encoding=options.encoding)
    n_lists = data.count(b"[") + data.count(b"{")
    claimed = _VALUE_BYTES * data.count(b",") + _LIST_BYTES * n_lists
    check_size(claimed, limit=options.max_bytes, subject="the JSON")
    tables = list(_tables(_parsed(data.decode("utf-8", "replace")), {}))
    problem = ""
    if len(tables) > _MAX_TABLES:
        problem = f"{len(tables)} tables, more than the limit of {_MAX_TABLES}"
    elif not tables and _QUOTED.search(data):
        problem = (
            "the numbers of this JSON are in quotes and so are text; write them without, as in "
            "0.012"
        )
    elif not tables:
        problem = f"this is JSON without columns or rows of numbers; {_EXPECTED}"
    if problem:
        raise LogError(problem, code="bad-json")
    notes, drops = (*notes, "format: JSON"), options.bad_rows == "drop"
    return tuple(_table(*table, notes, source.name, drops=drops) for table in tables)


def _parsed(text: str) -> Any:
    def once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        if len(document := dict(pairs)) < len(pairs):
            double = _doubled([key for key, _ in pairs])
            raise LogError(
                f"this is JSON with two values for {visible(double)}", code="given-twice"
            )
        return document

    decoder = json.JSONDecoder(parse_int=float, object_pairs_hook=once)
    try:
        try:
            return decoder.decode(text)
        except json.JSONDecodeError as error:
            lines = [line for line in text.splitlines() if line.strip()]
            if error.msg.startswith("Extra data") and not error.lineno == len(lines) == 1:
                with suppress(json.JSONDecodeError):  # why the whole is none says more
                    return [decoder.decode(line) for line in lines]
            raise
    except json.JSONDecodeError as error:
        place = f"line {error.lineno}, column {error.colno}"
        problem = f"this is JSON, damaged in {place}: {error.msg}; copy the log again"
        raise LogError(problem, code="bad-json") from error
    except RecursionError as error:
        problem = f"this is JSON, nested too deep for a log; {_EXPECTED}"
        raise LogError(problem, code="bad-json") from error


def _doubled(names: Sequence[str]) -> str:
    return next(name for name in names if names.count(name) > 1)


def _tables(
    node: Any, above: Mapping[str, str], title: str = "", depth: int = 0
) -> Iterator[tuple[str, _Columns, Mapping[str, str]]]:
    """Yield title, columns and facts of each table; a table may stand two names deep."""
    if isinstance(node, list):
        if columns := _from_columns(node) or _from_rows(node):
            yield title, columns, above
        return
    if not isinstance(node, dict):
        return
    facts = {**above, **_facts(node)}
    names, data = node.get("columns"), node.get("data")
    if isinstance(names, list) and _are(str, names) and isinstance(data, list) and data:
        yield title, _from_rows([names, *data]), facts  # as pandas splits a table
        return
    columns = {key.strip(): column for key, value in node.items() if (column := _column(value))}
    inner = [(key, value) for key, value in node.items() if isinstance(value, dict | list)]
    if not mentions_channel(columns) and depth < _DEPTH:
        for _, value in inner:
            facts |= _facts(value) if isinstance(value, dict) and not _column(value) else {}
        tables = [t for key, value in inner for t in _tables(value, facts, key, depth + 1)]
        if tables:
            yield from tables
            return
    if columns:
        yield title, columns, facts


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
        first = next((cell for cell in value if cell is not None), None)
        is_value = isinstance(first, float) or (isinstance(first, str) and is_stamp(first))
        return (None, value) if is_value else None
    if not isinstance(value, dict) or not value:
        return None
    values = value.get("values", value.get("data"))
    if isinstance(values, list) and (column := _column(values)):
        unit = value.get("unit", value.get("units"))
        return (unit.strip() or None if isinstance(unit, str) else None), column[1]
    is_numbered = all(key == str(i) for i, key in enumerate(value))  # as pandas does it
    return _column(list(value.values())) if is_numbered else None


def _from_columns(listed: list[Any]) -> _Columns:
    """Return columns that stand in a list, each an object with its name; none where they do not."""
    columns: _Columns = {}
    for entry in listed if _are(dict, listed) else ():
        name = next((entry[key] for key in ("name", "channel", "label") if key in entry), "")
        name = name.strip() if isinstance(name, str) else ""
        if name and (column := _column(entry)):
            columns[name] = column
    return columns if len(columns) == len(listed) else {}


def _from_rows(rows: list[Any]) -> _Columns:
    """Return the columns of rows that are objects, or lists with or without names above them."""
    if _are(dict, rows):
        for number, row in enumerate(rows, start=1):
            if row.keys() != rows[0].keys():
                odd = min(row.keys() ^ rows[0].keys())
                has = "has" if odd in row else "lacks"
                raise LogError(
                    f"{has} {visible(odd)}, unlike row 1", subject=f", row {number}", code="bad-row"
                )
        return {key.strip(): (None, [row[key] for row in rows]) for key in rows[0]}
    if not _are(list, rows):
        return {}
    n = len(rows[0])
    heads = [row for row in rows[:2] if _are(str, row) and not any(map(is_stamp, row))]
    heads = heads if heads and heads[0] is rows[0] else []
    names = [text.strip() for text in heads[0]] if heads else [f"\0{i}" for i in range(n)]
    units = [text.strip("()[] ") for text in heads[1]] if len(heads) > 1 else [""] * n
    if len(set(names)) < len(names):
        raise LogError(f"two columns are named {visible(_doubled(names))}", code="given-twice")
    for number, row in enumerate(rows[1:], start=2):
        if len(row) != n:
            raise LogError(
                f"found {len(row)} values, expected {n} as in row 1",
                subject=f", row {number}",
                code="bad-row",
            )
    return {
        key: (units[i] or None, [row[i] for row in rows[len(heads) :]])
        for i, key in enumerate(names)
    }


def _table(
    title: str,
    columns: _Columns,
    metadata: Mapping[str, str],
    notes: tuple[str, ...],
    name: str,
    *,
    drops: bool,
) -> Table:
    """Return a table whose values become arrays when they are asked for."""
    raw = [values for _, values in columns.values()]

    def load(indices: Mapping[str, int]) -> Samples:
        lengths = {[*columns][i]: len(raw[i]) for i in indices.values()}
        if len(set(lengths.values())) > 1:
            listed = ", ".join(f"{visible(key)} {n}" for key, n in lengths.items())
            raise LogError(f"columns of different length: {listed} values", code="bad-row")
        is_bad = np.zeros(next(iter(lengths.values())), dtype=bool)
        channels, first_bad = {}, ""
        for channel, index in indices.items():
            values, is_clock = raw[index], _is_clock(raw[index])
            bad = np.array([not _is_value(value, is_clock=is_clock) for value in values], bool)
            numbers = [None if wrong else value for value, wrong in zip(values, bad, strict=True)]
            channels[channel] = (
                clock_seconds(numbers) if is_clock else np.array(numbers, np.float64)
            )
            if drops and channel not in EXTRAS:
                bad |= ~np.isfinite(channels[channel])
            if bad.any():
                at = int(np.flatnonzero(bad)[0])
                place = f", row {at + 1}"
                text = f"{channel} is {visible(str(values[at]))}, expected a number"
                if not drops:
                    text += "; repair it, or drop such rows by rig.bad_rows = 'drop'"
                    raise LogError(text, subject=place, code="bad-json")
                first_bad = first_bad or f"{name}{place}: {text}"
                is_bad |= bad
        rows = np.flatnonzero(~is_bad)
        channels = {channel: values[rows] for channel, values in channels.items()}
        findings = rows_dropped(int(is_bad.sum()), first_bad)
        return Samples(channels, lambda i: f"row {rows[i] + 1}", findings=findings)

    headings = tuple(
        Column("" if key.startswith("\0") else key, unit, _is_clock(values))
        for key, (unit, values) in columns.items()
    )
    hint = "this is JSON" if any(column.name for column in headings) else ""
    return Table(headings, load, metadata, notes, title, hint=hint)


def _is_clock(values: Sequence[Any]) -> bool:
    return _are(str, values[:1]) and is_stamp(values[0])


def _is_value(value: Any, *, is_clock: bool) -> bool:
    if value is None:
        return True
    return isinstance(value, str) and is_stamp(value) if is_clock else type(value) is float
