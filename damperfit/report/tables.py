"""Tables of a run: parameters, MSE, checks, cavitation, what was held out."""

from __future__ import annotations

import itertools
import math
import re
from dataclasses import dataclass
from itertools import combinations
from typing import TYPE_CHECKING, Any, NamedTuple

from damperfit.damper.quantity import SETTING
from damperfit.report.rounding import NOTHING, number, percent, rounded_by_error, with_error
from damperfit.report.sheet import Sheet, sheet_width
from damperfit.tables import PAPER_QUANTITIES
from damperfit.tested.setting import clicks_between, lines_of

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from damperfit.tested.setting import Setting

    Row = Mapping[str, Any]
    from collections.abc import Iterable, Mapping

    from damperfit.checks import Check
    from damperfit.damper.quantity import Quantity
    from damperfit.uncertainty import Prediction

__all__ = [
    "ABSOLUTE_PRESSURES",
    "ASCII_LEVELS",
    "BLOCK_LEVELS",
    "BRANCHES",
    "BRANCHES_AND_RATIO",
    "CHECK_WORDS",
    "DAMPING_SHARE",
    "FORCE_AS_MEASURED",
    "MEASURED_BESIDE_MODEL",
    "PARAMETER_MARKS",
    "Scale",
    "cavitation_sheet",
    "check_lines",
    "check_sheet",
    "check_summary",
    "differ",
    "energy_and_temperature",
    "errors_and_flags",
    "flags",
    "force_and_click_at",
    "grade_counts",
    "held_out_sheet",
    "is_one_for_all",
    "limit_text",
    "mse_sheet",
    "over_several_clicks",
    "parameter_line",
    "parameter_sheet",
    "scale_of",
    "scaled_units",
    "setting_sparklines",
    "shared_sentence",
    "shown_quantities",
    "simulated_clicks_at",
    "sparkline",
    "stroke_and_click_at",
    "summary_sheet",
    "total_error",
    "units_and_marks",
]


# The sentences below the tables: what units, marks and columns mean.

DAMPING_SHARE = "% of the damping: of the force less the gas force at mid-stroke"
ABSOLUTE_PRESSURES = "Absolute pressures, of the simulation on the motion of the logs."
BRANCHES = "force at a speed: mean of both branches; hysteresis: opening less closing branch"
BRANCHES_AND_RATIO = (
    "Force at a speed: mean of the opening and the closing branch. Hysteresis: opening less "
    "closing. Ratio: rebound over bump; none where the gas pushes both to one side."
)
MEASURED_BESIDE_MODEL = (
    "force in N, mean of all compared cycles, beside the model's on the same cycles"
)
FORCE_AS_MEASURED = "m measured: the model misses the force there by more than 2 %"
_MARKS = {
    "fixed": "f fixed",
    "absent": "none: does nothing here, the law is fitted without it",
    "shared": "s shared by all settings",
    "at_bound": "! ran into a bound",
    "not_identifiable": "? not determined by these logs",
}
_BY_CLICK = "s shared by all settings, or by those with one click of the adjuster that it follows"

_OF_MISFIT = (
    "errors are of noise and of what repeats in the residual; parameters.csv has them apart"
)
_MOST_STEPS = 5  # named below a table


def units_and_marks(rows: Sequence[Row], names: Sequence[str], units: str) -> tuple[str, ...]:
    """Return what the units and the marks of a table of parameters mean.

    Parameters
    ----------
    rows : sequence of mapping
        Rows of the table.
    names : sequence of str
        Parameters in it.
    units : str
        What is said of their units; empty where nothing is.
    """
    used = {row[f"{name}_status"] for row in rows for name in names}
    marks = ", ".join(text for status, text in _MARKS.items() if status in used)
    if any(_follows_adjuster(rows, name) for name in names):
        marks = marks.replace(_MARKS["shared"], _BY_CLICK)
    is_bent = any(row.get(f"{name}_misfit_se") for row in rows for name in names)
    return tuple(note for note in (units, marks, _OF_MISFIT * is_bent) if note)


