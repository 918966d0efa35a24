"""What the paper says in words about setting 10 (Figs 4 to 9), on the synthetic reference set."""

import dataclasses

import numpy as np
import pytest

from damperfit.damper.purdy.closed_forms import gas_pressure
from damperfit.damper.purdy.parameters import PURDY_DAMPER
from damperfit.damper.purdy.reference import reference_parameters
from damperfit.simulation import SolverOptions, simulate, sine_motion

N = 3000  # samples a cycle


@dataclasses.dataclass(frozen=True)
class Loop:
    """A steady cycle, x = A sin(2 pi i/N) at sample i."""

    velocity: np.ndarray
    force: np.ndarray
    pressures: np.ndarray

    @property
    def rebound(self):
        return self.force[self.velocity > 0.05]

    @property
    def bump(self):
        return self.force[self.velocity < -0.05]

    def hysteresis(self, *, bump=False):
        """Width of the force-velocity loop at half the peak speed, N."""
        at = N // 6 + (N // 2 if bump else 0)
        back = N - N // 6 + (N // 2 if bump else 0)
        return abs(self.force[at] - self.force[back % N])


def loop(setting=10, **factors):
    """The loop of a setting with some parameters scaled."""
    y = reference_parameters(setting)
    y = dataclasses.replace(y, **{name: getattr(y, name) * f for name, f in factors.items()})
    response = simulate(
        y,
        PURDY_DAMPER,
        sine_motion(0.032, 1.5, cycles=3, sample_rate=1.5 * N),
        options=SolverOptions(tolerance=1e-4),
    )
    cut = slice(2 * N, 3 * N)
    return Loop(response.velocity[cut], response.force[cut], response.pressures[:, cut])


@pytest.fixture(scope="module")
def base():
    return loop()


@pytest.mark.parametrize("factor", [0.8, 1.2])
def test_r_m1_moves_rebound_more_than_bump(base, factor):
    """Fig 5: both strokes, rebound more; hysteresis grows with it; the centre stays."""
    other = loop(r_m1=factor)
    rebound = np.max(np.abs(other.rebound - base.rebound))
    bump = np.max(np.abs(other.bump - base.bump))
    assert rebound > 1.5 * bump > 100.0
    assert (other.force.max() > base.force.max()) == (factor > 1)
    assert (other.force.min() < base.force.min()) == (factor > 1)
    for is_bump in (False, True):
        wider = other.hysteresis(bump=is_bump) > base.hysteresis(bump=is_bump)
        assert wider == (factor > 1)
    # the centre: the force at the reversals
    ends = [N // 4, 3 * N // 4]
    at_ends = np.abs(other.force[ends] - base.force[ends])
    assert np.max(at_ends) < 0.1 * rebound


@pytest.mark.parametrize("factor", [0.8, 1.2])
def test_r_m2_moves_bump_only(base, factor):
    """Fig 6."""
    other = loop(r_m2=factor)
    assert np.max(np.abs(other.rebound - base.rebound)) < 0.1
    assert np.max(np.abs(other.bump - base.bump)) > 50.0
    assert (other.force.min() < base.force.min()) == (factor > 1)


@pytest.mark.parametrize("factor", [0.5, 1.5])
def test_r_m3_moves_rebound_only(base, factor):
    """Fig 7; x1.5 cavitates chamber 2 in part of rebound, x0.5 does not (N10)."""
    other = loop(r_m3=factor)
    assert np.max(np.abs(other.bump - base.bump)) < 0.1
    assert np.max(np.abs(other.rebound - base.rebound)) > 50.0
    is_empty = other.pressures[1] == 0.0
    assert np.any(is_empty) == (factor > 1)
    assert np.all(other.velocity[is_empty] > 0)
    assert np.mean(is_empty) < 0.4
    assert np.all(base.pressures > 0)


def test_k_e_opens_the_loop(base):
    """Fig 8: x2 narrows it a little, x0.2 opens it about four times (N11: 2.5 to 4)."""
    for is_bump in (False, True):
        width = base.hysteresis(bump=is_bump)
        assert 0.5 * width < loop(k_e=2.0).hysteresis(bump=is_bump) < width
        assert 2.5 < loop(k_e=0.2).hysteresis(bump=is_bump) / width < 4.5
    assert loop(k_e=2.0).force.max() == pytest.approx(base.force.max(), rel=0.01)


@pytest.mark.parametrize(("factor", "shift"), [(0.0, -50.0), (2.0, 50.0)])
def test_friction_shifts_both_branches(base, factor, shift):
    """Fig 9: by the friction itself, up in rebound and down in bump."""
    other = loop(f_f=factor)
    assert other.rebound - base.rebound == pytest.approx(np.full(len(base.rebound), shift))
    assert other.bump - base.bump == pytest.approx(np.full(len(base.bump), -shift))


@pytest.mark.parametrize("setting", [1, 10, 15])
def test_r_m3_lies_fifteen_per_cent_below_cavitation(setting):
    """Section 6.2, which gives P_0 = 0.46 MPa: onset at R_m3/0.85 whatever R_m1 and K_e."""
    onset = 1 / 0.85
    assert np.all(loop(setting, r_m3=0.99 * onset).pressures[1] > 0)
    assert np.any(loop(setting, r_m3=1.01 * onset).pressures[1] == 0)


def test_the_gas_pushes_the_rod_out():
    """At the reversals, where oil hardly flows, the force is the gas force, mean -a_r P_0."""
    soft = loop(1, f_f=0.0)
    for at, x in ((N // 4, 0.032), (3 * N // 4, -0.032)):
        gas = -PURDY_DAMPER.rod_area * float(gas_pressure(PURDY_DAMPER, x))
        assert soft.force[at] == pytest.approx(gas, abs=10.0)


def test_no_setting_cavitates_and_force_grows_with_the_setting_in_both_strokes():
    loops = [loop(setting) for setting in range(1, 21)]
    assert all(np.all(cycle.pressures > 0) for cycle in loops)
    peaks = np.array([(cycle.force.max(), -cycle.force.min()) for cycle in loops])
    assert np.all(np.diff(peaks, axis=0) > 0)
