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
    first_of,
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
    Place = tuple[Any, str | None]  # a setting, and the adjuster that was turned

STROKE_WORDS = {"rebound": "rebound", "bump": "compression"}  # keys are the paper's, words people's
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


def force_sheets(rows: Sequence[Row], strokes: Iterable[str] = STROKE_WORDS) -> list[Sheet]:
    """Return the forces at all speeds and the click at the fastest, a table a stroke."""
    speeds = sorted({row["speed_m_per_s"] for row in rows})
    sheets = [_by_setting(rows, (stroke,), speeds) for stroke in strokes if rows]
    # A note stands once, below the last table.
    return [*(replace(one, notes=()) for one in sheets[:-1]), *sheets[-1:]]


def force_by_setting_sheet(rows: Sequence[Row], strokes: Iterable[str] = STROKE_WORDS) -> Sheet:
    """Return force and change by click at the fastest speed of the rows, strokes side by side."""
    strokes = list(strokes)
    fastest = max((row["speed_m_per_s"] for row in rows), default=0.0)
    known = [row for row in rows if row["speed_m_per_s"] == fastest]
    sheet = _by_setting(known, strokes, [fastest])
    heads = list(sheet.headings[1:])
    heads[:: len(heads) // len(strokes)] = [STROKE_WORDS[one] for one in strokes]
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
    lines = lines_of([setting for setting, _ in places])
    steps = ((a, b, clicks_between(a, b) or 0.0)
             for line in lines for a, b in itertools.pairwise(line.settings))  # fmt: skip
    wide = [step for step in steps if step[2] > 1.0]
    columns = [Column(STROKE_WORDS[strokes[0]], "N at", _words)]

    def add(heading: str, unit: str, stroke: str, speed: float, cell: Callable[[Row], str]) -> None:
        columns.append(
            Column(heading, unit, lambda place: cell(table.get((*place, stroke, speed), {})))
        )

    def bare_force(row: Row) -> str:
        return number(row.get("force_N"), digits=4) + _mark(row)

    def force(row: Row) -> str:
        limits = [row.get(name) for name in ("force_N", "force_ci_low_N", "force_ci_high_N")]
        return with_interval(*limits, digits=4) + _mark(row)

    def change(row: Row) -> str:
        names = ("change_N", "change_ci_low_N", "change_ci_high_N")
        return with_interval(*(row.get(name) for name in names), plus="+")

    def change_percent(row: Row) -> str:
        share = row.get("change_percent")
        return NOTHING if share is None else f"{share:+.1f}"

    for stroke in strokes:
        for speed in speeds[:-1]:
            add(f"{speed:.3g}", "m/s", stroke, speed, bare_force)
        last = speeds[-1]
        add(f"{last:.3g}", "m/s ±95 %", stroke, last, force)
        if has_click:
            add("change" if wide else "click", "N ±95 %", stroke, last, change)
            add("", "%", stroke, last, change_percent)
    notes = _notes_on_clicks(places, wide) if has_click else []
    return laid_out(places, columns, *notes, *_marks(rows))


def _words(place: Place) -> str:
    setting, changed = str(place[0]), place[1]
    return f"{setting}, {changed}" if changed is not None and " " in setting else setting


def _mark(row: Row) -> str:
    return "*" if row.get("origin") == "measured" else ""


def _marks(rows: Iterable[Row]) -> list[str]:
    return [_AS_MEASURED] if any(map(_mark, rows)) else []


def _notes_on_clicks(places: Sequence[Place], wide: Sequence[tuple[Any, Any, float]]) -> list[str]:
    notes = []
    if wide:
        named = ", ".join(f"{a} to {b} ({n:g} clicks)" for a, b, n in wide[:_MOST_STEPS])
        more = f" and {len(wide) - _MOST_STEPS} more" if len(wide) > _MOST_STEPS else ""
        notes.append(f"change: over all clicks from one tested setting to the next: {named}{more}")
    marked = next((one for one in places if _words(one) != str(one[0])), None)
    if marked is not None:
        notes.append(
            f'"{_words(marked)}": the change when {marked[1]} alone is turned; the forces of a '
            "setting are the same in its rows"
        )
    return [*notes, _OF_DAMPING]


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

    def model(row: Row) -> str:
        return number(row["measured_N"] - row["difference_N"], digits=4)

    def difference(row: Row) -> str:
        return f"{round(row['difference_N'], 1) + 0.0:+.1f}"

    def column(stroke: str, heading: str, text: Callable[[Row], str]) -> Column:
        def cell(place: tuple[Any, float]) -> str:
            row = table.get((*place, stroke))
            return text(row) if row else NOTHING

        return Column(STROKE_WORDS[stroke], heading, cell)

    columns = [
        Column("set", "", lambda place: str(place[0])),
        Column("speed", "m/s", lambda place: f"{place[1]:g}"),
    ]
    texts = {"measured": measured, "model": model, "diff.": difference}
    columns += [column(stroke, *one) for stroke in STROKE_WORDS for one in texts.items()]
    note = "force in N ±95 %, mean of all compared cycles, beside the model's on the same cycles"
    return laid_out(places, columns, note, *_marks(known))


# Of logs and segments: rows of the table "characteristics"


def log_force_sheet(rows: Sequence[Row]) -> Sheet:
    """Return the forces of one segment, measured beside simulated: at named speeds, and peaks."""
    peak = next(row for row in rows if row["point"] == "peak")

    def pair(name: str, row: Row) -> tuple[str, ...]:
        forces = [row[f"{whose}_{stroke}_N"] for stroke in STROKE_WORDS for whose in _WHOSE]
        ratios = map(stroke_ratio, forces[:2], forces[2:])
        return (name, *(number(force, digits=4) for force in forces), *ratios)

    lost = [peak[f"{whose}_hysteresis_{stroke}_N"] for stroke in STROKE_WORDS for whose in _WHOSE]
    # What is left of a sum that is zero is zero.
    lost = [None if force is None else round(force, 6) + 0.0 for force in lost]
    hysteresis = f"hysteresis, {number(peak['hysteresis_speed_m_per_s'], digits=2)} m/s"
    heat = peak["temperature_degC"]
    temperature = f"Temperature: {'not logged' if heat is None else f'{heat:.1f} degC'}"
    energy = [number(peak[f"{whose}_energy_J"], digits=4) for whose in _WHOSE]
    named = [row for row in rows if row is not peak]
    return Sheet(
        ("force, N", *(word for word in STROKE_WORDS.values() for _ in _WHOSE), "ratio", "ratio"),
        ("", *_WHOSE * 3),
        (
            *(pair(f"at {row['speed_rebound_m_per_s']:g} m/s", row) for row in named),
            pair("peak", peak),
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
        logs = {(row["setting"], row.get("log")) for row in peaks}
        first = [Column.text("setting", "setting", is_number=True)]
        first += [Column.text("log", "log")] * (len(logs) > len({one for one, _ in logs}))
        peaks.sort(
            key=lambda row: (Setting.of(row["setting"]), row["speed_rebound_m_per_s"] or 0.0)
        )

    def fastest(row: Row) -> str:
        speeds = [row[f"speed_{stroke}_m_per_s"] for stroke in STROKE_WORDS]
        return number(max((one for one in speeds if one is not None), default=None), digits=3)

    def error(row: Row) -> str:
        return percent((errors or {}).get((str(row["setting"]), row["log"], row["start_s"])))

    columns = [
        *first,
        Column("cycles", "", lambda row: str(row["cycles"]) if row.get("cycles") else "moving"),
        Column.of("freq.", "Hz", "frequency_Hz", digits=3),
        Column("speed", "m/s", fastest),
        *(
            Column.of(heading, f"{whose}, {unit}", f"{whose}_{name}_{unit}", digits=digits)
            for heading, name, unit, digits in (
                ("rebound", "rebound", "N", 4),
                ("compression", "bump", "N", 4),
                ("energy", "energy", "J", 4),
                ("hyst. rebound", "hysteresis_rebound", "N", 3),
                ("hyst. compression", "hysteresis_bump", "N", 3),
            )
            for whose in _WHOSE
        ),
        *([Column("MSE", "%", error)] if errors else []),
    ]
    shown, more = first_of(peaks, _MOST, "in characteristics.csv")
    return laid_out(shown, columns, _SEGMENTS, *more)
