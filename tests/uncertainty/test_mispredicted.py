"""A test that was not fitted and is missed stands against the grade, whatever the fit's own MSE."""

from __future__ import annotations

import json
from dataclasses import replace

import pytest

from damperfit.cli import main
from damperfit.uncertainty import Prediction, missed_predictions
from damperfit.uncertainty.grades import LIMITS
from tests import fakes

PLAIN = Prediction(3, fakes.trace(3), False, 0.8, 0.1, 0.02, 0.05)


def kinds(*predictions: Prediction) -> list[str]:
    return [one.kind for one in missed_predictions(predictions).values()]


@pytest.mark.parametrize(
    ("mse", "expected", "is_missed"),
    [
        (0.51, 0.51 / 4.1, True),
        (0.51, 0.51 / 3.9, False),
        (0.49, 0.05, False),
        (120.0, 0.05, True),
    ],
)
def test_a_missed_test_stands_against_the_grade(
    mse: float, expected: float, *, is_missed: bool
) -> None:
    assert (LIMITS.predicted_percent, LIMITS.predicted_times) == (0.5, 4.0)
    one = replace(PLAIN, mse_percent=mse, expected_mse_percent=expected)
    assert kinds(one) == (["prediction"] if is_missed else [])


def test_a_repeat_and_a_setting_without_a_fit_are_no_test_of_a_fit() -> None:
    assert kinds(PLAIN) == ["prediction"]
    assert kinds(replace(PLAIN, is_same_motion=True)) == []
    assert kinds(replace(PLAIN, is_unseen=True)) == []


def test_a_run_withholds_the_grade_of_a_setting_whose_hold_out_is_missed(tmp_path) -> None:
    """A straight line through 0.2 m/s fits that speed alone; friction has its share at another."""
    import numpy as np

    from tests.laws.valve_logs import moved

    for name, speed in (("fast", 0.2), ("slow", 0.03)):
        motion = moved((speed,), amplitude=0.01, cycles=6)
        x, v = motion.displacement, np.gradient(motion.displacement, motion.interval)
        noise, n = np.random.default_rng(5), len(x)
        force = 900.0 * v + 12.0 * np.tanh(v / 0.02)
        rows = np.c_[motion.interval * np.arange(n), 1e3 * x, force + noise.normal(0.0, 0.5, n)]
        text = "\n".join(",".join(f"{one:.5f}" for one in row) for row in rows)
        (tmp_path / f"{name}.csv").write_text(
            f"# setting: 1\ntime_s,displacement_mm,force_N\n{text}\n"
        )
    out = tmp_path / "results"
    code = main(
        ["identify", str(tmp_path / "fast.csv"), str(tmp_path / "slow.csv"), "--hold-out",
         "slow.csv", "--model", "linear", "--out", str(out)]
    )  # fmt: skip
    assert code == 0
    record = json.loads((out / "run.json").read_text())
    (held,) = record["held_out"]
    assert held["mse_percent"] > 4.0 * held["expected_mse_percent"]
    (withheld,) = record["grades_withheld"]
    assert [one["kind"] for one in withheld["reasons"]] == ["prediction"]
    assert "slow.csv, which was not fitted, is missed" in withheld["reasons"][0]["sentence"]
    assert any("let the logs choose a model" in one for one in record["warnings"])
