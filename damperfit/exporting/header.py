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
    from collections.abc import Sequence

    from damperfit.exporting.tables import ExportedRun, ForceTable, RoadMiss

_SHOWN = {"N/m": (1e-3, "N/mm"), "m": (1e3, "mm"), "s": (1e3, "ms")}
_OTHERS = 6  # settings whose MSE is listed one by one


def header_lines(
    run: ExportedRun, tables: Sequence[ForceTable], *, sign: str, gas: str, has_table: bool = True
) -> tuple[str, ...]:
    """Return the lines that stand in every file.

    Whose damper, what is positive (``sign``), where the gas force is (``gas``); of force by speed,
    or of the equations.
    """
    about = run.run
    settings = ", ".join(str(one.setting) for one in tables)
    identity = "; ".join(f"{k} {v}" for k, v in about.identity.items()) or "not named"
    lines = [
        f"damperfit {__version__}: {about.name}, setting {settings}",
        f"identity: {identity}",
        f"model: {run.damper.sentence}",
        f"tested: {tested_range(about.tested)}",
        f"MSE of the fit: {_mse(tables)}",
        *(["table: force of the damper alone at constant speed, in the middle of the stroke"]
          if has_table else []),
        f"taken out: {taken_out(run)}",
        determined_line(tables),
        *([_beyond(tables), road_line(run, tables)] if has_table else []),
        f"gas: {gas}",
        f"sign: {sign}",
        f"results: sha256 {about.digest or 'not known'}",
    ]  # fmt: skip
    return tuple(map(one_line, lines))


def one_line(text: str) -> str:
    """Return text that ends no comment and holds no control characters."""
    return "".join(letter if letter.isprintable() else " " for letter in text)


def taken_out(run: ExportedRun) -> str:
    """Return what the fit found and the file does not hold: mounting, play, mass, lag, tare."""
    parts = []
    for one in run.damper.quantities:
        values = [setting.values for setting in run.settings]
        numbers = [getattr(known, one.name) for known in values if one.name in known.names]
        is_tare = one.is_offset and run.damper.rest_force(0.0) is not None
        if not any(numbers) or not (is_tare or one.scope == RIG):
            continue
        factor, unit = _SHOWN.get(one.unit, (1.0, one.unit))
        ends = [f"{factor * end:.4g}" for end in (min(numbers), max(numbers))]
        label = "tare of the rig" if is_tare else one.label
        parts.append(f"{label} {' to '.join(dict.fromkeys(ends))} {unit}")
    if getattr(getattr(run.damper, "mounting", None), "series_stiffness", NONE) == NONE:
        parts.insert(0, "no mounting (rigid)")
    return ", ".join(parts)


def gas_line(table: ForceTable, *, place: str, is_bump_positive: bool = False) -> str:
    """Return what presses at rest, and what to do with it (``place``: "add it to the spring").

    The table may be of any setting: the gas is the damper's. Where a file counts compression as
    positive the gas has the sign of its spring.
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
        "value, the damper's force goes on rising; an extended table has rows of the model"
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
    if len(known) > _OTHERS:
        ranked = sorted(known, key=lambda one: one.mse_percent)
        ends = (
            f"{one.mse_percent:.3g} % (setting {one.setting})" for one in ranked[:: len(ranked) - 1]
        )
        return " to ".join(ends)
    if len(known) == 1:
        return f"{known[0].mse_percent:.3g} %"
    shown = (f"{one.mse_percent:.3g} % at setting {one.setting}" for one in known)
    return ", ".join(shown) or "not known"


def rendered(template: str, **known: Any) -> str:
    """Return a template of this package, by its file's name, filled in with what it asks for.

    In XML and HTML texts cannot leave their place.
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
