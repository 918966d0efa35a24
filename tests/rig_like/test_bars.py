"""Dampers like measured ones meet their bars; the command that says so can also say no."""

import numpy as np
import pytest

from damperfit.damper.model import MODELS
from damperfit.damper.mounting import FIT, NONE, Mounting
from damperfit.simulation import Motion, SolverOptions, simulate
from tests.identification.convergence import KINDS
from tests.rig_like import other_laws, valve_bars
from tests.rig_like.accuracy import BARS, measured
from tests.rig_like.bars import adjustable_bars, second_rig_bars
from tests.rig_like.moving_mass import errors, loaded_logs
from tests.rig_like.rig import FINE, LAYOUTS, Body, Valve, pulled, steps


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


# Dampers in laws of another form: drawn as the command says, and met by the law that is chosen.


@pytest.mark.slow
@pytest.mark.parametrize("seed", [4, 7])
def test_a_law_of_another_form_is_met_at_its_speed_and_a_fifth_of_it(seed, tmp_path) -> None:
    bars = other_laws.bars_of(other_laws.written(tmp_path, seed))
    assert not [bar.line for bar in bars if not bar.is_met]


# The command that says whether dampers of valves meet their bars can say no; three drawn ones.


@pytest.mark.slow
@pytest.mark.parametrize("place", range(3))
def test_dampers_drawn_by_chance_meet_their_bars(place, tmp_path):
    bars = valve_bars.bars_of(valve_bars.written(tmp_path / "own", place, seed=1))
    assert len(bars) == 6
    assert not [bar.line for bar in bars if not bar.is_met]


# A rod of 2 kg between load cell and damper bends what a fit finds, unless the fit knows of it.


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


# The rig of the synthetic logs and the core integrate the same dampers alike.

NUMBERS = {
    "rebound_bleed": 5e4, "rebound_opening": 8e5, "rebound_slope": 4e6, "compression_bleed": 6e4,
    "compression_opening": 5e5, "compression_slope": 3e6, "k_e": 1e9, "k_s": 5e5, "f_f": 20.0,
    "f_0": 0.0,
}  # fmt: skip


@pytest.mark.parametrize("play", [0.0, 5e-4], ids=["tight", "play"])
@pytest.mark.parametrize("layout", LAYOUTS)
def test_rig_and_core_agree_where_both_have_the_laws(layout: str, play: float) -> None:
    pressure = 2.5e6 if layout == "monotube" else 6e5
    body = Body(
        layout,
        Valve(bleed=5e4, opening=8e5, slope=4e6),
        Valve(bleed=6e4, opening=5e5, slope=3e6),
        rod=0.0115, piston=0.028, length=0.085, gas_pressure=pressure, gas_volume=3e-5, play=play,
    )  # fmt: skip
    x, v = steps((0.2,), 0.01, 0.7)
    model = MODELS[layout](
        rod_diameter=body.rod, piston_diameter=body.piston, chamber_1_length=body.length,
        chamber_2_length=body.length, gas_pressure=pressure, gas_volume=body.gas_volume,
        mounting=Mounting(FIT, FIT if play else NONE),
    )  # fmt: skip
    motion = Motion(10 * FINE, x[::10].copy(), v[::10].copy())
    values = model.values(NUMBERS | ({"play": play} if play else {}))
    force = simulate(values, model, motion, options=SolverOptions(tolerance=1e-4)).force
    pull = pulled(body, x, v)[0][::10]
    moving = slice(350, None)  # the rod's mass rings while it comes to rest
    # A rod of 50 g and a bristle of 2 um are the rig's alone.
    assert float(np.std((force - pull)[moving])) < 2e-3 * float(np.std(pull[moving]))
