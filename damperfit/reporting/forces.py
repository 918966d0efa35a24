"""Tables of forces: by setting and click, of logs, curves, a simulated cycle, a sweep."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from damperfit.io import ForceCurve
from damperfit.reporting.inspection import MANY_ROWS
from damperfit.reporting.sheet import (
    NOTHING,
    Column,
    Sheet,
    laid_out,
    number,
    percent,
    stroke_ratio,
    with_interval,
)
from damperfit.reporting.tables import BLOCK_LEVELS, sparkline
from damperfit.statistics import NORMAL_95
from damperfit.tested.setting import Setting, clicks_between, lines_of

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping, Sequence

    from damperfit.simulation import Characteristics, Response

    Row = Mapping[str, Any]
    Places = Sequence[tuple[Any, str | None]]

STROKE_WORDS = {"rebound": "rebound", "bump": "compression"}  # keys are the paper's, words people's
_BOTH = ("rebound", "bump")
_WHOSE = ("measured", "simulated")
_OF_DAMPING = "% of the damping: of the force less the gas force at mid-stroke"
_AS_MEASURED = "* measured: the model misses the force there by more than 2 %"
_BRANCHES = "force at a speed: mean of both branches; hysteresis: opening less closing branch"
_SEGMENTS = (
    "Mean of the cycles; where nothing repeats the extremes, and the energy of all of it. "
    "Hysteresis: opening less closing force at half of the lower peak speed."
)
_MOST = 60  # segments that have a row
_MOST_STEPS = 5  # steps of several clicks that are named
_CURVE_SPEEDS = (0.05, 0.1, 0.13, 0.26, 0.52)  # m/s, of the speeds that damper tests name
_BAR = 1e5  # Pa
_CELLS, _FEWEST = 44, 16  # characters of one cycle; where the terminal is narrow
_BESIDE = 36  # name and range of a line


# By setting and click: rows of the table "adjustment"


def force_sheets(rows: Sequence[Row], strokes: Sequence[str] = _BOTH) -> list[Sheet]:
    """Return the forces at all speeds and the click at the fastest, a table a stroke."""
    speeds = sorted({row["speed_m_per_s"] for row in rows})
    sheets = [_by_setting(rows, (stroke,), speeds) for stroke in strokes if rows]
    # A note stands once, below the last table.
    return [*(replace(one, notes=()) for one in sheets[:-1]), *sheets[-1:]]


def force_by_setting_sheet(rows: Sequence[Row], strokes: Sequence[str] = _BOTH) -> Sheet:
    """Return force and change by click at the fastest speed of the rows, strokes side by side."""
    fastest = max((row["speed_m_per_s"] for row in rows), default=0.0)
    known = [row for row in rows if row["speed_m_per_s"] == fastest]
    sheet = _by_setting(known, strokes, [fastest])
    n = (len(sheet.headings) - 1) // len(strokes)
    heads = [STROKE_WORDS[one] for one in strokes]
    return replace(
        sheet,
        headings=("set", *(heads[k // n] if k % n == 0 else one
                           for k, one in enumerate(sheet.headings[1:]))),
        units=("", *(one.replace("m/s", "N") for one in sheet.units[1:])),
        notes=(f"at {fastest:g} m/s", *sheet.notes),
    )  # fmt: skip


def _by_setting(rows: Sequence[Row], strokes: Sequence[str], speeds: Sequence[float]) -> Sheet:
    """Force at each speed, and what a click changes at the last, a row a setting."""
    table = {
        (row["setting"], row.get("changed"), row["stroke"], row["speed_m_per_s"]): row
        for row in rows
    }
    # With several adjusters a setting has a row for each that was turned.
    places = sorted({key[:2] for key in table}, key=lambda one: (Setting.of(one[0]), one[1] or ""))
    has_click = any(row.get("change_N") is not None for row in rows)
    columns = [Column(STROKE_WORDS[strokes[0]], "N at", lambda place: _words(*place))]

    def column(
        heading: str, unit: str, stroke: str, speed: float, cell: Callable[[Row], str]
    ) -> Column:
        return Column(heading, unit, lambda at: cell(table.get((*at, stroke, speed), {})))

    for stroke in strokes:
        for speed in speeds:
            is_last = speed == speeds[-1]
            cell = _force if is_last else _bare_force
            unit = "m/s ±95 %" if is_last else "m/s"
            columns.append(column(f"{speed:.3g}", unit, stroke, speed, cell))
        if has_click:
            heading = "change" if _wide_steps(places) else "click"
            columns.append(column(heading, "N ±95 %", stroke, speeds[-1], _change))
            columns.append(column("", "%", stroke, speeds[-1], _change_percent))
    notes = _notes_on_clicks(places) if has_click else ()
    return laid_out(places, columns, *notes, *_marks(rows))


def _force(row: Row) -> str:
    """Return the force with its 95 % interval, marked where it was measured."""
    limits = [row.get(name) for name in ("force_N", "force_ci_low_N", "force_ci_high_N")]
    return with_interval(*limits, digits=4) + _mark(row)


def _bare_force(row: Row) -> str:
    return number(row.get("force_N"), digits=4) + _mark(row)


def _mark(row: Row) -> str:
    return "*" if row.get("origin") == "measured" else ""


def _change(row: Row) -> str:
    names = ("change_N", "change_ci_low_N", "change_ci_high_N")
    return with_interval(*(row.get(name) for name in names), plus="+")


def _change_percent(row: Row) -> str:
    share = row.get("change_percent")
    return NOTHING if share is None else f"{share:+.1f}"


def _words(setting: Any, changed: str | None) -> str:
    several = changed is not None and " " in str(setting)
    return f"{setting}, {changed}" if several else str(setting)


def _wide_steps(places: Places) -> list[tuple[Setting, Setting, float]]:
    """Return the steps between tested settings that are more than one click."""
    steps = (
        (a, b, clicks_between(a, b) or 0.0)
        for line in lines_of([setting for setting, _ in places])
        for a, b in itertools.pairwise(line.settings)
    )
    return [step for step in steps if step[2] > 1.0]


def _notes_on_clicks(places: Places) -> tuple[str, ...]:
    notes = []
    if wide := _wide_steps(places):
        named = ", ".join(f"{a} to {b} ({n:g} clicks)" for a, b, n in wide[:_MOST_STEPS])
        more = f" and {len(wide) - _MOST_STEPS} more" if len(wide) > _MOST_STEPS else ""
        notes.append(f"the change is over all clicks between two tested settings: {named}{more}")
    marked = next((one for one in places if _words(*one) != str(one[0])), None)
    if marked is not None:
        notes.append(
            f'"{_words(*marked)}": the change when {marked[1]} alone is turned; the forces of a '
            "setting are the same in its rows"
        )
    return (*notes, _OF_DAMPING)


def _marks(rows: Iterable[Row]) -> tuple[str, ...]:
    return (_AS_MEASURED,) if any(map(_mark, rows)) else ()


def _measured(row: Row) -> str:
    force, reach = row["measured_N"], NORMAL_95 * (row.get("measured_se_N") or math.nan)
    return with_interval(force, force - reach, force + reach, digits=4)


def measured_force_sheet(rows: Sequence[Row]) -> Sheet:
    """Return the measured force beside the model's on the same cycles, with the difference.

    At the fastest speed of all settings, and wherever else the model misses the measured force.
    """
    known = [row for row in rows if row.get("measured_N") is not None]
    table = {(row["setting"], row["speed_m_per_s"], row["stroke"]): row for row in known}
    fastest = max((row["speed_m_per_s"] for row in known), default=0.0)
    missed = {(row["setting"], row["speed_m_per_s"]) for row in known if _mark(row)}
    places = sorted(
        {(a, b) for a, b, _ in table if b == fastest or (a, b) in missed},
        key=lambda place: (Setting.of(place[0]), place[1]),
    )

    def column(stroke: str, heading: str, text: Callable[[Row], str]) -> Column:
        def cell(place: tuple[Any, float]) -> str:
            row = table.get((*place, stroke))
            return text(row) if row else NOTHING

        return Column(STROKE_WORDS[stroke], heading, cell)

    columns = [
        Column("set", "", lambda place: str(place[0])),
        Column("speed", "m/s", lambda place: f"{place[1]:g}"),
    ]
    for stroke in _BOTH:
        columns += [
            column(stroke, "measured", lambda row: _measured(row) + _mark(row)),
            column(
                stroke, "model", lambda r: number(r["measured_N"] - r["difference_N"], digits=4)
            ),
            column(stroke, "diff.", lambda row: f"{row['difference_N']:+.1f}"),
        ]
    note = "force in N ±95 %, mean of all compared cycles, beside the model's on the same cycles"
    return laid_out(places, columns, note, *_marks(known))


# Of logs and segments: rows of the table "characteristics"


def log_force_sheet(rows: Sequence[Row]) -> Sheet:
    """Return the forces of one segment, measured beside simulated: at named speeds, and peaks."""
    peak = next(row for row in rows if row["point"] == "peak")
    named = [(f"at {one['speed_rebound_m_per_s']:g} m/s", one) for one in rows if one is not peak]

    def pair(name: str, row: Row) -> tuple[str, ...]:
        forces = [row[f"{whose}_{stroke}_N"] for stroke in _BOTH for whose in _WHOSE]
        ratios = map(stroke_ratio, forces[:2], forces[2:])
        return (name, *(number(force, digits=4) for force in forces), *ratios)

    lost = (
        number(_rounded(peak[f"{whose}_hysteresis_{stroke}_N"]), digits=4)
        for stroke in _BOTH
        for whose in _WHOSE
    )
    hysteresis = f"hysteresis, {number(peak['hysteresis_speed_m_per_s'], digits=2)} m/s"
    heat = peak["temperature_degC"]
    temperature = f"Temperature: {'not logged' if heat is None else f'{heat:.1f} degC'}"
    energy = [number(peak[f"{whose}_energy_J"], digits=4) for whose in _WHOSE]
    return Sheet(
        ("force, N", *(STROKE_WORDS[one] for one in _BOTH for _ in _WHOSE), "ratio", "ratio"),
        ("", *_WHOSE * 3),
        (
            *(pair(name, row) for name, row in named),
            pair("peak", peak),
            (hysteresis, *lost, "", ""),
        ),
        (False, *(True,) * 6),
        (f"Energy per cycle: {energy[0]} J measured, {energy[1]} J simulated. {temperature}.",),
    )


def _rounded(force: float | None) -> float | None:
    return None if force is None else round(force, 6) + 0.0  # what is left of a sum that is zero


def segment_sheet(rows: Sequence[Row], *, has_setting: bool) -> Sheet:
    """Return peak force against peak speed (PVP), energy, hysteresis: a row a segment.

    Of all settings, by setting and speed; else of one log, as it ran.
    """
    peaks = [row for row in rows if row["point"] == "peak"]
    columns = [Column.of("from", "s", "start_s")]
    if has_setting:
        peaks.sort(
            key=lambda row: (Setting.of(row["setting"]), row["speed_rebound_m_per_s"] or 0.0)
        )
        columns = [Column("setting", "", lambda row: str(row["setting"]))]
    columns += _motion("speed_{}_m_per_s")
    for heading, name, unit, digits in (
        ("rebound", "rebound", "N", 4),
        ("compression", "bump", "N", 4),
        ("energy", "energy", "J", 4),
        ("hyst. rebound", "hysteresis_rebound", "N", 3),
        ("hyst. compression", "hysteresis_bump", "N", 3),
    ):
        columns += [
            Column.of(heading, f"{whose}, {unit}", f"{whose}_{name}_{unit}", digits=digits)
            for whose in _WHOSE
        ]
    return _first_segments(peaks, columns, "characteristics.csv")


def measured_segment_sheet(entries: Sequence[Row]) -> Sheet:
    """Return a row a segment, of run.json's "stretches": what was measured, MSE of the fit."""
    columns = [
        Column("setting", "", lambda row: str(row["setting"])),
        Column("log", "", lambda row: str(row["log"]), is_number=False),
        *_motion("peak_speed_{}_m_per_s"),
        Column.of("rebound", "N", "peak_force_rebound_N"),
        Column.of("compression", "N", "peak_force_bump_N"),
        Column.of("energy", "J", "energy_J"),
        Column.of("hyst. rebound", "N", "hysteresis_rebound_N", digits=3),
        Column.of("hyst. compression", "N", "hysteresis_bump_N", digits=3),
        Column("MSE", "%", lambda row: percent(row.get("mse_percent"))),
    ]
    return _first_segments(entries, columns, "run.json")


