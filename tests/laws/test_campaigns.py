"""Campaigns of valvings meet their bars; the truth of their forces is the rig's own."""

import re
from dataclasses import replace

import numpy as np
import pytest

from tests.laws import campaigns
from tests.rig_like.rig import FINE, pulled


@pytest.mark.parametrize("place", range(3))
@pytest.mark.parametrize("speed", [0.1, -0.1])
def test_the_steady_force_is_that_of_the_rig_at_a_constant_speed(place: int, speed: float) -> None:
    campaign = campaigns.drawn(place, 1)
    body = replace(campaign.bodies[2], stiffness=2e6, play=0.0, rubber=0.0, free_gas=0.0)
    x = np.arange(-0.01, 0.0, abs(speed) * FINE) * np.sign(speed)
    pull, p1, p2, p3 = pulled(body, x, np.full(len(x), speed))
    rod, bore = body.areas
    if body.layout == "monotube":
        p2 = p3
    oil = p1[-1] * (bore - rod) - p2[-1] * bore + rod * p3[-1]
    slides = np.sign(speed) * body.friction + body.drag * speed
    assert oil + slides == pytest.approx(campaigns.steady_force(body, speed), rel=0.01)
    assert pull[-1] == pytest.approx(oil + slides - rod * (p3[-1] - 101325.0), abs=0.02 * abs(oil))


@pytest.mark.slow
@pytest.mark.parametrize("place", [0, 4])
def test_a_campaign_in_one_command_meets_its_bars(place: int, tmp_path) -> None:
    campaign, logs = campaigns.drawn(place, 1), campaigns.logs_of(place, 1)
    cpu_s = campaigns.identified(logs, tmp_path)
    lines, covered, known = campaigns.told(campaign, tmp_path, cpu_s)
    missed = [line for line in lines if line.startswith("  ! ")]
    assert covered >= known - 2
    assert not [line for line in missed if re.search(r"csv|f_f| for ", line)]
