"""The gas of a damper with real valves: held as declared, or found by the logs of all settings."""

from __future__ import annotations

from dataclasses import replace

import pytest

from damperfit.identification import DETECT, FitOptions, Status, identify
from tests.identification import adjusted
from tests.identification.adjusted import DAMPER, FOLLOWS, SETTINGS, log

GAS = ("gas_pressure", "gas_volume", "gas_exponent")


def test_one_volume_and_one_pressure_are_found_from_all_settings() -> None:
    # Declared a third too high and a fifth too low, as from a gauge and a guess.
    wrong = replace(DAMPER, gas_pressure=1.35 * DAMPER.gas_pressure, gas_volume=4.8e-5)
    free = ("rebound_bleed", "rebound_opening", "rebound_slope", "compression_bleed", "k_e", "f_f")
    options = FitOptions(
        "joint", free=(*free, "gas_pressure", "gas_volume"), fixed={"f_0": 8.0},
        share=(DETECT,), follows=FOLLOWS,
    )  # fmt: skip
    campaign = identify(adjusted.logs(), wrong, options)
    for fit in campaign.fits:
        assert fit.parameters.gas_pressure == pytest.approx(DAMPER.gas_pressure, rel=0.01)
        assert fit.parameters.gas_volume == pytest.approx(6e-5, rel=0.02)
        assert fit.status["gas_pressure"] is fit.status["gas_volume"] is Status.SHARED
        assert fit.status["gas_exponent"] is Status.FIXED


def test_the_exponent_is_told_by_what_the_gas_does_to_the_force() -> None:
    wrong = replace(DAMPER, gas_exponent=1.0)
    fitted = identify(
        [log(SETTINGS[0], noise=0.1)], wrong,
        FitOptions("plain", free=(*adjusted.TRUTH, "gas_exponent")),
    )  # fmt: skip
    assert fitted.fits[0].parameters.gas_exponent == pytest.approx(1.3, rel=0.02)
