"""What is exported of a run: the damper at one temperature, its settings and their errors."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np

from damperfit import __version__
from damperfit.damper.warmed import Warmed
from damperfit.errors import ConfigurationError
from damperfit.results import Run, Tested, segments_in

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from numpy.typing import NDArray

    from damperfit.adjustment import Sine
    from damperfit.damper.model import Model, Values
    from damperfit.results import SettingResult
    from damperfit.simulation import SolverOptions
    from damperfit.tables.reading import LogSignals
    from damperfit.tested.setting import Setting

    FloatArray = NDArray[np.float64]

__all__ = ["ExportedRun", "ExportedSetting", "Tested", "exported_run"]


@dataclass(frozen=True, slots=True, eq=False)
class ExportedSetting:
    """One setting.

    Attributes
    ----------
    setting : Setting
        Where the adjusters stand.
    values : Values
        Of the model, SI.
    mse_percent : float
        NaN where it is not known.
    speed : float or None
        Highest speed of its own logs, m/s.
    uncertain : tuple of str
        Quantities that have an error.
    covariance : numpy.ndarray
        Of these, of u = ln y (plain y for linear quantities), shape (k, k).
    unlimited : mapping of str to (float, float)
        Quantities without a limit on one side or both: the ends between which they may be.
    """

    setting: Setting
    values: Values
    mse_percent: float = math.nan
    speed: float | None = None
    uncertain: tuple[str, ...] = ()
    covariance: FloatArray = field(default_factory=lambda: np.zeros((0, 0)))
    unlimited: Mapping[str, tuple[float, float]] = field(
        default_factory=lambda: MappingProxyType({})
    )


@dataclass(frozen=True, slots=True, eq=False)
class ExportedRun:
    """A `Run` as the targets need it: attributes as there, and these.

    Attributes
    ----------
    damper : Model
        At one temperature, where the run's follows it: other programs know of none.
    settings : tuple of ExportedSetting
        Rising; at least one.
    version : str
        Of damperfit, as it writes.
    notes : tuple of str
        What else to know of the values.
    """

    name: str
    damper: Model
    settings: tuple[ExportedSetting, ...]
    motion: Sine
    tested: Tested
    solver: SolverOptions
    identity: Mapping[str, str] = field(default_factory=lambda: MappingProxyType({}))
    version: str = __version__
    digest: str = ""
    remarks: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    run: Run = field(default_factory=Run)

    @property
    def folder(self) -> Path:
        """Where its tables are."""
        return self.run.folder

    @property
    def record(self) -> Mapping[str, Any]:
        """What run.json tells."""
        return self.run.record

    @property
    def signals(self) -> tuple[LogSignals, ...]:
        """Measured and simulated signals by setting and log."""
        return self.run.signals


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
    damper, notes = run.damper, []
    if isinstance(damper, Warmed):
        at = f"{damper.oil_temperature:g} degC (fitted at {damper.reference:g} degC)"
        notes.append(f"resistances as they are at {at}")
    settings = tuple(_setting(one, run, damper) for one in run.settings)
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
    return ExportedRun(
        run.name,
        damper.plain if isinstance(damper, Warmed) else damper,
        settings,
        motion,
        run.tested,
        run.solver,
        MappingProxyType(run.identity),
        digest=run.digest,
        remarks=run.remarks,
        notes=tuple(notes),
        run=run,
    )


def _setting(one: SettingResult, run: Run, damper: Model) -> ExportedSetting:
    values = one.values
    if isinstance(damper, Warmed):
        values = damper.at_reference(values, damper.oil_temperature)
    names = (*one.own, *one.shared) if one.covariance is not None else ()
    kept = [k for k, name in enumerate(names) if name in values.names]
    covariance = np.zeros((0, 0)) if one.covariance is None else one.covariance
    return ExportedSetting(
        one.setting,
        values,
        one.mse_percent,
        _speed(run, one.setting),
        tuple(names[k] for k in kept),
        covariance[np.ix_(kept, kept)],
        {name: (one.intervals[name][0] or 0.0, math.inf) for name in one.unlimited},
    )


def _speed(run: Run, setting: Setting) -> float | None:
    """The highest speed of the setting's own logs, m/s; None: the run does not tell it."""
    logs = run.record.get("inputs")
    speeds = [
        segment.get("peak_speed_m_per_s")
        for log in (logs if isinstance(logs, list) else ())
        if isinstance(log, dict) and log.get("setting") == setting.cell
        for segment in segments_in(log)
    ]
    return max((float(one) for one in speeds if isinstance(one, int | float)), default=None)
