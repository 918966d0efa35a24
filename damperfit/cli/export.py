"""``damperfit export``: a results folder handed over to another program."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from textwrap import wrap
from typing import TYPE_CHECKING, Annotated

import typer

from damperfit.cli.console import print_json, print_lines, say, screen_columns
from damperfit.cli.option_values import check_places
from damperfit.cli.options import (
    ConfigOption,
    DebugOption,
    JsonOption,
    OverwriteOption,
    QuietOption,
    ResultsArgument,
    TemperatureOption,
    UnitsOption,
    VersionOption,
)
from damperfit.errors import ConfigurationError
from damperfit.problem import Option

if TYPE_CHECKING:
    from damperfit.exporting import Target
    from damperfit.units.shown_units import ShownUnits

__all__ = ["export"]


def export(
    results: ResultsArgument = Path("results"),
    to: Annotated[
        str | None, typer.Option(metavar="TARGET", help="What to write; --list shows them.")
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(
            metavar="PATH",
            help="A file if it has a suffix, else a folder.  [default: export in the results "
            "folder]",
        ),
    ] = None,
    extend: Annotated[
        str | None,
        typer.Option(
            metavar="SPEED", help="Extend tables beyond the tested speed; marked as untested."
        ),
    ] = None,
    units: UnitsOption = None,
    decimal: Annotated[
        str, typer.Option(metavar="MARK", help="Decimal mark in CSV files: a point or a comma.")
    ] = ".",
    temperature: TemperatureOption = None,
    check: Annotated[
        bool,
        typer.Option(
            "--check", help="Run what was written against the logs of the run; show the error."
        ),
    ] = False,
    list_: Annotated[
        bool, typer.Option("--list", help="Show the targets with file, units and sign.")
    ] = False,
    overwrite: OverwriteOption = False,
    config: ConfigOption = None,
    json: JsonOption = False,
    quiet: QuietOption = False,
    debug: DebugOption = False,
    version: VersionOption = False,
) -> int:
    """Hand an identified damper over to a simulator or a spreadsheet.

    Example: damperfit export results --to csv
    """
    from damperfit.exporting import TARGETS, ExportOptions, exported_run, find_target
    from damperfit.exporting.check import check_export
    from damperfit.units.quantities import parse_quantity

    if list_:
        _show(tuple(TARGETS.values()), is_json=json)
        return 0
    if to is None:
        raise ConfigurationError(
            f"export: to what? Give --to {'|'.join(TARGETS)}; --list shows what they are"
        )
    target = find_target(to)
    shown, mark = _chosen(target, units, decimal)
    speed = None if extend is None else parse_quantity(extend, "velocity", option="--extend")
    folder, stem = _destination(results, out, target)
    check_places(folder)
    run = exported_run(results, config=config, temperature=temperature)
    for remark in run.run.remarks:
        say(f"damperfit: {results}: {remark}")
    made = target.export(run, ExportOptions(stem, speed, shown, mark))
    checked = check_export(run, made) if check else ()
    written = _write(folder, dict(made.files), spares_others=not overwrite)
    if json:
        document: dict[str, object] = {
            "target": to,
            "units": target.units,
            "sign": target.sign,
            "files": [str(path) for path in written],
            "remarks": list(run.run.remarks),
            "notes": list(made.notes),
        }
        document |= {"lost_in_a_table": made.lost} if made.lost else {}
        document["determined"] = [
            {"setting": one.setting.cell, "speed_m_per_s": one.determined} for one in made.tables
        ]
        rows = [{**asdict(one), "setting": one.setting.cell} for one in checked]
        print_json(document | ({"check": rows} if check else {}))
        return 1 if run.run.remarks else 0
    if not quiet:
        more = f" and {len(written) - 1} more" if len(written) > 1 else ""
        used = target.units if shown.is_si else f"{shown.of('m/s')}, {shown.of('N')}"
        say(f"damperfit: {written[0]} written{more}; {used}; {target.sign}")
        notes = [made.lost] if made.lost else []
        if speed is not None:
            tested = max(one.tested for one in made.tables)
            notes.append(f"beyond {tested:.4g} m/s the tables are untested")
        for note in (*notes, *made.notes, made.determined):
            say(f"note: {note}")
    if checked:
        print_lines([f"check, {one}" for one in checked])
    return 1 if run.run.remarks else 0


def _chosen(target: Target, units: str | None, decimal: str) -> tuple[ShownUnits, str]:
    """Return units and decimal mark, where the target heeds them.

    Raises
    ------
    ConfigurationError
        It does not, or they are none.
    """
    from damperfit.units.shown_units import SI, parse_units

    given = {"units": units is not None, "decimal": decimal != "."}
    for option, is_given in given.items():
        if is_given and option not in target.takes:
            raise ConfigurationError(
                f"--{option} {units if option == 'units' else decimal}: {target.name} has units "
                f"and marks of its own ({target.units}); leave it out"
            )
    if decimal not in {".", ","}:
        raise ConfigurationError("expected . or ,", where=Option("decimal", decimal))
    return SI if units is None else parse_units(units), decimal


def _destination(results: Path, out: Path | None, target: Target) -> tuple[Path, str]:
    """Return the folder to write to, and what the files' names begin with.

    Raises
    ------
    ConfigurationError
        The suffix of ``out`` is not the target's.
    """
    if out is None:
        from damperfit.tables.reading import is_part, written_of

        place = written_of(results, "export")
        return place if is_part(results) else place / "export", "damper"
    return target.place_of(out)


def _write(folder: Path, files: dict[str, bytes], *, spares_others: bool) -> list[Path]:
    from damperfit.store import file_set

    with file_set(folder, spares_others=spares_others) as drafts:
        for name, content in files.items():
            drafts.path(name).write_bytes(content)
    return [folder / name for name in files]


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
