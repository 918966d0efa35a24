"""Limits of what is put right or doubted in a log: a case just inside, one just outside."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from damperfit.conditioning import (
    corrections,
    gas_force,
    polarity,
    refusals,
    rig_filter,
    skew,
    timebase,
)
from damperfit.conditioning.gas_force import ForceLevel
from damperfit.conditioning.options import MAX_SKEW, ConditionOptions
from damperfit.conditioning.skew import Skew, estimate_skew
from damperfit.conditioning.velocity import check_velocity
from damperfit.errors import ConditioningError, ConfigurationError
from tests.conditioning.logs import recording
from tests.conditioning.test_limits_of_findings import cycles

OPTIONS = ConditionOptions()


def level(force: float, uncertainty: float = 0.0, *, rebound: float = 0.1, bump: float = 0.0):
    """Gas gives -100 N."""
    return ForceLevel(force, force, uncertainty, -100.0, rebound, bump)


# Tare, mid-stroke and signs


@pytest.mark.parametrize(
    ("corner", "harmonics"), [(31.0, 20.7), (30.0, 20.0), (29.0, 19.3), (15.0, 10.0)]
)
def test_a_filter_that_passes_twenty_harmonics_takes_nothing_off_the_turns(
    corner, harmonics
) -> None:
    trace = cycles(4)
    assert trace.frequency == 1.5
    lost = 0.15 * max(1.0 / harmonics - 0.05, 0.0)
    assert gas_force._lost_at_turns(trace, corner) == pytest.approx(lost, rel=0.05, abs=1e-12)


@pytest.mark.parametrize(("corner", "turn"), [
    (30.0, 0.0), (15.0, 2.0 * math.pi * 1.5 * 0.1 / 15.0 - 0.05), (1.89, 0.4486), (1.5, 0.45),
    (math.inf, 0.0),
])  # fmt: skip
def test_what_a_filter_does_not_show_of_a_turn_may_be_preloads(corner, turn) -> None:
    """Of a force of 1000 N in step with the speed: a twentieth of that is a friction's, at most."""
    trace = cycles(4)
    v = trace.velocity
    found = gas_force._preloads(trace, v, 1000.0 * v / v.max(), corner)
    assert found == pytest.approx(700.0 * turn, rel=0.01, abs=1e-9)


def test_without_a_filter_a_turn_is_looked_at_a_sample_beside_it() -> None:
    trace = cycles(4)
    found = gas_force._preloads(trace, trace.velocity, 1000.0 * np.sign(trace.velocity), math.inf)
    assert found == pytest.approx(700.0 * 0.95, rel=0.01)


def test_a_motion_that_never_turns_has_no_preloads() -> None:
    trace = cycles(4)
    v = np.abs(trace.velocity) + 0.1
    assert gas_force._preloads(trace, v, 1000.0 * v, 15.0) == 0.0


@pytest.mark.parametrize(("preloads", "hidden", "said"), [
    (14.0, 0.0, "gas force present"), (16.0, 0.0, "cannot"),
    (16.0, 14.0, "cannot"), (14.0, 14.0, "gas force present"), (0.0, 16.0, "cannot"),
])  # fmt: skip
def test_preloads_and_what_opens_early_are_one_doubt(preloads, hidden, said) -> None:
    """The larger of the two, beside an uncertainty of 20 N: 35 N are a third of the gas force."""
    seen = replace(level(-100.0, 20.0), preloads=preloads, hidden=hidden)
    (found,) = corrections.describe_level(seen, OPTIONS)
    assert found.sentence.startswith(said)


@pytest.mark.parametrize(("uncertainty", "said"), [(34.0, "gas force present"), (36.0, "cannot")])
def test_nothing_is_said_of_a_tare_beyond_a_third_of_the_gas_force(uncertainty, said) -> None:
    (found,) = corrections.describe_level(level(-100.0, uncertainty), OPTIONS)
    assert found.sentence.startswith(said)


@pytest.mark.parametrize(("missing", "said"), [(19.5, "gas force present"), (20.5, "part of")])
def test_a_gas_force_is_there_within_its_uncertainty_and_15_per_cent(missing, said) -> None:
    (found,) = corrections.describe_level(level(missing - 100.0, 5.0), OPTIONS)
    assert found.sentence.startswith(said)


@pytest.mark.parametrize(("force", "said"), [(-24.0, "gas force tared"), (-26.0, "part of")])
def test_a_gas_force_is_tared_below_a_quarter(force, said) -> None:
    (found,) = corrections.describe_level(level(force), OPTIONS)
    assert found.sentence.startswith(said)


