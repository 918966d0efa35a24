"""What is handed over: the damper, its values by setting, and what they were found from."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import TYPE_CHECKING

from damperfit import __version__
from damperfit.damper.warmed import Warmed
from damperfit.errors import ConfigurationError
from damperfit.results import Run, Tested

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from damperfit.adjustment import Sine
    from damperfit.damper.model import Model, Values
    from damperfit.simulation import SolverOptions
    from damperfit.tested.setting import Setting

__all__ = ["HandedOver", "HandedSetting", "Tested", "hand_over"]


@dataclass(frozen=True, slots=True)
class HandedSetting:
    """One setting.

    Attributes
    ----------
    setting : Setting
        Where the adjusters stand.
    values : Values
        Of the model, SI.
    mse_percent : float
        NaN where it is not known.
    """

    setting: Setting
    values: Values
    mse_percent: float = math.nan


@dataclass(frozen=True, slots=True)
class HandedOver:
    """A results folder as its targets need it.

    Attributes
    ----------
    name : str
        Of the folder.
    damper : Model
        Geometry, oil, gas and law.
    settings : tuple of HandedSetting
        Rising; at least one.
    motion : Sine
        The test's fastest.
    tested : Tested
        Range of the tests.
    solver : SolverOptions
        How exactly the model is integrated.
    identity : mapping of str to str
        Whose test it was: what is known of damper, serial, customer, operator, date, rig.
    version : str
        Of damperfit, as it writes.
    digest : str
        SHA-256 of the table of parameters.
    remarks : tuple of str
        What was missing or damaged.
    notes : tuple of str
        What else to know of the values.
    folder : pathlib.Path or None
        The results folder itself, for those who hand on its tables.
    """

    name: str
    damper: Model
    settings: tuple[HandedSetting, ...]
    motion: Sine
    tested: Tested
    solver: SolverOptions
    identity: Mapping[str, str] = field(default_factory=lambda: MappingProxyType({}))
    version: str = __version__
    digest: str = ""
    remarks: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    folder: Path | None = None


def _at_one_temperature(
    damper: Model, settings: tuple[HandedSetting, ...], notes: list[str]
) -> tuple[Model, tuple[HandedSetting, ...]]:
    """A damper that follows the temperature, as it is at one: other programs know of none."""
    if not isinstance(damper, Warmed):
        return damper, settings
    told = damper.oil_temperature
    notes.append(f"resistances as they are at {told:g} degC (fitted at {damper.reference:g} degC)")
    there = (replace(one, values=damper.at_reference(one.values, told)) for one in settings)
    return damper.plain, tuple(there)


def hand_over(
    folder: Path, *, config: Path | None = None, temperature: str | None = None
) -> HandedOver:
    """Read what `identify` wrote, for a target.

    Parameters
    ----------
    folder : pathlib.Path
        Results folder.
    config : pathlib.Path, optional
        Configuration; its damper is taken where the run does not tell its own.
    temperature : str, optional
        Of the oil, where the damper follows it; the reference temperature by default.

    Raises
    ------
    ConfigurationError
        There is no such folder, no setting in it has parameters, or ``config`` declares another
        damper.
    """
    run = Run.load(folder, parts=("parameters",), config=config, temperature=temperature)
    notes: list[str] = []
    known = tuple(HandedSetting(one.setting, one.values, one.mse_percent) for one in run.settings)
    damper, settings = _at_one_temperature(run.damper, known, notes)
    if not settings:
        raise ConfigurationError(
            f"{folder}: no setting has all parameters; run damperfit identify LOGS first"
        )
    notes += [
        f"{', '.join(one.unlimited)} at setting {one.setting}: the logs set no upper limit, so the "
        "force beyond their speeds may be far off"
        for one in run.settings
        if one.unlimited
    ]
    motion = run.motion
    return HandedOver(
        run.name,
        damper,
        settings,
        motion,
        run.tested,
        run.solver,
        MappingProxyType(run.identity),
        digest=run.digest,
        remarks=run.remarks,
        notes=tuple(notes),
        folder=folder,
    )
