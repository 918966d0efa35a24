"""The same test twice counts once; tests of one setting that contradict each other are named."""

from dataclasses import replace

import numpy as np
import pytest

from damperfit.configuration.loading import load_configuration
from damperfit.recording import StretchFigures
from damperfit.run.logs import Log, LogBatch
from damperfit.run.parting import once_each, without_contradictions, without_copies
from damperfit.tested.setting import Setting
from tests.fakes import trace

NOISE = np.random.default_rng(5)


def log(name, setting=1, *, rebound=1000.0, bump=-800.0, speed=0.3, noise=4.0, temperature=26.0):
    """A log with one steady stretch of known peak forces."""
    one = trace(setting, name)
    figures = StretchFigures(rebound, bump, speed, speed, 1.0, 0.1, 0.0, 0.0)
    stretch = replace(
        one.stretches[0], kind="steady", figures=figures, noise=noise, peak_speed=speed
    )
    force = one.force + NOISE.normal(0.0, 0.02 * np.ptp(one.force), len(one.force))
    return replace(
        one,
        setting=Setting.of(setting),
        stretches=(stretch,),
        force=force,
        temperature=temperature,
    )


def batch(*traces, paths=None):
    places = paths or [one.name for one in traces]
    logs = [Log(one.name, path) for one, path in zip(traces, places, strict=True)]
    return LogBatch(logs, list(traces))


def once(*traces, **how):
    found = batch(*traces, **how)
    once_each(found)
    return found


def checked(*traces, overlay=None):
    """What contradicts among logs of one motion is left out."""
    found = batch(*traces)
    without_contradictions(found, load_configuration(overlay=overlay), is_law_open=True)
    return found


def names(found):
    return [one.name for one in found.traces]


def test_the_same_test_in_another_format_counts_once():
    first = log("a.csv")
    printed = np.round(first.force, 3)
    found = once(first, replace(first, name="a.tdms", force=printed), log("b.csv"))
    assert names(found) == ["a.csv", "b.csv"]
    assert list(map(str, found.remarks)) == ["a.tdms: the same test as a.csv; it counts once"]
    assert found.failures == []


@pytest.mark.parametrize("order", [(0, 1, 2), (2, 1, 0), (1, 0, 2)])
def test_the_two_logs_that_are_furthest_apart_are_named(order):
    logs = [log(f"{n}.csv", rebound=force) for n, force in enumerate((1000.0, 1100.0, 1400.0))]
    found = checked(*(logs[k] for k in order))
    for failure in found.failures:
        assert "0.csv" in failure.message
        assert "2.csv" in failure.message
        assert "1.csv" not in failure.message
    assert found.failures


@pytest.mark.parametrize(
    ("rebound", "noise", "is_told"),
    [(1004.3, 1.0, False), (1004.7, 1.0, True), (1016.0, 4.0, False), (1018.0, 4.0, True)],
)
def test_what_differs_beyond_the_scatter_is_told_and_fitted(rebound, noise, is_told):
    """Half a per cent of half the range of 1800 N is 4.5 N; three times 4 N twice, 17 N."""
    logs = [log("a.csv", noise=noise), log("b.csv", rebound=rebound, noise=noise)]
    found = checked(*logs)
    assert names(found) == ["a.csv", "b.csv"]
    assert not found.failures
    assert [str(one).split(": peak")[0] for one in found.remarks] == [
        "setting 1: a.csv and b.csv differ by more than their cycles scatter"
    ] * is_told
    assert all("repeats within 5 %" in str(one) for one in found.remarks)


def test_a_log_at_another_gas_pressure_hides_no_contradiction():
    first = replace(log("a.csv"), gas_pressure=5e5)
    others = (log("b.csv"), log("c.csv", rebound=1400.0))
    found = checked(first, *others)
    (failure, *_) = found.failures
    assert "b.csv" in failure.message
    assert "c.csv" in failure.message
    assert "a.csv" not in failure.message


