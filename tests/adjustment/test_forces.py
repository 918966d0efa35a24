"""Force by setting and click: the right force, the right error, shared errors that cancel."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from damperfit.adjustment import Sine, Stage, clicks, forces, levels, named_speeds, stage_of
from damperfit.damper.purdy.parameters import PURDY_DAMPER
from damperfit.damper.purdy.reference import reference_parameters
from damperfit.identification import Status
from damperfit.simulation import (
    SolverOptions,
    characterise,
    signals_at_speeds,
    simulate,
    sine_motion,
)
from damperfit.tested.setting import Setting
from damperfit.uncertainty import Uncertainty
from tests import fakes

SINE = Sine(0.032, 1.5)
TIGHT = SolverOptions(tolerance=1e-4)
OWN, SHARED = ("r_m1", "r_m2", "k_e"), ("r_m3", "f_f")


def stage(setting, covariance=None):
    return Stage(setting, reference_parameters(setting), OWN, SHARED, covariance)


def covariance(seed, *, own=2e-3, shared=4e-3):
    random = np.random.default_rng(seed)
    root = random.standard_normal((5, 5)) * np.array([own] * 3 + [shared] * 2)[:, None]
    return root @ root.T


def force_at(parameters, speed):
    """By `characterise`, the twin of `signals_at_speeds`, on a motion of its own."""
    motion = sine_motion(0.032, 1.5, cycles=3, sample_rate=3000.0)
    response = simulate(parameters, PURDY_DAMPER, motion, options=TIGHT)
    (found,) = characterise(response, 1.5, speeds=(speed,)).speed_forces
    return {"rebound": found.rebound, "bump": found.bump}


def test_errors_of_many_forces_are_those_of_each_alone() -> None:
    one = stage(10, covariance(3))
    slopes = np.random.default_rng(4).standard_normal((5, 6))
    parts = forces.errors_parted(one)
    rests, carried = forces.split(one, parts, slopes)
    for k, g in enumerate(slopes.T):
        own, shared = g[:3], g[3:]
        assert rests[k] ** 2 == pytest.approx(own @ parts.rest @ own)
        assert carried[k] == pytest.approx((shared + own @ parts.follow) @ parts.root)
        assert rests[k] ** 2 + carried[k] @ carried[k] == pytest.approx(g @ one.covariance @ g)


def test_forces_are_those_of_the_characteristics() -> None:
    found = levels([stage(10)], PURDY_DAMPER, SINE, speeds=(0.1, 0.26), solver=TIGHT)
    assert [(level.speed, level.stroke) for level in found] == [
        (0.1, "rebound"),
        (0.1, "bump"),
        (0.26, "rebound"),
        (0.26, "bump"),
    ]
    for level in found:
        true = force_at(reference_parameters(10), level.speed)[level.stroke]
        assert level.force == pytest.approx(true, abs=0.05)
        assert np.isnan(level.error)


@pytest.mark.parametrize("sine", [SINE, Sine(0.004, 12.0)], ids=["1.5 Hz", "12 Hz"])
def test_the_cycle_that_counts_is_a_settled_one(sine, monkeypatch) -> None:
    """Of fast motions half a cycle is over before the pressures have settled."""
    at = {"speeds": (0.05, 0.2), "solver": TIGHT}
    found = levels([stage(1), stage(20)], PURDY_DAMPER, sine, **at)
    monkeypatch.setattr(forces, "_SETTLING", 1.0)
    for one, settled in zip(
        found, levels([stage(1), stage(20)], PURDY_DAMPER, sine, **at), strict=True
    ):
        assert one.force == pytest.approx(settled.force, abs=2e-3)


def test_a_speed_that_is_not_reached_has_no_signal() -> None:
    motion = sine_motion(0.032, 1.5, cycles=2, sample_rate=1000.0)
    response = simulate(reference_parameters(5), PURDY_DAMPER, motion)
    values = signals_at_speeds(response, 1.5, response.force[None, :], speeds=(0.1, 0.4))
    assert values.shape == (1, 2, 2)
    assert np.isfinite(values[0, 0]).all()
    assert np.isnan(values[0, 1]).all()
    assert named_speeds(SINE) == (0.05, 0.1, 0.13, 0.26, 0.3)


@pytest.mark.parametrize("setting", [2, 18])
def test_the_error_is_that_of_draws_from_the_covariance(setting) -> None:
    """Slopes by differences of another simulation, covariance as a whole."""
    cov = covariance(setting)
    found = levels([stage(setting, cov)], PURDY_DAMPER, SINE, speeds=(0.2,), solver=TIGHT)
    truth = reference_parameters(setting)
    for level in found:
        slopes = []
        for name in (*OWN, *SHARED):
            up, down = (
                force_at(replace(truth, **{name: getattr(truth, name) * (1.0 + h)}), 0.2)
                for h in (1e-3, -1e-3)
            )
            slopes.append((up[level.stroke] - down[level.stroke]) / 2e-3)
        assert level.error == pytest.approx(np.sqrt(slopes @ cov @ slopes), rel=5e-3)


def test_errors_of_shared_parameters_cancel_between_neighbours() -> None:
    shared_only = np.zeros((5, 5))
    shared_only[3:, 3:] = np.diag([1e-2, 1e-1]) ** 2
    found = levels(
        [stage(9, shared_only), stage(10, shared_only)], PURDY_DAMPER, SINE, speeds=(0.1,)
    )
    for level in found:
        assert level.rest == 0.0
        assert level.error > 2.0
    for click in clicks(found, PURDY_DAMPER):
        assert click.high - click.change < 0.1 * 1.96 * found[0].error


def test_errors_of_the_settings_own_parameters_add_up() -> None:
    own_only = np.zeros((5, 5))
    own_only[:3, :3] = np.diag([1e-3, 1e-3, 1e-2]) ** 2
    first, second = (stage(n, own_only) for n in (9, 10))
    found = levels([first, second], PURDY_DAMPER, SINE, speeds=(0.26,))
    by_place = {(level.setting, level.stroke): level for level in found}
    for click in clicks(found, PURDY_DAMPER):
        a, b = by_place[9, click.stroke], by_place[10, click.stroke]
        assert click.change == b.force - a.force
        reach = 1.96 * np.hypot(a.error, b.error)
        assert click.high - click.change == pytest.approx(reach, rel=1e-4)
        damping = a.force + PURDY_DAMPER.rod_area * PURDY_DAMPER.gas_pressure
        ratio = 1.0 + click.change / damping
        share = 196.0 * np.hypot(b.error, ratio * a.error) / abs(damping)
        assert click.percent_high - click.percent == pytest.approx(share, rel=1e-4)


def test_percent_is_of_the_damping_without_the_gas_force() -> None:
    found = levels([stage(1), stage(2)], PURDY_DAMPER, SINE, speeds=(0.05,))
    gas = PURDY_DAMPER.rod_area * PURDY_DAMPER.gas_pressure
    for click in clicks(found, PURDY_DAMPER):
        first = next(x for x in found if x.setting == 1 and x.stroke == click.stroke)
        assert click.percent == pytest.approx(100.0 * click.change / (first.force + gas))
        assert click.percent > 0.0  # harder, in rebound and in bump alike


def test_clicks_join_neighbours_over_gaps() -> None:
    found = levels([stage(n) for n in (1, 5, 6)], PURDY_DAMPER, SINE, speeds=(0.2,))
    assert [(c.first, c.second, c.stroke) for c in clicks(found, PURDY_DAMPER)] == [
        (1, 5, "rebound"),
        (1, 5, "bump"),
        (5, 6, "rebound"),
        (5, 6, "bump"),
    ]
    assert clicks(found[:2], PURDY_DAMPER) == ()


def test_a_shared_value_that_no_log_tells_is_shared_all_the_same() -> None:
    """Used to be taken for the setting's own, with the covariance of another parameter."""
    cov = covariance(3)
    known = Uncertainty(1, {}, (*OWN, *SHARED), cov, SHARED)
    plain = fakes.fit(1)
    for name in SHARED:
        unsound = replace(plain, status={**plain.status, name: Status.NOT_IDENTIFIABLE})
        found = stage_of(unsound, known)
        assert (found.own, found.shared) == (OWN, SHARED)
        assert found.covariance is cov


