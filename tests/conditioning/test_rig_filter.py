"""An undeclared filter in the rig is remarked on; a raw log is not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import butter, sosfilt

from damperfit.conditioning import ConditionOptions, condition
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


@pytest.mark.parametrize(
    ("order", "corner", "is_told"),
    [(1, 10.0, True), (1, 20.0, True), (4, 30.0, True), (2, 100.0, False), (4, 120.0, False)],
)
def test_a_force_that_is_smoothed_alone_is_told_where_it_does_harm(order, corner, is_told) -> None:
    raw = recording(10, noise=4.0)
    sections = butter(order, corner, fs=1000.0, output="sos")
    names = [
        one.name for one in condition(replace(raw, force=sosfilt(sections, raw.force))).findings
    ]
    assert ("force_smoothed" in names) is is_told
    assert "rig_filter" not in names


def test_a_running_mean_of_the_force_is_told() -> None:
    raw = recording(10, noise=4.0)
    mean = np.convolve(raw.force, np.full(25, 1.0 / 25.0))[: len(raw.force)]
    names = [one.name for one in condition(replace(raw, force=mean)).findings]
    assert "force_smoothed" in names
