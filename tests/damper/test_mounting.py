"""Moving mass, lag of the force channel, rubber of the mounting."""

import math
from dataclasses import replace

import numpy as np
import pytest

from damperfit.damper.mounting import (
    FIT,
    NONE,
    Friction,
    Mounting,
    acceleration,
    before_load_cell,
    behind_lag,
)
from damperfit.damper.network import Valve
from damperfit.damper.valve_dampers import ThroughFlow, TwinTube
from damperfit.errors import ConfigurationError
from damperfit.simulation import Motion, SolverOptions, sine_motion, triangle_motion
from tests import fakes
from tests.rig_like import rig

MOTION = sine_motion(0.009, 6.0, cycles=5, sample_rate=2000)
BARE = TwinTube(mounting=Mounting(NONE))
NUMBERS = {
    "rebound_bleed": 4e4, "rebound_opening": 9e5, "rebound_slope": 1.5e7, "compression_bleed": 9e4,
    "compression_opening": 1.1e6, "compression_slope": 3.2e7, "f_f": 24.0, "f_0": -12.0,
}  # fmt: skip


def response(mounting: Mounting, motion=MOTION, sensitivities=(), **numbers: float):
    model = replace(BARE, mounting=mounting)
    held = {one.name: 1e9 if one.default is None else one.default for one in model.quantities}
    values = model.values(held | NUMBERS | numbers)
    return model.simulate(values, motion, sensitivities=sensitivities, options=SolverOptions())


def test_a_mass_takes_its_acceleration_and_changes_nothing_in_the_damper() -> None:
    bare, loaded = response(Mounting(NONE)), response(Mounting(NONE, NONE, NONE, 2.0))
    exact = -2.0 * (2 * np.pi * 6.0) ** 2 * MOTION.displacement
    np.testing.assert_allclose(loaded.force - bare.force, exact, atol=2e-4 * np.max(exact))
    np.testing.assert_array_equal(loaded.pressures, bare.pressures)


def test_the_channel_reads_the_mass_late_too() -> None:
    late = response(Mounting(NONE, NONE, 0.008, 2.0)).force
    apart = response(Mounting(NONE, NONE, 0.008)).force
    t, omega = MOTION.interval * np.arange(len(late)), 2 * np.pi * 6.0
    lost = np.hypot(1.0, 0.008 * omega)
    exact = -2.0 * omega**2 * 0.009 * np.sin(omega * t - np.arctan(0.008 * omega)) / lost
    settled = slice(400, -1)
    error = (late - apart - exact)[settled]
    assert np.max(np.abs(error)) < 2e-3 * np.max(exact)


def test_the_slopes_are_those_of_differences() -> None:
    mounting = Mounting(4e5, NONE, FIT, FIT)
    names = ("moving_mass", "lag", "rebound_bleed")
    known = {"moving_mass": 1.5, "lag": 0.006, "k_s": 4e5}
    found = response(mounting, sensitivities=names, **known).sensitivities
    assert tuple(found) == names
    for name, step in (("moving_mass", 1e-3), ("lag", 1e-6)):
        high, low = (
            response(mounting, **known | {name: known[name] + d}).force for d in (step, -step)
        )
        slope = (high - low) / (2 * step)
        np.testing.assert_allclose(found[name], slope, atol=2e-5 * np.max(np.abs(slope)))


def test_a_jump_of_the_speed_keeps_its_momentum() -> None:
    motion = triangle_motion(0.02, 2.0, cycles=2, sample_rate=1000)
    found = acceleration(motion.velocity, motion.interval)
    jump = slice(120, 130)  # a quarter of a cycle is 125 samples
    assert np.sum(found[jump]) * motion.interval == pytest.approx(-2 * 0.16, rel=1e-9)


def test_a_log_before_its_load_cell_is_what_the_damper_had() -> None:
    log = fakes.trace(1)
    assert before_load_cell(log) is log
    inertia = acceleration(log.velocity, log.interval)
    loaded = replace(log, force=log.force + 3.0 * inertia)
    bare = before_load_cell(loaded, moving_mass=3.0).force
    np.testing.assert_allclose(bare, log.force, atol=1e-9)
    early = before_load_cell(log, lag=0.01).force
    np.testing.assert_allclose(early, log.force + 0.01 * np.gradient(log.force, log.interval))
    # A mass that was weighed is taken off before valves are read.
    weighed = replace(BARE, mounting=Mounting(NONE, NONE, NONE, 3.0))
    both = zip(BARE.start([log], {}), weighed.start([loaded], {}), strict=True)
    for one, other in both:
        own = [getattr(other, name) for name in one.names]
        np.testing.assert_allclose(own, one.numbers, rtol=1e-6)


