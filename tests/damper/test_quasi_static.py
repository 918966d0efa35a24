"""The force at constant speed against a second solver of the same valves, and its slopes."""

import numpy as np
import pytest

from damperfit.damper.mounting import FIT, Mounting
from damperfit.damper.network import Valve
from damperfit.damper.purdy.parameters import PURDY_DAMPER, reference_parameters
from damperfit.damper.quasi_static import quasi_static
from damperfit.damper.rivals import RIVALS, BoucWen, HagedornWallaschek
from damperfit.damper.temperature_law import WithTemperature
from damperfit.damper.valve_dampers import Monotube, ThroughFlow, TwinTube
from tests.damper.test_rivals import NUMBERS, values_of
from tests.laws.valve_logs import VALUES, damper
from tests.oracles.steady import purdy_force, steady_force

SPEEDS = np.array([0.005, 0.01, 0.025, 0.05, 0.13, 0.25, 1.0])
BOTH = np.concatenate([-SPEEDS, SPEEDS])
WITHIN = 0.003  # of the force without the gas
RIG = {"k_s": 1e6, "lag": 9e-3, "play": 5e-4}  # 1 N/um
CLICKS = [
    VALUES | RIG | {"rebound_bleed": bleed, "rebound_opening": opening}
    for bleed in (2.9e4, 7e4)
    for opening in (3.7e5, 9e5)
]


def near(found, expected, level):
    np.testing.assert_allclose(found - level, np.array(expected) - level, rtol=WITHIN, atol=0.02)


@pytest.mark.parametrize("setting", [1, 10, 20])
def test_the_papers_damper_has_the_force_of_its_valves(setting):
    y = reference_parameters(setting).replace(f_0=11.0)
    found = quasi_static(PURDY_DAMPER, y, BOTH)
    expected = [purdy_force(y, PURDY_DAMPER, v) for v in BOTH]
    near(found.forces, expected, found.rest)
    assert found.friction == pytest.approx(np.sign(BOTH) * y.f_f)
    assert found.is_cavitating.tolist() == [v >= 0.99 for v in BOTH]


@pytest.mark.parametrize("values", CLICKS)
@pytest.mark.parametrize("kind", [ThroughFlow, TwinTube, Monotube])
def test_a_valve_damper_on_a_rig_has_the_force_of_its_valves(kind, values):
    model = kind(gas_pressure=2e6, mounting=Mounting(FIT, FIT, FIT))
    values = {name: number for name, number in values.items() if name in model.names}
    known = model.values(values, drag=20.0)
    found = quasi_static(model, known, BOTH)
    numbers = dict(zip(known.names, known.numbers, strict=True))
    near(found.forces, [steady_force(model.network, numbers, model, v) for v in BOTH], found.rest)


def test_valves_of_every_kind_as_well():
    for bleed, blow_off in (("long", "rounded"), ("leak", "power"), ("none", "port")):
        valve = Valve(bleed, blow_off)
        model = TwinTube(rebound=valve, compression=valve)
        own = {"bleed": 4e4, "leak": 2e7, "opening": 4e5, "slope": 4e6, "port": 1e4}
        own |= {"width": 5e4, "power": 1.3}
        named = {name: own[name.split("_")[1]] for name in model.network.passage_numbers
                 if name != "return_slope"}  # fmt: skip
        known = model.values(named, k_e=1e9, f_f=20.0, k_s=1e6, f_0=0.0)
        numbers = dict(zip(known.names, known.numbers, strict=True))
        found = quasi_static(model, known, BOTH)
        expected = [steady_force(model.network, numbers, model, v) for v in BOTH]
        near(found.forces, expected, found.rest)


def test_parts_sum_up_and_the_tare_is_in_when_it_is_asked_for():
    y = reference_parameters(3).replace(f_0=11.0)
    bare = quasi_static(PURDY_DAMPER, y, BOTH, displacement=0.01)
    whole = quasi_static(PURDY_DAMPER, y, BOTH, displacement=0.01, with_tare=True)
    assert whole.forces - bare.forces == pytest.approx(np.full(len(BOTH), 11.0))
    assert whole.damping == pytest.approx(bare.damping)
    assert bare.rest == pytest.approx(float(PURDY_DAMPER.rest_force(0.01)))
    at_rest = quasi_static(PURDY_DAMPER, y, [0.0])
    assert at_rest.forces == pytest.approx([at_rest.rest])


def test_a_rival_without_gas_keeps_its_offset_and_loses_its_spring():
    model = HagedornWallaschek()
    y = model.values(NUMBERS[model.name])
    found = quasi_static(model, y, BOTH)
    v = np.abs(BOTH)
    c, q = np.where(BOTH > 0, y.c_r, y.c_b), np.where(BOTH > 0, y.q_r, y.q_b)
    expected = np.sign(BOTH) * (c * v + (q * v) ** 2 + y.f_f) + y.f_0
    assert found.forces == pytest.approx(expected, rel=1e-3, abs=0.01)
    assert (found.rest, found.knows_gas) == (y.f_0, False)


def test_a_hysteresis_has_turned():
    model = BoucWen()
    y = model.values(NUMBERS[model.name])
    slope = np.where(BOTH > 0, y.c_r, y.c_b)
    expected = slope * BOTH + y.alpha * np.sign(BOTH) + y.f_0
    assert quasi_static(model, y, BOTH).forces == pytest.approx(expected, rel=1e-3, abs=0.01)


def _cases():
    yield PURDY_DAMPER, reference_parameters(7)
    valves = damper()
    yield valves, valves.values(VALUES)
    temperature_law = WithTemperature(valves, 40.0, 55.0)
    yield temperature_law, temperature_law.values(VALUES, beta=0.02)
    for kind in RIVALS:
        yield kind(), values_of(kind())


@pytest.mark.parametrize(("model", "y"), list(_cases()), ids=lambda one: getattr(one, "name", ""))
def test_slopes_are_those_of_differences(model, y):
    at = np.array([-0.11, 0.013, 0.2])
    found = quasi_static(model, y, at, sensitivities=y.names)
    for name, row in zip(y.names, found.slopes, strict=True):
        quantity, value = y.quantity(name), getattr(y, name)
        step = 1e-4 if quantity.is_logarithmic else 1e-4 * quantity.size
        moved = [value * np.exp(s) if quantity.is_logarithmic else value + s for s in (step, -step)]
        up, down = (quasi_static(model, y.replace({name: one}), at).forces for one in moved)
        scale = np.abs(found.damping).max()
        assert row == pytest.approx((up - down) / (2.0 * step), rel=2e-3, abs=1e-4 * scale), name
