"""The compiled core: known answers, jumps, rounding, interpreters."""

from dataclasses import replace

import numpy as np
import pytest

from damperfit.damper.mounting import FIT, NONE, Mounting
from damperfit.damper.network import SteppedDamper, Valve, purdy, simulate_network
from damperfit.damper.purdy.parameters import (
    PURDY_DAMPER,
    Parameters,
    incompressible_force,
    reference_parameters,
)
from damperfit.damper.rivals import Bilinear
from damperfit.damper.valve_dampers import TwinTube
from damperfit.errors import ConfigurationError, SimulationError
from damperfit.simulation import Motion, SolverOptions, simulate, sine_motion
from tests.oracles.motions import _force, triangles

# What it costs that the root of an orifice is rounded near no pressure, N.
TIGHT = 1e-6  # N a step: the integrator's own error is far below


# Where the core's equations have solutions on paper: after a step with the rod held.
#
# With a gas spring so long that P_3 stays put, valve 1 empties chamber 1 by sqrt(D) = sqrt(D_0) -
# k_1 t/(2 R_m1) until the flow ends, and valve 3 fills chamber 2 by D = D_0 exp(-k_2 t/R_m3); k_i
# = K_e/(rho_0 V_i). They take the place of a manufactured solution, for which the kernel would
# need a source term.

DAMPER = replace(PURDY_DAMPER)
object.__setattr__(DAMPER, "gas_length", 1e5)  # so much gas as no damper may be declared with
Y = Parameters(r_m1=3e4, r_m2=4e6, r_m3=2.597e6, k_e=4e8, f_f=0.0)
STEP, INTERVAL = 2e-5, 1e-5


def _held_after_a_step(n: int, tolerance: float):
    x = np.full(n, STEP)
    x[0] = 0.0
    motion = Motion(INTERVAL, x, np.zeros(n))
    return simulate(Y, DAMPER, motion, options=SolverOptions(tolerance=tolerance))


@pytest.mark.parametrize("tolerance", [1e-3, 1e-6])
def test_valves_empty_and_fill_a_chamber_by_a_parabola_and_an_exponential(tolerance) -> None:
    response, t = _held_after_a_step(400, tolerance), INTERVAL * np.arange(400)
    one, two = response.pressures[:2] - response.pressures[2]
    assert one[1] > 1e4
    assert two[1] < -1e4
    k_1 = Y.k_e / (DAMPER.oil_density * (DAMPER.chamber_1_volume - STEP * DAMPER.annulus_area))
    k_2 = Y.k_e / (DAMPER.oil_density * (DAMPER.chamber_2_volume + STEP * DAMPER.piston_area))
    root = np.sqrt(one[1]) - k_1 * (t - t[1]) / (2.0 * Y.r_m1)
    flows = (t >= t[1]) & (root > 0.05 * np.sqrt(one[1]))
    assert 5 < np.count_nonzero(flows) < 395
    # Every step may add its tolerance; nothing is forgotten before the flow ends.
    error = (one - root**2)[flows] * DAMPER.annulus_area
    assert np.max(np.abs(error)) < tolerance * np.count_nonzero(flows)
    # Here the flow forgets at its own rate.
    error = (two - two[1] * np.exp(-k_2 * (t - t[1]) / Y.r_m3))[1:] * DAMPER.piston_area
    assert np.max(np.abs(error)) < 1.1 * tolerance / (k_2 * INTERVAL / Y.r_m3)


