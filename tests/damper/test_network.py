"""Any passages between the chambers: golden values, the slow twin, sensitivities, limits, laws."""

import dataclasses
import math

import numpy as np
import pytest

from damperfit.configuration.loading import load_configuration
from damperfit.damper.mounting import Friction
from damperfit.damper.network import Network, Passage, Valve, simulate_network
from damperfit.damper.purdy.parameters import PURDY_DAMPER, Damper
from damperfit.damper.valve_dampers import Monotube, ThroughFlow, TwinTube
from damperfit.errors import ConfigurationError, SimulationError
from damperfit.simulation import Motion, SolverOptions, sine_motion
from tests.oracles import network as twin

GAS_PISTON = math.sqrt(15e-6 / 0.05 * 4 / math.pi)
SMALL = Damper(0.0089, 0.025, GAS_PISTON, 0.06, 0.06, 0.05, 850.0, 7.9e5)
STANDARD = {"k_e": 4.54e8, "f_f": 50.0}
LONG = Valve("long", "rounded")
# The paper's layout with a blow-off beside valve 1 and a preload on valve 2.
PURDY_BLOW_OFF = Network(
    "purdy_blow_off",
    (
        Passage(1, 3, orifice="r_m1", is_two_way=True),
        Passage(1, 3, opening="rebound_opening", resistance="rebound_slope"),
        Passage(2, 1, opening="compression_opening", resistance="r_m2"),
        Passage(3, 2, resistance="r_m3"),
    ),
)


def layout(kind=ThroughFlow, valve=Valve()):
    """The passages of a preset without air."""
    return kind(rebound=valve, compression=valve, ambient_pressure=0.0).network


# name: network, numbers, damper, amplitude, frequency
CASES = {
    "a": (
        PURDY_BLOW_OFF,
        STANDARD
        | {"r_m1": 3e4, "rebound_opening": 2e6, "rebound_slope": 1e7}
        | {"compression_opening": 5e5, "r_m2": 4e6, "r_m3": 2.597e6},
        PURDY_DAMPER,
        (0.032, 1.5),
    ),
    "b": (
        layout(),
        {"k_e": 5e7, "f_f": 15.0, "return_slope": 2e5}
        | {"rebound_bleed": 1.9e5, "rebound_opening": 5.5e5, "rebound_slope": 3.5e6}
        | {"compression_bleed": 1.3e5, "compression_opening": 5e5, "compression_slope": 2.5e6},
        SMALL,
        (0.0187, 1.05),
    ),
    "c": (
        layout(valve=LONG),
        {"k_e": 1e9, "f_f": 15.0, "free_gas": 0.005, "return_slope": 2e5}
        | {"rebound_bleed": 1e4, "rebound_leak": 4e6, "rebound_opening": 2.4e5}
        | {"rebound_slope": 3e6, "rebound_width": 2e4, "compression_bleed": 1.2e4}
        | {"compression_leak": 1e6, "compression_opening": 2.2e5, "compression_slope": 3e6}
        | {"compression_width": 2e4},
        SMALL,
        (0.0187, 1.05),
    ),
    "d": (
        layout(TwinTube),
        STANDARD
        | {"rebound_bleed": 3e4, "rebound_opening": 2e6, "rebound_slope": 4e6}
        | {"compression_bleed": 3e4, "compression_opening": 1e6, "compression_slope": 6e6}
        | {"return_slope": 4e5},
        PURDY_DAMPER,
        (0.032, 1.5),
    ),
    "e": (
        layout(Monotube),
        STANDARD
        | {"rebound_bleed": 2.5e4, "rebound_opening": 2e6, "rebound_slope": 4e6}
        | {"compression_bleed": 5e4, "compression_opening": 4e5, "compression_slope": 2e6},
        dataclasses.replace(PURDY_DAMPER, gas_pressure=2e6),
        (0.032, 1.5),
    ),
    # By a power of the flow: a stack that stiffens, and one that gives way with all else in bump.
    "f": (
        Network(
            "by a power",
            (
                *Valve("orifice", "power").passages(1, 3, "rebound"),
                Passage(3, 1, resistance="return_slope"),
                Passage(2, 3, orifice="compression_bleed", is_two_way=True),
                Passage.of_parts(
                    2, 3, "compression", ("opening", "slope", "port", "width", "power")
                ),
                Passage(3, 2, resistance="return_slope"),
            ),
        ),
        {"k_e": 5e8, "f_f": 15.0, "return_slope": 2e5}
        | {"rebound_bleed": 1.9e5, "rebound_opening": 2.5e5, "rebound_slope": 7e6}
        | {"rebound_power": 1.4, "compression_bleed": 1.3e5, "compression_opening": 2e5}
        | {"compression_slope": 5e6, "compression_port": 3e4, "compression_width": 3e4}
        | {"compression_power": 0.7},
        SMALL,
        (0.0187, 1.05),
    ),
}  # fmt: skip
FRICTION = ("presliding", "breakaway", "stribeck_speed", "seal_area", "turning_speed")
RUBBER = ("rubber", "rubber_bend")
ABSENT = {"free_gas", "k_s", "play", "drag", *FRICTION, *RUBBER}
SHARP = SolverOptions(tolerance=1e-3, rounding=1.0, max_steps_per_sample=100_000)
SMOOTH = SolverOptions(tolerance=1e-7, rounding=100.0, max_steps_per_sample=100_000)


