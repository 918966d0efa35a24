"""Limits of verdicts, physical and statistical: a log just inside and one just outside of each."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from damperfit.conditioning import ConditionOptions, condition
from damperfit.errors import ConditioningError
from tests.conditioning.logs import sine_log
from tests.conditioning.test_quality import (
    LOG,
    OPTIONS,
    at,
    clipped,
    drifting,
    made,
    rounded,
    scattered,
    spiked,
    standing,
    wrongly_stamped,
)

STILL = made(noise=(0.0, 0.0))
SPEED = np.gradient(STILL.displacement, STILL.time)
SINE = sine_log()
SPRING = 30_000.0 * (SINE.displacement - 0.0123)  # N; beside it a damper takes little energy
LINE = np.linspace(-0.5, 0.5, len(LOG.time))
# Finding -> what spoils a log by so much, the most that is a note, the least that is a warning.
LIMITS = {
    "force_drift": (lambda s: drifting(STILL, "force", s), 0.0120, 0.0130),  # 1 % of the peak
    "stroke_drift": (lambda s: drifting(STILL, "displacement", s), 0.060, 0.064),
    "cycle_scatter": (lambda s: scattered(STILL, s), 0.0155, 0.0162),  # 1 %, and what chance adds
    "temperature": (lambda s: at(STILL, STILL.temperature + s), 0.99, 1.01),  # K
    "temperature_drift": (lambda s: at(STILL, 26.0 + s * LINE), 2.35, 2.45),  # 2 K inside
    "displacement_noise": (lambda s: made(noise=(4.0, s)), 28e-6, 30e-6),  # m
    "displacement_steps": (lambda n: rounded(STILL, "displacement", n), 502, 496),
    "force_steps": (lambda n: rounded(STILL, "force", n), 126, 123),
    "force_clipping": (lambda s: clipped(LOG, "force", 1.0 - s), 0.0034, 0.0039),
    "force_spikes": (lambda s: spiked(STILL, "force", [1500], s), 0.195, 0.207),
    "force_range": (lambda s: replace(STILL, force=STILL.force * s), 0.0071, 0.0067),  # 10 N
    "force_stuck": (lambda n: standing(LOG, "force", 2000, n), 10, 11),
    "velocity_channel": (lambda s: replace(STILL, velocity=(1.0 + s) * SPEED), 0.08, 0.12),
    "force_polarity": (lambda s: replace(SINE, force=SPRING + s * SINE.force), 0.3, 0.02),
    "jitter": (lambda s: wrongly_stamped(LOG, s), 0.030, 0.045),  # of a step
}


def severity(log, name: str, options: ConditionOptions = OPTIONS) -> str:
    return {one.name: one.severity for one in condition(log, options).findings}.get(name, "none")


@pytest.mark.parametrize("name", LIMITS)
def test_a_fault_is_a_warning_from_its_limit_on(name) -> None:
    spoil, inside, outside = LIMITS[name]
    assert severity(spoil(inside), name) != "warning"
    assert severity(spoil(outside), name) == "warning"


@pytest.mark.parametrize(("n_cycles", "is_used"), [(2.4, False), (3.1, True)])
def test_three_whole_cycles_are_a_test(n_cycles, is_used) -> None:
    log = sine_log(cycles=n_cycles, rate=500.0)
    if is_used:
        assert condition(log).n_cycles >= 2
    else:
        with pytest.raises(ConditioningError, match="expected at least 3"):
            condition(log)


@pytest.mark.parametrize(("n_lost", "is_used"), [(4, True), (5, False)])
def test_four_samples_in_a_row_may_be_missing(n_lost, is_used) -> None:
    log = sine_log(rate=500.0)
    kept = np.delete(np.arange(len(log.time)), np.s_[1000 : 1000 + n_lost])
    channels = {one: getattr(log, one)[kept] for one in ("time", "displacement", "force")}
    log = replace(log, **channels)
    if is_used:
        assert severity(log, "missing_samples") == "note"
    else:
        with pytest.raises(ConditioningError, match="gap of"):
            condition(log)


@pytest.mark.parametrize(
    ("change", "options", "says"),
    [
        ({"amplitude": 2.1e-4, "centre": 0.0}, {}, ""),
        ({"amplitude": 1.9e-4, "centre": 0.0}, {}, "was m read as mm"),
        ({"amplitude": 0.99, "frequency": 0.2}, {}, ""),
        ({"amplitude": 1.01, "frequency": 0.2}, {}, "was mm read as m"),
        ({}, {"chamber_lengths": (0.033, 0.033)}, ""),
        ({}, {"chamber_lengths": (0.031, 0.033)}, "stroke beyond the chamber"),
        ({}, {"chamber_lengths": (0.033, 0.031)}, "stroke beyond the chamber"),
        ({}, {"max_force": 800.0}, ""),
        ({}, {"max_force": 700.0}, "was N read as kN"),
        ({"frequency": 29.0, "amplitude": 0.002, "cycles": 90.0}, {}, ""),
        ({"frequency": 31.0, "amplitude": 0.002, "cycles": 90.0}, {}, "not below the filter"),
    ],
)
def test_a_motion_or_force_that_no_rig_makes_is_refused(change, options, says) -> None:
    log = sine_log(**{"rate": 500.0, **change})
    if not says:
        condition(log, ConditionOptions(**options))
        return
    with pytest.raises(ConditioningError, match=says):
        condition(log, ConditionOptions(**options))