def _motion(speed: str) -> list[Column]:
    """Cycles, frequency and peak speed of a segment, whose columns have the stroke for {}."""

    def fastest(row: Row) -> str:
        speeds = (row.get(speed.format(stroke)) for stroke in _BOTH)
        return number(max((one for one in speeds if one is not None), default=None), digits=3)

    return [
        Column("cycles", "", lambda row: str(row["cycles"]) if row.get("cycles") else "moving"),
        Column.of("freq.", "Hz", "frequency_Hz", digits=3),
        Column("speed", "m/s", fastest),
    ]


def _first_segments(rows: Sequence[Row], columns: Sequence[Column], file: str) -> Sheet:
    more = len(rows) - _MOST
    notes = (_SEGMENTS, *([f"{more} more in {file}"] if more > 0 else []))
    return laid_out(rows[:_MOST], columns, *notes)


# Curves without time


def curve_sheet(logs: Iterable[Row]) -> Sheet:
    """Return one row per curve and stroke of the files without time; no rows without.

    ``logs`` are facts of `damperfit.run.logs.LogFacts`, also of logs with time.
    """
    files = [log for log in logs if log.get("curves")]
    curves = []
    for log in files:
        for facts in log["curves"]:
            velocity, force = (np.array(facts[name]) for name in ("velocity_m_per_s", "force_N"))
            file, label = str(log["name"]), str(facts["label"])
            label = f"{file}: {label}" if len(files) > 1 and label != file else label
            curves.append(ForceCurve("", "", "", label, velocity, force))
    return curve_forces_sheet(curves, _CURVE_SPEEDS)


