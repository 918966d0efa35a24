"""What it costs that the root of an orifice is rounded near no pressure, N."""

from __future__ import annotations

import numpy as np
import pytest

from damperfit.damper.purdy import parameters
from damperfit.damper.purdy.parameters import PURDY_DAMPER
from damperfit.damper.purdy.reference import reference_parameters
from damperfit.simulation import SolverOptions, simulate, sine_motion
from tests.laws.valve_logs import VALUES, damper

STANDARD = sine_motion(0.032, 1.5, cycles=3, sample_rate=1000.0)
TIGHT = 1e-6  # N a step: the integrator's own error is far below


def worst(one, other) -> float:
    return float(np.max(np.abs(one.force - other.force)))


@pytest.mark.parametrize(("rounding", "least", "most"), [(1.0, 0.0, 1e-4), (100.0, 0.01, 0.02)])
@pytest.mark.parametrize("setting", [1, 10, 20])
def test_a_pascal_cannot_be_seen_in_the_papers_damper(
    setting: int, rounding: float, least: float, most: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    found = []
    for one in (rounding, 0.01):
        monkeypatch.setattr(parameters, "_ROUNDING", one)
        values, options = reference_parameters(setting), SolverOptions(tolerance=TIGHT)
        found.append(simulate(values, PURDY_DAMPER, STANDARD, options=options))
    assert least < worst(*found) < most


def test_what_a_hundred_pascals_cost_a_damper_of_valves() -> None:
    """The default, of `SolverOptions.rounding`."""
    assert SolverOptions().rounding == 100.0
    model = damper()
    found = [
        simulate(model.values(VALUES), model, STANDARD, options=SolverOptions(TIGHT, rounding=one))
        for one in (100.0, 0.1)
    ]
    assert worst(*found) < 0.02
