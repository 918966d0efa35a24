"""What settings tell each other: which parts a law needs, and what is the same at all of them.

The softest and the stiffest setting tell laws apart as well as all do, but for a blow-off that
neither reaches: the setting between them with the most bleed and the softest spring may. So others
are asked before a part of one stroke's valve is taken out. Friction, oil and mounting are those of
the damper and its rig: a fit that needs others than the rest lies in a wrong valley.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

from damperfit.damper.quantity import DAMPER, RIG
from damperfit.errors import SimulationError
from damperfit.laws.choosing import Tried, effective_samples, judged
from damperfit.laws.law_fit import UNDETERMINED, fit_law
from damperfit.tested.setting import nearest_setting

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from damperfit.damper.model import Model, Values
    from damperfit.laws.law_fit import LawFit, SettingLogs
    from damperfit.simulation import SolverOptions
    from damperfit.tested.setting import Setting

__all__ = ["freed_of", "from_another", "had_by", "lent", "needed_at", "worst_missed"]

_MOST = 4  # settings that are asked
# Settings that lend one what is the same at all of them: those that leave least.
_LENDING = 2
# Times what a fit leaves by itself: what another lends it is not its own if it leaves more beside
# that, and is not freed again.
_LENT_IN_VAIN = 20.0


def needed_at(
    small: Tried, large: Tried, elsewhere: Sequence[SettingLogs], solver: SolverOptions
) -> str:
    """Return why a setting needs what the smaller law lacks; nothing where none does.

    What is left is looked at stroke by stroke: a tenth of the force of a weak bump stroke is little
    beside a strong rebound.

    Parameters
    ----------
    small, large : Tried
        Two laws, the first without a part of the second.
    elsewhere : sequence of SettingLogs
        Settings that these were not compared at.
    solver : SolverOptions
        How exactly to integrate.
    """
    for one in _some_of(elsewhere):
        try:
            less, more = (
                Tried(law.title, (_fitted_at(law, one, freed_of(law), solver),))
                for law in (small, large)
            )
        except SimulationError:
            continue
        n_eff = effective_samples(more, (one,))
        verdict = judged(less, more, n_eff, left_percent=less.fits[0].worst_stroke_percent)
        if verdict.takes_larger:
            return f"setting {one.setting} needs it: {verdict.reason}"
    return ""


def _fitted_at(
    law: Tried, one: SettingLogs, freed: tuple[str, ...], solver: SolverOptions
) -> LawFit:
    """The law at a setting that it was not compared at.

    From its own starts, for what no compared setting determines is no start for this one; where
    these lead to a wrong valley, from the compared ones: what is left there tells nothing of parts.
    """
    own = fit_law(law.fits[0].model, one, freed=freed, solver=solver, is_whole=False)
    if not Tried(law.title, (own,)).leaves_something:
        return own
    beside = _fitted_beside(law, one, {fit.setting: fit for fit in law.fits}, solver)
    return own if beside is None else min(own, beside, key=lambda fit: fit.mse_percent)


def _some_of(settings: Sequence[SettingLogs]) -> Sequence[SettingLogs]:
    return settings[:: max(1, -(-len(settings) // _MOST))]


def worst_missed(
    law: Tried, asked: Sequence[SettingLogs], solver: SolverOptions
) -> tuple[SettingLogs, Tried] | None:
    """Return the setting at which a law leaves most, with its fit; None where it leaves little.

    Parameters
    ----------
    law : Tried
        The law, with its fits at the settings that were compared.
    asked : sequence of SettingLogs
        Some of these settings, and others.
    solver : SolverOptions
        How exactly to integrate.
    """
    known = {one.setting: one for one in law.fits}
    others = _some_of([one for one in asked if one.setting not in known])
    found: list[tuple[float, SettingLogs, Tried]] = []
    for one in asked:
        fit = known.get(one.setting)
        if fit is None and one in others:
            fit = _fitted_beside(law, one, known, solver)
        if fit is None:
            continue
        there = Tried(law.title, (fit,))
        if there.leaves_something:
            found.append((there.left_over, one, there))
    return max(found, key=lambda row: row[0])[1:] if found else None


def _fitted_beside(
    law: Tried, one: SettingLogs, known: Mapping[Setting, LawFit], solver: SolverOptions
) -> LawFit | None:
    """The law at another setting, from what is the damper's or the rig's at the nearest.

    Where that leaves something also without its valves, which may lead to a wrong valley.
    """
    near = known[nearest_setting(one.setting, known) or one.setting].values
    logs, found = from_another(one, near), None
    for start in (near, None):
        try:
            fit = fit_law(
                law.fits[0].model, logs, freed=freed_of(law), near=start, solver=solver,
                is_whole=False,
            )  # fmt: skip
        except SimulationError:
            continue
        if found is None or fit.mse_percent < found.mse_percent:
            found = fit
        if not Tried(law.title, (found,)).leaves_something:
            return found
    return None if found is None else lent(found, one, law.fits, solver)


def lent(
    own: LawFit,
    logs: SettingLogs,
    others: Sequence[LawFit],
    solver: SolverOptions,
    *,
    is_whole: bool = False,
) -> LawFit:
    """Return a fit that leaves something, or a better one from what other settings have found.

    So is one that leaves nothing with friction, oil or mounting unlike another that leaves nothing.

    What is the damper's or the rig's is held where another has it until the valves are found beside
    it, and then freed: all at once, a preload may be taken for a friction again.

    Parameters
    ----------
    own : LawFit
        The law at the setting.
    logs : SettingLogs
        Its logs.
    others : sequence of LawFit
        The same law at other settings, and perhaps at this one.
    solver : SolverOptions
        How exactly to integrate.
    is_whole : bool
        As of `fit_law`.
    """
    lending = [one for one in others if one.setting != own.setting]
    if not _leaves_something(own):
        lending = [o for o in lending if _is_unlike(own, o) and not _leaves_something(o)]
    freed = freed_of(Tried("", (own,)))
    best = own
    for other in sorted(lending, key=lambda one: Tried("", (one,)).left_over)[:_LENDING]:
        known = _shared(other.values, own.free)
        try:
            held = fit_law(own.model, logs, freed=freed, fixed=known, solver=solver, is_whole=False)
            if held.mse_percent > _LENT_IN_VAIN * own.mse_percent:
                continue
            again = fit_law(
                own.model, logs, freed=freed, near=held.values, solver=solver, is_whole=is_whole
            )
        except SimulationError:
            continue
        best = min(best, again, key=lambda one: one.mse_percent)
    return best


def _leaves_something(fit: LawFit) -> bool:
    return Tried("", (fit,)).leaves_something


def _is_unlike(own: LawFit, other: LawFit) -> bool:
    """Whether two settings tell unlike numbers of what is the damper's or the rig's."""
    known = [_shared(one.values, one.free) for one in (own, other)]
    untold = {*own.undetermined, *own.at_bound, *other.undetermined, *other.at_bound}
    factor = math.log(UNDETERMINED)
    return any(
        abs(math.log(known[0][name] / known[1][name])) > factor
        for name in known[0].keys() & known[1].keys() - untold
        if own.values.quantity(name).is_logarithmic
    )


def _shared(values: Values, names: Sequence[str]) -> dict[str, float]:
    """What is the damper's or the rig's."""
    return {
        name: getattr(values, name)
        for name in names
        if name in values.names and values.quantity(name).scope in {DAMPER, RIG}
    }


def from_another(one: SettingLogs, other: Values) -> SettingLogs:
    """Return logs of a setting that start with what is the damper's or the rig's from another.

    Friction, oil and mounting do not follow the clicks; the loops of one setting may take a
    friction for a preload.

    Parameters
    ----------
    one : SettingLogs
        The logs.
    other : Values
        Of a law at another setting.
    """
    return replace(one, more_start={**_shared(other, other.names), **one.more_start})


def had_by(model: Model, names: tuple[str, ...]) -> tuple[str, ...]:
    """Return of some quantities those that a law has: a monotube has no return checks.

    Parameters
    ----------
    model : Model
        The law.
    names : tuple of str
        Quantities of any law.
    """
    return tuple(name for name in names if name in model.names)


def freed_of(law: Tried) -> tuple[str, ...]:
    """Return what a law's fits have free although it has a default.

    Parameters
    ----------
    law : Tried
        A law with its fits.
    """
    fit = law.fits[0]
    return tuple(name for name in fit.free if fit.model.quantity(name).default is not None)
