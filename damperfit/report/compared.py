"""Runs beside one another: tables, rows for files and --json, Markdown, JUnit."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any
from xml.etree.ElementTree import Element, SubElement, indent, tostring

import pyarrow as pa

from damperfit.comparison import Sameness, verdict_of
from damperfit.report.forces import STROKE_WORDS
from damperfit.report.rounding import NOTHING, number, with_interval
from damperfit.report.sheet import Sheet, escape, markdown_table, printable
from damperfit.units.shown_units import SI

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence

    from damperfit.comparison import ComparedRun, Difference, Point, RunComparison
    from damperfit.units.shown_units import ShownUnits

__all__ = [
    "comparison_force_sheet",
    "comparison_markdown",
    "comparison_record",
    "comparison_rows",
    "comparison_sheets",
    "comparison_table",
    "junit_report",
    "tolerance_outcome",
    "tolerance_rows",
    "tolerance_sheet",
    "tolerance_table",
]

_FIGURES_NOTE = (
    "energy and hysteresis as measured where both ran one motion, hysteresis at half the peak speed"
)
_MANY = 40  # lines that a terminal shows of forces that are the same
_TEXT, _FLOAT, _TRUTH = pa.string(), pa.float64(), pa.bool_()
# Name, kind and meaning of each column; what is compared tells its unit.
_COLUMNS: tuple[tuple[str, pa.DataType, str], ...] = (
    ("first", _TEXT, "the reference"),
    ("second", _TEXT, "the run beside it"),
    ("kind", _TEXT, "force, parameter or figure"),
    ("name", _TEXT, "what is compared"),
    ("setting", _TEXT, "adjuster setting; empty: of all settings"),
    ("speed_m_per_s", _FLOAT, "of a force, positive"),
    ("stroke", _TEXT, "rebound or bump"),
    ("unit", _TEXT, "of the values and their difference"),
    ("first_value", _FLOAT, "of the reference"),
    ("second_value", _FLOAT, "of the run beside it"),
    ("difference", _FLOAT, "second less first"),
    ("difference_ci_low", _FLOAT, "95 % interval of the difference"),
    ("difference_ci_high", _FLOAT, "95 % interval of the difference"),
    ("percent", _FLOAT, "difference in % of the first; of its damping, or half the force's range"),
    ("percent_ci_low", _FLOAT, "95 % interval of percent"),
    ("percent_ci_high", _FLOAT, "95 % interval of percent"),
    ("chance", _FLOAT, "how often chance alone makes as large a difference, 0 to 1"),
    ("verdict", _TEXT, "same, different or untold"),
    ("is_sure", _TRUTH, "different even when the number of lines is allowed for"),
    ("told_from", _TEXT, "model or measured"),
    ("words", _TEXT, "the verdict in words"),
)
_POINT_COLUMNS: tuple[tuple[str, pa.DataType, str], ...] = (
    ("run", _TEXT, "whose force it is"),
    ("setting", _TEXT, "adjuster setting"),
    ("speed_m_per_s", _FLOAT, "positive; empty where a whole setting is missing"),
    ("stroke", _TEXT, "rebound or bump"),
    ("force_N", _FLOAT, "positive in rebound"),
    ("low_N", _FLOAT, "lower edge of the band"),
    ("high_N", _FLOAT, "upper edge of the band"),
    ("margin_N", _FLOAT, "how far inside the band; negative: outside"),
    ("half_interval_N", _FLOAT, "half the 95 % interval of the force that is checked"),
    ("told_from", _TEXT, "model or measured"),
    ("is_met", _TRUTH, "whether it is inside; false where it could not be evaluated"),
    ("words", _TEXT, "the result in words"),
)


# Tables for people


def comparison_sheets(
    comparison: RunComparison, *, is_short: bool = False
) -> list[tuple[str, Sheet]]:
    """Return forces, parameters and figures by title, those without rows left out.

    Parameters
    ----------
    comparison : RunComparison
        What was compared.
    is_short : bool
        For a terminal: of many forces those that tell something.
    """
    title = comparison.forces_title
    sheets = (
        (title[0].upper() + title[1:], comparison_force_sheet(comparison, is_short=is_short)),
        ("Parameters", _parameter_sheet(comparison)),
        ("Energy, hysteresis, MSE, cavitation", _figure_sheet(comparison)),
    )
    return [(title, sheet) for title, sheet in sheets if sheet.rows]


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
    lines, units = comparison.of("force"), comparison.units
    shown = _telling(lines) if is_short and len(lines) > _MANY else lines
    has_model = not comparison.is_without_model
    notes = [
        "B - A, positive: B is harder; % of "
        + ("A's damping" if has_model else "A's measured force, gas included")
    ]
    if has_model and any(line.is_measured for line in shown):
        notes.append("measured: A and B are the forces that were measured, not those of a model")
    if len(shown) < len(lines):
        rest = [line for line in lines if line not in shown]
        differ = sum(line.verdict is Sameness.DIFFERENT for line in rest)
        said = f", {differ} of them different" if differ else ""
        notes.append(f"{len(rest)} more lines{said}: --json and --out have all")
    force = units.of("N")
    return Sheet(
        headings=("set", "speed", "stroke", "A", "B", "B - A", "", "verdict"),
        units=("", units.of("m/s"), "", force, force, f"{force} ±95 %", "%", ""),
        rows=tuple(
            (
                *(str(line.subject.setting), _speed(line.subject.speed, units)),
                STROKE_WORDS.get(line.subject.stroke, line.subject.stroke),
                *(*_values(line, units), _difference(line, units)),
                NOTHING if math.isnan(line.percent) else f"{line.percent:+.2f}",
                verdict_of(line, units, says_measured=has_model),
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


def _difference(line: Difference, units: ShownUnits) -> str:
    numbers = (line.difference, line.low, line.high)
    return with_interval(*(units.show(one, line.subject.unit) for one in numbers), plus="+")


def _parameter_sheet(comparison: RunComparison) -> Sheet:
    """Return the parameters, those that all settings share once."""
    lines, units = comparison.of("parameter"), comparison.units
    # Some units are longer than the numbers: they are told once.
    known = {line.subject.label: units.of(line.subject.unit) for line in lines if line.subject.unit}
    notes = [", ".join(f"{name} in {unit}" for name, unit in known.items())] if known else []
    return Sheet(
        headings=("set", "parameter", "A", "B", "B - A", "", "verdict"),
        units=("", "", "", "", "%", "%, 95 %", ""),
        rows=tuple(
            (
                "all" if line.subject.setting is None else str(line.subject.setting),
                *(line.subject.label, *_values(line, units, digits=5), *_change(line, units)),
                verdict_of(line, units),
            )
            for line in lines
        ),
        is_number=(True, False, True, True, True, True, False),
        notes=tuple(notes),
    )


def _change(line: Difference, units: ShownUnits = SI) -> tuple[str, str]:
    if math.isnan(line.percent):
        unit = line.subject.unit
        low, high = (units.show(end, unit) for end in (line.low, line.high))
        interval = f"{low:+.3g} to {high:+.3g}" if math.isfinite(low) else NOTHING
        return units.write(line.difference, unit, "+.3g"), interval
    if math.isnan(line.percent_low):
        return f"{line.percent:+.2f}", NOTHING
    return f"{line.percent:+.2f}", f"{line.percent_low:+.2f} to {line.percent_high:+.2f}"


def _figure_sheet(comparison: RunComparison) -> Sheet:
    """Return energy, hysteresis, MSE and distance from cavitation."""
    units = comparison.units
    return Sheet(
        headings=("set", "figure", "A", "B", "B - A", "verdict"),
        units=("", "", "", "", "±95 %", ""),
        rows=tuple(
            (
                str(line.subject.setting),
                f"{line.subject.label}, {units.of(line.subject.unit)}",
                *(*_values(line, units), _difference(line, units), verdict_of(line, units)),
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
                *(one.run, str(one.setting)),
                _speed(None if math.isnan(one.speed) else one.speed, units),
                STROKE_WORDS.get(one.stroke, one.stroke),
                *(number(units.show(f, "N"), digits=4) for f in (one.force, one.low, one.high)),
                one.words,
            )
            for one in shown
        ),
        is_number=(False, True, True, False, True, True, True, False),
        notes=(f"{more} more points pass",) if more else (),
    )


def tolerance_outcome(points: Sequence[Point]) -> str:
    """Say how many points keep their bands."""
    units = points[0].units
    met = sum(one.is_met for one in points)
    unseen = sum(math.isnan(one.margin) for one in points)
    said = f"{met} of {len(points)} points within the tolerance"
    outside = [-one.margin for one in points if one.margin < 0.0]
    if outside:
        said += f", {len(outside)} outside, by up to {units.write(max(outside), 'N', '.3g')}"
    if unseen:
        said += f", {unseen} not evaluated"
    measured = sum(one.is_measured for one in points)
    if measured:
        said += f"; {measured} compared as measured, without a model"
    if met == len(points):
        nearest = min(points, key=lambda one: one.margin)
        return f"{said}; the nearest edge is {units.write(nearest.margin, 'N', '.3g')} away"
    return said


def comparison_markdown(
    comparisons: Sequence[RunComparison],
    points: Sequence[Point] = (),
    *,
    source: str = "",
    alone: Sequence[str] = (),
) -> str:
    """Return comparisons, and forces held against bands, as one document, everything escaped.

    Parameters
    ----------
    comparisons : sequence of RunComparison
        One a pair.
    points : sequence of Point
        Forces held against bands.
    source : str
        The bands, as they were given.
    alone : sequence of str
        What has no partner.
    """
    parts: list[str] = ["# Comparison", "", *_list(alone)]
    if points:
        parts += ["", f"## Tolerance {escape(source)}", "", escape(tolerance_outcome(points)), ""]
        parts += markdown_table(tolerance_sheet(points))
    for one in comparisons:
        parts += _comparison(one)
    return "\n".join(parts) + "\n"


def _comparison(one: RunComparison) -> Iterator[str]:
    yield from ("", f"## {escape(one.second.name)} beside {escape(one.first.name)}", "")
    yield from _list(f"differs besides: {sentence}" for sentence in one.differing)
    yield from ("", *_list((*one.sentences, *one.to_know, *one.remarks)))
    for title, sheet in comparison_sheets(one):
        yield from ("", f"### {escape(title)}", "", *markdown_table(sheet))


def _list(items: Iterable[str]) -> list[str]:
    return [f"- {escape(item)}" for item in items]


# Rows for files and programs


def comparison_rows(comparison: RunComparison) -> list[dict[str, Any]]:
    """Return the lines of a comparison as rows; what is not known is None."""
    return [_row(comparison, line) for line in comparison.lines]


def _row(comparison: RunComparison, line: Difference) -> dict[str, Any]:
    subject = line.subject
    values = (
        *(comparison.first.name, comparison.second.name, subject.kind, subject.name),
        None if subject.setting is None else str(subject.setting),
        *(subject.speed, subject.stroke or None, subject.unit),
        *map(_finite, (line.first.value, line.second.value)),
        *map(_finite, (line.difference, line.low, line.high)),
        *map(_finite, (line.percent, line.percent_low, line.percent_high, line.chance)),
        *(line.verdict.value, line.is_sure, "measured" if line.is_measured else "model"),
        verdict_of(line),
    )
    return dict(zip((name for name, *_ in _COLUMNS), values, strict=True))


def _finite(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None


def comparison_table(rows: Sequence[Mapping[str, Any]]) -> pa.Table:
    """Return rows of one or more comparisons as a table."""
    return _table(rows, _COLUMNS)


def tolerance_rows(points: Sequence[Point]) -> list[dict[str, Any]]:
    """Return forces held against bands as rows; what is not known is None."""
    rows = (
        (
            *(point.run, str(point.setting), _finite(point.speed), point.stroke or None),
            *map(_finite, (point.force, point.low, point.high, point.margin, point.reach)),
            *("measured" if point.is_measured else "model", point.is_met, point.words),
        )
        for point in points
    )
    names = [name for name, *_ in _POINT_COLUMNS]
    return [dict(zip(names, row, strict=True)) for row in rows]


def tolerance_table(rows: Sequence[Mapping[str, Any]]) -> pa.Table:
    """Return rows of forces held against bands as a table."""
    return _table(rows, _POINT_COLUMNS)


def _table(
    rows: Sequence[Mapping[str, Any]], columns: Sequence[tuple[str, pa.DataType, str]]
) -> pa.Table:
    fields = [pa.field(name, kind, metadata={"description": said}) for name, kind, said in columns]
    return pa.Table.from_pylist([dict(row) for row in rows], schema=pa.schema(fields))


def comparison_record(comparison: RunComparison) -> dict[str, Any]:
    """Return a comparison as JSON values."""

    def run(one: ComparedRun) -> dict[str, str]:
        return {"name": one.name, "place": one.place}

    return {
        "first": run(comparison.first),
        "second": run(comparison.second),
        "repeats": [run(one) for one in comparison.repeats],
        "motion": comparison.motion,
        "settings": [setting.cell for setting in comparison.settings],
        "sentences": list(comparison.sentences),
        "circumstances": [
            {"kind": one.kind, "first": one.first, "second": one.second, "sentence": one.sentence}
            for one in comparison.circumstances
        ],
        "notes": list(comparison.notes),
        "remarks": list(comparison.remarks),
        "lines": comparison_rows(comparison),
    }


def junit_report(points: Sequence[Point], *, source: str) -> bytes:
    """Return a JUnit file, which build servers read: a test case a point, by run.

    What could not be looked at has failed.

    Parameters
    ----------
    points : sequence of Point
        Forces held against bands.
    source : str
        The bands, as they were given.
    """

    def counts(mine: Sequence[Point]) -> dict[str, str]:
        failures = sum(not point.is_met for point in mine)
        return {"tests": str(len(mine)), "failures": str(failures), "errors": "0"}

    root = Element("testsuites", counts(points) | {"name": "damperfit compare"})
    for run in dict.fromkeys(point.run for point in points):
        mine = [point for point in points if point.run == run]
        title = {"name": printable(f"{run}, tolerance {source}")}
        suite = SubElement(root, "testsuite", title | counts(mine))
        for point in mine:
            name = f"setting {point.setting}"
            if not math.isnan(point.speed):
                name += f", {point.stroke}, {point.units.write_speed(point.speed)}"
            facts = {"classname": printable(run), "name": printable(name)}
            case = SubElement(suite, "testcase", facts)
            if not point.is_met:
                kind = "not evaluated" if math.isnan(point.margin) else "out of tolerance"
                said = {"type": kind, "message": printable(point.words)}
                forces = (point.force, point.low, point.high)
                force, low, high = (point.units.show(value, "N") for value in forces)
                unit = point.units.of("N")
                SubElement(
                    case, "failure", said
                ).text = f"force {force:.5g} {unit}, expected {low:.5g} to {high:.5g} {unit}"
    indent(root)
    text: bytes = tostring(root, encoding="utf-8", xml_declaration=True)
    return text + b"\n"
