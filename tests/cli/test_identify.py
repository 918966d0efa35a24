"""damperfit identify: files, exit codes, failures that stay alone, sets that never mix."""

import csv
import hashlib
import json
import resource
import shutil
from pathlib import Path

import pyarrow.parquet as pq
import pytest

from damperfit.cli import main
from tests.fakes import values_in

FILES = {
    "parameters.parquet",
    "parameters.csv",
    "mse.parquet",
    "mse.csv",
    "adjustment.parquet",
    "adjustment.csv",
    "characteristics.parquet",
    "characteristics.csv",
    "responses.parquet",
    "report.md",
    "run.json",
}
TABLES = sorted(FILES - {"run.json", "report.md"})


def _bytes(folder: Path) -> dict[str, bytes]:
    return {name: (folder / name).read_bytes() for name in TABLES}


def _record(folder: Path) -> dict:
    return json.loads((folder / "run.json").read_text())


def test_the_parameters_are_the_true_ones(logs, results) -> None:
    truth = values_in(logs / "truth.csv")
    found = values_in(results / "parameters.parquet")
    assert found == values_in(results / "parameters.csv")
    for setting, true in truth.items():
        assert found[setting].r_m1 == pytest.approx(true.r_m1, rel=2e-3)
        assert found[setting].r_m2 == pytest.approx(true.r_m2, rel=5e-3)
        assert found[setting].k_e == pytest.approx(true.k_e, rel=2e-2)
        assert found[setting].r_m3 == pytest.approx(true.r_m3, rel=1e-2)
        assert found[setting].f_f == pytest.approx(true.f_f, rel=2e-2)


def test_run_json_tells_the_whole_story(logs, results) -> None:
    record = _record(results)
    assert {
        "version",
        "configuration",
        "inputs",
        "failures",
        "warnings",
        "timings",
        "schema",
    } <= record.keys()
    assert record["failures"] == []
    first = record["inputs"][0]
    digest = hashlib.sha256((logs / "setting_01.csv").read_bytes()).hexdigest()
    assert (first["log"], first["sha256"], first["setting"]) == ("setting_01.csv", digest, 1)
    assert record["configuration"]["damper"]["rod_diameter"] == "19mm"
    names = [column["name"] for column in record["schema"]["parameters"]]
    assert names == pq.read_schema(results / "parameters.parquet").names
    for name, known in record["files"].items():
        assert hashlib.sha256((results / name).read_bytes()).hexdigest() == known


def test_when_every_log_fails_the_code_is_3_and_the_tables_are_empty(run, tmp_path) -> None:
    (tmp_path / "setting_1.csv").write_bytes(b"")
    ended = run("identify", "setting_1.csv")
    assert ended.code == 3
    assert pq.read_table(tmp_path / "results" / "parameters.parquet").num_rows == 0
    assert pq.read_table(tmp_path / "results" / "responses.parquet").num_rows == 0
    assert len(_record(tmp_path / "results")["failures"]) == 1


def test_a_gate_that_is_not_met_is_code_4_and_everything_is_written(run, logs, tmp_path) -> None:
    ended = run("identify", logs / "setting_01.csv", "--max-mse", "0.00001")
    assert ended.code == 4
    assert "setting 1: MSE" in ended.err
    assert {path.name for path in (tmp_path / "results").iterdir()} == FILES
    assert run("identify", logs / "setting_01.csv", "--max-mse", "1").code == 0


def test_several_logs_of_one_setting_are_fitted_together(run, logs, repeated, tmp_path) -> None:
    text = (logs / "setting_01.csv").read_text()
    (tmp_path / "a").mkdir()
    (tmp_path / "b").mkdir()
    (tmp_path / "a" / "x.csv").write_text(text)
    (tmp_path / "b" / "x.csv").write_text(repeated(text, 1))
    ended = run("identify", "a/x.csv", "b/x.csv")
    assert ended.code == 0
    row = pq.read_table(tmp_path / "results" / "parameters.parquet").to_pylist()[0]
    assert (row["setting"], row["n_logs"]) == (1, 2)
    with (tmp_path / "results" / "mse.csv").open(newline="") as file:
        assert [r["log"] for r in csv.DictReader(file)] == ["", "a/x.csv", "b/x.csv"]


def test_a_log_without_a_setting_takes_the_one_given_or_fails(run, logs, tmp_path) -> None:
    text = (logs / "setting_02.csv").read_text().replace("# setting: 2\n", "")
    (tmp_path / "run.csv").write_text(text)
    ended = run("identify", "run.csv")
    assert ended.code == 3
    assert "--setting N" in ended.err
    assert run("identify", "run.csv", "--setting", "7").code == 0
    table = pq.read_table(tmp_path / "results" / "parameters.parquet")
    assert table["setting"].to_pylist() == [7]


def test_settings_that_the_configuration_expects_are_explicit_gaps(run, logs, tmp_path) -> None:
    (tmp_path / "rig.toml").write_text("[rig]\nsettings = [1, 2, 3, 4]\n")
    ended = run("identify", logs / "setting_0[13].csv", "--config", "rig.toml")
    assert ended.code == 1
    assert "setting 2: no log" in ended.err
    table = pq.read_table(tmp_path / "results" / "parameters.parquet")
    assert table["setting"].to_pylist() == [1, 2, 3, 4]
    assert table["outcome"].to_pylist()[1] == "missing"


def test_a_second_run_replaces_the_first_as_a_set(run, logs, tmp_path) -> None:
    run("identify", logs / "setting_*.csv")
    run("identify", logs / "setting_02.csv")
    folder = tmp_path / "results"
    assert {path.name for path in folder.iterdir()} == FILES
    for name in ("parameters", "mse", "responses"):
        assert set(pq.read_table(folder / f"{name}.parquet")["setting"].to_pylist()) == {2}
    assert [i["log"] for i in _record(folder)["inputs"]] == ["setting_02.csv"]


def test_a_full_disk_leaves_the_old_results_whole(spawn, logs, results, tmp_path) -> None:
    folder = tmp_path / "results"
    shutil.copytree(results, folder)
    before = {path.name: path.read_bytes() for path in folder.iterdir()}
    ended = spawn(
        "identify",
        logs / "setting_01.csv",
        # A limit on file sizes is the nearest to a full disk that needs no rights.
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (60_000, 60_000)),
    )
    assert ended.code == 1
    assert "earlier results there are untouched" in ended.err
    assert "Traceback" not in ended.err
    assert {path.name: path.read_bytes() for path in folder.iterdir()} == before


# damperfit identify: profiles, many starts, gas content and cavitation in the results.


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
