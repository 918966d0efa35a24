"""A dwell drives the model at no speed; the crest of a slow sine is none."""

from __future__ import annotations

import numpy as np
import pytest

from damperfit.conditioning import ConditionOptions, condition
from damperfit.conditioning.drive import dwell_lengths, dwells_of
from tests.conditioning.logs import recording, static_force

RATE = 1000.0
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


def test_a_model_is_driven_without_noise_where_the_motion_rests():
    """Else friction turns with the noise: of rounded dwells R_m3 was 25 % and f_f 28 % off."""
    x, v = dwelling()
    log = recording(np.arange(len(x)) / RATE, x, static_force(v))
    trace = condition(log, ConditionOptions(centre=0.0))
    assert not len(trace.drive.jumps)
    (stretch,) = trace.stretches
    lengths = dwell_lengths(trace.drive.velocity[stretch.window])
    assert len(lengths) == pytest.approx(2 * stretch.n_cycles, abs=1)
    assert sorted(lengths)[1] >= 94
    first = round(trace.start_time * RATE)
    drawn = trace.drive.velocity == 0.0
    assert np.max(np.abs(v[first : first + len(drawn)][drawn])) <= 0.1
    (said,) = [one for one in trace.findings if one.name == "rests"]
    assert said.severity == "note"
    assert said.sentence == (
        f"the motion rests {len(lengths)} times where it is compared, for 0.096 s at most: what "
        "friction holds there is not known, and the model has none"
    )