def test_a_setting_without_errors_beside_one_with_them() -> None:
    """Used to end in a broadcasting error."""
    stages = [stage(9, covariance(1)), Stage(10, reference_parameters(10))]
    for click in clicks(levels(stages, PURDY_DAMPER, SINE, speeds=(0.2,)), PURDY_DAMPER):
        assert np.isfinite(click.percent)
        assert np.isnan([click.low, click.high, click.percent_low, click.percent_high]).all()


def test_shared_errors_cancel_whatever_rounding_does_to_their_directions() -> None:
    """Two shared parameters of like error have eigenvectors that hang on the last digit."""
    found = []
    for setting, sign in ((9, 1.0), (10, -1.0)):
        cov = np.zeros((5, 5))
        cov[3:, 3:] = 1e-2**2 * (np.eye(2) + sign * 1e-13 * np.array([[0.0, 1.0], [1.0, 0.0]]))
        found += levels([stage(setting, cov)], PURDY_DAMPER, SINE, speeds=(0.1,))
    for click in clicks(found, PURDY_DAMPER):
        assert click.high - click.change < 0.1 * 1.96 * found[0].error


@pytest.mark.parametrize(
    ("status", "has_errors"),
    [
        ({"r_m1": Status.FITTED, "k_e": Status.FITTED}, False),
        ({"r_m1": Status.FIXED, "k_e": Status.FITTED}, True),
        ({"r_m1": Status.AT_BOUND, "k_e": Status.FITTED}, True),
    ],
)
def test_a_setting_without_a_minimum_has_no_error_from_shared_values_alone(
    status, has_errors
) -> None:
    """Two of three triangle logs met no minimum; "+30.12 +- 0.01 N" was said of a click."""
    fit = SimpleNamespace(
        setting=Setting.of(9), parameters=reference_parameters(9), status=status
    )  # fmt: skip
    known = SimpleNamespace(names=("k_e", "r_m3"), shared=("r_m3",), covariance=np.eye(2) * 1e-4)
    found = stage_of(fit, known)
    assert (found.covariance is not None) is has_errors
    (level, *_) = levels([found], PURDY_DAMPER, SINE, speeds=(0.1,))
    assert np.isfinite(level.error) == has_errors


