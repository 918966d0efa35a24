"""Findings whose number and words nobody else looks at."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from damperfit.conditioning.corrections import _of_wandering, _removed
from damperfit.conditioning.motion import _stretches
from damperfit.conditioning.skew import _straight
from tests import fakes


@pytest.mark.parametrize(("n", "begins"), [(1, "1 stretch evaluated: "), (2, "2 stretches evalu")])
def test_stretches_are_counted_in_words(n, begins) -> None:
    log = fakes.trace(1)
    found = _stretches(replace(log, stretches=log.stretches[:1] * n))
    assert found.sentence.startswith(begins)
    assert found.value == n


def test_a_tare_is_accounted_for_by_an_offset_that_is_known() -> None:
    offset = SimpleNamespace(is_known=True, name="f_0")
    said = _removed("0 N where 90 N are expected", None, SimpleNamespace(offset=offset))
    assert said == "gas force tared away: 0 N where 90 N are expected; f_0 accounts for it"


@pytest.mark.parametrize(
    ("centre", "severity", "value", "words"),
    [
        (0.0, "note", 0.0, "the log's 0 is taken as x = 0 of the model (the range's middle is "),
        (0.012, "warning", 0.012, "the middle of the range (12.0 mm) is taken as x = 0 of the "),
    ],
)
def test_a_motion_without_a_middle_asks_for_one(centre, severity, value, words) -> None:
    """The finding's number is in metres, those of its sentence in millimetres."""
    found = _of_wandering(replace(fakes.trace(1), centre=centre), 0.003)
    assert (found.severity, found.value, found.unit) == (severity, value, "m")
    assert words in found.sentence
    assert ("middle is 3.0 mm" in found.sentence) is (centre == 0.0)
    assert found.sentence.endswith(("if it is elsewhere", ": set rig.centre"))


def test_turns_that_do_not_repeat_are_on_no_straight_line() -> None:
    """Of cycles the ends are drawn onto one; a road's are left as they are."""
    trace = fakes.trace(1)
    at = np.array([0.0, 1.02, 1.98, 3.0]) / trace.frequency
    straight = _straight(at, trace)
    assert np.ptp(np.diff(straight)) < 1e-12 < np.ptp(np.diff(at))
    road = replace(trace.fastest, kind="moving", cycle_starts=np.empty(0))
    assert _straight(at, replace(trace, stretches=(road,))) is at
    assert _straight(at[:2], trace) is not straight
