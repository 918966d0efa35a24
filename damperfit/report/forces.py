"""Tables of forces: by setting and click, of logs, curves, a simulated cycle, a sweep."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from damperfit.io import ForceCurve
from damperfit.report.inspection import MANY_ROWS
from damperfit.report.rounding import NOTHING, number, percent, stroke_ratio, with_interval
from damperfit.report.sheet import Sheet
from damperfit.report.tables import (
    BLOCK_LEVELS,
    BRANCHES,
    BRANCHES_AND_RATIO,
    DAMPING_SHARE,
    FORCE_AS_MEASURED,
    MEASURED_BESIDE_MODEL,
    energy_and_temperature,
    force_and_click_at,
    over_several_clicks,
    simulated_clicks_at,
    sparkline,
    stroke_and_click_at,
)
from damperfit.statistics import NORMAL_95
from damperfit.tested.setting import Setting, clicks_between

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping, Sequence

    from damperfit.adjustment import Click
    from damperfit.recording import StretchFigures
    from damperfit.simulation import Characteristics, Response

__all__ = [
    "ComparedStretch",
    "PeakPoint",
    "SweepMember",
    "click_sheet",
    "compared_stretch_sheet",
    "curve_forces_sheet",
    "curve_sheet",
    "cycle_force_sheet",
    "cycle_pressure_sheet",
    "cycle_sparklines",
    "force_by_setting_sheet",
    "force_by_speed_sheet",
    "measured_and_simulated_sheet",
    "measured_force_sheet",
    "measured_stretch_sheet",
    "peak_sheet",
    "sweep_records",
    "sweep_sentence",
    "sweep_sheet",
]


# The change of force from click to click, one row per click.


def click_sheet(clicks: Sequence[Click], of_offset: Sequence[str] = ()) -> Sheet:
    """Return one row per click: the change of force at the highest speed, by stroke.

    Parameters
    ----------
    clicks : sequence of Click
        Of all speeds.
    of_offset : sequence of str
        What became of the rigs' offsets, told below the table.
    """
    fastest = max((click.speed for click in clicks), default=0.0)
    shown = [click for click in clicks if click.speed == fastest]
    steps = sorted({(click.first, click.second) for click in shown})
    cells = {(click.first, click.second, click.stroke): click for click in shown}

    def change_of(step: tuple[Setting, Setting], stroke: str) -> str:
        click = cells.get((*step, stroke))
        return NOTHING if click is None else with_interval(click.change, click.high, plus="+")

    return Sheet(
        headings=("click", "rebound", "bump"),
        units=("", "N", "N"),
        rows=tuple(
            (_words(*step), change_of(step, "rebound"), change_of(step, "bump")) for step in steps
        ),
        is_number=(False, True, True),
        notes=(simulated_clicks_at(fastest), *of_offset) if steps else (),
    )


def _words(first: Setting, second: Setting) -> str:
    """Two settings apart are more than one click, and what lies between was not tested."""
    clicks = clicks_between(first, second) or 0.0
    apart = f" ({clicks:g} clicks)" if clicks > 1.0 else ""
    return f"{first} to {second}{apart}"


# Force by setting, and what a click changes: at one speed, or of one stroke at all speeds.


def force_by_setting_sheet(
    rows: Sequence[Mapping[str, Any]], strokes: Sequence[str] = ("rebound", "bump")
) -> Sheet:
    """Return force and change by click at one speed, rebound beside bump or one of them.

    Parameters
    ----------
    rows : sequence of mapping
        Of the table "adjustment"; the fastest speed among them is shown.
    strokes : sequence of str
        Which to show.
    """
    fastest = max((row["speed_m_per_s"] for row in rows), default=0.0)
    by_place = {
        (row["setting"], row.get("changed"), row["stroke"]): row
        for row in rows
        if row["speed_m_per_s"] == fastest
    }
    places = _places(by_place)
    gaps = over_several_clicks([setting for setting, _ in places])
    change = "change" if gaps else "click"
    return Sheet(
        headings=("set", *(cell for stroke in strokes for cell in (stroke, change, ""))),
        units=("", *(("N", "N", "%") * len(strokes))),
        rows=tuple(
            (
                _words_force_by_setting_sheet(setting, changed),
                *(
                    cell
                    for stroke in strokes
                    for cell in _cells(by_place[setting, changed, stroke])
                ),
            )
            for setting, changed in places
        ),
        is_number=(True,) * (1 + 3 * len(strokes)),
        notes=(
            force_and_click_at(fastest),
            *gaps,
            *_turned(places),
            DAMPING_SHARE,
            *_marks(by_place.values()),
        ),
    )


def force_by_speed_sheet(rows: Sequence[Mapping[str, Any]], stroke: str) -> Sheet:
    """Return the forces of one stroke at all speeds, and the click at the fastest."""
    speeds = sorted({row["speed_m_per_s"] for row in rows})
    table = {
        (row["setting"], row.get("changed"), row["speed_m_per_s"]): row
        for row in rows
        if row["stroke"] == stroke
    }
    places = _places(table)
    gaps = over_several_clicks([setting for setting, _ in places])
    change = "change" if gaps else "click"
    return Sheet(
        headings=("set", *(f"{speed:g}" for speed in speeds), change, ""),
        units=("", *("m/s" for _ in speeds), "N", "%"),
        rows=tuple(
            (
                _words_force_by_setting_sheet(setting, changed),
                *(_force_cell(table[setting, changed, speed], digits=4) for speed in speeds),
                *_cells(table[setting, changed, speeds[-1]])[1:],
            )
            for setting, changed in places
        ),
        is_number=(True,) * (len(speeds) + 3),
        notes=(
            stroke_and_click_at(stroke, speeds[-1], change),
            *gaps,
            *_turned(places),
            DAMPING_SHARE,
            *_marks(rows),
        ),
    )


def _places(rows: Iterable[tuple[Any, str | None, Any]]) -> list[tuple[Any, str | None]]:
    """Return settings in order; with several adjusters one for each that was turned."""
    known = {(setting, changed) for setting, changed, _ in rows}
    return sorted(known, key=lambda one: (Setting.of(one[0]), one[1] or ""))


def _words_force_by_setting_sheet(setting: Any, changed: str | None) -> str:
    several = changed is not None and " " in str(setting)
    return f"{setting}, {changed}" if several else str(setting)


def _turned(places: Sequence[tuple[Any, str | None]]) -> tuple[str, ...]:
    """Say what the letter behind a setting means, where there is one."""
    marked = next(
        (one for one in places if _words_force_by_setting_sheet(*one) != str(one[0])), None
    )
    if marked is None:
        return ()
    said = (
        f'"{_words_force_by_setting_sheet(*marked)}": the change when {marked[1]} alone is turned'
    )
    return (f"{said}; the forces of a setting are the same in its rows",)


def measured_force_sheet(rows: Sequence[Mapping[str, Any]]) -> Sheet:
    """Return the measured force beside the model's on the same cycles, with the difference.

    At the fastest speed of all settings, and wherever else the model misses the measured force.

    Parameters
    ----------
    rows : sequence of mapping
        Of the table "adjustment".
    """
    known = [row for row in rows if row.get("measured_N") is not None]
    table = {(row["setting"], row["speed_m_per_s"], row["stroke"]): row for row in known}
    fastest = max((row["speed_m_per_s"] for row in known), default=0.0)
    missed = {(row["setting"], row["speed_m_per_s"]) for row in known if _is_measured(row)}
    places = sorted(
        {(a, b) for a, b, _ in table if b == fastest or (a, b) in missed},
        key=lambda place: (Setting.of(place[0]), place[1]),
    )
    return Sheet(
        headings=("set", "speed", *("rebound",) * 3, *("bump",) * 3),
        units=("", "m/s", *("measured", "model", "diff.") * 2),
        rows=tuple(
            (
                str(setting),
                f"{speed:g}",
                *(
                    cell
                    for stroke in ("rebound", "bump")
                    for cell in _beside(table.get((setting, speed, stroke)))
                ),
            )
            for setting, speed in places
        ),
        is_number=(True,) * 8,
        notes=(MEASURED_BESIDE_MODEL, *_marks(known)),
    )


def _beside(row: Mapping[str, Any] | None) -> tuple[str, str, str]:
    if row is None:
        return (NOTHING,) * 3
    measured, difference = row["measured_N"], row["difference_N"]
    mark = " m" if _is_measured(row) else ""
    return (
        number(measured, digits=4) + mark,
        number(measured - difference, digits=4),
        f"{difference:+.1f}",
    )


def _is_measured(row: Mapping[str, Any]) -> bool:
    return row.get("told_from") == "measured"


def _force_cell(row: Mapping[str, Any], *, digits: int | None = None) -> str:
    """Return the force to show: the model's, or as measured where the model misses it."""
    force, high, mark = row["force_N"], row["force_ci_high_N"], ""
    if _is_measured(row):
        force, mark = row["measured_N"], " m"
        error = row["measured_se_N"]
        high = None if error is None else force + NORMAL_95 * error
    text = with_interval(force, high) if digits is None else number(force, digits=digits)
    return text + mark


