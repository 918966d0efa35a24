"""Runs beside one another: tables and figures, rows for files and --json, Markdown, JUnit."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any
from xml.etree.ElementTree import Element, SubElement, indent, tostring

import numpy as np
import pyarrow as pa

from damperfit.comparison import Sameness, common_tests, verdict_of
from damperfit.reporting.figures import (
    RUN_COLOURS,
    Line,
    Panel,
    Plot,
    setting_panel,
    setting_places,
)
from damperfit.reporting.forces import STROKE_WORDS
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
from damperfit.units.shown_units import SI

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping, Sequence

    from numpy.typing import NDArray

    from damperfit.comparison import Difference, MeasuredTest, Point, RunComparison
    from damperfit.results import Run
    from damperfit.tested.setting import Setting
    from damperfit.units.shown_units import ShownUnits

    FloatArray = NDArray[np.float64]

_FIGURES_NOTE = (
    "energy and hysteresis as measured where both ran one motion, hysteresis at half the peak speed"
)
_MANY = 40  # lines that a terminal shows of forces that are the same


# Tables for people


def comparison_sheets(
    comparison: RunComparison, *, is_short: bool = False
) -> list[tuple[str, Sheet]]:
    """Return forces, parameters and figures by title, those without rows left out.

    ``is_short`` is for a terminal: of many forces those that tell something.
    """
    title = comparison.forces_title
    sheets = (
        (title[0].upper() + title[1:], comparison_force_sheet(comparison, is_short=is_short)),
        ("Parameters", _parameter_sheet(comparison)),
        ("Energy, hysteresis, MSE, cavitation", _figure_sheet(comparison)),
    )
    return [(title, sheet) for title, sheet in sheets if sheet.rows]


_SETTING = Column(
    "set", "", lambda line: "all" if line.subject.setting is None else str(line.subject.setting)
)


def _pair(units: ShownUnits, unit: str, digits: int = 4) -> Iterator[Column]:
    """Yield the columns of both values."""
    for heading, name in (("A", "first"), ("B", "second")):

        def cell(line: Difference, name: str = name) -> str:
            value = units.show(getattr(line, name).value, line.subject.unit)
            return number(value, digits=digits)

        yield Column(heading, unit, cell)


def _difference(units: ShownUnits, unit: str) -> Column:
    def cell(line: Difference) -> str:
        numbers = (line.difference, line.low, line.high)
        return with_interval(*(units.show(one, line.subject.unit) for one in numbers), plus="+")

    return Column("B - A", unit, cell)


def comparison_force_sheet(comparison: RunComparison, *, is_short: bool = False) -> Sheet:
    """Return the forces by setting, speed and stroke.

    ``is_short`` shows of many lines those that differ, unless these are many too, and the fastest
    speed of each setting.
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

    def percent(line: Difference) -> str:
        return NOTHING if math.isnan(line.percent) else f"{line.percent:+.2f}"

    def verdict(line: Difference) -> str:
        return verdict_of(line, units, says_measured=has_model)

    columns = [
        _SETTING,
        Column("speed", units.of("m/s"), lambda line: _speed(line.subject.speed, units)),
        Column("stroke", "", lambda line: _stroke(line.subject.stroke), is_number=False),
        *_pair(units, force),
        _difference(units, f"{force} ±95 %"),
        Column("", "%", percent),
        Column("verdict", "", verdict, is_number=False),
    ]
    return laid_out(shown, columns, *notes)


def _telling(lines: Sequence[Difference]) -> list[Difference]:
    fastest = max(line.subject.speed or 0.0 for line in lines)
    top = [line for line in lines if line.subject.speed == fastest]
    shown = [line for line in lines if line in top or line.verdict is not Sameness.SAME]
    return shown if len(shown) <= _MANY else top


def _stroke(stroke: str) -> str:
    return STROKE_WORDS.get(stroke, stroke)


def _speed(speed: float | None, units: ShownUnits) -> str:
    return NOTHING if speed is None else units.write_speed(speed).split()[0]