def run(name, *, per_cycle=1000, cycles=4, options=SHARP, sensitivities=(), **changed):
    network, values, damper, (amplitude, frequency) = CASES[name]
    rate = per_cycle * frequency * (1 + 1e-12)
    motion = sine_motion(amplitude, frequency, cycles=cycles, sample_rate=rate)
    how = {"sensitivities": sensitivities, "options": options}
    return simulate_network(network, values | changed, damper, motion, **how)


MOUNTINGS = {"rigid": (0.0, 0.0, 0.0), "elastic": (2e6, 0.0, 60.0), "play": (3e5, 7e-4, 60.0)}
# The golden values hold every case; these hold the motion and the mounting.
BY_THE_TWIN = {("e", "rigid"), ("f", "rigid"), ("b", "elastic"), ("b", "play")}


def resting(name):
    """Numbers that a case does not name: its gas, and nothing of all that may be absent."""
    damper = CASES[name][2]
    gas = {key: getattr(damper, key) for key in ("gas_pressure", "gas_exponent", "gas_volume")}
    return dict.fromkeys((*ABSENT, "f_0"), 0.0) | gas


def check_by_the_twin(name, mounting, **more):
    """Hold force and gas pressure on a rough motion to those of the slow twin."""
    network, values, damper, (amplitude, frequency) = CASES[name]
    network = dataclasses.replace(network, ambient_pressure=101325.0)
    values = resting(name) | values | mounting | more
    w = 2 * math.pi * frequency

    def x(t):
        return amplitude * (0.6 * math.sin(w * t) + 0.25 * math.sin(5.3 * w * t))

    def v(t):
        return amplitude * w * (0.6 * math.cos(w * t) + 0.25 * 5.3 * math.cos(5.3 * w * t))

    time = np.arange(211) / (500 * frequency)
    motion = Motion(float(time[1]), np.array([x(t) for t in time]), np.array([v(t) for t in time]))
    options = dataclasses.replace(SHARP, tolerance=1e-4)
    response = simulate_network(network, values, damper, motion, options=options)
    force, pressures = twin.solve(network, values, damper, (x, v), time)
    # Behind a mounting the two start with the piston elsewhere, which a reversal makes forget.
    seen = slice(150 if mounting["k_s"] else 0, None)
    gap = np.abs(response.force - force)[seen]
    assert np.max(gap) < 0.05
    assert np.sqrt(np.mean(gap**2)) < 0.005
    assert np.max(np.abs(response.pressures[2] - pressures[2])[seen]) < 2.0


@pytest.mark.parametrize(
    ("name", "mounting"),
    [
        pytest.param(
            name, dict(zip(("k_s", "play", "drag"), way, strict=True)), id=f"{kind}-{name}",
            marks=[] if (name, kind) in BY_THE_TWIN else pytest.mark.slow,
        )
        for kind, way in MOUNTINGS.items()
        for name in CASES
    ],
)  # fmt: skip
def test_the_slow_twin_agrees_on_a_rough_motion(name, mounting):
    check_by_the_twin(name, mounting)