def _follows_adjuster(rows: Sequence[Row], name: str) -> bool:
    return len({row[name] for row in rows if row[f"{name}_status"] == "shared"}) > 1


def errors_and_flags(
    rows: Sequence[Row], names: Sequence[str], *, shows_errors: bool, example: str = ""
) -> Iterator[str]:
    """Yield how errors are written in the table that `identify` ends with, and its flags.

    Parameters
    ----------
    rows : sequence of mapping
        Rows of the table.
    names : sequence of str
        Parameters in it.
    shows_errors : bool
        Cells hold the errors.
    example : str
        A cell of the table, as in "14.005(11)".
    """
    has_errors = any(row[f"{name}_se"] for row in rows for name in names)
    if shows_errors and has_errors:
        if example:
            yield f"{example} means {_spelt_out(example)}, one standard error"
    elif has_errors:
        yield "rounded by their standard errors, which are in parameters.csv"
    if any(row.get("cavitation_fraction") for row in rows):
        yield "cav.: share of the cycle with a chamber at zero pressure"


def _spelt_out(cell: str) -> str:
    """Return what a cell means.

    Examples
    --------
    >>> [_spelt_out(cell) for cell in ("14.005(11)", "45680(320)", "0.80(1.20)", "2.5(3)e6")]
    ['14.005 +- 0.011', '45680 +- 320', '0.80 +- 1.20', '(2.5 +- 0.3)e6']
    """
    value, _, rest = cell.partition("(")
    error, _, power = rest.partition(")")
    decimals = len(value.partition(".")[2])
    if "." not in error:
        error = f"{int(error) / 10**decimals:.{decimals}f}"
    return f"({value} +- {error}){power}" if power else f"{value} +- {error}"


def force_and_click_at(speed: float) -> str:
    """Return what a table of forces by setting shows; speed in m/s."""
    return f"force at {speed:g} m/s and its change by click, with 95 % intervals"


def stroke_and_click_at(stroke: str, speed: float, change: str = "click") -> str:
    """Return what a table of one stroke at several speeds shows; speed of the change in m/s."""
    return f"{stroke}: force in N; {change}: its change at {speed:g} m/s"


def over_several_clicks(settings: Sequence[Setting]) -> tuple[str, ...]:
    """Return which changes between tested settings are over more than one click, if any are."""
    steps = [
        (a, b, clicks_between(a, b) or 0.0)
        for line in lines_of(settings)
        for a, b in itertools.pairwise(line.settings)
    ]
    wide = [(a, b, n) for a, b, n in steps if n > 1.0]
    if not wide:
        return ()
    named = ", ".join(f"{a} to {b} ({n:g} clicks)" for a, b, n in wide[:_MOST_STEPS])
    more = f" and {len(wide) - _MOST_STEPS} more" if len(wide) > _MOST_STEPS else ""
    return (f"the change is over all clicks between two tested settings: {named}{more}",)


def simulated_clicks_at(speed: float) -> str:
    """Return what a table of clicks shows; speed in m/s."""
    return f"At {speed:g} m/s, simulated, with 95 % intervals."


def energy_and_temperature(measured: float, simulated: float, temperature: float | None) -> str:
    """Return energies per cycle in J and the temperature in degC as a sentence."""
    warmth = "not logged" if temperature is None else f"{temperature:.1f} degC"
    energies = f"{measured:.4g} J measured, {simulated:.4g} J simulated"
    return f"Energy per cycle: {energies}. Temperature: {warmth}."


# The parameters, one row per setting, with how each parameter is shown: symbol, unit, mark.


class Scale(NamedTuple):
    """How a parameter is shown: symbol, meaning, unit, power of ten, and both on an axis."""

    symbol: str
    meaning: str
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

    @property
    def unit_with_power(self) -> str:
        """For a column of units: "1e3 s sqrt(N)/(m kg)"."""
        if len(self.unit) <= _SHORT or not self.power:
            return self.unit
        return f"1e{self.power} {self.unit}"

    def say(self, text: str) -> str:
        """Return a shown value, with or without its error, and its unit."""
        if len(self.unit) <= _SHORT:
            return f"{text} {self.unit}"
        return f"{f'({text})' if '±' in text else text}e{self.power} {self.unit}"


