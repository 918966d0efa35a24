"""`damperfit compare --measured` of raw logs alone: folders, patterns, lists, one bad log."""

import json
import shutil
from pathlib import Path

import pytest

from damperfit.synthetic import SampleOptions, make_samples

GAS = -130.4  # N, of the synthetic damper


@pytest.fixture(scope="session")
def raw(tmp_path_factory) -> Path:
    """Folders of raw logs: `before`, `again`, and `after` with 5 % more damping at setting 2."""
    root = tmp_path_factory.mktemp("raw")
    for name, seed in (("before", 1), ("again", 2), ("after", 3)):
        options = SampleOptions(settings=(1, 2), cycles=8.0, force_noise=2.0, seed=seed)
        make_samples(root / name, options)
        (root / name / "truth.csv").unlink()
    path = root / "after" / "setting_02.csv"
    path.write_text(_changed(path.read_text(), lambda force: GAS + 1.05 * (force - GAS)))
    return root


def _changed(text: str, how) -> str:
    lines = text.splitlines()
    for i, line in enumerate(lines):
        if line[:1].isdigit():
            time, displacement, force, *rest = line.split(",")
            lines[i] = ",".join([time, displacement, f"{how(float(force)):.7g}", *rest])
    return "\n".join(lines) + "\n"


def _document(run, *arguments, code: int = 0) -> dict:
    ended = run("compare", *arguments, "--measured", "--json")
    assert ended.code == code, ended.err
    return json.loads(ended.out)


def _forces(found: dict) -> dict:
    return {
        (line["setting"], line["stroke"], line["speed_m_per_s"]): line
        for line in found["lines"]
        if line["kind"] == "force"
    }


def test_two_folders_of_logs_are_two_runs(run, raw) -> None:
    (found,) = _document(run, raw / "before", raw / "after")["comparisons"]
    assert found["settings"] == [1, 2]
    assert found["motion"] == "the motion of each test"
    forces = _forces(found)
    assert {key[2] for key in forces} == {0.05, 0.1, 0.13, 0.26, 0.3}
    for (setting, _, speed), line in forces.items():
        assert line["source"] == "measured"
        if speed >= 0.1:
            assert (line["verdict"] == "different") == (setting == "2"), line
    line = forces["2", "rebound", 0.26]
    truth = 0.05 * (line["first_value"] - GAS)
    assert line["difference_ci_low"] < truth < line["difference_ci_high"]
    assert {line["kind"] for line in found["lines"]} == {"force", "figure"}


@pytest.mark.parametrize("form", ["pattern", "results"])
def test_a_pattern_a_list_and_a_folder_are_the_same_run(run, raw, form) -> None:
    whole = _forces(_document(run, raw / "before", raw / "after")["comparisons"][0])
    if form == "pattern":
        first = raw / "before" / "*.csv"
    elif form == "list":
        logs = sorted((raw / "before").glob("*.csv"))
        Path("before.txt").write_text("# the morning\n" + "\n".join(map(str, logs)) + "\n")
        first = Path("@before.txt")
    else:
        logs = sorted((raw / "before").glob("*.csv"))
        assert run("identify", *logs, "--out", "fitted", "--quiet").code == 0
        first = Path("fitted")
    found = _forces(_document(run, first, raw / "after")["comparisons"][0])
    assert found.keys() == whole.keys()
    for key, line in found.items():
        assert line["first_value"] == pytest.approx(whole[key]["first_value"], abs=0.05)


def test_a_bad_log_costs_itself(run, raw) -> None:
    shutil.copytree(raw / "after", "after")
    Path("after/setting_03.csv").write_text("# setting: 3\ntime_s,displacement_mm,force_N\n0,1,2\n")
    shutil.copytree(raw / "before", "before")
    shutil.copy(raw / "before" / "setting_01.csv", "before/setting_03.csv")
    text = Path("before/setting_03.csv").read_text()
    Path("before/setting_03.csv").write_text(text.replace("setting: 1", "setting: 3"))
    found = _document(run, "before", "after", code=1)
    assert found["comparisons"][0]["settings"] == [1, 2]
    (remark,) = found["remarks"]
    assert remark.startswith("after: setting_03.csv: 1 sample;")
    ended = run("compare", "before", "after", "--measured", "--debug")
    assert ended.code == 1
    assert "setting 3 only in before: not compared" in ended.out
    assert "Traceback" not in ended.err


def test_folders_of_serials_and_serials_in_the_logs_are_paired(run, raw) -> None:
    for when, source in (("old", "before"), ("new", "again")):
        for serial in ("S1", "S2") if when == "old" else ("S2", "S3"):
            shutil.copytree(raw / source, Path(when, serial))
        Path(when, "notes").mkdir()
    told = _document(run, "old", "new")
    assert [one["first"]["place"] for one in told["comparisons"]] == ["old/S2"]
    assert told["alone"] == ["S1: only in old", "S3: only in new"]
    for when in ("old", "new"):
        flat = Path(f"flat_{when}")
        flat.mkdir()
        for path in Path(when).glob("S*/*.csv"):
            text = f"# serial: {path.parent.name}\n{path.read_text()}"
            (flat / f"{path.parent.name}_{path.name}").write_text(text)
    told = _document(run, "flat_old", "flat_new")
    assert [one["second"]["place"] for one in told["comparisons"]] == ["flat_new/S2"]
    assert told["alone"] == ["S1: only in flat_old", "S3: only in flat_new"]
    serials = _document(run, "flat_old")["comparisons"]
    assert [(one["first"]["name"], one["second"]["name"]) for one in serials] == [("S1", "S2")]
    refused = run("compare", "flat_old", "--measured", "--save", "base.json")
    assert refused.code == 2
    assert "logs of 2 dampers (S1, S2); a baseline is of one" in refused.err
