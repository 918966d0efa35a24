"""Traces of known dampers for the tests: simulated tightly, with noise, conditioned as logs are."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import numpy as np

from damperfit.conditioning import ConditionOptions, condition
from damperfit.damper.purdy.parameters import PURDY_DAMPER, Damper, Parameters
from damperfit.damper.purdy.reference import reference_parameters
from damperfit.recording import Recording, Trace
from damperfit.simulation import Motion, SolverOptions, simulate

AMPLITUDE, FREQUENCY = 0.032, 1.5
OMEGA = 2.0 * np.pi * FREQUENCY
TIGHT = SolverOptions(tolerance=1e-6)


def recording(
    setting: int,
    parameters: Parameters | None = None,
    *,
    damper: Damper = PURDY_DAMPER,
    noise: float = 0.0,
    rate: float = 1000.0,
    duration: float = 10.0,
    seed: int = 1,
    amplitude: float = AMPLITUDE,
) -> Recording:
    """Return a log of the standard test that starts in mid-cycle; noise in N, and 2 um per N."""
    random = np.random.default_rng([seed, setting])
    lead = round(2.0 / FREQUENCY * rate)
    n = round(duration * rate)
    angle = OMEGA * np.arange(lead + n) / rate + random.uniform(0.0, 2.0 * np.pi)
    three_cycles = round(3.0 / FREQUENCY * rate)
    assert three_cycles * FREQUENCY == 3.0 * rate, "not a whole number of samples"
    truth = parameters or reference_parameters(setting)
    first = angle[0], lead, three_cycles
    force = np.resize(_settled(truth, damper, rate, amplitude, first), n)
    x = amplitude * np.sin(angle[lead:])
    return Recording(
        name=f"setting_{setting:02d}.csv",
        path="",
        sha256="",
        setting=setting,
        time=np.arange(n) / rate,
        displacement=x + 2e-6 * noise * random.standard_normal(n),
        force=force + noise * random.standard_normal(n),
    )


@lru_cache(maxsize=256)
def _settled(
    truth: Parameters,
    damper: Damper,
    rate: float,
    amplitude: float,
    first: tuple[float, int, int],
) -> np.ndarray:
    """Return the force of cycles that come after two others: the next are the same within 3 uN."""
    phase, lead, n = first
    angle = OMEGA * np.arange(lead + n) / rate + phase
    motion = Motion(1.0 / rate, amplitude * np.sin(angle), amplitude * OMEGA * np.cos(angle))
    return simulate(truth, damper, motion, options=TIGHT).force[lead:]


def trace(setting: int, parameters: Parameters | None = None, **kwargs: object) -> Trace:
    """Return the conditioned log."""
    log = recording(setting, parameters, **kwargs)  # type: ignore[arg-type]
    return condition(log, ConditionOptions())


def short_trace(setting: int, parameters: Parameters | None = None, **kwargs: object) -> Trace:
    """Return a log of 6 s unless it is said: where no limit is near, nine cycles tell as much."""
    return trace(setting, parameters, **{"duration": 6.0, **kwargs})  # type: ignore[arg-type]


def traces(settings: Sequence[int], **kwargs: object) -> list[Trace]:
    """Return one trace for each setting of the reference set."""
    return [trace(setting, **kwargs) for setting in settings]


def short_traces(settings: Sequence[int], **kwargs: object) -> list[Trace]:
    """Return one short trace for each setting of the reference set."""
    return [short_trace(setting, **kwargs) for setting in settings]


def errors(found: Parameters, truth: Parameters) -> dict[str, float]:
    """Return relative errors by name."""
    return {
        name: getattr(found, name) / getattr(truth, name) - 1.0
        for name in ("r_m1", "r_m2", "r_m3", "k_e", "f_f")
    }
