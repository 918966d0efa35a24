"""A law with kinks: few looks at the whole log, and the end of a descent that goes on."""

from __future__ import annotations

import numpy as np
import pytest

from damperfit.conditioning import condition
from damperfit.damper.model import Values
from damperfit.identification import FitOptions, descent
from damperfit.identification.descent import Misfit, descend
from damperfit.identification.setting import relative_errors
from damperfit.recording import Recording, Trace
from damperfit.simulation import simulate, sine_motion
from damperfit.tested.setting import Setting
from tests.laws.valve_logs import VALUES, damper

FREE = (
    "rebound_bleed", "rebound_opening", "rebound_slope", "compression_bleed",
    "compression_opening", "compression_slope", "f_f", "k_s", "play", "lag", "f_0",
)  # fmt: skip


@pytest.fixture(scope="module")
def log() -> Trace:
    """3.5 s of a made-up damper with play and lag, 4 N and 3 um of noise."""
    motion = sine_motion(0.02, 1.5, cycles=5.2, sample_rate=1000.0)
    force = simulate(damper().values(VALUES), damper(), motion).force
    random, n = np.random.default_rng(5), len(force)
    return condition(
        Recording(
            name="kinks.csv",
            path="",
            sha256="",
            setting=Setting.of(3),
            time=motion.interval * np.arange(n),
            displacement=motion.displacement + random.normal(0.0, 3e-6, n),
            force=force + random.normal(0.0, 4.0, n),
        )
    )


def misfit(log: Trace) -> Misfit:
    return Misfit((log,), damper(), FREE, FitOptions().solver, 100, lambda: False)


def beside(share: float) -> Values:
    """Where a search on settled cycles may end: everything a share off."""
    truth = damper().values(VALUES)
    return truth.replace({name: (1.0 + share) * getattr(truth, name) for name in FREE})


def test_the_last_step_is_taken_without_a_look_and_ends_where_a_descent_that_goes_on_does(
    log: Trace, monkeypatch: pytest.MonkeyPatch
) -> None:
    start = beside(0.005)
    found = descend(misfit(log), start)
    assert found.evaluations <= 5
    monkeypatch.setattr(descent, "_AMONG_KINKS_LEFT", 0.5)
    longer = descend(misfit(log), start)
    assert longer.evaluations > 2 * found.evaluations  # 18 and 4
    model = damper()
    for name, error in zip(FREE, relative_errors(longer), strict=True):
        one, other = getattr(found.parameters, name), getattr(longer.parameters, name)
        size = other if model.quantity(name).is_logarithmic else misfit(log).deviation
        assert abs(one - other) < 0.1 * error * abs(size), name


def test_a_small_misfit_is_descended_with_the_tighter_integrator_from_the_start(
    log: Trace, monkeypatch: pytest.MonkeyPatch
) -> None:
    near = descend(misfit(log), beside(0.005)).parameters
    asked: list[tuple[float, int]] = []
    evaluated = descent.evaluate

    def listening(one: Misfit, at: Values, scale: float) -> object:
        asked.append((one.solver.tolerance, len(one.free)))
        return evaluated(one, at, scale)

    monkeypatch.setattr(descent, "evaluate", listening)
    descend(misfit(log), near)
    (first, derivatives), *others = asked
    assert (first, derivatives) == (FitOptions().solver.tolerance, 0)
    assert all(tolerance < 0.5 * first and n == len(FREE) for tolerance, n in others)
