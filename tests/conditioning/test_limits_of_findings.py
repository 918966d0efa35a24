"""Every limit of a finding with a case just inside and one just outside, on made-up cycles."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from damperfit.conditioning import findings as motion
from damperfit.conditioning import repeatability
from damperfit.conditioning.channels import (
    Channel,
    _is_clip,
    _runs,
    examine_channel,
    find_spikes,
    noise_of,
)
from damperfit.conditioning.gas_force import force_level, gas_force
from damperfit.conditioning.options import ConditionOptions, GasFacts, NominalTest
from tests import fakes

PERIOD = 200


def cycles(n, *, force=0.0, displacement=0.0, size=1.0, **more):
    """n cycles of 200 samples at 300 Hz, 1.5 Hz; per cycle an offset or a size of its own."""
    turns = np.arange(n * PERIOD) / PERIOD
    which = turns.astype(int)
    wave, slope = np.sin(2.0 * np.pi * turns), np.cos(2.0 * np.pi * turns)
    each = np.broadcast_to(force, n)[which]
    moved = np.broadcast_to(displacement, n)[which]
    sizes = np.broadcast_to(size, n)[which]
    one = fakes.trace(1)
    stretch = replace(
        one.fastest, first=0, stop=n * PERIOD, cycle_starts=PERIOD * np.arange(n + 1.0)
    )
    trace = replace(
        one,
        interval=1.0 / 300.0,
        displacement=0.032 * wave + moved,
        velocity=0.3 * slope,
        force=1000.0 * sizes * slope + each,
        stretches=(stretch,),
        n_cycles_found=n,
    )
    return replace(trace, **more)


def ramp(n, whole, ripple=0.0):
    """From the first cycle to the last so much more; every other one off by the ripple."""
    return whole * np.arange(n) / (n - 1) + ripple * (-1.0) ** np.arange(n)


@pytest.mark.parametrize(
    ("whole", "ripple", "severity"),
    [
        (9.5, 0.0, "note"),
        (10.6, 0.0, "warning"),  # 1 % of 1000 N
        (-10.6, 0.0, "warning"),
        # Nine cycles: the error of the drift is 1.164 times the ripple.
        (20.0, 20.0 / 1.164 / 3.6, "note"),
        (20.0, 20.0 / 1.164 / 4.4, "warning"),
    ],
)
def test_a_force_drifts_by_one_per_cent_and_four_errors(whole, ripple, severity):
    found = repeatability._force_drift(cycles(9, force=ramp(9, whole, ripple)))
    assert found.severity == severity
    assert found.value == pytest.approx(0.1 * whole, rel=0.02)
    assert f"drifts by {whole:+.3g} N over the cycles, {0.1 * abs(whole):.2g} %" in found.sentence


@pytest.mark.parametrize(
    ("whole", "ripple", "severity"),
    [
        (4.8, 0.0, "note"),
        (5.3, 0.0, "warning"),  # % of the amplitude
        (10.0, 10.0 / 1.164 / 3.6, "note"),
        (10.0, 10.0 / 1.164 / 4.4, "warning"),
    ],
)
def test_a_mid_stroke_drifts_by_a_twentieth_and_four_errors(whole, ripple, severity):
    found = repeatability._stroke_drift(cycles(9, displacement=3.2e-4 * ramp(9, whole, ripple)))
    assert found.severity == severity
    assert found.value == pytest.approx(whole, rel=0.02)


@pytest.mark.parametrize(("whole", "severity"), [(4.8, "note"), (5.3, "warning")])
def test_an_amplitude_drifts_by_a_twentieth(whole, severity):
    """Half of what lies between the ends of a stroke, in % of the amplitude."""
    trace = cycles(9)
    sizes = np.repeat(1.0 + 0.01 * ramp(9, whole), PERIOD)
    found = repeatability._stroke_drift(replace(trace, displacement=sizes * trace.displacement))
    assert found.severity == severity
    assert found.value == pytest.approx(whole, rel=0.02)
    assert f"the amplitude by {0.32 * whole:+.2g} mm" in found.sentence


@pytest.mark.parametrize(("n", "drifts"), [(3, False), (4, True)])
def test_a_drift_takes_four_cycles_to_tell(n, drifts):
    trace = cycles(n, force=ramp(n, 50.0))
    silent = SimpleNamespace(temperature=None)
    names = {one.name for one in repeatability.examine_repeatability(silent, trace)}
    assert ("force_drift" in names) is drifts
    assert ("stroke_drift" in names) is drifts


class _Cycles:
    """All of a log's cycles, steady."""

    n_elsewhere, break_at = 0, 0

    def __init__(self, n, found=None):
        self.rising, self.n_found = np.arange(n + 1), n if found is None else found


