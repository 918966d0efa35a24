"""The targets of ``damperfit export``: entries of ``targets.toml``, and what writes their files.

A text is a template of this package. A template gets the run, its tables (`table` is the first),
the options, and a few functions: ``header(sign, gas)`` and ``intervals(speed, sign)`` return the
lines that every file holds, ``comments(mark, lines)`` puts a mark before each. The grammars stand
with the targets.

In spreadsheets text is stored as text, so that no cell can become a formula; their bytes, as those
of the .mat file, depend on the results alone: no date stands in them.
"""

from __future__ import annotations

import csv
import io
import math
import re
import tomllib
import zipfile
from dataclasses import dataclass, field
from functools import cache
from importlib import resources
from itertools import groupby
from typing import TYPE_CHECKING, Any, NamedTuple, cast

import numpy as np
from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup, escape

from damperfit import __version__
from damperfit.damper.purdy.parameters import Damper
from damperfit.errors import ConfigurationError, did_you_mean
from damperfit.exporting.tables import (
    determined_line,
    force_tables,
    gas_line,
    header_lines,
    interval_lines,
    one_line,
    road_line,
)
from damperfit.problem import Option
from damperfit.reporting.sheet import printable
from damperfit.tables.columns import describe_tables
from damperfit.tables.files import finite, safe_cell
from damperfit.units.shown_units import SI, ShownUnits

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
    from pathlib import Path

    from numpy.typing import NDArray

    from damperfit.damper.model import Model
    from damperfit.exporting.tables import ExportedRun, ForceTable

    FloatArray = NDArray[np.float64]

_REBOUND = "velocity in m/s and force in N are positive in rebound; displacement in m likewise"
_OF_PAPER = ("r_m1", "r_m2", "r_m3", "k_e", "f_f")
_STORED = ("parameters", "mse", "adjustment", "characteristics")
_SIGN = "forces, displacement and velocity are positive in rebound (rod out)"
_DATE = (1980, 1, 1, 0, 0, 0)
_PARTS = {
    "[Content_Types].xml": "xlsx_types.xml",
    "_rels/.rels": "xlsx_rels.xml",
    "xl/workbook.xml": "xlsx_workbook.xml",
    "xl/_rels/workbook.xml.rels": "xlsx_workbook_rels.xml",
    "xl/styles.xml": "xlsx_styles.xml",
}


@dataclass(frozen=True, slots=True)
class ExportOptions:
    """What the user may choose."""

    stem: str = "damper"  # what the names of the files begin with
    extend: float | None = None  # speed up to which tables go, m/s; None: to the tested speed
    units: ShownUnits = SI  # of spreadsheets; a simulator has units of its own
    decimal: str = "."  # mark of the decimals in CSV: a point or a comma


class Export(NamedTuple):
    """What was made for a target."""

    target: Target
    options: ExportOptions
    files: Mapping[str, bytes]  # by name
    tables: tuple[ForceTable, ...]  # of each setting, as they stand in the files, or would
    lost: str  # how far the damper's dynamics are from its table; empty where they hold no table
    determined: str  # up to which speed the logs determine the force
    notes: tuple[str, ...]  # what else to know


