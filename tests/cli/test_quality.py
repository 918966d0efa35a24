"""Strict quality through the commands; what each finding is worth is held in `conditioning/`."""

import json
from pathlib import Path

import pytest


@pytest.fixture
def rows(logs) -> list[list[str]]:
    """Rows of a good log of setting 2."""
    lines = (logs / "setting_02.csv").read_text().splitlines()
    return [line.split(",") for line in lines if line[:1].isdigit()]


def write(path: Path, rows, *, end="\n") -> None:
    lines = ["time_s,displacement_mm,force_N,temperature_degC", *map(",".join, rows)]
    path.write_text("\n".join(lines) + end)


def test_strict_quality_leaves_a_log_out_and_ends_with_4(run, logs, tmp_path, rows) -> None:
    clipped = [[t, x, str(min(float(f), 380.0)), warmth] for t, x, f, warmth in rows]
    write(tmp_path / "clipped_s3.csv", clipped)
    good = logs / "setting_01.csv"
    ended = run("identify", good, "clipped_s3.csv", "--strict", "--out", "strict")
    assert ended.code == 4
    assert "1 setting fitted, 1 left out" in ended.err
    record = json.loads((tmp_path / "strict" / "run.json").read_text())
    (failure,) = record["failures"]
    assert (failure["log"], failure["kind"]) == ("clipped_s3.csv", "QualityError")
    assert "force is clipped" in failure["message"]
    assert " more)" not in failure["message"]  # it is the only warning
    assert record["gates_missed"] == ["strict quality: clipped_s3.csv left out for warnings"]
    checks = {check["name"]: check for check in record["checks"]}
    assert checks["every_setting_fitted"]["reason"] == "clipped_s3.csv left out"
    assert [row["verdict"] for row in record["inputs"]] == ["refused", "good"]
    # A real failure counts before the gate.
    write(tmp_path / "gap_s4.csv", [*rows[:700], *rows[720:]])
    assert run("identify", good, "*.csv", "--strict", "--out", "strict").code == 1


def test_a_cut_last_line_fails_strict_quality(run, tmp_path, rows) -> None:
    write(tmp_path / "cut_s2.csv", rows, end="\n4.666,-12")
    (tmp_path / "strict.toml").write_text("[rig]\nstrict = true\n")
    assert run("inspect", "cut_s2.csv").code == 0
    for command, how in (("inspect", "--strict"), ("identify", "--config=strict.toml")):
        ended = run(command, "cut_s2.csv", how)
        assert ended.code == 4
        assert "the last row may be cut" in ended.err
