"""The chosen law at every setting: by itself, and as one model where a joint fit is asked for."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from damperfit.configuration.what_is_tested import followed
from damperfit.damper.valve_dampers import ValveDamper
from damperfit.errors import SimulationError
from damperfit.identification.descent import Misfit
from damperfit.identification.failures import SettingError
from damperfit.identification.following import Way, declared_way, detected_way
from damperfit.laws import fit_law, from_another, lent
from damperfit.laws.elsewhere import freed_of
from damperfit.laws.together import told_together
from damperfit.tested.setting import nearest_setting
from damperfit.workers import executor

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from damperfit.configuration.options import Configuration
    from damperfit.damper.model import Model
    from damperfit.identification.unknowns import Follows
    from damperfit.laws import JudgedLaw, LawFit, LawSearch, SettingLogs, Tried
    from damperfit.simulation import SolverOptions

__all__ = ["at_every_setting", "told_as_one"]

# Numbers that follow what another of the same valve follows, where the logs tell the way.
_LIKE = {"leak": "bleed", "bleed": "leak", "port": "slope", "width": "slope", "lift": "slope"}


def at_every_setting(
    law: Tried, evidence: Sequence[SettingLogs], solver: SolverOptions, *, jobs: int
) -> tuple[LawFit | None, ...]:
    """Return the law at each setting by itself; None where it cannot be simulated.

    Parameters
    ----------
    law : Tried
        With its fits at the settings that were compared.
    evidence : sequence of SettingLogs
        The logs of all settings.
    solver : SolverOptions
        How exactly to integrate.
    jobs : int
        Threads.
    """
    known, model, freed = {one.setting: one for one in law.fits}, law.fits[0].model, freed_of(law)

    def fit(one: SettingLogs) -> LawFit | None:
        if one.setting in known:
            return known[one.setting]
        try:
            near = nearest_setting(one.setting, known)
            return fit_law(
                model,
                one if near is None else from_another(one, known[near].values),
                freed=freed,
                near=None if near is None or known[near].undetermined else known[near].values,
                solver=solver,
            )
        except SimulationError:
            return None

    with executor(jobs) as pool:
        apart = tuple(pool.map(fit, evidence))
    sound = tuple(one for one in apart if one is not None)

    def beside(logs: SettingLogs, own: LawFit | None) -> LawFit | None:
        return own if own is None else lent(own, logs, sound, solver, is_whole=True)

    with executor(jobs) as pool:
        return tuple(pool.map(beside, evidence, apart))


def told_as_one(  # noqa: PLR0913 - what a search has found and who waits for it
    configuration: Configuration,
    search: LawSearch,
    fits: Sequence[LawFit],
    evidence: Sequence[SettingLogs],
    *,
    layouts: Sequence[ValveDamper],
    jobs: int,
    on_law: Callable[[JudgedLaw], None],
) -> tuple[LawSearch, tuple[LawFit, ...]]:
    """Return the search and the fits of all settings with what one model of them has told.

    They stay as they are where no joint fit shares what no adjuster moves, and where one model
    cannot be simulated.

    Parameters
    ----------
    configuration : Configuration
        The procedure, and what is declared of the adjusters.
    search : LawSearch
        The law that was chosen.
    fits : sequence of LawFit
        That law at each setting by itself.
    evidence : sequence of SettingLogs
        The logs of these settings.
    layouts : sequence of ValveDamper
        That were compared.
    jobs : int
        Threads.
    on_law : callable
        Called with every law that was judged.
    """
    options = configuration.identification
    model = search.chosen.fits[0].model
    if options.procedure != "joint" or search.also or len(fits) < 2:
        return search, tuple(fits)
    if not isinstance(model, ValveDamper) or not _is_shared(configuration, model):
        return search, tuple(fits)
    known = {one.setting: one for one in evidence}
    logs = [known[fit.setting] for fit in fits]
    try:
        found = told_together(
            fits,
            logs,
            _follows(configuration, fits, logs, jobs=jobs),
            layouts=[one for one in layouts if one.name != model.name],
            solver=options.solver,
            jobs=jobs,
            on_law=on_law,
        )
    except (SimulationError, SettingError):
        return search, tuple(fits)
    earlier = tuple(replace(one, is_taken=False) for one in search.laws)
    is_another = found.chosen.fits[0].model.name != model.name
    told = replace(
        search, laws=(*earlier, *found.laws), chosen=found.chosen, is_of_one_model=True,
        alike=found.alike if is_another else search.alike,
    )  # fmt: skip
    return told, found.chosen.fits


def _is_shared(configuration: Configuration, model: ValveDamper) -> bool:
    """Whether a joint fit of this model shares what no adjuster moves.

    The configuration's own model, before a law is chosen, may be another: it has other quantities
    to follow adjusters, and shares others.
    """
    if followed(configuration.document["adjusters"], model, is_law_open=True):
        return True
    is_said = "identification.share" in configuration.declared
    return configuration.identification.is_detecting or not is_said


def _follows(
    configuration: Configuration,
    fits: Sequence[LawFit],
    logs: Sequence[SettingLogs],
    *,
    jobs: int,
) -> Callable[[Model, Sequence[str]], Follows]:
    """From a law and what is free to the adjusters that each quantity follows."""
    adjusters = min(fit.setting for fit in fits).adjusters
    declared = configuration.document["adjusters"]

    def as_declared(model: Model, free: Sequence[str]) -> Follows:
        said = followed(declared, model, is_law_open=True)
        way = declared_way(model, free, {n: who for n, who in said.items() if n in free}, adjusters)
        return _with_own(way, adjusters)

    if followed(declared, fits[0].model, is_law_open=True):
        return as_declared
    told = _with_own(_told(configuration, fits, logs, jobs=jobs), adjusters)

    def as_told(model: Model, free: Sequence[str]) -> Follows:
        found = {}
        for name in free:
            stroke, _, part = name.partition("_")
            like = f"{stroke}_{_LIKE.get(part, part)}"
            if name in told or like in told:
                found[name] = told.get(name, told.get(like, ()))
            elif model.quantity(name).is_offset:
                found[name] = adjusters
        return found

    return as_told


def _told(
    configuration: Configuration,
    fits: Sequence[LawFit],
    logs: Sequence[SettingLogs],
    *,
    jobs: int,
) -> Way:
    options = configuration.identification
    misfits = {
        fit.setting: Misfit(
            one.fitted, fit.model, fit.free, options.solver, options.max_evaluations, lambda: False
        )
        for fit, one in zip(fits, logs, strict=True)
    }
    return detected_way(misfits, {fit.setting: fit.values for fit in fits}, jobs=jobs).way


def _with_own(way: Way, adjusters: tuple[str, ...]) -> Follows:
    return {**way.follows, **dict.fromkeys(way.own, adjusters)}
