"""Mean cycles, forces at speeds, energy; how tests repeat; measured runs compared."""

import math

import numpy as np
import pytest

from damperfit import results
from damperfit.comparison.comparing import ComparisonOptions, compare_runs
from damperfit.comparison.differences import DIFFERENT
from damperfit.comparison.measured import (
    common_tests,
    measured_readings,
    measured_tests,
    repeat_scatter,
    zero_shift,
)
from damperfit.errors import ConfigurationError
from damperfit.tested.setting import Setting
from tests.comparison.runs import (
    AMPLITUDE,
    DAMPING,
    FREQUENCY,
    GAS,
    measured,
    run,
    signals,
)

MEASURED = ComparisonOptions(is_measured=True)
PEAK = 2.0 * math.pi * FREQUENCY * AMPLITUDE


def test_force_of_a_known_loop() -> None:
    test = measured()
    # k x has one sign on the opening branch and the other on the closing one.
    for speed in (0.05, 0.13, 0.26):
        assert test.force_at(speed, "rebound")[0] == pytest.approx(DAMPING * speed + GAS, abs=0.05)
        assert test.force_at(speed, "bump")[0] == pytest.approx(-DAMPING * speed + GAS, abs=0.05)
    assert test.n_cycles == 10
    assert test.peak_speed == pytest.approx(PEAK, rel=1e-4)


def test_errors_are_those_of_the_scatter_between_cycles() -> None:
    seeds = range(40)
    found = np.array([measured(noise=4.0, seed=seed).force_at(0.26, "rebound") for seed in seeds])
    assert np.std(found[:, 0], ddof=1) == pytest.approx(np.mean(found[:, 1]), rel=0.25)


@pytest.mark.parametrize("change", [{"frequency_Hz": None}, {"kind": "moving"}, {"stop_s": "x"}])
def test_what_does_not_repeat_is_no_test(change) -> None:
    found, told = signals()
    assert measured_tests(found, [told[0] | change]) == ()


def test_one_motion_is_within_a_twentieth_and_those_that_all_ran_are_compared() -> None:
    for ratio, is_one in ((1.049, True), (1.051, False)):
        runs = run(measured()), run(measured(frequency=ratio * FREQUENCY))
        assert bool(common_tests(runs, Setting.of(1))) == is_one
    slow, fast, faster = (measured(frequency=f) for f in (1.0, 1.5, 3.0))
    groups = common_tests([run(slow, fast), run(faster, fast, slow)], Setting.of(1))
    assert groups == [((fast,), (fast,)), ((slow,), (slow,))]


def campaign(rng, n: int = 8, **how):
    """Dampers whose tests, three a setting, repeat within 2 %."""
    return run(
        *(
            measured(k, factor=1.0 + 0.02 * rng.standard_normal(), seed=j, **how)
            for k in range(1, n + 1)
            for j in range(3)
        )
    )


def test_tests_that_do_not_repeat_are_found_with_their_size() -> None:
    share, freedom = repeat_scatter(campaign(np.random.default_rng(3), noise=2.0))
    assert (freedom, share) == (16.0, pytest.approx(0.02, rel=0.4))
    quiet = (run(*(measured(noise=4.0, seed=10 * k + j) for j in range(3))) for k in range(12))
    assert sum(repeat_scatter(one)[0] > 0.0 for one in quiet) <= 1
    factors = (0.95, 1.05, 0.97, 1.03)
    one = run(*(measured(1, factor=f, noise=1.0, seed=k) for k, f in enumerate(factors)))
    share, _ = repeat_scatter(one)
    # The mean of several has their scatter by the root of their number.
    (table,) = measured_readings((one,), one.settings, speeds=(0.2,))
    for reading in table.values():
        assert reading.repeat == pytest.approx(share * DAMPING * 0.2 / 2.0, rel=0.01)


@pytest.mark.parametrize("pairs", [2, pytest.param(6, marks=pytest.mark.slow)])
def test_dampers_that_are_mounted_anew_are_seldom_called_different(pairs: int) -> None:
    rng, options = np.random.default_rng(5), ComparisonOptions(speeds=(0.26,), is_measured=True)
    both = ((campaign(rng, 4, cycles=4), campaign(rng, 4, cycles=4)) for _ in range(pairs))
    lines = [one for pair in both for one in compare_runs(*pair, options).of("force")]
    # Eight a pair, in four settings of their own.
    assert np.mean([one.verdict == DIFFERENT for one in lines]) < 0.13


