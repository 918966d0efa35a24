"""An undeclared filter in the rig is remarked on; a raw log is not."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.signal import butter, sosfilt

from damperfit.conditioning import ConditionOptions, condition, quality, rig_filter
from damperfit.conditioning.rig_filter import _fall, _more_below, falls_off
from tests.conditioning import logs
from tests.identification.rig import recording


@pytest.mark.parametrize("rate", [300.0, 1000.0])
@pytest.mark.parametrize("setting", [1, 20])
def test_a_raw_log_is_not_suspected(setting: int, rate: float) -> None:
    assert condition(recording(setting, noise=4.0, rate=rate)).warnings == ()
    assert condition(recording(setting, noise=0.5, rate=rate)).warnings == ()


@pytest.mark.parametrize("corner", [30.0, 60.0])
def test_a_filtered_log_is_suspected_until_it_is_declared(corner: float) -> None:
    raw = recording(10, noise=4.0)
    sections = butter(4, corner, fs=1000.0, output="sos")
    log = replace(
        raw,
        displacement=sosfilt(sections, raw.displacement),
        force=sosfilt(sections, raw.force),
    )
    assert "rig.filter" in condition(log).warnings[0]
    declared = ConditionOptions(rig_filter="causal", rig_filter_corner=corner)
    assert condition(log, declared).warnings == ()


def test_the_noise_far_above_the_motion_is_looked_at_alone() -> None:
    """White noise with the motion's own lines: level by level the same near and far."""
    rng = np.random.default_rng(1)
    noise = rng.standard_normal(20_000)
    assert _fall(noise, 1e-3, 1.5) == pytest.approx(1.0, abs=0.15)
    quiet = sosfilt(butter(4, 60.0, fs=1000.0, output="sos"), noise)
    assert _fall(quiet, 1e-3, 1.5) > 1e3
    assert _fall(noise[:50], 1e-3, 1.5) == 0.0


def test_lines_between_the_motion_and_the_far_ones_do_not_count() -> None:
    """Near the motion a level of 100, far above it 1; a resonance between them and above both."""
    frequency = np.fft.rfftfreq(4000, 1e-3)
    level = np.full(len(frequency), 1e4)
    level[(frequency > 10.0) & (frequency < 30.0)] = 100.0
    level[(frequency > 290.0) & (frequency < 452.0)] = 1.0
    turns = np.exp(2j * np.pi * np.random.default_rng(6).random(len(frequency)))
    signal = np.fft.irfft(level * turns, 4000)
    assert _fall(signal, 1e-3, 10.0) == pytest.approx(1e4, rel=0.5)


def wandering(*, force_noise=4.0, corner=0.0, rate=1000.0):
    """A random motion to 3 Hz and the force of a damper with friction, raw or behind a filter."""
    random = np.random.default_rng(2)
    time = np.arange(round(15.0 * rate)) / rate
    rates = np.arange(0.2, 3.0, 1.0 / 15.0)
    phases = 2.0 * np.pi * (rates[:, None] * time + random.random((len(rates), 1)))
    sizes = 0.01 * random.standard_normal(len(rates)) / np.sqrt(rates)
    x, v = sizes @ np.sin(phases), (2.0 * np.pi * rates * sizes) @ np.cos(phases)
    log = logs.recording(time, x, logs.static_force(v))
    noise = random.standard_normal((2, len(time)))
    channels = np.stack([x, log.force]) + np.array([[3e-6], [force_noise]]) * noise
    if corner:
        sections = butter(2, corner, fs=rate, output="sos")
        begin = channels[:, :1]
        channels = begin + sosfilt(sections, channels - begin)
    return replace(log, displacement=channels[0], force=channels[1])


