"""Tables of forces: by setting and click, measured beside the model, of logs and segments."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace
from typing import TYPE_CHECKING, Any

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
from damperfit.statistics import NORMAL_95
from damperfit.tested.setting import Setting, clicks_between, lines_of

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping, Sequence

    Row = Mapping[str, Any]
    Places = Sequence[tuple[Any, str | None]]

STROKE_WORDS = {"rebound": "rebound", "bump": "compression"}  # keys are the paper's, words people's
_BOTH = ("rebound", "bump")
_WHOSE = ("measured", "simulated")
_OF_DAMPING = "% of the damping: of the force less the gas force at mid-stroke"
_AS_MEASURED = "* measured: the model misses the force there by more than 2 %"
_SEGMENTS = (
    "Mean of the cycles; where nothing repeats the extremes, and the energy of all of it. "
    "Hysteresis: opening less closing force at half of the lower peak speed."
)
_MOST = 60  # segments that have a row
_MOST_STEPS = 5  # steps of several clicks that are named


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
    heads = list(sheet.headings[1:])
    heads[::n] = [STROKE_WORDS[one] for one in strokes]
    units = ("", *(one.replace("m/s", "N") for one in sheet.units[1:]))
    notes = (f"at {fastest:g} m/s", *sheet.notes)
    return replace(sheet, headings=("set", *heads), units=units, notes=notes)


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

    def add(heading: str, unit: str, key: tuple[str, float], cell: Callable[[Row], str]) -> None:
        columns.append(Column(heading, unit, lambda place: cell(table.get((*place, *key), {}))))

    for stroke in strokes:
        for speed in speeds[:-1]:
            add(f"{speed:.3g}", "m/s", (stroke, speed), _bare_force)
        fastest = (stroke, speeds[-1])
        add(f"{speeds[-1]:.3g}", "m/s ±95 %", fastest, _force)
        if has_click:
            add("change" if _wide_steps(places) else "click", "N ±95 %", fastest, _change)
            add("", "%", fastest, _change_percent)
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


def _marks(rows: Iterable[Row]) -> tuple[str, ...]:
    return (_AS_MEASURED,) if any(map(_mark, rows)) else ()


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

    def measured(row: Row) -> str:
        force, reach = row["measured_N"], NORMAL_95 * (row.get("measured_se_N") or math.nan)
        return with_interval(force, force - reach, force + reach, digits=4) + _mark(row)

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
            column(stroke, "measured", measured),
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

    def pair(name: str, row: Row) -> tuple[str, ...]:
        forces = [row[f"{whose}_{stroke}_N"] for stroke in _BOTH for whose in _WHOSE]
        ratios = map(stroke_ratio, forces[:2], forces[2:])
        return (name, *(number(force, digits=4) for force in forces), *ratios)

    lost = [peak[f"{whose}_hysteresis_{stroke}_N"] for stroke in _BOTH for whose in _WHOSE]
    # What is left of a sum that is zero is zero.
    lost = [None if force is None else round(force, 6) + 0.0 for force in lost]
    hysteresis = f"hysteresis, {number(peak['hysteresis_speed_m_per_s'], digits=2)} m/s"
    heat = peak["temperature_degC"]
    temperature = f"Temperature: {'not logged' if heat is None else f'{heat:.1f} degC'}"
    energy = [number(peak[f"{whose}_energy_J"], digits=4) for whose in _WHOSE]
    named = (pair(f"at {one['speed_rebound_m_per_s']:g} m/s", one)
             for one in rows if one is not peak)  # fmt: skip
    return Sheet(
        ("force, N", *(STROKE_WORDS[one] for one in _BOTH for _ in _WHOSE), "ratio", "ratio"),
        ("", *_WHOSE * 3),
        (
            *(*named, pair("peak", peak)),
            (hysteresis, *(number(force, digits=4) for force in lost), "", ""),
        ),
        (False, *(True,) * 6),
        (f"Energy per cycle: {energy[0]} J measured, {energy[1]} J simulated. {temperature}.",),
    )


def segment_sheet(
    rows: Sequence[Row], *, has_setting: bool, errors: Mapping[tuple[Any, ...], Any] | None = None
) -> Sheet:
    """Return peak force against peak speed (PVP), energy, hysteresis: a row a segment.

    Of all settings, by setting and speed; else of one log, as it ran. ``errors`` are MSEs of the
    fit in per cent, by setting, log and begin.
    """
    peaks = [row for row in rows if row["point"] == "peak"]
    first = [Column.of("from", "s", "start_s")]
    if has_setting:
        first = [Column.text("setting", "setting", is_number=True)]
        logs = {(row["setting"], row.get("log")) for row in peaks}
        first += [Column.text("log", "log")] * (len(logs) > len({one for one, _ in logs}))
        peaks.sort(
            key=lambda row: (Setting.of(row["setting"]), row["speed_rebound_m_per_s"] or 0.0)
        )
    pairs = [
        Column.of(heading, f"{whose}, {unit}", f"{whose}_{name}_{unit}", digits=digits)
        for heading, name, unit, digits in (
            ("rebound", "rebound", "N", 4),
            ("compression", "bump", "N", 4),
            ("energy", "energy", "J", 4),
            ("hyst. rebound", "hysteresis_rebound", "N", 3),
            ("hyst. compression", "hysteresis_bump", "N", 3),
        )
        for whose in _WHOSE
    ]
    columns = [*first, *_motion(), *pairs]
    if errors:
        columns.append(
            Column(
                "MSE",
                "%",
                lambda row: percent(errors.get((str(row["setting"]), row["log"], row["start_s"]))),
            )
        )
    more = len(peaks) - _MOST
    notes = (_SEGMENTS, *([f"{more} more in characteristics.csv"] if more > 0 else []))
    return laid_out(peaks[:_MOST], columns, *notes)


def _motion() -> list[Column]:
    """Cycles, frequency and peak speed of a segment."""

    def fastest(row: Row) -> str:
        speeds = [row[f"speed_{stroke}_m_per_s"] for stroke in _BOTH]
        return number(max((one for one in speeds if one is not None), default=None), digits=3)

    return [
        Column("cycles", "", lambda row: str(row["cycles"]) if row.get("cycles") else "moving"),
        Column.of("freq.", "Hz", "frequency_Hz", digits=3),
        Column("speed", "m/s", fastest),
    ]
