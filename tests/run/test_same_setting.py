"""The same test twice counts once; tests of one setting that contradict each other are named."""

from dataclasses import replace

import numpy as np
import pytest

from damperfit.configuration.loading import load_configuration
from damperfit.recording import SegmentFigures
from damperfit.run.logs import Log, LogBatch
from damperfit.run.preparation import once_each, without_contradictions, without_copies
from damperfit.tested.setting import Setting
from tests.fakes import trace

NOISE = np.random.default_rng(5)


def log(name, setting=1, *, rebound=1000.0, bump=-800.0, speed=0.3, noise=4.0, temperature=26.0):
    """A log with one steady segment of known peak forces."""
    one = trace(setting, name)
    figures = SegmentFigures(rebound, bump, speed, speed, 1.0, 0.1, 0.0, 0.0)
    steady = {"kind": "steady", "figures": figures, "noise": noise, "peak_speed": speed}
    force = one.force + NOISE.normal(0.0, 0.02 * np.ptp(one.force), len(one.force))
    known = {"setting": Setting.of(setting), "force": force, "temperature": temperature}
    return replace(one, segments=(replace(one.segments[0], **steady),), **known)


def batch(*traces, paths=None):
    places = paths or [one.name for one in traces]
    logs = [Log(one.name, path) for one, path in zip(traces, places, strict=True)]
    return LogBatch(logs, list(traces))


def once(*traces, **how):
    found = batch(*traces, **how)
    once_each(found)
    return found


def checked(*traces):
    """What contradicts among logs of one motion is left out."""
    found = batch(*traces)
    without_contradictions(found, load_configuration(), is_law_open=True)
    return found


def names(found):
    return [one.name for one in found.traces]


def test_the_same_test_counts_once_and_is_not_held_out():
    first = log("a.csv")
    copy = replace(first, name="a.tdms", force=np.round(first.force, 3))
    found = once(first, copy, log("b.csv"))
    assert names(found) == ["a.csv", "b.csv"]
    assert list(map(str, found.remarks)) == ["a.tdms: the same test as a.csv; it counts once"]
    assert found.failures == []
    # The tests in one file are no twins.
    parts = [replace(first, name=f"a.txt part {k}") for k in (1, 2)]
    assert len(once(*parts, paths=["a.txt", "a.txt"]).traces) == 2
    # Nor are the last cycles of a fitted log a copy of it.
    found = batch(first)
    found.held_out = [copy, log("b.csv"), first]
    without_copies(found)
    assert [one.name for one in found.held_out] == ["b.csv", "a.csv"]
    told = "a.tdms: the same test as a.csv, which is fitted; it is not held out"
    assert list(map(str, found.remarks)) == [told]


@pytest.mark.parametrize(("share", "counts"), [(0.999, 1), (1.001, 2)])
@pytest.mark.parametrize("part", [slice(0, 111), slice(-111, None), slice(None)])
def test_the_first_samples_tell_nothing_that_all_do_not(share, counts, part):
    """A root mean square of a tenth of the noise, wherever in the log the difference lies."""
    first = log("a.csv")
    limit = max(0.1 * first.fastest.noise, 2e-5 * np.ptp(first.force))
    misses = np.zeros(len(first.force))
    misses[part] = 1.0
    misses *= share * limit / np.sqrt(np.mean(misses**2))
    found = once(first, replace(first, name="b.csv", force=first.force + misses))
    assert len(found.traces) == counts


# Half of the mean range is 900 N: 5 % of it are 45 N.
@pytest.mark.parametrize(
    ("change", "is_contradiction"),
    [
        *(({"rebound": 1043.0}, False), ({"rebound": 1048.0}, True)),
        *(({"bump": -843.0}, False), ({"bump": -848.0}, True)),
        ({"rebound": 1048.0, "noise": 20.0}, False),  # 3 times 20.4 N
        ({"rebound": 1200.0, "noise": 20.0}, True),
        ({"rebound": 1120.0, "speed": 0.314}, False),  # speed explains 2 x 4.6 % more
        ({"rebound": 1180.0, "speed": 0.314}, True),
        ({"rebound": 2000.0, "speed": 0.3144}, True),
        ({"rebound": 2000.0, "speed": 0.3162}, False),  # another motion
    ],
)
def test_what_contradicts(change, is_contradiction):
    found = checked(log("a.csv"), log("b.csv", **change), log("c.csv", 2))
    assert names(found) == (["c.csv"] if is_contradiction else ["a.csv", "b.csv", "c.csv"])
    assert [one.setting for one in found.failures] == [1] * is_contradiction


@pytest.mark.parametrize(
    ("rebound", "noise", "is_told"),
    [(1004.3, 1.0, False), (1004.7, 1.0, True), (1016.0, 4.0, False), (1018.0, 4.0, True)],
)
def test_what_differs_beyond_the_scatter_is_told_and_fitted(rebound, noise, is_told):
    """Half a per cent of half the range of 1800 N is 4.5 N; three times 4 N twice, 17 N."""
    found = checked(log("a.csv", noise=noise), log("b.csv", rebound=rebound, noise=noise))
    assert (names(found), found.failures) == (["a.csv", "b.csv"], [])
    begin = "setting 1: a.csv and b.csv differ by more than their cycles scatter: peak"
    assert [str(one).startswith(begin) for one in found.remarks] == [True] * is_told
