"""Dampers like measured ones meet their bars; the command that says so can also say no."""

from __future__ import annotations

import pytest

from tests.rig_like.bars import Bar, adjustable_bars, second_rig_bars


@pytest.mark.slow
@pytest.mark.parametrize("bars", [adjustable_bars, second_rig_bars])
def test_dampers_like_measured_ones_meet_their_bars(bars, tmp_path):
    missed = [bar.line for bar in bars(tmp_path) if not bar.is_met]
    assert not missed


def test_a_bar_is_met_up_to_itself():
    assert Bar("", 0.5, 0.5).is_met
    assert not Bar("", 0.501, 0.5).is_met
    assert Bar("slow", 0.501, 0.5).line == "MISSED slow: 0.501 (0.5)"