@pytest.mark.parametrize("name", CASES)
def test_sensitivities_by_every_number_are_those_of_central_differences(name):
    check_slopes(name, resting(name) | CASES[name][1])


def check_slopes(name, base, held=None, *, passed=0):
    """Hold exact sensitivities of a case, with some numbers changed, to central differences."""
    network, held = CASES[name][0], held or {}

    def short(sensitivities=(), **numbers):
        how = {"cycles": 1, "per_cycle": 300, "options": SMOOTH, "sensitivities": sensitivities}
        return run(name, **how, **held | numbers)

    exact = short(network.numbers).sensitivities
    for number in network.numbers:
        if number in ABSENT and base[number] == 0.0:
            continue  # two laws meet there; the limits are tested below
        size = base[number] or {"drag": 1.0}.get(number, 100.0)
        best, scale = math.inf, np.max(np.abs(exact[number]))
        for step in (1e-3, 1e-4, 1e-2):
            moved = (short(**{number: base[number] + s * step * size}).force for s in (1, -1))
            slope = np.subtract(*moved) / (2 * step * size)
            gaps = np.sort(np.abs(slope - exact[number])) / scale
            best = min(best, gaps[-1 - passed])
            if best < 1e-4:
                break
        assert scale > 0.0, number
        assert best < 1e-4, (number, best)
        assert gaps[-1] < 0.05, (number, gaps[-1])


def test_a_blow_off_that_never_opens_is_not_there():
    with_it = run("b", rebound_opening=1e9, compression_opening=1e9)
    _, values, damper, (amplitude, frequency) = CASES["b"]
    bleed = Valve("orifice", "none")
    motion = sine_motion(amplitude, frequency, cycles=4, sample_rate=1000 * frequency * (1 + 1e-12))
    gone = ("rebound_opening", "rebound_slope", "compression_opening", "compression_slope")
    kept = {k: v for k, v in values.items() if k not in gone}
    without = simulate_network(layout(valve=bleed), kept, damper, motion, options=SHARP)
    np.testing.assert_allclose(with_it.force, without.force, rtol=0, atol=2e-3)
    seen = run("b", rebound_opening=1e9, sensitivities=("rebound_opening", "rebound_slope"))
    assert not np.any(seen.sensitivities["rebound_opening"])
    assert not np.any(seen.sensitivities["rebound_slope"])


VALVE = Valve("orifice", "linear")
# A case, its valves with a part and without it, the part's numbers, and how fast it fades.
FADING = {
    "width": ("c", LONG, Valve("long", "linear"), (2e4, 5e3, 1.25e3), 2.0),
    "leak": ("b", Valve("long", "linear"), VALVE, (1e5, 1e4, 1e3), 5.0),
    "free_gas": ("c", LONG, LONG, (1e-3, 1e-4, 1e-5), 8.0),
}


@pytest.mark.parametrize("part", FADING)
def test_a_law_fades_into_the_one_without_a_part(part):
    name, there, without, sizes, ratio = FADING[part]
    _, values, damper, (amplitude, frequency) = CASES[name]
    motion = sine_motion(amplitude, frequency, cycles=2, sample_rate=500 * frequency)

    def force(valve, **numbers):
        network = layout(valve=valve)
        known = {key: x for key, x in (values | numbers).items() if key in network.numbers}
        return simulate_network(network, known, damper, motion, options=SHARP).force

    names = ("free_gas",) if part == "free_gas" else (f"rebound_{part}", f"compression_{part}")
    limit = force(without, **dict.fromkeys(names, 0.0))
    gaps = [np.max(np.abs(force(there, **dict.fromkeys(names, x)) - limit)) for x in sizes]
    assert gaps[0] > ratio * gaps[1] > ratio**2 * gaps[2] > 0.0


