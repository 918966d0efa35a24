"""The text grammars of force by speed: what each program reads, a function each.

A function takes the run and the tables that its file holds, and returns the text. Sources of the
grammars: examples that come with the programs, and public files; none is documented by its maker.
"""

from __future__ import annotations

import csv
import io
import math
import re
from typing import TYPE_CHECKING, Any, cast
from xml.sax.saxutils import quoteattr

import numpy as np

from damperfit.exporting.header import (
    commented,
    gas_line,
    header_lines,
    interval_lines,
    one_line,
)
from damperfit.exporting.workbook import stored_tables
from damperfit.tables import safe_cell

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from numpy.typing import NDArray

    from damperfit.exporting.source import ExportedRun
    from damperfit.exporting.tables import ForceTable
    from damperfit.exporting.targets import ExportOptions

    FloatArray = NDArray[np.float64]

__all__ = [
    "REBOUND",
    "adams_dpr",
    "adams_xml",
    "carmaker",
    "carsim",
    "chrono",
    "combitable",
    "csv_files",
    "matlab_files",
    "setting_numbers",
]

REBOUND = "velocity in m/s and force in N are positive in rebound; displacement in m likewise"
_ADAMS = "velocity in mm/s and force in N are positive in rebound, as the damper grows longer"
_RULER = 80


def adams_dpr(run: ExportedRun, tables: Sequence[ForceTable], _: ExportOptions) -> str:
    """Return an Adams/Car property file in TeimOrbit, which MotionView reads too.

    Blocks in square brackets, tables below one line of column names in braces, comments behind
    ``$``; the program's own spline (Akima) joins the rows. Signs as in the example that comes with
    the program (3218 N at +1270, 1495 N at -1270 mm/s). There is no place for the gas force.
    """
    (table,) = tables
    gas = gas_line(table, place="give it as gas preload, or add it to the spring")
    lines = [*header_lines(run, [table], sign=_ADAMS, gas=gas), *interval_lines(table, speed=1e3)]
    return (
        f"{_ruler('MDI_HEADER')}[MDI_HEADER]\n FILE_TYPE     =  'dpr'\n FILE_VERSION  =  4.0\n"
        f" FILE_FORMAT   =  'ASCII'\n{commented(lines, '$')}{_ruler('UNITS')}[UNITS]\n"
        " LENGTH  =  'mm'\n ANGLE  =  'degrees'\n FORCE  =  'newton'\n MASS  =  'kg'\n"
        f" TIME  =  'second'\n{_ruler('CURVE')}[CURVE]\n{{   vel       force}}\n"
        f"{_adams_rows(table, '$')}"
    )


def _ruler(name: str) -> str:
    return "$" + name.rjust(_RULER - 1, "-") + "\n"


def _adams_rows(table: ForceTable, mark: str = "") -> str:
    """Return rows of mm/s and N; a comment stands where another range begins."""
    lines, last = [], table.range_of(table.end)
    for speed, force in zip(table.speeds, table.forces, strict=True):
        if mark and table.range_of(speed) != last:
            last = table.range_of(speed)
            lines.append(f"{mark} {last.upper() if last == 'untested' else last} from here on")
        lines.append(f"{1e3 * speed:12.4f} {force:14.3f}")
    return "\n".join(lines) + "\n"


