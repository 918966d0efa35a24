"""Dampers of real valves as models: their quantities, their mounting, where their fits start."""

import dataclasses
import math
import tomllib
from dataclasses import replace

import numpy as np
import pytest

from damperfit.configuration.loading import configuration_toml, load_configuration
from damperfit.damper.mounting import Mounting
from damperfit.damper.network import Valve, law_flow, simulate_network
from damperfit.damper.purdy.parameters import PURDY_DAMPER
from damperfit.damper.valve_dampers import (
    DeclaredNetwork,
    DeclaredPassage,
    Monotube,
    ThroughFlow,
    TwinTube,
    declared_passages,
)
from damperfit.errors import ConfigurationError
from damperfit.identification import FitOptions, identify
from damperfit.recording import Drive, FilterDesign, Segment, Trace
from damperfit.simulation import SolverOptions, simulate, sine_motion

ALL = Mounting("fit", "fit", "fit", "fit")
VALVES = {
    "rebound_bleed": 5e4, "rebound_opening": 4.5e5, "rebound_slope": 5e6,
    "compression_bleed": 4e4, "compression_opening": 3.6e5, "compression_slope": 4e6,
    "f_f": 20.0, "f_0": -12.0,
}  # fmt: skip
HELD = {"k_s": 4e5, "play": 4e-4, "lag": 6e-3, "moving_mass": 0.8}
LAYOUTS = pytest.mark.parametrize("kind", [TwinTube, Monotube, ThroughFlow])


def damper(kind, mounting=Mounting()):
    """A monotube needs the pressure that keeps its rod side full in bump."""
    pressure = 2.5e6 if kind is Monotube else 5e5
    return kind(gas_pressure=pressure, mounting=mounting)


def motion(speed=0.26, cycles=3):
    return sine_motion(0.02, speed / (2 * np.pi * 0.02), cycles=cycles, sample_rate=1000)


def log(model, values, *, speed=0.26):
    """A log without a filter: the third of three cycles is compared."""
    driven = motion(speed)
    force = simulate(values, model, driven).force
    n, a_cycle = len(force), len(force) // 3
    segment = Segment(
        kind="steady", first=2 * a_cycle, stop=n, cycle_starts=np.array([2.0 * a_cycle, n - 1.0]),
        frequency=1000 / a_cycle, amplitude=0.02, peak_speed=speed,
    )  # fmt: skip
    return Trace(
        name="log", setting=1, start_time=0.0, interval=1e-3, displacement=driven.displacement,
        velocity=driven.velocity, force=force,
        drive=Drive(driven.displacement, driven.velocity, math.inf), segments=(segment,),
        centre=0.0, n_cycles_found=3,
        model_filter=FilterDesign(np.empty((0, 6)), is_zero_phase=False, description="none"),
    )  # fmt: skip


@LAYOUTS
def test_without_a_lag_it_is_the_network_and_with_it_the_force_is_late(kind):
    model = damper(kind, Mounting("fit", "fit", "fit"))
    numbers = {**VALVES, **HELD, "return_slope": 2e5, "k_e": 9e8}
    values = model.values({one: numbers[one] for one in numbers if one in model.names})
    core = {one: number for one, number in numbers.items() if one in model.network.numbers}
    core |= {"k_s": 4e5, "play": 4e-4}
    bare = simulate_network(model.network, core, model, motion()).force
    late = simulate(values, model, motion()).force
    crossings = [np.flatnonzero(np.diff(np.signbit(one[1000:])))[0] for one in (bare, late)]
    assert 6 <= crossings[1] - crossings[0] <= 10
    on_time = dataclasses.replace(model, mounting=Mounting("fit", "fit"))
    same = on_time.values({one: getattr(values, one) for one in on_time.names})
    np.testing.assert_array_equal(simulate(same, on_time, motion()).force, bare)


# A valve's characteristic, read off loops, lies on the law that made them and off a wrong one.


def misses(one) -> np.ndarray:
    """Measured less law, as shares of the largest flow, where the valve is open."""
    law = np.interp(one.drop, one.law_drop, one.law_flow)
    return ((one.flow - law) / one.law_flow[-1])[one.drop > 0.3 * one.drop.max()]


def truth(model, **more):
    numbers = {**VALVES, "return_slope": 2e5, "k_e": 9e8, "k_s": 4e5}
    if model.name == "twin_tube":  # the rod is small: its valve makes as much force as the piston's
        numbers |= {
            "compression_bleed": 8e4, "compression_opening": 1.5e6, "compression_slope": 2e7,
        }  # fmt: skip
    numbers |= more
    return model.values({name: numbers[name] for name in numbers if name in model.names})