def test_starts_away_from_the_middle_keep_the_oil():
    """The steady cycle does not depend on where the log begins."""
    for network, values, damper, (amplitude, frequency) in CASES.values():
        whole = sine_motion(amplitude, frequency, cycles=4, sample_rate=400 * frequency)
        late = Motion(whole.interval, whole.displacement[150:], whole.velocity[150:])
        first, second = (
            simulate_network(network, values, damper, one, options=SHARP).force
            for one in (whole, late)
        )
        np.testing.assert_allclose(second[1050:1450], first[1200:1600], rtol=0, atol=5e-3)


def test_oil_is_kept_and_every_passage_dissipates():
    for name, (network, values, damper, _) in CASES.items():
        response = run(name, cycles=2)
        known = {"": 0.0} | values
        for way in network.passages:
            drop = response.pressures[way.start - 1] - response.pressures[way.end - 1]
            law = twin.law_of(way, known)
            assert np.all(np.array([twin.flow_through(d, **law) for d in drop]) * drop >= 0.0)
        one, two = response.masses / damper.oil_density
        lost = two - damper.chamber_2_volume
        if network.has_floating_piston:
            lost = damper.piston_area * response.displacement
        volume = damper.gas_volume + one - damper.chamber_1_volume + lost
        gas = response.pressures[2] * volume**damper.gas_exponent
        np.testing.assert_allclose(gas, gas[0], rtol=1e-9)


def test_it_rests_at_the_gas_force_and_the_surroundings_push_on_the_rod():
    still = Motion(1e-2, np.zeros(500), np.zeros(500))
    for network, values, damper, _ in CASES.values():
        force = simulate_network(network, values, damper, still).force
        expected = -damper.rod_area * damper.gas_pressure
        np.testing.assert_allclose(force, expected, rtol=1e-12)
        outside = dataclasses.replace(network, ambient_pressure=1e5)
        lifted = simulate_network(outside, values, damper, still).force - force
        np.testing.assert_allclose(lifted, 1e5 * damper.rod_area, rtol=1e-9)


def test_wild_numbers_end_in_a_sentence_or_a_force():
    """Newton stays safe at every root and corner: it may give up, far from any damper."""
    rng = np.random.default_rng(11)
    network, values, damper, (amplitude, frequency) = CASES["b"]
    motion = sine_motion(amplitude, frequency, cycles=1, sample_rate=300 * frequency)
    limited = SolverOptions(tolerance=1e-2, max_steps_per_sample=200)
    finished = 0
    for _ in range(40):
        wild = {name: value * math.exp(rng.normal(0.0, 2.0)) for name, value in values.items()}
        try:
            response = simulate_network(network, wild, damper, motion, options=limited)
        except SimulationError:
            continue
        finished += 1
        assert np.all(np.isfinite(response.force))
        assert np.all(response.pressures >= 0.0)
    assert finished >= 38


STRAIGHT = sine_motion(0.01, 1.0, cycles=1, sample_rate=100)


def test_numbers_that_are_missing_or_unknown_are_named():
    network, values, damper, _ = CASES["b"]
    less = {k: v for k, v in values.items() if k != "rebound_slope"}
    with pytest.raises(ConfigurationError, match="needs a value of rebound_slope"):
        simulate_network(network, less, damper, STRAIGHT)
    with pytest.raises(ConfigurationError, match="no number 'rebound_slop' in through_flow"):
        simulate_network(network, values | {"rebound_slop": 1.0}, damper, STRAIGHT)
    with pytest.raises(ConfigurationError, match="no bleed 'orifise'"):
        Valve("orifise")
    with pytest.raises(ConfigurationError, match="needs a bleed or a blow-off"):
        Valve("none", "none")


OIL = {"k_e": 1e9, "f_f": 0.0}