def adams_xml(run: ExportedRun, tables: Sequence[ForceTable], _: ExportOptions) -> str:
    """Return an Adams/Car property file in XML, the gas force at x = 0 as constant preload.

    The program's template also has the sizes of its picture of a damper; they are left out, for
    nobody has measured this one's.
    """
    (table,) = tables
    gas = gas_line(table, place="handed over as gasPreloadConstant, positive as it pushes out")
    lines = [*header_lines(run, [table], sign=_ADAMS, gas=gas), *interval_lines(table, speed=1e3)]
    lines.append("upperDiameter, upperLength, lowerDiameter, lowerLength of the picture: not known")
    comment = "\n".join(lines).replace("--", "- -")
    units = (
        ("angle", "deg"), ("current", "A"), ("force", "N"), ("length", "mm"),
        ("luminosity", "cd"), ("mass", "kg"), ("quantity", "mol"), ("solidAngle", "sr"),
        ("temperature", "K"), ("time", "s"),
    )  # fmt: skip
    settings = "\n".join(
        f'    <afc:UnitSetting name="{name}" current="{unit}" />' for name, unit in units
    )
    who = quoteattr(run.identity.get("operator", ""))
    version = quoteattr(f"damperfit {run.version}")
    return f"""<?xml version="1.0" encoding="ISO-8859-1"?>
<!--
{comment}
-->
<afc xmlns="http://www.mscsoftware.com/:vfc" xmlns:afc="http://www.mscsoftware.com/:afc">
  <afc:Bibliography>
    <File schema="afc" version="2.0.0.0" />
    <Revision version="2" />
    <Author user={who} name={who} />
    <Application name="damperfit" version={version} />
  </afc:Bibliography>
  <afc:Units>
{settings}
  </afc:Units>
  <DamperProperties active="true" userDefined="false" method="non_linear" \
dampingMethod="non_linear" gasPreloadMethod="constant" gasPreloadConstant="{-table.level:.3f}">
    <Spline name="spline_data" id="0" active="true" userDefined="false" \
interpolation_method="akima"><![CDATA[
{_adams_rows(table)}]]></Spline>
  </DamperProperties>
</afc>
"""


def carmaker(run: ExportedRun, tables: Sequence[ForceTable], _: ExportOptions) -> str:
    """Return the damper's part of a CarMaker Infofile: push and pull, both without sign.

    Lines of a table begin with a tab; the first row is 0 0. Pull is rebound: the program's own
    example takes it while the damper grows longer. No place for gas or friction is known.
    """
    (table,) = tables
    sign = (
        "Damp_Push is bump, Damp_Pull is rebound; speed in m/s and force in N are without sign. "
        "Front axle; for the rear write SuspR for SuspF"
    )
    gas = gas_line(table, place="add it to the spring")
    lines = [*header_lines(run, [table], sign=sign, gas=gas), *interval_lines(table)]
    text = "#INFOFILE1.1 (UTF-8) - Do not remove this line!\n" + commented(lines, "##")
    for name, side in (("Damp_Push", -1.0), ("Damp_Pull", 1.0)):
        rows = sorted(
            (abs(float(v)), max(float(side * f), 0.0) + 0.0)
            for v, f in zip(table.speeds, table.forces, strict=True)
            if side * v >= 0.0
        )
        text += f"SuspF.{name}.Amplify = 1.0\nSuspF.{name}:\n"
        text += "".join(f"\t{speed:.7g} {force:.3f}\n" for speed, force in rows)
    return text


def carsim(run: ExportedRun, tables: Sequence[ForceTable], _: ExportOptions) -> str:
    """Return the block FD_TABLE of CarSim and TruckSim; compression is positive.

    Keyword, interpolation word and ENDTABLE are what public files show; the name of the data set
    around them is not known, so the block stands alone.
    """
    (table,) = tables
    sign = "COMPRESSION (bump) is positive, for speed in mm/s and force in N alike"
    gas = gas_line(table, place="add it to the spring", is_bump_positive=True)
    lines = header_lines(run, [table], sign=sign, gas=gas)
    text = commented([*lines, *interval_lines(table, speed=-1e3, sign=-1.0)], "!")
    rows = zip(-1e3 * table.speeds[::-1], -table.forces[::-1], strict=True)
    rows_as_text = "".join(f"{v + 0.0:.4f}, {f + 0.0:.3f}\n" for v, f in rows)
    return f"{text}FD_TABLE SPLINE\n{rows_as_text}ENDTABLE\n"


def chrono(run: ExportedRun, tables: Sequence[ForceTable], options: ExportOptions) -> str:
    """Return the entry of a spring and damper (TSDA) in a YAML model of Chrono.

    Chrono goes straight from point to point and applies minus the curve at the rate at which the
    length grows; the curve itself is positive with it.
    """
    (table,) = tables
    sign = (
        "velocity in m/s is positive in rebound, as the length grows; so is the curve in N, "
        "which Chrono applies with a minus"
    )
    gas = gas_line(table, place="add it to spring_curve_data of the same entry")
    lines = [*header_lines(run, [table], sign=sign, gas=gas), *interval_lines(table)]
    rows = ",\n".join(
        f"      [ {v:.7g}, {f:.3f} ]" for v, f in zip(table.speeds, table.forces, strict=True)
    )
    name = f"{options.stem}_s{table.slug}"
    return (
        f"{commented(lines, '#')}# add body1, body2, point1 and point2 of your model\n"
        f'tsdas:\n  - name: "{name}"\n    damping_curve_data: [\n{rows}\n    ]\n'
    )


