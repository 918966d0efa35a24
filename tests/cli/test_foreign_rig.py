"""A servo-hydraulic rig's export gives the parameters of the plain log, without a word said."""

import json
import re
from itertools import pairwise
from pathlib import Path

import pytest

from tests.fakes import values_in

SAMPLES = Path(__file__).parents[2] / "sample_runs"
NAMES = ("r_m1", "r_m2", "r_m3", "k_e", "f_f")


def _rows(setting: int) -> list[list[float]]:
    lines = (SAMPLES / f"setting_{setting:02d}.csv").read_text().splitlines()[4:]
    return [[float(field) for field in line.split(",")] for line in lines]


def _export(path: Path, setting: int, *, x_sign: float = -1.0, f_sign: float = -1.0) -> Path:
    """Quoted, semicolons, decimal comma, preamble with both, kN, time last, stroke at 41.7 mm."""
    lines = [
        '"Prüfstand 2; Dämpfer Nr. 7"',
        '"Operator";"J. Müller"',
        '"Date";"12.03.2024 10:15:01"',
        "",
        '"Axial Force ";"Axial Displacement ";"Running Time "',
        '"kN";"mm";"sec"',
    ]
    for time, x, force, _ in _rows(setting):
        values = (f_sign * force / 1e3, 41.7 + x_sign * x, time)
        lines.append(";".join(f'"{value:.9g}"'.replace(".", ",") for value in values))
    path.write_bytes(("\r\n".join(lines) + "\r\n").encode("latin-1"))
    return path


def _found(folder: Path, setting: int) -> dict[str, float]:
    parameters = values_in(folder / "parameters.parquet")[setting]
    return {name: getattr(parameters, name) for name in NAMES}


@pytest.mark.parametrize("setting", [10])
def test_a_servo_hydraulic_export_bump_positive_and_off_centre(run, tmp_path, setting) -> None:
    plain = run("identify", SAMPLES / f"setting_{setting:02d}.csv", "--out", "plain")
    log = _export(tmp_path / f"setting_{setting:02d}.csv", setting)
    ended = run("identify", log, "--out", "foreign")
    assert (plain.code, ended.code) == (0, 0), ended.err
    expected, found = (_found(tmp_path / name, setting) for name in ("plain", "foreign"))
    for name in NAMES:
        assert found[name] == pytest.approx(expected[name], rel=1e-5)  # asked for: 1e-3
    assert "displacement: found positive in compression and reversed" in ended.err
    assert "force: found positive in compression and reversed" in ended.err
    record = json.loads((tmp_path / "foreign" / "run.json").read_text())
    assert record["inputs"][0]["centre_m"] == pytest.approx(0.0417, abs=2e-5)
    names = {one["name"] for one in record["inputs"][0]["findings"] if one["is_correction"]}
    assert names == {"force_polarity", "displacement_polarity"}
    assert any(line.startswith("Corrected:") for line in record["procedure"])


@pytest.mark.parametrize("skew", ["auto", "2ms"])
def test_skew_is_taken_back_on_request(run, tmp_path, skew) -> None:
    rows = _rows(5)
    lines = ["time_s,displacement_mm,force_N"]
    # One sample is 2 ms: the force of the row before.
    lines += [f"{t},{x},{before[2]}" for before, (t, x, _, _) in pairwise(rows)]
    (tmp_path / "late_s5.csv").write_text("\n".join(lines) + "\n")
    plain = run("identify", SAMPLES / "setting_05.csv", "--out", "plain")
    late = run("identify", "late_s5.csv", "--out", "late")
    right = run("identify", "late_s5.csv", "--skew", skew, "--out", "right")
    assert (plain.code, late.code, right.code) == (0, 0, 0)
    k_e = {name: _found(tmp_path / name, 5)["k_e"] for name in ("plain", "late", "right")}
    assert k_e["late"] < 0.75 * k_e["plain"]
    assert k_e["right"] == pytest.approx(k_e["plain"], rel=0.05)
    assert "at the ends of the stroke: the force is late, or the mounting is elastic" in late.err
    assert re.search(r"set rig.skew = '(1.9|2.\d)ms', or --skew auto", late.err)
    shown = run("inspect", "late_s5.csv", "--skew", skew, "--json")
    findings = {one["name"]: one for one in json.loads(shown.out)["logs"][0]["findings"]}
    assert ("skew_declared" in findings) == (skew == "2ms")
    findings = json.loads(run("inspect", "late_s5.csv", "--json").out)["logs"][0]["findings"]
    assert "skew_declared" not in {one["name"] for one in findings}
