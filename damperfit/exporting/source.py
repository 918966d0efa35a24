"""What is exported of a run: the damper at one temperature, and its settings."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from damperfit.damper.warmed import Warmed
from damperfit.errors import ConfigurationError
from damperfit.results import Run, segments_in

if TYPE_CHECKING:
    from pathlib import Path

    from damperfit.damper.model import Model
    from damperfit.results import SettingResult
    from damperfit.tested.setting import Setting

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

    def tested_speed(self, setting: Setting) -> float:
        """Return the highest speed of a setting's own logs, m/s; else that of the run's motion."""
        logs = self.run.record.get("inputs")
        speeds = [
            segment.get("peak_speed_m_per_s")
            for log in (logs if isinstance(logs, list) else ())
            if isinstance(log, dict) and log.get("setting") == setting.cell
            for segment in segments_in(log)
        ]
        known = [float(one) for one in speeds if isinstance(one, int | float)]
        return max(known, default=self.run.motion.peak_speed)


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
        settings = tuple(
            replace(one, parameters=damper.at_reference(one.values, at)) for one in settings
        )
        damper = damper.plain
    notes += [
        f"{', '.join(one.unlimited)} at setting {one.setting}: the logs set no upper limit, so the "
        "force beyond their speeds may be far off"
        for one in settings
        if one.unlimited
    ]
    run.motion  # noqa: B018 - where it is not known, that is remarked
    return ExportedRun(run, damper, settings, tuple(notes))