@dataclass(frozen=True, slots=True)
class Target:
    """A program or format that a damper can be exported to: an entry of ``targets.toml``."""

    name: str  # as on the command line
    title: str  # for people, as are units of speed and force, what is positive, and where it goes
    file: str  # pattern of names: {stem}.csv, {stem}_s{setting}.dpr for one a setting; or several
    units: str
    sign: str
    place: str
    template: str = ""  # of a text that a template makes
    encoding: str = "utf-8"  # what it cannot hold becomes a question mark
    read: Mapping[str, Any] = field(default_factory=dict)  # how `check` finds the table again
    has_table: bool = True  # it holds force by speed
    physics_of: Sequence[str] = ()  # models whose own equations it holds instead
    takes: Sequence[str] = ()  # options that only some targets heed: "units", "decimal"

    def has_table_of(self, damper: Model) -> bool:
        """Whether the file of this damper holds a table."""
        return self.has_table and damper.name not in self.physics_of

    def place_of(self, out: Path) -> tuple[Path, str]:
        """Return the folder to write to, and what the files' names begin with.

        ``out`` is a file if it has a suffix, else a folder.
        """
        if not out.suffix or out.is_dir():
            return out, "damper"
        suffixes = ["." + one.rpartition(".")[2] for one in self.file.split(", ")]
        if out.suffix.lower() not in suffixes:
            raise ConfigurationError(
                f"{self.name} writes {' and '.join(suffixes)} files; give a "
                "name that ends so, or a folder",
                where=Option("out", out),
                code="wrong-suffix",
            )
        return out.parent, out.stem

    def export(self, run: ExportedRun, options: ExportOptions = ExportOptions()) -> Export:
        """Return what this target's files hold of a run."""
        from damperfit.exporting.fmu import missing_platforms, write_fmu

        has_table = self.has_table_of(run.damper)
        if options.extend is not None and not has_table:
            raise ConfigurationError(
                f"{self.name} holds no table here; leave it out",
                where=Option("extend", f"{options.extend:g}"),
                code="no-effect",
            )
        is_one_each = "{setting}" in self.file
        tables = force_tables(run, extend=options.extend, common=not is_one_each)
        fmi = {"fmu2": 2, "fmu3": 3}.get(self.name)
        files: dict[str, bytes] = {}
        if fmi:
            files[f"{options.stem}.fmu"] = write_fmu(run, tables, version=fmi)
        for group in () if fmi else [(one,) for one in tables] if is_one_each else [tables]:
            if self.name in _WRITERS:
                files |= _WRITERS[self.name](run, group, options)
                continue
            text = rendered(self.template, **_known(run, group, options)).rstrip("\n") + "\n"
            name = self.file.format(stem=options.stem, setting=group[0].slug)
            lost = "xmlcharrefreplace" if text.startswith("<?xml") else "replace"
            files[name] = text.encode(self.encoding, lost)
        return Export(
            *(self, options, files, tables),
            road_line(run, tables) if has_table else "",
            determined_line(tables),
            (*run.notes, *(missing_platforms(fmi) if fmi else ())),
        )


# Texts


def rendered(template: str, **known: Any) -> str:
    """Return a template of this package, filled in; texts cannot leave their place in XML, HTML."""
    is_marked = template.endswith((".xml", ".html"))
    return _environment(is_marked=is_marked).get_template(template).render(**known)


