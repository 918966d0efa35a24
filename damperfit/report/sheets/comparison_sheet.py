"""Two runs beside each other: forces, parameters, figures, a verdict a line."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from damperfit.comparison import Sameness, verdict_of
from damperfit.report.sheets.rounding import NOTHING, number, with_interval
from damperfit.report.sheets.sheet import Sheet
from damperfit.units.shown_units import SI

if TYPE_CHECKING:
    from collections.abc import Sequence

    from damperfit.comparison import Difference, Point, RunComparison
    from damperfit.units.shown_units import ShownUnits

__all__ = [
    "comparison_figure_sheet",
    "comparison_force_sheet",
    "comparison_parameter_sheet",
    "tolerance_sheet",
]

_FIGURES_NOTE = (
    "energy and hysteresis as measured where both ran one motion, hysteresis at half the peak speed"
)
_MANY = 40  # lines that a terminal shows of forces that are the same


def comparison_force_sheet(comparison: RunComparison, *, is_short: bool = False) -> Sheet:
    """Return the forces by setting, speed and stroke.

    Parameters
    ----------
    comparison : RunComparison
        What was compared.
    is_short : bool
        Of many lines those that differ, unless these are many too, and the fastest speed of each
        setting.
    """
    lines = comparison.of("force")
    shown = _telling(lines) if is_short and len(lines) > _MANY else lines
    units = comparison.units
    force, speed = units.of("N"), units.of("m/s")
    whole = "A's measured force, gas included" if comparison.is_without_model else "A's damping"
    notes = [f"B - A with half of its 95 % interval; % of {whole}, positive: B is harder"]
    if any(line.is_measured for line in shown) and not comparison.is_without_model:
        notes.append("measured: A and B are the forces that were measured, not those of a model")
    if len(shown) < len(lines):
        rest = [line for line in lines if line not in shown]
        differ = sum(line.verdict is Sameness.DIFFERENT for line in rest)
        said = f", {differ} of them different" if differ else ""
        notes.append(f"{len(rest)} more lines{said}: --json and --out have all")
    return Sheet(
        headings=("set", "speed", "stroke", "A", "B", "B - A", "", "verdict"),
        units=("", speed, "", force, force, force, "%", ""),
        rows=tuple(
            (
                str(line.subject.setting),
                _speed(line.subject.speed, units),
                line.subject.stroke,
                *_values(line, units),
                with_interval(*_reach(line, units), plus="+"),
                _percent(line),
                verdict_of(line, units, says_measured=not comparison.is_without_model),
            )
            for line in shown
        ),
        is_number=(True, True, False, True, True, True, True, False),
        notes=tuple(notes),
    )


def _telling(lines: Sequence[Difference]) -> list[Difference]:
    fastest = max(line.subject.speed or 0.0 for line in lines)
    top = [line for line in lines if line.subject.speed == fastest]
    shown = [line for line in lines if line in top or line.verdict is not Sameness.SAME]
    return shown if len(shown) <= _MANY else top


def _speed(speed: float | None, units: ShownUnits) -> str:
    return NOTHING if speed is None else units.write_speed(speed).split()[0]


def _values(line: Difference, units: ShownUnits, digits: int = 4) -> tuple[str, str]:
    a, b = (units.show(one.value, line.subject.unit) for one in (line.first, line.second))
    return number(a, digits=digits), number(b, digits=digits)


def _reach(line: Difference, units: ShownUnits) -> tuple[float, float]:
    """Return the difference and the upper end of its interval."""
    unit = line.subject.unit
    return units.show(line.difference, unit), units.show(line.high, unit)


def _percent(line: Difference) -> str:
    return NOTHING if math.isnan(line.percent) else f"{line.percent:+.2f}"


def comparison_parameter_sheet(comparison: RunComparison) -> Sheet:
    """Return the parameters, those that all settings share once."""
    lines, units = comparison.of("parameter"), comparison.units
    return Sheet(
        headings=("set", "parameter", "A", "B", "B - A", "", "verdict"),
        units=("", "", "", "", "%", "%", ""),
        rows=tuple(
            (
                "all" if line.subject.setting is None else str(line.subject.setting),
                line.subject.label,
                *_values(line, units, digits=5),
                *_change(line, units),
                verdict_of(line, units),
            )
            for line in lines
        ),
        is_number=(True, False, True, True, True, True, False),
        notes=("B - A in per cent with its 95 % interval", *_units(lines, units)),
    )


def _units(lines: Sequence[Difference], units: ShownUnits) -> tuple[str, ...]:
    """Say the units once: some are longer than the numbers."""
    known = {line.subject.label: units.of(line.subject.unit) for line in lines if line.subject.unit}
    return (", ".join(f"{name} in {unit}" for name, unit in known.items()),) if known else ()


def _change(line: Difference, units: ShownUnits = SI) -> tuple[str, str]:
    if math.isnan(line.percent):
        unit = line.subject.unit
        low, high = (units.show(end, unit) for end in (line.low, line.high))
        interval = f"{low:+.3g} to {high:+.3g}" if math.isfinite(low) else NOTHING
        return units.write(line.difference, unit, "+.3g"), interval
    if math.isnan(line.percent_low):
        return f"{line.percent:+.2f}", NOTHING
    return f"{line.percent:+.2f}", f"{line.percent_low:+.2f} to {line.percent_high:+.2f}"


def comparison_figure_sheet(comparison: RunComparison) -> Sheet:
    """Return energy, hysteresis, MSE and distance from cavitation."""
    units = comparison.units
    return Sheet(
        headings=("set", "figure", "A", "B", "B - A", "verdict"),
        units=("",) * 6,
        rows=tuple(
            (
                str(line.subject.setting),
                f"{line.subject.label}, {units.of(line.subject.unit)}",
                *_values(line, units),
                with_interval(*_reach(line, units), plus="+")
                if math.isfinite(line.high)
                else number(_reach(line, units)[0], digits=3),
                verdict_of(line, units),
            )
            for line in comparison.of("figure")
        ),
        is_number=(True, False, True, True, True, False),
        notes=(_FIGURES_NOTE,),
    )


def tolerance_sheet(points: Sequence[Point], *, is_short: bool = False) -> Sheet:
    """Return forces held against their bands, those outside first.

    Parameters
    ----------
    points : sequence of Point
        Of one run or several.
    is_short : bool
        Of many those that are not met, and the nearest to an edge.
    """
    order = sorted(points, key=lambda one: (not math.isnan(one.margin), one.margin))
    failed = sum(not one.is_met for one in points)
    shown = order[: max(failed, _MANY)] if is_short else order
    more = len(order) - len(shown)
    units = points[0].units if points else SI
    force = units.of("N")
    return Sheet(
        headings=("run", "set", "speed", "stroke", "force", "from", "to", "result"),
        units=("", "", units.of("m/s"), "", force, force, force, ""),
        rows=tuple(
            (
                one.run,
                str(one.setting),
                _speed(None if math.isnan(one.speed) else one.speed, units),
                one.stroke,
                *(
                    number(units.show(value, "N"), digits=4)
                    for value in (one.force, one.low, one.high)
                ),
                one.words,
            )
            for one in shown
        ),
        is_number=(False, True, True, False, True, True, True, False),
        notes=(f"{more} more points pass",) if more else (),
    )