@pytest.mark.parametrize(
    ("network", "values"),
    [
        *(
            (CASES["b"][0], CASES["b"][1] | {name: value})
            for name, value in (
                ("rebound_bleed", -1.0), ("k_e", 0.0), ("k_e", math.nan), ("gas_volume", 0.0),
                ("free_gas", -1e-9), ("rebound_opening", -1.0), ("rebound_slope", 0.0),
            )
        ),
        # Passages that lead nowhere, or let nothing through.
        (Network("odd", (Passage(1, 1, resistance="a"),)), OIL | {"a": 1e5}),
        (Network("odd", (Passage(0, 2, resistance="a"),)), OIL | {"a": 1e5}),
        (Network("odd", (Passage(1, 2),)), OIL),
        (Network("odd", (Passage(2, 3, resistance="a"),), True), OIL | {"a": 1e5}),
    ],
)  # fmt: skip
def test_numbers_without_sense_and_passages_that_lead_nowhere_are_refused(network, values):
    with pytest.raises(SimulationError, match="zero, negative or not finite"):
        simulate_network(network, values, SMALL, STRAIGHT)


def test_more_numbers_than_the_core_holds_are_refused():
    full = tuple(Passage(1, 3, f"s{k}", f"r{k}", f"p{k}") for k in range(10))  # 17 are the body's
    network = Network("full", full)
    values = OIL | dict.fromkeys(network.passage_numbers, 1e5)
    simulate_network(network, values, PURDY_DAMPER, STRAIGHT, sensitivities=network.numbers)
    with pytest.raises(ConfigurationError, match="11 passages and 48 numbers"):
        Network("over", (*full, Passage(1, 3, resistance="r")))


def test_the_drag_of_a_rigid_mounting_is_by_the_velocity():
    free, dragged = (run("b", cycles=1, drag=drag, sensitivities=("drag",)) for drag in (0.0, 40.0))
    np.testing.assert_allclose(dragged.force - free.force, 40.0 * free.velocity, rtol=0, atol=1e-9)
    assert np.array_equal(free.sensitivities["drag"], free.velocity)


# Friction that pre-slides, is larger at rest, grows with pressure: golden values, twin, slopes.

RIGID = {"k_s": 0.0, "play": 0.0, "drag": 0.0}
ELASTIC = {"k_s": 1e6, "play": 0.0, "drag": 40.0}
PLAY = {"k_s": 3e5, "play": 7e-4, "drag": 40.0}
PRESLIDES = {"presliding": 3e-5}
STRIBECK = {"breakaway": 20.0, "stribeck_speed": 0.02}
PRESSED = {"seal_area": 1e-5}
TURNS = {"turning_speed": 8e-3}
ALL = {**PRESLIDES, **STRIBECK, **PRESSED}
EACH = {
    "presliding": PRESLIDES, "stribeck": STRIBECK, "pressed": PRESSED, "all": ALL, "turns": TURNS,
}  # fmt: skip

# Case b (valves.md) with more friction, 4th cycle: force N. The core and SciPy's Radau agree.
RUBBED_AT = (0.02, 0.1, 0.26, 0.3, 0.6, 0.77)
RUBBED = {
    "presliding": (RIGID | PRESLIDES, (270.083, 258.704, 78.103, -263.214, -358.929, -16.219)),
    "all": (RIGID | ALL, (284.601, 272.642, 66.690, -270.735, -367.041, 3.853)),
    "elastic": (ELASTIC | ALL, (289.468, 276.773, 166.450, -187.871, -371.036, -151.376)),
    "play": (PLAY | ALL, (289.328, 277.030, 197.598, 0.000, -370.915, -242.454)),
}


@pytest.mark.parametrize(("numbers", "expected"), RUBBED.values(), ids=RUBBED)
def test_golden_values_of_friction(numbers, expected):
    at = [3000 + round(1000 * q) for q in RUBBED_AT]
    assert run("b", **numbers).force[at] == pytest.approx(expected, abs=0.02)


@pytest.mark.parametrize(
    ("mounting", "more"),
    [
        pytest.param(
            mounting,
            more,
            id=f"{held}-{kind}",
            # Behind a mounting all kinds at once; one by one where nothing else gives way.
            marks=[] if mounting is RIGID or more in (ALL, TURNS) else pytest.mark.slow,
        )
        for held, mounting in (("rigid", RIGID), ("elastic", ELASTIC), ("play", PLAY))
        for kind, more in EACH.items()
    ],
)
def test_sensitivities_are_those_of_central_differences(more, mounting):
    held = {**mounting, **more}
    passed = 30 if mounting["play"] else 20 if mounting["k_s"] else 4
    check_slopes("b", resting("b") | CASES["b"][1] | held, held, passed=passed)