_SHORT = 5
_SAME = 1e-9  # of a value that went through a file
# Within this factor of an edge a value at its bound is the edge, not a number that was found.
_AT_EDGE = 2.0


def scale_of(quantity: Quantity) -> Scale:
    """Return how a quantity is shown."""
    shown = quantity.shown_unit
    has_power = shown[:2] == "10"  # "10³ s √N / (m kg)" is for an axis alone
    unit = shown if shown and not has_power else quantity.unit
    return Scale(quantity.symbol, quantity.label, unit, quantity.power, shown or quantity.unit)


def shown_quantities(rows: Sequence[Row], quantities: Sequence[Quantity]) -> list[Quantity]:
    """Return the quantities without those that are held at their default at every setting."""
    return [
        one
        for one in quantities
        if one.default is None or not all(_is_idle(row, one) for row in rows)
    ]


def _is_idle(row: Row, one: Quantity) -> bool:
    if one.default is None:
        return False
    is_default = row[one.name] in (None, one.default)
    return is_default and row[f"{one.name}_status"] in ("fixed", None)


PARAMETER_MARKS = {
    "absent": "none",
    "fixed": "f",
    "shared": "s",
    "at_bound": "!",
    "not_identifiable": "?",
}


def parameter_sheet(
    rows: Sequence[Row],
    quantities: Sequence[Quantity] = PAPER_QUANTITIES,
    *,
    says_shared_once: bool = False,
) -> Sheet:
    """Return one row per setting: parameters with their standard errors, MSE, grade, outcome.

    Parameters
    ----------
    rows : sequence of mapping
        Of the table of parameters.
    quantities : sequence of Quantity
        What was fitted.
    says_shared_once : bool
        What all settings have in common is a line below, no column.
    """
    shown = shown_quantities(rows, quantities)
    once = ""
    if says_shared_once:
        once = shared_sentence(rows, quantities)
        shown = [one for one in shown if not is_one_for_all(rows, one.name)]
    scales = [scale_of(one) for one in shown]
    return Sheet(
        headings=("set", *(scale.symbol for scale in scales), "MSE", "grade", "outcome"),
        units=("", *(scale.short_unit for scale in scales), "%", "", ""),
        rows=tuple(
            (
                str(row["setting"]),
                *(_parameter_cell(row, one) for one in shown),
                percent(row["mse_percent"]),
                row["grade"] or NOTHING,
                (row["outcome"] or NOTHING).replace("_", " "),
            )
            for row in rows
        ),
        is_number=(True, *(True for _ in shown), True, False, False),
        notes=(
            *([once] if once else []),
            *units_and_marks(rows, [one.name for one in shown], scaled_units(shown)),
        ),
    )


def scaled_units(quantities: Sequence[Quantity]) -> str:
    """Return which quantities stand in a power of ten of a long unit; empty where none does."""
    groups: dict[str, list[str]] = {}
    for one in quantities:
        scale = scale_of(one)
        if scale.short_unit != scale.unit:
            power = f"1e{scale.power} " if scale.power else ""
            groups.setdefault(f"{power}{scale.unit}", []).append(scale.symbol)
    return ", ".join(f"{_listed(symbols)} in {unit}" for unit, symbols in groups.items())


def _listed(symbols: Sequence[str]) -> str:
    *first, last = symbols
    return f"{', '.join(first)} and {last}" if first else last


def parameter_line(row: Row, quantities: Sequence[Quantity] = PAPER_QUANTITIES) -> str:
    """Return the parameters of one setting in a sentence, those not known left out."""
    parts = []
    for one in quantities:
        name, scale, status = one.name, scale_of(one), row[f"{one.name}_status"]
        if row[name] is None or _is_idle(row, one):
            continue
        if status == "absent":
            parts.append(f"no {one.label}")
            continue
        if status == "not_identifiable":
            parts.append(f"{scale.symbol} cannot be determined")
            continue
        error = total_error(row, name)
        at_edge = status == "at_bound" and limit_text(one, row[name], scale.factor)
        if at_edge:
            words = "below" if at_edge.startswith("<") else "above"
            parts.append(f"{scale.symbol} {words} {scale.say(at_edge[1:])} (at bound)")
            continue
        value = with_error(
            scale.factor * row[name], None if error is None else scale.factor * error
        )
        words = "" if status in {"fitted", None} else f" ({status.replace('_', ' ')})"
        parts.append(f"{scale.symbol} = {scale.say(value)}{words}")
    return f"{', '.join(parts)}." if parts else ""


