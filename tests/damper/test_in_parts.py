"""A long motion in four parts side by side: the same answer as one, or done as one."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from damperfit.damper.purdy.parameters import PURDY_DAMPER, Parameters
from damperfit.damper.purdy.reference import reference_parameters
from damperfit.errors import SimulationError
from damperfit.simulation import Motion, Response, SolverOptions, simulate, sine_motion

CARRIED = ("r_m1", "r_m2", "r_m3", "k_e", "f_f", "f_0", "gas_pressure", "gas_exponent")
AS_ONE = SolverOptions(tolerance=1e-2)
IN_PARTS = replace(AS_ONE, settling=0.25)


def shaken(seed: int = 1, seconds: float = 6.0) -> Motion:
    """A sine that drifts and trembles, so that no cycle is another's, from mid-stroke."""
    t = np.arange(round(1000 * seconds)) / 1000.0
    random = np.random.default_rng(seed)
    x, v = np.zeros_like(t), np.zeros_like(t)
    for frequency, amplitude in ((1.5, 0.03), (0.11, 2e-3), (17.0, 3e-6), (29.0, 2e-6)):
        omega, phase = 2.0 * np.pi * frequency, random.uniform(0.0, 2.0 * np.pi)
        x += amplitude * np.sin(omega * t + phase)
        v += amplitude * omega * np.cos(omega * t + phase)
    return Motion(1e-3, x, v)


def both(
    parameters: Parameters, motion: Motion, names: tuple[str, ...] = CARRIED
) -> tuple[Response, Response]:
    one, other = (
        simulate(parameters, PURDY_DAMPER, motion, sensitivities=names, options=options)
        for options in (AS_ONE, IN_PARTS)
    )
    return one, other


def is_done_as_one(one: Response, other: Response) -> bool:
    """To the last bit, with the same work."""
    return np.array_equal(one.force, other.force) and one.work == other.work


@pytest.mark.parametrize("setting", [1, 5, 10, 20])
@pytest.mark.parametrize("seed", [1, 2])
def test_parts_are_the_whole_within_what_its_steps_err_by(setting: int, seed: int) -> None:
    parameters, motion = replace(reference_parameters(setting), f_0=7.0), shaken(seed)
    one, other = both(parameters, motion)
    assert not is_done_as_one(one, other)
    exact = simulate(
        parameters, PURDY_DAMPER, motion, sensitivities=CARRIED, options=SolverOptions(1e-4)
    )
    assert np.std(other.force - exact.force) <= 1.1 * np.std(one.force - exact.force)
    assert np.max(np.abs(other.force - exact.force)) <= 1.2 * np.max(
        np.abs(one.force - exact.force)
    )
    np.testing.assert_allclose(other.pressures, exact.pressures, rtol=1e-3)
    np.testing.assert_allclose(other.masses, exact.masses, rtol=1e-6)
    for name in CARRIED:
        size = np.max(np.abs(exact.sensitivities[name]))
        gap = other.sensitivities[name] - exact.sensitivities[name]
        assert np.std(gap) < 1e-3 * size, name


def test_it_takes_four_steps_at_once_and_hardly_more_of_them() -> None:
    one, other = both(reference_parameters(10), shaken())
    assert other.work.steps % 4 == 0
    # Three parts settle for a quarter of a second; all step as their hardest one.
    assert one.work.steps + 3 * 250 < other.work.steps < 1.3 * one.work.steps + 3 * 250


def test_a_chamber_that_empties_is_empty_in_parts_too() -> None:
    parameters = replace(reference_parameters(10), r_m3=4e6)
    one, other = both(parameters, shaken(), ("r_m3", "k_e"))
    assert not is_done_as_one(one, other)
    assert 0.2 < np.mean(one.pressures[1] <= 0.0) < 0.4
    assert np.mean((one.pressures[1] <= 0.0) != (other.pressures[1] <= 0.0)) < 2e-3
    assert np.std(one.force - other.force) < 0.01


def test_a_chamber_that_is_hardly_ever_full_remembers_and_is_done_as_one() -> None:
    assert is_done_as_one(*both(replace(reference_parameters(10), r_m3=4e7), shaken()))


def test_a_motion_is_cut_from_twice_the_settling_on() -> None:
    assert is_done_as_one(*both(reference_parameters(10), shaken(seconds=0.502)))
    assert not is_done_as_one(*both(reference_parameters(10), shaken(seconds=0.506)))


@pytest.mark.parametrize(("setting", "settling"), [(1, 0.04), (5, 0.06), (10, 0.08), (15, 0.1)])
def test_a_part_begins_with_the_oil_on_its_way(setting: int, settling: float) -> None:
    """From one pressure in all chambers none of these would be enough."""
    motion = sine_motion(0.032, 1.5, cycles=7.15, sample_rate=1000.0)
    one, other = (
        simulate(reference_parameters(setting), PURDY_DAMPER, motion, options=options)
        for options in (AS_ONE, replace(AS_ONE, settling=settling))
    )
    assert not is_done_as_one(one, other)
    assert np.max(np.abs(one.force - other.force)) < 0.2


