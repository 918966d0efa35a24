"""Readings of fitted runs: degrees of freedom, what is shared, the motion that is common."""

from __future__ import annotations

import math
from types import SimpleNamespace

import pytest

from damperfit.adjustment.force_at import Sine, Stage
from damperfit.comparison import ComparisonOptions
from damperfit.comparison.comparing import _figure_lines, _freedom_of, _parameter_readings, _speeds
from damperfit.damper.purdy.parameters import PURDY_DAMPER
from damperfit.damper.purdy.reference import reference_parameters
from damperfit.simulation import SolverOptions
from damperfit.tested.setting import Setting
from tests.fakes import fitted_run as fitted_run_of

SETTINGS = (Setting.of(1), Setting.of(2))


def _row(n_cycles: int, n_logs: int, **more: object) -> dict:
    row: dict = {"n_cycles": n_cycles, "n_logs": n_logs}
    for one in PURDY_DAMPER.quantities:
        status = "shared" if one.name in {"r_m3", "f_f"} else "fitted"
        row |= {one.name: 5.0, f"{one.name}_se": 0.1, f"{one.name}_status": status}
    return row | {"f_0_status": "fixed"} | more


TESTED = Sine(0.032, 1.5)
ROWS = (_row(13, 1), _row(12, 2))


def _fitted(sine: Sine = TESTED, rows: tuple = ROWS):
    stages = tuple(Stage(one, reference_parameters(1)) for one in SETTINGS)
    known = dict(zip(SETTINGS, rows, strict=True))
    solver = SolverOptions()
    return fitted_run_of(PURDY_DAMPER, stages, sine, (), known, PURDY_DAMPER.quantities, solver)


def test_cycles_less_one_a_log_are_the_degrees_of_freedom() -> None:
    assert [_freedom_of(_fitted(), one) for one in SETTINGS] == [12.0, 10.0]
    assert _freedom_of(_fitted(rows=({}, {})), SETTINGS[0]) == math.inf


def test_what_all_share_stands_once_with_the_cycles_of_all() -> None:
    (table,) = _parameter_readings([_fitted()], SETTINGS)
    told = {(topic.name, topic.setting): one.freedom for topic, one in table.items()}
    assert told["r_m3", None] == 22.0
    assert told["r_m1", SETTINGS[1]] == 10.0
    assert ("f_0", SETTINGS[0]) not in told
    apart = _fitted(rows=(_row(13, 1), _row(12, 2, r_m3=6.0)))
    (table,) = _parameter_readings([apart], SETTINGS)
    assert {topic.setting for topic in table if topic.name == "r_m3"} == set(SETTINGS)


@pytest.mark.parametrize("status", ["at_bound", "not_identifiable"])
def test_what_the_logs_do_not_tell_is_not_compared(status) -> None:
    rows = (_row(13, 1, r_m1_status=status), _row(12, 2))
    (table,) = _parameter_readings([_fitted(rows=rows)], SETTINGS)
    told = {(topic.name, topic.setting): one.objection for topic, one in table.items()}
    assert told["r_m1", SETTINGS[0]]
    assert not told["r_m1", SETTINGS[1]]


def test_speeds_are_those_that_all_tests_have_reached() -> None:
    slow, fast = _fitted(Sine(0.02, 1.1)), _fitted(Sine(0.032, 1.5))
    assert _speeds([slow, fast], ComparisonOptions()) == (0.05, 0.1, 0.13)
    faster = ComparisonOptions(sine=Sine(0.032, 1.5))
    assert _speeds([slow, fast], faster) == (0.05, 0.1, 0.13, 0.26, 0.3)
    assert _speeds([slow], ComparisonOptions(speeds=(0.7,))) == (0.7,)


def test_misfits_and_margins_are_told_in_per_cent() -> None:
    """A misfit is stored in per cent, a margin as a share."""
    rows = (
        {"mse_percent": 0.5, "grade": "excellent", "r_m3_cavitation_margin": 0.25},
        {"mse_percent": 0.8, "grade": "good", "r_m3_cavitation_margin": None},
    )
    first, second = (SimpleNamespace(row=lambda _, row=row: row) for row in rows)
    misfit, margin = _figure_lines(first, second, [Setting.of(1)])  # type: ignore[arg-type]
    assert (misfit.first.value, misfit.second.value, misfit.words) == (
        0.5, 0.8, "excellent, now good",
    )  # fmt: skip
    assert misfit.difference == pytest.approx(0.3)
    assert (margin.first.value, margin.words) == (25.0, "both full")
    assert math.isnan(margin.second.value)