def _parameter_cell(row: Row, quantity: Quantity) -> str:
    name, factor = quantity.name, scale_of(quantity).factor
    value, error, status = row[name], total_error(row, name), row[f"{name}_status"]
    if status in {"absent", "not_identifiable"}:
        return PARAMETER_MARKS[status]  # no number that pretends to be known
    at_edge = status == "at_bound" and value is not None and limit_text(quantity, value, factor)
    text = at_edge or with_error(
        None if value is None else value * factor, None if error is None else error * factor
    )
    mark = PARAMETER_MARKS.get(status or "", "")
    return f"{text} {mark}" if mark else text


def total_error(row: Row, name: str) -> float | None:
    """Return the standard error of noise and of the misfit together, SI; None where none is known.

    Older results have no misfit in them.
    """
    error = row[f"{name}_se"]
    bend = row.get(f"{name}_misfit_se")
    return math.hypot(error, bend) if error is not None and bend else error


def is_one_for_all(rows: Sequence[Row], name: str) -> bool:
    """Whether several settings have one value, shared or held, and none by a fit of its own."""
    values = [row[name] for row in rows if row[name] is not None]
    held = {row[f"{name}_status"] for row in rows if row[name] is not None} <= {"fixed", "shared"}
    return len(values) > 1 and held and max(values) - min(values) <= _SAME * abs(values[0])


def shared_sentence(rows: Sequence[Row], quantities: Sequence[Quantity]) -> str:
    """Return what all settings have in common, in a line; empty where there is nothing."""
    said = []
    for one in shown_quantities(rows, quantities):
        if not is_one_for_all(rows, one.name):
            continue
        row, scale = next(row for row in rows if row[one.name] is not None), scale_of(one)
        error = total_error(row, one.name)
        value = with_error(
            scale.factor * row[one.name], None if error is None else scale.factor * error
        )
        status = row[f"{one.name}_status"]
        how = "shared by all settings" if status == "shared" else "fixed"
        said.append(f"{scale.symbol} = {scale.say(value)}, {how}")
    return "; ".join(said)


def limit_text(quantity: Quantity, value: float, factor: float) -> str:
    """Return a value that ran to an edge of its range as the limit it ran into.

    Empty where it is none: a friction too small to be determined may be far from the edge.
    """
    if not quantity.is_logarithmic:
        return ""
    low, high = quantity.plausible
    if value < _AT_EDGE * low:
        return f"<{max(value, low) * factor:.2g}"
    return f">{min(value, high) * factor:.2g}" if value > high / _AT_EDGE else ""


# Numbers as one line of characters, for a terminal: `sparkline`; parameters by setting as such.
#
# Values that their standard errors cannot tell apart are drawn flat: scaled to the height of a
# line,
# chance would look like a course.

BLOCK_LEVELS = "▁▂▃▄▅▆▇█"
ASCII_LEVELS = ".:-=+*#@"  # for terminals and files that know nothing else: more ink is more
_WITHOUT_VALUE = {"absent", "at_bound", "not_identifiable"}
_FEWEST, _MOST = 3, 60  # settings that a sparkline is drawn of


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
    finite = [value for value in known if math.isfinite(value)]
    if not finite:
        return " " * len(known)
    low, span = min(finite), max(finite) - min(finite)

    def mark(value: float) -> str:
        if not math.isfinite(value):
            return " "
        share = (value - low) / span if span > 0.0 else 0.5
        return levels[min(len(levels) - 1, int(share * len(levels)))]

    return "".join(map(mark, known))


