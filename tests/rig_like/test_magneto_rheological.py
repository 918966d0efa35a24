"""Of a damper that yields before it slides no valve is blamed, and that it yields is said."""

import pytest

from damperfit.conditioning import condition
from damperfit.damper.purdy.parameters import PURDY_DAMPER
from damperfit.damper.valve_dampers import TwinTube
from damperfit.identification import FitOptions, identify
from damperfit.recording import Trace
from damperfit.uncertainty import Diagnosis, assess
from tests.identification.rig import recorded
from tests.rig_like.dampers import magneto_rheological

OF_VALVES = {
    "delay", "gas_pressure", "gas_exponent", "gas_volume", "compressibility", "valve_law_rebound",
    "valve_law_bump", "r_m1", "r_m2", "r_m3",
}  # fmt: skip
FREE = ("r_m1", "r_m2", "k_e", "f_f", "f_0")
PAPER = FitOptions("plain", FREE, {"r_m3": 2.597e6})


def conditioned(current: float) -> Trace:
    log = magneto_rheological(current, 1.0, 1)
    return condition(recorded(log.displacement, log.force, 500.0, setting=1))


def diagnosed(current: float, damper: object, options: FitOptions) -> Diagnosis:
    campaign = identify([conditioned(current)], damper, options)
    (found,) = assess(campaign, damper).diagnoses
    return found


@pytest.mark.parametrize(
    "current",
    [pytest.param(0.0, marks=pytest.mark.slow), 0.5, pytest.param(1.5, marks=pytest.mark.slow)],
)
def test_the_papers_damper_is_told_that_the_log_yields(current: float) -> None:
    found = diagnosed(current, PURDY_DAMPER, PAPER)
    assert found.has_yielded
    assert not OF_VALVES & {hint.name for hint in found.hints}
    assert "it yields before it slides" in found.sentence
    assert "the model misses that" in found.sentence


@pytest.mark.slow
def test_blow_offs_that_meet_it_are_not_said_to_miss_that_it_yields() -> None:
    found = diagnosed(1.5, TwinTube(), FitOptions("plain"))
    assert found.has_yielded
    assert not OF_VALVES & {hint.name for hint in found.hints}
    assert found.is_met
    assert "misses that" not in found.sentence
    assert found.sentence.endswith("its cause was not found")
