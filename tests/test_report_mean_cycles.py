"""Figures of a log on the page are means of its cycles; advice to let the logs choose a model."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from damperfit.damper.purdy.parameters import PURDY_DAMPER
from damperfit.damper.valve_dampers import TwinTube
from damperfit.report.logs import evaluate_logs
from damperfit.results import Run
from damperfit.run.trust import other_model_advice
from damperfit.simulation import characterise, mean_figures, simulate, sine_motion
from damperfit.tables import LogSignals
from damperfit.tested.setting import Setting
from damperfit.uncertainty import Assessment, Objection
from tests.fakes import fit


def signals(n_cycles: int) -> LogSignals:
    """A force that grows by a tenth from cycle to cycle."""
    n = 400
    phase = np.arange(n * n_cycles) / n
    x, v = 0.03 * np.sin(2 * np.pi * phase), 0.03 * 2 * np.pi * np.cos(2 * np.pi * phase)
    force = 1000.0 * v * (1.0 + 0.1 * np.floor(phase))
    steady = 1000.0 * v
    pressures = np.ones((3, len(x)))
    return LogSignals(Setting.of(1), "a.csv", phase, x, v, force, steady, pressures)


@pytest.mark.parametrize("n_cycles", [1, 2, 5])
def test_measured_figures_are_the_mean_of_all_cycles(n_cycles: int) -> None:
    results = Run(signals=(signals(n_cycles),))
    (view,) = evaluate_logs(results)
    mean = 1.0 + 0.05 * (n_cycles - 1)
    (rebound,) = (one.rebound for one in view.measured.speed_forces if one.speed == 0.1)
    # Ends of a cycle lie where the force steps up; the branches are half a cycle apart.
    assert rebound == pytest.approx(100.0 * mean, rel=0.02)
    assert view.simulated.energy == pytest.approx(
        np.pi * 0.03 * 1000.0 * 0.03 * 2 * np.pi, rel=1e-3
    )
    assert view.measured.energy == pytest.approx(view.simulated.energy * mean, rel=5e-3)


def test_means_keep_what_only_some_cycles_reach_out() -> None:
    motion = sine_motion(0.032, 1.5, cycles=2, sample_rate=500)
    one = characterise(simulate(fit(1).parameters, PURDY_DAMPER, motion), 1.5)
    slow = replace(one, speed_forces=one.speed_forces[:1], energy=one.energy + 2.0)
    both = mean_figures([one, slow])
    assert both.speed_forces == one.speed_forces[:1]
    assert both.energy == (one.energy + slow.energy) / 2
    assert both.pressure_ranges == one.pressure_ranges


def judged(kind: str) -> Assessment:
    return Assessment(objections={Setting.of(3): (Objection(kind, "", "much"),)})


def test_the_advice_is_to_let_the_logs_choose_where_they_did_not() -> None:
    (said,) = other_model_advice(judged("misfit"), PURDY_DAMPER)
    assert "model purdy does not describe setting 3: let the logs choose a model" in said
    assert "identify LOGS --model auto" in said
    # Declared valves may lack play or a lag; of what the logs chose nothing is advised.
    (said,) = other_model_advice(judged("misfit"), TwinTube())
    assert "model twin_tube does not describe setting 3: let the logs choose a model" in said
    assert list(other_model_advice(judged("misfit"), TwinTube(), is_chosen_by_logs=True)) == []
    # A wrong tare is no matter of the law, and without doubt there is no advice.
    assert list(other_model_advice(judged("offset"), PURDY_DAMPER)) == []
    assert list(other_model_advice(Assessment(), PURDY_DAMPER)) == []