@LAYOUTS
def test_what_the_loops_show_lies_on_the_law_that_made_them(kind) -> None:
    model = damper(kind, Mounting("fit", "none", "fit"))
    values = truth(model, lag=6e-3, drag=20.0)
    found = model.valve_characteristics(values, [log(model, values)])
    assert [one.stroke for one in found] == ["rebound", "bump"]
    for one, area in zip(found, model.pressed_areas, strict=True):
        # The base valve is read through the piston's return, by the small area of the rod.
        limit = 0.03 if (kind, one.stroke) == (TwinTube, "bump") else 0.01
        assert np.median(np.abs(misses(one))) < limit
        assert np.percentile(np.abs(misses(one)), 90) < 0.03
        stroke = "compression" if one.stroke == "bump" else one.stroke
        assert one.opening == getattr(values, f"{stroke}_opening")
        assert one.area == area
        assert one.opening in one.law_drop


@pytest.mark.parametrize("bleed", ["none", "orifice", "leak", "long"])
@pytest.mark.parametrize("blow_off", ["none", "linear", "port", "rounded", "power"])
def test_the_law_is_that_of_the_core(bleed, blow_off) -> None:
    """A stiff monotube: the flow through its piston valve is what the rod side loses."""
    if bleed == blow_off == "none":
        return
    valve = Valve(bleed, blow_off)
    model = Monotube(rebound=valve, gas_pressure=2.5e6, mounting=Mounting("none"))
    own = {
        "bleed": 5e4, "leak": 2e6, "opening": 4.5e5, "slope": 5e6, "port": 6e4, "width": 3e5,
        "power": 1.3,
    }  # fmt: skip
    numbers = {f"rebound_{part}": value for part, value in own.items()} | VALVES | {"k_e": 5e10}
    values = model.values({name: numbers[name] for name in numbers if name in model.names})
    motion = sine_motion(0.02, 1.5, cycles=2, sample_rate=2000)
    known = dict(zip(values.names, values.numbers, strict=True))
    response = simulate_network(model.network, known, model, motion)
    drop = response.pressures[0] - response.pressures[1]
    is_late = response.time > 0.4  # the second cycle, without the start
    fastest = np.flatnonzero(is_late & (response.velocity > 0.9 * response.velocity.max()))
    parts = {name.removeprefix("rebound_"): known[name] for name in known if "rebound" in name}
    flow = law_flow(parts, drop[fastest], model.oil_density)
    assert flow == pytest.approx(model.annulus_area * response.velocity[fastest], rel=5e-3)


def test_a_valve_that_no_log_presses_is_left_out() -> None:
    model = damper(ThroughFlow)
    values = truth(model)
    made = log(model, values)
    # The load cell reads a pull throughout: nothing presses the valve of compression.
    pulled = replace(made, force=np.abs(made.force) + 50.0)
    (only,) = model.valve_characteristics(values, [pulled])
    assert only.stroke == "rebound"


# Passages one by one: spelled out, a preset is itself; what is no passage is refused.

P = DeclaredPassage
WAYS = {TwinTube: ((1, 2), (2, 3)), ThroughFlow: ((1, 3), (2, 3)), Monotube: ((1, 2), (2, 1))}


def both(kind, mounting=ALL):
    """A preset, and the same spelled out."""
    floats, passages = kind is Monotube, []
    for stroke, (start, end) in zip(("rebound", "compression"), WAYS[kind], strict=True):
        passages.append(P(start, end, stroke, "orifice", is_two_way=not floats))
        passages.append(P(start, end, stroke, "linear"))
        passages += [] if floats else [P(end, start, "return", "check")]
    shared = {"gas_pressure": 2.5e6 if floats else 5e5, "mounting": mounting}
    spelled = DeclaredNetwork(**shared, passages=tuple(passages), floating_piston=floats)
    return kind(**shared), spelled


@LAYOUTS
def test_a_preset_spelled_out_has_its_quantities_its_force_and_its_slopes(kind):
    preset, spelled = both(kind)
    assert spelled.quantities == preset.quantities
    values = preset.values({**VALVES, **HELD})
    wanted = preset.names
    one = simulate(values, preset, motion(), sensitivities=wanted)
    other = simulate(values, spelled, motion(), sensitivities=wanted)
    assert np.array_equal(one.force, other.force)
    for number in wanted:
        assert np.array_equal(one.sensitivities[number], other.sensitivities[number])
    assert spelled.pressed_areas == preset.pressed_areas
    assert spelled.rest_force(0.01) == preset.rest_force(0.01)


