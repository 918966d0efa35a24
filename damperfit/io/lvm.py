"""LabVIEW measurement files (.lvm): text in segments, each with a header of its own.

The format: https://www.ni.com/docs/en-US/bundle/labview/page/labview-measurement-file-format.html.
Each header ends in ``***End_of_Header***``; the first is the file's. A segment's header gives units
(``Y_Unit_Label``), below it stand the names, with a column for comments, and the rows.
"""

from __future__ import annotations

import re

from damperfit.errors import LogError
from damperfit.io.files import Source, to_utf8
from damperfit.io.formats import Table
from damperfit.io.options import ReadOptions
from damperfit.io.text import Block, read_block

__all__ = ["read_lvm"]

_END = re.compile(rb"(?m)^\*\*\*End_of_Header\*\*\*[^\n]*\n")
_SEGMENT = re.compile(rb"(?m)^(?:Notes|Channels)\b")  # what a segment's header begins with
_ENTRY = re.compile(r"(?m)^(\w+)\t([^\r\n]*?)\s*$")


def read_lvm(source: Source, options: ReadOptions) -> tuple[Table, ...]:
    """Return a table for each segment.

    Raises
    ------
    LogError
        There is no segment with names and rows.
    """
    data, notes = to_utf8(source.data, name=source.name, encoding=options.encoding)
    ends = list(_END.finditer(data))
    facts = dict(_ENTRY.findall(data[: ends[0].start()].decode() if ends else ""))
    preamble = tuple(f"{key}: {text}" for key, text in facts.items())
    separator = {"Comma": ",", "Tab": "\t"}.get(facts.get("Separator", ""), "\t")
    tables = []
    for k, end in enumerate(ends[1:], start=1):
        stop = len(data)
        if k + 1 < len(ends):  # the next segment's header stands above its end
            stop = next(
                (m.start() for m in _SEGMENT.finditer(data, end.end(), ends[k + 1].start())), stop
            )
        head = data[ends[k - 1].end() : end.start()].decode("utf-8")
        names, _, rows = data[end.end() : stop].partition(b"\n")
        rows = rows.rstrip() + b"\n" if stop < len(data) else rows
        columns = names.decode("utf-8").rstrip("\r").split(separator)
        label = next((line for line in head.splitlines() if line.startswith("Y_Unit_Label")), "")
        units = ["s", *(unit.strip() for unit in label.split(separator)[1:])]
        columns[0] = "time" if columns[0] == "X_Value" else columns[0]
        if columns[-1] == "Comment":  # in the rows that have one
            columns.pop()
            width = len(columns)
            rows = b"\n".join(
                separator.encode().join(row.rstrip(b"\r").split(separator.encode())[:width])
                for row in rows.split(b"\n")
            )
        heading = [f"{name} ({unit})" for name, unit in zip(columns, units, strict=False)]
        heading += columns[len(heading) :]
        line = data.count(b"\n", 0, end.end()) + 1
        text = separator.join(heading).encode() + b"\n" + rows
        decimal = facts.get("Decimal_Separator", "")
        block = Block(text, line, decimal, f"segment {k}", preamble)
        tables.append(read_block(block, source.name, notes, options))
    if not tables:
        raise LogError("a LabVIEW measurement file without a segment", subject=source.name)
    return tuple(tables)
