"""`identify` with a setting that cannot be fitted: the others are complete, and it is told."""

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

from damperfit.damper.purdy.parameters import PURDY_DAMPER
from damperfit.damper.purdy.reference import reference_parameters
from damperfit.errors import SimulationError
from damperfit.identification import fit_problem
from damperfit.simulation import Motion, simulate, sine_motion


def _written(path: Path, setting: int, motion: Motion, force: np.ndarray, noise: float) -> Path:
    random = np.random.default_rng(setting)
    n = len(force)
    rows = np.column_stack(
        [
            motion.interval * np.arange(n),
            1e3 * motion.displacement + 1e-3 * random.standard_normal(n),
            force + noise * random.standard_normal(n),
        ]
    )
    head = f"# setting: {setting}\ntime_s,displacement_mm,force_N"
    np.savetxt(path, rows, fmt="%.5f", delimiter=",", header=head, comments="")
    return path


@pytest.fixture
def short_stroke(tmp_path: Path) -> Path:
    """Return setting 1 of an ordinary damper at +-0.3 mm."""
    motion = sine_motion(3e-4, 1.5, cycles=9, sample_rate=1000)
    force = simulate(reference_parameters(1), PURDY_DAMPER, motion).force
    return _written(tmp_path / "short_01.csv", 1, motion, force, 4.0)


@pytest.fixture
def break_short_strokes(
    monkeypatch: pytest.MonkeyPatch, fitted_anew: None
) -> Callable[[Exception], None]:
    """Let the simulation of a fit fail for logs of less than 1 mm."""

    def arrange(error: Exception) -> None:
        def broken(parameters: object, damper: object, motion: Motion, **kwargs: object) -> object:
            if np.max(np.abs(motion.displacement)) < 1e-3:
                raise error
            return simulate(parameters, damper, motion, **kwargs)  # type: ignore[arg-type]

        monkeypatch.setattr(fit_problem, "simulate", broken)

    return arrange


def _rows(folder: Path) -> dict[int, dict[str, object]]:
    table = pq.read_table(folder / "results" / "parameters.parquet").to_pylist()
    return {row["setting"]: row for row in table}


@pytest.mark.parametrize(
    "procedure",
    ["paper", *(pytest.param(one, marks=pytest.mark.slow) for one in ("joint", "plain"))],
)
@pytest.mark.parametrize(
    ("error", "kind", "said"),
    [
        (SimulationError("simulation failed: stiff."), "SimulationError", "simulation failed"),
        (
            np.linalg.LinAlgError("SVD did not converge"),
            "InternalError",
            "internal error while fitting, LinAlgError: SVD did not converge",
        ),
    ],
)
def test_one_that_cannot_be_fitted_is_one_line_and_code_1(
    run, logs, tmp_path, short_stroke, break_short_strokes, procedure, error, kind, said
) -> None:
    break_short_strokes(error)
    files = (short_stroke, logs / "setting_02.csv", logs / "setting_03.csv")
    ended = run("identify", *files, "--procedure", procedure)
    assert ended.code == 1
    assert f"damperfit: setting 1: {said}" in ended.err
    assert "2 settings fitted, 1 failed" in ended.err
    assert "Traceback" not in ended.err
    rows = _rows(tmp_path)
    assert list(rows) == [2, 3]
    assert all(row["outcome"] == "converged" for row in rows.values())
    record = json.loads((tmp_path / "results" / "run.json").read_text(encoding="utf-8"))
    assert record["exit_code"] == 1
    assert [(one["setting"], one["kind"]) for one in record["failures"]] == [(1, kind)]
    assert ("please report" in record["failures"][0]["message"]) is (kind == "InternalError")
    assert said in (tmp_path / "results" / "report.md").read_text(encoding="utf-8")


def test_where_that_is_the_only_setting_the_code_is_3(
    run, tmp_path, short_stroke, break_short_strokes
) -> None:
    break_short_strokes(ValueError("shapes"))
    ended = run("identify", short_stroke)
    assert ended.code == 3
    assert "internal error while fitting, ValueError: shapes" in ended.err
