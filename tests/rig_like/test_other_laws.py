"""Dampers in laws of another form: drawn as the command says, and met by the law that is chosen."""

import pytest

from tests.rig_like import other_laws


def test_settings_of_a_drawn_damper_differ_by_needle_and_preload_alone() -> None:
    settings, channels = other_laws.drawn(3)
    soft, stiff = settings[6, 1], settings[18, 3]
    assert stiff.rebound.bleed / soft.rebound.bleed == pytest.approx(1.6e5 / 1.7e4)
    assert soft.rebound.opening < stiff.rebound.opening
    assert (soft.rebound.cost, soft.rebound.power) == (stiff.rebound.cost, stiff.rebound.power)
    assert (soft.friction, soft.layout) == (stiff.friction, "monotube")
    assert {other_laws.drawn(seed)[1].lag for seed in range(3)} == {0.0, 0.006, 0.01}
    assert channels.lag == 0.01


@pytest.mark.slow
@pytest.mark.parametrize("seed", [4, 7])
def test_a_law_of_another_form_is_met_at_its_speed_and_a_fifth_of_it(seed, tmp_path) -> None:
    bars = other_laws.bars_of(other_laws.written(tmp_path, seed))
    assert not [bar.line for bar in bars if not bar.is_met]
