"""Triangles whose speeds are all above the knee: friction and preload make one level of force."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from damperfit.conditioning import condition
from damperfit.damper.model import MODELS
from damperfit.damper.mounting import FIT, Mounting
from damperfit.identification import Fit, FitOptions, identify
from damperfit.io import read_log
from tests.rig_like.dampers import text_of
from tests.rig_like.rig import FINE, Body, Channels, Valve, logged

FRICTION, OPENINGS = 18.0, {"rebound_opening": 3.0e5, "compression_opening": 2.6e5}
BODY = Body(
    "through_flow",
    Valve(bleed=3.6e4, opening=OPENINGS["rebound_opening"], slope=4.5e6),
    Valve(bleed=3.15e4, opening=OPENINGS["compression_opening"], slope=4e6),
    length=0.08, gas_pressure=6e5, gas_volume=2.5e-5, stiffness=4.5e5, friction=FRICTION,
)  # fmt: skip
MODEL = MODELS["through_flow"](
    rod_diameter=BODY.rod, piston_diameter=BODY.piston, chamber_1_length=BODY.length,
    chamber_2_length=BODY.length, gas_pressure=BODY.gas_pressure, gas_volume=BODY.gas_volume,
    mounting=Mounting(FIT),
)  # fmt: skip


def triangle(speed: float, cycles: int, half: float = 0.02) -> tuple[np.ndarray, np.ndarray]:
    """Displacement and velocity between rests, with corners rounded twice over 4 ms."""
    quarter = round(half / speed / FINE)
    one = np.repeat([speed, -speed, speed], [quarter, 2 * quarter, quarter])
    rests = np.zeros(round(0.4 / FINE)), np.zeros(round(0.5 / FINE))
    v = np.concatenate([rests[0], np.tile(one, cycles), rests[1]])
    n = round(0.004 / FINE) // 2 * 2 + 1
    for _ in range(2):
        v = np.convolve(np.pad(v, n // 2, "edge"), np.ones(n) / n, "valid")
    return np.concatenate([[0.0], np.cumsum(0.5 * (v[1:] + v[:-1]))]) * FINE, v


ABOVE = (triangle(0.05, 4), triangle(0.13, 5), triangle(0.26, 6))
BELOW = triangle(0.02, 3, 0.01)


def fitted(motions: tuple[tuple[np.ndarray, np.ndarray], ...], folder: Path) -> Fit:
    channels = Channels(rate=1000.0, noise=3.0, jitter=6e-6)
    traces = []
    for k, motion in enumerate(motions):
        path = folder / f"setting_02_{k}.csv"
        path.write_text(text_of(logged(BODY, motion, channels, 1000 + k), "2"), encoding="utf-8")
        traces.append(condition(replace(read_log(path), setting=2)))
    (fit,) = identify(traces, MODEL, FitOptions("plain")).fits
    return fit


@pytest.mark.slow
def test_three_speeds_above_the_knee_do_not_determine_two_valves_and_a_fourth_does(
    tmp_path: Path,
) -> None:
    """Below 5 N of friction was found for 18, and openings 10 to 15 % off, without a word."""
    three = fitted(ABOVE, tmp_path)
    assert any("the logs hold 3 speeds" in str(one) for one in three.warnings)
    assert three.mse_percent < 0.002
    assert three.parameters.f_f < 5.0
    four = fitted((*ABOVE, BELOW), tmp_path)
    assert not any("speeds" in str(one) for one in four.warnings)
    assert four.parameters.f_f == pytest.approx(FRICTION, rel=0.15)
    for name, true in OPENINGS.items():
        assert getattr(three.parameters, name) > 1.08 * true, name
        assert getattr(four.parameters, name) == pytest.approx(true, rel=0.02), name
