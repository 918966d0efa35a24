"""One simulated test: whose parameters, which motion, what comes of it."""

from __future__ import annotations

import math
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from damperfit.damper.warmed import BETA, Warmed
from damperfit.errors import (
    ConfigurationError,
    DamperfitError,
    InternalError,
    SimulationError,
    mishap_of,
)
from damperfit.io import read_log
from damperfit.problem import Option
from damperfit.queries.origin import damper_of_table
from damperfit.run.labelling import labels_for
from damperfit.run.tested_at import conditioned_as_tested, facts_of
from damperfit.simulation import (
    Characteristics,
    Response,
    characterise,
    motion_of,
    refuse_amplitude,
    simulate,
    sine_motion,
    triangle_motion,
)

if TYPE_CHECKING:
    from pathlib import Path

    from damperfit.configuration.options import Configuration
    from damperfit.damper.model import Values
    from damperfit.queries.chosen_parameters import ChosenParameters
    from damperfit.recording import Trace
    from damperfit.simulation import Motion

__all__ = [
    "SimulatedTest",
    "damper_of",
    "simulate_test",
]

# A cycle: at 33 the force at 0.05 m/s is up to 50 N off, at 333 half a newton
# (`tests/test_told_figures.py`).
_FEW_SAMPLES = 200
_PILOT_SAMPLES = 100  # of one cycle: the integrator's own steps are more
_WAVES = {"sine": sine_motion, "triangle": triangle_motion}


@dataclass(frozen=True, slots=True, eq=False)
class SimulatedTest:
    """A simulated test.

    Attributes
    ----------
    choice : ChosenParameters
        Whose parameters.
    motion : str
        What drove the damper, for people.
    frequency : float
        Cycles per second, Hz.
    response : Response
        The signals, all cycles.
    characteristics : Characteristics
        Figures of the last cycle.
    temperature : float or None
        That was asked for, degrees Celsius.
    """

    choice: ChosenParameters
    motion: str
    frequency: float
    response: Response
    characteristics: Characteristics
    temperature: float | None = None

    @property
    def warnings(self) -> tuple[str, ...]:
        """What to know before believing the figures, a sentence each."""
        fastest = float(np.max(np.abs(self.response.velocity)))
        amplitude = 0.5 * float(np.ptp(self.response.displacement))
        said = list(
            self.choice.warnings(
                fastest, self.temperature, amplitude=amplitude, frequency=self.frequency
            )
        )
        if self.samples_a_cycle < _FEW_SAMPLES:
            said.append(
                f"{self.samples_a_cycle:.3g} samples a cycle: peaks, hysteresis and forces at a "
                f"speed are coarse; {_FEW_SAMPLES} or more are wanted (--sample-rate)"
            )
        for chamber, share in enumerate(self.characteristics.cavitation_shares, start=1):
            if share > 0.0:
                said.append(
                    f"chamber {chamber} is empty for {100.0 * share:.3g} % of the cycle: these are "
                    "the forces of a damper that cavitates; a slower motion or more gas keeps it "
                    "full"
                )
        return tuple(said)

    @property
    def samples_a_cycle(self) -> float:
        """How finely a cycle is sampled."""
        interval = float(self.response.time[1] - self.response.time[0])
        return 1.0 / (self.frequency * interval)


def damper_of(
    choice: ChosenParameters, configuration: Configuration, *, config: Path | None = None
) -> tuple[Configuration, str]:
    """Return the configuration with the damper that the parameters belong to, and a line on it.

    Parameters
    ----------
    choice : ChosenParameters
        Whose parameters.
    configuration : Configuration
        As the user gave it.
    config : pathlib.Path, optional
        The file it came from, for the message.

    Raises
    ------
    ConfigurationError
        The user declares another damper than the one that was fitted, or asks what temperature does
        to one that was fitted without it.
    """
    meant, line = configuration, configuration.damper_sentence
    if choice.table is not None:
        meant, line = damper_of_table(choice.table, configuration, config=config)
    if isinstance(meant.damper, Warmed) and BETA.name not in choice.parameters.names:
        raise ConfigurationError(
            f"damper.reference_temperature: {choice.source.partition(': ')[2]}, has no beta; leave "
            "the key out, or take results of damperfit identify --covariate temperature"
        )
    return meant, line