def differ(values: Sequence[float], errors: Sequence[float]) -> bool:
    """Return whether any two values differ by more than the standard error of their difference.

    Parameters
    ----------
    values, errors : sequence of float
        Values and their standard errors, 0 where one is not known.

    Examples
    --------
    >>> differ([5.0, 5.4, 5.2], [0.3, 0.3, 0.3]), differ([5.0, 5.5, 5.2], [0.3, 0.3, 0.3])
    (False, True)
    """
    pairs = combinations(zip(values, errors, strict=True), 2)
    return any(abs(a - b) > math.hypot(e, f) for (a, e), (b, f) in pairs)


def setting_sparklines(
    rows: Sequence[Row], shown: Sequence[Quantity], levels: str
) -> Iterator[str]:
    """Yield each parameter over the settings as one line, and the MSE, which spans decades.

    Parameters
    ----------
    rows : sequence of mapping
        Rows of the table of parameters.
    shown : sequence of Quantity
        Parameters that are drawn.
    levels : str
        Characters from low to high.
    """
    fitted = [row for row in rows if row["mse_percent"] is not None]
    if len(fitted) < _FEWEST or len(rows) > _MOST:
        return
    for one in shown:
        yield from _parameter(rows, one, levels)
    errors = [row["mse_percent"] for row in rows]
    logs = [math.log10(error) if error else None for error in errors]
    seen = [error for error in errors if error is not None]
    ends = f"{percent(min(seen))} to {percent(max(seen))} %, on a scale of decades"
    yield f"{'MSE':<4} {sparkline(logs, levels=levels)}  {ends}"


def _parameter(rows: Sequence[Row], quantity: Quantity, levels: str) -> Iterator[str]:
    """Yield one parameter as a line, and a second one where it says nothing of its course."""
    name, scale = quantity.name, scale_of(quantity)
    shown = [None if row[f"{name}_status"] in _WITHOUT_VALUE else row[name] for row in rows]
    known = [value for value in shown if value is not None]
    if len(known) < _FEWEST:
        return
    places = [k for k, value in enumerate(shown) if value is not None]
    is_flat = not differ(known, [_error(rows[k][f"{name}_se"]) for k in places])
    heights = [None if value is None else 0.0 for value in shown] if is_flat else shown
    ends = " to ".join(number(scale.factor * end, digits=4) for end in (min(known), max(known)))
    yield f"{scale.symbol:<4} {sparkline(heights, levels=levels)}  {ends} {scale.short_unit}"
    if is_flat and min(known) < max(known):
        yield f"{'':<4} drawn flat: no two settings differ by more than their standard errors"


def _error(error: float | None) -> float:
    return error if error is not None and math.isfinite(error) else 0.0


# The rows that `identify` ends with: all of a run in a table of 80 columns.
#
# Parameters stand as value and standard error in the last digits, ``14.005(11)`` for 14.005 ±
# 0.011.
# What is the same at all settings moves below the table. Where 80 columns are not enough, the
# errors
# go first (values stay rounded by them), then the grade, which the MSE tells too.

_SAME_IDENTIFY_SUMMARY_SHEET = 1e-12


@dataclass(frozen=True, slots=True)
class _Look:
    """What a table shows of what it could."""

    has_errors: bool
    has_grade: bool
    has_flags: bool


_LOOKS = (
    _Look(has_errors=True, has_grade=True, has_flags=True),
    _Look(has_errors=False, has_grade=True, has_flags=True),
    _Look(has_errors=False, has_grade=False, has_flags=True),
    _Look(has_errors=False, has_grade=False, has_flags=False),
)