@pytest.mark.parametrize("setting", [1, 10, 20])
def test_a_cycle_in_parts_is_the_cycle(setting: int) -> None:
    """A sine from a turn on, half a cycle to settle: quarters that begin in mid-stroke too."""
    phase = 2.0 * np.pi * 1.5 * np.arange(1000) / 1000.0
    motion = Motion(1e-3, 0.032 * np.cos(phase), -0.032 * 2.0 * np.pi * 1.5 * np.sin(phase))
    parameters = reference_parameters(setting)
    responses = [
        simulate(parameters, PURDY_DAMPER, motion, sensitivities=CARRIED, options=options)
        for options in (AS_ONE, replace(AS_ONE, settling=0.333), SolverOptions(1e-4))
    ]
    one, other, exact = responses
    assert not is_done_as_one(one, other)
    last = slice(333, None)
    near = 1.2 * np.max(np.abs(one.force[last] - exact.force[last]))
    assert np.max(np.abs(other.force[last] - exact.force[last])) <= near
    for name in CARRIED:
        rows = [each.sensitivities[name][last] for each in responses]
        assert np.std(rows[1] - rows[2]) <= 1.2 * np.std(rows[0] - rows[2]) + 1e-9, name


def turning(setting: int, rate: float = 1080.0) -> tuple[Motion, int]:
    """A sine from a turn on, half a cycle to settle, and how many samples that is."""
    n = round(rate / 1.5)
    phase = 2.0 * np.pi * np.arange(-(n // 2), n) / n
    x, v = 0.032 * np.cos(phase), -0.032 * 2.0 * np.pi * 1.5 * np.sin(phase)
    return Motion(1.0 / rate, x, v), n // 2


@pytest.mark.parametrize("rate", [480.0, 1080.0])
@pytest.mark.parametrize("setting", [1, 10, 20])
def test_what_nobody_asks_for_is_run_through_in_long_steps(setting: int, rate: float) -> None:
    motion, lead = turning(setting, rate)
    seen = SolverOptions(settling=(lead - 0.5) / rate)
    one, other = (
        simulate(
            reference_parameters(setting), PURDY_DAMPER, motion, sensitivities=CARRIED, options=how
        )
        for how in (seen, replace(seen, settles_unseen=True))
    )
    assert other.work.steps < 0.7 * one.work.steps
    assert np.all(np.isnan(other.force[:lead]))
    assert np.all(np.isnan(other.pressures[:, :lead]))
    assert np.max(np.abs(other.force[lead:] - one.force[lead:])) < 2e-3
    np.testing.assert_allclose(other.masses[:, lead:], one.masses[:, lead:], rtol=1e-7)
    for name in CARRIED:
        rows = [each.sensitivities[name][lead:] for each in (other, one)]
        assert np.std(rows[0] - rows[1]) <= 2e-5 * np.std(rows[1]), name


def test_a_motion_that_hardly_settles_has_no_long_steps() -> None:
    """Of 0.1 s the last 0.09 are stepped through: no leap of 16 ms fits before them."""
    motion, _ = turning(10)
    seen = SolverOptions(settling=0.1)
    one, other = (
        simulate(reference_parameters(10), PURDY_DAMPER, motion, options=how)
        for how in (seen, replace(seen, settles_unseen=True))
    )
    assert np.array_equal(np.isnan(other.force), np.arange(len(other.force)) < 108)
    assert np.max(np.abs(one.force[108:] - other.force[108:])) < 2e-3


def test_what_is_done_as_one_has_all_its_samples() -> None:
    """Also those that nobody asked for."""
    motion = sine_motion(0.032, 1.5, cycles=2, sample_rate=1000.0)
    hasty = replace(AS_ONE, settling=0.002, settles_unseen=True)
    one, other = (
        simulate(reference_parameters(10), PURDY_DAMPER, motion, options=options)
        for options in (AS_ONE, hasty)
    )
    assert is_done_as_one(one, other)


def test_parts_that_have_not_met_are_done_as_one() -> None:
    """In two milliseconds no start is forgotten."""
    parameters, motion = reference_parameters(10), shaken()
    hasty = replace(AS_ONE, settling=0.002)
    one, other = (
        simulate(parameters, PURDY_DAMPER, motion, options=options) for options in (AS_ONE, hasty)
    )
    assert is_done_as_one(one, other)


def test_what_fails_as_one_fails_in_parts_with_the_same_words() -> None:
    motion = sine_motion(0.2, 1.5, cycles=6, sample_rate=1000.0)
    words = []
    for options in (AS_ONE, IN_PARTS):
        with pytest.raises(SimulationError) as caught:
            simulate(reference_parameters(10), PURDY_DAMPER, motion, options=options)
        words.append(str(caught.value))
    assert words[0] == words[1]


def test_a_part_that_leaves_the_numbers_is_left_to_the_whole() -> None:
    parameters = replace(reference_parameters(10), k_e=1e300)
    words = []
    for options in (AS_ONE, IN_PARTS):
        try:
            found = simulate(parameters, PURDY_DAMPER, shaken(), options=options)
            words.append(repr(bool(np.all(np.isfinite(found.force)))))
        except SimulationError as error:
            words.append(str(error))
    assert words[0] == words[1]


def test_a_network_takes_no_notice_of_the_settling() -> None:
    from damperfit.damper.valve_dampers import TwinTube

    values = TwinTube().values(
        rebound_bleed=5e4, rebound_opening=4.5e5, rebound_slope=5e6, compression_bleed=4e4,
        compression_opening=3.6e5, compression_slope=4e6, f_f=20.0, f_0=0.0, k_s=4e5,
    )  # fmt: skip
    one, other = (
        simulate(values, TwinTube(), shaken(), options=options) for options in (AS_ONE, IN_PARTS)
    )
    assert is_done_as_one(one, other)


def test_settling_longer_than_any_motion_is_none() -> None:
    endless = replace(AS_ONE, settling=math.ldexp(1.0, 20))
    one, other = (
        simulate(reference_parameters(10), PURDY_DAMPER, shaken(), options=options)
        for options in (AS_ONE, endless)
    )
    assert is_done_as_one(one, other)
