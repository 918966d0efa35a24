"""Logs of one setting under different motions that contradict each other are named."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from damperfit.conditioning import condition
from damperfit.configuration.loading import load_configuration
from damperfit.identification.unlike_motions import _differing
from damperfit.io import read_log
from damperfit.run.logs import LogBatch
from damperfit.run.parting import without_contradictions
from damperfit.tested.setting import Setting
from tests.conditioning.logs import sine_log, static_force
from tests.identification.rig import trace
from tests.laws.valve_logs import VALUES, damper, log_text, moved


@pytest.fixture(scope="module")
def slow_and_fast():
    """Settings 10 and 11 under 0.3 m/s, setting 10 under 0.15 m/s."""
    slow, fast, other = (
        trace(setting, noise=4.0, duration=4.0, seed=setting, amplitude=amplitude)
        for setting, amplitude in ((10, 0.016), (10, 0.032), (11, 0.032))
    )
    named = {"slow.csv": slow, "fast.csv": fast, "other.csv": other}
    return [replace(one, name=name, setting=Setting.of(10)) for name, one in named.items()]


def told(traces, overlay=None):
    batch = LogBatch(traces=list(traces))
    without_contradictions(batch, load_configuration(overlay=overlay))
    return batch


def test_a_log_of_the_next_click_is_named_and_averaged_where_that_is_asked(slow_and_fast):
    slow, fast, other = slow_and_fast
    left = told([slow, fast])
    assert (left.traces, left.failures, left.remarks) == ([slow, fast], [], [])
    left = told([slow, other])
    assert left.traces == []
    (failure,) = left.failures
    assert failure.kind == "ContradictionError"
    assert failure.message.startswith(
        "setting 10: slow.csv and other.csv contradict each other: both reach 0.128 m/s, where "
        "their damping forces are "
    )
    assert "--rig contradictions=average" in failure.message
    left = told([slow, other], {"rig": {"contradictions": "average"}})
    assert left.traces == [slow, other]
    (remark,) = map(str, left.remarks)
    assert "slow.csv and other.csv contradict" in remark
    assert remark.endswith("; averaged")


def of_real_valves(path, amplitude, *, more=1.0):
    """A log of valves and an elastic mounting that the paper's law does not know."""
    model = damper(has_play_and_lag=False)
    values = {
        name: value * (more if name.endswith(("bleed", "opening", "slope")) else 1.0)
        for name, value in VALUES.items()
        if name in model.names
    }
    path.write_text(log_text(model, values, moved([0.2], amplitude=amplitude), setting=10))
    return condition(read_log(path))


@pytest.mark.slow
def test_where_the_law_does_not_suit_nothing_is_told(tmp_path):
    logs = [
        of_real_valves(tmp_path / "a.csv", 0.01),
        of_real_valves(tmp_path / "b.csv", 0.03, more=1.2),
    ]
    assert _differing(tuple(logs), [one.force for one in logs]) is not None
    assert told(logs).failures == []


@pytest.mark.parametrize(("more", "differs"), [(0.047, False), (0.055, True)])
def test_five_per_cent_are_a_difference(more, differs):
    logs = [
        condition(sine_log(frequency=1.5, cycles=8.0, rate=1000.0, amplitude=a))
        for a in (0.016, 0.032)
    ]
    speed = 0.85 * 2.0 * np.pi * 1.5 * 0.016
    forces = _differing(tuple(logs), [logs[0].force, (1.0 + more) * logs[1].force])
    assert (forces is not None) is differs
    if forces is not None:
        half = 0.5 * (static_force(np.array([speed])) - static_force(np.array([-speed])))[0]
        assert forces[0] == pytest.approx(half, rel=0.01)
