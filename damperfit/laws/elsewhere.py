"""Settings that laws are not compared at, asked before a part of one stroke's valve is taken out.

The softest and the stiffest setting tell laws apart as well as all do, but for a blow-off that
neither reaches: the setting between them with the most bleed and the softest spring may.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from damperfit.damper.quantity import DAMPER, RIG
from damperfit.errors import SimulationError
from damperfit.laws.choosing import Tried, effective_samples, judged
from damperfit.laws.law_fit import fit_law
from damperfit.tested.setting import nearest_setting

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from damperfit.damper.model import Model, Values
    from damperfit.laws.law_fit import LawFit, SettingLogs
    from damperfit.simulation import SolverOptions
    from damperfit.tested.setting import Setting

__all__ = ["freed_of", "from_another", "had_by", "needed_at", "worst_missed"]

_MOST = 4  # settings that are asked


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
    freed = freed_of(large)
    for one in _some_of(elsewhere):
        try:
            # From its own starts: what no compared setting determines is no start for this one.
            less, more = (
                Tried(
                    law.title,
                    (fit_law(law.fits[0].model, one, freed=freed, solver=solver, is_whole=False),),
                )
                for law in (small, large)
            )
        except SimulationError:
            continue
        n_eff = effective_samples(more, (one,))
        verdict = judged(less, more, n_eff, left_percent=less.fits[0].worst_stroke_percent)
        if verdict.takes_larger:
            return f"setting {one.setting} needs it: {verdict.reason}"
    return ""


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
    """The law at another setting, from what is the damper's or the rig's at the nearest."""
    near = known[nearest_setting(one.setting, known) or one.setting].values
    model = law.fits[0].model
    try:
        return fit_law(
            model,
            from_another(one, near),
            freed=freed_of(law),
            near=near,
            solver=solver,
            is_whole=False,
        )
    except SimulationError:
        return None


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
    known = {
        name: getattr(other, name)
        for name in other.names
        if other.quantity(name).scope in {DAMPER, RIG}
    }
    return replace(one, more_start={**known, **one.more_start})


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