def combitable(run: ExportedRun, tables: Sequence[ForceTable], _: ExportOptions) -> str:
    """Return the text file of Modelica's CombiTable1D and CombiTable2D.

    ``#1``, then matrices with their sizes: one for each setting (velocity, force), one with all
    settings (first row the settings, first column the velocity; the corner is ignored), the same
    for the ends of the 95 % interval, and the gas force by displacement. Grids rise strictly.
    Settings that are no numbers count 1, 2, ...; a comment says which is which.
    """
    first = tables[0]
    gas = gas_line(first, place="matrix gas, by displacement; add it to the table's force")
    lines = list(header_lines(run, tables, sign=REBOUND, gas=gas))
    axis = setting_numbers(tables)
    if len(tables) > 1:
        lines += [
            f"column {at:g} is setting {one_line(str(table.setting))}"
            for at, table in zip(axis, tables, strict=True)
            if str(table.setting) != f"{at:g}"
        ]
    text = "#1\n" + commented(lines, "#")
    for table in tables:
        # A name that programs take as an identifier: force_s10, force_s_3.
        name = "force_s" + re.sub(r"[^A-Za-z0-9]", "_", table.slug)
        pairs = np.column_stack([table.speeds, table.forces])
        text += _matrix(name, pairs, f"setting {table.setting}: velocity m/s, force N")
    for name in ("forces", "low", "high"):
        if name != "forces" and not any(table.has_interval for table in tables):
            continue
        if name == "forces" and len(tables) == 1:
            continue
        grid = np.zeros((len(first.speeds) + 1, len(tables) + 1))
        grid[0, 1:], grid[1:, 0] = axis, first.speeds
        grid[1:, 1:] = np.column_stack([getattr(table, name) for table in tables])
        what = "" if name == "forces" else f", {name} end of the 95 % interval"
        text += _matrix(
            "force" if name == "forces" else f"force_{name}",
            grid,
            f"first row settings, first column velocity m/s; N{what}",
        )
    pairs = np.column_stack([first.gas_displacements, first.gas_forces])
    if len(pairs) == 1:  # a table needs two points
        pairs = np.array([[-first.stroke, first.level], [first.stroke, first.level]])
    return text + _matrix("gas", pairs, "displacement m, force at rest N")


def setting_numbers(tables: Sequence[ForceTable]) -> FloatArray:
    """Return a number for each setting, rising: where it stands, else 1, 2, ..."""
    known = [table.setting.number() for table in tables]
    numbers = np.array([np.nan if one is None else one for one in known])
    if np.isfinite(numbers).all() and (np.diff(numbers) > 0.0).all():
        return numbers
    return np.arange(1.0, len(tables) + 1.0)


def _matrix(name: str, rows: FloatArray, about: str) -> str:
    lines = "\n".join(" ".join(f"{cell:.9g}" for cell in row) for row in rows)
    return f"double {name}({rows.shape[0]},{rows.shape[1]})   # {one_line(about)}\n{lines}\n"