def curve_forces_sheet(curves: Sequence[ForceCurve], speeds: Sequence[float]) -> Sheet:
    """Return one row per curve and stroke: points, peaks and forces at some speeds, m/s."""
    rows = []
    for curve in curves:
        name = curve.label
        for stroke in _BOTH:
            v, f = curve.points(stroke)
            if not len(v):
                continue
            row = (
                *(name, STROKE_WORDS[stroke], str(len(v)), number(float(v.max()), digits=3)),
                number(float(f[np.argmax(np.abs(f))]), digits=4),
                *(number(curve.force_at(speed, stroke), digits=4) for speed in speeds),
                number(curve.hysteresis_at(0.5 * float(v.max()), stroke), digits=3),
            )
            rows.append(row)
            name = ""
    n = 5 + len(speeds) + any(row[-1] != NOTHING for row in rows)  # points have no hysteresis
    more = len(rows) - MANY_ROWS
    headings = ("curve", "stroke", "points", "to", "peak", *map("{:g}".format, speeds), "hyst.")
    return Sheet(
        headings=headings[:n],
        units=("", "", "", "m/s", "N", *("m/s, N" for _ in speeds), "N")[:n],
        rows=tuple(row[:n] for row in rows[:MANY_ROWS]),
        is_number=(False, False, *(True,) * (n - 2)),
        notes=(
            "forces are read between measured points, of loops the mean of both branches",
            *([f"{more} more rows are not shown; --json lists them all"] if more > 0 else []),
        ),
    )