def _log(trace):
    from damperfit.conditioning.timebase import UniformLog

    return UniformLog(trace.start_time, trace.interval, trace.displacement, trace.force)


@pytest.mark.parametrize(("share", "severity"), [(1.4, "note"), (1.6, "warning")])
def test_peaks_scatter_by_one_per_cent_and_what_chance_adds(share, severity):
    # Nine cycles: a standard deviation is itself uncertain by a quarter; 1 % and two of these.
    sizes = 1.0 + 0.01 * share * (-1.0) ** np.arange(9) * np.sqrt(72.0 / 80.0)
    (found, *_) = repeatability._scatter(cycles(9, size=sizes))
    assert (found.severity, found.unit) == (severity, "%")
    assert found.value == pytest.approx(share, rel=0.02)


@pytest.mark.parametrize(
    ("steady", "found", "elsewhere", "said"),
    [
        (5, 12, 0, ""),  # one more than five may be cut at the log's ends: half of 12
        (5, 13, 0, "only 5 of 13 cycles in a row are steady"),
        (9, 10, 1, ""),
        (9, 11, 2, "2 more steady cycles lie beyond a break"),
    ],
)
def test_half_of_the_cycles_must_be_steady(steady, found, elsewhere, said):
    trace, told = cycles(9), _Cycles(steady, found)
    told.n_elsewhere = elsewhere
    sentences = [one.sentence for one in motion._unsteady(_log(trace), trace, told)]
    assert len(sentences) == bool(said)
    assert all(said in sentence for sentence in sentences)


def test_the_curvature_of_a_small_gas_chamber_is_no_level():
    """At the ends of the stroke this gas pushes by 46 % more, in the mean, than at its middle."""
    trace = cycles(6)
    gas = GasFacts(rod_area=1e-4, pressure=1e6, volume=0.04 * 1e-4 / 0.6, exponent=1.4)
    pushed = gas_force(gas, trace.displacement)
    assert 0.5 * (pushed.min() + pushed.max()) < -140.0
    rubbed = replace(trace, force=pushed + 300.0 * np.tanh(trace.velocity / 0.05))
    assert force_level(rubbed, gas).reversals == pytest.approx(-100.0, abs=1.0)


@pytest.mark.parametrize(("half", "n"), [(9.6, 1), (10.4, 0)])
def test_a_force_of_less_than_ten_newtons_is_remarked(half, n):
    trace = cycles(4)
    found = list(motion._force_range(replace(trace, force=1e-3 * half * trace.force)))
    assert len(found) == n
    if n:
        assert (found[0].severity, found[0].unit) == ("warning", "N")
        assert "swings by +-9.6 N" in found[0].sentence


@pytest.mark.parametrize(
    ("told", "severity"),
    [("1.43 Hz", "note"), ("1.425 Hz", "warning"), ("1.57 Hz", "note"), ("1.6 Hz", "warning")],
)
def test_a_frequency_may_be_a_twentieth_off_what_the_log_declares(told, severity):
    found = motion._frequency({"frequency": told}, cycles(4), ConditionOptions())
    assert found.severity == severity
    assert ("but the log's preamble says" in found.sentence) is (severity == "warning")