@pytest.mark.parametrize(
    ("changed", "shift"),
    [
        ({"tare": 4.0}, 4.0),
        ({"tare": -0.6}, -0.6),
        ({"tare": 4.0, "factor": 1.1}, 4.0),
        ({"factor": 1.1}, 0.0),
        ({}, 0.0),
    ],
)
def test_another_tare_shifts_every_force_and_a_valve_does_not(changed, shift) -> None:
    a = run(*(measured(k, noise=1.0, factor=1.0 + 0.1 * k) for k in (1, 2)))
    how = {"factor": 1.0} | changed
    factors = {k: how["factor"] * (1.0 + 0.1 * k) for k in (1, 2)}
    b = run(
        *(measured(k, noise=1.0, seed=7, **how | {"factor": factors[k]}) for k in (1, 2)), name="b"
    )
    found, error = zero_shift(a, b, [Setting.of(1), Setting.of(2)])
    assert found == pytest.approx(shift, abs=3.0 * error + 1e-12)
    lines = compare_runs(a, b, MEASURED).of("force")
    assert any(line.is_sure for line in lines) == ("factor" in changed)


def test_what_one_stroke_alone_has_is_no_shift() -> None:
    """It is a change of the damper, however like a tare it looks."""
    a, b = measured(1, noise=0.5), measured(1, noise=0.5, seed=2)
    b.strokes["rebound"][0] += 6.0
    assert zero_shift(run(a), run(b), [Setting.of(1)]) == (0.0, 0.0)


def test_a_scatter_of_tests_keeps_a_difference_from_being_called_one() -> None:
    quiet = run(measured(noise=2.0, seed=1))
    other = run(measured(factor=1.03, noise=2.0, seed=2), name="b")
    line = next(one for one in compare_runs(quiet, other, MEASURED).of("force"))
    assert compare_runs(quiet, other, MEASURED).of("force")[-1].verdict == DIFFERENT
    factors = (0.97, 1.03, 0.96, 1.04)
    loud = run(*(measured(factor=f, noise=2.0, seed=k) for k, f in enumerate(factors)))
    found = compare_runs(loud, other, MEASURED)
    assert found.of("force")[-1].verdict != DIFFERENT
    assert any("tests of one setting differ by" in str(note) for note in found.notes)
    assert line.is_measured


def test_repeats_are_the_measure() -> None:
    factors = (1.0, 1.02, 0.98, 1.01)
    reference = [run(measured(factor=f), name=str(f)) for f in factors]
    other = run(measured(factor=1.03), name="b")
    bare = compare_runs(reference[0], other, MEASURED)
    assert {line.verdict for line in bare.of("force")} == {DIFFERENT}
    found = compare_runs(reference[0], other, MEASURED, repeats=reference[1:])
    line = found.of("force")[-2]
    at = [one.tests[0].force_at(line.subject.speed, "rebound")[0] for one in reference]
    assert line.first.value == pytest.approx(np.mean(at))
    reach = 3.182446 * np.std(at, ddof=1) * math.sqrt(1.25)  # Student's t, three degrees
    assert line.high - line.difference == pytest.approx(reach, rel=1e-5)
    assert line.verdict != DIFFERENT
    far = compare_runs(
        reference[0], run(measured(factor=1.2), name="c"), MEASURED, repeats=reference[1:]
    )
    assert far.of("force")[-2].verdict == DIFFERENT


def test_a_force_near_nothing_has_newtons_and_no_per_cent() -> None:
    top = DAMPING * float(measured().speeds[-1]) + GAS
    edge = (0.05 * top - GAS) / DAMPING
    options = ComparisonOptions(speeds=(edge - 1e-3, edge + 1e-3), is_measured=True)
    found = compare_runs(run(measured(noise=0.1)), run(measured(noise=0.1, seed=1)), options)
    below, above = (line for line in found.of("force") if line.subject.stroke == "rebound")
    assert math.isnan(below.percent)
    assert math.isfinite(below.high)
    assert math.isfinite(above.percent)


def test_no_setting_or_motion_in_common_is_said() -> None:
    for other, says in (
        (measured(2), "no setting is common to all: a has setting 1"),
        (measured(frequency=3.0), "no motion is common"),
    ):
        with pytest.raises(ConfigurationError, match=says):
            compare_runs(run(measured()), run(other, name="b"), MEASURED)


def test_a_log_of_an_older_run_is_one_motion_from_its_first_sample_to_its_last() -> None:
    """Its run.json tells no segments; a cycle lasts as long as its samples."""
    log, (told,) = signals(1, factor=1.1, noise=2.0)
    facts = {"log": log.log, "frequency_Hz": told["frequency_Hz"], "temperature_degC": 26.0}
    run = results.Run({"inputs": [facts, "junk"]}, signals=(log,))
    (found,) = run.tests
    (whole,) = measured_tests(log, [told], temperature=26.0)
    assert (found.n_cycles, found.temperature) == (whole.n_cycles, 26.0) == (10, 26.0)
    np.testing.assert_allclose(found.force, whole.force, rtol=1e-6)
