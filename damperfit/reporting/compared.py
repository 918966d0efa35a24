"""Runs beside one another: tables and figures, rows for files and --json, Markdown, JUnit."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any
from xml.etree.ElementTree import Element, SubElement, indent, tostring

import numpy as np
import pyarrow as pa

from damperfit.adjustment.force_at import STROKE_WORDS
from damperfit.arrays import FloatArray
from damperfit.comparison.differences import DIFFERENT, SAME, Difference, verdict_of
from damperfit.comparison.measured import MeasuredTest, common_tests
from damperfit.reporting.plots import RUN_COLOURS, Line, Panel, Plot, setting_panel, setting_places
from damperfit.reporting.report import Section, markdown
from damperfit.reporting.sheet import (
    NOTHING,
    Column,
    Sheet,
    laid_out,
    number,
    printable,
    with_interval,
)
from damperfit.tables.files import finite, json_values
from damperfit.tested.setting import Setting
from damperfit.units.shown_units import SI, ShownUnits

if TYPE_CHECKING:
    from damperfit.comparison.comparing import RunComparison
    from damperfit.comparison.tolerance import Point
    from damperfit.queries.compared import Comparison
    from damperfit.results import Run

_FIGURES_NOTE = (
    "energy and hysteresis as measured at the fastest common motion, hysteresis at half its "
    "peak speed"
)
_MANY = 40  # lines that a terminal shows of forces that are the same


# Tables for people


def comparison_sheets(
    comparison: RunComparison, *, is_short: bool = False
) -> list[tuple[str, Sheet]]:
    """Return forces, parameters and figures by title; ``is_short``: of many forces a few."""
    parameters, units = comparison.of("parameter"), comparison.units
    # Some units are longer than the numbers: they are printed once.
    unit_of = {
        line.subject.label: units.of(line.subject.unit) for line in parameters if line.subject.unit
    }
    notes = [", ".join(f"{name} in {unit}" for name, unit in unit_of.items())] if unit_of else []

    def change(line: Difference) -> str:
        of_value = units.write(line.difference, line.subject.unit, "+.3g")
        return of_value if math.isnan(line.percent) else f"{line.percent:+.2f} %"

    def interval(line: Difference) -> str:
        low, high, form, unit = line.percent_low, line.percent_high, "+.2f", "%"
        if math.isnan(line.percent):
            low, high = (units.show(end, line.subject.unit) for end in (line.low, line.high))
            form, unit = "+.3g", units.of(line.subject.unit)
        return f"{low:{form}} to {high:{form}} {unit}" if math.isfinite(low) else NOTHING

    def figure(line: Difference) -> str:
        return f"{line.subject.label}, {units.of(line.subject.unit)}"

    of_parameters = [
        _SETTING,
        Column("parameter", "", lambda line: line.subject.label, is_number=False),
        *_pair(units, "", 5),
        Column("B - A", "", change),
        Column("", "95 %", interval),
        _verdict(units),
    ]
    of_figures = [
        _SETTING,
        Column("figure", "", figure, is_number=False),
        *(*_pair(units, ""), _difference(units, "±95 %"), _verdict(units)),
    ]
    figures = laid_out(comparison.of("figure"), of_figures, _FIGURES_NOTE)
    sheets = (
        (comparison.forces_title, comparison_force_sheet(comparison, is_short=is_short)),
        ("Parameters", laid_out(parameters, of_parameters, *notes)),
        ("Energy, hysteresis, MSE, cavitation", figures),
    )
    return [(title, sheet) for title, sheet in sheets if sheet.rows]


def comparison_force_sheet(comparison: RunComparison, *, is_short: bool = False) -> Sheet:
    """Return the forces by setting, speed and stroke.

    ``is_short`` shows of many lines those that differ, unless these are many too, and the fastest
    speed of each setting.
    """
    lines, units = comparison.of("force"), comparison.units
    has_model, listed = not comparison.is_without_model, list(lines)
    if is_short and len(lines) > _MANY:
        fastest = max(line.subject.speed or 0.0 for line in lines)
        top = [line for line in lines if line.subject.speed == fastest]
        listed = [line for line in lines if line in top or line.verdict != SAME]
        listed = listed if len(listed) <= _MANY else top
    of = "A's damping" if has_model else "A's force as logged, gas and tare in it"
    notes = [f"%: of {of}; positive where B is harder"]
    if not has_model:
        notes.append("measured with the slowest motion common to both that reaches the speed")
    if has_model and any(line.is_measured for line in listed):
        notes.append("measured: A and B are the forces that were measured, not those of a model")
    if len(listed) < len(lines):
        n = sum(line.verdict == DIFFERENT for line in lines if line not in listed)
        differ = f", {n} of them different" if n else ""
        n_more = len(lines) - len(listed)
        notes.append(f"{n_more} more lines{differ}: --json and --out have all")
    force = units.of("N")

    def percent(line: Difference) -> str:
        return NOTHING if math.isnan(line.percent) else f"{line.percent:+.2f}"

    columns = [
        _SETTING,
        Column("speed", units.of("m/s"), lambda line: _speed(line.subject.speed, units)),
        _STROKE._replace(cell=lambda line: STROKE_WORDS.get(line.subject.stroke, "")),
        *_pair(units, force),
        _difference(units, f"{force} ±95 %"),
        Column("", "%", percent),
        _verdict(units, says_measured=has_model),
    ]
    return laid_out(listed, columns, *notes)


_SETTING = Column(
    "set", "", lambda line: "all" if line.subject.setting is None else str(line.subject.setting)
)
_STROKE = Column("stroke", "", lambda point: STROKE_WORDS.get(point.stroke, ""), is_number=False)


def _pair(units: ShownUnits, unit: str, digits: int = 4) -> list[Column]:
    """The columns of both values."""

    def cell(name: str, line: Difference) -> str:
        return number(units.show(getattr(line, name).value, line.subject.unit), digits=digits)

    runs = (("A", "first"), ("B", "second"))
    return [Column(heading, unit, partial(cell, name)) for heading, name in runs]


def _difference(units: ShownUnits, unit: str) -> Column:
    def cell(line: Difference) -> str:
        numbers = (line.difference, line.low, line.high)
        return with_interval(*(units.show(x, line.subject.unit) for x in numbers), plus="+")

    return Column("B - A", unit, cell)


def _verdict(units: ShownUnits, **options: bool) -> Column:
    return Column("verdict", "", lambda line: verdict_of(line, units, **options), is_number=False)


def _speed(speed: float | None, units: ShownUnits) -> str:
    return NOTHING if speed is None else units.write_speed(speed).split()[0]


def tolerance_sheet(points: Sequence[Point], *, is_short: bool = False) -> Sheet:
    """Return forces and their bands, those outside first; ``is_short``: and the nearest."""
    order = sorted(points, key=lambda point: (not math.isnan(point.margin), point.margin))
    failed = sum(not point.is_met for point in points)
    listed = order[: max(failed, _MANY)] if is_short else order
    n_more = len(order) - len(listed)
    units = points[0].units if points else SI

    def force(name: str, point: Point) -> str:
        return number(units.show(getattr(point, name), "N"), digits=4)

    forces = (("force", "force"), ("from", "low"), ("to", "high"))
    columns = [
        Column("run", "", lambda point: point.run, is_number=False),
        Column("set", "", lambda point: str(point.setting)),
        Column("speed", units.of("m/s"), lambda point: _speed(finite(point.speed), units)),
        _STROKE,
        *(Column(heading, units.of("N"), partial(force, name)) for heading, name in forces),
        Column("result", "", lambda point: point.words, is_number=False),
    ]
    return laid_out(listed, columns, *([f"{n_more} more points pass"] if n_more else []))


def tolerance_outcome(points: Sequence[Point]) -> str:
    """Say how many points keep their bands."""
    units = points[0].units
    n_met = sum(point.is_met for point in points)
    n_unknown = sum(math.isnan(point.margin) for point in points)
    outside = [-point.margin for point in points if point.margin < 0.0]
    n_measured = sum(point.is_measured for point in points)
    sentence = f"{n_met} of {len(points)} points within the tolerance"
    if outside:
        sentence += f", {len(outside)} outside, by up to {units.write(max(outside), 'N', '.3g')}"
    if n_unknown:
        sentence += f", {n_unknown} not evaluated"
    if n_measured:
        sentence += f"; {n_measured} compared as measured, without a model"
    if n_met == len(points):
        nearest = min(point.margin for point in points)
        sentence += f"; the nearest limit is {units.write(nearest, 'N', '.3g')} away"
    return sentence


def comparison_markdown(done: Comparison) -> str:
    """Return comparisons, and forces checked against bands, as one document, all escaped."""
    sections = [Section("In one run only", "", [*map(str, done.alone)])] if done.alone else []
    if done.points:
        title, outcome = f"Tolerance {done.tolerance}", [tolerance_outcome(done.points)]
        sections.append(Section(title, "", outcome, [tolerance_sheet(done.points)]))
    for pair in done.comparisons:
        besides = (f"differs: {sentence}" for sentence in pair.differing)
        sentences = [*besides, *pair.sentences, *pair.to_know, *map(str, pair.remarks)]
        sections.append(Section(f"{pair.second.name} beside {pair.first.name}", "", sentences))
        sheets = comparison_sheets(pair)
        sections += [Section(title, "below", (), [sheet]) for title, sheet in sheets]
    return markdown("Comparison", (), sections)


# Rows for files and programs

_TEXT, _FLOAT, _TRUTH = pa.string(), pa.float64(), pa.bool_()
_Columns = tuple[tuple[str, pa.DataType, str, Callable[[Any], Any]], ...]


def _source(line: Difference | Point) -> str:
    return "measured" if line.is_measured else "model"


# Name, kind, meaning and value of each column; each line has its own unit.
_COLUMNS: _Columns = (
    ("kind", _TEXT, "force, parameter or figure", lambda d: d.subject.kind),
    ("name", _TEXT, "what is compared", lambda d: d.subject.name),
    ("setting", _TEXT, "adjuster setting; empty: of all settings", lambda d: d.subject.setting),
    ("speed_m_per_s", _FLOAT, "of a force, positive", lambda d: d.subject.speed),
    ("stroke", _TEXT, "rebound or bump", lambda d: d.subject.stroke or None),
    ("unit", _TEXT, "of the values and their difference", lambda d: d.subject.unit),
    ("first_value", _FLOAT, "of the reference", lambda d: d.first.value),
    ("second_value", _FLOAT, "of the run beside it", lambda d: d.second.value),
    ("difference", _FLOAT, "second less first", lambda d: d.difference),
    ("difference_ci_low", _FLOAT, "95 % interval of the difference", lambda d: d.low),
    ("difference_ci_high", _FLOAT, "95 % interval of the difference", lambda d: d.high),
    ("percent", _FLOAT, "difference in % of the first; of its damping, or half the force's range",
     lambda d: d.percent),
    ("percent_ci_low", _FLOAT, "95 % interval of percent", lambda d: d.percent_low),
    ("percent_ci_high", _FLOAT, "95 % interval of percent", lambda d: d.percent_high),
    ("chance", _FLOAT, "how often chance alone makes as large a difference, 0 to 1",
     lambda d: d.chance),
    ("verdict", _TEXT, "same, different or undetermined", lambda d: d.verdict),
    ("is_sure", _TRUTH, "different even when the number of lines is allowed for",
     lambda d: d.is_sure),
    ("source", _TEXT, "model or measured", _source),
    ("words", _TEXT, "the verdict in words", verdict_of),
)  # fmt: skip
_POINT_COLUMNS: _Columns = (
    ("run", _TEXT, "whose force it is", lambda p: p.run),
    ("setting", _TEXT, "adjuster setting", lambda p: str(p.setting)),
    ("speed_m_per_s", _FLOAT, "positive; empty where a whole setting is missing",
     lambda p: p.speed),
    ("stroke", _TEXT, "rebound or bump", lambda p: p.stroke or None),
    ("force_N", _FLOAT, "positive in rebound", lambda p: p.force),
    ("low_N", _FLOAT, "lower edge of the band", lambda p: p.low),
    ("high_N", _FLOAT, "upper edge of the band", lambda p: p.high),
    ("margin_N", _FLOAT, "how far inside the band; negative: outside", lambda p: p.margin),
    ("half_interval_N", _FLOAT, "half the 95 % interval of the force that is checked",
     lambda p: p.reach),
    ("source", _TEXT, "model or measured", _source),
    ("is_met", _TRUTH, "whether it is inside; false where it could not be evaluated",
     lambda p: p.is_met),
    ("words", _TEXT, "the result in words", lambda p: p.words),
)  # fmt: skip
_NAMES = (("first", _TEXT, "the reference", str), ("second", _TEXT, "the run beside it", str))


def comparison_rows(comparison: RunComparison) -> list[dict[str, Any]]:
    """Return the lines of a comparison as rows; what is not known is None."""
    names = {"first": comparison.first.name, "second": comparison.second.name}
    return [names | row for row in _rows(comparison.lines, _COLUMNS)]


def tolerance_rows(points: Sequence[Point]) -> list[dict[str, Any]]:
    """Return forces checked against bands as rows; what is not known is None."""
    return _rows(points, _POINT_COLUMNS)


def _rows(lines: Sequence[Any], columns: _Columns) -> list[dict[str, Any]]:
    def cell(kind: pa.DataType, value: Any) -> Any:
        if value is None or kind is _TRUTH:
            return value
        return str(value) if kind is _TEXT else finite(float(value))

    return [{name: cell(kind, get(line)) for name, kind, _, get in columns} for line in lines]


def comparison_table(comparisons: Sequence[RunComparison]) -> pa.Table:
    """Return the rows of comparisons as a table."""
    rows = [row for pair in comparisons for row in comparison_rows(pair)]
    return _table(rows, (*_NAMES, *_COLUMNS))


def tolerance_table(points: Sequence[Point]) -> pa.Table:
    """Return forces checked against bands as a table."""
    return _table(tolerance_rows(points), _POINT_COLUMNS)


def _table(rows: list[dict[str, Any]], columns: _Columns) -> pa.Table:
    fields = [
        pa.field(name, kind, metadata={"description": text}) for name, kind, text, _ in columns
    ]
    return pa.Table.from_pylist(rows, schema=pa.schema(fields))


def comparison_record(comparison: RunComparison) -> dict[str, Any]:
    """Return a comparison as JSON values."""

    def names(run: Run) -> dict[str, str]:
        return {"name": run.name, "place": run.shown_as}

    return {
        "first": names(comparison.first),
        "second": names(comparison.second),
        "repeats": [names(run) for run in comparison.repeats],
        "motion": comparison.motion,
        "settings": [setting.cell for setting in comparison.settings],
        "sentences": list(comparison.sentences),
        "circumstances": [fact._asdict() for fact in comparison.circumstances],
        "notes": json_values(comparison.notes),
        "remarks": json_values(comparison.remarks),
        "lines": comparison_rows(comparison),
    }


def junit_report(points: Sequence[Point], *, source: str) -> bytes:
    """Return a JUnit file: a test case a point, by run; one that was not evaluated has failed."""

    def counts(group: Sequence[Point]) -> dict[str, str]:
        failures = sum(not point.is_met for point in group)
        return {"tests": str(len(group)), "failures": str(failures), "errors": "0"}

    root = Element("testsuites", counts(points) | {"name": "damperfit compare"})
    for run in dict.fromkeys(point.run for point in points):
        group = [point for point in points if point.run == run]
        title = {"name": printable(f"{run}, tolerance {source}")}
        suite = SubElement(root, "testsuite", title | counts(group))
        for point in group:
            name = f"setting {point.setting}"
            if not math.isnan(point.speed):
                name += f", {STROKE_WORDS[point.stroke]}, {point.units.write_speed(point.speed)}"
            facts = {"classname": printable(run), "name": printable(name)}
            case = SubElement(suite, "testcase", facts)
            if not point.is_met:
                kind = "not evaluated" if math.isnan(point.margin) else "out of tolerance"
                failed = {"type": kind, "message": printable(point.words)}
                forces = (point.force, point.low, point.high)
                force, low, high = (point.units.show(value, "N") for value in forces)
                unit = point.units.of("N")
                text = f"force {force:.5g} {unit}, expected {low:.5g} to {high:.5g} {unit}"
                SubElement(case, "failure", failed).text = text
    indent(root)
    text_bytes: bytes = tostring(root, encoding="utf-8", xml_declaration=True)
    return text_bytes + b"\n"


# Figures: loops of a setting with their differences below, and all settings


def loop_plots(runs: Sequence[Run], setting: Setting, *, name: str) -> tuple[Plot, ...]:
    """Return the loops of a setting, where all ran one motion; the first run is the reference."""
    groups = next(iter(common_tests(runs, setting)), ())
    if not groups:
        return ()

    def line(x: FloatArray, y: FloatArray, label: str, k: int, style: str, **fields: Any) -> Line:
        return Line(x, y, label, RUN_COLOURS[k % len(RUN_COLOURS)], setting, style, **fields)

    if any(not len(test.displacement) for group in groups for test in group):  # without time
        points = tuple(
            line(test.velocity, test.force, run.name, k, "triangles" if k else "points")
            for k, (run, group) in enumerate(zip(runs, groups, strict=True))
            for test in group[:1]
        )
        panel = Panel("velocity", "m/s", "force", "N", points)
        title = f"Setting {setting}: force against velocity"
        return (Plot(f"{name}_force_velocity", title, (panel,)),)
    # Of several tests the mean: x, v and force over one cycle, begun where x passes its middle.
    loops = [np.mean([_aligned(test) for test in group], axis=0) for group in groups]
    closed = [np.column_stack([loop, loop[:, :1]]) for loop in loops]
    reference, base = closed[0], runs[0].name
    numbered = list(enumerate(zip((run.name for run in runs), closed, strict=True)))
    plots = []
    for place, word, unit, factor in ((1, "velocity", "m/s", 1.0), (0, "displacement", "mm", 1e3)):
        # The reference last and thin: else it is hidden where nothing differs.
        upper = tuple(
            line(factor * loop[place], loop[2], run, k, "wide" if k else "thin")
            for k, (run, loop) in reversed(numbered)
        )
        # Forces are subtracted at the same phase, which is the same motion.
        x = factor * reference[place]
        lower = tuple(
            line(x, loop[2] - reference[2], f"{run} less {base}", k, "thin", in_legend=False)
            for k, (run, loop) in numbered[1:]
        )
        panels = (
            Panel(word, unit, "force", "N", upper),
            Panel(word, unit, "difference", "N", lower, rules=((0.0, ""),)),
        )
        title = f"Setting {setting}: force against {word}"
        caption = f"Mean measured cycles. Below: less {base}, phase by phase."
        plots.append(Plot(f"{name}_force_{word}", title, panels, caption))
    return tuple(plots)


def _aligned(test: MeasuredTest) -> FloatArray:
    """Return x, v and force over one cycle from the rising passage of mid-stroke."""
    x = test.displacement - 0.5 * (test.displacement.max() + test.displacement.min())
    n = len(x)
    later = np.roll(x, -1)
    rises = np.flatnonzero((x < 0.0) & (later >= 0.0))
    start = 0.0
    if len(rises):
        at = int(rises[np.argmax(test.velocity[rises])])
        start = at + float(x[at] / (x[at] - later[at]))
    phases = start + np.arange(n)
    rows = (x, test.velocity, test.force)
    return np.stack([np.interp(phases, np.arange(n), row, period=n) for row in rows])


def difference_plots(comparisons: Sequence[RunComparison]) -> tuple[Plot, ...]:
    """Return the difference of force from one reference over the settings, at the fastest speed."""
    plots = []
    places = setting_places({s for pair in comparisons for s in pair.settings})
    is_bare = any(pair.is_without_model for pair in comparisons)
    for stroke, word in STROKE_WORDS.items():
        lines, speeds = [], []
        for k, pair in enumerate(comparisons, start=1):
            forces = [
                line
                for line in pair.of("force")
                if line.subject.stroke == stroke and math.isfinite(line.percent)
            ]
            top = max((line.subject.speed or 0.0 for line in forces), default=0.0)
            forces = [line for line in forces if line.subject.speed == top]
            if not forces:
                continue
            speeds.append(pair.units.write_speed(top))
            x = np.array([places[line.subject.setting] for line in forces if line.subject.setting])
            y, low, high = np.array(
                [(line.percent, line.percent_low, line.percent_high) for line in forces]
            ).T
            errors = {"low": low, "high": high} if np.isfinite(low).all() else {}
            label, colour = f"{pair.second.name}, {speeds[-1]}", RUN_COLOURS[k % len(RUN_COLOURS)]
            lines.append(Line(x, y, label, colour, style="points", **errors))
        if lines:
            unit = f"% of {'measured force' if is_bare else 'damping'}"
            panel = setting_panel(places, "difference", unit, lines, rules=((0.0, ""),))
            title = f"Difference of force in {word}, with 95 % intervals"
            listed = " and ".join(dict.fromkeys(speeds))
            caption = f"At {listed}. Above zero: harder than {comparisons[0].first.name}."
            plots.append(Plot(f"difference_{stroke}", title, (panel,), caption))
    return tuple(plots)
