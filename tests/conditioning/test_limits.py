"""The figures in the findings' module texts are those that the command measures."""

from __future__ import annotations

import pytest

from tests.conditioning.limits import FAULTS, measured

# What `damperfit.conditioning.channels` and `motion` say: name, parameter, per cent.
QUOTED = [
    ("force clipped at 98 %", "r_m2", 0.6),
    ("force clipped at 98 %", "k_e", 1.7),
    ("force clipped at 95 %", "r_m2", 2.0),
    ("force clipped at 95 %", "k_e", 8.0),
    ("displacement in 1000 steps", "k_e", 0.4),
    ("displacement in 500 steps", "k_e", 5.0),
    ("displacement in 250 steps", "k_e", 6.0),
    ("force in 125 steps", "k_e", 0.3),
    ("force in 62 steps", "k_e", 0.4),
    ("1 spike of 100 % of the range", "k_e", 4.0),
    ("20 spikes of 10 %", "k_e", 4.0),
    ("5 spikes of 2 %", "k_e", 0.3),
    ("force drifts by 1 %", "k_e", 1.6),
    ("force drifts by 3 %", "k_e", 5.0),
    ("stroke drifts by 5 %", "k_e", 0.7),
    ("20 um on the displacement", "k_e", 0.7),
    ("37 um on the displacement", "k_e", 2.4),
    ("67 um on the displacement", "k_e", 7.0),
]
BY_NAME = {fault.name: fault for fault in FAULTS}


@pytest.mark.slow
@pytest.mark.parametrize("name", dict.fromkeys(name for name, _, _ in QUOTED))
def test_what_a_fault_costs_is_what_the_text_says(name) -> None:
    worst, _ = measured(BY_NAME[name])
    for parameter, percent in ((p, cost) for quoted, p, cost in QUOTED if quoted == name):
        assert worst[parameter] == pytest.approx(percent, rel=0.15, abs=0.05)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "percent"),
    [
        ("sound", 0.01),
        ("logged at 100 Hz", 0.01),
        ("logged at 66 Hz", 0.01),
        ("4 % of the rows missing", 0.1),
    ],
)
def test_what_costs_next_to_nothing(name, percent) -> None:
    assert max(measured(BY_NAME[name])[0].values()) < percent


def test_the_sound_log_has_no_warning() -> None:
    _, seen = measured(BY_NAME["sound"])
    assert not any("warning" in finding for finding in seen)
