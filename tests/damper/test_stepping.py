"""A damper stepped from outside is the damper that is simulated."""

from __future__ import annotations

import numpy as np
import pytest

from damperfit.damper.mounting import FIT, NONE, Mounting
from damperfit.damper.network import Valve
from damperfit.damper.purdy.parameters import PURDY_DAMPER
from damperfit.damper.purdy.reference import reference_parameters
from damperfit.damper.rivals import Bilinear
from damperfit.damper.stepping import SteppedDamper
from damperfit.damper.valve_dampers import TwinTube
from damperfit.errors import ConfigurationError, SimulationError
from damperfit.simulation import Motion, SolverOptions

VALVE = Valve("orifice", "linear")
TWIN_TUBE = TwinTube(rebound=VALVE, compression=VALVE, mounting=Mounting(FIT, lag=FIT))
ELASTIC = TwinTube(rebound=VALVE, compression=VALVE, mounting=Mounting(FIT))
ON_A_RIG = {
    "rebound_bleed": 8e4, "rebound_opening": 3e5, "rebound_slope": 4e6, "compression_bleed": 6e4,
    "compression_opening": 2e5, "compression_slope": 3e6, "k_e": 9e8, "f_f": 20.0, "f_0": 11.0,
    "k_s": 4e5, "lag": 9e-3,
}  # fmt: skip
STEP = 1e-3


def motion() -> Motion:
    """A sine that begins slowly."""
    time = np.arange(700) * STEP
    x = 0.02 * np.sin(4.0 * np.pi * time) * np.minimum(1.0, time / 0.3) ** 2
    v = np.gradient(x, STEP)
    v[0] = 0.0
    return Motion(STEP, x, v)


def stepped(damper: SteppedDamper, driven: Motion, first: int = 1) -> list[float]:
    pairs = zip(driven.displacement[first:], driven.velocity[first:], strict=True)
    return [damper.step(x, v, STEP) for x, v in pairs]


@pytest.mark.parametrize(
    ("model", "values"),
    [
        (PURDY_DAMPER, reference_parameters(10)),
        (ELASTIC, ELASTIC.values({k: v for k, v in ON_A_RIG.items() if k != "lag"})),
    ],
)
def test_step_by_step_is_at_once(model, values) -> None:
    driven = motion()
    whole = model.simulate(values, driven, sensitivities=(), options=SolverOptions())
    damper = SteppedDamper(model, values, with_rig=True)
    assert damper.force == pytest.approx(whole.force[0], abs=1e-9)
    assert (
        np.abs(stepped(damper, driven) - whole.force[1:]).max() < 1.0 * (model is TWIN_TUBE) + 1e-9
    )
    assert damper.pressures == pytest.approx(whole.pressures[:, -1])


def test_by_default_it_is_the_damper_alone() -> None:
    bare = TwinTube(rebound=VALVE, compression=VALVE, mounting=Mounting(NONE))
    known = {name: value for name, value in (ON_A_RIG | {"f_0": 0.0}).items() if name in bare.names}
    driven = motion()
    whole = bare.simulate(bare.values(known), driven, sensitivities=(), options=SolverOptions())
    found = stepped(SteppedDamper(TWIN_TUBE, TWIN_TUBE.values(ON_A_RIG)), driven)
    assert found == pytest.approx(whole.force[1:], abs=1e-9)


def test_a_copy_goes_back_to_where_it_was() -> None:
    driven = motion()
    damper = SteppedDamper(PURDY_DAMPER, reference_parameters(5))
    stepped(damper, driven.until(0, 300))
    kept = damper.copy()
    assert stepped(damper, driven, 300) == stepped(kept, driven, 300)


def test_a_step_that_is_refused_leaves_the_state_as_it_was() -> None:
    driven = motion()
    damper = SteppedDamper(PURDY_DAMPER, reference_parameters(5))
    stepped(damper, driven.until(0, 300))
    kept = damper.copy()
    for x, dt in ((1.0, STEP), (0.02, 1e3), (0.02, -STEP), (float("nan"), STEP)):
        with pytest.raises(SimulationError):
            damper.step(x, 0.1, dt)
    assert stepped(damper, driven, 300) == stepped(kept, driven, 300)


def test_a_model_without_chambers_is_refused() -> None:
    with pytest.raises(ConfigurationError, match="no chambers"):
        SteppedDamper(Bilinear(), Bilinear().values(dict.fromkeys(Bilinear().names, 1.0)))
