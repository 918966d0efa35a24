"""Hand-made runs: measured cycles of a known force, no fit, no file."""

from __future__ import annotations

import numpy as np

from damperfit.comparison import ComparedRun, MeasuredTest
from damperfit.comparison.runs import measured_tests
from damperfit.tables.reading import LogSignals
from damperfit.tested.setting import Setting

AMPLITUDE, FREQUENCY, DAMPING, GAS = 0.032, 1.5, 2000.0, -130.0
STIFFNESS = 300.0  # N/m: opening and closing differ


def signals(
    setting: int = 1,
    *,
    factor: float = 1.0,
    noise: float = 0.0,
    cycles: int = 10,
    seed: int = 0,
    frequency: float = FREQUENCY,
    log: str = "a.csv",
) -> tuple[LogSignals, list[dict]]:
    """Return whole cycles of F = factor c v + k x + gas, and what run.json says of them."""
    rate = 600.0
    n = round(cycles / frequency * rate)
    time = 5.0 + np.arange(n) / rate
    angle = 2.0 * np.pi * frequency * (time - 5.0)
    x = AMPLITUDE * np.sin(angle)
    v = 2.0 * np.pi * frequency * AMPLITUDE * np.cos(angle)
    force = factor * DAMPING * v + STIFFNESS * x + GAS
    force = force + noise * np.random.default_rng([seed, setting]).standard_normal(n)
    nothing = np.full(n, np.nan)
    told = [
        {
            "kind": "steady",
            "start_s": 5.0,
            "stop_s": 5.0 + n / rate,
            "frequency_Hz": frequency,
            "amplitude_m": AMPLITUDE,
            "cycles": cycles,
        }
    ]
    found = LogSignals(
        Setting.of(setting), log, time, x, v, force, nothing, np.stack([nothing] * 3)
    )
    return found, told


def measured(setting: int = 1, **how: object) -> MeasuredTest:
    """Return one measured test."""
    (found,) = measured_tests(*signals(setting, **how))
    return found


def run(*tests: MeasuredTest, name: str = "a", record: dict | None = None) -> ComparedRun:
    """Return a run of measured tests alone."""
    return ComparedRun(name, name, None, tests, record or {})
