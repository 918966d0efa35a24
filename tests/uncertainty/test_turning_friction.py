"""A friction that turns in another form than the law's is in the errors of what takes it up."""

from __future__ import annotations

import numpy as np
import pytest

from damperfit.damper.friction import _SPREAD
from tests.uncertainty.drag_coverage import NAMES, SHARP, TURNING, Seals, errors_of

DRAG = NAMES.index("drag")


def counted(law, seals: Seals, seeds: int) -> tuple[np.ndarray, np.ndarray]:
    """Which intervals hold, by noise alone and with the misfit."""
    found = np.array([errors_of(law, seals, seed) for seed in range(seeds)])
    return tuple(np.abs(found.transpose(1, 0, 2)) < 1.96)


def test_a_freed_drag_is_covered_where_friction_turns_otherwise() -> None:
    alone, whole = counted(TURNING, Seals(noise=0.5), 8)
    assert alone[:, DRAG].sum() <= 4  # what was printed before
    assert whole[:, DRAG].sum() >= 7
    assert whole.mean() >= 0.9


def test_a_freed_drag_is_covered_where_the_law_turns_at_once() -> None:
    alone, whole = counted(SHARP, Seals(), 3)
    assert alone[:, DRAG].sum() == 0
    assert whole.mean() >= 0.9


@pytest.mark.slow
@pytest.mark.parametrize(
    ("law", "seals"),
    [
        (TURNING, Seals(within=0.0)),
        (TURNING, Seals()),
        (SHARP, Seals()),
        (TURNING, Seals(noise=0.5)),
    ],
)
def test_intervals_of_valves_and_seals_hold_the_truth(law, seals) -> None:
    _, whole = counted(law, seals, 60)
    assert whole.mean() >= 0.92
    assert whole[:, DRAG].mean() >= 0.9


def test_two_straight_lines_lack_as_much_below_their_speeds_as_a_hyperbolic_tangent() -> None:
    v = np.linspace(0.0, 20.0, 20001)
    lines = [np.clip(v / (1.386 * (1.0 + away)), 0.0, 1.0) for away in (-_SPREAD, _SPREAD)]
    lacking, truth = 1.0 - np.mean(lines, axis=0), 1.0 - np.tanh(v)
    for power in (0, 1):  # what a slow passage shows, and its first moment
        assert np.sum(v**power * lacking) == pytest.approx(np.sum(v**power * truth), rel=0.01)
