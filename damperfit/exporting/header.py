"""What every file says of itself: whose damper, tested where, how good, what is in it and what not.

Plain lines; each target puts its own mark of a comment before them. And the templates of files.
"""

from __future__ import annotations

import math
from functools import cache
from itertools import groupby
from typing import TYPE_CHECKING, Any

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup, escape

from damperfit import __version__
from damperfit.damper.mounting import NONE
from damperfit.damper.quantity import RIG
from damperfit.exporting.tables import road_misses
from damperfit.reporting.report import tested_range
from damperfit.reporting.sheet import printable

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from damperfit.exporting.tables import ExportedRun, ForceTable, RoadMiss

_OTHERS = 6  # settings whose MSE is listed one by one


def header_lines(
    run: ExportedRun,
    tables: Sequence[ForceTable],
    *,
    sign: str,
    gas: str,
    has_table: bool = True,
) -> tuple[str, ...]:
    """Return the lines that stand in every file.

    Parameters
    ----------
    run : ExportedRun
        The damper.
    tables : sequence of ForceTable
        What stands in the file.
    sign : str
        What is positive in it, in words.
    gas : str
        Where the gas force is.
    has_table : bool
        Force by speed stands in it; otherwise the equations.
    """
    return tuple(map(one_line, _lines(run, tables, sign, gas, has_table=has_table)))


def _lines(
    run: ExportedRun, tables: Sequence[ForceTable], sign: str, gas: str, *, has_table: bool
) -> Iterator[str]:
    settings = ", ".join(str(one.setting) for one in tables)
    yield f"damperfit {__version__}: {run.run.name}, setting {settings}"
    yield "identity: " + ("; ".join(f"{k} {v}" for k, v in run.run.identity.items()) or "not named")
    yield f"model: {run.damper.sentence}"
    yield f"tested: {tested_range(run.run.tested)}"
    yield f"MSE of the fit: {_mse(tables)}"
    if has_table:
        yield "table: force of the damper alone at constant speed, in the middle of the stroke"
    yield f"taken out: {taken_out(run)}"
    yield determined_line(tables)
    if has_table:
        yield _beyond(tables)
        yield road_line(run, tables)
    yield f"gas: {gas}"
    yield f"sign: {sign}"
    yield f"results: sha256 {run.run.digest or 'not known'}"


def one_line(text: str) -> str:
    """Return text that ends no comment and holds no control characters."""
    return "".join(letter if letter.isprintable() else " " for letter in text)


def taken_out(run: ExportedRun) -> str:
    """Return what the fit found and the file does not hold: mounting, play, mass, lag, tare."""
    found = []
    quantities = {one.name: one for one in run.damper.quantities}
    for name, one in quantities.items():
        numbers = [
            getattr(setting.values, name)
            for setting in run.settings
            if name in setting.values.names
        ]
        is_tare = one.is_offset and run.damper.rest_force(0.0) is not None
        if not numbers or not any(numbers) or not (is_tare or one.scope == RIG):
            continue
        factor, unit = {"N/m": (1e-3, "N/mm"), "m": (1e3, "mm"), "s": (1e3, "ms")}.get(
            one.unit, (1.0, one.unit)
        )
        ends = [f"{factor * end:.4g}" for end in (min(numbers), max(numbers))]
        label = "tare of the rig" if is_tare else one.label
        found.append(f"{label} {' to '.join(dict.fromkeys(ends))} {unit}")
    if getattr(getattr(run.damper, "mounting", None), "series_stiffness", NONE) == NONE:
        found.insert(0, "no mounting (rigid)")
    return ", ".join(found)


def gas_line(table: ForceTable, *, place: str, is_bump_positive: bool = False) -> str:
    """Return what presses at rest, and where it belongs.

    Parameters
    ----------
    table : ForceTable
        Of any setting: the gas is the damper's.
    place : str
        What to do with it: "add it to the spring".
    is_bump_positive : bool
        Whether the file counts forces so; the gas then has the sign of its spring.
    """
    sign, way = (-1.0, "plus") if is_bump_positive else (1.0, "minus")
    what = "gas force" if table.has_gas else "force at rest, gas and tare of the rig together,"
    sentence = (
        f"not in the table; {what} {sign * table.level:.4g} N at x = 0 ({way} pushes the rod out)"
    )
    if table.has_gas:
        in_bump, in_rebound = sign * table.gas_forces[0], sign * table.gas_forces[-1]
        sentence += (
            f", {in_bump:.4g} N at -{1e3 * table.stroke:.3g} mm, "
            f"{in_rebound:.4g} N at +{1e3 * table.stroke:.3g} mm of rebound"
        )
    return f"{sentence}; {place}"


