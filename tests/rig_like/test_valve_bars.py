"""The command that says whether dampers of valves meet their bars can say no; three drawn ones."""

import json

import pytest

from damperfit.configuration.loading import load_configuration
from tests.rig_like import valve_bars
from tests.rig_like.bars import adjusted


@pytest.mark.slow
@pytest.mark.parametrize("place", range(3))
def test_dampers_drawn_by_chance_meet_their_bars(place, tmp_path):
    bars = valve_bars.bars_of(valve_bars.written(tmp_path / "own", place, seed=1))
    assert len(bars) == 6
    assert not [bar.line for bar in bars if not bar.is_met]


def test_every_seed_and_place_is_another_damper_with_four_settings():
    drawn = [valve_bars.drawn(place, seed)[0] for seed in (1, 2) for place in range(3)]
    assert len({one[6, 1] for one in drawn}) == 6
    for settings in drawn:
        assert settings[6, 1].rebound.bleed > settings[14, 1].rebound.bleed
        assert settings[6, 1].rebound.opening < settings[6, 3].rebound.opening
        assert settings[6, 1].check == settings[14, 3].check


def test_what_its_owner_knows_is_a_configuration(monkeypatch, tmp_path):
    monkeypatch.setattr(valve_bars, "logged", lambda *_: None)
    monkeypatch.setattr(valve_bars, "text_of", lambda *_: "")
    folder = valve_bars.written(tmp_path, 0, 1)
    body = valve_bars.drawn(0, 1)[0][6, 1]
    (folder / "damper.toml").write_text(adjusted((folder / "damper.toml").read_text()))
    found = load_configuration(folder / "damper.toml", is_law_open=True).damper
    assert found.gas_volume == pytest.approx(body.gas_volume)
    assert found.piston_diameter == pytest.approx(body.piston)
    assert len(list(folder.glob("*_slow.csv"))) == 2


@pytest.mark.parametrize(("speeds", "half_range", "worst"), [
    ((0.04, 0.05), 300.0, 3.0), ((0.05, 0.06), 300.0, 10.0), ((0.05, 0.06), 1000.0, 5.0),
])  # fmt: skip
def test_theworst_force_counts_from_the_lowest_fitted_speed_on(speeds, half_range, worst, tmp_path):
    (tmp_path / "results").mkdir()
    one = {"speeds": speeds, "measured": [100.0, -200.0], "difference": [10.0, 6.0],
           "half_range": half_range}  # fmt: skip
    (tmp_path / "results" / "run.json").write_text(json.dumps({"speed_forces": [one]}))
    assert valve_bars.worst_force(tmp_path) == pytest.approx(worst)
