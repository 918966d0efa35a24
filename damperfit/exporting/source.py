"""What is exported of a run: the damper at one temperature, and its settings."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from damperfit.damper.warmed import Warmed
from damperfit.errors import ConfigurationError
from damperfit.results import Run

if TYPE_CHECKING:
    from pathlib import Path

    from damperfit.damper.model import Model
    from damperfit.results import SettingResult

__all__ = ["ExportedRun", "exported_run"]


@dataclass(frozen=True, slots=True, eq=False)
class ExportedRun:
    """A run as the targets need it.

    Attributes
    ----------
    run : Run
        Whose test it was, and how it was tested.
    damper : Model
        At one temperature, where the run's follows it: other programs know of none.
    settings : tuple of SettingResult
        Rising; at least one.
    notes : tuple of str
        What else to know of the values.
    """

    run: Run
    damper: Model
    settings: tuple[SettingResult, ...]
    notes: tuple[str, ...] = ()

    @property
    def fastest(self) -> float:
        """Speed of the run's fastest motion, m/s, for settings whose own tests are not known."""
        return (
            self.run.motion.peak_speed if self.run.tested.speed is None else self.run.tested.speed
        )


def exported_run(
    folder: Path, *, config: Path | None = None, temperature: str | None = None
) -> ExportedRun:
    """Read what `identify` wrote, for a target.

    Parameters
    ----------
    folder : pathlib.Path
        Results folder, or a fleet's part.
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
    damper, settings, notes = run.damper, run.settings, []
    if not settings:
        raise ConfigurationError(
            "no setting has all parameters; run damperfit identify LOGS first", subject=folder
        )
    if isinstance(damper, Warmed):
        at = damper.oil_temperature
        notes.append(
            f"resistances as they are at {at:g} degC (fitted at {damper.reference:g} degC)"
        )
        settings = tuple(_at_one_temperature(one, damper) for one in settings)
        damper = damper.plain
    notes += [
        f"{', '.join(one.unlimited)} at setting {one.setting}: the logs set no upper limit, so the "
        "force beyond their speeds may be far off"
        for one in settings
        if one.unlimited
    ]
    run.motion  # noqa: B018 - where it is not known, that is remarked
    return ExportedRun(run, damper, settings, tuple(notes))


def _at_one_temperature(one: SettingResult, damper: Warmed) -> SettingResult:
    values = damper.at_reference(one.values, damper.oil_temperature)
    names = (*one.own, *one.shared)
    kept = [k for k, name in enumerate(names) if name in values.names]
    covariance = None if one.covariance is None else one.covariance[np.ix_(kept, kept)]
    return replace(
        one,
        parameters=values,
        own=tuple(name for name in one.own if name in values.names),
        shared=tuple(name for name in one.shared if name in values.names),
        covariance=covariance,
        open_limits=tuple(pair for pair in one.open_limits if pair[0] in values.names),
    )