def test_the_tests_in_one_file_are_no_twins():
    first = log("a.txt part 1")
    second = replace(first, name="a.txt part 2")
    assert names(once(first, second, paths=["a.txt", "a.txt"])) == [
        "a.txt part 1",
        "a.txt part 2",
    ]


def test_one_test_under_two_settings_is_a_failure_of_both():
    first = log("a.csv", 3)
    other = replace(first, name="b.csv", setting=Setting.of(4))
    found = once(first, other, log("c.csv", 5))
    assert names(found) == ["c.csv"]
    (failure,) = found.failures
    assert failure.kind == "ContradictionError"
    assert "a.csv setting 3, b.csv setting 4" in failure.message


# Half of the mean range is 900 N: 5 % of it are 45 N.
@pytest.mark.parametrize(
    ("change", "is_contradiction"),
    [
        ({"rebound": 1043.0}, False),
        ({"rebound": 1048.0}, True),
        ({"bump": -843.0}, False),
        ({"bump": -848.0}, True),
        ({"rebound": 1048.0, "noise": 20.0}, False),  # 3 times 20.4 N
        ({"rebound": 1200.0, "noise": 20.0}, True),
        ({"rebound": 1120.0, "speed": 0.314}, False),  # speed explains 2 x 4.6 % more
        ({"rebound": 1180.0, "speed": 0.314}, True),
        ({"rebound": 2000.0, "speed": 0.3144}, True),
        ({"rebound": 2000.0, "speed": 0.3162}, False),  # another motion
    ],
)
def test_what_contradicts(change, is_contradiction):
    found = checked(log("a.csv"), log("b.csv", **change))
    assert (found.traces == []) is is_contradiction
    assert bool(found.failures) is is_contradiction


def test_a_contradiction_is_told_by_name_and_costs_its_setting_alone():
    found = checked(log("a.csv"), log("b.csv", rebound=1300.0, temperature=60.0), log("c.csv", 2))
    assert names(found) == ["c.csv"]
    (failure,) = found.failures
    assert failure.setting == 1
    assert failure.message.startswith(
        "setting 1: a.csv and b.csv contradict each other: peak force in rebound 1000 N and 1300 N "
        "at 0.3 m/s, 26.1 % apart, at 26 and 60 degC (covariate temperature fits both), more "
        "than their scatter; "
    )
    assert "--rig contradictions=average" in failure.message


def test_told_to_they_are_averaged_and_it_is_said():
    averaged = {"rig": {"contradictions": "average"}}
    found = checked(log("a.csv"), log("b.csv", rebound=1300.0), overlay=averaged)
    assert names(found) == ["a.csv", "b.csv"]
    assert "a.csv and b.csv contradict" in str(found.remarks[0])
    assert found.failures == []


def test_a_copy_of_a_fitted_log_is_not_held_out():
    fitted, other = log("a.csv"), log("b.csv")
    # The last cycles of a fitted log itself are no copy.
    found = batch(fitted)
    found.held_out = [replace(fitted, name="a_copy.csv"), other, fitted]
    without_copies(found)
    assert [one.name for one in found.held_out] == ["b.csv", "a.csv"]
    assert list(map(str, found.remarks)) == [
        "a_copy.csv: the same test as a.csv, which is fitted; it is not held out",
    ]


@pytest.mark.parametrize(("share", "counts"), [(0.999, 1), (1.001, 2)])
@pytest.mark.parametrize("where", ["first", "last", "all"])
def test_the_first_samples_tell_nothing_that_all_do_not(share, counts, where):
    """A root mean square of a tenth of the noise, wherever in the log the difference lies."""
    first = log("a.csv")
    limit = max(0.1 * first.fastest.noise, 2e-5 * np.ptp(first.force))
    n = len(first.force)
    part = {"first": slice(0, n // 9), "last": slice(-(n // 9), None), "all": slice(None)}[where]
    misses = np.zeros(n)
    misses[part] = 1.0
    misses *= share * limit / np.sqrt(np.mean(misses**2))
    found = once(first, replace(first, name="b.csv", force=first.force + misses))
    assert len(found.traces) == counts
