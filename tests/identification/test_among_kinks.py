"""A law with kinks: few looks at the whole log, and the end of a descent that goes on."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from damperfit.conditioning import condition
from damperfit.damper.model import Values
from damperfit.identification import FitOptions, descent
from damperfit.identification import looks as looks_module
from damperfit.identification.descent import Misfit, descend
from damperfit.identification.last_step import step_among_kinks
from damperfit.identification.setting import relative_errors
from damperfit.recording import Recording, Trace
from damperfit.simulation import SolverOptions, simulate, sine_motion
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
    near = descend(misfit(log), beside(0.005)).parameters
    off = 1.0 + np.linspace(-2e-4, 2e-4, len(FREE))
    moved = {name: by * getattr(near, name) for name, by in zip(FREE, off, strict=True)}
    start = near.replace(moved)
    looks: list[int] = []
    evaluated = looks_module.evaluate

    def listening(one: Misfit, at: Values, scale: float) -> object:
        looks.append(len(one.free))
        return evaluated(one, at, scale)

    monkeypatch.setattr(looks_module, "evaluate", listening)
    found = descend(misfit(log), start)
    assert found.evaluations == len(looks) == 2
    assert found.gradient_cosine < 1e-6
    longer = descent._minimise(replace(misfit(log), solver=SolverOptions(tolerance=1e-3)), start)
    model = damper()
    for name, error in zip(FREE, relative_errors(longer), strict=True):
        one, other = getattr(found.parameters, name), getattr(longer.parameters, name)
        size = other if model.quantity(name).is_logarithmic else misfit(log).deviation
        assert abs(one - other) < 0.1 * error * abs(size), name


def test_what_the_logs_do_not_tell_is_followed_to_its_edge(log: Trace) -> None:
    """Its own error is long, however little the step promises."""
    near = descend(misfit(log), beside(0.005))
    assert step_among_kinks(misfit(log), near) is not None
    seen = near.jacobian.copy()
    seen[:, FREE.index("play")] *= 1e-3
    assert step_among_kinks(misfit(log), replace(near, jacobian=seen)) is None


@pytest.mark.parametrize(("share", "is_told"), [(0.98, True), (1.02, False)])
def test_a_value_is_told_up_to_half_of_itself(log: Trace, share: float, *, is_told: bool) -> None:
    near = descend(misfit(log), beside(0.005))
    place = FREE.index("play")
    alone = np.zeros((len(near.jacobian), len(FREE)))
    alone[: len(FREE)] = 1e3 * np.eye(len(FREE))
    rough = np.sqrt(near.mse_percent / 100.0 / near.n_independent)
    alone[place, place] = rough / (0.5 * share)
    flat = replace(near, jacobian=alone, gradient=np.zeros(len(FREE)))
    assert (step_among_kinks(misfit(log), flat) is not None) is is_told


def test_a_small_misfit_is_descended_with_the_tighter_integrator_from_the_second_look_on(
    log: Trace, monkeypatch: pytest.MonkeyPatch
) -> None:
    near = descend(misfit(log), beside(0.005)).parameters
    asked: list[float] = []
    evaluated = looks_module.evaluate

    def listening(one: Misfit, at: Values, scale: float) -> object:
        asked.append(one.solver.tolerance)
        return evaluated(one, at, scale)

    monkeypatch.setattr(looks_module, "evaluate", listening)
    descend(misfit(log), near)
    first, *others = asked
    assert first == FitOptions().solver.tolerance
    assert others
    assert all(tolerance < 0.5 * first for tolerance in others)
