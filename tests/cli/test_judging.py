"""damperfit identify: profiles, many starts, gas content and cavitation in the results."""

from __future__ import annotations

import csv
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest

from damperfit.cli import main
from damperfit.damper.purdy.reference import reference_parameters
from damperfit.synthetic import SampleOptions, make_samples
from damperfit.uncertainty import profiles as profile_walk
from tests.identification.rig import recording


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


@pytest.mark.parametrize(
    ("options", "text"),
    [
        (("--profile", "k_f"), "no parameter 'k_f' to profile"),
        (("--profile", "f_f", "--fix", "f_f=50N"), "f_f is both fixed and to be profiled"),
        (("--bulk-modulus", "appendix1"), "expected procedure joint, found paper"),
        (("--bulk-modulus", "appendix2", "--procedure", "joint"), "Did you mean 'appendix1'"),
        (("--starts", "0"), "--starts: expected"),
    ],
)
def test_what_cannot_be_is_refused_before_any_log_is_read(run, logs, options, text) -> None:
    ended = run("identify", logs / "setting_01.csv", "--out", "r", *options)
    assert ended.code == 2
    assert text in ended.err


def test_many_starts_stand_in_the_report(run, logs, tmp_path) -> None:
    ended = run("identify", logs / "setting_*.csv", "--starts", "3", "--procedure", "plain")
    assert ended.code == 0
    record = json.loads((tmp_path / "results" / "run.json").read_text())
    assert [one["setting"] for one in record["searches"]] == [1, 2, 3]
    for one in record["searches"]:
        assert one["n_starts"] == sum(m["n_starts"] for m in one["minima"]) + one["n_failed"]
        assert set(one["minima"][0]["parameters"]) >= {"r_m1", "k_e"}
    report = (tmp_path / "results" / "report.md").read_text(encoding="utf-8")
    assert "## Many starts" in report
    assert "3 starts" in report


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


def test_r_m3_that_cannot_be_seen_is_called_by_name(run, tmp_path) -> None:
    known = {s: replace(reference_parameters(s), r_m3=2.6e3) for s in (1, 2)}
    make_samples(tmp_path / "made", SampleOptions(settings=(1, 2), cycles=8.0), parameters=known)
    ended = run("identify", tmp_path / "made" / "setting_*.csv")
    assert ended.code == 0
    assert "do not determine R_m3, but 2.597e+06" in ended.err
    report = (tmp_path / "results" / "report.md").read_text(encoding="utf-8")
    assert "## Identifiability" in report
    assert "r_m3 at settings 1, 2: these logs do not determine it (flat downward" in report
    rows = pq.read_table(tmp_path / "results" / "parameters.parquet").to_pylist()
    for row in rows:
        assert row["r_m3_status"] == "not_identifiable"
        assert row["r_m3_ci_low"] is None
        assert row["r_m3"] < row["r_m3_ci_high"] < 1e5
        # Used to be held at 2.597e6, which bent all the others.
        assert row["r_m1"] == pytest.approx(known[row["setting"]].r_m1, rel=5e-3)
        assert row["mse_percent"] < 0.01


def test_a_set_that_cavitates_is_told_what_gas_pressure_it_takes(run, tmp_path) -> None:
    known = {1: replace(reference_parameters(1), r_m3=3.6e6)}
    make_samples(tmp_path / "made", SampleOptions(settings=(1,), cycles=8.0), parameters=known)
    ended = run(
        "identify", tmp_path / "made" / "setting_01.csv", "--fix", "r_m3=3.6e6", "--fix", "f_f=50N"
    )
    assert ended.code == 0
    (row,) = pq.read_table(tmp_path / "results" / "parameters.parquet").to_pylist()
    assert row["cavitation_fraction"] > 0.1
    assert row["lowest_pressure"] == 0.0
    assert row["lowest_pressure_chamber"] == 2
    assert row["lowest_pressure_velocity"] > 0.0
    assert row["safe_gas_pressure"] == pytest.approx(3.92e5 * 3.6 / 2.597, rel=0.01)
    report = (tmp_path / "results" / "report.md").read_text(encoding="utf-8")
    assert "of the cycle with chamber 2 at zero pressure" in report
    assert "it takes a gas pressure of 5.4" in report


def profiled_run(tmp_path: Path, *, amplitude: float, more: tuple[str, ...]) -> dict[str, Any]:
    """A soft setting, a small stroke and noise: K_e is hardly seen. Returns what is told of it."""
    log = recording(4, noise=20.0, amplitude=amplitude, duration=5.0)
    rows = np.column_stack([log.time, log.displacement, log.force]).tolist()
    lines = ["time_s,displacement_m,force_N", *(",".join(map(repr, row)) for row in rows)]
    (tmp_path / "setting_4.csv").write_text("\n".join(lines) + "\n")
    fixed = ("--procedure", "plain", "--fix", "r_m3=2.597e6", "--fix", "f_f=50")
    out = tmp_path / "results"
    command = ["identify", str(tmp_path / "setting_4.csv"), "--out", str(out), "--quiet", *fixed]
    code = main([*command, *more])
    record = json.loads((out / "run.json").read_text(encoding="utf-8"))
    checks = {one["name"]: one for one in record["checks"]}
    return {
        "code": code,
        "row": pq.read_table(out / "parameters.parquet").to_pylist()[0],
        "check": checks["all_parameters_identifiable"],
        "verdict": record["uncertainty"][0]["verdicts"]["k_e"],
        "report": (out / "report.md").read_text(encoding="utf-8"),
    }


GATE = ("--check", "all_parameters_identifiable")


@pytest.mark.parametrize("asked", [False, True])
def test_a_profile_on_request_that_is_flat_has_the_last_word(
    tmp_path, monkeypatch, *, asked: bool
) -> None:
    # Without the quick look, which nobody asked for, the fit's own rough errors let K_e pass.
    monkeypatch.setattr(profile_walk, "is_doubtful", lambda *_: False)
    seen = profiled_run(
        tmp_path, amplitude=4e-3, more=(*GATE, *(("--profile", "k_e") if asked else ()))
    )
    row, check = seen["row"], seen["check"]
    assert row["k_e_status"] == ("not_identifiable" if asked else "fitted")
    assert row["outcome"] == ("not_identifiable" if asked else "converged")
    assert (row["k_e_ci_high"] is None) is asked
    assert row["k_e_ci_low"] is not None
    assert seen["code"] == (4 if asked else 0)
    if asked:
        assert 1e6 < row["k_e_ci_low"] < row["k_e"]
        assert "k_e" in str(check)
        assert "not identifiable upward: at least " in seen["verdict"]
        assert "not identifiable upward: at least " in seen["report"]


def test_a_profile_on_request_that_just_closes_leaves_the_parameter_fitted(tmp_path) -> None:
    seen = profiled_run(tmp_path, amplitude=9e-3, more=(*GATE, "--profile", "k_e"))
    row = seen["row"]
    assert seen["code"] == 0
    assert (row["k_e_status"], row["outcome"]) == ("fitted", "converged")
    assert row["k_e_ci_low"] < row["k_e"] < row["k_e_ci_high"]
    assert row["k_e_ci_high"] > 10.0 * row["k_e"]  # nearly open
    assert "by its profile" in seen["verdict"]