@cache
def _environment(*, is_marked: bool) -> Environment:
    def shown(text: object) -> Markup:
        return text if isinstance(text, Markup) else escape(printable(str(text)))

    made = Environment(
        loader=PackageLoader("damperfit.exporting"),
        autoescape=is_marked,  # noqa: S701 - other texts are no markup
        finalize=shown if is_marked else None,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    made.filters["one_line"] = one_line
    return made


def _known(
    run: ExportedRun, tables: Sequence[ForceTable], options: ExportOptions
) -> dict[str, Any]:
    """What templates may ask for."""
    first, numbers = tables[0], _setting_numbers(tables)

    def header(
        sign: str, place: str, *, is_bump_positive: bool = False, has_table: bool = True
    ) -> list[str]:
        gas = gas_line(first, place, is_bump_positive=is_bump_positive) if has_table else place
        return header_lines(run, tables, sign=sign, gas=gas, has_table=has_table)

    def grid_of(column: str) -> FloatArray:
        rows = [[0.0, *numbers], *zip(first.speeds, *(getattr(t, column) for t in tables))]  # noqa: B905
        return np.array(rows)

    gas = list(zip(first.gas_displacements, first.gas_forces, strict=True))
    if len(gas) == 1:  # a table needs two points
        gas = [(-first.stroke, first.level), (first.stroke, first.level)]
    ranges = groupby(first.rows(), key=lambda row: first.range_of(row[0]))
    return {
        "run": run,
        "version": __version__,
        "tables": tables,
        "table": first,
        "options": options,
        "header": header,
        "intervals": lambda speed=1.0, of=first: interval_lines(of, speed, np.sign(speed)),
        "comments": lambda mark, lines: "\n".join(f"{mark} {one}".rstrip() for one in lines),
        "rebound": _REBOUND,
        "ranges": [(range_, list(rows)) for range_, rows in ranges],
        "grid_of": grid_of,
        "gas_rows": gas,
        # A name that programs take as an identifier: 10, _3.
        "identifier": lambda table: re.sub(r"[^A-Za-z0-9]", "_", table.slug),
        "labels": [
            f"column {at:g} is setting {one_line(str(table.setting))}"
            for at, table in zip(numbers, tables, strict=True)
            if len(tables) > 1 and str(table.setting) != f"{at:g}"
        ],
    }


def _setting_numbers(tables: Sequence[ForceTable]) -> list[float]:
    """Return a number for each setting, rising: where it stands, else 1, 2, ..."""
    known = [table.setting.number() for table in tables]
    numbers = [math.nan if one is None else float(one) for one in known]
    is_rising = np.isfinite(numbers).all() and (np.diff(numbers) > 0.0).all()
    return numbers if is_rising else [1.0 + k for k in range(len(tables))]


def _modelica(
    run: ExportedRun, tables: Sequence[ForceTable], options: ExportOptions
) -> Mapping[str, bytes]:
    """Return a Modelica model with all settings; ``setting`` counts them from 1."""
    speeds = tables[0].speeds
    slopes = [np.diff(table.forces) / np.diff(speeds) for table in tables]
    x, gas = tables[0].gas_displacements, tables[0].gas_forces
    word = re.sub(r"\W", "_", options.stem, flags=re.ASCII).strip("_") or "damper"
    word = word if word[0].isalpha() else f"D_{word}"
    quantities = [one for one in run.damper.quantities if one.name in _OF_PAPER]
    text = rendered(
        "modelica.mo",
        **_known(run, tables, options),
        name=word[0].upper() + word[1:],
        sign="s_rel in m, v_rel in m/s and f in N are positive in rebound (tension)",
        physics=isinstance(run.damper, Damper),
        damper=run.damper,
        quantities=quantities,
        values={
            one.name: [getattr(setting.values, one.name) for setting in run.settings]
            for one in quantities
        },
        speeds=speeds[:-1].tolist(),
        firsts=[float(table.forces[0]) for table in tables],
        bends=[[float(one[0]), *np.diff(one).tolist()] for one in slopes],
        gas=np.polyfit(x, gas, min(3, len(x) - 1))[::-1].tolist(),
    )
    return {f"{options.stem}.mo": (text.rstrip("\n") + "\n").encode("utf-8", "replace")}


def _matlab(
    run: ExportedRun, tables: Sequence[ForceTable], options: ExportOptions
) -> Mapping[str, bytes]:
    """Return a script (.m) and a data file (.mat, version 5) with the same variables."""
    from scipy.io import savemat

    first, known = tables[0], _known(run, tables, options)
    labels = [str(table.setting) for table in tables]
    about = [
        *known["header"](_REBOUND, "gas_force at gas_displacement; add it to the table's force"),
        "set the table's extrapolation: linear or error, never the last value",
        *(f"column {k} of force: setting {label}" for k, label in enumerate(labels, 1)),
    ]

    def columns(name: str) -> FloatArray:
        return np.column_stack([getattr(table, name) for table in tables])

    variables: dict[str, FloatArray] = {
        "setting": np.array([_setting_numbers(tables)]),
        "velocity": first.speeds[:, None],
        "force": columns("forces"),
        "force_low": columns("low"),
        "force_high": columns("high"),
        "determined_speed": columns("determined"),
        "tested_speed": np.array([[max(table.tested for table in tables)]]),
        "gas_displacement": first.gas_displacements[:, None],
        "gas_force": first.gas_forces[:, None],
    }
    script = rendered("matlab.m", **known, about=map(one_line, about), variables=variables)
    cells = np.array(labels, dtype=object)[None, :]
    document = {"setting_label": cells, **variables, "about": "\n".join(about)}
    file = io.BytesIO()
    savemat(cast("Any", file), document, format="5")
    content = b"MATLAB 5.0 MAT-file, damperfit".ljust(116) + file.getvalue()[116:]  # no date
    stem = options.stem
    return {f"{stem}.m": script.encode("utf-8", "replace"), f"{stem}.mat": content}


# Spreadsheets


class _Table(NamedTuple):
    """A table of numbers, text, or None where nothing is known."""

    name: str
    headings: Sequence[str]
    units: Sequence[str]
    rows: Sequence[Sequence[Any]]


def _stored(run: ExportedRun, units: ShownUnits) -> Iterator[_Table]:
    """Yield the tables of the run, as far as they are there."""
    described = describe_tables([one.setting for one in run.settings], run.run.quantities)
    for name in _STORED:
        rows = run.run.rows(name)
        columns = []
        for one in described[name] if rows else ():
            heading, unit = one["name"], one["unit"] if one["unit"] != "1" else ""
            cells = [
                row["setting"].cell
                if heading == "setting"
                else finite(row.get(heading, dict(row["setting"].places).get(heading)))
                for row in rows
            ]
            if units.of(unit) != unit:
                cells = [None if cell is None else units.show(float(cell), unit) for cell in cells]
            if heading in rows[0] or any(cell is not None for cell in cells):
                columns.append((units.column(heading, unit), units.of(unit), cells))
        if rows:
            headings, shown, cells_of = zip(*columns, strict=True)
            yield _Table(name, headings, shown, list(zip(*cells_of, strict=True)))


def _workbook(
    run: ExportedRun, tables: Sequence[ForceTable], options: ExportOptions
) -> Mapping[str, bytes]:
    """Return one workbook: what it is about, forces with half intervals, tables of the results."""
    shown = options.units
    known = [table for table in tables if table.has_interval]
    halves = (0.5 * (table.high - table.low) for table in known)
    forces = [shown.show(one, "N") for one in (*(table.forces for table in tables), *halves)]
    headings = [
        shown.column("speed_m_per_s", "m/s"),
        *(f"setting {table.setting}" for table in tables),
        *(f"± 95 % of setting {table.setting}" for table in known),
    ]
    units = [shown.of("m/s"), *(shown.of("N") for _ in forces)]
    rows = np.column_stack([shown.show(tables[0].speeds, "m/s"), *forces]).tolist()
    gas = gas_line(tables[0], "add it to the force")
    about = header_lines(run, tables, sign=_SIGN, gas=gas)
    sheets = (
        _Table("about", ["about"], [""], [[line] for line in about]),
        _Table("forces", headings, units, rows),
        *_stored(run, shown),
    )
    parts = {name: rendered(template, sheets=sheets) for name, template in _PARTS.items()}
    for k, sheet in enumerate(sheets, 1):
        heads = [sheet.headings, *([sheet.units] if any(sheet.units) else [])]
        parts[f"xl/worksheets/sheet{k}.xml"] = rendered(
            "xlsx_sheet.xml", headings=sheet.headings, heads=heads, rows=sheet.rows, column=_column
        )
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.comment = b"damperfit"
        for name, text in parts.items():
            entry = zipfile.ZipInfo(name, _DATE)
            archive.writestr(entry, text.encode("utf-8", "replace"), zipfile.ZIP_DEFLATED)
    return {f"{options.stem}.xlsx": file.getvalue()}


def _column(place: int) -> str:
    """Return the letters of a column counted from 0: A, Z, AA."""
    more, last = divmod(place, 26)
    return (_column(more - 1) if more else "") + chr(ord("A") + last)


def _csv_files(
    run: ExportedRun, tables: Sequence[ForceTable], options: ExportOptions
) -> Mapping[str, bytes]:
    """Return a row for each setting and speed, every table of the results, and what it is about.

    With a decimal comma the cells stand between semicolons, as spreadsheets of those countries read
    and write them. What other targets say in a comment stands in a text file: CSV has no comments.
    """
    shown, mark, stem = options.units, options.decimal, options.stem
    rows = []
    for table in tables:
        speeds = shown.show(table.speeds, "m/s")
        forces = [shown.show(one, "N") for one in (table.forces, table.low, table.high)]
        for v, speed, *numbers in zip(table.speeds, speeds, *forces, strict=True):
            force, low, high = (f"{one:.3f}".replace(".", mark) for one in numbers)
            ends = (low, high) if table.has_interval else ("", "")
            speed_cell = f"{speed:.6g}".replace(".", mark)
            rows.append((str(table.setting), speed_cell, force, table.range_of(v), *ends))
    force, low, high = (
        shown.column(name, "N") for name in ("force_N", "force_ci_low_N", "force_ci_high_N")
    )
    head = ("setting", shown.column("speed_m_per_s", "m/s"), force, "range", low, high)
    gas = gas_line(tables[0], "add it to the force")
    about = "\n".join(header_lines(run, tables, sign=_SIGN, gas=gas)) + "\n"
    files = {
        f"{stem}.csv": _csv(head, rows, mark),
        f"{stem}_about.txt": about.encode("utf-8", "backslashreplace"),
    }
    for stored in _stored(run, shown):
        # The unit stands with the name, where that does not end with it already.
        named = [
            name if not unit or name.endswith("_" + unit.replace("/", "_per_"))
            else f"{name} [{unit}]"
            for name, unit in zip(stored.headings, stored.units, strict=True)
        ]  # fmt: skip
        files[f"{stem}_{stored.name}.csv"] = _csv(named, stored.rows, mark)
    return files


def _csv(head: Sequence[str], rows: Iterable[Sequence[Any]], mark: str) -> bytes:
    def shown(cell: Any) -> str:
        """A text that no spreadsheet takes for a formula; numbers stay numbers."""
        text = repr(cell).replace(".", mark) if isinstance(cell, float) else str(cell)
        try:
            float(text.replace(",", "."))
        except ValueError:
            return safe_cell(text)
        return text

    file = io.StringIO()
    writer = csv.writer(file, delimiter=";" if mark == "," else ",", lineterminator="\n")
    writer.writerow(head)
    writer.writerows(["" if cell is None else shown(cell) for cell in row] for row in rows)
    return file.getvalue().encode("utf-8", "backslashreplace")


# What no template makes alone.
_WRITERS: Mapping[
    str, Callable[[ExportedRun, Sequence[ForceTable], ExportOptions], Mapping[str, bytes]]
] = {"csv": _csv_files, "xlsx": _workbook, "matlab": _matlab, "modelica": _modelica}
# By name; a new target is a template and an entry there.
TARGETS: Mapping[str, Target] = {
    name: Target(name, **entry)
    for name, entry in tomllib.loads(
        resources.files("damperfit.exporting").joinpath("targets.toml").read_text("utf-8")
    ).items()
}


def find_target(name: str) -> Target:
    """Return the target of a name."""
    if name not in TARGETS:
        raise ConfigurationError(
            f"expected one of {', '.join(TARGETS)}.{did_you_mean(name, TARGETS)} "
            "damperfit export --list shows them",
            where=Option("to", name),
            code="unknown-target",
        )
    return TARGETS[name]
