"""Tables of forces: by setting and click, of logs, curves, a simulated cycle, a sweep."""

from __future__ import annotations

import itertools
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from damperfit.io import ForceCurve
from damperfit.report.inspection import MANY_ROWS
from damperfit.report.rounding import NOTHING, number, percent, stroke_ratio, with_interval
from damperfit.report.sheet import Sheet
from damperfit.report.tables import BLOCK_LEVELS, sparkline
from damperfit.tested.setting import Setting, clicks_between, lines_of

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping, Sequence

    from damperfit.simulation import Characteristics, Response

    Row = Mapping[str, Any]
    Places = Sequence[tuple[Any, str | None]]

__all__ = [
    "STROKE_WORDS",
    "SweepMember",
    "curve_forces_sheet",
    "curve_sheet",
    "cycle_force_sheet",
    "cycle_pressure_sheet",
    "cycle_sparklines",
    "force_by_setting_sheet",
    "force_sheets",
    "log_force_sheet",
    "measured_force_sheet",
    "measured_segment_sheet",
    "segment_sheet",
    "sweep_records",
    "sweep_sentence",
    "sweep_sheet",
]

STROKE_WORDS = {"rebound": "rebound", "bump": "compression"}  # keys are the paper's, words people's
_BOTH = ("rebound", "bump")
_OF_DAMPING = "% of the damping: of the force less the gas force at mid-stroke"
_AS_MEASURED = "* measured: the model misses the force there by more than 2 %"
_BRANCHES = "force at a speed: mean of both branches; hysteresis: opening less closing branch"
_SEGMENTS = (
    "Mean of the cycles; where nothing repeats the extremes, and the energy of all of it. "
    "Hysteresis: opening less closing force at half of the lower peak speed."
)
_CLICK_UNITS = ("N ±95 %", "%")
_MOST = 60  # segments that have a row
_MOST_STEPS = 5  # steps of several clicks that are named
_CURVE_SPEEDS = (0.05, 0.1, 0.13, 0.26, 0.52)  # m/s, of the speeds that damper tests name
_BAR = 1e5  # Pa
_CELLS, _FEWEST = 44, 16  # characters of one cycle; where the terminal is narrow
_BESIDE = 36  # name and range of a line


def force_sheets(rows: Sequence[Row], strokes: Sequence[str] = _BOTH) -> list[Sheet]:
    """Return the forces at all speeds and the click at the fastest, a table a stroke.

    Parameters
    ----------
    rows : sequence of mapping
        Of the table "adjustment".
    strokes : sequence of str
        Which to show.
    """
    sheets = [_force_by_speed(rows, stroke) for stroke in strokes if rows]
    # A note stands once, below the last table.
    return [*(replace(one, notes=()) for one in sheets[:-1]), *sheets[-1:]]


def _force_by_speed(rows: Sequence[Row], stroke: str) -> Sheet:
    table = {
        (row["setting"], row.get("changed"), row["speed_m_per_s"]): row
        for row in rows
        if row["stroke"] == stroke
    }
    speeds = sorted({speed for *_, speed in table}) or [0.0]
    places = _places(table)
    click = _click_headings(rows, places)

    def cells(setting: Any, changed: str | None) -> tuple[str, ...]:
        known = [table.get((setting, changed, speed), {}) for speed in speeds]
        slower = (_force(row, has_error=False) for row in known[:-1])
        return (*slower, *_force_and_click(known[-1])[: 1 + len(click)])

    return Sheet(
        headings=(STROKE_WORDS[stroke], *map("{:.3g}".format, speeds), *click),
        units=("N at", *("m/s" for _ in speeds[1:]), "m/s ±95 %", *_CLICK_UNITS[: len(click)]),
        rows=tuple((_words(*place), *cells(*place)) for place in places),
        is_number=(True,) * (1 + len(speeds) + len(click)),
        notes=(*(_notes_on_clicks(places) if click else ()), *_marks(rows)),
    )