@pytest.mark.parametrize("corner", [30.0, 60.0, 100.0])
def test_a_filtered_motion_that_does_not_repeat_is_suspected(corner: float) -> None:
    """Its noise is read far above the motion, where that filter has taken it away."""
    log = wandering(corner=corner)
    warnings = [one for one in condition(log).findings if one.name == "rig_filter"]
    assert [one.severity for one in warnings] == ["warning"]
    assert "errors are too small: noise is read where that filter" in warnings[0].sentence
    declared = ConditionOptions(rig_filter="causal", rig_filter_corner=corner)
    assert not [one for one in condition(log, declared).findings if one.name == "rig_filter"]


@pytest.mark.parametrize("force_noise", [0.3, 4.0])
def test_a_raw_motion_that_does_not_repeat_is_not_suspected(force_noise: float) -> None:
    log = wandering(force_noise=force_noise)
    assert not [one for one in condition(log).findings if one.name == "rig_filter"]


def falling(ratio: float, *, n: int = 4000) -> np.ndarray:
    """Noise at 1 kHz of which so many times more lies between 150 and 200 than 400 and 450 Hz."""
    frequency = np.fft.rfftfreq(n, 1e-3)
    level = np.where(frequency > 390.0, 1.0, np.sqrt(ratio))
    turns = np.exp(2j * np.pi * np.random.default_rng(6).random(len(frequency)))
    return np.fft.irfft(level * turns, n)


@pytest.mark.parametrize(
    ("x", "force", "falls"), [(4.3, 43.0, True), (3.7, 43.0, False), (4.3, 37.0, False)]
)
def test_noise_of_both_channels_falls_off(
    x: float, force: float, *, falls: bool, monkeypatch
) -> None:
    monkeypatch.setattr(rig_filter, "_window", np.ones)
    assert falls_off(falling(x), falling(force), 1e-3) is falls


@pytest.mark.parametrize(("rate", "is_told"), [(410.0, True), (390.0, False)])
def test_noise_is_looked_at_above_60_hz(rate: float, *, is_told: bool) -> None:
    assert falls_off(falling(50.0), falling(500.0), 1.0 / rate) is is_told


@pytest.mark.parametrize(("n", "is_told"), [(1020, True), (976, False)])
def test_noise_takes_fifty_lines(n: int, *, is_told: bool) -> None:
    assert falls_off(falling(50.0, n=n), falling(500.0, n=n), 1e-3) is is_told


def test_noise_is_read_from_015_to_02_and_from_04_to_045_of_the_rate(monkeypatch) -> None:
    """Of a level that rises evenly the medians are those of the bands' middles."""
    monkeypatch.setattr(rig_filter, "_window", np.ones)
    signal = np.fft.irfft(np.arange(2001.0), 4000)
    assert _more_below(signal, 1e-3) == pytest.approx((0.175 / 0.425) ** 2, rel=0.005)


@pytest.mark.parametrize(
    ("stretches", "looked_at"),
    [
        ([(250, 700, 4)], [0, 999]),
        ([(0, 200, 4), (250, 700, 4)], [350, 799]),  # samples of the log, 100 before the trace
        ([(0, 600, 0), (650, 700, 4)], [750, 799]),
    ],
)
def test_of_several_motions_the_longest_is_looked_at_alone(
    stretches, looked_at, monkeypatch
) -> None:
    """What lies between them is at another speed: no lines of one frequency."""
    log = SimpleNamespace(
        start_time=5.0, interval=0.01, displacement=np.arange(1000), force=np.arange(1000.0)
    )
    parts = tuple(
        SimpleNamespace(first=first, stop=stop, n_samples=stop - first, n_cycles=n, frequency=1.0)
        for first, stop, n in stretches
    )
    seen = []
    monkeypatch.setattr(quality, "looks_filtered", lambda x, *_: seen.append(x))
    trace = SimpleNamespace(start_time=6.0, stretches=parts)
    assert list(quality._rig_filter(log, trace, ConditionOptions())) == []
    (rows,) = seen
    assert [rows[0], rows[-1]] == looked_at
