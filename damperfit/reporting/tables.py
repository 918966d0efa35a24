"""Tables of a run: parameters, MSE, checks, cavitation, what was held out."""

from __future__ import annotations

import math
from itertools import combinations
from typing import TYPE_CHECKING, Any, NamedTuple

from damperfit.damper.quantity import SETTING
from damperfit.reporting.sheet import (
    NOTHING,
    Column,
    Sheet,
    laid_out,
    number,
    percent,
    with_interval,
)
from damperfit.tables.columns import PAPER_QUANTITIES

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence

    from damperfit.checks import Check
    from damperfit.damper.quantity import Quantity
    from damperfit.tested.setting import Setting

    Row = Mapping[str, Any]

_SHORT = 5  # letters of a unit that fits over a column
_SAME = 1e-9  # of a value that went through a file
# Within this factor of a bound a value at its bound is the bound, not a number that was found.
_AT_BOUND = 2.0
_MARKS = {
    "absent": ("none", "does nothing here, the model is fitted without it"),
    "fixed": ("f", "fixed"),
    "shared": ("s", "shared by all settings"),
    "at_bound": ("!", "ran into a bound"),
    "not_identifiable": ("?", "not determined by these logs"),
}
_BY_CLICK = "shared by all settings, or by those with one click of the adjuster that it follows"
_OF_MISFIT = "intervals hold noise and lack of fit; parameters.csv has both"
_WITHOUT_VALUE = {"absent", "at_bound", "not_identifiable"}
_GRADES = ("excellent", "good", "poor", "withheld")
_CHECK_WORDS = {True: "passed", False: "FAILED", None: "not evaluated"}
BLOCK_LEVELS = "▁▂▃▄▅▆▇█"
ASCII_LEVELS = ".:-=+*#@"  # for terminals and files that know nothing else: more ink is more
_FEWEST, _MOST = 3, 60  # settings that a sparkline is drawn of


class Scale(NamedTuple):
    """How a parameter is shown: its unit, its power of ten, and what stands on an axis."""

    unit: str
    power: int
    axis: str

    @property
    def factor(self) -> float:
        """From SI to what is shown."""
        return 10.0**-self.power

    @property
    def short_unit(self) -> str:
        """For the head of a narrow column."""
        if len(self.unit) <= _SHORT:
            return self.unit
        return f"1e{self.power}" if self.power else "SI"

    def say(self, text: str) -> str:
        """Return a shown value, with or without its interval, and its unit."""
        if len(self.unit) <= _SHORT:
            return f"{text} {self.unit}"
        if "(" in text:
            return f"{text} times 1e{self.power} {self.unit}"
        return f"{f'({text})' if ' ' in text else text}e{self.power} {self.unit}"


def scale_of(quantity: Quantity) -> Scale:
    """Return how a quantity is shown."""
    shown = quantity.shown_unit
    has_power = shown[:2] == "10"  # "10³ s √N / (m kg)" is for an axis alone
    unit = shown if shown and not has_power else quantity.unit
    return Scale(unit, quantity.power, shown or quantity.unit)


# Parameters


def parameter_sheet(
    rows: Sequence[Row], quantities: Sequence[Quantity] = PAPER_QUANTITIES, *, levels: str = ""
) -> Sheet:
    """Return one row per setting: parameters with their 95 % intervals, MSE, grade, remarks.

    What all settings have in common is a note below, what is held at its default everywhere is left
    out. ``levels`` are the characters, from low to high, of a course over the settings.
    """
    shown = [one for one in quantities if not rows or not all(_is_idle(row, one) for row in rows)]
    shared = [one for one in shown if is_one_for_all(rows, one.name) and _may_be_shared(one, rows)]
    own = [one for one in shown if one not in shared]
    notes = []
    for one in shared:
        row = next(row for row in rows if row[one.name] is not None)
        how = "shared by all settings" if row[f"{one.name}_status"] == "shared" else "fixed"
        notes.append(f"{one.symbol} = {scale_of(one).say(_value(row, one))}, {how}")

    def column(one: Quantity) -> Column:
        spread = " ±95 %" * any(" " in _value(row, one) for row in rows)
        unit = f"{scale_of(one).short_unit}{spread}"
        return Column(one.symbol, unit, lambda row: _cell(row, one))

    columns = [
        Column.text("set", "setting", is_number=True),
        *map(column, own),
        Column("MSE", "%", lambda row: percent(row["mse_percent"])),
        Column.text("grade", "grade", missing=NOTHING),
    ]
    if any(map(remarks_on, rows)):
        columns.append(Column("remarks", "", remarks_on, is_number=False))
    courses = _courses(rows, own, levels) if levels else ()
    return laid_out(rows, columns, *notes, *courses, *_legend(rows, own))


def _is_idle(row: Row, one: Quantity) -> bool:
    value = row[one.name]
    is_default = one.default is not None and value in (None, one.default)
    is_nothing = one.may_vanish and value is not None and value <= one.plausible[0]
    return (is_default or is_nothing) and row[f"{one.name}_status"] in ("fixed", None)