def force_by_setting_sheet(rows: Sequence[Row], strokes: Sequence[str] = _BOTH) -> Sheet:
    """Return force and change by click at one speed, the fastest of the rows.

    Parameters
    ----------
    rows : sequence of mapping
        Of the table "adjustment".
    strokes : sequence of str
        Which to show, beside each other.
    """
    fastest = max((row["speed_m_per_s"] for row in rows), default=0.0)
    table = {
        (row["setting"], row.get("changed"), row["stroke"]): row
        for row in rows
        if row["speed_m_per_s"] == fastest
    }
    places = _places(table)
    click = _click_headings(rows, places)
    n = 1 + len(click)
    return Sheet(
        headings=("set", *(cell for one in strokes for cell in (STROKE_WORDS[one], *click))),
        units=("", *(("N ±95 %", *_CLICK_UNITS[: len(click)]) * len(strokes))),
        rows=tuple(
            (
                _words(*place),
                *(
                    cell
                    for one in strokes
                    for cell in _force_and_click(table.get((*place, one), {}))[:n]
                ),
            )
            for place in places
        ),
        is_number=(True,) * (1 + n * len(strokes)),
        notes=(
            f"at {fastest:g} m/s",
            *(_notes_on_clicks(places) if click else ()),
            *_marks(table.values()),
        ),
    )


def _force_and_click(row: Row) -> tuple[str, str, str]:
    """Return force and change, each with its 95 % interval, and the change in per cent."""
    change = with_interval(
        *(row.get(name) for name in ("change_N", "change_ci_low_N", "change_ci_high_N")), plus="+"
    )
    share = row.get("change_percent")
    return _force(row), change, NOTHING if share is None else f"{share:+.1f}"


def _force(row: Row, *, has_error: bool = True) -> str:
    """Return the force, marked where it was measured."""
    limits = [row.get(name) for name in ("force_N", "force_ci_low_N", "force_ci_high_N")]
    mark = "*" if row.get("origin") == "measured" else ""
    if has_error:
        return with_interval(*limits, digits=4) + mark
    return number(limits[0], digits=4) + mark


def _places(rows: Iterable[tuple[Any, str | None, Any]]) -> list[tuple[Any, str | None]]:
    """Return settings in order; with several adjusters one for each that was turned."""
    known = {(setting, changed) for setting, changed, _ in rows}
    return sorted(known, key=lambda one: (Setting.of(one[0]), one[1] or ""))


def _words(setting: Any, changed: str | None) -> str:
    several = changed is not None and " " in str(setting)
    return f"{setting}, {changed}" if several else str(setting)


def _click_headings(rows: Iterable[Row], places: Places) -> tuple[str, ...]:
    """Return the headings of what a click changes; none where no setting has a neighbour."""
    if all(row.get("change_N") is None for row in rows):
        return ()
    return ("change" if _wide_steps(places) else "click", "")


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
    return (_AS_MEASURED,) if any(row.get("origin") == "measured" for row in rows) else ()


def measured_force_sheet(rows: Sequence[Row]) -> Sheet:
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
    missed = {
        (row["setting"], row["speed_m_per_s"]) for row in known if row.get("origin") == "measured"
    }
    places = sorted(
        {(a, b) for a, b, _ in table if b == fastest or (a, b) in missed},
        key=lambda place: (Setting.of(place[0]), place[1]),
    )

    def cells(row: Row) -> tuple[str, str, str]:
        if not row:
            return (NOTHING,) * 3
        measured, difference = row["measured_N"], row["difference_N"]
        mark = "*" if row.get("origin") == "measured" else ""
        modelled = number(measured - difference, digits=4)
        return number(measured, digits=4) + mark, modelled, f"{difference:+.1f}"

    return Sheet(
        headings=("set", "speed", *(STROKE_WORDS[one] for one in _BOTH for _ in range(3))),
        units=("", "m/s", *("measured", "model", "diff.") * 2),
        rows=tuple(
            (
                *(str(setting), f"{speed:g}"),
                *(c for one in _BOTH for c in cells(table.get((setting, speed, one), {}))),
            )
            for setting, speed in places
        ),
        is_number=(True,) * 8,
        notes=(
            "force in N, mean of all compared cycles, beside the model's on the same cycles",
            *_marks(known),
        ),
    )


