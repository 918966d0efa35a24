"""A dwell drives the model at no speed; the crest of a slow sine is none."""

from __future__ import annotations

import numpy as np
import pytest

from damperfit.conditioning import ConditionOptions, condition, rests
from damperfit.conditioning.rests import rests_of, samples_at_rest
from tests.conditioning.logs import recording, sine_log, static_force

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
    found = rests_of(x, 1.0 / rate)
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
    assert rests_of(x, 2e-4) == []


@pytest.mark.parametrize(("milliseconds", "is_found"), [(20, True), (19, False)])
def test_a_rest_has_20_ms(milliseconds, is_found):
    """Looks begin at every tenth of them, and so does the rest."""
    x = np.concatenate([np.full(90, 0.01), np.zeros(milliseconds), np.full(110, -0.01)])
    levels = [level for _, level in rests_of(x + np.linspace(0.0, 1e-12, len(x)), 1e-3)]
    assert any(abs(level) < 1e-6 for level in levels) is is_found


@pytest.mark.parametrize(("milliseconds", "is_found"), [(28, True), (17, False)])
def test_a_dwell_of_28_ms_is_a_rest_and_one_of_17_is_none(milliseconds, is_found):
    x, _ = dwelling(dwell=1e-3 * milliseconds, width=1)
    assert bool(rests_of(x, 1e-3)) is is_found


@pytest.mark.parametrize(("n", "is_found"), [(10, True), (9, False)])
def test_a_rest_has_ten_samples(n, is_found):
    """At 200 Hz; looks begin at every fifth sample."""
    x = np.concatenate([np.full(100, 0.01), np.zeros(n), np.full(100, -0.01)])
    levels = [level for _, level in rests_of(x + np.linspace(0.0, 1e-12, len(x)), 5e-3)]
    assert any(abs(level) < 1e-6 for level in levels) is is_found


def bent(n, form, errors):
    """A rest of so many samples with a slope or a bend of so many errors, far away beside it."""
    reach = np.linspace(-1.0, 1.0, n)
    shape = {"slope": reach, "bend": reach**2 - np.mean(reach**2)}[form]
    part = errors * NOISE * shape / np.linalg.norm(shape)
    wave = NOISE * np.tile([1.0, -1.0, -1.0, 1.0], 100)  # neither slope nor bend
    return np.concatenate([0.01 + wave, part + wave[:n], wave - 0.01])


@pytest.mark.parametrize("form", ["slope", "bend"])
@pytest.mark.parametrize(("errors", "is_found"), [(2.8, True), (3.2, False)])
def test_a_rest_has_neither_slope_nor_bend(form, errors, is_found, monkeypatch):
    monkeypatch.setattr(rests, "noise_of", lambda _: NOISE)
    x = bent(20, form, errors)
    assert any(part.start >= 395 and part.stop <= 425 for part, _ in rests_of(x, 1e-3)) is is_found


@pytest.mark.parametrize(("far", "is_left"), [(31.0, True), (29.0, False)])
def test_a_rest_is_come_to_and_left(far, is_left):
    x = np.zeros(300)
    x[:130] = x[170:] = far * NOISE
    assert rests._is_left(x, slice(100, 200), 0.0, NOISE) is is_left
    assert rests._is_left(x[:170], slice(100, 170), 0.0, NOISE) is is_left
    assert not rests._is_left(np.zeros(40), slice(0, 40), 0.0, NOISE)


@pytest.mark.parametrize(
    ("n", "share", "is_level"),
    [(32, 1.58, True), (32, 1.62, False), (20_000, 1.115, True), (20_000, 1.125, False)],
)
def test_a_rest_scatters_as_noise_does(n, share, is_level):
    part = share * NOISE * (-1.0) ** np.arange(n)
    assert rests._is_level(part, NOISE) is is_level


@pytest.mark.parametrize(("equal", "is_coarse"), [(12, True), (10, False), (8, False)])
def test_steps_count_where_a_tenth_of_the_samples_are_equal(equal, is_coarse):
    steps = np.ones(100)
    steps[:equal] = 0.0
    found = rests._of_steps(np.concatenate([[0.0], np.cumsum(1e-4 * steps)]))
    assert found == pytest.approx(1e-4 / np.sqrt(12.0) if is_coarse else 0.0)


@pytest.mark.parametrize(("share", "is_found"), [(1.68, True), (1.78, False)])
def test_rounding_is_noise(share, is_found, monkeypatch):
    """A millionth of the stroke, which 20 samples may exceed by 1.73."""
    monkeypatch.setattr(rests, "noise_of", lambda _: 0.0)
    part = share * 2e-8 * np.tile([1.0, -1.0, -1.0, 1.0], 5)
    x = np.concatenate([np.linspace(0.01, 0.0031, 400), part, np.linspace(-0.0031, -0.01, 400)])
    assert bool(rests_of(x, 1e-3)) is is_found


def test_a_model_is_driven_without_noise_where_the_motion_rests():
    """Else friction turns with the noise: of rounded dwells R_m3 was 25 % and f_f 28 % off."""
    x, v = dwelling()
    log = recording(np.arange(len(x)) / RATE, x, static_force(v))
    trace = condition(log, ConditionOptions(centre=0.0))
    assert not len(trace.drive.jumps)
    (stretch,) = trace.stretches
    lengths = samples_at_rest(trace.drive.velocity[stretch.window])
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


def test_a_sine_is_left_alone():
    trace = condition(sine_log())
    assert trace.drive.displacement is trace.displacement
    assert not [one for one in trace.findings if one.name == "rests"]
