"""Tables of a run: parameters, MSE, checks, forces by setting and click, segments, structures."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

from damperfit.adjustment.force_at import STROKE_WORDS
from damperfit.checks import Check
from damperfit.damper.model import SETTING, Quantity
from damperfit.problem import in_a_row, listed_names
from damperfit.reporting.records import entries_in, listed_in, number_in
from damperfit.reporting.sheet import (
    NOTHING,
    Column,
    Sheet,
    first_of,
    laid_out,
    number,
    percent,
    with_interval,
)
from damperfit.statistics import NORMAL_95
from damperfit.tables.columns import PAPER_QUANTITIES
from damperfit.tested.setting import ADJUSTER, Setting, clicks_between, lines_of
from damperfit.units.shown_units import SI, ShownUnits

Row = Mapping[str, Any]
Place = tuple[Any, str | None]  # a setting, and the adjuster that was turned


_SHORT = 5  # letters of a unit that fits over a column
_SAME = 1e-9  # of a value that went through a file
# Within this factor of a bound a value at its bound is shown as the bound.
_AT_BOUND = 2.0
_MARKS = {
    "absent": ("none", "does nothing here, the model is fitted without it"),
    "fixed": ("f", "fixed"),
    "shared": ("s", "shared by all settings"),
    "at_bound": ("!", "at its bound"),
    "not_identifiable": ("?", "not determined by these logs"),
}
_BY_CLICK = "shared by all settings, or by those with the same click of its adjuster"
_OF_MISFIT = "intervals include noise and lack of fit; parameters.csv has both"
_WITHOUT_VALUE = {"absent", "at_bound", "not_identifiable"}
_GRADES = ("excellent", "good", "poor", "withheld")
_CHECK_WORDS = {True: "passed", False: "FAILED", None: "not evaluated"}
BLOCK_LEVELS = "▁▂▃▄▅▆▇█"
ASCII_LEVELS = ".:-=+*#@"  # for terminals and files that know nothing else: more ink is more
_FEWEST, _MOST = 3, 60  # settings that a sparkline is drawn of


class Shown:
    """How a quantity is shown: in which unit, to which power of ten, and its value in a row."""

    def __init__(self, quantity: Quantity, units: ShownUnits = SI) -> None:
        is_converted = quantity.unit == "N" != units.of("N")  # of resistances nothing else is usual
        unit_text = units.of("N") if is_converted else quantity.shown_unit
        has_power = unit_text[:2] == "10"  # "10³ s √N / (m kg)" is for an axis alone
        self.quantity, self.name, self.symbol = quantity, quantity.name, quantity.symbol
        unit = unit_text if unit_text and not has_power else quantity.unit
        self.unit = "" if unit == "1" else unit
        self.axis, self.power = unit_text or self.unit, quantity.power
        self.factor = 10.0**-quantity.power  # from SI to what is shown
        if is_converted:
            self.factor = units.show(self.factor, "N")

    @property
    def short_unit(self) -> str:
        """For the head of a narrow column."""
        if len(self.unit) <= _SHORT:
            return self.unit
        return f"1e{self.power}" if self.power else "SI"

    def say(self, text: str) -> str:
        """Return a shown value, with or without its interval, and its unit."""
        if len(self.unit) <= _SHORT:
            return f"{text} {self.unit}".rstrip()
        if "(" in text:
            return f"{text} times 1e{self.power} {self.unit}"
        return f"{f'({text})' if ' ' in text else text}e{self.power} {self.unit}"

    def status(self, row: Row) -> str | None:
        """Return the status of the value."""
        status: str | None = row[f"{self.name}_status"]
        return status

    def value(self, row: Row) -> str:
        """Return the value with its 95 % interval."""
        numbers = (row[self.name], row.get(f"{self.name}_ci_low"), row.get(f"{self.name}_ci_high"))
        shown = (None if value is None else self.factor * value for value in numbers)
        return with_interval(*shown, digits=4)

    def bound(self, row: Row) -> str:
        """Return a value at a bound as the limit it ran into; empty where it is far from it."""
        value, (low, high) = row[self.name], self.quantity.plausible
        if value is None or self.status(row) != "at_bound" or not self.quantity.is_logarithmic:
            return ""
        if value < _AT_BOUND * low:
            return f"<{max(value, low) * self.factor:.2g}"
        return f">{min(value, high) * self.factor:.2g}" if value > high / _AT_BOUND else ""

    def cell(self, row: Row) -> str:
        """Return the value with the mark of its status."""
        mark, _ = _MARKS.get(self.status(row) or "", ("", ""))
        if self.status(row) in {"absent", "not_identifiable"}:
            return mark  # a number would look determined
        return f"{self.bound(row) or self.value(row)} {mark}".rstrip()

    def is_idle(self, row: Row) -> bool:
        """Whether it is fixed at its default, or has no effect."""
        value, quantity = row[self.name], self.quantity
        is_default = quantity.default is not None and value in (None, quantity.default)
        is_nothing = quantity.may_vanish and value is not None and value <= quantity.plausible[0]
        return (is_default or is_nothing) and self.status(row) in ("fixed", None)


# Parameters


def parameter_sheet(
    rows: Sequence[Row],
    quantities: Sequence[Quantity] = PAPER_QUANTITIES,
    *,
    levels: str = "",
    units: ShownUnits = SI,
) -> Sheet:
    """Return one row per setting: parameters with their 95 % intervals, MSE, grade, remarks.

    What all settings share is a note below, a quantity fixed at its default everywhere is left out.
    ``levels`` are the characters, from low to high, of a sparkline over the settings.
    """
    by_setting, notes = [], []
    for quantity in (Shown(quantity, units) for quantity in quantities):
        if rows and all(map(quantity.is_idle, rows)):
            continue
        # A quantity of the setting keeps its column, unless it is one fitted value for all.
        is_shared = all(quantity.status(row) == "shared" for row in rows)
        is_own = quantity.quantity.scope == SETTING and quantity.quantity.default is None
        if (is_shared or not is_own) and is_one_for_all(rows, quantity.name):
            row = next(row for row in rows if row[quantity.name] is not None)
            status = "shared by all settings" if quantity.status(row) == "shared" else "fixed"
            notes.append(f"{quantity.symbol} = {quantity.say(quantity.value(row))}, {status}")
        else:
            by_setting.append(quantity)

    def unit(quantity: Shown) -> str:
        mark = " ±95 %" * any(" " in quantity.value(row) for row in rows)
        return f"{quantity.short_unit}{mark}".strip()

    columns = [
        Column.text("set", "setting", is_number=True),
        *(Column(quantity.symbol, unit(quantity), quantity.cell) for quantity in by_setting),
        Column("MSE", "%", lambda row: percent(row["mse_percent"])),
        Column.text("grade", "grade", missing=NOTHING),
    ]
    if any(map(remarks_on, rows)):
        columns.append(Column("remarks", "", remarks_on, is_number=False))
    sparklines = _sparklines(rows, by_setting, levels) if levels else ()
    return laid_out(rows, columns, *notes, *sparklines, *_legend(rows, by_setting))


def is_one_for_all(rows: Sequence[Row], name: str) -> bool:
    """Whether settings have one value, shared or fixed, and none by a fit of its own."""
    filled = [row for row in rows if row[name] is not None]
    values = [row[name] for row in filled]
    is_common = {row[f"{name}_status"] for row in filled} <= {"fixed", "shared"}
    return bool(values) and is_common and max(values) - min(values) <= _SAME * abs(values[0])


def parameter_line(
    row: Row, quantities: Sequence[Quantity] = PAPER_QUANTITIES, units: ShownUnits = SI
) -> str:
    """Return the parameters of one setting in a sentence, without those that have no value."""
    phrases = []
    for quantity in (Shown(quantity, units) for quantity in quantities):
        status = quantity.status(row)
        if row[quantity.name] is None or quantity.is_idle(row):
            continue
        if status == "absent":
            phrases.append(f"no {quantity.quantity.label}")
        elif status == "not_identifiable":
            phrases.append(f"{quantity.symbol} cannot be determined")
        elif bound := quantity.bound(row):
            words = "below" if bound.startswith("<") else "above"
            phrases.append(f"{quantity.symbol} {words} {quantity.say(bound[1:])} (at bound)")
        else:
            words = "" if status in {"fitted", None} else f" ({status.replace('_', ' ')})"
            phrases.append(f"{quantity.symbol} = {quantity.say(quantity.value(row))}{words}")
    return f"{', '.join(phrases)}." if phrases else ""


def _legend(rows: Sequence[Row], quantities: Sequence[Shown]) -> Iterator[str]:
    """Yield what units and marks of a table of parameters mean."""
    groups: dict[str, list[str]] = {}
    for quantity in quantities:
        if quantity.short_unit != quantity.unit:
            power = f"1e{quantity.power} " if quantity.power else ""
            groups.setdefault(f"{power}{quantity.unit}", []).append(quantity.symbol)
    if groups:
        yield ", ".join(f"{in_a_row(symbols)} in {unit}" for unit, symbols in groups.items())
    statuses = {quantity.status(row) for row in rows for quantity in quantities}
    marks = {key: f"{mark} {words}" for key, (mark, words) in _MARKS.items() if key in statuses}
    for quantity in quantities:
        if len({row[quantity.name] for row in rows if quantity.status(row) == "shared"}) > 1:
            marks["shared"] = f"s {_BY_CLICK}"
    if marks:
        yield ", ".join(marks.values())
    if any(row.get(f"{quantity.name}_misfit_se") for row in rows for quantity in quantities):
        yield _OF_MISFIT


def sparkline(values: Iterable[float | None], *, levels: str = BLOCK_LEVELS) -> str:
    """Return one character a value, the lowest and the highest at the ends of ``levels``.

    A missing value is a blank. Equal values are drawn at the middle level.

    Examples
    --------
    >>> sparkline([1.0, 2.0, None, 3.0, 8.0]), sparkline([5.0, 5.0], levels=ASCII_LEVELS)
    ('▁▂ ▃█', '++')
    """
    numbers = [math.nan if value is None else float(value) for value in values]
    finite = [value for value in numbers if math.isfinite(value)] or [0.0]
    low, span, n = min(finite), max(finite) - min(finite), len(levels)

    def level(value: float) -> int:
        return min(n - 1, int((value - low) / span * n)) if span else n // 2

    return "".join(levels[level(value)] if math.isfinite(value) else " " for value in numbers)


def _sparklines(rows: Sequence[Row], quantities: Sequence[Shown], levels: str) -> Iterator[str]:
    """Yield each parameter over the settings as one line, and the MSE, which spans decades."""
    errors = [row["mse_percent"] for row in rows]
    finite = [error for error in errors if error is not None]
    if len(finite) < _FEWEST or len(rows) > _MOST:
        return
    for quantity in quantities:
        points = {
            k: (row[quantity.name], row[f"{quantity.name}_se"] or 0.0)
            for k, row in enumerate(rows)
            if quantity.status(row) not in _WITHOUT_VALUE and row[quantity.name] is not None
        }
        if len(points) < _FEWEST:
            continue
        # Scaled to the height of a line, noise would look like a trend.
        pairs = itertools.combinations(points.values(), 2)
        is_flat = not any(abs(a - b) > math.hypot(e, f) for (a, e), (b, f) in pairs)
        heights = [0.0 if is_flat else points.get(k, (None,))[0] for k in range(len(rows))]
        values = [quantity.factor * value for value, _ in points.values()]
        span = f"{number(min(values), digits=4)} to {number(max(values), digits=4)}"
        flat = ", drawn flat: within their standard errors" if is_flat else ""
        line = sparkline(heights, levels=levels)
        yield f"{quantity.symbol:<4} {line}  {span} {quantity.short_unit}".rstrip() + flat
    line = sparkline([math.log10(error) if error else None for error in errors], levels=levels)
    span = f"{percent(min(finite))} to {percent(max(finite))} %, logarithmic"
    yield f"{'MSE':<4} {line}  {span}"


def remarks_on(row: Row, quantities: Sequence[Quantity] = ()) -> str:
    """Return what limits the fit of a setting; of these quantities also which are at a bound."""
    outcome = (row.get("outcome") or "outcome unknown").replace("_", " ")
    share = row.get("cavitation_fraction")
    remarks = [] if outcome == "converged" or (outcome == "cavitating" and share) else [outcome]
    for word in ("at bound", "not identifiable"):
        status = word.replace(" ", "_")
        symbols = [q.symbol for q in quantities if row.get(f"{q.name}_status") == status]
        if symbols:
            remarks = [text for text in remarks if text != word] + [f"{in_a_row(symbols)} {word}"]
    cavitates = [f"cavitates {100.0 * share:.0f} % of the time"] if share else []
    return "; ".join([*remarks, *cavitates])


# MSE, cavitation, checks, held out


def mse_sheet(
    everything: Sequence[Row],
    parameters: Sequence[Row],
    quantities: Sequence[Quantity] = PAPER_QUANTITIES,
) -> Sheet:
    """Return one row per setting and log: MSE, noise floor, grade; remarks per setting."""
    settings = {row["setting"]: row for row in parameters}
    logs: dict[Setting, list[str]] = {row["setting"]: [] for row in everything}
    for row in everything:
        if row["log"] and row.get("role") != "held_out":
            logs[row["setting"]].append(row["log"])

    def setting(row: Row) -> str:
        # One that was only predicted has no parameters, hence no row of its own.
        is_named = not row["log"] or row["setting"] not in settings
        return str(row["setting"]) if is_named else ""

    def log(row: Row) -> str:
        fitted = logs[row["setting"]]
        return row["log"] or (fitted[0] if len(fitted) == 1 else "all logs")

    def remarks(row: Row) -> str:
        if row["log"]:
            return "held out: predicted, not fitted" if row.get("role") == "held_out" else ""
        fitted = settings.get(row["setting"])
        return remarks_on(fitted, quantities) if fitted else ""

    columns = [
        Column("setting", "", setting),
        Column("log", "", log, is_number=False),
        Column("MSE", "%", lambda row: percent(row["mse_percent"])),
        Column("noise floor", "%", lambda row: percent(row["noise_floor_percent"])),
        Column.text("grade", "grade", missing=NOTHING),
        Column.text("samples", "n_samples", is_number=True),
        Column("remarks", "", remarks, is_number=False),
    ]
    # The only log of a setting says the same as the setting.
    return laid_out([row for row in everything if logs[row["setting"]] != [row["log"]]], columns)


def grade_counts(rows: Iterable[Row]) -> str:
    """Return how many rows of a table have each grade, in words."""
    grades = [row["grade"] for row in rows]
    return ", ".join(f"{grades.count(grade)} {grade}" for grade in _GRADES if grade in grades)


def cavitation_sheet(rows: Sequence[Row]) -> Sheet:
    """Return one row per setting with pressures: the lowest, and the margins."""
    names = ("lowest_pressure", "r_m3_cavitation_margin")
    listed = [row for row in rows if any(row.get(name) is not None for name in names)]
    columns = [
        Column.text("setting", "setting", is_number=True),
        Column.of("lowest pressure", "bar", "lowest_pressure", digits=3, factor=1e-5),
        Column("in chamber", "", lambda row: str(row.get("lowest_pressure_chamber") or NOTHING)),
        Column.of("cavitates", "% of cycle", "cavitation_fraction", digits=3, factor=100.0),
        Column.of("R_m3 margin", "%", "r_m3_cavitation_margin", digits=3, factor=100.0),
        Column.of("gas", "bar at least", "safe_gas_pressure", digits=3, factor=1e-5),
    ]
    note = "Absolute pressures, of the simulation on the motion of the logs."
    return laid_out(listed, columns, note)


def check_summary(checks: Sequence[Check]) -> str:
    """Return how many checks were passed, failed and not evaluated."""
    results = [check.passed for check in checks]
    words = ((results.count(False), "failed"), (results.count(None), "not evaluated"))
    others = "".join(f", {n} {word}" for n, word in words if n)
    return f"{results.count(True)} of {len(checks)} checks passed{others}"


def check_lines(checks: Sequence[Check]) -> list[str]:
    """Return the summary and each failed check with its reason, for the terminal."""
    failed = [f"FAILED {check.name}: {check.reason}" for check in checks if check.passed is False]
    return [check_summary(checks), *failed]


def check_sheet(checks: Sequence[Check]) -> Sheet:
    """Return one row per check, those that failed first."""
    columns = [
        Column("check", "", lambda check: check.name, is_number=False),
        Column("result", "", lambda check: _CHECK_WORDS[check.passed], is_number=False),
        Column("reason", "", lambda check: check.reason, is_number=False),
    ]
    return laid_out(sorted(checks, key=lambda check: check.passed is not False), columns)


def held_out_sheet(predictions: Iterable[Row], *, is_narrow: bool = False) -> Sheet:
    """Return one row per prediction; ``is_narrow``: without motion and expected MSE."""

    def figure(heading: str, unit: str, name: str, text_of: Callable[[float], str]) -> Column:
        def cell(row: Row) -> str:
            value = number_in(row, name)
            return NOTHING if value is None else text_of(value)

        return Column(heading, unit, cell)

    def frequency(row: Row) -> str:
        # A moving segment has no frequency.
        rate = number_in(row, "frequency_Hz") or 0.0
        return number(rate, digits=3) if rate > 0.0 else "varies"

    columns = [
        Column.text("set", "setting", is_number=True),
        Column.text("held out", "log"),
        Column.text("cycles", "cycles"),
        figure("ampl.", "mm", "amplitude_m", lambda size: number(1e3 * size, digits=3)),
        Column("freq.", "Hz", frequency),
        figure("MSE", "%", "mse_percent", percent),
        figure("fitted", "%", "fitted_mse_percent", percent),
        figure("expected", "%", "expected_mse_percent", percent),
        Column.text("verdict", "verdict"),
    ]
    if is_narrow:
        columns = [*columns[:3], *columns[5:7], columns[-1]]
    return laid_out(predictions, columns)


# Forces

_KINDS = ("measured", "simulated")
_OF_DAMPING = "%: of the damping, which is the force less the gas force at mid-stroke"
_AS_MEASURED = "* measured: the model misses the force there by more than 2 %"
_SEGMENTS = (
    "Mean of the cycles; where no cycle repeats, the extremes and the total energy. "
    "Hysteresis: opening less closing force at half of the lower peak speed."
)
_MOST_SEGMENTS = 60  # segments that have a row


# By setting and click: rows of the table "adjustment"


def force_sheets(rows: Sequence[Row], strokes: Iterable[str] = STROKE_WORDS) -> list[Sheet]:
    """Return a table a stroke: force at each speed, and what a click changes at the fastest."""
    sheets = [_by_setting(rows, stroke) for stroke in strokes if rows]
    # A note stands once, below the last table.
    return [*(replace(sheet, notes=()) for sheet in sheets[:-1]), *sheets[-1:]]


def _by_setting(rows: Sequence[Row], stroke: str) -> Sheet:
    table = {
        (row["setting"], row.get("changed"), row["speed_m_per_s"]): row
        for row in rows
        if row["stroke"] == stroke
    }
    *speeds, top = sorted({row["speed_m_per_s"] for row in rows})
    # With several adjusters a setting has a row for each that was turned.
    places = sorted(
        {(row["setting"], row.get("changed")) for row in rows},
        key=lambda place: (Setting.of(place[0]), place[1] or ""),
    )
    has_click = any(row.get("change_N") is not None for row in rows)
    lines = lines_of([setting for setting, _ in places])
    steps = ((a, b, clicks_between(a, b) or 0.0)
             for line in lines for a, b in itertools.pairwise(line.settings))  # fmt: skip
    wide = [step for step in steps if step[2] > 1.0]

    def words(place: Place) -> str:
        setting, changed = str(place[0]), place[1]
        is_named = changed not in (None, ADJUSTER) and " " in setting
        return f"{setting}, {changed}" if is_named else setting

    def column(heading: str, unit: str, speed: float, cell: Callable[[Row], str]) -> Column:
        return Column(heading, unit, lambda place: cell(table.get((*place, speed), {})))

    def interval(name: str, row: Row, **how: Any) -> str:
        return with_interval(*(row.get(f"{name}{e}_N") for e in ("", "_ci_low", "_ci_high")), **how)

    def force(row: Row) -> str:
        return interval("force", row, digits=4) + _mark(row)

    def bare_force(row: Row) -> str:
        return number(row.get("force_N"), digits=4) + _mark(row)

    def change(row: Row) -> str:
        return interval("change", row, plus="+")

    def change_percent(row: Row) -> str:
        share = row.get("change_percent")
        return NOTHING if share is None else f"{share:+.1f}"

    # Beyond the tests the interval says how many digits are known.
    is_wide = {row["speed_m_per_s"] for row in rows if row.get("tested") == "no"} | {top}
    columns = [Column(STROKE_WORDS[stroke], "N at", words)]
    for speed in (*speeds, top):
        unit, cell = ("m/s ±95 %", force) if speed in is_wide else ("m/s", bare_force)
        columns.append(column(f"{speed:.3g}" if speeds else f"{speed:g}", unit, speed, cell))
    if has_click:
        columns.append(column("change" if wide else "click", "N ±95 %", top, change))
        columns.append(column("", "%", top, change_percent))
    notes = []
    if has_click and wide:
        listed = listed_names([f"{a} to {b} ({n:g} clicks)" for a, b, n in wide])
        notes.append(f"change: over all clicks from one tested setting to the next: {listed}")
    marked = next((place for place in places if words(place) != str(place[0])), None)
    if has_click and marked is not None:
        notes.append(
            f'"{words(marked)}": only {marked[1]} was turned to get there; a setting with a '
            "neighbour along each adjuster has a row for each"
        )
    gas = sorted({row["gas_N"] for row in rows if row.get("gas_N") is not None})
    if gas:
        ends = dict.fromkeys(number(force, digits=4) for force in (gas[0], gas[-1]))
        of_rest = "; %: of the damping" * has_click
        notes.append(f"forces include the gas force, {' to '.join(ends)} N at mid-stroke{of_rest}")
    elif has_click:
        notes.append(_OF_DAMPING)
    return laid_out(places, columns, *notes, *_marks(rows))


def _mark(row: Row) -> str:
    return "*" if row.get("origin") == "measured" else ""


def _marks(rows: Iterable[Row]) -> list[str]:
    return [_AS_MEASURED] if any(map(_mark, rows)) else []


def measured_force_sheet(rows: Sequence[Row]) -> Sheet:
    """Return measured and modelled force at the fastest speed, and wherever the model misses."""
    compared = [row for row in rows if row.get("measured_N") is not None]
    table = {(row["setting"], row["speed_m_per_s"], row["stroke"]): row for row in compared}
    fastest = max((row["speed_m_per_s"] for row in compared), default=0.0)
    missed = {(row["setting"], row["speed_m_per_s"]) for row in compared if _mark(row)}
    places = sorted(
        {(a, b) for a, b, _ in table if b == fastest or (a, b) in missed},
        key=lambda place: (Setting.of(place[0]), place[1]),
    )

    def measured(row: Row) -> str:
        force, reach = row["measured_N"], NORMAL_95 * (row.get("measured_se_N") or math.nan)
        return with_interval(force, force - reach, force + reach, digits=4) + _mark(row)

    texts: dict[str, Callable[[Row], str]] = {
        "measured": measured,
        "model": lambda row: number(row["measured_N"] - row["difference_N"], digits=4),
        "diff.": lambda row: f"{round(row['difference_N'], 1) + 0.0:+.1f}",
    }

    def column(stroke: str, heading: str) -> Column:
        def cell(place: tuple[Any, float]) -> str:
            row = table.get((*place, stroke))
            return texts[heading](row) if row else NOTHING

        return Column(STROKE_WORDS[stroke], heading, cell)

    columns = [
        Column("set", "", lambda place: str(place[0])),
        Column("speed", "m/s", lambda place: f"{place[1]:g}"),
        *(column(stroke, heading) for stroke in STROKE_WORDS for heading in texts),
    ]
    note = "force in N ±95 %, mean of all compared cycles, beside the model's on the same cycles"
    return laid_out(places, columns, note, *_marks(compared))


# Of logs and segments: rows of the table "characteristics"


def log_force_sheet(rows: Sequence[Row]) -> Sheet:
    """Return the forces of one segment, measured beside simulated: at named speeds, and peaks."""
    peak = next(row for row in rows if row["point"] == "peak")
    lines = []
    for row in (*(row for row in rows if row is not peak), peak):
        forces = [row[f"{kind}_{stroke}_N"] for stroke in STROKE_WORDS for kind in _KINDS]
        ratios = (number(row[f"{kind}_ratio"], digits=3) for kind in _KINDS)
        name = "peak" if row is peak else f"at {row['speed_rebound_m_per_s']:g} m/s"
        lines.append((name, *(number(force, digits=4) for force in forces), *ratios))
    widths = [peak[f"{kind}_hysteresis_{stroke}_N"] for stroke in STROKE_WORDS for kind in _KINDS]
    # A sum that is zero but for rounding is zero.
    widths = [None if force is None else round(force, 6) + 0.0 for force in widths]
    hysteresis = f"hysteresis, {number(peak['hysteresis_speed_m_per_s'], digits=2)} m/s"
    lines.append((hysteresis, *(number(force, digits=4) for force in widths), "", ""))
    celsius = peak["temperature_degC"]
    temperature = f"Temperature: {'not logged' if celsius is None else f'{celsius:.1f} degC'}"
    energy = [number(peak[f"{kind}_energy_J"], digits=4) for kind in _KINDS]
    return Sheet(
        ("force, N", *(word for word in STROKE_WORDS.values() for _ in _KINDS), "ratio", "ratio"),
        ("", *_KINDS * 3),
        tuple(lines),
        (False, *(True,) * 6),
        (f"Energy per cycle: {energy[0]} J measured, {energy[1]} J simulated. {temperature}.",),
    )


def segment_sheet(
    rows: Sequence[Row], *, has_setting: bool, errors: Mapping[tuple[Any, ...], Any] | None = None
) -> Sheet:
    """Return peak force against peak speed (PVP), energy, hysteresis: a row a segment.

    Of all settings, by setting and speed; else of one log, as it ran. ``errors`` are segments with
    the MSE of the fit, by setting, log and begin.
    """
    peaks = [row for row in rows if row["point"] == "peak"]
    leading = [Column.of("from", "s", "start_s")]
    if has_setting:
        logs = {(row["setting"], row.get("log")) for row in peaks}
        leading = [Column.text("setting", "setting", is_number=True)]
        leading += [Column.text("log", "log")] * (len(logs) > len({setting for setting, _ in logs}))
        peaks.sort(
            key=lambda row: (Setting.of(row["setting"]), row["speed_rebound_m_per_s"] or 0.0)
        )

    def fastest(row: Row) -> str:
        speeds = [row[f"speed_{stroke}_m_per_s"] for stroke in STROKE_WORDS]
        return number(max((v for v in speeds if v is not None), default=None), digits=3)

    def error(row: Row) -> str:
        segment = (errors or {}).get((str(row["setting"]), row["log"], row["start_s"]), {})
        return percent(number_in(segment, "mse_percent"))

    columns = [
        *leading,
        Column("cycles", "", lambda row: str(row["cycles"]) if row.get("cycles") else "moving"),
        Column.of("freq.", "Hz", "frequency_Hz", digits=3),
        Column("speed", "m/s", fastest),
        *(
            Column.of(heading, f"{kind}, {unit}", f"{kind}_{name}_{unit}", digits=digits)
            for heading, name, unit, digits in (
                ("rebound", "rebound", "N", 4),
                ("compression", "bump", "N", 4),
                ("energy", "energy", "J", 4),
                ("hyst. rebound", "hysteresis_rebound", "N", 3),
                ("hyst. compression", "hysteresis_bump", "N", 3),
            )
            for kind in _KINDS
        ),
        *([Column("MSE", "%", error)] if errors else []),
    ]
    listed, notes = first_of(peaks, _MOST_SEGMENTS, "in characteristics.csv")
    return laid_out(listed, columns, _SEGMENTS, *notes)


# Which model structure the logs support, from run.json: one row per candidate


_FREE = Column("free", "", lambda row: str(len(listed_in(row, "free")) or ""))
_ERRORS = (
    Column("MSE", "%", lambda row: percent(number_in(row, "mse_percent"))),
    Column("held out", "%", lambda row: percent(number_in(row, "held_out_mse_percent"))),
)


def tried_laws_sheet(choice: Row, *, is_narrow: bool = False) -> Sheet:
    """Return one row a candidate in order; ``is_narrow``: without changes and reasons."""
    notes = ["* chosen; MSE and what was held out in per cent of the variance"]
    if (samples := number_in(choice, "effective_samples")) is not None:
        notes.append(
            f"BIC with {samples:.0f} effective samples, against the structure that the row was "
            "compared with: positive where it is for the larger of both"
            + ("; factor: MSE of the smaller of both over that of the larger" * (not is_narrow))
        )
    chosen = Column("", "", lambda row: "*" if row.get("is_chosen") is True else "", False)

    def figure(heading: str, key: str, pattern: str) -> Column:
        def cell(row: Row) -> str:
            value = number_in(row, key)
            return "" if value is None else pattern.format(value)

        return Column(heading, "", cell)

    structure, bic = Column.text("structure", "law"), figure("BIC", "bic", "{:+.0f}")
    columns = [chosen, structure, _FREE, bic, *_ERRORS]
    if not is_narrow:
        changed, reason = Column.text("changed", "change"), Column.text("why", "reason")
        factor = figure("factor", "gain", "{:.3g}")
        columns = [chosen, structure, changed, factor, bic, _FREE, *_ERRORS, reason]
    return laid_out(entries_in(choice, "laws"), columns, *notes)


def rival_sheet(choice: Row) -> Sheet:
    """Return one row a model of the literature, as in run.json, the best prediction first."""
    caveats: dict[str, list[str]] = {}
    for rival in entries_in(choice, "rivals"):
        if rival.get("caveat"):
            caveats.setdefault(str(rival["caveat"]), []).append(str(rival.get("title")))
    notes = (f"{', '.join(titles)}: {caveat}" for caveat, titles in caveats.items())
    title = Column.text("model of the literature", "title")
    columns = [title, Column.text("source", "source"), _FREE, *_ERRORS]
    return laid_out(entries_in(choice, "rivals"), columns, *notes)


def law_sentences(choice: Row) -> list[str]:
    """Return which structure was chosen, and its physics."""
    if not isinstance(choice.get("chosen"), str):
        return []
    return [f"The logs support {choice['chosen']}.", *map(str, listed_in(choice, "sentences"))]