def summary_sheet(
    rows: Sequence[Row],
    *,
    columns: int = 80,
    levels: str = BLOCK_LEVELS,
    quantities: Sequence[Quantity] = PAPER_QUANTITIES,
) -> Sheet:
    """Return one row per setting: parameters, MSE, grade, outcome, flags; sparklines below.

    Parameters
    ----------
    rows : sequence of mapping
        Rows of the table of parameters.
    columns : int
        Room for a row.
    levels : str
        Characters of the sparklines, from low to high.
    quantities : sequence of Quantity
        What the rows are of.
    """
    shown = shown_quantities(rows, quantities)
    # What is each setting's own has a column, equal at all settings or not.
    common = [q for q in shown if _is_common(rows, q.name) and not _is_own(q, rows)]
    shown = [one for one in shown if one not in common]
    units = scaled_units(quantities)
    notes = (*_common_notes(rows, common), *setting_sparklines(rows, shown, levels))
    sheets = [
        _sheet(rows, shown, look, (*notes, *_legend(rows, shown, look, units))) for look in _LOOKS
    ]
    turned = _turned(rows, shown, (*notes, *_legend(rows, shown, _LOOKS[-1], "")))
    fitting = (one for one in (*sheets, turned) if sheet_width(one, gap=1) <= columns)
    return next(fitting, sheets[-1])


def _is_own(quantity: Quantity, rows: Sequence[Row]) -> bool:
    is_shared = all(row[f"{quantity.name}_status"] == "shared" for row in rows)
    return quantity.scope == SETTING and quantity.default is None and not is_shared


def _is_common(rows: Sequence[Row], name: str) -> bool:
    """Whether all settings have one value, and not by fits of their own."""
    values = [row[name] for row in rows if row[name] is not None]
    held = {row[f"{name}_status"] for row in rows} <= {"fixed", "shared", None}
    return (
        bool(values)
        and held
        and max(values) - min(values) <= _SAME_IDENTIFY_SUMMARY_SHEET * abs(values[0])
    )


def _sheet(
    rows: Sequence[Row], shown: Sequence[Quantity], look: _Look, notes: tuple[str, ...]
) -> Sheet:
    scales = [scale_of(one) for one in shown]
    has = (look.has_grade, True, look.has_flags)

    def last(cells: tuple[str, str, str]) -> tuple[str, ...]:
        return tuple(cell for cell, is_wanted in zip(cells, has, strict=True) if is_wanted)

    return Sheet(
        headings=(
            *("set", *(scale.symbol for scale in scales), "MSE"),
            *last(("grade", "outcome", "flags")),
        ),
        units=("", *(scale.short_unit for scale in scales), "%", *last(("", "", ""))),
        rows=tuple(
            (
                str(row["setting"]),
                *(_cell(row, one, has_error=look.has_errors) for one in shown),
                percent(row["mse_percent"]),
                *last((row["grade"] or NOTHING, row["outcome"].replace("_", " "), _flags(row))),
            )
            for row in rows
        ),
        is_number=(True, *(True for _ in shown), True, *(False for _ in last(("", "", "")))),
        notes=notes,
    )


def _turned(rows: Sequence[Row], shown: Sequence[Quantity], notes: tuple[str, ...]) -> Sheet:
    """Return a column for each setting: for models of many quantities, where settings are few."""
    lines = [
        (scale.symbol, scale.unit_with_power, *(_cell(row, one, has_error=False) for row in rows))
        for one, scale in ((one, scale_of(one)) for one in shown)
    ]
    lines += [
        ("MSE", "%", *(percent(row["mse_percent"]) for row in rows)),
        ("grade", "", *(row["grade"] or NOTHING for row in rows)),
        ("outcome", "", *(row["outcome"].replace("_", " ") for row in rows)),
        ("flags", "", *(_flags(row) for row in rows)),
    ]
    filled = tuple(line for line in lines if any(line[2:]))
    return Sheet(
        headings=("set", "", *(str(row["setting"]) for row in rows)),
        units=("",) * (len(rows) + 2),
        rows=filled,
        is_number=(False, False, *(True for _ in rows)),
        notes=notes,
    )


def _cell(row: Row, quantity: Quantity, *, has_error: bool) -> str:
    name = quantity.name
    value, error, status = row[name], total_error(row, name), row[f"{name}_status"]
    if status in {"absent", "not_identifiable"}:
        return PARAMETER_MARKS[status]
    factor = scale_of(quantity).factor
    at_edge = status == "at_bound" and value is not None and limit_text(quantity, value, factor)
    text = at_edge or rounded_by_error(
        None if value is None else factor * value,
        None if error is None else factor * error,
        has_error=has_error,
    )
    mark = PARAMETER_MARKS.get(status or "", "")
    return f"{text} {mark}" if mark else text