def _marks(rows: Iterable[Mapping[str, Any]]) -> tuple[str, ...]:
    return (FORCE_AS_MEASURED,) if any(_is_measured(row) for row in rows) else ()


def _cells(row: Mapping[str, Any]) -> tuple[str, str, str]:
    """Force and change, each with half of its 95 % interval, and the change in per cent."""
    return (
        _force_cell(row),
        with_interval(row["change_N"], row["change_ci_high_N"], plus="+"),
        NOTHING if row["change_percent"] is None else f"{row['change_percent']:+.1f}",
    )


# The forces of one log, measured beside simulated: at named speeds, peaks, hysteresis, ratio.


def measured_and_simulated_sheet(
    measured: Characteristics, simulated: Characteristics, *, temperature: float | None
) -> Sheet:
    """Return forces at named speeds, peaks, hysteresis and ratio, measured beside simulated.

    Parameters
    ----------
    measured, simulated : Characteristics
        Figures of one cycle.
    temperature : float or None
        degC, when it was logged.
    """
    rows = (
        *(
            _force_row(f"at {a.speed:g} m/s", (a.rebound, b.rebound), (a.bump, b.bump))
            for a, b in zip(measured.speed_forces, simulated.speed_forces, strict=True)
        ),
        _force_row(
            "peak",
            (measured.peak_force_rebound, simulated.peak_force_rebound),
            (measured.peak_force_bump, simulated.peak_force_bump),
        ),
        (
            f"hysteresis, {measured.hysteresis_speed:.2g} m/s",
            number(measured.hysteresis_rebound, digits=4),
            number(simulated.hysteresis_rebound, digits=4),
            number(measured.hysteresis_bump, digits=4),
            number(simulated.hysteresis_bump, digits=4),
            *("", ""),
        ),
    )
    energy = energy_and_temperature(measured.energy, simulated.energy, temperature)
    return Sheet(
        headings=("force, N", "rebound", "rebound", "bump", "bump", "ratio", "ratio"),
        units=("", *("measured", "simulated") * 3),
        rows=rows,
        is_number=(False, *(True,) * 6),
        notes=(energy, BRANCHES_AND_RATIO),
    )


