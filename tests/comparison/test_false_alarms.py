"""A few of the pairs that `python -m tests.comparison.false_alarms` counts by hundreds."""

import pytest

from tests.comparison.false_alarms import (
    CHANGE,
    compared_pairs,
    found,
    rig,
    shares,
)


@pytest.fixture(scope="module")
def reference():
    return rig(duration=6.0)


def test_noise_alone_is_not_called_a_difference(reference) -> None:
    told = shares(compared_pairs(reference, reference, 3))
    for share, _, surely in told.values():
        assert share <= 0.1
        assert surely == 0.0


def test_one_per_cent_of_a_valve_is_found_and_a_tenth_of_it_is_not_made_up(reference) -> None:
    changed = compared_pairs(reference, rig(factor=1.0 + CHANGE, duration=6.0), 1)
    assert found(changed) == 1.0
    for line in changed[0].of("parameter"):
        if line.subject.name == "r_m1":
            assert line.percent_low <= 100.0 * CHANGE <= line.percent_high
    forces = changed[0].of("force")
    assert any(line.is_sure for line in forces)
