"""damperfit identify tells how far its numbers may be trusted."""

from __future__ import annotations

import json

import pyarrow.parquet as pq
import pytest

from damperfit.cli import main


@pytest.mark.parametrize("procedure", ["paper", "joint"])
def test_tables_and_run_json_carry_errors_and_correlations(logs, tmp_path, procedure) -> None:
    command = ["identify", str(logs / "setting_*.csv"), "--out", str(tmp_path), "--quiet"]
    shared = ["--share", "r_m3,f_f"] if procedure == "joint" else []
    assert main([*command, "--procedure", procedure, *shared]) == 0
    rows = pq.read_table(tmp_path / "parameters.parquet").to_pylist()
    truth = {row["setting"]: row for row in rows}
    for row in rows:
        for name in ("r_m1", "r_m2", "r_m3", "k_e", "f_f"):
            assert 0.0 < row[f"{name}_ci_low"] < row[name] < row[f"{name}_ci_high"]
            assert 0.0 < row[f"{name}_se"] < 0.1 * row[name]
        assert row["r_m3_status"] == row["f_f_status"] == "shared"
        assert row["f_0_se"] is None
    record = json.loads((tmp_path / "run.json").read_text())
    assert "judge_s" in record["timings"]
    assert [one["setting"] for one in record["uncertainty"]] == sorted(truth)
    for one in record["uncertainty"]:
        assert one["parameters"] == ["r_m1", "r_m2", "k_e", "r_m3", "f_f"]
        assert one["verdicts"]["f_0"] == "held at the value given"
        assert one["verdicts"]["r_m3"].startswith("shared by all settings, 95 % from 2.")
        assert one["verdicts"]["k_e"].startswith("fitted, 95 % from ")
        matrix = one["correlation"]
        assert [matrix[i][i] for i in range(5)] == pytest.approx([1.0] * 5)
        assert all(abs(value) <= 1.0 + 1e-12 for row in matrix for value in row)
        assert one["residuals"]["is_structured"] is False
    report = (tmp_path / "report.md").read_text(encoding="utf-8")
    assert "## Noise and lack of fit" in report
    assert "no misfit repeats from cycle to cycle" in report
    assert " ± " in report
    assert "sandwich covariance" in report


def test_an_unknown_shared_parameter_is_refused(logs, tmp_path, capsys) -> None:
    command = ["identify", str(logs / "setting_*.csv"), "--out", str(tmp_path / "r")]
    assert main([*command, "--procedure", "joint", "--share", "r_m4"]) == 2
    assert "no parameter 'r_m4'" in capsys.readouterr().err
    assert not (tmp_path / "r").exists()