def determined_line(tables: Sequence[ForceTable]) -> str:
    """Return up to which speed the logs determine the force of each setting."""
    speeds = [
        ("not known" if math.isnan(one.determined) else f"{one.determined:.2g} m/s", one)
        for one in tables
    ]
    parts = []
    for speed, group in groupby(speeds, key=lambda pair: pair[0]):
        names = [str(one.setting) for _, one in group]
        which = names[0] if len(names) == 1 else f"{names[0]} to {names[-1]}"
        parts.append(f"{speed} at setting{'s' * (len(names) > 1)} {which}")
    tested = dict.fromkeys(f"{one.tested:.3g}" for one in tables)
    return (
        f"force determined by the logs (95 % interval within 5 %) to {', '.join(parts)}; tested to "
        f"{' to '.join((min(tested), max(tested)) if len(tested) > 1 else tested)} m/s"
    )


def _beyond(tables: Sequence[ForceTable]) -> str:
    if any(one.is_extended for one in tables):
        end, tested = max(one.end for one in tables), min(one.tested for one in tables)
        return (
            f"beyond {tested:.4g} m/s UNTESTED: up to {end:.4g} m/s the table is the model's, "
            "unmeasured there"
        )
    return (
        f"beyond {tables[0].end:.4g} m/s there is nothing: do not let a program hold the last "
        "value, the damper's force goes on rising; --extend SPEED adds rows of the model"
    )


def road_line(run: ExportedRun, tables: Sequence[ForceTable]) -> str:
    """Return how far the damper's dynamics are from its tables on a road, at three speeds."""
    misses = [(road_misses(run, one), one) for one in tables]
    most, table = max(misses, key=lambda pair: max(one.percent for one in pair[0]))
    least, _ = min(misses, key=lambda pair: max(one.percent for one in pair[0]))
    sentence = (
        "on a class B road the damper's dynamics (elasticity of the oil) are off the table by "
        + _shares(most)
    )
    if len(tables) > 1:
        sentence += f" at setting {table.setting}, by {_shares(least)} at the best"
    return sentence


def _shares(misses: Sequence[RoadMiss]) -> str:
    return ", ".join(
        f"{one.percent:.2g} % MSE ({one.rms:.3g} N rms) at {one.speed:.2g} m/s" for one in misses
    )


def interval_lines(table: ForceTable, *, speed: float = 1.0, sign: float = 1.0) -> list[str]:
    """Return the 95 % interval of each force, in a file's units and signs, as lines."""
    if not table.has_interval:
        return ["95 % interval of the forces: not known"]
    unit = "mm/s" if abs(speed) > 1.0 else "m/s"
    rows = [f"95 % interval of the forces: {unit}, low N, high N"]
    for v, *ends in zip(table.speeds, table.low, table.high, strict=True):
        low, high = sorted(sign * end for end in ends)
        rows.append(f"  {speed * v + 0.0:.6g} {low:.3f} {high:.3f}")
    return rows


def _mse(tables: Sequence[ForceTable]) -> str:
    known = [one for one in tables if math.isfinite(one.mse_percent)]
    if not known:
        return "not known"
    if len(known) > _OTHERS:
        worst = max(known, key=lambda one: one.mse_percent)
        best = min(known, key=lambda one: one.mse_percent)
        return (
            f"{best.mse_percent:.3g} % (setting {best.setting}) to {worst.mse_percent:.3g} % "
            f"(setting {worst.setting})"
        )
    if len(known) == 1:
        return f"{known[0].mse_percent:.3g} %"
    return ", ".join(f"{one.mse_percent:.3g} % at setting {one.setting}" for one in known)


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