# The lag of the force channel against its exact answers and its derivative by differences.

INTERVAL = 1e-3


def ramp(n=400):
    """A force that stands, climbs, and stands: pieces of straight lines, as the lag takes them."""
    return np.interp(np.arange(n), [0, 100, 200, n], [-30.0, -30.0, 470.0, 470.0])


@pytest.mark.parametrize("lag", [2e-4, 8e-3, 5e-2])
def test_a_ramp_comes_late_by_the_lag_and_is_met_exactly(lag):
    t = np.arange(100) * INTERVAL
    exact = -30.0 + 5e3 * (t - lag * (1.0 - np.exp(-t / lag)))
    np.testing.assert_allclose(
        behind_lag(ramp()[None], INTERVAL, lag)[0, 100:200], exact, rtol=1e-12
    )


@pytest.mark.parametrize("rows", [1, 3, 4, 5, 9])
def test_each_of_some_signals_is_what_a_general_filter_makes_of_it(rows):
    from scipy.signal import lfilter

    force = np.random.default_rng(rows).normal(size=(rows, 50))
    q = INTERVAL / 8e-3
    a, mean = np.exp(-q), -np.expm1(-q) / q
    start = mean * force[:, :1]  # at rest before the first sample
    slow = lfilter([1 - mean, mean - a], [1.0, -a], force, axis=1, zi=start)[0]
    np.testing.assert_allclose(behind_lag(force, INTERVAL, 8e-3), slow, rtol=1e-12, atol=1e-14)


def test_no_lag_is_the_signal_itself_and_a_small_one_nearly():
    force = ramp()[None]
    assert behind_lag(force, INTERVAL, 0.0) is force
    assert np.max(np.abs(behind_lag(force, INTERVAL, 1.1e-6) - force)) < 6e-3


# A mounting of rubber: a force that it holds whichever way it was bent last.

RUBBER = {"k_s": 1.6e5, "rubber": 60.0, "rubber_bend": 4e-4}
BODY = rig.Body(
    "through_flow",
    rig.Valve(bleed=6.4e4, opening=2.3e5, slope=2e6),
    rig.Valve(bleed=5e4, opening=2e5, slope=1.8e6),
    stiffness=RUBBER["k_s"], rubber=RUBBER["rubber"], rubber_bend=RUBBER["rubber_bend"],
    mass=0.01, friction=20.0, presliding=2e-5,
)  # fmt: skip
NUMBERS_RUBBER = {
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
        **{name: NUMBERS_RUBBER[name] for name in own}, rebound=Valve(), compression=Valve(),
        mounting=Mounting(FIT, rubber=FIT, rubber_bend=FIT), friction=friction,
    )  # fmt: skip


def simulated(model, motion, sensitivities=(), **changed):
    known = NUMBERS_RUBBER | changed
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
        value, step = NUMBERS_RUBBER[name], 1e-5 * NUMBERS_RUBBER[name]
        ends = [simulated(model, motion, **{name: value + s}).force for s in (step, -step)]
        away = np.abs((ends[0] - ends[1]) / (2 * step) - found[name])
        # Beside corners of friction and valves a difference of steps is none.
        assert np.median(away) < 1e-5 * np.std(found[name]), name


@pytest.mark.parametrize(
    ("parts", "said"),
    [
        ({"series_stiffness": "none", "play": "fit"}, "play needs a series stiffness"),
        ({"lag": "some"}, "lag: found 'some'; expected a number, 'none' or 'fit'"),
        ({"lag": -0.01}, "lag: found -0.01; expected 1e-05 to 0.05 s"),
        ({"lag": math.nan}, "lag: found nan"),
        ({"series_stiffness": True}, "series_stiffness: found True"),
        ({"series_stiffness": 300.0}, "series_stiffness: found 300; expected 1000 to 1e.10 N"),
        ({"moving_mass": 0.0}, "moving_mass: found 0"),
        ({"moving_mass": 1001.0}, "moving_mass: found 1001; expected 0.0001 to 1000 kg"),
        ({"rubber": 60.0}, "rubber"),
        ({"rubber_bend": FIT}, "rubber"),
        ({"series_stiffness": NONE, "rubber": FIT, "rubber_bend": FIT}, "rubber"),
    ],
)
def test_no_mounting_is_refused_in_a_sentence(parts, said):
    with pytest.raises(ConfigurationError, match=said):
        Mounting(**parts)
