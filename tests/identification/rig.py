"""Traces of known dampers for the tests: simulated tightly, with noise, conditioned as logs are."""

from functools import lru_cache

import numpy as np

from damperfit.conditioning import condition
from damperfit.damper.purdy.parameters import PURDY_DAMPER, Damper, Parameters, reference_parameters
from damperfit.recording import Recording, Trace
from damperfit.simulation import Motion, SolverOptions, simulate

AMPLITUDE, FREQUENCY = 0.032, 1.5
OMEGA = 2.0 * np.pi * FREQUENCY
TIGHT = SolverOptions(tolerance=1e-6)
NAMES = ("r_m1", "r_m2", "r_m3", "k_e", "f_f")


def recorded(x, force, rate=1000.0, *, setting=10, noises=(0.0, 0.0), seed=1, name="log.csv"):
    """What a rig writes of a motion, with noise of the displacement, m, and of the force, N."""
    random, n = np.random.default_rng(seed), len(x)
    return Recording(
        name=name, path="", sha256="", setting=setting, time=np.arange(n) / rate,
        displacement=x + noises[0] * random.standard_normal(n),
        force=force + noises[1] * random.standard_normal(n),
    )  # fmt: skip


def recording(
    setting: int, parameters: Parameters | None = None, *, damper: Damper = PURDY_DAMPER,
    noise: float = 0.0, rate: float = 1000.0, duration: float = 10.0, seed: int = 1,
    amplitude: float = AMPLITUDE,
) -> Recording:  # fmt: skip
    """A log of the standard test that starts in mid-cycle; noise in N, and 2 um per N."""
    random = np.random.default_rng([seed, setting])
    lead, n = round(2.0 / FREQUENCY * rate), round(duration * rate)
    angle = OMEGA * np.arange(lead + n) / rate + random.uniform(0.0, 2.0 * np.pi)
    three_cycles = round(3.0 / FREQUENCY * rate)
    assert three_cycles * FREQUENCY == 3.0 * rate, "not a whole number of samples"
    truth = parameters or reference_parameters(setting)
    first = angle[0], lead, three_cycles
    force = np.resize(_settled(truth, damper, rate, amplitude, first), n)
    name, noises = f"setting_{setting:02d}.csv", (2e-6 * noise, noise)
    x = amplitude * np.sin(angle[lead:])
    return recorded(x, force, rate, setting=setting, noises=noises, seed=random, name=name)


@lru_cache(maxsize=256)
def _settled(truth, damper, rate, amplitude, first: tuple[float, int, int]) -> np.ndarray:
    """The force of cycles that come after two others: the next are the same within 3 uN."""
    phase, lead, n = first
    angle = OMEGA * np.arange(lead + n) / rate + phase
    motion = Motion(1.0 / rate, amplitude * np.sin(angle), amplitude * OMEGA * np.cos(angle))
    return simulate(truth, damper, motion, options=TIGHT).force[lead:]


def trace(setting: int, parameters: Parameters | None = None, **kwargs: object) -> Trace:
    """The conditioned log."""
    return condition(recording(setting, parameters, **kwargs))  # type: ignore[arg-type]


def short_trace(setting: int, parameters: Parameters | None = None, **kwargs: object) -> Trace:
    """A log of 6 s unless it is said: where no limit is near, nine cycles tell as much."""
    return trace(setting, parameters, **{"duration": 6.0, **kwargs})


def traces(settings, **kwargs: object) -> list[Trace]:
    """One trace for each setting of the reference set."""
    return [trace(setting, **kwargs) for setting in settings]


def short_traces(settings, **kwargs: object) -> list[Trace]:
    """One short trace for each setting of the reference set."""
    return [short_trace(setting, **kwargs) for setting in settings]


def errors(found: Parameters, truth: Parameters) -> dict[str, float]:
    """Relative errors by name."""
    return {name: getattr(found, name) / getattr(truth, name) - 1.0 for name in NAMES}


def is_near(found: Parameters, truth: Parameters, **bars: float) -> bool:
    """Whether relative errors are within bars, by name."""
    off = errors(found, truth)
    return all(abs(off[name]) < bar for name, bar in bars.items())
