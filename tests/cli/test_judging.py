"""damperfit identify: profiles, many starts, gas content and cavitation in the results."""

import csv
import json

import pyarrow.parquet as pq
import pytest

from damperfit.cli import main


def test_profiles_are_written_on_request_and_go_with_the_next_run(logs, tmp_path) -> None:
    command = ["identify", str(logs / "setting_*.csv"), "--out", str(tmp_path), "--quiet"]
    assert main([*command, "--profile", "k_e,r_m3", "--profile", "r_m1"]) == 0
    table = pq.read_table(tmp_path / "profiles.parquet")
    assert table.schema.field("k_e").metadata[b"unit"] == b"Pa"
    rows = table.to_pylist()
    with (tmp_path / "profiles.csv").open(encoding="utf-8") as file:
        assert [float(row["value"]) for row in csv.DictReader(file)] == [r["value"] for r in rows]
    followed = {(row["setting"], row["parameter"]) for row in rows}
    assert followed == {(1, "r_m3")} | {(s, name) for s in (1, 2, 3) for name in ("k_e", "r_m1")}
    for row in rows:
        assert row["value"] == row[row["parameter"]]
        assert row["misfit_rise"] >= -0.05
    record = json.loads((tmp_path / "run.json").read_text())
    assert {"profile_s", "judge_s"} <= record["timings"].keys()
    assert "profiles.parquet" in record["files"]
    assert "profiles" in record["schema"]
    assert len(record["profiles"]) == 7
    for one in record["profiles"]:
        assert one["shape"] == "closed"
        # Beside each other: the profile's limits and those of the sandwich covariance.
        wide = one["sandwich_ci_high"] - one["sandwich_ci_low"]
        assert one["ci_low"] == pytest.approx(one["sandwich_ci_low"], abs=0.02 * wide)
        assert one["ci_high"] == pytest.approx(one["sandwich_ci_high"], abs=0.02 * wide)
    assert record["uncertainty"][0]["verdicts"]["k_e"].endswith("by its profile")
    assert main(command) == 0
    assert not list(tmp_path.glob("profiles.*"))
    record = json.loads((tmp_path / "run.json").read_text())
    assert record["profiles"] == []
    assert "profiles.parquet" not in record["files"]


def test_the_gas_content_stands_in_the_report(run, logs, tmp_path) -> None:
    ended = run(
        "identify", logs / "setting_*.csv", "--procedure", "joint", "--bulk-modulus", "appendix1"
    )
    assert ended.code == 0
    record = json.loads((tmp_path / "results" / "run.json").read_text())
    found = record["gas_content"]
    assert found["volume_ratio_interval"]["low"] < found["volume_ratio"]
    assert set(found["pressures"]) == {"1", "2", "3"}
    rows = pq.read_table(tmp_path / "results" / "parameters.parquet").to_pylist()
    assert {row["k_e_status"] for row in rows} == {"shared"}
    assert rows[0]["k_e"] < rows[1]["k_e"] < rows[2]["k_e"]
    assert all(row["k_e_ci_low"] < row["k_e"] < row["k_e_ci_high"] for row in rows)
    report = (tmp_path / "results" / "report.md").read_text(encoding="utf-8")
    assert "gas content: V_r = " in report