def test_a_damper_that_is_no_preset_is_fitted():
    """A piston valve with two stacks in rebound, a leak about it, and a base valve with a port."""
    passages = (
        P(1, 2, "piston", "orifice", is_two_way=True), P(1, 2, "low", "linear"),
        P(2, 1, "intake", "check"), P(1, 2, "ring", "leak", is_two_way=True),
        P(2, 3, "base", "orifice", is_two_way=True), P(2, 3, "base", "port"),
        P(3, 2, "foot", "check"),
    )  # fmt: skip
    model = DeclaredNetwork(gas_pressure=5e5, passages=passages)
    truth = model.values(
        piston_bleed=9e4, low_opening=4e5, low_slope=6e6, intake_slope=3e5, ring_leak=3e7,
        base_bleed=6e4, base_opening=9e5, base_slope=9e6, base_port=4e4, foot_slope=2e5,
        k_s=4e5, f_f=15.0, f_0=0.0,
    )  # fmt: skip
    made = log(model, truth)
    (start, *_) = model.start([made], {})
    assert np.isfinite(simulate(start, model, motion(cycles=1)).force).all()
    (fit,) = identify([made], model, FitOptions("plain", solver=SolverOptions(tolerance=1e-2))).fits
    assert fit.mse_percent < 0.01
    assert "1 to 2 and back piston (orifice), 1 to 2 low (linear)" in model.sentence
    assert model.valve_characteristics(truth, [made]) == ()
    words = "rod 12 mm, piston 30 mm, chambers 90 and 90 mm, gas 30 cm3 at 5 bar absolute"
    assert words in Monotube(gas_pressure=5e5).sentence
    words = "rod 19 mm, piston 28.5 mm, gas piston 40 mm, chambers 133 and 99 mm, gas 50 mm at 4.6"
    assert words in replace(PURDY_DAMPER, chamber_2_length=0.099).sentence


PASSAGES = [
    {"from": 1, "to": 3, "name": "needle", "law": "long", "two_way": True},
    {"from": 3, "to": 1, "name": "foot", "law": "check", "two_way": False},
    {"from": 2, "to": 3, "name": "base", "law": "rounded", "two_way": False},
    {"from": 3, "to": 2, "name": "foot", "law": "check", "two_way": False},
]


def test_toml_declares_it_and_config_prints_it_back(tmp_path):
    own = {"model": "network", "gas_pressure": "5bara", "passages": PASSAGES}
    made = load_configuration(overlay={"damper": own | {"mounting": {"series_stiffness": "none"}}})
    assert made.damper.names[:6] == (
        "needle_leak", "needle_bleed", "foot_slope", "base_opening", "base_slope", "base_width",
    )  # fmt: skip
    assert made.damper.passages[0] == P(1, 3, "needle", "long", is_two_way=True)
    again = tmp_path / "again.toml"
    again.write_text(configuration_toml(made))
    assert load_configuration(again).damper == made.damper
    assert tomllib.loads(again.read_text())["damper"]["passages"] == PASSAGES
    plain = load_configuration(overlay={"damper": {"model": "network"}})
    assert "rebound" not in plain.document["damper"]


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"from": 4}, r"passage 2: from = 4; expected chamber 1 \(rod side\)"),
        ({"to": True}, "passage 2: to = True; expected chamber"),
        ({"to": 1}, "passage 2: leads from chamber 1 to itself"),
        ({"law": "orifise"}, "passage 2: no law 'orifise'; .* Did you mean 'orifice'"),
        ({"name": "Base valve"}, "passage 2: name = 'Base valve'; expected small letters"),
        ({"two_way": 1}, "passage 2: two_way = 1; expected true or false"),
        ({"twoway": True}, "passage 2: no key 'twoway'; .* Did you mean 'two_way'"),
    ],
)
def test_what_is_no_passage_is_refused_with_its_place(changed, said):
    good = {"from": 1, "to": 2, "name": "one", "law": "orifice"}
    with pytest.raises(ConfigurationError, match=said):
        declared_passages([good, good | changed])
    with pytest.raises(ConfigurationError, match="passage 1: lacks to, law"):
        declared_passages([{"from": 1, "name": "one"}])


def test_a_layout_that_cannot_be_is_refused():
    with pytest.raises(ConfigurationError, match="passage 2 joins 2 and 3, which are one behind"):
        DeclaredNetwork(passages=(P(1, 2, "a", "leak"), P(2, 3, "b", "leak")), floating_piston=True)
    with pytest.raises(ConfigurationError, match="none leads to or from chamber 1"):
        DeclaredNetwork(passages=(P(2, 3, "a", "leak"),))
    many = tuple(P(1, 2, "a", "leak") for _ in range(17))
    with pytest.raises(ConfigurationError, match="17 passages"):
        DeclaredNetwork(passages=many)
