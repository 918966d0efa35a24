"""Hand-made runs: measured cycles of a known force, no fit, no file."""

from pathlib import Path

import numpy as np

from damperfit.adjustment.force_at import Sine, Stage
from damperfit.comparison.measured import MeasuredTest, measured_tests
from damperfit.damper.purdy.parameters import PURDY_DAMPER, reference_parameters
from damperfit.results import Run
from damperfit.tables.files import LogSignals
from damperfit.tested.setting import Setting
from tests.fakes import fitted_run

AMPLITUDE, FREQUENCY, DAMPING, GAS = 0.032, 1.5, 2000.0, -130.0
TESTED = Sine(AMPLITUDE, FREQUENCY)
STIFFNESS = 300.0  # N/m: opening and closing differ


def signals(
    setting: int = 1, *, factor=1.0, noise=0.0, cycles=10, seed=0, frequency=FREQUENCY,
    log="a.csv", tare=0.0,
) -> tuple[LogSignals, list[dict]]:  # fmt: skip
    """Return whole cycles of F = factor c v + k x + gas, and what run.json says of them."""
    rate = 600.0
    n = round(cycles / frequency * rate)
    time = 5.0 + np.arange(n) / rate
    angle = 2.0 * np.pi * frequency * (time - 5.0)
    x = AMPLITUDE * np.sin(angle)
    v = 2.0 * np.pi * frequency * AMPLITUDE * np.cos(angle)
    force = factor * DAMPING * v + STIFFNESS * x + GAS + tare
    force = force + noise * np.random.default_rng([seed, setting]).standard_normal(n)
    nothing = np.full(n, np.nan)
    told = {"kind": "steady", "start_s": 5.0, "stop_s": 5.0 + n / rate, "cycles": cycles}
    told |= {"frequency_Hz": frequency, "amplitude_m": AMPLITUDE}
    channels = (time, x, v, force, nothing, np.stack([nothing] * 3))
    return LogSignals(Setting.of(setting), log, *channels), [told]


def measured(setting: int = 1, **how: object) -> MeasuredTest:
    """Return one measured test."""
    (found,) = measured_tests(*signals(setting, **how))
    return found


def run(*tests: MeasuredTest, name: str = "a", record: dict | None = None) -> Run:
    """Return a run of measured tests alone."""
    made = Run(record, {"parameters": ()}, place=Path(name))
    made.tests, made.name, made.shown_as = tests, name, name
    return made


def fitted(
    *settings: int,
    name: str = "a",
    damper=PURDY_DAMPER,
    sine: Sine = TESTED,
    tests: tuple[MeasuredTest, ...] = (),
    quantities=PURDY_DAMPER.quantities,
    stages: tuple[Stage, ...] = (),
    rows: tuple[dict, ...] = (),
    **record: object,
) -> Run:
    """Return a run of the paper's model at settings, with what is told of them."""
    places = [Setting.of(setting) for setting in settings or (1, 2)]
    stages = stages or tuple(Stage(one, reference_parameters(1)) for one in places)
    known = dict(zip(places, rows or ({},) * len(places), strict=True))
    made = fitted_run(damper, stages, sine, (), known, quantities)
    made.tests, made.name, made.shown_as = tests, name, name
    made.record.update(record)
    return made
