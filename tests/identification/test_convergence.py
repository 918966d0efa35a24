"""The command that counts ends in the best known minimum, on one damper of each topology."""

from __future__ import annotations

import math

import numpy as np
import pytest

from tests.identification.convergence import KINDS, REACHED, Outcome, log_of, made_up, run_damper


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_identify_and_most_random_starts_end_in_the_best_known_minimum(kind):
    found = run_damper(kind, 0, 4)
    assert found.own <= REACHED * found.best
    assert found.share >= 0.75


def test_a_start_that_cannot_be_simulated_has_not_reached_it():
    found = Outcome(1.0, 1.0, (1.019, 1.021, math.inf, 1.0), {}, {})
    assert found.share == 0.5


@pytest.mark.parametrize("kind", KINDS)
def test_made_up_dampers_differ_and_their_logs_reach_the_openings(kind):
    model, truth = made_up(kind, 1)
    assert truth != made_up(kind, 2)[1]
    assert truth == made_up(kind, 1)[1]
    trace = log_of(model, truth, 1)
    assert len(trace.stretches) == 3
    peak = float(np.max(trace.force[trace.compared]))
    assert peak > 0.9 * truth.rebound_opening * model.pressed_areas[0]