def _force_row(
    name: str, rebound: tuple[float, float], bump: tuple[float, float]
) -> tuple[str, ...]:
    """Return a row; pairs are measured and simulated."""
    forces = (number(force, digits=4) for force in (*rebound, *bump))
    return (name, *forces, *map(stroke_ratio, rebound, bump))


# Peak force against peak speed (PVP), a row per test, measured beside simulated.

_MOST = 200  # rows


class PeakPoint(NamedTuple):
    """What a log, or a steady stretch of it, gives to peak force against peak speed."""

    setting: Setting
    log: str
    frequency: float
    measured: Characteristics | StretchFigures
    simulated: Characteristics | StretchFigures


def peak_sheet(points: Sequence[PeakPoint]) -> Sheet:
    """Return a row for each log or steady stretch, by setting and speed.

    Parameters
    ----------
    points : sequence of PeakPoint
        Of all logs.
    """
    ordered = sorted(points, key=lambda one: (one.setting, one.measured.peak_speed_rebound))
    more = len(ordered) - _MOST
    notes = ["Means of the cycles. Ratio: rebound force over bump force, without signs."]
    if more > 0:
        notes.append(f"{more} more in characteristics.csv")
    return Sheet(
        headings=(
            *("setting", "freq.", "speed", "rebound", "rebound", "speed", "bump", "bump"),
            *("ratio", "ratio", "energy"),
        ),
        units=(
            *("", "Hz", "m/s", "measured, N", "simulated, N", "m/s"),
            *("measured, N", "simulated, N", "measured", "simulated", "J"),
        ),
        rows=tuple(_row(one) for one in ordered[:_MOST]),
        is_number=(True,) * 11,
        notes=tuple(notes),
    )


