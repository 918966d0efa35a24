"""The rig of the synthetic logs and the core integrate the same dampers alike."""

import numpy as np
import pytest

from damperfit.damper.model import MODELS
from damperfit.damper.mounting import FIT, NONE, Mounting
from damperfit.simulation import Motion, SolverOptions, simulate
from tests.rig_like.rig import FINE, LAYOUTS, Body, Valve, pulled, steps

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
