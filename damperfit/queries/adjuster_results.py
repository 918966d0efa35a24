"""A results folder read back as an adjuster: its settings with their errors, damper and motion."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from damperfit.adjustment.motions import Sine
from damperfit.damper.warmed import Warmed
from damperfit.errors import ConfigurationError
from damperfit.results import Run
from damperfit.simulation import refuse_amplitude
from damperfit.units.quantities import parse_quantity

if TYPE_CHECKING:
    from pathlib import Path

    from damperfit.adjustment.stage import Stage
    from damperfit.damper.model import Model
    from damperfit.simulation import SolverOptions
    from damperfit.uncertainty import SpeedForces

__all__ = ["AdjusterResults", "adjuster_of", "read_adjuster_results"]


@dataclass(frozen=True, slots=True, eq=False)
class AdjusterResults:
    """The settings of a results folder, and the motion at which they are compared.

    Attributes
    ----------
    stages : tuple of Stage
        By rising setting.
    damper : Model
        Geometry, oil and gas of the run.
    sine : Sine
        The test's own motion, or the one asked for: the named speeds go up to its peak.
    source : str
        At what forces are given, for people.
    solver : SolverOptions
        How exactly to integrate.
    remarks : tuple of str
        What was missing or damaged in the folder.
    forces : tuple of SpeedForces
        As measured, at the motion of the tests.
    notes : tuple of str
        What is so, and nothing to mend in the folder.
    """

    stages: tuple[Stage, ...]
    damper: Model
    sine: Sine
    source: str
    solver: SolverOptions
    remarks: tuple[str, ...]
    forces: tuple[SpeedForces, ...] = ()
    notes: tuple[str, ...] = ()


def read_adjuster_results(
    folder: Path,
    *,
    config: Path | None = None,
    amplitude: str | None = None,
    frequency: str | None = None,
    temperature: str | None = None,
) -> AdjusterResults:
    """Read the settings, damper and motion of a results folder.

    Parameters
    ----------
    folder : pathlib.Path
        What `identify` wrote.
    config : pathlib.Path, optional
        Configuration; its damper is taken where the run does not tell its own.
    amplitude, frequency : str, optional
        Motion instead of the test's own.
    temperature : str, optional
        Of the oil, instead of the reference temperature.

    Raises
    ------
    ConfigurationError
        There is no such folder, no setting in it has parameters, ``config`` declares another
        damper, or the motion is none.
    """
    run = Run.load(folder, parts=("parameters",), config=config, temperature=temperature)
    return adjuster_of(run, amplitude=amplitude, frequency=frequency)


def adjuster_of(
    run: Run, *, amplitude: str | None = None, frequency: str | None = None
) -> AdjusterResults:
    """Return a run as an adjuster; see `read_adjuster_results`."""
    if not run.settings:
        why = f" ({'; '.join(run.remarks)})" if run.remarks else ""
        raise ConfigurationError(
            f"no setting has all parameters{why}; run damperfit identify LOGS first",
            subject=run.place,
        )
    damper = run.damper
    own = run.motion_of_tests if amplitude and frequency else run.motion
    sine = _motion(own, amplitude, frequency)
    notes = list(run.notes)
    if sine is not own:
        outside = run.tested.outside
        beyond = list(
            outside(amplitude=sine.amplitude, frequency=sine.frequency, speed=sine.peak_speed)
        )
        if beyond:
            notes.append(f"never tested: {', '.join(beyond)}")
        notes.append(
            f"the sine of {1e3 * sine.amplitude:.4g} mm at {sine.frequency:.4g} Hz says which "
            "speeds are shown; the forces are those at constant speed, whatever the stroke"
        )
    source = "at constant speed"
    if isinstance(damper, Warmed):
        source += f" and {damper.oil_temperature:g} degC"
    refuse_amplitude(sine.amplitude, damper.travel)
    return AdjusterResults(
        run.settings,
        damper,
        sine,
        source,
        run.solver,
        (*run.remarks, *run.remarks_on_errors),
        run.speed_forces,
        tuple(notes),
    )


def _motion(own: Sine | None, amplitude: str | None, frequency: str | None) -> Sine:
    """Return the motion asked for, else the test's own."""
    size = parse_quantity(amplitude, "length", option="--amplitude") if amplitude else None
    rate = parse_quantity(frequency, "frequency", option="--frequency") if frequency else None
    for option, value in (("--amplitude", size), ("--frequency", rate)):
        if value is not None and value <= 0.0:
            raise ConfigurationError(f"{option} {value:g}: expected more than 0")
    if own is not None and size is None and rate is None:
        return own
    a = size if size is not None else own.amplitude if own else math.nan
    f = rate if rate is not None else own.frequency if own else math.nan
    return Sine(a, f)