def log_force_sheet(rows: Sequence[Row]) -> Sheet:
    """Return the forces of one log, measured beside simulated: at named speeds, and peaks.

    Parameters
    ----------
    rows : sequence of mapping
        Of the table "characteristics", of one segment.
    """
    peak = next(row for row in rows if row["point"] == "peak")
    named = [(f"at {one['speed_rebound_m_per_s']:g} m/s", one) for one in rows if one is not peak]

    def pair(name: str, row: Row) -> tuple[str, ...]:
        forces = {
            (stroke, whose): row[f"{whose}_{stroke}_N"]
            for stroke in _BOTH
            for whose in ("measured", "simulated")
        }
        ratios = (
            stroke_ratio(forces["rebound", whose], forces["bump", whose])
            for whose in ("measured", "simulated")
        )
        return (name, *(number(force, digits=4) for force in forces.values()), *ratios)

    lost = [
        number(_rounded(peak[f"{whose}_hysteresis_{stroke}_N"]), digits=4)
        for stroke in _BOTH
        for whose in ("measured", "simulated")
    ]
    hysteresis = f"hysteresis, {number(peak['hysteresis_speed_m_per_s'], digits=2)} m/s"
    warmth = peak["temperature_degC"]
    temperature = f"Temperature: {'not logged' if warmth is None else f'{warmth:.1f} degC'}"
    energy = [number(peak[f"{w}_energy_J"], digits=4) for w in ("measured", "simulated")]
    return Sheet(
        headings=(
            "force, N",
            *(STROKE_WORDS[one] for one in _BOTH for _ in "ms"),
            "ratio",
            "ratio",
        ),
        units=("", *("measured", "simulated") * 3),
        rows=(
            *(pair(name, row) for name, row in named),
            pair("peak", peak),
            (hysteresis, *lost, "", ""),
        ),
        is_number=(False, *(True,) * 6),
        notes=(
            f"Energy per cycle: {energy[0]} J measured, {energy[1]} J simulated. {temperature}.",
        ),
    )


def _rounded(force: float | None) -> float | None:
    return None if force is None else round(force, 6) + 0.0  # what is left of a sum that is zero


def segment_sheet(rows: Sequence[Row], *, has_setting: bool) -> Sheet:
    """Return peak force against peak speed (PVP), energy, hysteresis: a row a segment.

    Parameters
    ----------
    rows : sequence of mapping
        Of the table "characteristics".
    has_setting : bool
        Of all settings, by setting and speed; else of one log, as it ran.
    """
    peaks = [row for row in rows if row["point"] == "peak"]
    if has_setting:
        peaks.sort(
            key=lambda row: (Setting.of(row["setting"]), row["speed_rebound_m_per_s"] or 0.0)
        )
    more = len(peaks) - _MOST
    pairs = ("rebound", "compression", "energy", "hyst. rebound", "hyst. compression")
    names = ("{}_rebound_N", "{}_bump_N", "{}_energy_J", "{}_hysteresis_rebound_N",
             "{}_hysteresis_bump_N")  # fmt: skip
    return Sheet(
        headings=(
            *(["setting"] if has_setting else ["from"]),
            *("cycles", "freq.", "speed", *(name for name in pairs for _ in "ms")),
        ),
        units=(
            *("" if has_setting else "s", "", "Hz", "m/s"),
            *(f"{word}, {'J' if one == 'energy' else 'N'}" for one in pairs
              for word in ("measured", "simulated")),
        ),
        rows=tuple(
            (
                str(row["setting"]) if has_setting else number(row["start_s"], digits=4),
                str(row["cycles"]) if row["cycles"] else "moving",
                number(row["frequency_Hz"], digits=3),
                number(_fastest(row, "speed_{}_m_per_s"), digits=3),
                *(
                    number(row[name.format(whose)], digits=3 if "hysteresis" in name else 4)
                    for name in names
                    for whose in ("measured", "simulated")
                ),
            )
            for row in peaks[:_MOST]
        ),
        is_number=(True,) * 14,
        notes=(_SEGMENTS, *([f"{more} more in characteristics.csv"] if more > 0 else [])),
    )  # fmt: skip