def test_locked_oil_is_a_spring() -> None:
    # Valves as good as shut: the masses stay, and the pressures follow the volumes, eq. (7).
    y = Parameters(r_m1=1e12, r_m2=1e18, r_m3=1e18, k_e=4e8, f_f=0.0)
    t = INTERVAL * np.arange(2000)
    x = 1e-4 * np.sin(2 * np.pi * 100 * t)
    v = 1e-4 * 2 * np.pi * 100 * np.cos(2 * np.pi * 100 * t)
    response = simulate(y, PURDY_DAMPER, Motion(INTERVAL, x, v))
    v_1 = PURDY_DAMPER.chamber_1_volume - x * PURDY_DAMPER.annulus_area
    v_2 = PURDY_DAMPER.chamber_2_volume + x * PURDY_DAMPER.piston_area
    p_1 = y.k_e * (PURDY_DAMPER.chamber_1_volume / v_1 - 1.0) + PURDY_DAMPER.gas_pressure
    p_2 = y.k_e * (PURDY_DAMPER.chamber_2_volume / v_2 - 1.0) + PURDY_DAMPER.gas_pressure
    np.testing.assert_allclose(response.pressures[0], np.maximum(p_1, 0.0), rtol=1e-6)
    np.testing.assert_allclose(response.pressures[1], np.maximum(p_2, 0.0), rtol=1e-6)


@pytest.mark.parametrize("setting", [1, 10, 20])
@pytest.mark.parametrize("amplitude", [0.032, 0.003, 0.0003])
@pytest.mark.parametrize("k_e", [4e12, 5e12, 1e13, 1e14, 1e15])
def test_oil_as_stiff_as_may_be_gives_the_incompressible_force(
    setting: int, amplitude: float, k_e: float
) -> None:
    # Newton's goal of 1e-3 Pa lay below the rounding of K_e from 4.5e12 Pa on: step limit.
    y = replace(reference_parameters(setting), k_e=k_e)
    motion = sine_motion(amplitude, 1.5, cycles=3, sample_rate=1000)
    options = SolverOptions(tolerance=1e-2)
    response = simulate(y, PURDY_DAMPER, motion, sensitivities=["k_e"], options=options)
    expected = incompressible_force(y, PURDY_DAMPER, motion.displacement, motion.velocity)
    # Inside the dead band and in the first instants the two have different friction.
    is_moving = (np.abs(motion.velocity) > 3e-4) & (np.arange(len(motion.displacement)) > 200)
    error = np.abs(response.force - expected)[is_moving]
    # What is left is the oil's give, 1e12 N Pa/K_e at setting 20, and two steps' tolerance.
    assert np.max(error) < 2e-2 + 1e12 / k_e
    # f_inf - f goes with 1/K_e, so that K_e df/dK_e is f_inf - f: no digits are lost in it.
    give = np.max(np.abs(k_e * response.sensitivities["k_e"][200:]))
    assert give < 1.5 * 0.9e12 / k_e + 1e-3
    assert response.work.newton_iterations < 6 * response.work.steps


# A motion whose speed jumps between two samples: the core turns where it turns.

RATE = 500.0
TIGHT_TEST_JUMPS = SolverOptions(tolerance=1e-5)
DRIVE = triangles(0.1037, 0.2411, cycles=2, amplitude=0.011)


def sampled(drive=DRIVE, *, rate=RATE):
    time = np.arange(round(drive.duration * rate)) / rate
    x, v = (np.array([f(t) for t in time.tolist()]) for f in (drive.displacement, drive.velocity))
    beside = (
        (one, drive.velocity(one - 1e-9), drive.velocity(one + 1e-9)) for one in drive.corners
    )
    jumps = [
        (one * rate, drive.displacement(one), *v) for one, *v in beside if 0.0 < one < time[-1]
    ]
    return Motion(1.0 / rate, x, v, jumps=np.array([j for j in jumps if j[2] != j[3]]))


@pytest.mark.parametrize("setting", [1, 20])
def test_as_the_slow_twin_that_stops_at_each_corner(setting):
    motion = sampled()
    truth = reference_parameters(setting)
    time = np.arange(len(motion.displacement)) / RATE
    force = simulate(truth, PURDY_DAMPER, motion, options=TIGHT_TEST_JUMPS).force
    # LSODA at 1e-9 is itself 0.03 N off at corners; without jumps the core is 300 N off.
    np.testing.assert_allclose(force, _force(truth, PURDY_DAMPER, DRIVE, time), atol=0.06)
    without = simulate(truth, PURDY_DAMPER, replace(motion, jumps=np.empty((0, 4)))).force
    assert np.max(np.abs(without - force)) > 100.0


