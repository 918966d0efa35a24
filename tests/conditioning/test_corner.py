"""A corner that follows the motion, and refusals that offer the one that fits."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from damperfit.conditioning import ConditionOptions, condition
from damperfit.conditioning.filters import fitting_corner, with_corner
from damperfit.configuration.loading import load_configuration
from damperfit.errors import ConditioningError
from tests.conditioning.logs import recording, sine_log, static_force

AUTO = ConditionOptions(auto_corner=True)


@pytest.mark.parametrize(
    ("frequency", "rate", "corner"),
    [
        (0.2, 1000.0, 30.0),
        (1.5, 500.0, 30.0),
        (1.6, 500.0, 32.0),
        (10.0, 1024.0, 200.0),
        (10.0, 300.0, 120.0),
        (1.0, 50.0, 20.0),
        (0.0, 1000.0, 30.0),
    ],
)
def test_twenty_harmonics_pass(frequency, rate, corner):
    assert fitting_corner(frequency, rate) == corner


def found(trace):
    return {one.name: one for one in trace.findings}


def test_the_corner_follows_the_fastest_speed_and_is_said():
    parts = [
        a * np.sin(2 * np.pi * f * np.arange(round(6 / f * 1024)) / 1024.0)
        for f, a in ((0.5, 0.03), (5.0, 0.01), (1.0, 0.03))
    ]
    x = np.concatenate(parts)
    log = recording(np.arange(len(x)) / 1024.0, x, static_force(np.gradient(x, 1 / 1024.0)))
    trace = condition(log, AUTO)
    assert "-3 dB at 100 Hz" in trace.model_filter.description
    assert found(trace)["filter_corner"].sentence == (
        "filter corner 100 Hz, to fit the fastest motion of 5 Hz"
    )
    sweep = (
        np.sin(
            2
            * np.pi
            * (0.3 + 0.5 * 3.7 / 20.0 * np.arange(20480) / 1024.0)
            * np.arange(20480)
            / 1024.0
        )
        * 0.01
    )
    log = recording(np.arange(20480) / 1024.0, sweep, static_force(np.gradient(sweep, 1 / 1024.0)))
    assert found(condition(log, AUTO))["filter_corner"].value == pytest.approx(80.0, rel=0.1)


def test_the_paper_s_test_keeps_30_hz_also_with_auto():
    seen = [condition(sine_log(), options) for options in (ConditionOptions(), AUTO)]
    assert np.array_equal(seen[0].force, seen[1].force)
    assert "filter_corner" not in found(seen[0])


def test_a_knee_that_30_hz_hides_is_seen():
    log = sine_log(frequency=8.0, amplitude=0.006, cycles=20)
    jump = [np.diff(condition(log, options).force).max() for options in (ConditionOptions(), AUTO)]
    assert jump[1] > 1.5 * jump[0]


@pytest.mark.parametrize(("frequency", "is_reported"), [(3.6, False), (3.9, True)])
def test_fewer_than_eight_harmonics_are_told(frequency, is_reported):
    told = found(condition(sine_log(frequency=frequency, amplitude=0.01)))
    assert ("filter_corner" in told) is is_reported
    if is_reported:
        assert "conditioning.filter_corner = 'auto' takes 78 Hz" in told["filter_corner"].sentence


@pytest.mark.parametrize(
    "more", [{"auto_corner": False}, {"rig_filter": "causal"}, {"filter": "none"}]
)
def test_a_corner_that_is_not_ours_to_choose_stands(more):
    """Behind a filter in the rig the simulated force must pass that one, whatever the motion."""
    options = replace(AUTO, **more)
    assert with_corner(sine_log(frequency=5.0), options) == (options, ())


def offered(log, options):
    with pytest.raises(ConditioningError) as refusal:
        condition(log, options)
    key, corner = re.search(r"set ([a-z_.]+) = '([0-9.]+)Hz'", str(refusal.value)).groups()
    return key, float(corner)


def test_a_refusal_offers_a_corner_that_fits():
    slow = sine_log(rate=50.0)
    key, corner = offered(slow, ConditionOptions())
    assert (key, corner) == ("conditioning.filter_corner", 20.0)
    assert condition(slow, ConditionOptions(filter_corner=corner)).n_cycles > 5
    assert condition(slow, AUTO).n_cycles > 5
    key, corner = offered(slow, ConditionOptions(rig_filter="causal"))
    assert key == "rig.filter_corner"
    fast = sine_log(frequency=12.0, amplitude=0.003, cycles=60)
    key, corner = offered(fast, ConditionOptions(filter_corner=10.0))
    assert (key, corner) == ("conditioning.filter_corner", 240.0)
    assert condition(fast, replace(ConditionOptions(), filter_corner=corner)).n_cycles > 5


def test_the_configuration_knows_the_word(tmp_path):
    path = tmp_path / "rig.toml"
    path.write_text('[conditioning]\nfilter_corner = "auto"\n')
    assert load_configuration(path).conditioning.auto_corner
    path.write_text('[conditioning]\nfilter_corner = "60Hz"\n')
    options = load_configuration(path).conditioning
    assert (options.auto_corner, options.filter_corner) == (False, 60.0)