def test_levels_of_settings_together_are_those_of_each_alone() -> None:
    stages = [stage(k, covariance(k)) for k in (8, 9)]
    stages += [stage(10), replace(stage(11, covariance(11)[:3, :3]), shared=())]
    together = levels(stages, PURDY_DAMPER, SINE, speeds=(0.1, 0.26))
    alone = [one for s in stages for one in levels([s], PURDY_DAMPER, SINE, speeds=(0.1, 0.26))]
    for one, other in zip(together, alone, strict=True):
        assert (one.setting, one.speed, one.stroke) == (other.setting, other.speed, other.stroke)
        figures = ("force", "error", "rest", "whole_error")
        for a, b in ((getattr(x, name) for x in (one, other)) for name in figures):
            assert a == pytest.approx(b, rel=1e-12, nan_ok=True)
        assert one.carried == pytest.approx(other.carried, rel=1e-12)


def test_a_covariance_that_breaks_costs_its_setting_alone() -> None:
    told = []
    stages = [stage(k, covariance(k)) for k in (8, 9, 10)]
    stages[1] = replace(stages[1], covariance=covariance(9)[:4])
    found = levels(
        stages, PURDY_DAMPER, SINE, speeds=(0.1,), on_error=lambda *one: told.append(one[0])
    )
    assert told == [9]
    assert [level.setting for level in found] == [8, 8, 10, 10]
    with pytest.raises(ValueError, match="square"):
        levels(stages, PURDY_DAMPER, SINE, speeds=(0.1,))


def test_a_click_to_a_setting_with_other_shared_values_has_no_error() -> None:
    stages = [stage(8, covariance(8)), replace(stage(9, covariance(9)[:3, :3]), shared=())]
    found = clicks(levels(stages, PURDY_DAMPER, SINE, speeds=(0.1,)), PURDY_DAMPER)
    assert all(np.isfinite(one.change) and np.isnan(one.low) for one in found)
    assert len(found) == 2
