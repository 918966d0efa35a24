"""The incompressible limit and both appendices, against pressures, volumes and the slow oracle."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from damperfit.damper.purdy import parameters as appendices
from damperfit.damper.purdy import parameters as cf
from damperfit.damper.purdy.parameters import PURDY_DAMPER, Damper, Parameters
from damperfit.errors import ConfigurationError, SimulationError

# Appendix 1: equations (23) to (30), their limits and the typical values.

ratios = st.floats(0.0, 0.5)
pressures = st.floats(1e3, 1e8)
moduli = st.floats(1e8, 1e10)
tubes = st.builds(
    appendices.Tube, st.floats(5e-4, 5e-3), st.floats(0.02, 0.08), st.floats(5e10, 2.2e11)
)


@given(ratio=ratios, pressure=pressures, liquid=moduli, tube=tubes)
def test_23_25_26_and_28_are_one_law(ratio, pressure, liquid, tube):
    """The corrected numerator K_g K_B: only it agrees with (23). N08: (26) is V_r off at most."""
    parts = {"gas": appendices.gas_modulus(pressure), "liquid": liquid}
    parts["container"] = appendices.tube_modulus(tube)
    share, rest = appendices.volume_fractions(ratio)
    assert share + rest == pytest.approx(1.0)
    summed = appendices.effective_modulus(share, **parts)
    closed = appendices.mixture_modulus(ratio, **parts)
    assert closed == pytest.approx(summed, rel=1e-12)
    dilute = appendices.dilute_modulus(ratio, **parts)
    assert -1e-12 <= closed / dilute - 1.0 <= ratio * (1 + 1e-9) + 1e-12
    oil = {"liquid": liquid, "compliance": appendices.compliance_factor(liquid, tube)}
    direct = appendices.modulus_at_pressure(pressure, volume_ratio=ratio, **oil)
    assert direct == pytest.approx(dilute, rel=1e-12)


@given(ratio=st.floats(1e-4, 0.5), liquid=moduli, compliance=st.floats(1.0, 2.0))
def test_29_and_30_are_the_limits_of_28(ratio, liquid, compliance):
    """N08."""
    oil = {"liquid": liquid, "compliance": compliance}
    at_nothing = appendices.modulus_at_pressure(1e-6, volume_ratio=ratio, **oil)
    at_everything = appendices.modulus_at_pressure(1e25, volume_ratio=ratio, **oil)
    assert appendices.low_pressure_limit(ratio, **oil) == 0.0
    without_gas = appendices.modulus_at_pressure(1.0, volume_ratio=0.0, **oil)
    assert without_gas == pytest.approx(appendices.low_pressure_limit(0.0, **oil))
    assert at_nothing < 1e-1
    assert at_everything == pytest.approx(appendices.high_pressure_limit(**oil), rel=1e-9)
    assert appendices.high_pressure_limit(**oil) == pytest.approx(liquid / compliance)


def test_tube_modulus_against_the_stretch_of_a_thin_ring():
    """Raise the pressure in a ring by dP and measure the area it encloses."""
    tube = appendices.Tube(wall_thickness=0.002, inner_diameter=0.0285, youngs_modulus=7e10)
    pressure = 1e3
    hoop_stress = pressure * tube.inner_diameter / (2 * tube.wall_thickness)
    wider = tube.inner_diameter * (1 + hoop_stress / tube.youngs_modulus)
    swelling = (wider**2 - tube.inner_diameter**2) / tube.inner_diameter**2
    assert appendices.tube_modulus(tube) == pytest.approx(pressure / swelling, rel=1e-6)


def test_a_tube_without_wall_is_refused():
    with pytest.raises(ConfigurationError, match="must all be positive"):
        appendices.compliance_factor(1.5e9, appendices.Tube(0.0, 0.03, 7e10))


# The incompressible limit and Appendix 2, against pressures, volumes and the slow oracle.

SET_M = Parameters(r_m1=1.8e4, r_m2=3.527e6, r_m3=2.597e6, k_e=3.65e8, f_f=0.0)

ENDS = {
    "rod_diameter": (0.008, 0.022), "piston_diameter": (0.025, 0.06), "gas_length": (0.05, 0.2),
    "gas_piston_diameter": (0.03, 0.06), "oil_density": (700.0, 1000.0),
    "gas_pressure": (1e5, 3e6), "gas_exponent": (1.0, 1.67),
}  # fmt: skip
dampers = st.builds(Damper, **{name: st.floats(*ends) for name, ends in ENDS.items()})
valves = st.builds(appendices.LinearValves, *3 * (st.floats(0, 1e10),))
strokes = st.floats(-0.05, 0.05)
speeds = st.floats(1e-6, 3.0)


@given(damper=dampers, x=strokes, v=speeds)
def test_incompressible_force_follows_from_flows_and_valve_laws(damper, x, v):
    """Chamber by chamber from the volume swept, with no formula of the module under test."""
    y = dataclasses.replace(SET_M, f_f=37.0, f_0=-5.0)
    gas = damper.gas_volume + damper.rod_area * x
    p_3 = damper.gas_pressure * (damper.gas_volume / gas) ** damper.gas_exponent
    # rebound: what chamber 1 loses leaves through valve 1, what 2 gains came through valve 3
    w_1 = damper.oil_density * damper.annulus_area * v
    p_1 = p_3 + (y.r_m1 * w_1) ** 2
    p_2 = p_3 - y.r_m3 * damper.oil_density * damper.piston_area * v
    rebound = p_1 * damper.annulus_area - p_2 * damper.piston_area + y.f_f + y.f_0
    # bump: what chamber 2 loses goes through valve 2; the rod's share leaves through valve 1
    w_1 = damper.oil_density * damper.rod_area * v
    p_1 = p_3 + (y.r_m1 * w_1) ** 2
    p_2 = p_1 + y.r_m2 * damper.oil_density * damper.piston_area * v
    bump = p_1 * damper.annulus_area - p_2 * damper.piston_area - y.f_f + y.f_0
    found = cf.incompressible_force(y, damper, np.array([x, x]), np.array([v, -v]))
    scale = p_1 * damper.piston_area + abs(bump) + abs(rebound)
    assert found == pytest.approx([rebound, bump], rel=1e-11, abs=1e-12 * scale)


def test_the_papers_damper_in_numbers():
    """Areas by hand, (39) of them, and N06: the closed form peaks at x = 0."""
    d, speed = PURDY_DAMPER, 2 * np.pi * 1.5 * 0.032
    areas = d.annulus_area, d.piston_area, d.rod_area
    assert areas == pytest.approx((3.54411e-4, 6.37940e-4, 2.83529e-4), rel=1e-6)
    assert d.gas_volume == pytest.approx(6.28319e-5, rel=1e-6)
    slopes = appendices.simple_slopes(appendices.LinearValves(1e9, 2e9, 3e9), d)
    by_hand = 3.54411e-4**2 * 1e9 + 6.37940e-4**2 * 3e9, 6.37940e-4**2 * 2e9 + 2.83529e-4**2 * 1e9
    assert slopes == pytest.approx(by_hand, rel=1e-5)
    force = cf.incompressible_force(SET_M, d, np.zeros(2), np.array([speed, -speed]))
    assert force == pytest.approx([892.855, -862.009], abs=5e-4)
    assert cf.gas_pressure(d, -0.03) > d.gas_pressure  # the rod in compresses the gas


@given(damper=dampers, resistances=valves, x=strokes, v=speeds)
def test_simple_force_is_pressure_times_area_and_has_its_slopes(damper, resistances, x, v):
    """N07: (38) from the pressures of (32) and (36); (39), exact as the force is linear in v."""
    p_1, p_2 = appendices.rebound_pressures(resistances, damper, x, v)
    rebound = p_1 * damper.annulus_area - p_2 * damper.piston_area
    q_1, q_2 = appendices.bump_pressures(resistances, damper, x, -v)
    bump = q_1 * damper.annulus_area - q_2 * damper.piston_area
    found = appendices.simple_force(resistances, damper, np.full(3, x), np.array([v, -v, 0.0]))
    scale = float(max(np.max(np.abs([p_1, p_2, q_1, q_2])), 1.0)) * damper.piston_area
    assert found[:2] == pytest.approx([rebound, bump], abs=1e-10 * scale, rel=1e-10)
    assert found[2] == pytest.approx(-damper.rod_area * cf.gas_pressure(damper, x), rel=1e-14)
    slopes = np.array(appendices.simple_slopes(resistances, damper)) * [v, -v]
    assert found[:2] - found[2] == pytest.approx(slopes, rel=1e-10, abs=1e-12 * abs(found[2]))


@given(damper=dampers, v=speeds)
def test_flows_fill_the_volume_that_the_piston_sweeps(damper, v):
    """(31), (34): oil is neither gained nor lost in chambers 1 and 2, nor with the rod in 3."""
    q_1, q_3 = appendices.rebound_flows(damper, v)
    assert q_1 == pytest.approx(damper.annulus_area * v)
    assert q_3 - q_1 == pytest.approx(damper.rod_area * v)
    q_1, q_2 = appendices.bump_flows(damper, -v)
    assert q_2 == pytest.approx(damper.piston_area * v)
    assert q_2 - q_1 == pytest.approx(damper.annulus_area * v)
    assert q_1 >= 0


@given(damper=dampers, x=strokes)
def test_gas_piston_moves_by_the_rod_volume(damper, x):
    """(16), (33), (35): a_g eta = -a_r x, and P_3 V^gamma is constant."""
    gas_area = np.pi / 4 * damper.gas_piston_diameter**2
    eta = appendices.gas_piston_displacement(damper, x)
    assert eta * gas_area == pytest.approx(-x * damper.rod_area, rel=1e-12, abs=1e-20)
    volume = gas_area * (damper.gas_length - eta)
    invariant = cf.gas_pressure(damper, x) * volume**damper.gas_exponent
    at_rest = damper.gas_pressure * damper.gas_volume**damper.gas_exponent
    assert invariant == pytest.approx(at_rest, rel=1e-12)


def test_no_room_for_the_gas_is_an_error_that_says_where():
    with pytest.raises(SimulationError, match=r"gas volume used up at displacement -0\.25 m"):
        cf.gas_pressure(PURDY_DAMPER, [0.0, -0.25])
