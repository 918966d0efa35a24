"""Appendix 1: equations (23) to (30), their limits and the typical values."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from damperfit.damper.purdy import appendices
from damperfit.errors import ConfigurationError

ratios = st.floats(0.0, 0.5)
pressures = st.floats(1e3, 1e8)
moduli = st.floats(1e8, 1e10)
tubes = st.builds(
    appendices.Tube,
    wall_thickness=st.floats(5e-4, 5e-3),
    inner_diameter=st.floats(0.02, 0.08),
    youngs_modulus=st.floats(5e10, 2.2e11),
)


@given(ratio=ratios, pressure=pressures, liquid=moduli, tube=tubes)
def test_25_is_23_with_the_shares_put_in(ratio, pressure, liquid, tube):
    """The corrected numerator K_g K_B: only it agrees with (23)."""
    gas = appendices.gas_modulus(pressure)
    share, _ = appendices.volume_fractions(ratio)
    container = appendices.tube_modulus(tube)
    summed = appendices.effective_modulus(share, gas=gas, liquid=liquid, container=container)
    closed = appendices.mixture_modulus(ratio, gas=gas, liquid=liquid, container=container)
    assert closed == pytest.approx(summed, rel=1e-12)


@given(ratio=st.floats(1e-6, 0.05), pressure=pressures, liquid=moduli, tube=tubes)
def test_26_is_25_for_little_gas(ratio, pressure, liquid, tube):
    """N08: the two differ by at most V_r."""
    springs = {
        "gas": appendices.gas_modulus(pressure),
        "liquid": liquid,
        "container": appendices.tube_modulus(tube),
    }
    exact, dilute = (
        appendices.mixture_modulus(ratio, **springs),
        appendices.dilute_modulus(ratio, **springs),
    )
    assert 0.0 <= exact / dilute - 1.0 + 1e-12
    assert exact / dilute - 1.0 <= ratio * (1 + 1e-9) + 1e-12


@given(ratio=ratios, pressure=pressures, liquid=moduli, tube=tubes)
def test_28_is_26_with_gas_and_tube_put_in(ratio, pressure, liquid, tube):
    dilute = appendices.dilute_modulus(
        ratio,
        gas=appendices.gas_modulus(pressure),
        liquid=liquid,
        container=appendices.tube_modulus(tube),
    )
    direct = appendices.modulus_at_pressure(
        pressure,
        volume_ratio=ratio,
        liquid=liquid,
        compliance=appendices.compliance_factor(liquid, tube),
    )
    assert direct == pytest.approx(dilute, rel=1e-12)


@given(ratio=st.floats(1e-4, 0.5), liquid=moduli, compliance=st.floats(1.0, 2.0))
def test_29_and_30_are_the_limits_of_28(ratio, liquid, compliance):
    """N08."""
    oil = {"liquid": liquid, "compliance": compliance}
    at_nothing = appendices.modulus_at_pressure(1e-6, volume_ratio=ratio, **oil)
    at_everything = appendices.modulus_at_pressure(1e25, volume_ratio=ratio, **oil)
    assert appendices.low_pressure_limit(ratio, **oil) == 0.0
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
        appendices.Tube(wall_thickness=0.0, inner_diameter=0.03, youngs_modulus=7e10)