def _parameter_sheet(comparison: RunComparison) -> Sheet:
    """Return the parameters, those that all settings share once."""
    lines, units = comparison.of("parameter"), comparison.units
    # Some units are longer than the numbers: they are told once.
    known = {line.subject.label: units.of(line.subject.unit) for line in lines if line.subject.unit}
    notes = [", ".join(f"{name} in {unit}" for name, unit in known.items())] if known else []
    columns = [
        _SETTING,
        Column("parameter", "", lambda line: line.subject.label, is_number=False),
        *_pair(units, "", 5),
        Column("B - A", "%", lambda line: _change(line, units)[0]),
        Column("", "%, 95 %", lambda line: _change(line, units)[1]),
        Column("verdict", "", lambda line: verdict_of(line, units), is_number=False),
    ]
    return laid_out(lines, columns, *notes)


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

    def figure(line: Difference) -> str:
        return f"{line.subject.label}, {units.of(line.subject.unit)}"

    columns = [
        _SETTING,
        Column("figure", "", figure, is_number=False),
        *_pair(units, ""),
        _difference(units, "±95 %"),
        Column("verdict", "", lambda line: verdict_of(line, units), is_number=False),
    ]
    return laid_out(comparison.of("figure"), columns, _FIGURES_NOTE)


def tolerance_sheet(points: Sequence[Point], *, is_short: bool = False) -> Sheet:
    """Return forces held against their bands, those outside first.

    ``is_short`` shows of many those that are not met, and the nearest to an edge.
    """
    order = sorted(points, key=lambda one: (not math.isnan(one.margin), one.margin))
    failed = sum(not one.is_met for one in points)
    shown = order[: max(failed, _MANY)] if is_short else order
    more = len(order) - len(shown)
    units = points[0].units if points else SI
    force = units.of("N")

    def newtons(name: str) -> Callable[[Point], str]:
        return lambda one: number(units.show(getattr(one, name), "N"), digits=4)

    columns = [
        Column("run", "", lambda one: one.run, is_number=False),
        Column("set", "", lambda one: str(one.setting)),
        Column("speed", units.of("m/s"), lambda one: _speed(_finite(one.speed), units)),
        Column("stroke", "", lambda one: _stroke(one.stroke), is_number=False),
        Column("force", force, newtons("force")),
        Column("from", force, newtons("low")),
        Column("to", force, newtons("high")),
        Column("result", "", lambda one: one.words, is_number=False),
    ]
    return laid_out(shown, columns, *([f"{more} more points pass"] if more else []))


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

    Of the pairs, of the points and their bands as they were given, and of what has no partner.
    """
    sections = [Section("Without a partner", "", alone)] if alone else []
    if points:
        told = [tolerance_outcome(points)]
        sections.append(Section(f"Tolerance {source}", "", told, [tolerance_sheet(points)]))
    for one in comparisons:
        besides = (f"differs besides: {sentence}" for sentence in one.differing)
        told = [*besides, *one.sentences, *one.to_know, *one.remarks]
        sections.append(Section(f"{one.second.name} beside {one.first.name}", "", told))
        sections += [
            Section(title, "below", (), [sheet]) for title, sheet in comparison_sheets(one)
        ]
    return markdown("Comparison", (), sections)


# Rows for files and programs

_Described = tuple[str, pa.DataType, str]
_TEXT, _FLOAT, _TRUTH = pa.string(), pa.float64(), pa.bool_()
# Name, kind and meaning of each column; what is compared tells its unit.
_COLUMNS: tuple[_Described, ...] = (
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
    ("source", _TEXT, "model or measured"),
    ("words", _TEXT, "the verdict in words"),
)
_POINT_COLUMNS: tuple[_Described, ...] = (
    ("run", _TEXT, "whose force it is"),
    ("setting", _TEXT, "adjuster setting"),
    ("speed_m_per_s", _FLOAT, "positive; empty where a whole setting is missing"),
    ("stroke", _TEXT, "rebound or bump"),
    ("force_N", _FLOAT, "positive in rebound"),
    ("low_N", _FLOAT, "lower edge of the band"),
    ("high_N", _FLOAT, "upper edge of the band"),
    ("margin_N", _FLOAT, "how far inside the band; negative: outside"),
    ("half_interval_N", _FLOAT, "half the 95 % interval of the force that is checked"),
    ("source", _TEXT, "model or measured"),
    ("is_met", _TRUTH, "whether it is inside; false where it could not be evaluated"),
    ("words", _TEXT, "the result in words"),
)


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


def comparison_table(rows: Sequence[Mapping[str, Any]]) -> pa.Table:
    """Return rows of one or more comparisons as a table."""
    return _table(rows, _COLUMNS)


def tolerance_table(rows: Sequence[Mapping[str, Any]]) -> pa.Table:
    """Return rows of forces held against bands as a table."""
    return _table(rows, _POINT_COLUMNS)


def _table(rows: Sequence[Mapping[str, Any]], columns: Sequence[_Described]) -> pa.Table:
    fields = [pa.field(name, kind, metadata={"description": said}) for name, kind, said in columns]
    return pa.Table.from_pylist([dict(row) for row in rows], schema=pa.schema(fields))


def comparison_record(comparison: RunComparison) -> dict[str, Any]:
    """Return a comparison as JSON values."""

    def run(one: Run) -> dict[str, str]:
        return {"name": one.name, "place": one.shown_as}

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

    What could not be looked at has failed. ``source`` are the bands, as they were given.
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


# Figures: loops of a setting with their differences below, and all settings


def loop_plots(runs: Sequence[Run], setting: Setting, *, name: str) -> tuple[Plot, ...]:
    """Return force against velocity and displacement of a setting, where all ran one motion.

    The reference is the first of the runs; ``name`` is what the names of the plots begin with.
    """
    groups = common_tests(runs, setting)
    if not groups:
        return ()
    if any(not len(test.displacement) for group in groups for test in group):  # without time
        points = tuple(
            Line(
                *(test.velocity, test.force, run.name, _colour(k)),
                setting=setting,
                style="points" if k == 0 else "triangles",
            )
            for k, (run, group) in enumerate(zip(runs, groups, strict=True))
            for test in group[:1]
        )
        panel = Panel("velocity", "m/s", "force", "N", points)
        title = f"Setting {setting}: force against velocity"
        return (Plot(f"{name}_force_velocity", title, (panel,)),)
    # Of several tests the mean: x, v and force over one cycle, begun where x passes its middle.
    loops = [np.mean([_aligned(test) for test in group], axis=0) for group in groups]
    closed = [np.column_stack([loop, loop[:, :1]]) for loop in loops]
    reference, whose = closed[0], runs[0].name
    plots = []
    for place, word, unit, factor in ((1, "velocity", "m/s", 1.0), (0, "displacement", "mm", 1e3)):
        upper = tuple(
            Line(
                *(factor * loop[place], loop[2], run.name, _colour(k)),
                setting=setting,
                style="thin" if k == 0 else "wide",
            )
            # The reference last and thin: it would else be hidden where nothing differs.
            for k, (run, loop) in reversed(list(enumerate(zip(runs, closed, strict=True))))
        )
        # One phase is one motion: forces are taken from each other there.
        lower = tuple(
            Line(
                *(factor * reference[place], loop[2] - reference[2]),
                *(f"{run.name} less {whose}", _colour(k)),
                setting=setting,
                style="thin",
                in_legend=False,
            )
            for k, (run, loop) in enumerate(zip(runs[1:], closed[1:], strict=True), start=1)
        )
        panels = (
            Panel(word, unit, "force", "N", upper),
            Panel(word, unit, "difference", "N", lower, rules=((0.0, ""),)),
        )
        title = f"Setting {setting}: force against {word}"
        caption = f"Mean measured cycles. Below: less {whose}, phase by phase."
        plots.append(Plot(f"{name}_force_{word}", title, panels, caption))
    return tuple(plots)


def _colour(k: int) -> str:
    return RUN_COLOURS[k % len(RUN_COLOURS)]


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
    """Return the difference of force over the settings, at the fastest speed of each pair.

    All comparisons have one reference.
    """
    plots = []
    settings = sorted({s for one in comparisons for s in one.settings})
    places = setting_places(settings)
    is_bare = any(one.is_without_model for one in comparisons)
    for stroke, word in STROKE_WORDS.items():
        lines, speeds = [], []
        for k, one in enumerate(comparisons, start=1):
            known = [
                line
                for line in one.of("force")
                if line.subject.stroke == stroke and math.isfinite(line.percent)
            ]
            top = max((line.subject.speed or 0.0 for line in known), default=0.0)
            known = [line for line in known if line.subject.speed == top]
            if not known:
                continue
            speeds.append(one.units.write_speed(top))
            x = np.array([places[line.subject.setting] for line in known if line.subject.setting])
            y, low, high = np.array(
                [(line.percent, line.percent_low, line.percent_high) for line in known]
            ).T
            errors = {"low": low, "high": high} if np.isfinite(low).all() else {}
            label = f"{one.second.name}, {speeds[-1]}"
            lines.append(Line(x, y, label, _colour(k), style="points", **errors))
        if lines:
            unit = f"% of {'measured force' if is_bare else 'damping'}"
            panel = setting_panel(settings, "difference", unit, lines, rules=((0.0, ""),))
            title = f"Difference of force in {word}, with 95 % intervals"
            at = " and ".join(dict.fromkeys(speeds))
            caption = f"At {at}. Above zero: harder than {comparisons[0].first.name}."
            plots.append(Plot(f"difference_{stroke}", title, (panel,), caption))
    return tuple(plots)
