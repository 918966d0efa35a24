"""Made-up logs of dampers with real valves: the compiled network, noise, steps of the logger."""

import numpy as np

from damperfit.conditioning import condition
from damperfit.damper.mounting import FIT, NONE, Mounting
from damperfit.damper.valve_dampers import ThroughFlow
from damperfit.recording import Trace
from damperfit.simulation import Motion, simulate
from damperfit.tested.setting import Setting
from tests.identification.rig import recorded

DAMPER_TOML = """[damper]
rod_diameter = "10.1mm"
piston_diameter = "24.8mm"
chamber_1_length = "82mm"
chamber_2_length = "82mm"
gas_pressure = "7.28bara"
oil_density = "850kg/m3"
"""
VALUES = {
    "rebound_bleed": 7e4, "rebound_opening": 3.7e5, "rebound_slope": 5.3e6,
    "compression_bleed": 6.5e4, "compression_opening": 3e5, "compression_slope": 3.9e6,
    "return_slope": 2.2e5, "k_e": 9e8, "f_f": 20.0, "f_0": -9.6,
    "k_s": 4.3e5, "play": 5e-4, "lag": 8e-3,
}  # fmt: skip


def damper(*, has_play_and_lag=True):
    """The damper that is logged."""
    part = FIT if has_play_and_lag else NONE
    return ThroughFlow(
        rod_diameter=0.0101, piston_diameter=0.0248, chamber_1_length=0.082,
        chamber_2_length=0.082, oil_density=850.0, gas_pressure=7.28e5,
        gas_volume=62.83e-6, gas_exponent=1.4, mounting=Mounting(FIT, part, part),
    )  # fmt: skip


def moved(speeds, *, amplitude=0.02, cycles=4, rate=500.0):
    """Rest, then each peak speed for some cycles, each speed swept in over half a second."""
    frequency = [np.zeros(round(0.3 * rate))]
    last = 0.0
    for speed in speeds:
        own = speed / (2 * np.pi * amplitude)
        frequency.append(np.linspace(last, own, round(0.5 * rate)))
        frequency.append(np.full(round((cycles + 0.3) / own * rate), own))
        last = own
    whole = np.concatenate([*frequency, np.linspace(last, 0.0, round(0.5 * rate))])
    phase = 2 * np.pi * np.cumsum(whole) / rate
    x = amplitude * np.sin(phase)
    return Motion(1.0 / rate, x, np.gradient(x, 1.0 / rate))


def log_text(model, values, motion, *, setting, seed=0):
    """A log as a rig writes it: 1.5 N and 3 um of noise, steps of 0.4 N and 2 um."""
    noise = np.random.default_rng(seed)
    force = simulate(model.values(values), model, motion).force
    n = len(force)
    columns = (
        np.arange(n) * motion.interval,
        np.round((1e3 * motion.displacement + noise.normal(0, 3e-3, n)) / 2e-3) * 2e-3,
        np.round((force + noise.normal(0, 1.5, n)) / 0.4) * 0.4,
    )
    rows = "\n".join(",".join(f"{one:.4f}" for one in row) for row in zip(*columns, strict=True))
    return f"# setting: {setting}\ntime_s,displacement_mm,force_N\n{rows}\n"


def noisy_trace(model, numbers, motion, *, seed, force_noise, jitter) -> Trace:
    """A conditioned log of a model, with noise of the force (N) and of the displacement (m)."""
    force = simulate(model.values(numbers), model, motion).force
    noises = (jitter, force_noise)
    log = recorded(
        motion.displacement, force, 1.0 / motion.interval, setting=Setting.of(1), noises=noises,
        seed=seed,
    )  # fmt: skip
    return condition(log)