@pytest.mark.parametrize(
    ("told", "severity"),
    [("33.4", "note"), ("34", "warning"), ("30.6", "note"), ("30.2 mm", "warning")],
)
def test_an_amplitude_may_be_a_twentieth_off_what_the_log_declares(told, severity):
    key = "amplitude" if "mm" in told else "amplitude_mm"
    assert motion._amplitude({key: told}, cycles(4), ConditionOptions()).severity == severity


@pytest.mark.parametrize(
    ("nominal", "said"),
    [
        (1.494, ""),
        (1.49, ", 0.67 % above the 1.49 Hz of the configuration"),
        (1.51, ", 0.66 % below the 1.51 Hz of the configuration"),
        (1.26, ", 19 % above the 1.26 Hz of the configuration"),
        (1.24, ", a different test from the 1.24 Hz of the configuration"),
    ],
)
def test_a_test_is_another_one_from_a_fifth_off(nominal, said):
    options = ConditionOptions(nominal=NominalTest(frequency=nominal))
    assert motion._frequency({}, cycles(4), options).sentence == f"1.5 Hz found{said}"


def channel(values, *, name="force", other=None, period=0.0):
    n = len(values)
    other = np.zeros(n) if other is None else other
    return Channel(name, "N", 1.0, values, other, np.arange(n) / 300.0, period=period)


@pytest.mark.parametrize(
    ("height", "noise", "found"),
    [
        (6.6, 1.0, False),  # seven times the noise
        (7.5, 1.0, True),
        (1.9, 0.1, False),  # two hundredths of the range of 100
        (2.1, 0.1, True),
    ],
)
def test_a_spike_stands_out_of_noise_and_range(height, noise, *, found):
    values = np.zeros(400)
    values[123] = height
    rows = find_spikes(channel(values), 100.0, noise=noise)
    assert rows.tolist() == ([123] if found else [])


@pytest.mark.parametrize(("samples", "found"), [(158, False), (201, True)])
def test_few_samples_in_a_cycle_hide_small_spikes(samples, *, found):
    """At 200 samples a cycle 4/200 of the range is the limit of a spike, too."""
    values = np.zeros(1000)
    values[500] = 2.2
    rows = find_spikes(channel(values, period=samples), 100.0, noise=0.0)
    assert bool(len(rows)) is found


@pytest.mark.parametrize(("share", "n"), [(0.019, 19), (0.021, 0)])
def test_more_spikes_than_two_in_a_hundred_are_noise(share, n):
    values = np.zeros(1000)
    values[5 : 5 + round(1000 * share) * 20 : 20] = 50.0
    assert len(find_spikes(channel(values), 100.0, noise=0.1)) == n


@pytest.mark.parametrize(("second", "n"), [(0.37, 1), (0.43, 0)])
def test_what_the_next_cycle_has_too_is_no_spike(second, n):
    values = np.zeros(1000)
    values[300], values[503] = 50.0, 50.0 * second
    rows = find_spikes(channel(values, period=200.0), 100.0, noise=0.1)
    assert (300 in rows) is bool(n)


@pytest.mark.parametrize(("height", "severity"), [(19.0, "note"), (21.0, "warning")])
def test_spikes_below_a_fifth_of_the_range_in_all_are_harmless(height, severity):
    t = np.arange(2000)
    wave = 50.0 * np.sin(2.0 * np.pi * t / 400.0)
    wave[400] += 0.5 * height
    wave[1100] -= 0.5 * height
    found = {one.name: one for one in examine_channel(channel(wave, period=400.0))}
    usual = np.ptp(np.sort(wave)[20:-20])
    assert usual == pytest.approx(100.0, abs=0.1)
    assert found["force_spikes"].severity == severity
    assert found["force_spikes"].value == 2.0


def stood(rows, *, moves=1.0, period=1000.0, name="displacement"):
    """A displacement that stays where it is for some rows, while the force goes on."""
    turns = np.arange(4 * int(period)) / period
    values = np.sin(2.0 * np.pi * turns)
    first = 2 * int(period)
    values[first : first + rows] = values[first]
    other = moves * np.sin(2.0 * np.pi * turns)
    other[0], other[1] = -1.0, 1.0  # the whole range stands elsewhere
    found = examine_channel(channel(values, name=name, other=other, period=period))
    return {one.name: one for one in found}.get(f"{name}_stuck")


