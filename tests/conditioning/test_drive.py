"""What drives the model: noise off, corners and dwells kept."""

from dataclasses import replace

import numpy as np
import pytest

from damperfit.conditioning import apply_filter, condition
from damperfit.conditioning.drive import drive_of_lines, dwells_of
from damperfit.conditioning.segments import transients
from damperfit.damper.purdy.parameters import PURDY_DAMPER, reference_parameters
from damperfit.identification import compare, normalised_mse
from damperfit.recording import Drive
from damperfit.simulation import Motion, SolverOptions, simulate
from tests.conditioning.logs import RATE, found, sine_log
from tests.identification.rig import recorded
from tests.oracles.motions import logged


def at_the_truth(trace, setting=10):
    seen = compare(
        reference_parameters(setting), trace, PURDY_DAMPER, solver=SolverOptions(tolerance=1e-3)
    )
    return normalised_mse(trace.force[trace.compared], seen.force[trace.compared])


@pytest.mark.parametrize("mains", [50.0, 60.0, 100.0])
@pytest.mark.parametrize(
    ("frequency", "cycles"), [(2.0, 3.2), (2.0, 4.2), (2.0, 15.0), (1.5, 15.0)]
)
def test_hum_is_no_motion(mains, frequency, cycles):
    """At 2 Hz the mains are an order of the motion, and one cycle does not part them at all."""
    log = sine_log(frequency=frequency, cycles=cycles)
    hum = 1e-3 / mains * np.sin(2.0 * np.pi * mains * log.time)
    noise = 1e-6 * np.random.default_rng(1).standard_normal(len(hum))
    trace = condition(replace(log, displacement=log.displacement + hum + noise))
    assert trace.drive.corner == 30.0


def test_a_triangle_keeps_its_corners():
    trace = condition(logged("triangle"))
    compared = Drive(trace.displacement, trace.velocity, 30.0)
    # 0.0003 % of that is the force's noise.
    assert at_the_truth(trace) < 0.0007
    assert at_the_truth(replace(trace, drive=compared)) > 0.1
    without_noise = condition(logged("triangle", force_noise=0.0, displacement_noise=0.0))
    assert at_the_truth(without_noise) < 0.0004


def test_a_run_up_from_rest_is_driven_with_its_break():
    """Triangles of 0.05 and 0.2 m/s between rests; behind 30 Hz their start missed 2.6 %."""
    turns = [np.arange(round(0.4 / v * RATE)) * v / 0.08 / RATE for v in (0.05, 0.2)]
    parts = [0.04 / np.pi * np.arcsin(np.sin(2.0 * np.pi * turn)) for turn in turns]
    x, rounding = np.concatenate([np.zeros(400), *parts, np.zeros(400)]), np.hanning(14)[1:-1]
    x = np.convolve(np.pad(x, 6, "edge"), rounding / rounding.sum(), "valid")
    motion = Motion(1.0 / RATE, x, np.gradient(x, 1.0 / RATE))
    force = simulate(reference_parameters(20), PURDY_DAMPER, motion).force
    beside = transients(condition(recorded(x, force, RATE, setting=20, noises=(3e-6, 2.0), seed=1)))
    assert at_the_truth(beside, 20) < 1.0


def noisy_sine(rate, phase, *, noise=3e-6):
    """A sine of 1.5 Hz; of 300 Hz it turns at a sample where the phase is a multiple of 1/200."""
    log = sine_log(rate=rate, phase=2.0 * np.pi * phase)
    x = log.displacement + noise * np.random.default_rng(1).standard_normal(len(log.time))
    return replace(log, displacement=x)


@pytest.mark.parametrize(
    ("rate", "phase", "is_bridged"),
    [(300.0, 0.13, True), (300.0, 0.1325, False), (500.0, 0.0, False), (1000.0, 0.0, False)],
)
def test_samples_at_which_a_sine_turns_are_bridged(rate, phase, is_bridged):
    """Noise decided their friction: at 300 Hz f_f was 2 % too small and R_m3 2 % too large."""
    trace = condition(noisy_sine(rate, phase))
    assert ("drive" in found(trace)) is is_bridged
    if not is_bridged:
        assert trace.model_filter.bridged == ()
        return
    at = np.array(trace.model_filter.bridged)
    speeds = np.abs(trace.velocity)
    assert np.max(speeds[at]) < 6e-4 < np.min(np.delete(speeds, at))
    assert found(trace)["drive"].values["value"] == len(at)


