"""The oracle itself, against known numbers and laws: a twin that is wrong proves nothing."""

import dataclasses

import numpy as np
import pytest
from scipy.integrate import simpson

from damperfit.damper.purdy.parameters import PURDY_DAMPER
from tests.oracles import model
from tests.oracles.golden import GOLDEN, PHASES, SET_M

PERIOD = 1 / 1.5
SMOOTH = dataclasses.replace(SET_M, f_f=0.0)


def fourth_cycle(parameters, phases, *, run_in=3, **how):
    """The oracle's fourth cycle from rest, or an earlier one."""
    time = np.concatenate([[0.0], (run_in + np.asarray(phases)) * PERIOD])
    return model.solve(parameters, PURDY_DAMPER, model.sine(0.032, 1.5), time, **how)


@pytest.mark.parametrize(("parameters", "rows"), GOLDEN)
def test_golden_table(parameters, rows):
    """N12, to the digits printed."""
    solved = fourth_cycle(parameters, PHASES, run_in=1)  # steady by then
    expected = np.array(rows)
    assert np.max(np.abs(solved.force[1:] - expected[:, 0])) <= 0.006
    assert np.max(np.abs(solved.pressures[:, 1:].T / 1e5 - expected[:, 1:])) <= 0.00011


def test_rest():
    """N01: at P_0 everywhere nothing flows, and the gas pushes the rod out with a_r P_0."""
    now = model.instant(SET_M, PURDY_DAMPER, *model.rest_masses(PURDY_DAMPER), 0.0)
    assert now.oil_force == pytest.approx(-130.4232, abs=5e-5)
    assert max(abs(now.pressure_1 - 4.6e5), abs(now.pressure_2 - 4.6e5)) < 1e-6
    assert max(abs(now.rate_1), abs(now.rate_2)) < 1e-7


def test_energy_balance():
    """N03: 79.211376 J over a steady cycle of set M, both sides."""
    phases = np.arange(2001) / 2000
    solved = fourth_cycle(SMOOTH, phases, run_in=1, rtol=1e-12)
    velocity = 2 * np.pi * 1.5 * 0.032 * np.cos(2 * np.pi * phases)
    work = model.cycle_energy(solved.time[1:], solved.force[1:], velocity)
    lost = model.dissipation(SMOOTH, PURDY_DAMPER, solved.pressures[:, 1:])
    assert work == pytest.approx(79.211376, abs=1e-6)
    assert work == pytest.approx(sum(simpson(p, x=solved.time[1:]) for p in lost), rel=1e-9)
    assert min(np.min(p) for p in lost) > -1e-5


def test_equal_pressure_start_keeps_the_oil():
    """N24: at x != 0 all chambers at one pressure, no oil gained or lost."""
    rest = sum(model.rest_masses(PURDY_DAMPER))
    for x in (-0.032, -0.01, 0.0, 0.02, 0.032):
        m_1, m_2 = model.equal_pressure_start(SET_M, PURDY_DAMPER, x)
        now = model.instant(SET_M, PURDY_DAMPER, m_1, m_2, x)
        assert now.pressure_1 == pytest.approx(now.pressure_3, rel=1e-9)
        assert now.pressure_2 == pytest.approx(now.pressure_3, rel=1e-9)
        gained_3 = (PURDY_DAMPER.gas_volume - now.gas_volume) * PURDY_DAMPER.oil_density
        assert m_1 + m_2 + gained_3 == pytest.approx(rest, rel=1e-12)