@pytest.mark.parametrize(("rows", "is_stuck"), [(19, False), (21, True)])
def test_a_channel_is_stuck_from_a_fiftieth_of_a_cycle_on(rows, *, is_stuck):
    found = stood(rows)
    assert (found is not None) is is_stuck
    if found is not None:
        assert found.severity == "warning"
        assert found.value == pytest.approx(100.0 * rows / 4000.0, rel=0.1)


@pytest.mark.parametrize(("share", "is_stuck"), [(0.045, False), (0.055, True)])
def test_a_channel_is_stuck_while_the_other_goes_a_twentieth_of_its_range(share, *, is_stuck):
    # 40 of 1000 rows from mid-stroke: the other one goes sin(2 pi 39/1000) of its amplitude.
    moves = 2.0 * share / np.sin(2.0 * np.pi * 39.0 / 1000.0)
    assert (stood(40, moves=moves) is not None) is is_stuck


def test_noise_is_told_beside_a_motion():
    noise = np.random.default_rng(1).standard_normal(20_000)
    wave = 1000.0 * np.sin(2.0 * np.pi * np.arange(20_000) / 400.0)
    assert noise_of(wave + noise) == pytest.approx(1.0, rel=0.05)


def test_a_run_of_equal_samples_is_measured_on_both_sides():
    values = np.array([0.0, 5.0, 6.0, 9.0, 9.0, 9.0, 9.0, 8.5, 8.0, 7.0, 3.0, 3.0, 3.0])
    runs = _runs(values)
    assert runs.start.tolist() == [3, 10]
    assert runs.length.tolist() == [4, 3]
    # Half its length beside the first: 4 and 1; the second ends the log: its one side stands.
    assert runs.least_leap.tolist() == [1.0, 4.0]
    assert runs.greatest_leap.tolist() == [4.0, 4.0]
    mirrored = _runs(values[::-1])
    assert mirrored.least_leap.tolist() == [4.0, 1.0]
    assert mirrored.greatest_leap.tolist() == [4.0, 4.0]
    assert not len(_runs(np.array([0.0, 1.0, 1.0, 2.0, 3.0])).start)  # two are none


@pytest.mark.parametrize(("n", "is_seen"), [(7, False), (8, True)])
def test_eight_samples_are_looked_at(n, *, is_seen):
    assert bool(list(examine_channel(channel(np.sin(np.arange(float(n))))))) is is_seen


@pytest.mark.parametrize(
    ("lost", "severity"), [(0.8e-3, None), (1.2e-3, "note"), (0.9e-2, "note"), (1.1e-2, "warning")]
)
def test_a_filter_takes_a_thousandth_or_a_hundredth_of_the_motion(lost, severity, monkeypatch):
    monkeypatch.setattr(motion, "gain_at", lambda *_, **__: 1.0 - lost)
    found = list(motion._filter_loss(cycles(4)))
    assert [one.severity for one in found] == ([] if severity is None else [severity])
    for one in found:
        assert one.value == pytest.approx(100.0 * lost)
        assert f"the filter takes {100.0 * lost:.2g} % off the motion at 1.5 Hz" in one.sentence


@pytest.mark.parametrize(("bow", "is_clip"), [(0.0015, False), (0.0025, True)])
@pytest.mark.parametrize("stroke", [0.064, 3.0])
def test_a_constant_force_at_constant_speed_is_no_clipping(stroke, bow, is_clip) -> None:
    """Six tenths of the stroke, straight but for a bow; of a dam's damper too."""
    part = np.linspace(0.0, 1.0, 101)
    out = stroke * (0.6 * part + bow * np.sin(np.pi * part))
    other = np.concatenate([out, np.linspace(out[-1], stroke, 50)])
    channel = Channel("force", "N", 1.0, np.zeros(151), other, np.arange(151.0))
    run = SimpleNamespace(start=np.array([0]), stop=np.array([101]))
    assert _is_clip(channel, run, 0, 1.0) is is_clip
