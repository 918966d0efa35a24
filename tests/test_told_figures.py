"""Figures that module texts and the manual tell in passing, each measured anew."""

from dataclasses import replace

import pytest

from damperfit.damper.purdy.parameters import PURDY_DAMPER
from damperfit.damper.purdy.reference import reference_parameters
from damperfit.identification import FitOptions, identify
from tests.identification.rig import trace

SETTINGS = (1, 10, 20)
THREE = FitOptions("plain", ("r_m1", "r_m2", "k_e"), {"r_m3": 2.597e6, "f_f": 50.0})


def fitted(log, damper=PURDY_DAMPER, options=THREE):
    return identify([log], damper, options).fits[0]


@pytest.mark.parametrize(("longer", "more"), [(1.1, 1.1), (0.9, 0.9)])
def test_a_wrong_length_is_a_wrong_modulus(longer, more) -> None:
    """The manual's page `model`: lengths 10 % too long, K_e 10 % too high."""
    damper = replace(
        PURDY_DAMPER,
        chamber_1_length=longer * PURDY_DAMPER.chamber_1_length,
        chamber_2_length=longer * PURDY_DAMPER.chamber_2_length,
    )
    k_e = fitted(trace(10, duration=6.0), damper).parameters.k_e
    assert k_e / reference_parameters(10).k_e == pytest.approx(more, abs=0.015)


@pytest.mark.one_in(3)
@pytest.mark.parametrize("factor", [0.6, 1.4])
@pytest.mark.parametrize("setting", SETTINGS)
def test_a_wrong_gas_pressure_is_fitted_well(setting, factor) -> None:
    """The manual's page `model`: 40 % off, the MSE is 0.3 % or less."""
    damper = replace(PURDY_DAMPER, gas_pressure=factor * PURDY_DAMPER.gas_pressure)
    five = FitOptions("plain", ("r_m1", "r_m2", "r_m3", "k_e", "f_f"))
    assert fitted(trace(setting, duration=6.0), damper, five).mse_percent <= 0.3
