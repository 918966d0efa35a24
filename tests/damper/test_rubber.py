"""A mounting of rubber: a force that it holds whichever way it was bent last."""

from dataclasses import replace

import numpy as np
import pytest

from damperfit.damper.mounting import FIT, NONE, Friction, Mounting
from damperfit.damper.network import Valve
from damperfit.damper.valve_dampers import ThroughFlow
from damperfit.errors import ConfigurationError
from damperfit.simulation import Motion, SolverOptions
from tests.rig_like import rig

RUBBER = {"k_s": 1.6e5, "rubber": 60.0, "rubber_bend": 4e-4}
BODY = rig.Body(
    "through_flow",
    rig.Valve(bleed=6.4e4, opening=2.3e5, slope=2e6),
    rig.Valve(bleed=5e4, opening=2e5, slope=1.8e6),
    stiffness=RUBBER["k_s"], rubber=RUBBER["rubber"], rubber_bend=RUBBER["rubber_bend"],
    mass=0.01, friction=20.0, presliding=2e-5,
)  # fmt: skip
NUMBERS = {
    "rebound_bleed": 6.4e4, "rebound_opening": 2.3e5, "rebound_slope": 2e6,
    "compression_bleed": 5e4, "compression_opening": 2e5, "compression_slope": 1.8e6,
    "return_slope": 2.5e5, "k_e": 1e9, "free_gas": 0.0, "f_f": 20.0, "drag": 0.0, "f_0": 0.0,
    "presliding": 2e-5, "gas_pressure": BODY.gas_pressure, "gas_volume": BODY.gas_volume,
    "gas_exponent": BODY.gas_exponent, **RUBBER,
}  # fmt: skip


def damper(friction=Friction(presliding=FIT)):
    own = ("gas_pressure", "gas_volume", "gas_exponent")
    return ThroughFlow(
        BODY.rod, BODY.piston, BODY.length, BODY.length, BODY.density,
        **{name: NUMBERS[name] for name in own}, rebound=Valve(), compression=Valve(),
        mounting=Mounting(FIT, rubber=FIT, rubber_bend=FIT), friction=friction,
    )  # fmt: skip


def simulated(model, motion, sensitivities=(), **changed):
    known = NUMBERS | changed
    values = model.values({name: known[name] for name in model.names})
    options = SolverOptions(tolerance=1e-4)
    return model.simulate(values, motion, sensitivities=sensitivities, options=options)


def test_it_pulls_as_an_integrator_of_its_own_has_it() -> None:
    x, v = rig.crank(1.05, 0.0187, 2.2)
    exact = rig.pulled(BODY, x, v)[0][::10]
    force = simulated(damper(), Motion(1e-3, x[::10], v[::10])).force
    without = simulated(damper(), Motion(1e-3, x[::10], v[::10]), rubber=0.0).force
    assert np.std(force - exact) < 0.01 * np.std(exact)
    assert np.std(without - exact) > 0.03 * np.std(exact)


@pytest.mark.parametrize("friction", [Friction(), Friction(presliding=FIT)])
def test_slopes_are_those_of_differences(friction: Friction) -> None:
    x, v = rig.crank(1.05, 0.0187, 1.2)
    model, motion = damper(friction), Motion(1e-3, x[::10], v[::10])
    names = ("rubber", "rubber_bend", "k_s", "f_f", "rebound_opening", "k_e")
    found = simulated(model, motion, names).sensitivities
    for name in names:
        step = 1e-5 * NUMBERS[name]
        ends = [simulated(model, motion, **{name: NUMBERS[name] + s}).force for s in (step, -step)]
        away = np.abs((ends[0] - ends[1]) / (2 * step) - found[name])
        # Beside corners of friction and valves a difference of steps is none.
        assert np.median(away) < 1e-5 * np.std(found[name]), name


@pytest.mark.parametrize(
    "wrong", [{"rubber": 60.0}, {"rubber_bend": FIT}, {"series_stiffness": NONE, "rubber": FIT}]
)
def test_half_of_it_is_refused(wrong: dict[str, object]) -> None:
    with pytest.raises(ConfigurationError, match="rubber"):
        replace(Mounting(FIT), **wrong)