def measured_segment_sheet(entries: Sequence[Row]) -> Sheet:
    """Return a row a segment of all logs: what was measured, and the MSE of the fit.

    Parameters
    ----------
    entries : sequence of mapping
        As in run.json, "stretches".
    """
    more = len(entries) - _MOST
    return Sheet(
        headings=(
            *("setting", "log", "cycles", "freq.", "speed", "rebound", "compression", "energy"),
            *("hyst. rebound", "hyst. compression", "MSE"),
        ),
        units=("", "", "", "Hz", "m/s", "N", "N", "J", "N", "N", "%"),
        rows=tuple(
            (
                *(str(one["setting"]), str(one["log"])),
                str(one["cycles"]) if one.get("cycles") else "moving",
                number(one.get("frequency_Hz"), digits=3),
                number(_fastest(one, "peak_speed_{}_m_per_s"), digits=3),
                number(one.get("peak_force_rebound_N"), digits=4),
                number(one.get("peak_force_bump_N"), digits=4),
                number(one.get("energy_J"), digits=4),
                number(one.get("hysteresis_rebound_N"), digits=3),
                number(one.get("hysteresis_bump_N"), digits=3),
                percent(one.get("mse_percent")),
            )
            for one in entries[:_MOST]
        ),
        is_number=(True, False, *(True,) * 9),
        notes=(_SEGMENTS, *([f"{more} more in run.json"] if more > 0 else [])),
    )


def _fastest(row: Row, name: str) -> float | None:
    speeds = (row.get(name.format(stroke)) for stroke in _BOTH)
    return max((speed for speed in speeds if speed is not None), default=None)


def curve_sheet(logs: Iterable[Row]) -> Sheet:
    """Return one row per curve and stroke of the files without time; no rows without.

    Parameters
    ----------
    logs : iterable of mapping
        Facts of `damperfit.run.logs.LogFacts`, also of logs with time.
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
    """Return one row per member: peaks, hysteresis, energy, cavitation."""
    return Sheet(
        headings=("factor", name, "peak", "peak", "hyst.", "hyst.", "energy", "cavitation"),
        units=("", unit, *("rebound N", "compr. N") * 2, "J", "% of cycle"),
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
    )


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
    dry = [
        f"chamber {i} for {100.0 * share:.1f} % of the cycle at x{member.factor:g}"
        for member in ranked
        for i, share in enumerate(member.figures.cavitation_shares, start=1)
        if share > 0.0
    ]
    cavitation = f"cavitation: {', '.join(dry)}" if dry else "no chamber cavitates"
    if len(ranked) == 1:
        return f"{name} x{first.factor:g}: {cavitation}."

    def change(words: str, get: Callable[[Characteristics], float]) -> str:
        before, after = abs(get(first.figures)), abs(get(last.figures))
        gain = round(100.0 * (after / before - 1.0), 1) + 0.0 if before > 0.0 else None
        share = "" if gain is None else f" ({gain:+.1f} %)"
        return f"{words} {number(before, digits=4)} to {number(after, digits=4)} N{share}"

    changes = (
        change("peak rebound", lambda f: f.peak_force_rebound),
        change("peak compression", lambda f: f.peak_force_bump),
        change("hysteresis in rebound", lambda f: f.hysteresis_rebound),
        change("in compression", lambda f: f.hysteresis_bump),
    )
    return f"{name} x{first.factor:g} to x{last.factor:g}: {', '.join(changes)}; {cavitation}."
