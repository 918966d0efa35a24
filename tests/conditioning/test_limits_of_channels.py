"""Limits by which a channel is judged: a case just inside, one just outside."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from damperfit.conditioning import channels
from damperfit.conditioning.channels import Channel, _clipped, _is_clip, _repeats, _runs, _steps
from damperfit.conditioning.stands import Beside, beside, catches_up, is_cut_displacement


def channel(values, *, other=None, period=0.0):
    n = len(values)
    other = np.zeros(n) if other is None else other
    return Channel("force", "N", 1.0, values, other, np.arange(n) / 300.0, period=period)


BENT = np.array([0.0, 1.0, 3.0, 0.0, 9.0])  # goes on while the force stands, not straight


@pytest.mark.parametrize(("steps", "clips"), [(5.8, False), (6.2, True)])
def test_a_rail_leaps_by_six_steps(steps, clips) -> None:
    values = np.array([-20.0, -steps, 0.0, 0.0, 0.0, -steps, -20.0])
    other = np.array([0.0, 1.0, 5.0, 9.0, 5.0, 1.0, 0.0])
    _, top = _clipped(channel(values, other=other), _runs(values), 1.0, 20.0)
    assert bool(len(top.start)) is clips


@pytest.mark.parametrize(
    ("beyond", "step", "clips"),
    [(0.96, 0.0, False), (1.04, 0.0, True), (2.9, 1.0, False), (3.1, 1.0, True)],
)
def test_a_crest_may_lack_a_thousandth_or_three_steps(beyond, step, clips, monkeypatch) -> None:
    near = Beside((1.0, 0.0), (1.0, 0.0), beyond, step)
    monkeypatch.setattr(channels, "beside", lambda *_: near)
    run = SimpleNamespace(start=np.array([1]), stop=np.array([4]))
    assert _is_clip(channel(np.zeros(5), other=BENT), run, 0, 1000.0) is clips


@pytest.mark.parametrize(("noise", "severity"), [(0.43, "warning"), (0.47, "note")])
def test_noise_of_half_a_step_spreads_coarse_steps(noise, severity) -> None:
    values = np.rint(50.0 * np.sin(np.arange(400.0) / 20.0))
    assert _steps(channel(values), 1.0, 100.0, noise=noise).severity == severity


@pytest.mark.parametrize(("count", "said"), [(0.95e6, "has steps of"), (1.05e6, "has no steps")])
def test_no_converter_has_more_than_a_million_steps(count, said) -> None:
    assert said in _steps(channel(np.zeros(9)), 1.0, count, noise=1.0).sentence


@pytest.mark.parametrize(("noise", "said"), [(0.105, "has steps of"), (0.095, "has no steps")])
def test_what_is_smoother_than_rounding_has_no_steps(noise, said) -> None:
    smooth = channel(np.sin(np.arange(9.0)))
    assert said in _steps(smooth, 1e-3, 2.0, noise=1e-3 * noise).sentence
    # A slow ramp in whole steps is as smooth as its steps are few.
    ramp = channel(np.repeat(np.arange(50.0), 3) * np.array([1.0, 1.0, 1.0] * 50))
    assert "has steps of" in _steps(ramp, 1.0, 600.0, noise=0.0).sentence


@pytest.mark.parametrize(("height", "n"), [(24.0, 0), (26.0, 1)])
def test_a_jump_at_a_turn_is_a_spike_from_a_quarter_of_the_range(height, n) -> None:
    values = np.zeros(400)
    values[200] = height
    other = -np.abs(np.arange(400.0) - 200.0)
    assert len(channels.find_spikes(channel(values, other=other), 100.0, noise=0.0)) == n


@pytest.mark.parametrize(("others", "repeats"), [(24, False), (26, True)])
def test_what_a_quarter_of_the_cycles_have_repeats(others, repeats) -> None:
    size = np.zeros(101 * 20)
    row = 50 * 20 + 10
    size[row] = 1.0
    size[10 : 10 + 20 * others : 20] = 1.0
    assert bool(_repeats(size, row, 20.0)) is repeats


@pytest.mark.parametrize(("n", "spikes"), [(19, 19), (21, 0)])
def test_more_than_one_spike_in_fifty_samples_is_noise(n, spikes) -> None:
    values = np.zeros(1000)
    values[5 : 5 + 20 * n : 20] = 50.0
    # The log is shorter than a cycle: nothing can repeat.
    found = channels.find_spikes(channel(values, period=2000.0), 100.0, noise=0.0)
    assert len(found) == spikes


@pytest.mark.parametrize(("n", "said"), [(5, "5, 10, 15, 20, 25 of"), (6, "20, 25, ... of")])
def test_the_rows_of_five_spikes_are_listed(n, said, monkeypatch) -> None:
    monkeypatch.setattr(channels, "find_spikes", lambda *_, **__: 5 * np.arange(1, n + 1))
    values = np.zeros(60)
    values[5 : 5 * n + 1 : 5] = 50.0
    (found,) = channels._spikes(replace(channel(values), first_row=0), 1e3, noise=0.0)
    assert f"{said} the data" in found.sentence


@pytest.mark.parametrize(("speed", "is_cut"), [(3.9, False), (4.1, True)])
def test_a_cut_has_two_fifths_of_the_speed_that_turns_it(speed, is_cut) -> None:
    near = Beside((speed, 1.0), (speed, 1.0), 0.0, 0.0)
    assert is_cut_displacement(near, np.zeros(10)) is is_cut


def test_what_goes_on_as_it_came_is_not_cut() -> None:
    """A rest in mid-stroke: one side is as far above its value as the other is below it."""
    values = np.concatenate([np.arange(-10.0, 0.0), np.zeros(10), np.arange(1.0, 11.0)])
    near = beside(values, 10, 20)
    assert near.before == near.behind == (0.0, 0.0)
    assert not is_cut_displacement(near, np.repeat([0.0, 0.0, 0.0, 1.0], 10))


@pytest.mark.parametrize("bend", [-0.5, 0.3])
def test_a_cut_corner_hardly_bends_or_bends_the_other_way(bend) -> None:
    near = Beside((8.0, bend), (8.0, bend), 0.0, 0.0)
    assert is_cut_displacement(near, np.repeat([0.0, 0.0, 0.0, 1.0], 10))


@pytest.mark.parametrize(("early", "is_cut"), [(0.29, True), (0.31, False)])
def test_at_rest_the_force_leaves_its_value_at_once(early, is_cut) -> None:
    force = np.repeat([early, early, early, 1.0], 10)
    force[0], force[1:10] = 0.0, early * 10.0 / 9.0
    near = Beside((100.0, 1.0), (100.0, 1.0), 0.0, 0.0)
    assert is_cut_displacement(near, force) is is_cut


@pytest.mark.parametrize(("leap", "catches"), [(2.9, False), (3.1, True)])
def test_a_sensor_catches_up_by_three_usual_steps(leap, catches) -> None:
    values = np.concatenate([np.zeros(20), leap + np.arange(20.0)])
    assert catches_up(values, 20) is catches


@pytest.mark.parametrize(
    ("others", "rings"),
    [
        ([105], False),
        ([105, 95], True),  # with itself three
        ([106, 94], False),  # too far off
    ],
)
def test_three_samples_of_eleven_that_stand_out_are_a_blow(others, rings) -> None:
    size = np.zeros(200)
    size[[100, *others]] = 1.0
    assert channels._rings(size, 100) is rings


@pytest.mark.parametrize(("height", "n"), [(5.8, 0), (6.2, 1)])
def test_where_nothing_repeats_a_spike_is_six_times_the_usual(height, n, monkeypatch) -> None:
    size = np.ones(400)
    size[200] = height
    monkeypatch.setattr(channels, "_beside", lambda _: size)
    monkeypatch.setattr(channels, "_is_motion", lambda *_: False)
    assert len(channels.find_spikes(channel(np.zeros(400)), 100.0, noise=0.0)) == n


@pytest.mark.parametrize(("many", "n"), [(18, 1), (22, 0)])
def test_the_usual_is_what_one_sample_in_fifty_exceeds(many, n, monkeypatch) -> None:
    size = np.zeros(1000)
    size[:many] = 1.0
    size[500] = 5.0
    monkeypatch.setattr(channels, "_beside", lambda _: size)
    monkeypatch.setattr(channels, "_is_motion", lambda *_: False)
    assert len(channels.find_spikes(channel(np.zeros(1000)), 100.0, noise=0.0)) == n


@pytest.mark.parametrize(
    ("name", "count", "severity"),
    [
        ("displacement", 490.0, "warning"),
        ("displacement", 510.0, "note"),
        ("force", 122.0, "warning"),
        ("force", 128.0, "note"),
    ],
)
def test_a_range_has_five_hundred_steps_or_a_quarter_of_that(name, count, severity) -> None:
    values = np.rint(50.0 * np.sin(np.arange(400.0) / 20.0))
    one = Channel(name, "N", 1.0, values, values, values)
    assert _steps(one, 1.0, count, noise=0.0).severity == severity


@pytest.mark.parametrize(
    ("length", "start", "is_seen"), [(3, 4, True), (3, 3, False), (80, 60, True), (80, 59, False)]
)
def test_four_to_sixty_samples_beside_a_stand_are_looked_at(length, start, is_seen) -> None:
    values = np.abs(np.arange(300.0) - start)
    values[start : start + length] = 0.0
    assert (beside(values, start, start + length) is not None) is is_seen


def burst(rate=512.0):
    """Three cycles of 8.9 Hz, 57 samples each, before 12 s of a slow ramp: place and force."""
    turn = 2.0 * np.pi * 8.9 * np.arange(172) / rate
    slow = np.linspace(0.0, 0.02, 3000)
    x = np.concatenate([0.025 * np.sin(turn), slow, slow[::-1]])
    speed = np.repeat([0.02 * rate / 3000.0, -0.02 * rate / 3000.0], 3000)
    v = np.concatenate([0.025 * 2.0 * np.pi * 8.9 * np.cos(turn), speed])
    # Chambers empty where bump begins: a knee, and a level before it.
    force = np.where(v > 0.0, 8000.0 * v**2, np.minimum(-1500.0, 4000.0 * v))
    return x, force + 3.0 * np.random.default_rng(1).standard_normal(len(x))


@pytest.mark.parametrize(
    ("row", "size", "found"),
    [(0, 0.0, []), (2000, 300.0, [2000]), (2000, -300.0, [2000]), (150, 300.0, [])],
)
def test_a_burst_of_fast_cycles_in_a_slow_log_has_no_spikes(row, size, found) -> None:
    """Crests and knees of it stood out; so does a spike on the ramp, not what its own steps are."""
    x, force = burst()
    force[row] += size
    usual = float(np.ptp(np.percentile(force, [1.0, 99.0])))
    one = channel(force, other=x)
    assert channels.find_spikes(one, usual, noise=3.0).tolist() == found