def _row(one: PeakPoint) -> tuple[str, ...]:
    measured, simulated = one.measured, one.simulated
    return (
        str(one.setting),
        number(one.frequency, digits=3),
        number(measured.peak_speed_rebound, digits=3),
        number(measured.peak_force_rebound, digits=4),
        number(simulated.peak_force_rebound, digits=4),
        number(measured.peak_speed_bump, digits=3),
        number(measured.peak_force_bump, digits=4),
        number(simulated.peak_force_bump, digits=4),
        stroke_ratio(measured.peak_force_rebound, measured.peak_force_bump),
        stroke_ratio(simulated.peak_force_rebound, simulated.peak_force_bump),
        number(measured.energy, digits=4),
    )


# The characteristics of each stretch: peak force and speed (PVP), energy, hysteresis.

_MOST_STRETCH_SHEET = 60  # rows
_NOTE = (
    "Mean of the cycles; where nothing repeats the extremes, and the energy of all of it. "
    "Hysteresis: opening less closing force at half of the lower peak speed."
)


class ComparedStretch(NamedTuple):
    """A stretch with what is read off both forces: s, Hz."""

    start: float
    n_cycles: int
    frequency: float
    measured: StretchFigures
    simulated: StretchFigures


def measured_stretch_sheet(entries: Sequence[Mapping[str, Any]]) -> Sheet:
    """Return a row per stretch of all logs: what was measured, and the MSE of the fit.

    Parameters
    ----------
    entries : sequence of mapping
        As in run.json, "stretches".
    """
    shown = entries[:_MOST_STRETCH_SHEET]
    more = len(entries) - len(shown)
    return Sheet(
        headings=(
            *("setting", "log", "cycles", "freq.", "speed", "rebound", "bump", "energy"),
            *("hysteresis rebound", "hysteresis bump", "MSE"),
        ),
        units=("", "", "", "Hz", "m/s", "N", "N", "J", "N", "N", "%"),
        rows=tuple(_measured_row(one) for one in shown),
        is_number=(True, False, *(True,) * 9),
        notes=(
            _NOTE,
            *((f"{more} more stretch{'es' * (more > 1)} in run.json",) if more else ()),
        ),
    )


def _measured_row(one: Mapping[str, Any]) -> tuple[str, ...]:
    speeds = [one.get(f"peak_speed_{side}_m_per_s") for side in ("rebound", "bump")]
    numbers = [speed for speed in speeds if speed is not None]
    return (
        str(one["setting"]),
        str(one["log"]),
        str(one["cycles"]) if one.get("cycles") else "moving",
        number(one.get("frequency_Hz"), digits=3),
        number(max(numbers, default=None), digits=3),
        number(one.get("peak_force_rebound_N"), digits=4),
        number(one.get("peak_force_bump_N"), digits=4),
        number(one.get("energy_J"), digits=4),
        number(one.get("hysteresis_rebound_N"), digits=3),
        number(one.get("hysteresis_bump_N"), digits=3),
        percent(one.get("mse_percent")),
    )


def compared_stretch_sheet(rows: Sequence[ComparedStretch]) -> Sheet:
    """Return a row per stretch of one log, measured beside simulated.

    Parameters
    ----------
    rows : sequence of ComparedStretch
        Of the log.
    """
    names = ("rebound", "bump", "energy", "hyst. rebound", "hyst. bump")
    words = ("measured", "simulated")
    units = ("N", "N", "J", "N", "N")
    return Sheet(
        headings=("from, s", "cycles", "Hz", "m/s", *(name for name in names for _ in words)),
        units=(*("",) * 4, *(f"{word}, {unit}" for unit in units for word in words)),
        rows=tuple(_compared_row(one) for one in rows[:_MOST_STRETCH_SHEET]),
        is_number=(True,) * 14,
        notes=(_NOTE,),
    )


def _compared_row(one: ComparedStretch) -> tuple[str, ...]:
    measured, simulated = one.measured, one.simulated
    cells = [
        number(value if math.isfinite(value) else None, digits=digits)
        for name, digits in (
            ("peak_force_rebound", 4),
            ("peak_force_bump", 4),
            ("energy", 4),
            ("hysteresis_rebound", 3),
            ("hysteresis_bump", 3),
        )
        for value in (getattr(measured, name), getattr(simulated, name))
    ]
    return (
        number(one.start, digits=4),
        str(one.n_cycles) if one.n_cycles else "moving",
        number(one.frequency, digits=3),
        number(max(measured.peak_speed_rebound, measured.peak_speed_bump), digits=3),
        *cells,
    )


# Measured curves of force over speed: one row a curve and stroke, forces at named speeds.

_SPEEDS = (0.05, 0.1, 0.13, 0.26, 0.52)  # m/s, of the speeds that damper tests name
_STROKES = ("rebound", "bump")


