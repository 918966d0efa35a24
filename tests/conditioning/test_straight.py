"""A motion of straight lines drives the model with corners between samples, and no other does."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from damperfit.conditioning import ConditionOptions, apply_filter, condition
from damperfit.conditioning.drive import drive_of_lines
from tests.conditioning.logs import recording, sine_log, static_force
from tests.oracles.motions import triangles

RATE = 1000.0
EVERY = slice(None)
CORNERS = np.array([200.3, 500.0, 799.62, 1100.5])  # samples
SPEEDS = np.array([0.1, -0.2, 0.25, 0.0, -0.1])  # m/s


def zigzag(corners=CORNERS, speeds=SPEEDS, *, n=1400, noise=3e-6, seed=1, rate=RATE):
    """Lines of such speeds, from corner to corner, as a sensor shows them."""
    at = np.arange(n, dtype=float)
    edges = np.array([0.0, *corners, n])
    way = np.concatenate([[0.0], np.cumsum(speeds * np.diff(edges))]) / rate
    x = np.interp(at, edges, way)
    return x + noise * np.random.default_rng(seed).standard_normal(n)


@pytest.mark.parametrize("noise", [0.0, 3e-6, 1e-5])
def test_lines_and_where_they_cross_are_found(noise):
    found = drive_of_lines(zigzag(noise=noise), 1.0 / RATE, EVERY)
    exact = zigzag(noise=0.0)
    # Lines of 200 samples that turn by 0.1 to 0.45 m/s: 3 um err by 4e-3 of a sample.
    near = 1e-9 + 4e3 * noise
    np.testing.assert_allclose(found.jumps[:, 0], CORNERS, atol=near)
    assert found.jumps[1, 0] == 500.0  # the sample itself
    np.testing.assert_allclose(found.jumps[:, 2], SPEEDS[:-1], atol=near)
    np.testing.assert_allclose(found.jumps[:, 3], SPEEDS[1:], atol=near)
    np.testing.assert_allclose(found.displacement, exact, atol=1e-12 + 0.5 * noise)
    assert found.velocity[499] == found.jumps[1, 2]
    assert found.velocity[500] == found.jumps[1, 3]


def test_a_part_of_the_log_is_enough():
    """Before it the motion bends."""
    x = zigzag()
    x[:150] += 0.01 * np.sin(np.arange(150) / 20.0)
    assert drive_of_lines(x, 1.0 / RATE, EVERY) is None
    found = drive_of_lines(x, 1.0 / RATE, slice(150, 1400))
    np.testing.assert_allclose(found.jumps[:, 0], CORNERS, atol=0.02)
    np.testing.assert_allclose(found.displacement[150:], zigzag(noise=0.0)[150:], atol=2e-6)


@pytest.mark.parametrize(
    ("corners", "is_found"),
    [([303.0], True), ([289.0, 303.0], True), ([275.0, 289.0, 303.0], False)],
)
def test_a_corner_just_inside_a_part_has_its_line_from_beyond(corners, is_found):
    """Twice by 14 samples: so many show a turn and a line behind it at 1 kHz."""
    speeds = [0.2 * (-1.0) ** k for k in range(len(corners) + 2)]
    x = zigzag([100.0, *corners], np.array(speeds), n=600)
    found = drive_of_lines(x, 1.0 / RATE, slice(300, 600))
    assert (found is not None) is is_found
    if is_found:
        np.testing.assert_allclose(found.part(slice(300, 600), 0.0).jumps[:, 0], [3.0], atol=0.05)
    assert drive_of_lines(x, 1.0 / RATE, slice(0, 200)) is not None


def test_corners_of_a_noisy_sensor_are_found():
    """40 um: over 4 ms a turn by 0.16 m/s is six times that."""
    corners = np.array([400.4, 1100.7, 1800.2])
    x = zigzag(corners, np.array([0.08, -0.08, 0.08, -0.08]), n=2200, noise=4e-5)
    found = drive_of_lines(x, 1.0 / RATE, EVERY)
    np.testing.assert_allclose(found.jumps[:, 0], corners, atol=0.12)


def test_a_short_dwell_is_at_rest():
    """3 um over 20 ms would be 0.1 mm/s, at which friction slides one way with all its force."""
    x = zigzag([200.0, 220.0, 500.0, 520.0], np.array([0.1, 0.0, -0.1, 0.0, 0.1]), n=800)
    found = drive_of_lines(x, 1.0 / RATE, EVERY)
    assert found.jumps[:, 2:].min(axis=1).tolist()[::2] == [0.0, pytest.approx(-0.1, abs=1e-4)]
    assert not found.velocity[201:219].any()
    assert not found.velocity[501:519].any()


def test_what_does_not_move_in_lines_is_left_alone():
    time = np.arange(3000) / RATE
    sine = 0.03 * np.sin(2.0 * np.pi * 1.5 * time)
    for x in (sine, 0.1 * time, np.zeros(3000), np.maximum(sine, 0.0), zigzag()[:20]):
        assert drive_of_lines(x, 1.0 / RATE, EVERY) is None


def triangle_log(*, noise=3e-6):
    drive = triangles(0.1, 0.25, cycles=6)
    time = np.arange(round(RATE * drive.duration)) / RATE
    x, v = (np.array([f(t) for t in time.tolist()]) for f in (drive.displacement, drive.velocity))
    noisy = x + noise * np.random.default_rng(1).standard_normal(len(x))
    return recording(time, noisy, static_force(v))


def test_a_trace_of_a_triangle_has_its_corners_and_bridges_samples_on_them():
    log = triangle_log()
    trace = condition(log, ConditionOptions(centre=0.0))
    jumps, first = trace.drive.jumps, round(trace.start_time * RATE)
    assert np.all(np.diff(jumps[:, 0]) > 0.0)
    # The corners are at 0.32 and 0.128 s and their multiples.
    np.testing.assert_array_equal(jumps[:, 0], np.rint(jumps[:, 0]))
    assert trace.model_filter.bridged == tuple(jumps[:, 0].astype(int))
    force = log.force.copy()
    at = jumps[:, 0].astype(int) + first
    force[at] += 300.0
    other = condition(replace(log, force=force), ConditionOptions(centre=0.0))
    np.testing.assert_allclose(other.force, trace.force, rtol=1e-12)
    (said,) = [one for one in trace.findings if one.name == "drive"]
    assert said.severity == "note"
    assert said.sentence.endswith(f"turns where they cross, {len(jumps)} times")


@pytest.mark.parametrize("options", [ConditionOptions(filter="causal"), ConditionOptions()])
def test_other_filters_and_sines_have_no_corners(options):
    log = triangle_log() if options.filter == "causal" else sine_log()
    trace = condition(log, options)
    assert not len(trace.drive.jumps)
    assert trace.model_filter.bridged == ()


def test_a_bridged_sample_is_the_mean_of_its_neighbours():
    trace = condition(sine_log())
    signal = np.stack([trace.force, 2.0 * trace.force])
    design = replace(trace.model_filter, bridged=(100, 700))
    smooth = signal.copy()
    for k in (100, 700):
        smooth[:, k] = 0.5 * (smooth[:, k - 1] + smooth[:, k + 1])
        signal[:, k] = 1e6
    np.testing.assert_array_equal(
        apply_filter(design, signal), apply_filter(trace.model_filter, smooth)
    )
