"""``damperfit export``: a results folder handed over to another program."""

from __future__ import annotations

import math
from dataclasses import asdict
from textwrap import wrap
from typing import TYPE_CHECKING, Any

from damperfit import api
from damperfit.cli.command import Shown, command
from damperfit.cli.console import print_json, print_lines, say, screen_columns

if TYPE_CHECKING:
    from damperfit.exporting import Target

__all__ = ["export"]


@command(api.export, shown=("list", "json", "quiet", "debug", "version"))
def export(how: Shown, **given: Any) -> int:
    """Hand an identified damper over to a simulator or a spreadsheet.

    Example: damperfit export results --to csv
    """
    from damperfit.exporting import TARGETS, find_target

    if how.list:
        _show(tuple(TARGETS.values()), is_json=how.json)
        return 0
    files = api.export(**given)
    target = find_target(given["to"])
    for remark in files.remarks:
        say(f"damperfit: {given['results']}: {remark}")
    made = files.made
    if made is None:
        return 1 if files.remarks else 0
    if how.json:
        document: dict[str, object] = {
            "target": target.name,
            "units": target.units,
            "sign": target.sign,
            "files": [str(path) for path in files],
            "remarks": list(files.remarks),
            "notes": list(files.notes),
        }
        document |= {"lost_in_a_table": made.lost} if made.lost else {}
        document["determined"] = [
            {
                "setting": one.setting.cell,
                "speed_m_per_s": None if math.isnan(one.determined) else one.determined,
            }
            for one in made.tables
        ]
        rows = [{**asdict(one), "setting": one.setting.cell} for one in files.checked]
        print_json(document | ({"check": rows} if given["check"] else {}))
        return 1 if files.remarks else 0
    if not how.quiet:
        from damperfit.units.shown_units import SI, parse_units

        shown = SI if given["units"] is None else parse_units(given["units"])
        more = f" and {len(files) - 1} more" if len(files) > 1 else ""
        used = target.units if shown.is_si else f"{shown.of('m/s')}, {shown.of('N')}"
        say(f"damperfit: {files[0]} written{more}; {used}; {target.sign}")
        notes = [made.lost] if made.lost else []
        if given["extend"] is not None:
            tested = max(one.tested for one in made.tables)
            notes.append(f"beyond {tested:.4g} m/s the tables are untested")
        for note in (*notes, *files.notes, made.determined):
            say(f"note: {note}")
    if files.checked:
        print_lines([f"check, {one}" for one in files.checked])
    return 1 if files.remarks else 0


def _show(targets: tuple[Target, ...], *, is_json: bool) -> None:
    lines = [
        {
            "target": one.name,
            "title": one.title,
            "file": one.file.format(stem="damper", setting="N"),
            "units": one.units,
            "sign": one.sign,
            "place": one.place,
        }
        for one in targets
    ]
    if is_json:
        print_json({"targets": lines})
        return
    for one in lines:
        title = wrap(f"{one['target']}: {one['title']}", screen_columns(), subsequent_indent="  ")
        print_lines(title)
        for word, text in (
            ("file", one["file"]),
            ("units", one["units"]),
            ("sign", one["sign"]),
            ("goes", f"to {one['place']}"),
        ):
            head = f"  {word:<7}"
            print_lines(wrap(f"{head}{text}", screen_columns(), subsequent_indent=" " * len(head)))
