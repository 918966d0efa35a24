"""Findings: each fault with number and place, and no other alarm."""

from __future__ import annotations

import itertools
import re
from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import butter, sosfilt

from damperfit.conditioning import (
    ConditionOptions,
    NominalTest,
    apply_filter,
    condition,
    differentiate,
    examine_raw,
)
from damperfit.conditioning.duplicates import copies_in
from damperfit.damper.purdy.closed_forms import incompressible_force
from damperfit.damper.purdy.parameters import PURDY_DAMPER
from damperfit.damper.purdy.reference import reference_parameters
from damperfit.errors import ConditioningError
from damperfit.recording import Finding, Recording
from tests.conditioning import logs
from tests.conditioning.logs import sine_log, static_force
from tests.identification.rig import recording

TEST = NominalTest(frequency=1.5, amplitude=0.032, temperature=26.0, temperature_tolerance=1.0)
OPTIONS = ConditionOptions(nominal=TEST)


def moved(wave, t, *, frequency=1.5, amplitude=0.032, phase=1.1):
    """Displacement and velocity of a test."""
    w = 2 * np.pi * frequency
    a = w * t + phase
    if wave == "triangle":
        x = amplitude * 2 / np.pi * np.arcsin(np.sin(a))
        return x, amplitude * 2 / np.pi * w * np.sign(np.cos(a))
    crank = 0.03 if wave == "crank" else 0.0
    x = amplitude * (np.sin(a) + crank * np.cos(2 * a))
    return x, amplitude * w * (np.cos(a) - 2 * crank * np.sin(2 * a))


def made(
    wave="sine", *, setting=10, rate=500.0, noise=(4.0, 8e-6), bits=0, seed=1, cycles=15, **test
):
    """A log of the incompressible damper, with noise and a converter."""
    random = np.random.default_rng(seed)
    t = np.arange(round(cycles / test.get("frequency", 1.5) * rate)) / rate
    x, v = moved(wave, t, phase=random.uniform(0.0, 6.0), **test)
    f = incompressible_force(reference_parameters(setting), PURDY_DAMPER, x, v)
    f = f + noise[0] * random.normal(size=len(t))
    x = x + noise[1] * random.normal(size=len(t))
    if bits:
        x, f = (np.rint(s / q) * q for s, q in ((x, 0.1 / 2**bits), (f, 1.5 * np.ptp(f) / 2**bits)))
    return Recording("log.csv", "log.csv", "", setting, t, x, f, np.full(len(t), 26.0))


def warned(recording, options=OPTIONS) -> dict[str, Finding]:
    return {one.name: one for one in condition(recording, options).findings if _warns(one)}


def _warns(one: Finding) -> bool:
    # A delay is estimated, not looked up: tests/conditioning/test_skew.py holds its rates.
    return one.severity == "warning" and one.name != "skew"


def with_(recording, channel, values):
    return replace(recording, **{channel: values})


def clipped(recording, channel, share):
    values = getattr(recording, channel)
    return with_(recording, channel, np.minimum(values, share * values.max()))


def standing(recording, channel, first, n):
    values = getattr(recording, channel).copy()
    values[first : first + n] = values[first]
    return with_(recording, channel, values)


