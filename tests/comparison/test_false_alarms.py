"""A few of the pairs that `python -m tests.comparison.false_alarms` counts by hundreds."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from damperfit.comparison import Sameness
from tests.comparison.false_alarms import (
    CHANGE,
    compared_pairs,
    errors_of_shares,
    found,
    rig,
    shares,
)


@pytest.fixture(scope="module")
def reference():
    return rig(duration=6.0)


def test_noise_alone_is_not_called_a_difference(reference) -> None:
    told = shares(compared_pairs(reference, reference, 3))
    for share, surely in told.values():
        assert share <= 0.1
        assert surely == 0.0


def test_the_error_of_a_share_counts_campaigns_and_not_lines() -> None:
    """Of six campaigns one is off: its lines are no independent ones."""

    def compared(*, is_off: bool) -> SimpleNamespace:
        verdict = Sameness.DIFFERENT if is_off else Sameness.SAME
        lines = [SimpleNamespace(chance=0.5, verdict=verdict)] * 10
        return SimpleNamespace(of=lambda _kind: lines)

    pairs = [(i, k) for i in range(6) for k in range(i)]
    one_off = {pair: compared(is_off=0 in pair) for pair in pairs}
    # Without it nothing differs, without another 4 of 10 pairs do.
    rates = np.array([0.0, *[0.4] * 5])
    expected = np.sqrt(5 * np.var(rates))
    assert errors_of_shares(one_off, 6)["force"] == pytest.approx(expected)
    assert errors_of_shares({pair: compared(is_off=False) for pair in pairs}, 6)["force"] == 0.0


def test_one_per_cent_of_a_valve_is_found_and_a_tenth_of_it_is_not_made_up(reference) -> None:
    changed = compared_pairs(reference, rig(factor=1.0 + CHANGE, duration=6.0), 1)
    assert found(changed) == 1.0
    for line in changed[0].of("parameter"):
        if line.subject.name == "r_m1":
            assert line.percent_low <= 100.0 * CHANGE <= line.percent_high
    forces = changed[0].of("force")
    assert any(line.is_sure for line in forces)
