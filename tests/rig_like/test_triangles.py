"""Triangles whose speeds are all above the knee: friction and preload make one level of force."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from damperfit.conditioning import condition
from damperfit.damper.models import MODELS
from damperfit.damper.mounting import FIT, Mounting
from damperfit.identification import FitOptions, identify
from damperfit.readers import read_log
from damperfit.uncertainty import assess
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


def triangle(speed: float, cycles: int, rounded: float) -> tuple[np.ndarray, np.ndarray]:
    """Displacement and velocity, +-20 mm between rests, with corners rounded twice over a time."""
    quarter = round(0.02 / speed / FINE)
    one = np.repeat([speed, -speed, speed], [quarter, 2 * quarter, quarter])
    rests = np.zeros(round(0.4 / FINE)), np.zeros(round(0.5 / FINE))
    v = np.concatenate([rests[0], np.tile(one, cycles), rests[1]])
    n = round(rounded / FINE) // 2 * 2 + 1
    for _ in range(2):
        v = np.convolve(np.pad(v, n // 2, "edge"), np.ones(n) / n, "valid")
    return np.concatenate([[0.0], np.cumsum(0.5 * (v[1:] + v[:-1]))]) * FINE, v


@pytest.mark.parametrize("rounded", [0.004, pytest.param(0.008, marks=pytest.mark.slow)])
def test_corners_that_no_sensor_tells_decide_nothing(rounded: float, tmp_path: Path) -> None:
    """The friction was told as below 5 N for 18, the openings 10 to 15 % off and excellent."""
    channels = Channels(rate=1000.0, noise=3.0, jitter=6e-6)
    traces = []
    for k, (speed, cycles) in enumerate([(0.05, 4), (0.13, 5), (0.26, 6)]):
        log = logged(BODY, triangle(speed, cycles, rounded), channels, 1000 + k)
        path = tmp_path / f"setting_02_{k}.csv"
        path.write_text(text_of(log, "2"), encoding="utf-8")
        traces.append(condition(replace(read_log(path), setting=2)))
    found = identify(traces, MODEL, FitOptions("plain"))
    (errors,) = assess(found, MODEL).uncertainties
    truth = {"f_f": FRICTION, **OPENINGS}
    for name, true in truth.items():
        one = errors.intervals[name]
        assert one.low < true < one.high, name
        assert one.high > 1.1 * one.low, name
