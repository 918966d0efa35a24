"""The loop of every fit: its endings, each just inside and just outside of its limit."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from damperfit.errors import SimulationError
from damperfit.identification.step_solvers import DenseSystem, Step
from damperfit.identification.trust_region import Ended, Stopping, _damped, iterate

X = np.linspace(0.0, 1.0, 30)
# A decay that is none: large residuals, so that the full steps become shorter slowly.
DATA = np.exp(-3.0 * X) + 0.4 * np.sin(9.0 * X)


def decay(u: np.ndarray) -> tuple[DenseSystem, np.ndarray]:
    curve = u[0] * np.exp(-u[1] * X)
    system = DenseSystem(curve - DATA, np.stack([curve / u[0], -X * curve], axis=1))
    return system, u


def full_length(ended: Ended[np.ndarray]) -> float:
    """Relative length of the full step that is left."""
    lengths = ended.system.lengths
    step = ended.system.scaled(lengths).step(0.0)
    return step.length / float(np.linalg.norm(lengths * ended.variables))


START = np.array([1.0, 1.0])


def test_a_slow_descent_goes_on_until_its_full_step_is_short() -> None:
    loose = iterate(decay, START, Stopping(rest=math.inf))
    left = full_length(loose)
    assert left > 1e-7
    # A limit just above what is left changes nothing, one just below asks for more.
    assert iterate(decay, START, Stopping(rest=1.3 * left)).evaluations == loose.evaluations
    tighter = iterate(decay, START, Stopping(rest=0.7 * left))
    assert tighter.evaluations > loose.evaluations
    assert full_length(iterate(decay, START, Stopping())) <= 1e-8
    assert loose.status == tighter.status == 2


def test_a_step_that_promises_too_little_is_not_tried() -> None:
    promised = decay(START)[0].scaled(np.ones(2)).step(0.0).effect
    kept = iterate(decay, START, Stopping(least_gain=1.01 * promised))
    assert (kept.evaluations, kept.status) == (1, 2)
    assert kept.variables.tolist() == START.tolist()
    assert iterate(decay, START, Stopping(least_gain=0.99 * promised)).evaluations > 1


@pytest.mark.parametrize("longest", [0.01, 0.3])
def test_no_step_is_longer_than_it_may_be(longest: float) -> None:
    seen = [START]

    def watched(u: np.ndarray) -> tuple[DenseSystem, np.ndarray]:
        seen.append(u)
        return decay(u)

    iterate(watched, START, Stopping(longest_step=longest, max_evaluations=8))
    changes = np.abs(np.diff(seen, axis=0)).max(axis=1)
    assert max(changes) == pytest.approx(longest)


@pytest.mark.parametrize("limit", [1, 3])
def test_the_limit_of_evaluations_is_not_passed(limit: int) -> None:
    ended = iterate(decay, START, Stopping(max_evaluations=limit))
    assert (ended.evaluations, ended.status) == (limit, 0)


def test_a_descent_among_failures_shrinks_until_its_steps_are_short() -> None:
    def lonely(u: np.ndarray) -> tuple[DenseSystem, np.ndarray]:
        if u.tolist() != START.tolist():
            raise SimulationError("nothing but the start")
        return decay(u)

    stopping = Stopping(step_tolerance=1e-4)
    ended = iterate(lonely, START, stopping)
    assert ended.status == 3
    assert ended.failed_trials == ended.evaluations - 1
    longer = iterate(lonely, START, replace(stopping, step_tolerance=1e-8))
    assert longer.failed_trials == ended.failed_trials + 4  # a tenth at each failure


def test_a_step_that_rises_is_not_taken() -> None:
    """From 2 the full step of arctan goes to -3.5, where the misfit is larger: back to 2."""
    seen: list[float] = []

    def bend(u: np.ndarray) -> tuple[DenseSystem, None]:
        seen.append(float(u[0]))
        return DenseSystem(np.arctan(u), (1.0 / (1.0 + u**2))[:, None]), None

    ended = iterate(bend, np.array([2.0]), Stopping())
    overshot = seen[1] - seen[0]
    assert seen[1] == pytest.approx(2.0 - 5.0 * math.atan(2.0))
    assert 0.1 <= (seen[2] - seen[0]) / overshot <= 0.55
    assert ended.variables == pytest.approx([0.0], abs=1e-8)


@pytest.mark.parametrize(("tilt", "is_met"), [(0.0, True), (1e-3, False)])
def test_residuals_at_right_angles_to_every_column_end_a_descent_at_its_start(
    tilt: float, *, is_met: bool
) -> None:
    def line(u: np.ndarray) -> tuple[DenseSystem, None]:
        return DenseSystem(np.array([u[0] - 1.0 + tilt, 1.0]), np.array([[1.0], [0.0]])), None

    ended = iterate(line, np.array([1.0]), Stopping())
    assert (ended.evaluations == 1) is is_met
    assert ended.variables == pytest.approx([1.0 - tilt], abs=1e-9)
    assert ended.status == 1


class Steps:
    """A solver of steps whose lengths are given; it keeps the damping that it was asked for."""

    is_full_rank = False

    def __init__(self, *lengths: float) -> None:
        self.lengths, self.asked = [2.0, *lengths], []

    def step(self, damping: float) -> Step:
        self.asked.append(damping)
        length = self.lengths[min(len(self.asked), len(self.lengths)) - 1]
        return Step(np.zeros(1), length, 1.0, 1.0)


def test_damping_that_falls_to_nothing_begins_again_at_a_thousandth_of_its_limit() -> None:
    """Of columns that depend on one another no lower limit of the damping is known."""
    steps = Steps(0.5, 1.0)
    damping, _ = _damped(steps, slope=20.0, radius=1.0, damping=0.3)
    # Half the radius at 0.3: the limit falls to that, and 0.3 - 0.5 is no damping.
    assert steps.asked == [0.0, 0.3, pytest.approx(0.3e-3)]
    assert damping == pytest.approx(0.3e-3)
