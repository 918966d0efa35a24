"""A fit stays within the plausible ranges: just inside is fitted, just outside ends at the edge."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from damperfit.damper.purdy.parameters import PURDY_DAMPER, Parameters
from damperfit.damper.purdy.reference import reference_parameters
from damperfit.damper.rivals.linear import Bilinear
from damperfit.identification import Fit, FitOptions, Outcome, evaluation, identify
from damperfit.identification.descent import Misfit, descend
from damperfit.identification.plausible import first_edge, is_within, kept_within
from damperfit.identification.setting import fit_setting
from damperfit.simulation import SolverOptions, simulate
from tests.identification.rig import trace

SOLVER = SolverOptions(tolerance=1e-2)
PLAUSIBLE = {one.name: one.plausible for one in PURDY_DAMPER.quantities if one.is_logarithmic}


def _fitted(setting: int, truth: Parameters, free: tuple[str, ...]) -> Fit:
    held = {
        name: getattr(truth, name)
        for name in ("r_m1", "r_m2", "r_m3", "k_e", "f_f")
        if name not in free
    }
    log = trace(setting, truth, duration=4.0)
    return identify([log], PURDY_DAMPER, FitOptions("plain", free, held)).fits[0]


EDGES = [
    (10, "r_m2", 0, 1.25, 0.8),
    (10, "r_m3", 0, 1.25, 0.8),
    (10, "k_e", 0, 1.25, 0.8),
    (1, "f_f", 1, 0.9, 1.1),
]


@pytest.mark.parametrize(("setting", "name", "side", "inside", "outside"), EDGES)
def test_just_inside_is_fitted_and_just_outside_is_at_bound(
    setting: int, name: str, side: int, inside: float, outside: float
) -> None:
    edge = PLAUSIBLE[name][side]
    near = replace(reference_parameters(setting), **{name: inside * edge})
    fit = _fitted(setting, near, ("r_m1", name))
    assert fit.status[name] == "fitted"
    assert getattr(fit.parameters, name) == pytest.approx(inside * edge, rel=0.02)
    beyond = replace(reference_parameters(setting), **{name: outside * edge})
    fit = _fitted(setting, beyond, ("r_m1", name))
    assert fit.status[name] == "at_bound"
    assert fit.outcome is Outcome.AT_BOUND
    assert getattr(fit.parameters, name) == edge
    assert not any("could not be simulated" in text for text in fit.warnings)


def test_oil_just_within_its_range_is_told_and_oil_beyond_has_no_upper_limit() -> None:
    # At the stiffest setting 1e11 Pa still moves the force by 8 N.
    low, high = PLAUSIBLE["k_e"]
    near = replace(reference_parameters(20), k_e=0.8 * high)
    fit = _fitted(20, near, ("r_m1", "r_m2", "k_e"))
    assert fit.status["k_e"] == "fitted"
    assert fit.parameters.k_e == pytest.approx(0.8 * high, rel=0.02)
    fit = _fitted(20, replace(near, k_e=1.25 * high), ("r_m1", "r_m2", "k_e"))
    assert fit.status["k_e"] == "not_identifiable"
    assert fit.outcome is Outcome.NOT_IDENTIFIABLE
    assert fit.parameters.k_e == high
    # Oil too soft is no rigid oil: units or signs are wrong.
    soft = _fitted(20, replace(near, k_e=0.8 * low), ("r_m1", "k_e"))
    assert soft.status["k_e"] == "at_bound"


def test_the_others_end_where_they_do_with_the_edge_held() -> None:
    truth = replace(reference_parameters(6), r_m3=2e2)
    log = trace(6, truth, duration=4.0)
    free = ("r_m1", "r_m2", "r_m3", "k_e")
    misfit = Misfit((log,), PURDY_DAMPER, free, SOLVER, 100, lambda: False)
    start = replace(reference_parameters(6), r_m3=1e6, k_e=3e8)
    found = descend(misfit, start).parameters
    edge = PLAUSIBLE["r_m3"][0]
    assert found.r_m3 == edge
    held = replace(misfit, free=("r_m1", "r_m2", "k_e"))
    expected = descend(held, replace(start, r_m3=edge)).parameters
    for name in held.free:
        assert getattr(found, name) == pytest.approx(getattr(expected, name), rel=1e-5)


@pytest.mark.parametrize("k_e", [1e11, 1e13, 1e6, 1e3])
def test_a_start_at_an_edge_or_beyond_it_comes_back(k_e: float) -> None:
    truth = reference_parameters(8)
    misfit = Misfit(
        (trace(8, duration=4.0),), PURDY_DAMPER, ("r_m1", "k_e"), SOLVER, 100, lambda: False
    )
    solution = descend(misfit, replace(truth, k_e=k_e))
    assert solution.parameters.k_e == pytest.approx(truth.k_e, rel=1e-4)


def test_no_trial_leaves_the_ranges(monkeypatch: pytest.MonkeyPatch) -> None:
    seen: list[Parameters] = []

    def watched(parameters: Parameters, *args: object, **kwargs: object) -> object:
        seen.append(parameters)
        return simulate(parameters, *args, **kwargs)  # type: ignore[arg-type]

    monkeypatch.setattr(evaluation, "simulate", watched)
    free = ("r_m1", "r_m2", "r_m3", "k_e", "f_f")
    log = trace(10, amplitude=0.001, noise=4.0, duration=4.0)
    misfit = Misfit((log,), PURDY_DAMPER, free, SOLVER, 100, lambda: False)
    fit_setting(misfit, replace(reference_parameters(10), k_e=9e10, r_m3=2e3))
    assert seen
    assert all(is_within(parameters, free) for parameters in seen)


def test_ranges_count_their_edges_in() -> None:
    inside = reference_parameters(1)
    for name, (low, high) in PLAUSIBLE.items():
        for edge, out in ((low, 0.99), (high, 1.01)):
            assert is_within(replace(inside, **{name: edge}), (name,))
            beyond = replace(inside, **{name: out * edge})
            assert not is_within(beyond, (name,))
            assert is_within(beyond, ())
            assert getattr(kept_within(beyond, (name,)), name) == edge
            assert kept_within(beyond, ()) == beyond
    assert kept_within(inside, tuple(PLAUSIBLE)) is inside


def test_the_first_edge_on_the_way_is_the_one_that_stops() -> None:
    import math

    at = replace(reference_parameters(1), r_m2=1e9, k_e=1e10, f_0=3.0)
    names = ("r_m2", "k_e", "f_0")
    ten = math.log(10.0)
    ones = np.ones(3)
    assert first_edge(at, names, np.array([1.2 * ten, 1.5 * ten, 99.0]), ones) == ("k_e", 1e11)
    assert first_edge(at, names, np.array([1.5 * ten, 1.2 * ten, 99.0]), ones) == ("r_m2", 1e10)
    assert first_edge(at, names, np.array([0.9 * ten, 0.9 * ten, 99.0]), ones) is None
    assert first_edge(at, names, np.array([-6.5 * ten, 0.0, 0.0]), ones) == ("r_m2", 1e3)


@pytest.mark.parametrize(("step", "edge"), [(4.1, 1e6), (3.9, None), (-16.1, -1e6), (-15.9, None)])
def test_a_linear_quantity_reaches_its_edge_in_steps_of_its_scale(step, edge) -> None:
    """Of 0.6 MN to 1 MN in steps of 0.1 MN."""
    at = Bilinear().values({"c_r": 1e3, "c_b": 1e3, "f_0": 6e5})
    found = first_edge(at, ("f_0",), np.array([step]), np.array([1e5]))
    assert found == (None if edge is None else ("f_0", edge))
