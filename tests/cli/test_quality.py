"""Faults of signals through the commands: verdict, findings, exit code, strict (F38-F52)."""

import json
from pathlib import Path

import pytest

HEAD = ["time_s,displacement_mm,force_N,temperature_degC"]


@pytest.fixture
def rows(logs) -> list[list[str]]:
    """Rows of a good log of setting 2."""
    lines = (logs / "setting_02.csv").read_text().splitlines()
    return [line.split(",") for line in lines if line[:1].isdigit()]


def write(path: Path, rows, *, end="\n", head=HEAD) -> Path:
    path.write_text("\n".join([*head, *(",".join(row) for row in rows)]) + end)
    return path


def column(rows, i, change):
    """The same rows with one column changed."""
    return [
        [change(n, cell) if k == i else cell for k, cell in enumerate(row)]
        for n, row in enumerate(rows)
    ]


def number(change):
    return lambda n, cell: f"{change(n, float(cell)):.4f}"


# What becomes of the rows; then verdict and a finding with these words in it. What each finding
# is worth, and its limits, are held in `conditioning/`.
ROWS = {
    "blank": (
        lambda r: column(r, 1, lambda n, c: "" if n in {7, 8} else c),
        ("refused", "unreadable", "displacement is blank, NaN or infinite, in 2 of"),
    ),
    "missing": (
        lambda r: [*r[:700], *r[701:1300], *r[1302:]],
        ("good", "missing_samples", "3 missing samples"),
    ),
    "gap": (lambda r: [*r[:700], *r[720:]], ("refused", "unusable", "gap of")),
    "slow": (lambda r: r[::10], ("refused", "unusable", "30 Hz .* half the sample rate")),
    "clipped": (
        lambda r: column(r, 2, number(lambda _, f: min(f, 380.0))),
        ("warnings", "force_clipping", "clipped at 380 N"),
    ),
    "hot": (
        lambda r: column(r, 3, lambda *_: "29.0"),
        ("warnings", "temperature", "29.0 degC on average, outside 25 to 27"),
    ),
    "no temperature": (
        lambda r: column(r, 3, lambda *_: ""),
        ("warnings", "temperature_missing", "no temperature"),
    ),
}


def test_strict_quality_leaves_a_log_out_and_ends_with_4(run, logs, tmp_path, rows) -> None:
    write(tmp_path / "clipped_s3.csv", ROWS["clipped"][0](rows))
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
    write(tmp_path / "gap_s4.csv", ROWS["gap"][0](rows))
    assert run("identify", good, "*.csv", "--strict", "--out", "strict").code == 1


def test_a_cut_last_line_fails_strict_quality(run, tmp_path, rows) -> None:
    write(tmp_path / "cut_s2.csv", rows, end="\n4.666,-12")
    (tmp_path / "strict.toml").write_text("[rig]\nstrict = true\n")
    assert run("inspect", "cut_s2.csv").code == 0
    for command, how in (("inspect", "--strict"), ("identify", "--config=strict.toml")):
        ended = run(command, "cut_s2.csv", how)
        assert ended.code == 4
        assert "the last row may be cut" in ended.err
