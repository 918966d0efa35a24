"""Findings: each fault at its limit, with number and place, and no alarm on what is sound."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import butter, sosfilt

from damperfit.conditioning import (
    ConditionOptions,
    NominalTest,
    condition,
    examine_raw,
)
from damperfit.conditioning.duplicates import copies_in
from damperfit.configuration.loading import load_configuration
from damperfit.damper.purdy.parameters import (
    PURDY_DAMPER,
    incompressible_force,
    reference_parameters,
)
from damperfit.errors import ConditioningError
from tests.conditioning.logs import (
    RATE,
    changed,
    found,
    logged,
    made,
    moved,
    moving,
    random_motion,
    recording,
    sine,
    sine_log,
    static_force,
    warned,
)
from tests.identification.rig import recording as rig_log

TEST = NominalTest(frequency=1.5, amplitude=0.032, temperature=26.0, temperature_tolerance=1.0)
OPTIONS = ConditionOptions(nominal=TEST)


def spiked(log, channel, rows, size):
    def change(values):
        values[rows] += size * np.ptp(values)
        return values

    return changed(log, channel, change)


LOG, STILL, SINE = made(), made(noise=(0.0, 0.0)), sine_log()
# Finding: what spoils a log by so much; the most that is no warning, the least that is one.


CLEAN = list(
    itertools.product(
        (300.0, 1000.0, 5000.0),
        ("sine", "triangle", "crank"),
        ((0.0, 0.0), (4.0, 8e-6)),
        (0, 12, 16),
    )
)


@pytest.mark.one_in(5)
@pytest.mark.parametrize(("rate", "wave", "noise", "bits"), CLEAN)
def test_a_clean_log_gives_no_warning(rate, wave, noise, bits):
    setting = 1 if bits else 20
    assert not warned(
        made(wave, setting=setting, rate=rate, noise=noise, bits=bits, cycles=7), OPTIONS
    )


def test_spikes_are_bridged_only_when_declared():
    """Also where one is beyond the limits of a log."""
    clean, bridge = condition(LOG, OPTIONS), OPTIONS.but(spikes="bridge")
    log = spiked(LOG, "force", [1500, 2222, 3000], 0.5)
    bridged = condition(log, bridge)
    told = found(bridged)["force_spikes_bridged"]
    assert (told.severity, told.values["value"]) == ("note", 3.0)
    assert bridged.warnings == ()
    assert np.abs(bridged.force - clean.force).max() < 3.0
    assert np.abs(condition(log, OPTIONS).force - clean.force).max() > 60.0
    far = changed(LOG, "force", lambda force: np.where(np.arange(len(force)) == 2345, 4e5, force))
    with pytest.raises(ConditioningError, match="expected at most"):
        condition(far, OPTIONS)
    assert np.abs(condition(far, bridge).force - clean.force).max() < 3.0


def test_a_feature_of_every_cycle_is_no_spike():
    knock = 600.0 * (np.abs(np.mod(LOG.time * 1.5, 1.0) - 0.3) < 0.0015)
    assert "force_spikes" not in warned(replace(LOG, force=LOG.force + knock), OPTIONS)


def test_rest_at_the_end_of_the_stroke_is_no_clipping_and_no_stand():
    t = np.arange(9000) / 500.0
    x, v = moved("sine", t - 4.0, phase=-0.5 * np.pi)
    x, v = np.where(t < 4.0, -0.032, x), np.where(t < 4.0, 0.0, v)
    f = incompressible_force(reference_parameters(10), PURDY_DAMPER, x, v)
    log = recording(t, x, f, temperature=np.full(9000, 26.0))
    assert not warned(log, OPTIONS)
    assert not [one for one in examine_raw(log) if one.severity == "warning"]
    assert found(log, OPTIONS)["trimmed"].values["value"] > 4.0
    # Nor is it frozen.
    assert "frozen_rows" not in warned(moving(0.032 * np.sin(3 * np.pi * np.maximum(t - 1, 0))))


@pytest.mark.parametrize("channel", ["displacement", "force"])
def test_one_channel_that_is_frozen_amid_the_motion_is_told(channel):
    log = sine_log(cycles=16.0, rate=500.0)  # no cycle is found where the displacement stands

    def froze(values):
        values[1500:2600] = values[1500]
        return values

    assert "row 1501 " in str(warned(changed(log, channel, froze))["frozen_rows"])
    # A rest in which the force decays stands for as long.
    assert "frozen_rows" not in warned(logged(dwelling(), relaxing, steps=(1e-6, 0.0)))


# An undeclared filter in the rig is remarked on; a raw log is not.


def behind(log, order, corner, *, both=True):
    """A log behind a filter of its rig, or its force alone."""
    rate = 1.0 / (log.time[1] - log.time[0])
    sections = butter(order, corner, fs=rate, output="sos")

    def seen(values):
        return values[0] + sosfilt(sections, values - values[0])

    x = seen(log.displacement) if both else log.displacement
    return replace(log, displacement=x, force=seen(log.force))


@pytest.mark.parametrize("rate", [300.0, 1000.0])
@pytest.mark.parametrize("setting", [1, 20])
def test_a_raw_log_is_not_suspected(setting, rate) -> None:
    assert condition(rig_log(setting, noise=4.0, rate=rate)).warnings == ()
    assert condition(rig_log(setting, noise=0.5, rate=rate)).warnings == ()


def wandering(*, force_noise=4.0, rate=1000.0):
    """A log of random motion of the damper with friction."""
    t, x, v = random_motion(2, highest=3.0, rate=rate, duration=15.0)
    noise = np.random.default_rng(2).standard_normal((2, len(t)))
    return recording(t, 0.5 * x + 3e-6 * noise[0], static_force(0.5 * v) + force_noise * noise[1])


@pytest.mark.parametrize("corner", [30.0, 60.0, 100.0])
@pytest.mark.parametrize("does_repeat", [True, False])
def test_a_filtered_log_is_suspected_until_it_is_declared(corner, does_repeat) -> None:
    if does_repeat and corner > 60.0:
        return
    log = (
        behind(rig_log(10, noise=4.0), 4, corner) if does_repeat else behind(wandering(), 2, corner)
    )
    told = found(log)["rig_filter"]
    assert told.severity == "warning"
    # Where nothing repeats its noise is read far above the motion, where the filter has taken it.
    assert ("errors are too small" in str(told)) is not does_repeat
    declared = ConditionOptions(rig_filter="causal", rig_filter_corner=corner)
    assert "rig_filter" not in found(log, declared)


@pytest.mark.parametrize(("share", "is_lost"), [(1.9, False), (2.1, True)])
def test_a_motion_of_which_the_rigs_filter_takes_two_per_cent_is_told(share, is_lost) -> None:
    beside = 0.01 * share * 1.5 / 21.0 * np.max(LOG.displacement)
    more = beside * np.sin(2.0 * np.pi * 21.0 * LOG.time)
    log = replace(LOG, displacement=LOG.displacement + more)
    drive = found(log, ConditionOptions(rig_filter="causal", rig_filter_corner=30.0)).get("drive")
    assert (drive is not None) is is_lost
    assert drive is None or drive.values["value"] == pytest.approx(share, rel=0.05)


@pytest.mark.parametrize("force_noise", [0.3, 4.0])
def test_a_raw_motion_that_does_not_repeat_is_not_suspected(force_noise) -> None:
    assert "rig_filter" not in found(wandering(force_noise=force_noise))


# A copy is told by its noise: tests of an adjuster that does nothing are tests of their own.


def noisy(seed, newtons=0.3):
    log = sine_log(rate=500.0)
    random = np.random.default_rng(seed)
    force = log.force + newtons * random.standard_normal(len(log.force))
    displacement = log.displacement + 2e-6 * random.standard_normal(len(log.force))
    return replace(log, name=f"log_{seed}.csv", displacement=displacement, force=force)


@pytest.mark.parametrize("newtons", [0.2, 1.0, 4.0])
def test_the_same_motion_recorded_twice_is_no_copy(newtons):
    traces = [condition(noisy(seed, newtons)) for seed in (1, 2, 3)]
    assert not copies_in(traces, {trace.name: trace.name for trace in traces})


# What sound logs show and was taken for a fault, each beside the true fault of that name.


def opening(rebound, bump):
    """Valves that open at 20 mm/s at so many newtons, and 130 N of gas."""

    def law(_, v):
        stiff = np.where(v > 0.0, rebound, bump) * np.tanh(v / 0.02)
        return stiff + 1200.0 * v + 25.0 * np.tanh(v / 2e-3) - 130.4

    return law


@pytest.mark.parametrize("frequency", [1.0, 1.5, 2.0, 4.0, 7.0, 10.0])
@pytest.mark.parametrize("forces", [(0.0, 0.0), (300.0, 180.0), (900.0, 300.0), (300.0, 700.0)])
def test_valves_that_open_early_are_no_tare(frequency, forces):
    """Unlike knees, and what a filter of 30 Hz leaves of 10 Hz, look like a level of the force."""
    with_gas = load_configuration().conditioning
    x, law = sine(frequency, min(0.03, 0.3 / (2.0 * np.pi * frequency)), 12), opening(*forces)
    tare = found(logged(x, law, noise=(2e-6, 3.0)), with_gas)["tare"]
    assert tare.severity == "note", str(tare)
    if (frequency in {1.0, 2.0, 4.0} and forces == (0.0, 0.0)) or (frequency, *forces) == (
        1.0,
        300.0,
        180.0,
    ):
        tared = logged(x, lambda x, v: law(x, v) + 130.4, noise=(2e-6, 3.0))
        tare = found(tared, with_gas)["tare"]
        assert tare.severity == "warning"
        assert "gas force tared away" in str(tare)


def relaxing(_, v):
    """A force that follows the motion, and dies out at rest, within 30 ms."""
    force, now = np.empty(len(v)), 0.0
    for k, wanted in enumerate(static_force(v)):
        now += (wanted - now) / (0.03 * RATE)
        force[k] = now
    return force


def static(_, v):
    return static_force(v)


@pytest.mark.parametrize("n", [3, 4])
def test_equal_samples_at_a_smooth_crest_are_no_clipping(n):
    log = logged(sine(1.5, 0.032, 12), lambda _, v: 3000.0 * v, noise=(2e-6, 0.0))
    crests = replace(log, force=np.array([float(f"%.{n}g" % value) for value in log.force]))
    runs = np.flatnonzero(crests.force == crests.force.max())
    assert (np.diff(runs, 2) == 0).any(), "three equal samples at the top"
    assert "force_clipping" not in warned(crests)
    cut = np.clip(crests.force, -2000.0, 0.985 * crests.force.max())
    assert "force_clipping" in warned(replace(crests, force=cut))


def dwelling():
    """Half cosines of 0.5 s, with 0.2 s of rest at each end of the stroke."""
    half = 0.03 * np.cos(np.pi * np.arange(500) / 500)
    rest = 0.03 * np.ones(200)
    return np.tile(np.concatenate([half, -rest, -half, rest]), 9)


def with_play(gap=3e-4):
    """A crank that goes through its play at each end: the damper stands until it is taken along."""
    x, at = np.empty(8000), 0.0
    for k, crank in enumerate(sine(1.5, 0.032, 12)):
        at = x[k] = min(max(at, crank - gap), crank + gap)
    return x


def ended():
    """Speeds, and then the piston stands at the end of its stroke."""
    top = sine(1.0, 0.03, 1)[:250]
    return np.concatenate([sine(0.5, 0.03, 4), sine(1.0, 0.03, 4), top, 0.03 * np.ones(1500)])


@pytest.mark.parametrize("law", [static, relaxing])
@pytest.mark.parametrize("step", [1e-6, 1e-5])
@pytest.mark.parametrize("motion", [dwelling, with_play, ended])
def test_what_stands_is_neither_clipped_nor_stuck(motion, step, law):
    names = warned(logged(motion(), law, steps=(step, 0.0)))
    assert not {name for name in names if name.startswith("displacement")}


def test_a_triangle_that_is_cut_is_clipped_and_a_trapezoid_is_not():
    turns = np.arange(12000) / 1000.0
    triangle = 0.03 * (2.0 / np.pi) * np.arcsin(np.sin(2.0 * np.pi * turns))
    log = logged(triangle, steps=(1e-6, 0.0))
    cut = replace(log, displacement=np.clip(log.displacement, -0.027, 0.027))
    assert "displacement_clipping" in warned(cut)
    trapezoid = logged(np.clip(triangle, -0.027, 0.027), steps=(1e-6, 0.0))
    assert "displacement_clipping" not in warned(trapezoid)


def blows(size, width, seed=3):
    """Play that closes some 12 ms after each turn, a little earlier or later, with a ring."""

    def law(_, v):
        random = np.random.default_rng(seed)
        time, force = np.arange(len(v)) / RATE, static_force(v)
        for k in np.flatnonzero(v[:-1] * v[1:] < 0.0):
            since = time - time[k] - 0.012 - 0.004 * random.standard_normal()
            ring = np.exp(-np.maximum(since, 0.0) / width) * np.sin(since / width * 2.1)
            height = size * (1.0 + 0.2 * random.standard_normal())
            force = force + np.sign(v[min(k + 20, len(v) - 1)]) * height * ring * (since >= 0.0)
        return force

    return law


@pytest.mark.parametrize("size", [200.0, 500.0])
@pytest.mark.parametrize("width", [5e-4, 1e-3, 2e-3])
def test_blows_where_play_closes_are_no_spikes_and_a_spike_among_them_is(size, width):
    log = logged(sine(1.5, 0.032, 12), blows(size, width), noise=(2e-6, 3.0))
    assert "force_spikes" not in warned(log)
    log.force[4000] += 2.5 * size + 300.0
    assert "1 spike in the force, in row 4001" in warned(log)["force_spikes"].message()


def test_a_force_that_steps_while_the_motion_goes_on_is_placed_in_time() -> None:
    at = 0.6 * LOG.time[-1]
    stepped = replace(LOG, force=np.where(LOG.time < at, 1.0, 1.5) * LOG.force)
    (step,) = [x for x in condition(stepped, OPTIONS).findings if x.code == "another_force"]
    assert step.values["value"] == pytest.approx(at, abs=1.0 / TEST.frequency)
    # One cycle that is off beside it: what comes after that one is no third setting.
    once = (LOG.time > at + 1.0) & (LOG.time < at + 1.5)
    mixed = replace(stepped, force=np.where(once, 0.7, 1.0) * stepped.force)
    assert "another_force" not in found(mixed)


@pytest.mark.parametrize(("times", "words"), [(1.02, "2 % above"), (0.98, "2 % below")])
def test_a_motion_beside_the_declared_one_lies_above_or_below_it(times, words) -> None:
    log = replace(LOG, time=LOG.time / times)
    assert f"{words} the 1.5 Hz" in str(found(log, OPTIONS)["frequency"])
