"""One simulated test: whose parameters, which motion, what comes of it."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from damperfit.atomic import settle
from damperfit.characteristics import Characteristics, characterise
from damperfit.conditioning import condition
from damperfit.configuration.options import parameter_value
from damperfit.damper.parameters import PARAMETER_NAMES, Parameters
from damperfit.damper.reference import REFERENCE_SOURCE, reference_parameters
from damperfit.errors import ConfigurationError, DamperfitError, InternalError, mishap_of
from damperfit.identification.model_versus_log import motion_of
from damperfit.readers import read_log
from damperfit.simulation import (
    Response,
    refuse_amplitude,
    simulate,
    sine_motion,
    triangle_motion,
)
from damperfit.tables import read_parameters

if TYPE_CHECKING:
    from collections.abc import Mapping

    from damperfit.configuration.options import Configuration
    from damperfit.recording import Trace
    from damperfit.simulation import Motion

__all__ = ["DEFAULT_TABLE", "Choice", "SimulatedTest", "choose_parameters", "simulate_test"]

DEFAULT_TABLE = Path("results/parameters.parquet")
_WAVES = {"sine": sine_motion, "triangle": triangle_motion}
_NEEDED = tuple(name for name in PARAMETER_NAMES if name != "f_0")


@dataclass(frozen=True, slots=True)
class Choice:
    """Parameters and where they came from.

    Attributes
    ----------
    parameters : Parameters
        SI.
    setting : int or None
        Adjuster setting, None when all parameters were given one by one.
    source : str
        One sentence for people.
    """

    parameters: Parameters
    setting: int | None
    source: str


@dataclass(frozen=True, slots=True, eq=False)
class SimulatedTest:
    """A simulated test.

    Attributes
    ----------
    choice : Choice
        Whose parameters.
    motion : str
        What drove the damper, for people.
    frequency : float
        Cycles per second, Hz.
    response : Response
        The signals, all cycles.
    characteristics : Characteristics
        Figures of the last cycle.
    """

    choice: Choice
    motion: str
    frequency: float
    response: Response
    characteristics: Characteristics

    @property
    def samples_a_cycle(self) -> float:
        """How finely a cycle is sampled."""
        interval = float(self.response.time[1] - self.response.time[0])
        return 1.0 / (self.frequency * interval)


def choose_parameters(
    setting: int | None, *, table: Path | None, replaced: Mapping[str, str]
) -> Choice:
    """Return the parameters to simulate with.

    Parameters
    ----------
    setting : int or None
        Adjuster setting; not needed when all five parameters are replaced.
    table : pathlib.Path or None
        Parameters table; None takes `DEFAULT_TABLE` when it exists, else the reference set.
    replaced : mapping of str to str
        Values that replace the setting's, as text with or without a unit.

    Raises
    ------
    ConfigurationError
        No setting, an unknown setting, an unknown name, or a table that cannot be read.
    """
    values = {name: parameter_value(name, text) for name, text in replaced.items()}
    if set(_NEEDED) <= values.keys():
        return Choice(Parameters(**values), setting, "parameters: all given by --set")
    if setting is None:
        missing = ", ".join(name for name in _NEEDED if name not in values)
        raise ConfigurationError(f"no parameters for {missing}: give --setting N or --set them all")
    parameters, source = _of_setting(setting, table)
    if values:
        source = f"{source}; replaced: {', '.join(values)}"
    return Choice(replace(parameters, **values), setting, f"parameters: {source}")


def _of_setting(setting: int, table: Path | None) -> tuple[Parameters, str]:
    settle(DEFAULT_TABLE.parent)  # what an interrupted run put there may be none of the results
    if table is None and not DEFAULT_TABLE.exists():
        return reference_parameters(setting), f"setting {setting} of the {REFERENCE_SOURCE}"
    path = table or DEFAULT_TABLE
    known = read_parameters(path)
    if setting not in known:
        there = ", ".join(str(number) for number in sorted(known)) or "none"
        raise ConfigurationError(f"{path}: no parameters of setting {setting}; there are {there}")
    return known[setting], f"setting {setting} of {path}"


def simulate_test(
    choice: Choice, configuration: Configuration, *, log: Path | None = None
) -> SimulatedTest:
    """Simulate a test with a wave, or with the displacement of a log.

    Parameters
    ----------
    choice : Choice
        Parameters.
    configuration : Configuration
        Damper, nominal test, solver; for a log also how to read and condition it.
    log : pathlib.Path, optional
        Rig log whose displacement drives the damper.

    Raises
    ------
    LogError
        The log cannot be read or evaluated.
    InternalError
        Reading it has met a bug of damperfit's.
    ConfigurationError
        The stroke is longer than a chamber.
    SimulationError
        The model cannot be integrated, or the response is shorter than one cycle.
    """
    solver = configuration.simulation.solver
    if log is None:
        motion, words = _wave(configuration)
        response = simulate(choice.parameters, configuration.damper, motion, options=solver)
        frequency, steady = configuration.rig.frequency, response
    else:
        trace = _trace(log, configuration)
        response = simulate(
            choice.parameters, configuration.damper, motion_of(trace), options=solver
        )
        frequency, steady = trace.frequency, _part(response, trace.window)
        words = f"displacement of {trace.name}, last of {trace.n_cycles} steady cycles"
    figures = characterise(steady, frequency)
    if log is None and configuration.simulation.wave == "triangle":
        # It holds one speed a stroke: what lies below is passed in the jump, between two samples.
        figures = replace(
            figures, speed_forces=(), hysteresis_rebound=math.nan, hysteresis_bump=math.nan
        )
    return SimulatedTest(choice, words, frequency, response, figures)


def _trace(log: Path, configuration: Configuration) -> Trace:
    try:
        return condition(read_log(log, configuration.reading), configuration.conditioning)
    except (DamperfitError, MemoryError):
        raise
    except Exception as error:
        mishap = mishap_of(error, f"reading {log.name}")
        raise InternalError(mishap.message) from error


def _wave(configuration: Configuration) -> tuple[Motion, str]:
    rig, options = configuration.rig, configuration.simulation
    refuse_amplitude(rig.amplitude, configuration.damper)
    motion = _WAVES[options.wave](
        rig.amplitude,
        rig.frequency,
        cycles=options.cycles,
        sample_rate=options.sample_rate,
    )
    words = (
        f"{options.wave} of {1e3 * rig.amplitude:g} mm at {rig.frequency:g} Hz, "
        f"last of {options.cycles:g} cycles"
    )
    return motion, words


def _part(response: Response, window: slice) -> Response:
    return replace(
        response,
        time=response.time[window],
        displacement=response.displacement[window],
        velocity=response.velocity[window],
        force=response.force[window],
        pressures=response.pressures[:, window],
        masses=response.masses[:, window],
    )