def simulate_test(
    choice: ChosenParameters, configuration: Configuration, *, log: Path | None = None
) -> SimulatedTest:
    """Simulate a test with a wave, or with the displacement of a log.

    Parameters
    ----------
    choice : ChosenParameters
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
        The stroke is longer than a chamber, or the work is more than `simulation.max_steps`.
    SimulationError
        The model cannot be integrated, or the response is shorter than one cycle.
    """
    solver = configuration.simulation.solver
    asked = getattr(configuration.damper, "temperature", None)
    if log is None:
        refuse_amplitude(configuration.rig.amplitude, configuration.damper.travel)
        _refuse_work(choice.parameters, configuration)
        motion, words = _wave(configuration)
        response = simulate(choice.parameters, configuration.damper, motion, options=solver)
        frequency, steady = configuration.rig.frequency, response
    else:
        trace = _trace(log, configuration)
        motion = motion_of(trace)
        if asked is not None:  # before what the log says
            motion = replace(motion, temperature=asked)
        response = simulate(choice.parameters, configuration.damper, motion, options=solver)
        frequency, steady = trace.frequency, _part(response, trace.fastest.window)
        words = f"displacement of {trace.name}, last of {trace.fastest.n_cycles} steady cycles"
    figures = characterise(steady, frequency)
    if log is None and configuration.simulation.wave == "triangle":
        # It holds one speed a stroke: what lies below is passed in the jump, between two samples.
        figures = replace(
            figures, speed_forces=(), hysteresis_rebound=math.nan, hysteresis_bump=math.nan
        )
    return SimulatedTest(choice, words, frequency, response, figures, asked)


def _trace(log: Path, configuration: Configuration) -> Trace:
    try:
        recording = read_log(log, configuration.reading)
        row = labels_for([log], configuration, setting=None).row(log)
        facts, _ = facts_of(recording, log, configuration, row)
        return conditioned_as_tested(recording, configuration.conditioning, facts)
    except (DamperfitError, MemoryError):
        raise
    except Exception as error:
        mishap = mishap_of(error, f"reading {log.name}")
        raise InternalError(mishap.message) from error


def _wave(configuration: Configuration) -> tuple[Motion, str]:
    rig, options = configuration.rig, configuration.simulation
    motion = _WAVES[options.wave](
        rig.amplitude,
        rig.frequency,
        cycles=options.cycles,
        sample_rate=options.sample_rate,
    )
    words = (
        f"{options.wave} of {1e3 * rig.amplitude:.4g} mm at {rig.frequency:.4g} Hz, "
        f"last of {options.cycles:g} cycles"
    )
    return motion, words


def _refuse_work(parameters: Values, configuration: Configuration) -> None:
    """Estimate samples and steps before any are made, the steps from one cycle."""
    rig, options = configuration.rig, configuration.simulation
    n_samples = options.cycles * options.sample_rate / rig.frequency
    n_steps = n_samples
    if n_samples <= options.max_steps:
        rate = rig.frequency * min(_PILOT_SAMPLES, options.sample_rate / rig.frequency)
        cycle = _WAVES[options.wave](rig.amplitude, rig.frequency, cycles=1, sample_rate=rate)
        with suppress(SimulationError):  # the simulation itself will say why
            pilot = simulate(parameters, configuration.damper, cycle, options=options.solver)
            n_steps = max(n_samples, options.cycles * pilot.work.steps)
    if n_steps > options.max_steps:
        raise ConfigurationError(
            f"{options.cycles:g} cycles at {rig.frequency:g} Hz take about {n_samples:.3g} samples "
            f"and {n_steps:.3g} steps of the integrator, expected at most {options.max_steps} "
            "(simulation.max_steps); take fewer {cycles} or a lower {sample_rate}, or allow more "
            "with {max_steps}",
            cycles=Option("cycles"),
            sample_rate=Option("sample_rate"),
            max_steps=Option("max_steps", math.ceil(1.1 * n_steps)),
        )


def _part(response: Response, window: slice) -> Response:
    signals = ("time", "displacement", "velocity", "force", "pressures", "masses")
    return replace(response, **{name: getattr(response, name)[..., window] for name in signals})