@pytest.mark.parametrize(("force", "doubts"), [(-24.0, 1), (-26.0, 0)])
def test_a_quarter_of_the_gas_force_tells_the_direction(force, doubts) -> None:
    found = polarity._both_or_none(level(force), ["displacement", "force"])
    assert len(found.findings) == doubts


@pytest.mark.parametrize(("shift", "wanders"), [(0.0385, False), (0.0415, True)])
def test_a_motion_wanders_by_a_fiftieth_of_its_range(shift, wanders) -> None:
    """The last quarter stands higher: the range is 2 and the shift."""
    x = np.tile([-1.0, 1.0], 40)
    x[60:] += shift
    assert corrections._wanders(x) is wanders


@pytest.mark.parametrize(("middle", "taken"), [(0.32, True), (0.345, False)])
def test_the_logs_zero_lies_within_a_third_of_the_amplitude(middle, taken) -> None:
    x = np.tile([-1.0, 1.0], 40)
    x[:40] *= 0.5
    x[:20] += 0.3
    one = SimpleNamespace(amplitude=1.0, window=slice(0, 80))
    assert (corrections.middle_of(x + middle, [one]) == 0.0) is taken


@pytest.mark.parametrize(("share", "n"), [(0.095, 1), (0.105, 0)])
def test_a_loop_takes_energy_from_a_tenth_of_its_throughput(share, n, monkeypatch) -> None:
    monkeypatch.setattr(polarity, "_energy", lambda _: (share, 1.0))
    log = SimpleNamespace(reverse_displacement=None, reverse_force=None)
    assert len(polarity.find_signs(None, log, None).findings) == n


@pytest.mark.parametrize(("whole", "is_certain"), [(-0.58, True), (-0.62, False)])
def test_no_valve_is_as_digressive_as_six_tenths(whole, is_certain) -> None:
    one = level(-100.0, rebound=0.1, bump=whole - 0.1)
    assert polarity._is_certain(one, ()) is is_certain


@pytest.mark.parametrize(
    ("hidden", "held", "is_certain"),
    [(0.0, 49.0, True), (0.0, 51.0, False), (24.0, 0.0, True), (26.0, 0.0, False)],
)
def test_preloads_may_hide_a_level(hidden, held, is_certain) -> None:
    """Both channels reversed: the level must be twice what preloads may make of it."""
    one = replace(level(100.0, rebound=0.0, bump=0.1), hidden=hidden, held=held)
    assert polarity._is_certain(one, ("displacement", "force")) is is_certain


def test_of_one_reversed_channel_the_strokes_hide_nothing_that_is_known() -> None:
    one = replace(level(100.0, rebound=-0.2, bump=-0.1), hidden=60.0)
    assert polarity._is_certain(one, ("force",))
    assert not polarity._is_certain(replace(one, held=51.0), ("force",))


# Refusals


@pytest.mark.parametrize(
    ("driven", "answers", "refused"),
    [
        (2.9e-4, 1e-6, False),
        (3.1e-4, 1e-6, True),
        (3.9e-3, 1e-3, False),  # four times the other
        (4.1e-3, 1e-3, True),
    ],
)
def test_a_machine_drives_few_harmonics(driven, answers, refused, monkeypatch) -> None:
    trace = cycles(4)
    monkeypatch.setattr(
        refusals, "_harmonic_share", lambda _, x: driven if x is trace.displacement else answers
    )
    if refused:
        with pytest.raises(ConditioningError, match="look swapped"):
            refusals.refuse_swapped(trace)
    else:
        refusals.refuse_swapped(trace)


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_a_tenth_of_a_second_is_no_skew(sign) -> None:
    ConditionOptions(skew=0.096 * sign)
    with pytest.raises(ConfigurationError, match=f"at most {MAX_SKEW:g} s either way"):
        ConditionOptions(skew=0.104 * sign)


# A rig's filter


@pytest.mark.parametrize(
    ("displacement", "force", "looks"),
    [(97.0, 2e3, False), (103.0, 2e3, True), (2e2, 970.0, False), (2e2, 1030.0, True)],
)
def test_a_filter_takes_two_or_three_powers_of_ten(displacement, force, looks, monkeypatch) -> None:
    falls = {"displacement": displacement, "force": force}
    monkeypatch.setattr(rig_filter, "_fall", lambda signal, *_: falls[signal])
    assert rig_filter.looks_filtered("displacement", "force", 0.001, 1.5) is looks