def test_derivatives_go_over_jumps():
    truth, motion = reference_parameters(10), sampled()
    names = ("r_m1", "r_m2", "r_m3", "k_e", "f_f")
    seen = simulate(truth, PURDY_DAMPER, motion, sensitivities=names, options=TIGHT_TEST_JUMPS)
    for name in names:
        moved = (
            truth.replace({name: getattr(truth, name) * by}) for by in (1.0 - 1e-3, 1.0 + 1e-3)
        )
        fine = SolverOptions(tolerance=1e-7)
        ends = [simulate(y, PURDY_DAMPER, motion, options=fine).force for y in moved]
        slope = (ends[1] - ends[0]) / (2e-3 * getattr(truth, name))
        far = np.max(np.abs(slope))
        np.testing.assert_allclose(seen.sensitivities[name], slope, atol=2e-3 * far)


def test_an_elastic_mounting_has_jumps_too():
    """Beside a motion that is sampled so finely that its corners need none."""
    truth = reference_parameters(5)
    values = {name: getattr(truth, name) for name in ("r_m1", "r_m2", "r_m3", "k_e", "f_f")}
    values |= {"k_s": 5e6, "play": 1e-4, "drag": 40.0}
    motion, fine = sampled(), sampled(rate=100.0 * RATE)
    force, exact = (
        simulate_network(purdy(), values, PURDY_DAMPER, one, options=TIGHT_TEST_JUMPS).force
        for one in (motion, replace(fine, jumps=np.empty((0, 4))))
    )
    np.testing.assert_allclose(force[1:], exact[::100][1 : len(force)], atol=1.0)


def test_two_jumps_within_a_sample():
    truth = reference_parameters(10)
    jumps = np.array([[10.25, 1.025e-3, 0.1, -0.1], [10.75, 0.975e-3, -0.1, 0.1]])
    x = 1e-4 * np.arange(60.0) - np.where(np.arange(60) > 10, 1e-4, 0.0)
    motion = Motion(1e-3, x, np.full(60, 0.1), jumps=jumps)
    quarter = np.arange(237) / 4.0
    way = np.interp(quarter, [0.0, 10.25, 10.75, 60.0], [0.0, 1.025e-3, 0.975e-3, 5.9e-3])
    speed = np.where((quarter >= 10.25) & (quarter < 10.75), -0.1, 0.1)
    at = jumps.copy()
    at[:, 0] *= 4.0
    finer = Motion(2.5e-4, way, speed, jumps=at)
    force, same = (
        simulate(truth, PURDY_DAMPER, one, options=TIGHT_TEST_JUMPS).force
        for one in (motion, finer)
    )
    np.testing.assert_allclose(force, same[::4], atol=0.02)


@pytest.mark.parametrize(
    ("jumps", "says"),
    [
        (np.zeros(4), "of shape"),
        (np.zeros((2, 3)), "of shape"),
        ([[1.0, 0.0, 0.1, np.nan]], "not finite"),
        ([[0.0, 0.0, 0.1, -0.1]], "after the first sample"),
        ([[9.1, 0.0, 0.1, -0.1]], "not after the last"),
        ([[3.0, 0.0, 0.1, -0.1], [3.0, 0.0, 0.1, -0.1]], "in order of time"),
    ],
)
def test_what_is_no_jump_is_refused(jumps, says):
    with pytest.raises(SimulationError, match=says):
        Motion(1e-3, np.zeros(10), np.zeros(10), jumps=np.asarray(jumps))


def test_a_part_of_a_motion_has_the_jumps_in_it():
    motion = sampled()
    part = motion.until(100, 240)
    inside = (motion.jumps[:, 0] > 100.0) & (motion.jumps[:, 0] <= 239.0)
    assert 0 < np.count_nonzero(inside) < len(motion.jumps)
    np.testing.assert_array_equal(part.jumps[:, 0] + 100.0, motion.jumps[inside, 0])
    np.testing.assert_array_equal(part.jumps[:, 1:], motion.jumps[inside, 1:])
    assert part.start_time == pytest.approx(0.2)
    np.testing.assert_array_equal(part.velocity, motion.velocity[100:240])


