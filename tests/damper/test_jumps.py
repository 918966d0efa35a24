"""A motion whose speed jumps between two samples: the core turns where it turns."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from damperfit.damper.network import purdy, simulate_network
from damperfit.damper.purdy.parameters import PURDY_DAMPER
from damperfit.damper.purdy.reference import reference_parameters
from damperfit.errors import SimulationError
from damperfit.simulation import Motion, SolverOptions, simulate
from tests.oracles.motions import _force, triangles

RATE = 500.0
TIGHT = SolverOptions(tolerance=1e-5)
DRIVE = triangles(0.1037, 0.2411, cycles=2, amplitude=0.011)


def sampled(drive=DRIVE, *, rate=RATE):
    time = np.arange(round(drive.duration * rate)) / rate
    x, v = (np.array([f(t) for t in time.tolist()]) for f in (drive.displacement, drive.velocity))
    jumps = [
        (
            one * rate,
            drive.displacement(one),
            drive.velocity(one - 1e-9),
            drive.velocity(one + 1e-9),
        )
        for one in drive.corners
        if 0.0 < one < time[-1]
    ]
    return Motion(1.0 / rate, x, v, jumps=np.array([j for j in jumps if j[2] != j[3]]))


@pytest.mark.parametrize("setting", [1, 20])
def test_as_the_slow_twin_that_stops_at_each_corner(setting):
    motion = sampled()
    truth = reference_parameters(setting)
    time = np.arange(len(motion.displacement)) / RATE
    force = simulate(truth, PURDY_DAMPER, motion, options=TIGHT).force
    # LSODA at 1e-9 is itself 0.03 N off at corners; without jumps the core is 300 N off.
    np.testing.assert_allclose(force, _force(truth, PURDY_DAMPER, DRIVE, time), atol=0.06)
    without = simulate(truth, PURDY_DAMPER, replace(motion, jumps=np.empty((0, 4)))).force
    assert np.max(np.abs(without - force)) > 100.0


def test_derivatives_go_over_jumps():
    truth, motion = reference_parameters(10), sampled()
    names = ("r_m1", "r_m2", "r_m3", "k_e", "f_f")
    seen = simulate(truth, PURDY_DAMPER, motion, sensitivities=names, options=TIGHT)
    for name in names:
        ends = [
            simulate(
                replace(truth, **{name: getattr(truth, name) * factor}),
                PURDY_DAMPER,
                motion,
                options=SolverOptions(tolerance=1e-7),
            ).force
            for factor in (1.0 - 1e-3, 1.0 + 1e-3)
        ]
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
        simulate_network(purdy(), values, PURDY_DAMPER, one, options=TIGHT).force
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
        simulate(truth, PURDY_DAMPER, one, options=TIGHT).force for one in (motion, finer)
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
