"""Parts of a law that do nothing at a setting are left out there, and the rest is fitted again.

A law that logs have chosen is one for all settings. Where a bleed is closed or a mounting has no
play, the number of it runs to the edge of its range; that is the smaller law, not a bound that a
fit strains against.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from damperfit.damper.network import BLOW_OFF_PARTS
from damperfit.damper.quantity import GAS_AMOUNT, STIFFNESS
from damperfit.errors import FitCancelledError, SimulationError
from damperfit.identification.fit_problem import edge_of, kept_within
from damperfit.identification.fit_setting import describe_fit, minimised
from damperfit.identification.outcome import Status
from damperfit.problem import Problem, warning
from damperfit.workers import executor

if TYPE_CHECKING:
    from collections.abc import Callable

    from damperfit.damper.model import Values
    from damperfit.identification.campaign import Campaign
    from damperfit.identification.fit_problem import FitProblem
    from damperfit.identification.fit_setting import Fit

__all__ = [
    "does_nothing",
    "is_nothing",
    "without_idle_parts",
]

# Friction at rest and the speed at which it has gone: two numbers of one part, but for a speed that
# is lower than logs tell.
_AT_REST = ("breakaway", "stribeck_speed")
# Oil that does not give, and gas whose pressure does not change: what the logs do not show.
_AS_IF = {
    STIFFNESS: "the logs do not show the oil give: it is taken as rigid here",
    GAS_AMOUNT: "the logs do not show the gas pressure change with the stroke: it is taken as "
    "constant here",
}


def does_nothing(values: Values, name: str) -> bool:
    """Whether a quantity is at an edge of its range where its part of the model does nothing."""
    one = values.quantity(name)
    return one.edge_at(getattr(values, name)) in one.idle_edges


def is_nothing(values: Values, name: str) -> bool:
    """Whether a quantity that ran to an edge is none, rather than what a fit strains for.

    A friction is also where it is nothing beside the noise.
    """
    is_low = edge_of(values, name)[0] == "below"
    is_from_below = values.quantity(name).idle_edges[:1] == ("below",)
    return does_nothing(values, name) or (is_low and is_from_below)


def without_idle_parts(
    campaign: Campaign, problem_of: Callable[[Fit], FitProblem], *, jobs: int
) -> Campaign:
    """Return the fits with what does nothing at a setting left out of the law there.

    Parameters
    ----------
    campaign : Campaign
        Fits of settings by themselves.
    problem_of : callable
        What is fitted at the setting of a fit.
    jobs : int
        Threads; the result does not depend on them.
    """

    def lean(fit: Fit) -> Fit:
        try:
            return _lean(fit, problem_of(fit))
        except (SimulationError, FitCancelledError):
            return fit

    with executor(jobs) as pool:
        return replace(campaign, fits=tuple(pool.map(lean, campaign.fits)))


def _lean(fit: Fit, problem: FitProblem) -> Fit:
    lost: dict[str, None] = {}
    said: list[Problem] = []
    first = fit.warnings
    while idle := [name for name in _at_edge(fit) if does_nothing(fit.parameters, name)]:
        said += [warning("left-out", _sentence(fit.parameters, name)) for name in idle]
        lost |= dict.fromkeys(one for name in idle for one in _part(fit, name))
        start = kept_within(fit.parameters, lost)
        rest = replace(problem, free=tuple(one for one in problem.free if one not in lost))
        left = {name: _left(fit.parameters, name) for name in lost}
        result = minimised(rest, start, spent=fit.evaluations).with_status(left)
        fit = describe_fit(fit.setting, result, rest)
    return replace(fit, warnings=(*first, *said)) if said else fit


def _left(values: Values, name: str) -> Status:
    return Status.FIXED if values.quantity(name).has_own_edges else Status.ABSENT


def _at_edge(fit: Fit) -> list[str]:
    return [name for name, status in fit.status.items() if status is Status.AT_BOUND]


def _part(fit: Fit, name: str) -> list[str]:
    """A quantity with those that mean nothing without it: a closed blow-off has no slope."""
    one = fit.parameters.quantity(name)
    edge = one.edge_at(getattr(fit.parameters, name))
    if name in _AT_REST:
        is_speed_alone = name == _AT_REST[1] and edge != "above"
        return [name] if is_speed_alone else [two for two in _AT_REST if two in fit.status]
    is_shut = one.group == "blow_off" and one.area_power > 0.0 and edge == "above"
    if not is_shut or one.stroke == "return":
        return [name]
    return [two for two in map(one.beside, BLOW_OFF_PARTS) if two in fit.status]


def _is_above(values: Values, name: str) -> bool:
    return bool(getattr(values, name) >= values.quantity(name).plausible[1])


def _sentence(values: Values, name: str) -> str:
    one = values.quantity(name)
    if one.has_own_edges:
        return (
            f"{one.label} ({one.symbol}): {getattr(values, name):g}, an edge of its range at which "
            "the law is a simpler one, fits best, and is held here."
        )
    if one.role in _AS_IF:
        return f"{one.label} ({one.symbol}): {_AS_IF[one.role]}."
    if name == _AT_REST[1] and not _is_above(values, name):
        return (
            f"{one.label} ({one.symbol}): the logs do not determine one below "
            f"{1e3 * one.plausible[0]:g} mm/s, at which it is held here."
        )
    if one.area_power < 0.0 and _is_above(values, name):
        return (
            f"{one.label} ({one.symbol}): the logs do not determine one above "
            f"{one.plausible[1] / 10.0**one.power:g} {one.shown_unit}, at which it is held here."
        )
    return (
        f"{one.label} ({one.symbol}) does nothing here: it ran to the edge of its range, and the "
        "law is fitted without it."
    )
