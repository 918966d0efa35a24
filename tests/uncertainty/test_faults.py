"""Faults that a fit absorbs are named, and their shifts are in the intervals."""

from __future__ import annotations

import numpy as np
import pytest

import damperfit
from damperfit.damper.purdy.reference import reference_parameters
from tests.identification.rig import recording
from tests.uncertainty.flaws import speed

SETTINGS = (4, 8, 12, 16, 20)


def logs(fault):
    return {str(one): fault(recording(one, noise=2.0), one) for one in SETTINGS}


def frame(log, force=None, displacement=None, time=None):
    return {
        "time_s": log.time if time is None else time,
        "displacement_m": log.displacement if displacement is None else displacement,
        "force_N": log.force if force is None else force,
    }


def pressed(log, _):
    turned = np.clip(speed(log) / 1e-4, -1.0, 1.0)
    return frame(log, log.force + 0.03 * turned * np.maximum(log.force, 0.0))


def by_position(log, _):
    turned = np.clip(speed(log) / 1e-4, -1.0, 1.0)
    return frame(log, log.force + 1e3 * turned * np.abs(log.displacement))


def drifting(log, _):
    return frame(log, log.force + 20.0 * log.time / log.time[-1])


def clock(log, setting):
    return frame(log, time=log.time * (1.02 if setting == 12 else 1.0))


def stroke(log, setting):
    return frame(log, displacement=log.displacement * (1.03 if setting == 12 else 1.0))


def sticking(log, _):
    turned = np.clip(speed(log) / 1e-4, -1.0, 1.0)
    return frame(log, log.force + 3.5 * turned * np.exp(-np.abs(speed(log)) / 0.02))


def gain(log, setting):
    return frame(log, log.force * (1.04 if setting == 12 else 1.0))


@pytest.mark.parametrize(
    ("fault", "code", "flaw"),
    [
        (gain, "misfit", "force_gain"),
        (sticking, "misfit-of-all", "friction_with_speed"),
        (pressed, "misfit", "friction_with_pressure"),
        (by_position, "misfit", "friction_with_position"),
        (drifting, "force_drift", ""),
        (clock, "clock-apart", ""),
        (stroke, "stroke-apart", ""),
    ],
)
def test_a_fault_is_named_and_what_it_moves_is_in_the_intervals(fault, code, flaw) -> None:
    run = damperfit.identify(logs(fault), jobs=1)
    told = [one for one in run.problems if one.code == code]
    assert told
    worst = max(told, key=lambda one: one.values.get("mse_percent", 0.0))
    assert flaw in worst.values.get("flaw", "")
    if code in {"clock-apart", "stroke-apart"}:
        return  # its own numbers are off, and only the rig can say by how much
    for setting in run.settings:
        truth = reference_parameters(int(setting.label))
        for name in ("r_m1", "r_m2", "k_e"):
            low, high = setting.intervals[name]
            value, true = getattr(setting.values, name), getattr(truth, name)
            assert abs(value - true) < max(0.02 * true, 1.5 * (high - low)), (setting, name)


def test_sound_logs_have_no_such_warning() -> None:
    run = damperfit.identify(logs(lambda log, _: frame(log)), jobs=1)
    told = {one.code for one in run.problems}
    assert not told & {"misfit", "force_drift", "clock-apart", "stroke-apart"}