def _flags(row: Row) -> str:
    """Return what else to know of a setting, in a few characters."""
    share = row.get("cavitation_fraction")
    return f"cav. {100.0 * share:.0f} %" if share else ""


def _common_notes(rows: Sequence[Row], shown: Sequence[Quantity]) -> Iterator[str]:
    for one in shown:
        name, scale = one.name, scale_of(one)
        row = next(row for row in rows if row[name] is not None)
        error = total_error(row, name)
        text = rounded_by_error(
            scale.factor * row[name], None if error is None else scale.factor * error
        )
        how = {"shared": "shared by all settings", "fixed": "fixed"}[row[f"{name}_status"]]
        yield f"{scale.symbol} = {scale.say(text)}, {how}"


def _legend(
    rows: Sequence[Row], shown: Sequence[Quantity], look: _Look, units: str
) -> tuple[str, ...]:
    names = [one.name for one in shown]
    cells = (_cell(row, one, has_error=True) for row in rows for one in shown)
    example = next((cell for cell in cells if re.fullmatch(r"-?[\d.]+\([\d.]+\)\S*", cell)), "")
    said = errors_and_flags(rows, names, shows_errors=look.has_errors, example=example)
    return (*units_and_marks(rows, names, units), *said)


# The MSE, one row per setting and log; the grades counted; what makes a fit less than plain.

_GRADES = ("excellent", "good", "poor", "withheld")


def mse_sheet(
    everything: Sequence[Row],
    parameters: Sequence[Row],
    quantities: Sequence[Quantity] = PAPER_QUANTITIES,
) -> Sheet:
    """Return one row per setting and log: MSE, noise floor, grade; the outcome per setting."""
    settings = {row["setting"]: row for row in parameters}
    logs: dict[Setting, list[str]] = {}
    for row in everything:
        is_fitted_log = row["log"] and not _role(row)
        logs.setdefault(row["setting"], []).extend([row["log"]] if is_fitted_log else [])
    rows = []
    for row in everything:
        mine = logs[row["setting"]]
        is_whole = not row["log"]
        if mine == [row["log"]]:  # the row of its setting says the same
            continue
        setting = settings.get(row["setting"], {})  # one that was only predicted has no parameters
        name = row["log"] or (mine[0] if len(mine) == 1 else "all logs")
        rows.append(
            (
                str(row["setting"]) if is_whole or not setting else "",
                name,
                percent(row["mse_percent"]),
                percent(row["noise_floor_percent"]),
                row["grade"] or NOTHING,
                str(row["n_samples"]),
                setting["outcome"].replace("_", " ") if is_whole else "",
                flags(setting, quantities) if is_whole else _role(row),
            )
        )
    return Sheet(
        headings=("setting", "log", "MSE", "noise floor", "grade", "samples", "outcome", "flags"),
        units=("", "", "%", "%", "", "", "", ""),
        rows=tuple(rows),
        is_number=(True, False, True, True, False, True, False, False),
    )


def grade_counts(rows: Iterable[Row]) -> str:
    """Return how many rows of a table have each grade, as a sentence."""
    grades = [row["grade"] for row in rows]
    counts = [f"{grades.count(g)} {g}" for g in _GRADES if g in grades]
    return f"Grades: {', '.join(counts)} (excellent below 1 %, good below 5 %)."


def flags(row: Row, quantities: Sequence[Quantity] = PAPER_QUANTITIES) -> str:
    """Return what makes a setting's parameters less than plainly fitted, in words."""
    symbols = {one.name: one.symbol for one in quantities}
    marks = {
        key.removesuffix("_status"): status
        for key, status in row.items()
        if key.endswith("_status")
    }
    found = [
        f"{symbols.get(name, name)} {words}"
        for status, words in (("at_bound", "at bound"), ("not_identifiable", "not identifiable"))
        for name, found in marks.items()
        if found == status
    ]
    if row.get("cavitation_fraction"):
        found.append(f"cavitates for {100.0 * row['cavitation_fraction']:.1f} % of the cycle")
    return "; ".join(found)


