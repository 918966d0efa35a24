"""Dampers like measured ones meet their bars; the command that says so can also say no."""

import pytest

from tests.identification.convergence import KINDS
from tests.rig_like.accuracy import BARS, measured
from tests.rig_like.bars import Bar, adjustable_bars, second_rig_bars


@pytest.mark.slow
@pytest.mark.parametrize("bars", [adjustable_bars, second_rig_bars])
def test_dampers_like_measured_ones_meet_their_bars(bars, tmp_path):
    missed = [bar.line for bar in bars(tmp_path) if not bar.is_met]
    assert not missed


@pytest.mark.slow
@pytest.mark.parametrize("has_play", [False, True], ids=["tight", "play"])
@pytest.mark.parametrize("kind", KINDS)
def test_fits_come_near_dampers_of_another_integrator(kind, *, has_play):
    found = measured(kind, 1, has_play=has_play)
    for part, bar in BARS.items():
        assert max(found.of(part), default=0.0) <= bar, part
    assert all(found.covered.values())


def test_a_bar_is_met_up_to_itself():
    assert Bar("", 0.5, 0.5).is_met
    assert not Bar("", 0.501, 0.5).is_met
    assert Bar("slow", 0.501, 0.5).line == "MISSED slow: 0.501 (0.5)"
