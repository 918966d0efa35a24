"""Where little is left of a misfit, the integrator's own error is kept to a share of it."""

from __future__ import annotations

import math

import numpy as np
import pytest

from damperfit.damper.purdy.parameters import PURDY_DAMPER
from damperfit.damper.purdy.reference import reference_parameters
from damperfit.identification import FitOptions, evaluation
from damperfit.identification.descent import Misfit, descend
from damperfit.simulation import SolverOptions, simulate
from tests.identification.rig import short_trace

FREE = ("r_m1", "r_m2", "r_m3", "k_e", "f_f")
USUAL = FitOptions().solver
SHARE = 0.003


@pytest.fixture
def tolerances(monkeypatch):
    """The tolerances that fits integrate with, one for each simulation."""
    seen = []

    def watched(*arguments, **named):
        seen.append(named["options"].tolerance)
        return simulate(*arguments, **named)

    monkeypatch.setattr(evaluation, "simulate", watched)
    return seen


def descended(noise: float, solver: SolverOptions = USUAL):
    """Where a descent on a standard log ends, and what is left there, N."""
    misfit = Misfit((short_trace(10, noise=noise),), PURDY_DAMPER, FREE, solver, 100, lambda: False)
    solution = descend(misfit, reference_parameters(10))
    return solution, misfit.deviation * math.sqrt(solution.mse_percent / 100.0)


@pytest.mark.parametrize("noise", [0.3, 2.0])
def test_little_noise_asks_for_a_tolerance_in_proportion(tolerances, noise: float) -> None:
    _, left = descended(noise)
    assert 2 * USUAL.tolerance < left < 100 * USUAL.tolerance
    assert tolerances[0] == USUAL.tolerance
    assert min(tolerances) == pytest.approx(SHARE * left, rel=0.02)


def test_much_noise_asks_for_no_other_tolerance(tolerances) -> None:
    _, left = descended(8.0)
    assert left > 100 * USUAL.tolerance
    assert set(tolerances) == {USUAL.tolerance}


def test_without_noise_it_is_a_share_of_the_usual_tolerance(tolerances) -> None:
    _, left = descended(0.0)
    assert left < USUAL.tolerance
    assert min(tolerances) == pytest.approx(SHARE * USUAL.tolerance)


@pytest.mark.parametrize("noise", [0.3, 2.0])
def test_a_share_of_what_is_left_moves_no_value_by_a_fiftieth_of_its_error(noise: float) -> None:
    found, _ = descended(noise)
    exact, _ = descended(noise, SolverOptions(tolerance=1e-5))
    normal = exact.jacobian.T @ exact.jacobian * exact.n_independent
    errors = np.sqrt(np.diag(np.linalg.inv(normal)) * exact.mse_percent / 100.0)
    for name, error in zip(FREE, errors, strict=True):
        moved = math.log(getattr(found.parameters, name) / getattr(exact.parameters, name))
        assert abs(moved) < 0.02 * error, name