@pytest.mark.parametrize("name", ["b", pytest.param("e", marks=pytest.mark.slow)])
@pytest.mark.parametrize("mounting", [RIGID, pytest.param(PLAY, marks=pytest.mark.slow)])
@pytest.mark.parametrize("more", [ALL, TURNS], ids=["all", "turns"])
def test_the_slow_twin_agrees_on_friction(name, mounting, more):
    check_by_the_twin(name, mounting, **more)


def test_presliding_is_a_spring_first_and_loses_what_it_rubs():
    """From rest it is f_f/presliding stiff; a closed loop of it turns work into heat."""
    still = sine_motion(1e-6, 1.0, cycles=1, sample_rate=1000)
    network, values, damper, _ = CASES["b"]
    some = {**values, "presliding": 5e-5}
    there = simulate_network(network, some, damper, still).force
    gone = simulate_network(network, {**values, "f_f": 0.0}, damper, still).force
    stiffness = (there - gone)[100] / still.displacement[100]
    assert stiffness == pytest.approx(values["f_f"] / 5e-5, rel=0.02)
    loop = sine_motion(2e-3, 1.0, cycles=2, sample_rate=1000)
    rubbed = (
        simulate_network(network, some, damper, loop).force
        - simulate_network(network, {**values, "f_f": 0.0}, damper, loop).force
    )[1000:]
    work = float(np.sum(rubbed * loop.velocity[1000:]) * loop.interval)
    assert 0.9 * values["f_f"] * 8e-3 < work < values["f_f"] * 8e-3


def test_a_turn_within_a_sample_is_found():
    """A triangle whose corners lie between the samples: the way to the corner and back counts."""
    network, values, damper, _ = CASES["b"]
    some = {**values, "presliding": 2e-4, "f_f": 200.0}
    fine = sine_motion(1e-3, 3.0, cycles=2, sample_rate=24_000)
    x, v = fine.displacement[7:], fine.velocity[7:]
    coarse, shifted = Motion(fine.interval * 64, x[::64], v[::64]), Motion(fine.interval, x, v)
    one = simulate_network(network, some, damper, shifted, options=SHARP).force[::64]
    other = simulate_network(network, some, damper, coarse, options=SHARP).force
    assert np.max(np.abs(one - other)) < 0.2


@pytest.mark.parametrize(
    ("declared", "said"),
    [
        ({"presliding": "some"}, "presliding: found 'some'; expected a number, 'none' or 'fit'"),
        ({"presliding": 0.0}, "presliding: found 0; expected 1e-07 to 0.01 m"),
        ({"presliding": 20.0}, "presliding: found 20; expected"),
        ({"breakaway": "fit"}, "stribeck_speed: found 'none'"),
        ({"stribeck_speed": 0.1}, "breakaway: found 'none'"),
        ({"presliding": "fit", "turning_speed": 2e-3}, "turning_speed: found beside presliding"),
    ],
)
def test_what_is_no_declaration_is_refused(declared, said):
    with pytest.raises(ConfigurationError, match=said):
        Friction(**declared)


def test_toml_declares_it_with_units():
    told = {"presliding": "30um", "breakaway": "12N", "stribeck_speed": "20mm/s"}
    friction = {**told, "seal_area": "4mm2"}
    made = load_configuration(overlay={"damper": {"model": "twin_tube", "friction": friction}})
    found = made.damper.friction
    assert dataclasses.astuple(found)[:4] == pytest.approx((3e-5, 12.0, 0.02, 4e-6))
    assert found.turning_speed == "none"
    turns = {"damper": {"model": "twin_tube", "friction": {"turning_speed": "2mm/s"}}}
    assert load_configuration(overlay=turns).damper.friction.turning_speed == pytest.approx(2e-3)
    with pytest.raises(ConfigurationError, match=r"unknown key 'presliding_way' in \[damper.fric"):
        load_configuration(
            overlay={"damper": {"model": "twin_tube", "friction": {"presliding_way": "fit"}}}
        )
