"""The text files of targets: templates of their grammars, and what these are filled with.

A template gets the run, its tables (`table` is the first), the options, and a few functions:
``header(sign, gas)`` and ``intervals(speed, sign)`` return the lines that every file holds,
``comments(mark, lines)`` puts a mark before each. Sources of the grammars: examples that come with
the programs, and public files; hardly one is documented by its maker.

=================  =================================================================================
template           grammar
=================  =================================================================================
``adams.dpr``      Adams/Car in TeimOrbit, which MotionView reads too: blocks in square brackets,
                   tables below one line of column names in braces, comments behind ``$``; signs as
                   in the program's own example (3218 N at +1270, 1495 N at -1270 mm/s)
``adams.xml``      the same in XML; the sizes of the program's picture of a damper are left out
``carmaker.txt``   Infofile: lines of a table begin with a tab, the first row is 0 0; pull is
                   rebound, as in the program's own example; no place for gas or friction is known
``carsim.par``     block FD_TABLE, compression positive; the name of the data set around it is not
                   known, so the block stands alone
``chrono.yaml``    a TSDA; Chrono applies minus the curve at the rate at which the length grows
``combitable.txt`` Modelica's CombiTable1D and 2D: ``#1``, matrices with their sizes; grids rise
                   strictly, the corner of one is ignored
``matlab.m``       script for MATLAB, Octave, Scilab: breakpoints and table of a 2-D lookup
``modelica.mo``    a model without any library: the paper's physics where that is the law, else the
                   table; s_rel, v_rel, f as in ``PartialCompliantWithRelativeStates``
=================  =================================================================================
"""

from __future__ import annotations

import io
import re
from functools import cache
from itertools import groupby
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup, escape

from damperfit import __version__
from damperfit.damper.purdy.parameters import Damper
from damperfit.exporting.header import gas_line, header_lines, interval_lines, one_line
from damperfit.report.sheet import printable

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from numpy.typing import NDArray

    from damperfit.exporting.source import ExportedRun
    from damperfit.exporting.tables import ForceTable
    from damperfit.exporting.targets import ExportOptions

    FloatArray = NDArray[np.float64]

__all__ = ["matlab_files", "modelica", "rendered", "setting_numbers", "text_of"]

_REBOUND = "velocity in m/s and force in N are positive in rebound; displacement in m likewise"
_OF_PAPER = ("r_m1", "r_m2", "r_m3", "k_e", "f_f")


def rendered(template: str, **known: Any) -> str:
    """Return a template of this package filled in; in XML and HTML texts cannot leave their place.

    Parameters
    ----------
    template : str
        Name of its file.
    **known
        What it asks for.
    """
    is_marked = template.endswith((".xml", ".html"))
    return _environment(is_marked=is_marked).get_template(template).render(**known)


@cache
def _environment(*, is_marked: bool) -> Environment:
    found = Environment(
        loader=PackageLoader("damperfit.exporting"),
        autoescape=is_marked,  # noqa: S701 - other texts are no markup
        finalize=_shown if is_marked else None,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    found.filters["one_line"] = one_line
    return found


def _shown(text: object) -> Markup:
    return text if isinstance(text, Markup) else escape(printable(str(text)))


def text_of(
    template: str,
) -> Callable[[ExportedRun, Sequence[ForceTable], ExportOptions], str]:
    """Return what writes a target's file from a template."""

    def write(run: ExportedRun, tables: Sequence[ForceTable], options: ExportOptions) -> str:
        return rendered(template, **_known(run, tables, options)).rstrip("\n") + "\n"

    return write


def _known(
    run: ExportedRun, tables: Sequence[ForceTable], options: ExportOptions
) -> dict[str, Any]:
    """What templates may ask for."""
    first, numbers = tables[0], setting_numbers(tables)

    def header(
        sign: str, place: str, *, is_bump_positive: bool = False, has_table: bool = True
    ) -> list[str]:
        gas = gas_line(first, place=place, is_bump_positive=is_bump_positive)
        gas = gas if has_table else place
        return list(header_lines(run, tables, sign=sign, gas=gas, has_table=has_table))

    def grid_of(column: str) -> FloatArray:
        grid = np.zeros((len(first.speeds) + 1, len(tables) + 1))
        grid[0, 1:], grid[1:, 0] = numbers, first.speeds
        grid[1:, 1:] = np.column_stack([getattr(table, column) for table in tables])
        return grid

    gas = list(zip(first.gas_displacements, first.gas_forces, strict=True))
    if len(gas) == 1:  # a table needs two points
        gas = [(-first.stroke, first.level), (first.stroke, first.level)]
    return {
        "run": run,
        "version": __version__,
        "tables": tables,
        "table": first,
        "options": options,
        "header": header,
        "intervals": lambda speed=1.0, sign=None, of=first: interval_lines(
            of, speed=speed, sign=(-1.0 if speed < 0.0 else 1.0) if sign is None else sign
        ),
        "comments": lambda mark, lines: "\n".join(f"{mark} {one}".rstrip() for one in lines),
        "rebound": _REBOUND,
        "ranges": [
            (range_, list(rows))
            for range_, rows in groupby(first.rows(), key=lambda row: first.range_of(row[0]))
        ],
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


def setting_numbers(tables: Sequence[ForceTable]) -> FloatArray:
    """Return a number for each setting, rising: where it stands, else 1, 2, ..."""
    known = [table.setting.number() for table in tables]
    numbers = np.array([np.nan if one is None else one for one in known])
    if np.isfinite(numbers).all() and (np.diff(numbers) > 0.0).all():
        return numbers
    return np.arange(1.0, len(tables) + 1.0)


def modelica(run: ExportedRun, tables: Sequence[ForceTable], options: ExportOptions) -> str:
    """Return a Modelica model with all settings; ``setting`` counts them from 1."""
    speeds = tables[0].speeds
    slopes = [np.diff(table.forces) / np.diff(speeds) for table in tables]
    x, gas = tables[0].gas_displacements, tables[0].gas_forces
    word = re.sub(r"\W", "_", options.stem, flags=re.ASCII).strip("_") or "damper"
    word = word if word[0].isalpha() else f"D_{word}"
    quantities = [one for one in run.damper.quantities if one.name in _OF_PAPER]
    return rendered(
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


def matlab_files(
    run: ExportedRun, tables: Sequence[ForceTable], options: ExportOptions
) -> Mapping[str, bytes]:
    """Return a script (.m) and a data file (.mat, version 5) with the same variables.

    The bytes of the .mat depend on the damper alone: no date stands in it.
    """
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
        "setting": setting_numbers(tables)[None, :],
        "velocity": first.speeds[:, None],
        "force": columns("forces"),
        "force_low": columns("low"),
        "force_high": columns("high"),
        "determined_speed": columns("determined"),
        "tested_speed": np.array([[max(table.tested for table in tables)]]),
        "gas_displacement": first.gas_displacements[:, None],
        "gas_force": first.gas_forces[:, None],
    }
    lines = [one_line(line) for line in about]
    script = rendered("matlab.m", **known, about=lines, variables=variables)
    file = io.BytesIO()
    cells = np.array(labels, dtype=object)[None, :]
    document = {"setting_label": cells, **variables, "about": "\n".join(about)}
    savemat(cast("Any", file), document, format="5")
    content = b"MATLAB 5.0 MAT-file, damperfit".ljust(116) + file.getvalue()[116:]
    stem = options.stem
    return {f"{stem}.m": script.encode("utf-8", "replace"), f"{stem}.mat": content}
