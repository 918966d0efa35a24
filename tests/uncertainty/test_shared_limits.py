"""A mounting that no log shows give has a lower limit, also where all settings share it."""

from __future__ import annotations

import numpy as np
import pytest

from damperfit.conditioning import condition
from damperfit.identification import FitOptions, Status, identify
from damperfit.recording import Recording
from damperfit.simulation import simulate
from damperfit.tested.setting import Setting
from damperfit.uncertainty import assess, reconsider
from tests.laws.valve_logs import VALUES, damper, moved

TRUE = 2e9  # N/m: the oil of this damper gives three hundred times as much


def trace(setting: int, bleed: float):
    model = damper(has_play_and_lag=False)
    numbers = {k: v for k, v in VALUES.items() if k in model.names}
    numbers |= {"rebound_bleed": bleed, "compression_bleed": 0.9 * bleed, "k_s": TRUE, "k_e": 1e9}
    motion = moved((0.08, 0.24), rate=500.0, cycles=3)
    force = simulate(model.values(numbers), model, motion).force
    noise, n = np.random.default_rng(30 + setting), len(force)
    x = motion.displacement + noise.normal(0.0, 3e-6, n)
    force = force + noise.normal(0.0, 1.5, n)
    time = motion.interval * np.arange(n)
    return condition(Recording(f"{setting}.csv", "", "", Setting.of(setting), time, x, force))


@pytest.fixture(scope="module")
def found():
    model = damper(has_play_and_lag=False)
    logs = [trace(1, 2e4), trace(2, 3e4), trace(3, 4e4)]
    campaign = identify(logs, model, FitOptions("joint"))
    assessment = assess(campaign, model)
    return reconsider(campaign, assessment), assessment


def test_softer_mountings_are_excluded(found) -> None:
    campaign, assessment = found
    assert len(campaign.sharing.settings) == 2  # the first met it otherwise, and has the value
    assert [fit.status["k_s"] for fit in campaign.fits] == [Status.NOT_IDENTIFIABLE] * 3
    for fit in campaign.fits:
        low, high = assessment.plausible_limits(fit, "k_s")
        assert high is None
        assert 1e6 < low < TRUE
        said = assessment.verdicts(campaign)[fit.setting]["k_s"]
        assert said.startswith(f"not identifiable upward: at least {low:.4g} N/m (95 %)")
        assert "no value" not in said


def test_it_is_one_profile_of_all_settings(found) -> None:
    _, assessment = found
    one, *_, other = (p for p in assessment.profiles if p.name == "k_s")
    assert (one.low, one.is_shared, one.shape) == (other.low, True, "flat upward")
    assert one.evaluations < 60


def test_what_is_determined_is_not_followed(found) -> None:
    _, assessment = found
    assert {p.name for p in assessment.profiles if p.is_shared} == {"k_s"}