def curve_sheet(logs: Iterable[Mapping[str, Any]]) -> Sheet:
    """Return one row per curve and stroke of the files without time; no rows without.

    Parameters
    ----------
    logs : iterable of mapping
        Facts of `damperfit.run.logs.LogFacts`, also of logs with time.
    """
    files = [log for log in logs if log.get("curves")]
    curves = [
        _from_facts(one, "" if len(files) == 1 else str(log["name"]))
        for log in files
        for one in log["curves"]
    ]
    return curve_forces_sheet(curves, _SPEEDS)


def _from_facts(facts: Mapping[str, Any], file: str) -> ForceCurve:
    velocity, force = (np.array(facts[name]) for name in ("velocity_m_per_s", "force_N"))
    label = str(facts["label"])
    label = f"{file}: {label}" if file and label != file else label
    return ForceCurve("", "", "", label, velocity, force)


def curve_forces_sheet(curves: Sequence[ForceCurve], speeds: Sequence[float]) -> Sheet:
    """Return one row per curve and stroke: its points, its peaks and its forces at some speeds.

    Parameters
    ----------
    curves : sequence of ForceCurve
        As measured.
    speeds : sequence of float
        m/s.
    """
    rows = []
    for curve in curves:
        name = curve.label
        for stroke in _STROKES:
            v, f = curve.points(stroke)
            if not len(v):
                continue
            middle = 0.5 * float(v.max())
            rows.append(
                (
                    name,
                    stroke,
                    str(len(v)),
                    number(float(v.max()), digits=3),
                    number(float(f[np.argmax(np.abs(f))]), digits=4),
                    *(number(curve.force_at(speed, stroke), digits=4) for speed in speeds),
                    number(curve.hysteresis_at(middle, stroke), digits=3),
                )
            )
            name = ""
    has_loops = any(row[-1] != "-" for row in rows)
    kept = [row if has_loops else row[:-1] for row in rows]
    n = 5 + len(speeds) + has_loops
    notes = ["forces are read between measured points, of loops the mean of both branches"]
    if len(kept) > MANY_ROWS:
        notes.append(f"{len(kept) - MANY_ROWS} more rows are not shown; --json lists them all")
    return Sheet(
        headings=("curve", "stroke", "points", "to", "peak", *map("{:g}".format, speeds), "hyst.")[
            :n
        ],
        units=("", "", "", "m/s", "N", *("m/s, N" for _ in speeds), "N")[:n],
        rows=tuple(kept[:MANY_ROWS]),
        is_number=(False, False, *(True,) * (n - 2)),
        notes=tuple(notes),
    )


# One simulated cycle: forces and pressures as rows, its signals as sparklines.

_BAR = 1e5  # Pa
_CELLS, _FEWEST = 44, 16  # characters of one cycle; where the terminal is narrow
_BESIDE = 36  # name and range of a line


def cycle_force_sheet(figures: Characteristics) -> Sheet:
    """Return peak forces, hysteresis and forces at named speeds, rebound beside bump."""
    pairs = [
        ("peak force", "N", figures.peak_force_rebound, figures.peak_force_bump),
        ("peak speed", "m/s", figures.peak_speed_rebound, figures.peak_speed_bump),
        *(
            (f"force at {forces.speed:g} m/s", "N", forces.rebound, forces.bump)
            for forces in figures.speed_forces
        ),
        (
            f"hysteresis at {figures.hysteresis_speed:.3g} m/s",
            "N",
            figures.hysteresis_rebound,
            figures.hysteresis_bump,
        ),
    ]
    rows = [
        *(
            (name, unit, number(up, digits=4), number(down, digits=4))
            for name, unit, up, down in pairs
        ),
        ("energy per cycle", "J", number(figures.energy, digits=4), ""),
    ]
    return Sheet(
        headings=("", "", "rebound", "bump"),
        units=("", "", "", ""),
        rows=tuple(rows),
        is_number=(False, False, True, True),
        notes=(BRANCHES,),
    )


def cycle_pressure_sheet(figures: Characteristics) -> Sheet:
    """Return the pressure range and the share of the cycle in cavitation, by chamber."""
    low = tuple(number(p[0] / _BAR, digits=4) for p in figures.pressure_ranges)
    high = tuple(number(p[1] / _BAR, digits=4) for p in figures.pressure_ranges)
    share = tuple(f"{100.0 * part:.1f}" for part in figures.cavitation_shares)
    return Sheet(
        headings=("", "", "chamber 1", "chamber 2", "chamber 3"),
        units=("", "", "", "", ""),
        rows=(
            ("lowest pressure", "bar", *low),
            ("highest pressure", "bar", *high),
            ("cavitation", "% of cycle", *share),
        ),
        is_number=(False, False, True, True, True),
    )