def test_a_jump_at_a_sample_and_one_by_nothing():
    """At a sample the speed is that after it; friction has turned there, chambers need time."""
    truth, n = reference_parameters(10), np.arange(101)
    nothing = np.array([[20.5, 20.5e-4, 0.1, 0.1], [60.0, 60e-4, 0.1, 0.1]])
    back = np.where(n < 50, 1e-4 * n, 1e-2 - 1e-4 * n), np.where(n < 50, 0.1, -0.1)
    even = Motion(1e-3, 1e-4 * n, np.full(101, 0.1))
    turning = Motion(1e-3, *back, jumps=np.array([[50.0, 5e-3, 0.1, -0.1]]))
    plain, same, turned = (
        simulate(truth, PURDY_DAMPER, motion, options=SolverOptions(TIGHT)).force
        for motion in (even, replace(even, jumps=nothing), turning)
    )
    np.testing.assert_allclose(same, plain, atol=1e-3)
    np.testing.assert_allclose(turned[:50], plain[:50], atol=1e-3)
    assert turned[50] == pytest.approx(plain[50] - 2.0 * truth.f_f, abs=0.01)


# A damper stepped from outside is the damper that is simulated.

VALVE = Valve("orifice", "linear")
TWIN_TUBE = TwinTube(rebound=VALVE, compression=VALVE, mounting=Mounting(FIT, lag=FIT))
ELASTIC = TwinTube(rebound=VALVE, compression=VALVE, mounting=Mounting(FIT))
ON_A_RIG = {
    "rebound_bleed": 8e4, "rebound_opening": 3e5, "rebound_slope": 4e6, "compression_bleed": 6e4,
    "compression_opening": 2e5, "compression_slope": 3e6, "k_e": 9e8, "f_f": 20.0, "f_0": 11.0,
    "k_s": 4e5, "lag": 9e-3,
}  # fmt: skip
DT = 1e-3


def motion() -> Motion:
    """A sine that begins slowly."""
    time = np.arange(700) * DT
    x = 0.02 * np.sin(4.0 * np.pi * time) * np.minimum(1.0, time / 0.3) ** 2
    v = np.gradient(x, DT)
    v[0] = 0.0
    return Motion(DT, x, v)


def stepped(damper: SteppedDamper, driven: Motion, first: int = 1) -> list[float]:
    pairs = zip(driven.displacement[first:], driven.velocity[first:], strict=True)
    return [damper.step(x, v, DT) for x, v in pairs]


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
    assert np.abs(stepped(damper, driven) - whole.force[1:]).max() < 1e-9
    assert damper.pressures == pytest.approx(whole.pressures[:, -1])


def test_by_default_it_is_the_damper_alone() -> None:
    bare = TwinTube(rebound=VALVE, compression=VALVE, mounting=Mounting(NONE))
    known = {name: value for name, value in (ON_A_RIG | {"f_0": 0.0}).items() if name in bare.names}
    driven = motion()
    whole = bare.simulate(bare.values(known), driven, sensitivities=(), options=SolverOptions())
    found = stepped(SteppedDamper(TWIN_TUBE, TWIN_TUBE.values(ON_A_RIG)), driven)
    np.testing.assert_allclose(found, whole.force[1:], rtol=0, atol=1e-9)


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
    for x, dt in ((1.0, DT), (0.02, 1e3), (0.02, -DT), (float("nan"), DT)):
        with pytest.raises(SimulationError):
            damper.step(x, 0.1, dt)
    assert stepped(damper, driven, 300) == stepped(kept, driven, 300)


def test_a_model_without_chambers_is_refused() -> None:
    with pytest.raises(ConfigurationError, match="no chambers"):
        SteppedDamper(Bilinear(), Bilinear().values(dict.fromkeys(Bilinear().names, 1.0)))
