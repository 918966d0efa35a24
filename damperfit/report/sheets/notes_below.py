"""The sentences below the tables: what units, marks and columns mean."""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING, Any

from damperfit.tested.setting import clicks_between, lines_of

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from damperfit.tested.setting import Setting

    Row = Mapping[str, Any]

__all__ = [
    "ABSOLUTE_PRESSURES",
    "BRANCHES",
    "BRANCHES_AND_RATIO",
    "DAMPING_SHARE",
    "FORCE_AS_MEASURED",
    "MEASURED_BESIDE_MODEL",
    "energy_and_temperature",
    "errors_and_flags",
    "force_and_click_at",
    "over_several_clicks",
    "simulated_clicks_at",
    "stroke_and_click_at",
    "units_and_marks",
]

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