# A simulated cycle


def cycle_force_sheet(figures: Characteristics) -> Sheet:
    """Return peak forces, hysteresis and forces at named speeds, rebound beside compression."""
    pairs = [
        ("peak force", "N", figures.peak_force_rebound, figures.peak_force_bump),
        ("peak speed", "m/s", figures.peak_speed_rebound, figures.peak_speed_bump),
        *(
            (f"force at {one.speed:g} m/s", "N", one.rebound, one.bump)
            for one in figures.speed_forces
        ),
        (
            f"hysteresis at {figures.hysteresis_speed:.3g} m/s",
            *("N", figures.hysteresis_rebound, figures.hysteresis_bump),
        ),
    ]
    rows = [(name, unit, number(a, digits=4), number(b, digits=4)) for name, unit, a, b in pairs]
    return Sheet(
        headings=("", "", *STROKE_WORDS.values()),
        units=("",) * 4,
        rows=(*rows, ("energy per cycle", "J", number(figures.energy, digits=4), "")),
        is_number=(False, False, True, True),
        notes=(_BRANCHES,),
    )


def cycle_pressure_sheet(figures: Characteristics) -> Sheet:
    """Return the pressure range and the share of the cycle in cavitation, by chamber."""
    low, high = (
        tuple(number(p[end] / _BAR, digits=4) for p in figures.pressure_ranges) for end in (0, 1)
    )
    return Sheet(
        headings=("", "", "chamber 1", "chamber 2", "chamber 3"),
        units=("",) * 5,
        rows=(
            ("lowest pressure", "bar", *low),
            ("highest pressure", "bar", *high),
            ("cavitation", "% of cycle", *(f"{100.0 * p:.1f}" for p in figures.cavitation_shares)),
        ),
        is_number=(False, False, True, True, True),
    )