@pytest.mark.parametrize(
    ("n", "interval", "motion", "is_known"),
    [
        (800, 1e-3, 50.0, False),  # 13 to 19 lie between 15 and 25 Hz: seven lines
        (820, 1e-3, 50.0, True),
        (150, 1.0 / 150.0, 50.0, False),  # 61 to 67 Hz: seven lines beyond 60 Hz
        (180, 1.0 / 150.0, 50.0, True),
        (1600, 1e-3, 32.2 / 1.6, False),  # the line at 3.8 beside a harmonic would be the eighth
        (1620, 1e-3, 32.2 / 1.62, True),  # and the one at 4.2 is
    ],
)
def test_eight_lines_on_each_side_tell_a_filter(n, interval, motion, is_known) -> None:
    signal = np.random.default_rng(1).standard_normal(n)
    assert (rig_filter._fall(signal, interval, motion) > 0.0) is is_known


# Skew


@pytest.mark.parametrize(("delay", "is_late"), [(0.00048, False), (0.00052, True)])
def test_half_a_millisecond_is_late(delay, is_late) -> None:
    assert Skew(delay, 1e-4).is_significant is is_late


@pytest.mark.parametrize(("interval", "n"), [(1.9e-4, 210 // 2), (2.1e-4, 191)])
def test_samples_are_averaged_where_two_are_closer_than_four_tenths_of_a_ms(interval, n) -> None:
    log = SimpleNamespace(start_time=0.0, interval=interval, force=np.zeros(2000))
    lag, _ = skew._beside(log, np.array([1000.0 * interval]))
    assert len(lag) == n


@pytest.fixture
def scanned(monkeypatch):
    """Skew of a log of which the scan finds what the test says."""

    def run(*, samples=60, late=0.001, rests=None, gain=1000.0, jumps=(1.0, 1.0)):
        rests = {0.0: 1.0, **(rests or {})}
        n = 114  # the variance is then a hundredth of what is left
        side = np.linspace(-0.02, 0.02, samples), np.zeros(samples)

        def scan(_, delays, *, width):
            least = rests.get(width, 100.0)
            rest = least * (1.0 + 1e6 * (delays - late) ** 2)
            return skew._Scan(rest, 0.0, np.outer(jumps, np.ones(len(delays))), n)

        def scaled(*arguments, **words):
            # Of the best width a hundredth of its rest is the variance.
            found = scan(*arguments, **words)
            return replace(found, total=float(found.rest.min()) + gain * 0.01 * min(rests.values()))

        monkeypatch.setattr(skew, "_ends", lambda _: (np.zeros(1), np.zeros(1)))
        monkeypatch.setattr(skew, "_beside", lambda *_: side)
        monkeypatch.setattr(skew, "stands_still", lambda *_: False)
        monkeypatch.setattr(skew, "_scan", scaled)
        return estimate_skew(SimpleNamespace(interval=0.001), None)

    return run


@pytest.mark.parametrize(("samples", "is_reported"), [(39, False), (40, True)])
def test_forty_samples_beside_the_ends_tell_a_skew(scanned, samples, is_reported) -> None:
    assert ("too few samples" not in scanned(samples=samples).reason) is is_reported


@pytest.mark.parametrize(("gain", "said"), [(48.0, "no friction stands out"), (52.0, "")])
def test_friction_stands_out_by_fifty_squared_deviations(scanned, gain, said) -> None:
    assert scanned(gain=gain).reason.startswith(said)
    assert (scanned(gain=gain).delay is None) is bool(said)


@pytest.mark.parametrize(("smaller", "is_reported"), [(0.39, False), (0.41, True)])
def test_friction_jumps_alike_at_both_ends(scanned, smaller, is_reported) -> None:
    found = scanned(jumps=(smaller, 1.0))
    assert (found.delay is not None) is is_reported
    assert is_reported or "not friction alone" in found.reason


@pytest.mark.parametrize(("sharp", "is_reported"), [(1.45, True), (1.55, False)])
def test_a_jump_is_rounded_where_that_misses_two_thirds(scanned, sharp, is_reported) -> None:
    found = scanned(rests={0.0: sharp, 1e-4: sharp, 1e-3: 1.0})
    assert (found.delay is not None) is is_reported
    assert is_reported or "is rounded by" in found.reason


@pytest.mark.parametrize(("width", "is_reported"), [(1e-3, True), (3e-3, False)])
def test_a_jump_rounded_over_more_than_a_millisecond_tells_nothing(
    scanned, width, is_reported
) -> None:
    assert (scanned(rests={0.0: 1.2, 1e-4: 1.2, width: 1.0}).delay is not None) is is_reported


@pytest.mark.parametrize(("late", "is_reported"), [(0.0091, True), (0.0093, False)])
def test_a_force_is_ten_milliseconds_late_at_most(scanned, late, is_reported) -> None:
    """Known to half a step of the scan, and a step before its end is beyond it."""
    found = scanned(late=late)
    assert (found.delay is not None) is is_reported
    assert is_reported or "more than 10 ms" in found.reason


# A logged velocity


def logged(values):
    trace = cycles(6)
    time = trace.start_time + trace.interval * np.arange(len(trace.force))
    log = replace(recording(time, trace.displacement, trace.force), velocity=values(trace))
    (found,) = check_velocity(trace, log)
    return found


@pytest.mark.parametrize(("ratio", "severity"), [(1.096, "note"), (1.104, "warning")])
def test_a_logged_velocity_is_within_a_tenth(ratio, severity) -> None:
    assert logged(lambda trace: ratio * trace.velocity).severity == severity


@pytest.mark.parametrize(("share", "follows"), [(0.69, False), (0.71, True)])
def test_a_logged_velocity_has_seven_tenths_in_the_fundamental(share, follows) -> None:
    def mixed(trace):
        turns = 2.0 * math.pi * np.arange(len(trace.force)) / 200.0
        return math.sqrt(share) * np.cos(turns) + math.sqrt(1.0 - share) * np.cos(7.0 * turns)

    assert ("does not follow" not in logged(mixed).sentence) is follows


# Time


def stamped(time):
    wave = np.sin(np.arange(len(time)) / 8.0)
    return timebase.make_uniform(recording(np.asarray(time), wave, wave))


@pytest.mark.parametrize(("off", "n"), [(0.0096, 0), (0.0104, 1)])
def test_stamps_are_even_within_a_hundredth_of_an_interval(off, n) -> None:
    k = np.arange(400.0)
    assert len(stamped(0.0031234567 * (k + off * (-1.0) ** k)).findings) == n


@pytest.mark.parametrize(("late", "said"), [(17, "rounded_time"), (13, "jitter")])
def test_a_rounding_moves_stamps_by_three_quarters_of_it(late, said) -> None:
    """Whole ms, 10 ms apart; of 100 stamps so many are a ms late: the others are off the rest."""
    k = np.arange(1000)
    is_late = (k * late) % 100 < late
    (found,) = stamped(0.001 * (10.0 * k + is_late)).findings
    assert found.name == said


@pytest.mark.parametrize(("ratio", "severity"), [(1.46, "note"), (1.54, "warning")])
def test_stamps_are_doubted_that_make_the_motion_half_as_rough_again(ratio, severity) -> None:
    time = np.arange(50.0)
    log = recording(time, np.sin(time), np.sin(time))
    steps = np.linspace(0.8, 1.2, 49)
    assert timebase._jitter_finding(log, steps, ratio * log.displacement, 1.0).severity == severity


@pytest.mark.parametrize(("missing", "refused"), [(49, False), (51, True)])
def test_a_twentieth_of_the_samples_may_be_missing(missing, refused) -> None:
    counts = np.ones(999 - missing)
    counts[::18][:missing] += 1.0
    assert counts.sum() == 999
    log = SimpleNamespace(name="a.csv")
    if refused:
        with pytest.raises(ConditioningError, match="at most 5 %"):
            timebase._missing(log, counts)
    else:
        assert timebase._missing(log, counts) == missing


@pytest.mark.parametrize(
    ("ratio", "is_certain"), [(0.49, False), (0.51, True), (1.67, True), (1.73, False)]
)
def test_a_level_from_half_to_17_times_the_gas_force_is_certain(ratio, is_certain) -> None:
    assert polarity._is_certain(level(-100.0 * ratio), ()) is is_certain


@pytest.mark.parametrize(
    ("edge", "band", "is_high"),
    [(19.6, "near", True), (20.4, "near", False), (366.0, "far", True), (384.0, "far", False)],
)
def test_levels_are_those_of_15_to_25_hz_and_far_above(edge, band, is_high) -> None:
    """A spectrum that goes up within a band, so that half of it is high, or less."""
    frequency = np.arange(10_001) * 0.05
    is_band = frequency < 100.0 if band == "near" else frequency > 100.0
    lines = np.where(is_band & (frequency < edge), 1e-3, 1.0)
    phases = np.exp(2j * np.pi * np.random.default_rng(1).uniform(size=len(lines)))
    fall = rig_filter._fall(np.fft.irfft(lines * phases), 1e-3, 50.0)
    assert (abs(math.log10(fall)) < 2.0) is is_high