def matlab_files(
    run: ExportedRun, tables: Sequence[ForceTable], options: ExportOptions
) -> Mapping[str, bytes]:
    """Return a script (.m) and a data file (.mat, version 5) for MATLAB, Octave and Scilab.

    Breakpoints and table of a two-dimensional lookup: vectors ``velocity`` and ``setting``, matrix
    ``force`` with velocities down and settings across; ``setting_label`` says where the adjusters
    stand. The bytes of the .mat depend on the damper alone.
    """
    from scipy.io import savemat

    first = tables[0]
    gas = gas_line(first, place="gas_force at gas_displacement; add it to the table's force")
    labels = [str(table.setting) for table in tables]
    lines = [
        *header_lines(run, tables, sign=REBOUND, gas=gas),
        "set the table's extrapolation: linear or error, never the last value",
        *(f"column {k} of force: setting {label}" for k, label in enumerate(labels, 1)),
    ]
    known: dict[str, FloatArray] = {
        "setting": setting_numbers(tables)[None, :],
        "velocity": first.speeds[:, None],
        "force": np.column_stack([table.forces for table in tables]),
        "force_low": np.column_stack([table.low for table in tables]),
        "force_high": np.column_stack([table.high for table in tables]),
        "determined_speed": np.array([[table.determined for table in tables]]),
        "tested_speed": np.array([[max(table.tested for table in tables)]]),
        "gas_displacement": first.gas_displacements[:, None],
        "gas_force": first.gas_forces[:, None],
    }
    text = commented(map(one_line, lines), "%")
    quoted = ("'" + one_line(label).replace("'", "''") + "'" for label in labels)
    text += f"setting_label = {{{', '.join(quoted)}}};\n"
    for name, values in known.items():
        rows = [" ".join(f"{cell:.9g}" for cell in row) for row in values]
        between = ";\n  " if len(rows) > 1 else ""
        text += f"{name} = [{between.join(rows)}];\n"
    file = io.BytesIO()
    cells = np.array(labels, dtype=object)[None, :]
    variables = {"setting_label": cells, **known, "about": "\n".join(lines)}
    savemat(cast("Any", file), variables, format="5")
    content = b"MATLAB 5.0 MAT-file, damperfit".ljust(116) + file.getvalue()[116:]
    stem = options.stem
    return {f"{stem}.m": text.encode("utf-8", "replace"), f"{stem}.mat": content}


_ABOUT_CSV = "forces, displacement and velocity are positive in rebound (rod out)"


def csv_files(
    run: ExportedRun, tables: Sequence[ForceTable], options: ExportOptions
) -> Mapping[str, bytes]:
    """Return a row for each setting and speed, every table of the results, and what it is about.

    With a decimal comma the cells stand between semicolons, as spreadsheets of those countries read
    and write them. What other targets say in a comment stands in a text file: CSV has no comments.
    """
    shown, mark, stem = options.units, options.decimal, options.stem
    columns = ("force_N", "force_ci_low_N", "force_ci_high_N")
    rows = []
    for table in tables:
        forces = [shown.show(one, "N") for one in (table.forces, table.low, table.high)]
        speeds = zip(table.speeds, shown.show(table.speeds, "m/s"), *forces, strict=True)
        for at, speed, force, *ends in speeds:
            numbers = [f"{speed:.6g}", f"{force:.3f}", *(f"{end:.3f}" for end in ends)]
            numbers = [one.replace(".", mark) for one in numbers]
            ends_known = numbers[2:] if table.has_interval else ["", ""]
            rows.append([str(table.setting), *numbers[:2], table.range_of(at), *ends_known])
    force, *ends = (shown.column(name, "N") for name in columns)
    head = ("setting", shown.column("speed_m_per_s", "m/s"), force, "range", *ends)
    gas = gas_line(tables[0], place="add it to the force")
    about = "\n".join(header_lines(run, tables, sign=_ABOUT_CSV, gas=gas)) + "\n"
    files = {
        f"{stem}.csv": _csv(head, rows, mark),
        f"{stem}_about.txt": about.encode("utf-8", "backslashreplace"),
    }
    for stored in stored_tables(run, shown):
        named = [_heading(*pair) for pair in zip(stored.headings, stored.units, strict=True)]
        cells = ([_cell(one, mark) for one in row] for row in zip(*stored.columns, strict=True))
        files[f"{stem}_{stored.name}.csv"] = _csv(named, cells, mark)
    return files


def _csv(head: Sequence[str], rows: Iterable[Sequence[str]], mark: str) -> bytes:
    text = io.StringIO()
    writer = csv.writer(text, delimiter=";" if mark == "," else ",", lineterminator="\n")
    writer.writerow(head)
    writer.writerows([_safe(cell) for cell in row] for row in rows)
    return text.getvalue().encode("utf-8", "backslashreplace")


def _heading(name: str, unit: str) -> str:
    """Return the name with its unit, where it does not end with it already."""
    is_said = not unit or name.endswith("_" + unit.replace("/", "_per_"))
    return name if is_said else f"{name} [{unit}]"


def _cell(cell: Any, mark: str) -> str:
    if cell is None or (isinstance(cell, float) and not math.isfinite(cell)):
        return ""
    return repr(cell).replace(".", mark) if isinstance(cell, float) else str(cell)


def _safe(cell: str) -> str:
    """Return a cell that no spreadsheet takes for a formula; numbers stay numbers."""
    try:
        float(cell.replace(",", "."))
    except ValueError:
        return safe_cell(cell)
    return cell