def cycle_sparklines(
    response: Response, frequency: float, *, columns: int = 80, levels: str = BLOCK_LEVELS
) -> tuple[str, ...]:
    """Return the last cycle, of ``frequency`` Hz, as lines: displacement, force, pressures."""
    cells = max(_FEWEST, min(_CELLS, columns - _BESIDE))
    at = response.time[-1] - (1.0 - np.arange(cells) / (cells - 1.0)) / frequency
    is_inside = response.time >= at[0]
    lines = []
    for name, unit, signal in (
        ("displacement", "mm", 1e3 * response.displacement),
        ("force", "N", response.force),
        *((f"pressure {i}", "bar", p / _BAR) for i, p in enumerate(response.pressures, start=1)),
    ):
        if not np.isfinite(signal).all():
            continue
        marks = sparkline(np.interp(at, response.time, signal).tolist(), levels=levels)
        low, high = (number(float(end(signal[is_inside])), digits=4) for end in (np.min, np.max))
        lines.append(f"{name:<12} {marks} {low} to {high} {unit}")
    return tuple(lines)


# A sweep


@dataclass(frozen=True, slots=True, eq=False)
class SweepMember:
    """One test of a sweep.

    Attributes
    ----------
    factor, value : float
        The factor and the quantity it makes, SI.
    frequency : float
        Hz.
    response : Response
        Signals of the test.
    figures : Characteristics
        Figures of the last cycle.
    """

    factor: float
    value: float
    frequency: float
    response: Response
    figures: Characteristics

    @property
    def cavitation(self) -> float:
        """Largest share of the cycle that a chamber is at zero pressure."""
        return max(self.figures.cavitation_shares)


# Heading, unit and key of each figure of a member, and what it is in `Characteristics`.
_SWEPT = (
    ("peak", "rebound N", "peak_force_rebound_N", "peak_force_rebound"),
    ("peak", "compr. N", "peak_force_bump_N", "peak_force_bump"),
    ("", "", "hysteresis_speed_m_per_s", "hysteresis_speed"),
    ("hyst.", "rebound N", "hysteresis_rebound_N", "hysteresis_rebound"),
    ("hyst.", "compr. N", "hysteresis_bump_N", "hysteresis_bump"),
    ("energy", "J", "energy_J", "energy"),
)


def sweep_sheet(name: str, unit: str, members: Sequence[SweepMember]) -> Sheet:
    """Return one row per member: peaks, hysteresis, energy, cavitation."""

    def shown(figure: str) -> Callable[[SweepMember], str]:
        return lambda member: number(getattr(member.figures, figure), digits=4)

    columns = [
        Column("factor", "", lambda member: f"{member.factor:g}"),
        Column(name, unit, lambda member: number(member.value, digits=5)),
        *(Column(heading, of, shown(figure)) for heading, of, _, figure in _SWEPT if heading),
        Column("cavitation", "% of cycle", lambda member: f"{100.0 * member.cavitation:.1f}"),
    ]
    return laid_out(members, columns)


def sweep_records(name: str, members: Sequence[SweepMember]) -> list[dict[str, float | str]]:
    """Return the same as numbers in SI, by column name."""
    return [
        {
            "quantity": name,
            "factor": member.factor,
            "value": member.value,
            **{key: getattr(member.figures, figure) for *_, key, figure in _SWEPT},
            **{
                f"cavitation_fraction_{i}": share
                for i, share in enumerate(member.figures.cavitation_shares, start=1)
            },
        }
        for member in members
    ]


def sweep_sentence(name: str, members: Sequence[SweepMember]) -> str:
    """Return what changes from the lowest to the highest factor, in one sentence."""
    ranked = sorted(members, key=lambda member: member.factor)
    first, last = ranked[0], ranked[-1]
    dry = [
        f"chamber {i} for {100.0 * share:.1f} % of the cycle at x{member.factor:g}"
        for member in ranked
        for i, share in enumerate(member.figures.cavitation_shares, start=1)
        if share > 0.0
    ]
    cavitation = f"cavitation: {', '.join(dry)}" if dry else "no chamber cavitates"
    if len(ranked) == 1:
        return f"{name} x{first.factor:g}: {cavitation}."
    changes = []
    for words, figure in (
        ("peak rebound", "peak_force_rebound"),
        ("peak compression", "peak_force_bump"),
        ("hysteresis in rebound", "hysteresis_rebound"),
        ("in compression", "hysteresis_bump"),
    ):
        before, after = (abs(getattr(one.figures, figure)) for one in (first, last))
        gain = round(100.0 * (after / before - 1.0), 1) + 0.0 if before > 0.0 else None
        share_of = "" if gain is None else f" ({gain:+.1f} %)"
        change = f"{number(before, digits=4)} to {number(after, digits=4)} N{share_of}"
        changes.append(f"{words} {change}")
    return f"{name} x{first.factor:g} to x{last.factor:g}: {', '.join(changes)}; {cavitation}."
