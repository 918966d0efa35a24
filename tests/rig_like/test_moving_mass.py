"""A rod of 2 kg between load cell and damper bends what a fit finds, unless the fit knows of it."""

import pytest

from damperfit.damper.mounting import FIT, NONE
from tests.rig_like.moving_mass import errors, loaded_logs


@pytest.fixture(scope="module")
def traces():
    return loaded_logs(2.0, lag=0.0, tests=((3.0, 0.015), (10.0, 0.0055)))


def test_a_mass_that_nobody_knows_of_is_taken_for_other_things(traces):
    found = errors(traces, NONE, lag=NONE)
    assert found["k_s"] > 8.0
    assert found["compression_opening"] < -10.0


@pytest.mark.parametrize("way", [FIT, 2.0])
def test_a_mass_that_is_fitted_or_weighed_is_not(traces, way):
    found = errors(traces, way, lag=NONE)
    assert abs(found["k_s"]) < 5.0
    assert abs(found["rebound_opening"]) < 1.0
    assert found["mse_percent"] < 0.005
    assert found.get("moving_mass", 2.0) == pytest.approx(2.0, rel=0.05)