def cycle_sparklines(
    response: Response, frequency: float, *, columns: int = 80, levels: str = BLOCK_LEVELS
) -> tuple[str, ...]:
    """Return the last cycle as sparklines: displacement, force and the three pressures.

    Parameters
    ----------
    response : Response
        Signals, at least one cycle.
    frequency : float
        Hz.
    columns : int
        Width that the lines must fit into.
    levels : str
        Characters from low to high.
    """
    cells = max(_FEWEST, min(_CELLS, columns - _BESIDE))
    at = response.time[-1] - (1.0 - np.arange(cells) / (cells - 1.0)) / frequency
    rows = (
        ("displacement", "mm", 1e3 * response.displacement),
        ("force", "N", response.force),
        *(
            (f"pressure {i}", "bar", pressure / _BAR)
            for i, pressure in enumerate(response.pressures, start=1)
            if np.isfinite(pressure).all()
        ),
    )
    is_inside = response.time >= at[0]
    lines = []
    for name, unit, signal in rows:
        marks = sparkline(np.interp(at, response.time, signal).tolist(), levels=levels)
        low, high = (
            number(end, digits=4) for end in (np.min(signal[is_inside]), np.max(signal[is_inside]))
        )
        lines.append(f"{name:<12} {marks} {low} to {high} {unit}")
    return tuple(lines)


# What a sweep of one quantity does: a row per factor, records for a file, and a sentence.


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


def sweep_sheet(name: str, unit: str, members: Sequence[SweepMember]) -> Sheet:
    """Return one row per member."""
    return Sheet(
        headings=(
            "factor", name, "peak", "peak", "hysteresis", "hysteresis", "energy", "cavitation",
        ),
        units=("", unit, "rebound N", "bump N", "rebound N", "bump N", "J", "% of cycle"),
        rows=tuple(
            (
                f"{member.factor:g}",
                number(member.value, digits=5),
                number(member.figures.peak_force_rebound, digits=4),
                number(member.figures.peak_force_bump, digits=4),
                number(member.figures.hysteresis_rebound, digits=4),
                number(member.figures.hysteresis_bump, digits=4),
                number(member.figures.energy, digits=4),
                f"{100.0 * member.cavitation:.1f}",
            )
            for member in members
        ),
        is_number=(True,) * 8,
    )  # fmt: skip


def sweep_records(name: str, members: Sequence[SweepMember]) -> list[dict[str, float | str]]:
    """Return the same as numbers in SI, by column name."""
    return [
        {
            "quantity": name,
            "factor": member.factor,
            "value": member.value,
            "peak_force_rebound_N": member.figures.peak_force_rebound,
            "peak_force_bump_N": member.figures.peak_force_bump,
            "hysteresis_speed_m_per_s": member.figures.hysteresis_speed,
            "hysteresis_rebound_N": member.figures.hysteresis_rebound,
            "hysteresis_bump_N": member.figures.hysteresis_bump,
            "energy_J": member.figures.energy,
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
    wet = "no chamber cavitates"
    dry = [
        f"chamber {i} for {100.0 * share:.1f} % of the cycle at x{member.factor:g}"
        for member in ranked
        for i, share in enumerate(member.figures.cavitation_shares, start=1)
        if share > 0.0
    ]
    cavitation = f"cavitation: {', '.join(dry)}" if dry else wet
    if len(ranked) == 1:
        return f"{name} x{first.factor:g}: {cavitation}."

    def change(words: str, get: Callable[[Characteristics], float]) -> str:
        before, after = abs(get(first.figures)), abs(get(last.figures))
        share = (
            f" ({round(100.0 * (after / before - 1.0), 1) + 0.0:+.1f} %)" if before > 0.0 else ""
        )
        return f"{words} {number(before, digits=4)} to {number(after, digits=4)} N{share}"

    changes = (
        change("peak rebound", lambda f: f.peak_force_rebound),
        change("peak bump", lambda f: f.peak_force_bump),
        change("hysteresis in rebound", lambda f: f.hysteresis_rebound),
        change("in bump", lambda f: f.hysteresis_bump),
    )
    return f"{name} x{first.factor:g} to x{last.factor:g}: {', '.join(changes)}; {cavitation}."