def _may_be_shared(quantity: Quantity, rows: Sequence[Row]) -> bool:
    """Whether one value for all is told once: what is each setting's own keeps its column."""
    is_shared = all(row[f"{quantity.name}_status"] == "shared" for row in rows)
    return is_shared or quantity.scope != SETTING or quantity.default is not None


def is_one_for_all(rows: Sequence[Row], name: str) -> bool:
    """Whether settings have one value, shared or held, and none by a fit of its own."""
    values = [row[name] for row in rows if row[name] is not None]
    held = {row[f"{name}_status"] for row in rows if row[name] is not None} <= {"fixed", "shared"}
    return bool(values) and held and max(values) - min(values) <= _SAME * abs(values[0])


def _value(row: Row, quantity: Quantity) -> str:
    """Return a value as it is shown, with its 95 % interval."""
    factor, name = scale_of(quantity).factor, quantity.name
    numbers = (row[name], row.get(f"{name}_ci_low"), row.get(f"{name}_ci_high"))
    return with_interval(*(None if one is None else factor * one for one in numbers), digits=4)


def _cell(row: Row, quantity: Quantity) -> str:
    status = row[f"{quantity.name}_status"] or ""
    mark, _ = _MARKS.get(status, ("", ""))
    if status in {"absent", "not_identifiable"}:
        return mark  # no number that pretends to be known
    return f"{_bound(row, quantity) or _value(row, quantity)} {mark}".rstrip()


def _bound(row: Row, quantity: Quantity) -> str:
    """Return a value that ran to a bound as the limit it ran into; empty where it is none.

    A friction too small to be determined may be far from the bound.
    """
    value, factor = row[quantity.name], scale_of(quantity).factor
    is_at_bound = row[f"{quantity.name}_status"] == "at_bound"
    if value is None or not is_at_bound or not quantity.is_logarithmic:
        return ""
    low, high = quantity.plausible
    if value < _AT_BOUND * low:
        return f"<{max(value, low) * factor:.2g}"
    return f">{min(value, high) * factor:.2g}" if value > high / _AT_BOUND else ""


def parameter_line(row: Row, quantities: Sequence[Quantity] = PAPER_QUANTITIES) -> str:
    """Return the parameters of one setting in a sentence, those not known left out."""
    parts = []
    for one in quantities:
        scale, status = scale_of(one), row[f"{one.name}_status"]
        if row[one.name] is None or _is_idle(row, one):
            continue
        if status == "absent":
            parts.append(f"no {one.label}")
        elif status == "not_identifiable":
            parts.append(f"{one.symbol} cannot be determined")
        elif bound := _bound(row, one):
            words = "below" if bound.startswith("<") else "above"
            parts.append(f"{one.symbol} {words} {scale.say(bound[1:])} (at bound)")
        else:
            words = "" if status in {"fitted", None} else f" ({status.replace('_', ' ')})"
            parts.append(f"{one.symbol} = {scale.say(_value(row, one))}{words}")
    return f"{', '.join(parts)}." if parts else ""


def _legend(rows: Sequence[Row], shown: Sequence[Quantity]) -> Iterator[str]:
    """Yield what units and marks of a table of parameters mean."""
    groups: dict[str, list[str]] = {}
    for one in shown:
        scale = scale_of(one)
        if scale.short_unit != scale.unit:
            power = f"1e{scale.power} " if scale.power else ""
            groups.setdefault(f"{power}{scale.unit}", []).append(one.symbol)
    if groups:
        yield ", ".join(f"{_listed(symbols)} in {unit}" for unit, symbols in groups.items())
    used = {row[f"{one.name}_status"] for row in rows for one in shown}
    marks = {
        status: f"{mark} {words}" for status, (mark, words) in _MARKS.items() if status in used
    }
    for one in shown:
        if len({row[one.name] for row in rows if row[f"{one.name}_status"] == "shared"}) > 1:
            marks["shared"] = f"s {_BY_CLICK}"
    if marks:
        yield ", ".join(marks.values())
    if any(row.get(f"{one.name}_misfit_se") for row in rows for one in shown):
        yield _OF_MISFIT


def _listed(symbols: Sequence[str]) -> str:
    *first, last = symbols
    return f"{', '.join(first)} and {last}" if first else last


def sparkline(values: Iterable[float | None], *, levels: str = BLOCK_LEVELS) -> str:
    """Return one character a value, the lowest and the highest at the ends of ``levels``.

    A value that is not known is a blank. Equal values stand in the middle.

    Examples
    --------
    >>> sparkline([1.0, 2.0, None, 3.0, 8.0])
    '▁▂ ▃█'
    >>> sparkline([5.0, 5.0], levels=ASCII_LEVELS)
    '++'
    """
    known = [math.nan if value is None else float(value) for value in values]
    finite = [value for value in known if math.isfinite(value)] or [0.0]
    low, span = min(finite), max(finite) - min(finite)

    def mark(value: float) -> str:
        if not math.isfinite(value):
            return " "
        share = (value - low) / span if span > 0.0 else 0.5
        return levels[min(len(levels) - 1, int(share * len(levels)))]

    return "".join(map(mark, known))


