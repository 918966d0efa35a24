"""An undeclared filter in the rig is remarked on; a raw log is not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import butter, sosfilt

from damperfit.conditioning import ConditionOptions, condition
from damperfit.conditioning.rig_filter import _fall
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
