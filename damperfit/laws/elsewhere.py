"""Settings that laws are not compared at, asked before a part of one stroke's valve is taken out.

The softest and the stiffest setting tell laws apart as well as all do, but for a blow-off that
neither reaches: the setting between them with the most bleed and the softest spring may.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from damperfit.errors import SimulationError
from damperfit.laws.choosing import Tried, effective_samples, judged
from damperfit.laws.law_fit import fit_law

if TYPE_CHECKING:
    from collections.abc import Sequence

    from damperfit.damper.model import Model
    from damperfit.laws.law_fit import SettingLogs
    from damperfit.simulation import SolverOptions

__all__ = ["freed_of", "had_by", "needed_at"]

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
    for one in elsewhere[:: max(1, -(-len(elsewhere) // _MOST))]:
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