def _courses(rows: Sequence[Row], shown: Sequence[Quantity], levels: str) -> Iterator[str]:
    """Yield each parameter over the settings as one line, and the MSE, which spans decades."""
    errors = [row["mse_percent"] for row in rows]
    seen = [error for error in errors if error is not None]
    if len(seen) < _FEWEST or len(rows) > _MOST:
        return
    for one in shown:
        name, scale = one.name, scale_of(one)
        known = {
            k: (row[name], row[f"{name}_se"] or 0.0)
            for k, row in enumerate(rows)
            if row[f"{name}_status"] not in _WITHOUT_VALUE and row[name] is not None
        }
        if len(known) < _FEWEST:
            continue
        # Scaled to the height of a line, values that errors cannot tell apart would have a course.
        pairs = combinations(known.values(), 2)
        is_flat = not any(abs(a - b) > math.hypot(e, f) for (a, e), (b, f) in pairs)
        heights = {} if is_flat else {k: value for k, (value, _) in known.items()}
        course = [0.0 if is_flat else heights.get(k) for k in range(len(rows))]
        values = [scale.factor * value for value, _ in known.values()]
        ends = f"{number(min(values), digits=4)} to {number(max(values), digits=4)}"
        flat = ", drawn flat: within their standard errors" if is_flat else ""
        line = sparkline(course, levels=levels)
        yield f"{one.symbol:<4} {line}  {ends} {scale.short_unit}{flat}"
    line = sparkline([math.log10(error) if error else None for error in errors], levels=levels)
    ends = f"{percent(min(seen))} to {percent(max(seen))} %, logarithmic"
    yield f"{'MSE':<4} {line}  {ends}"


def remarks_on(row: Row, quantities: Sequence[Quantity] = ()) -> str:
    """Return what makes a setting less than plainly fitted, in words.

    Bounds and want of data are told of these quantities; a table marks them in its cells.
    """
    outcome = (row.get("outcome") or "outcome unknown").replace("_", " ")
    share = row.get("cavitation_fraction")
    cavitates = f"cavitates {100.0 * share:.0f} % of the time" if share else ""
    words = {outcome}
    if outcome == "converged" or (outcome == "cavitating" and cavitates):
        words = set()
    remarks = [*words]
    for status in ("at_bound", "not_identifiable"):
        own = [one.symbol for one in quantities if row.get(f"{one.name}_status") == status]
        word = status.replace("_", " ")
        if own:
            remarks = [one for one in remarks if one != word] + [f"{_listed(own)} {word}"]
    return "; ".join([*remarks, cavitates] if cavitates else remarks)


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
        known = settings.get(row["setting"])
        return remarks_on(known, quantities) if known else ""

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
    """Return one row per setting: lowest pressure, share of the cycle, and what may still change.

    Columns of another version may be missing; a setting that tells nothing has no row.
    """
    telling = ("lowest_pressure", "r_m3_cavitation_margin")
    known = [row for row in rows if any(row.get(name) is not None for name in telling)]
    columns = [
        Column.text("setting", "setting", is_number=True),
        Column.of("lowest pressure", "bar", "lowest_pressure", digits=3, factor=1e-5),
        Column("in chamber", "", lambda row: str(row.get("lowest_pressure_chamber") or NOTHING)),
        Column.of("cavitates", "% of cycle", "cavitation_fraction", digits=3, factor=100.0),
        Column.of("R_m3 margin", "%", "r_m3_cavitation_margin", digits=3, factor=100.0),
        Column.of("gas", "bar at least", "safe_gas_pressure", digits=3, factor=1e-5),
    ]
    note = "Absolute pressures, of the simulation on the motion of the logs."
    return laid_out(known, columns, note)


def check_summary(checks: Sequence[Check]) -> str:
    """Return how many checks were passed, failed and not looked at."""
    results = [check.passed for check in checks]
    n_failed, n_other = results.count(False), results.count(None)
    failed = f", {n_failed} failed" if n_failed else ""
    other = f", {n_other} not evaluated" if n_other else ""
    return f"{results.count(True)} of {len(checks)} checks passed{failed}{other}"


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
    """Return one row per prediction: its MSE beside the fitted logs', the verdict.

    ``is_narrow`` is for a terminal: without amplitude, frequency and the expected MSE.
    """

    def frequency(row: Row) -> str:
        # What moves beside the steady cycles has no frequency of its own.
        rate = row.get("frequency_Hz")
        return number(rate, digits=3) if rate and rate > 0.0 else "varies"

    columns = [
        Column.text("set", "setting", is_number=True),
        Column.text("held out", "log"),
        Column.text("cycles", "cycles"),
        Column.of("ampl.", "mm", "amplitude_m", digits=3, factor=1e3),
        Column("freq.", "Hz", frequency),
        Column("MSE", "%", lambda row: percent(row.get("mse_percent"))),
        Column("fitted", "%", lambda row: percent(row.get("fitted_mse_percent"))),
        Column("expected", "%", lambda row: percent(row.get("expected_mse_percent"))),
        Column.text("verdict", "verdict"),
    ]
    if is_narrow:
        columns = [*columns[:3], *columns[5:7], columns[-1]]
    return laid_out(predictions, columns)