def _role(row: Row) -> str:
    return "held out: predicted, not fitted" if row.get("role") == "held_out" else ""


# How near each setting is to cavitation, one row per setting.

_BAR = 1e5  # Pa


def cavitation_sheet(rows: Sequence[Mapping[str, Any]]) -> Sheet:
    """Return one row per setting: lowest pressure, share of the cycle, and what may still change.

    Columns of another version may be missing; a setting that tells nothing has no row.
    """
    known = [
        row
        for row in rows
        if row.get("lowest_pressure") is not None or row.get("r_m3_cavitation_margin") is not None
    ]
    return Sheet(
        headings=("setting", "lowest pressure", "in chamber", "cavitates", "R_m3 margin", "gas"),
        units=("", "bar", "", "% of cycle", "%", "bar at least"),
        rows=tuple(
            (
                str(row["setting"]),
                number(_times(row.get("lowest_pressure"), 1.0 / _BAR), digits=3),
                str(row.get("lowest_pressure_chamber") or NOTHING),
                number(_times(row.get("cavitation_fraction"), 100.0), digits=3),
                number(_times(row.get("r_m3_cavitation_margin"), 100.0), digits=3),
                number(_times(row.get("safe_gas_pressure"), 1.0 / _BAR), digits=3),
            )
            for row in known
        ),
        is_number=(True,) * 6,
        notes=(ABSOLUTE_PRESSURES,),
    )


def _times(value: float | None, factor: float) -> float | None:
    return None if value is None else value * factor


# The checklist: one row per check, and how many were passed.

CHECK_WORDS = {True: "passed", False: "FAILED", None: "not evaluated"}


def check_summary(checks: Sequence[Check]) -> str:
    """Return how many checks were passed, failed and not looked at."""
    counts = {word: sum(check.passed is word for check in checks) for word in (True, False, None)}
    said = f"{counts[True]} of {len(checks)} checks passed"
    return said + (f", {counts[None]} not evaluated" if counts[None] else "")


def check_lines(checks: Sequence[Check]) -> list[str]:
    """Return the summary and each failed check with its reason, for the terminal."""
    failed = [f"FAILED {check.name}: {check.reason}" for check in checks if check.passed is False]
    return [check_summary(checks), *failed]


def check_sheet(checks: Sequence[Check]) -> Sheet:
    """Return one row per check."""
    return Sheet(
        headings=("check", "result", "reason"),
        units=("", "", ""),
        rows=tuple((check.name, CHECK_WORDS[check.passed], check.reason) for check in checks),
        is_number=(False, False, False),
    )


# What was held out and how well it is predicted, as rows.

_NO_ONE = "varies"


def held_out_sheet(predictions: Iterable[Prediction], *, is_narrow: bool = False) -> Sheet:
    """Return one row per prediction: the motion, its MSE beside the fitted logs', the verdict.

    Parameters
    ----------
    predictions : iterable of Prediction
        What was held out.
    is_narrow : bool
        Leave out the motion, for a terminal.
    """
    rows = []
    for one in predictions:
        # What moves beside the steady cycles has no frequency of its own.
        has_one = one.trace.frequency > 0.0
        motion = (
            number(1e3 * one.trace.amplitude, digits=3),
            number(one.trace.frequency, digits=3) if has_one else _NO_ONE,
        )
        rows.append(
            (
                str(one.setting),
                one.trace.name,
                one.cycles,
                *(() if is_narrow else motion),
                percent(one.mse_percent),
                percent(one.fitted_mse_percent),
                one.verdict,
            )
        )
    middle = ((), (), ()) if is_narrow else (("ampl.", "freq."), ("mm", "Hz"), (True, True))
    return Sheet(
        headings=("set", "held out", "cycles", *middle[0], "MSE", "fitted", "verdict"),
        units=("", "", "", *middle[1], "%", "%", ""),
        rows=tuple(rows),
        is_number=(True, False, False, *middle[2], True, True, False),
    )