def held(recording, channel, n):
    values = getattr(recording, channel)
    return with_(recording, channel, values[np.arange(len(values)) // n * n])


def rounded(recording, channel, n_steps):
    values = getattr(recording, channel)
    step = np.ptp(values) / n_steps
    return with_(recording, channel, np.rint(values / step) * step)


def spiked(recording, channel, rows, size):
    values = getattr(recording, channel).copy()
    values[rows] += size * np.ptp(values)
    return with_(recording, channel, values)


def drifting(recording, channel, share):
    values = getattr(recording, channel)
    u = np.linspace(-0.5, 0.5, len(values))
    return with_(recording, channel, values + share * 0.5 * np.ptp(values) * u)


def scattered(recording, share):
    """Each cycle has its own size of force."""
    cycle = (recording.time * 1.5).astype(int)
    sizes = 1.0 + share * np.random.default_rng(5).normal(size=cycle.max() + 1)
    return replace(recording, force=recording.force * sizes[cycle])


def wrongly_stamped(recording, share):
    random = np.random.default_rng(3)
    moved_by = random.uniform(-share, share, len(recording.time)) * 0.002
    return replace(recording, time=recording.time + moved_by)


def at(recording, temperature):
    return replace(recording, temperature=temperature)


LOG = made()
RAMP = np.linspace(-1.5, 1.5, len(LOG.time))
FAULTS = {
    "clipped force": (clipped(LOG, "force", 0.95), "force_clipping", "clipped at"),
    "force in kN called N": (
        replace(LOG, force=LOG.force / 1000.0),
        "force_range",
        "was kN read as N",
    ),
    "clipped displacement": (clipped(LOG, "displacement", 0.97), "displacement_clipping", "row"),
    "force at 12 bits clipped": (
        clipped(made(bits=12, noise=(0.0, 0.0)), "force", 0.95),
        "force_clipping",
        "% of the evaluated samples",
    ),
    "stuck force": (standing(LOG, "force", 2000, 40), "force_stuck", "from row 2001 .* 40 rows"),
    "stuck displacement": (
        standing(LOG, "displacement", 2030, 20),
        "displacement_stuck",
        "check sensor",
    ),
    "slow displacement": (held(LOG, "displacement", 10), "displacement_stuck", "every 10 rows"),
    "coarse displacement": (
        rounded(LOG, "displacement", 200),
        "displacement_steps",
        r"20\d over its range",
    ),
    "coarse force": (rounded(made(noise=(0.0, 0.0)), "force", 60), "force_steps", "finer"),
    "spikes in force": (
        spiked(LOG, "force", [1500, 2222, 3000], 0.5),
        "force_spikes",
        "3 spikes in the force, in rows 1501, 2223, 3001 of the data",
    ),
    "spike in displacement": (
        spiked(LOG, "displacement", [2500], -0.4),
        "displacement_spikes",
        "1 spike in the displacement, in row 2501",
    ),
    "force that drifts": (drifting(LOG, "force", 0.04), "force_drift", "drifts by"),
    "stroke that drifts": (drifting(LOG, "displacement", 0.1), "stroke_drift", "mid-stroke"),
    "force that scatters": (scattered(LOG, 0.04), "cycle_scatter", "1 % or less"),
    "noisy displacement": (made(noise=(4.0, 6e-5)), "displacement_noise", "K_e"),
    "stamps of the computer": (wrongly_stamped(LOG, 0.2), "jitter", "smoother without"),
    "hot": (at(LOG, LOG.temperature + 2.3), "temperature", r"28\.3 degC .* outside 25 to 27"),
    "warming": (at(LOG, 26.0 + RAMP), "temperature_drift", "within the run"),
    "no temperature": (at(LOG, None), "temperature_missing", "no temperature"),
    "another frequency than said": (
        replace(LOG, metadata={"test frequency": "1.6 Hz"}),
        "frequency",
        "preamble says 1.6 Hz",
    ),
    "another amplitude than said": (
        replace(LOG, metadata={"amplitude_mm": "25"}),
        "amplitude",
        "preamble says 25 mm",
    ),
    "fast": (
        made(frequency=20.0, cycles=60, amplitude=0.004, noise=(4.0, 0.0)),
        "filter_loss",
        "raise its corner",
    ),
    "few samples a cycle": (
        made(rate=100.0, frequency=20.0, cycles=90, amplitude=0.004, noise=(0.0, 0.0)),
        "sample_rate",
        "% low",
    ),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_is_found_with_number_and_place(fault):
    recording, name, says = FAULTS[fault]
    found = warned(recording)
    assert name in found
    assert re.search(says, found[name].sentence), found[name].sentence
    if name != "temperature_missing":
        assert found[name].value is not None


@pytest.mark.parametrize("fault", sorted(FAULTS))
def test_a_fault_raises_no_other_alarm(fault):
    recording, name, _ = FAULTS[fault]
    # What one fault does to another number is no false alarm.
    shadows = {
        "few samples a cycle": {"filter_loss"},
        "coarse displacement": {"displacement_noise"},
        "stamps of the computer": {"displacement_noise"},
        "spikes in force": {"cycle_scatter"},
        "stuck force": {"force_smoothed"},
        "slow displacement": {"displacement_noise", "displacement_steps"},
    }
    assert set(warned(recording)) <= {name} | shadows.get(fault, set())


CLEAN = [
    (rate, wave, noise, bits)
    for rate, wave, noise, bits in itertools.product(
        (300.0, 1000.0, 5000.0),
        ("sine", "triangle", "crank"),
        ((0.0, 0.0), (4.0, 8e-6)),
        (0, 12, 16),
    )
]


@pytest.mark.one_in(5)
@pytest.mark.parametrize(("rate", "wave", "noise", "bits"), CLEAN)
def test_a_clean_log_gives_no_warning(rate, wave, noise, bits):
    setting = 1 if bits else 20
    recording = made(wave, setting=setting, rate=rate, noise=noise, bits=bits, cycles=7)
    assert warned(recording) == {}


@pytest.mark.slow
@pytest.mark.parametrize("setting", range(1, 21))
def test_clean_logs_of_every_setting_rate_and_seed(setting):
    for seed, (rate, wave, noise, bits) in enumerate(CLEAN):
        recording = made(wave, setting=setting, rate=rate, noise=noise, bits=bits, seed=seed)
        assert warned(recording) == {}, (rate, wave, noise, bits)


def test_notes_carry_the_numbers():
    found = {one.name: one for one in condition(made("crank"), OPTIONS).findings}
    assert found["harmonics"].value == pytest.approx(3.0, abs=0.05)
    assert "as of a crank" in found["harmonics"].sentence
    assert found["frequency"].value == pytest.approx(1.5, rel=1e-4)
    assert found["amplitude"].value == pytest.approx(32.0, abs=0.05)
    assert found["displacement_noise"].value == pytest.approx(8.0, rel=0.1)
    assert found["sample_rate"].value == pytest.approx(500.0)
    assert found["cycles"].value >= 12
    assert 0.7 < found["trimmed"].value < 3.0
    assert found["cycle_scatter"].value < 0.5
    assert found["temperature"].value == 26.0
    assert all(one.severity == "note" for one in found.values())


def test_a_triangle_is_known_by_its_harmonics():
    (one,) = (f for f in condition(made("triangle")).findings if f.name == "harmonics")
    assert one.value == pytest.approx(11.1, abs=0.2)
    assert "triangle" in one.sentence


def test_stamps_that_are_right_are_a_note_however_uneven():
    t = LOG.time + np.random.default_rng(4).uniform(-0.3, 0.3, len(LOG.time)) * 0.002
    x, v = moved("sine", t)
    f = incompressible_force(reference_parameters(10), PURDY_DAMPER, x, v)
    recording = replace(LOG, time=t, displacement=x, force=f)
    (one,) = (o for o in condition(recording, OPTIONS).findings if o.name == "jitter")
    assert one.severity == "note"
    assert "jitter" not in warned(recording)


def test_spikes_are_bridged_only_when_declared():
    recording, _, _ = FAULTS["spikes in force"]
    clean, kept = condition(LOG, OPTIONS), condition(recording, OPTIONS)
    bridged = condition(recording, replace(OPTIONS, spikes="bridge"))
    (one,) = (o for o in bridged.findings if o.name == "force_spikes_bridged")
    assert (one.severity, one.value) == ("note", 3.0)
    assert bridged.warnings == ()

    def off(trace):
        return np.abs(trace.force - clean.force).max()

    assert off(bridged) < 3.0
    assert off(kept) > 60.0


def test_a_force_spike_beyond_the_limits_of_a_log_is_bridged_too():
    force = LOG.force.copy()
    force[2345] = 4e5
    recording = replace(LOG, force=force)
    with pytest.raises(ConditioningError, match="expected at most"):
        condition(recording, OPTIONS)
    clean = condition(LOG, OPTIONS)
    bridged = condition(recording, replace(OPTIONS, spikes="bridge"))
    assert bridged.force.shape == clean.force.shape
    assert np.abs(bridged.force - clean.force).max() < 3.0


def test_a_feature_of_every_cycle_is_no_spike():
    phase = np.mod(LOG.time * 1.5, 1.0)
    knock = LOG.force + 600.0 * (np.abs(phase - 0.3) < 0.0015)
    assert "force_spikes" not in warned(replace(LOG, force=knock))


def test_rest_at_the_end_of_the_stroke_is_no_clipping_and_no_stand():
    t = np.arange(9000) / 500.0
    x, v = moved("sine", t - 4.0, phase=-0.5 * np.pi)
    is_rest = t < 4.0
    x, v = np.where(is_rest, -0.032, x), np.where(is_rest, 0.0, v)
    f = incompressible_force(reference_parameters(10), PURDY_DAMPER, x, v)
    recording = Recording("log.csv", "log.csv", "", 1, t, x, f, np.full(9000, 26.0))
    assert warned(recording) == {}
    assert not [one for one in examine_raw(recording) if _warns(one)]
    (one,) = (o for o in condition(recording, OPTIONS).findings if o.name == "trimmed")
    assert one.value > 4.0


def test_unsteady_cycles_are_told():
    t = np.arange(15_000) / 500.0
    size = np.where((t > 10) & (t < 21), 1.0, 1.0 + 0.3 * np.sin(2 * np.pi * 0.37 * t))
    recording = Recording(
        "log.csv", "log.csv", "", 1, t, 0.03 * size * np.sin(3 * np.pi * t), np.cos(3 * np.pi * t)
    )
    finding = warned(recording, ConditionOptions())["unsteady_cycles"]
    (steady, found) = map(int, re.findall(r"only (\d+) of (\d+) cycles", finding.sentence)[0])
    assert found == 45
    assert 15 <= steady <= 17  # 11 s at 1.5 Hz; crossings used to be counted, one more
    assert finding.value == pytest.approx(100.0 * (1.0 - steady / found))


@pytest.mark.parametrize("rate", [500.0, 1000.0])
def test_the_noise_told_is_that_of_the_velocity_behind_the_filter(rate):
    """Beside noise that is filtered and differentiated; the formula has a wall at the corner."""
    log = made(noise=(4.0, 40e-6), rate=rate)
    trace = condition(log, OPTIONS)
    noise = 40e-6 * np.random.default_rng(5).normal(size=200_000)
    seen = differentiate(apply_filter(trace.model_filter, noise), 1.0 / rate)[2000:-2000]
    share = 100.0 * np.std(seen) / (2 * np.pi * 1.5 * 0.032)
    (sentence,) = (o.sentence for o in trace.findings if o.name == "displacement_noise")
    told = float(re.findall(r"um, ([\d.]+) % of the peak velocity", sentence)[0])
    assert told == pytest.approx(share, rel=0.1)


@pytest.mark.parametrize(("noise", "severity"), [(0.3, "warning"), (0.6, "note"), (1.2, "note")])
def test_noise_of_half_a_step_turns_coarse_steps_of_the_force_into_scatter(noise, severity):
    log = made(noise=(0.0, 8e-6))
    step = np.ptp(log.force) / 60.0
    blurred = log.force + noise * step * np.random.default_rng(2).normal(size=len(log.force))
    trace = condition(with_(log, "force", step * np.rint(blurred / step)), OPTIONS)
    (found,) = (o for o in trace.findings if o.name == "force_steps")
    assert found.severity == severity


# Rows that a logger repeats while it drops out; a rest of the rig is none.


def frozen(log, rows: int):
    x, force = log.displacement.copy(), log.force.copy()
    for first in range(1000, 9000, 1000):
        x[first : first + rows], force[first : first + rows] = x[first], force[first]
    return replace(log, displacement=x, force=force)


def warnings(log):
    return [found.name for found in condition(log).findings if found.severity == "warning"]


@pytest.mark.parametrize(("rows", "is_told"), [(30, True), (4, False)])
def test_frozen_rows_are_told(rows, is_told):
    assert ("frozen_rows" in warnings(frozen(sine_log(), rows))) is is_told


def test_a_rest_of_the_rig_is_not_frozen():
    time = np.arange(8000) / 1000.0
    x = 0.032 * np.sin(3.0 * np.pi * np.clip(time - 1.0, 0.0, None))
    log = logs.recording(time, x, static_force(np.gradient(x, time)))
    assert "frozen_rows" not in warnings(log)


# An undeclared filter in the rig is remarked on; a raw log is not.


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


# A copy is told by its noise: tests of an adjuster that does nothing are tests of their own.


def noisy(seed: int, newtons: float = 0.3):
    log = sine_log(rate=500.0)
    random = np.random.default_rng(seed)
    force = log.force + newtons * random.standard_normal(len(log.force))
    displacement = log.displacement + 2e-6 * random.standard_normal(len(log.force))
    return replace(log, name=f"log_{seed}.csv", displacement=displacement, force=force)


@pytest.mark.parametrize("newtons", [0.2, 1.0, 4.0])
def test_the_same_motion_recorded_twice_is_no_copy(newtons):
    traces = [condition(noisy(seed, newtons)) for seed in (1, 2, 3)]
    assert not copies_in(traces, {trace.name: trace.name for trace in traces})


@pytest.mark.parametrize("digits", [1, 2, 6])
def test_a_copy_of_fewer_digits_is_found(digits):
    log = noisy(1)
    copy = replace(log, name="copy.csv", force=np.round(log.force, digits))
    traces = [condition(log), condition(copy)]
    assert list(copies_in(traces, {trace.name: trace.name for trace in traces})) == ["log_1.csv"]