# A dwell drives the model at no speed; the crest of a slow sine is none.

NOISE = 3e-6


def dwelling(*, dwell=0.1, stroke=0.1, speed=0.2, width=6, cycles=12, noise=NOISE, rate=RATE):
    """Strokes at an even speed with a dwell between, whose corners are turned in some samples."""
    way = [speed, 0.0, -speed, 0.0] * cycles
    v = np.repeat(way, [round(rate * one) for one in (stroke, dwell)] * (2 * cycles))
    v = np.convolve(v, np.full(width, 1.0 / width), "same")
    x = np.concatenate([[0.0], np.cumsum(0.5 * (v[1:] + v[:-1]))]) / rate - 0.5 * stroke * speed
    return x + noise * np.random.default_rng(1).standard_normal(len(x)), v


@pytest.mark.parametrize("noise", [0.0, 3e-7, 3e-6, 2e-5])
@pytest.mark.parametrize("rate", [500.0, 1000.0, 5000.0])
def test_dwells_are_found_with_their_levels(noise, rate):
    x, v = dwelling(noise=noise, rate=rate)
    true, _ = dwelling(noise=0.0, rate=rate)
    found = dwells_of(x, 1.0 / rate)
    assert len(found) == 24
    for part, level in found:
        assert part.stop - part.start == pytest.approx(0.1 * rate, abs=12)
        # What lies within noise beside it is a few samples of a corner.
        assert np.count_nonzero(v[part]) <= 10
        assert level == pytest.approx(true[(part.start + part.stop) // 2], abs=1e-8 + noise)


@pytest.mark.parametrize(
    "step", [0.0, 1e-5, 1e-4], ids=["no steps", "steps of 10 um", "steps of 0.1 mm"]
)
@pytest.mark.parametrize("frequency", [0.1, 1.5])
@pytest.mark.parametrize("noise", [0.0, 3e-7, 3e-6, 3e-5])
def test_crests_of_sines_are_no_rests(frequency, noise, step):
    time = np.arange(0.0, 3.0 / frequency, 2e-4)
    x = 0.03 * np.sin(2.0 * np.pi * frequency * time)
    x += noise * np.random.default_rng(2).standard_normal(len(x))
    if step:
        x = step * np.round(x / step)
    assert dwells_of(x, 2e-4) == []


@pytest.mark.parametrize(("milliseconds", "is_found"), [(28, True), (17, False)])
def test_a_dwell_of_28_ms_is_a_rest_and_one_of_17_is_none(milliseconds, is_found):
    x, _ = dwelling(dwell=1e-3 * milliseconds, width=1)
    assert bool(dwells_of(x, 1e-3)) is is_found


# A motion of straight lines drives the model with corners between samples, and no other does.

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


@pytest.mark.parametrize(
    ("first", "apart", "rate", "is_found"),
    [
        (200, 13, 1000.0, True), (200, 12, 1000.0, False),  # 2 beside either corner, 10 are a line
        (900, 63, 5000.0, True), (900, 57, 5000.0, False),  # 4 ms to either side and between
    ],
)  # fmt: skip
def test_corners_near_each_other_have_a_line_between_them(first, apart, rate, is_found):
    speeds = np.array([0.2, -0.2, 0.2])
    x = zigzag([first, first + apart], speeds, n=3 * first, noise=0.0, rate=rate)
    assert (drive_of_lines(x, 1.0 / rate, EVERY) is not None) is is_found


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


def test_a_bridged_sample_is_the_mean_of_its_neighbours():
    trace = condition(sine_log())
    signal = np.stack([trace.force, 2.0 * trace.force])
    design = trace.model_filter._replace(bridged=(100, 700))
    smooth = signal.copy()
    for k in (100, 700):
        smooth[:, k] = 0.5 * (smooth[:, k - 1] + smooth[:, k + 1])
        signal[:, k] = 1e6
    np.testing.assert_array_equal(
        apply_filter(design, signal), apply_filter(trace.model_filter, smooth)
    )
