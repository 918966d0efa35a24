"""`damperfit compare` end to end, on campaigns of one damper and of a changed one."""

import json
import shutil
from pathlib import Path

import pytest

from damperfit.cli import main
from damperfit.damper.purdy.reference import reference_parameters
from damperfit.synthetic import SampleOptions, make_samples
from tests.identification.rig import recording

SETTINGS = (1, 2)


@pytest.fixture(scope="session")
def campaigns(tmp_path_factory) -> Path:
    """Folders `before` and `again` of one damper, `after` with R_m1 5 % up, `fewer` settings."""
    root = tmp_path_factory.mktemp("campaigns")
    for name, seed, factor, settings in (
        ("before", 1, 1.0, SETTINGS),
        ("again", 2, 1.0, SETTINGS),
        ("after", 3, 1.05, SETTINGS),
        ("fewer", 4, 1.0, (2,)),
    ):
        (root / f"logs_{name}").mkdir()
        for setting in settings:
            truth = reference_parameters(setting)
            changed = truth.replace(r_m1=factor * truth.r_m1)
            log = recording(setting, changed, noise=2.0, rate=500.0, duration=6.0, seed=seed)
            rows = zip(log.time, 1e3 * log.displacement, log.force, strict=True)
            text = "\n".join(f"{t:.3f},{x:.4f},{f:.1f}" for t, x, f in rows)
            head = f"# setting: {setting}\ntime_s,displacement_mm,force_N\n"
            path = root / f"logs_{name}" / f"setting_{setting:02d}.csv"
            path.write_text(head + text + "\n")
        logs = sorted(map(str, (root / f"logs_{name}").glob("*.csv")))
        assert main(["identify", *logs, "--out", str(root / name), "--quiet"]) in {0, 1}
    return root


def _document(run, *arguments) -> dict:
    ended = run("compare", *arguments, "--json")
    assert ended.code == 0, ended.err
    return json.loads(ended.out)["comparisons"][0]


def test_two_campaigns_of_one_damper_are_the_same(run, campaigns) -> None:
    found = _document(run, campaigns / "before", campaigns / "again")
    assert not [line for line in found["lines"] if line["is_sure"]]
    forces = [line for line in found["lines"] if line["kind"] == "force"]
    assert len(forces) == len(SETTINGS) * 5 * 2
    assert sum(line["verdict"] == "same" for line in forces) >= 0.9 * len(forces)
    assert found["circumstances"] == []


def test_a_changed_valve_is_found_where_it_is_and_by_how_much(run, campaigns) -> None:
    found = _document(run, campaigns / "before", campaigns / "after")
    told = {
        (line["name"], line["setting"], line["stroke"], line["speed_m_per_s"]): line
        for line in found["lines"]
    }
    for setting in map(str, SETTINGS):
        line = told["r_m1", setting, None, None]
        assert line["verdict"] == "different"
        assert line["is_sure"]
        assert line["percent_ci_low"] <= 5.0 <= line["percent_ci_high"]
    assert told["r_m3", None, None, None]["verdict"] != "different"
    assert "parameters: " in " ".join(found["sentences"])
    assert "of them significantly" in found["sentences"][0]


def test_measured_curves_are_compared_without_a_model(run, campaigns) -> None:
    found = _document(run, campaigns / "before", campaigns / "after", "--measured")
    assert {line["kind"] for line in found["lines"]} == {"force", "figure"}
    assert found["motion"] == "the motion of each test"
    assert found["sentences"][0].startswith("forces as measured: ")
    assert not [note for note in found["notes"] if "model" in note]
    fast = [line for line in found["lines"] if line["speed_m_per_s"] == 0.3]
    assert all(line["verdict"] == "different" for line in fast if line["stroke"] == "rebound")
    logs = [campaigns / f"logs_{name}" / "setting_02.csv" for name in ("before", "after")]
    of_logs = _document(run, *logs, "--measured")
    assert of_logs["settings"] == [2]
    a, b = (
        next(
            line["second_value"]
            for line in one["lines"]
            if (line["setting"], line["speed_m_per_s"], line["stroke"]) == ("2", 0.26, "rebound")
        )
        for one in (found, of_logs)
    )
    assert a == pytest.approx(b, abs=0.05)


def test_repeats_of_the_reference_are_the_measure(run, campaigns) -> None:
    before = campaigns / "before"
    found = _document(run, before, campaigns / "after", "--repeats", campaigns / "again")
    assert [one["name"] for one in found["repeats"]] == ["again"]
    assert found["notes"][0].startswith("the scatter of A is that of 2 runs, 1 degree of freedom")
    single = _document(run, before, campaigns / "after")
    line, other = (
        next(one for one in document["lines"] if one["name"] == "r_m1")
        for document in (found, single)
    )
    assert line["first_value"] != other["first_value"]


def test_a_gate_that_is_missed_ends_with_code_4(run, campaigns) -> None:
    before, after = campaigns / "before", campaigns / "after"
    missed = run("compare", before, after, "--tolerance", "3%", "--junit", "j.xml", "--json")
    assert missed.code == 4
    points = json.loads(missed.out)["points"]
    failed = [point for point in points if not point["is_met"]]
    assert 0 < len(failed) < len(points)
    text = Path("j.xml").read_text()
    assert f'tests="{len(points)}" failures="{len(failed)}"' in text
    met = run("compare", before, after, "--tolerance", "8%,4N", "--quiet")
    assert met.code == 0
    assert "20 of 20 points within the tolerance" in met.out


def test_a_baseline_stands_for_its_run(run, campaigns) -> None:
    before, after = campaigns / "before", campaigns / "after"
    assert run("compare", before, "--save", "base.json").code == 0
    kept, whole = _document(run, "base.json", after), _document(run, before, after)
    assert len(kept["lines"]) == len(whole["lines"])
    for a, b in zip(kept["lines"], whole["lines"], strict=True):
        same = {"first": "before"} | {key: b[key] for key in ("verdict", "is_sure", "name")}
        assert (a | {"first": "before"}).items() >= same.items()
        for key in ("first_value", "difference_ci_low", "difference_ci_high", "chance"):
            assert a[key] == (None if b[key] is None else pytest.approx(b[key], rel=1e-4, abs=1e-4))
    measured = _document(run, "base.json", after, "--measured")
    assert {line["source"] for line in measured["lines"]} == {"measured"}
    Path("base.json").write_text(Path("base.json").read_text()[:5000])
    damaged = run("compare", "base.json", after)
    assert damaged.code == 2
    assert "base.json: a damaged baseline" in damaged.err


def test_page_markdown_json_and_tables_are_written_as_a_set(run, campaigns) -> None:
    pytest.importorskip("plotly")
    runs = [campaigns / name for name in ("before", "after", "again")]
    ended = run("compare", *runs, "--tolerance", "9%", "--out", "out", "--quiet")
    assert ended.code == 0
    assert sorted(path.name for path in Path("out").iterdir()) == [
        *("comparison.html", "comparison.json", "comparison.md", "differences.csv"),
        *("differences.parquet", "tolerance.csv", "tolerance.parquet"),
    ]
    page = Path("out/comparison.html").read_text()
    markdown = Path("out/comparison.md").read_text()
    document = json.loads(Path("out/comparison.json").read_text())
    assert len(document["comparisons"]) == 2
    for sentence in document["comparisons"][0]["sentences"]:
        assert sentence in page
        assert sentence.split(" (")[0] in markdown
    for setting in SETTINGS:
        assert f'data-name="setting_{setting:02d}_force_velocity"' in page
        assert f'data-name="setting_{setting:02d}_force_displacement"' in page
    table = Path("out/differences.csv").read_text().splitlines()
    assert len(table) == 1 + sum(len(one["lines"]) for one in document["comparisons"])


# `damperfit compare --measured` of raw logs alone: folders, patterns, lists, one bad log.

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


def _measured(run, *arguments, code: int = 0) -> dict:
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
    (found,) = _measured(run, raw / "before", raw / "after")["comparisons"]
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
    whole = _forces(_measured(run, raw / "before", raw / "after")["comparisons"][0])
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
    found = _forces(_measured(run, first, raw / "after")["comparisons"][0])
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
    found = _measured(run, "before", "after", code=1)
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
    told = _measured(run, "old", "new")
    assert [one["first"]["place"] for one in told["comparisons"]] == ["old/S2"]
    assert told["alone"] == ["S1: only in old", "S3: only in new"]
    for when in ("old", "new"):
        flat = Path(f"flat_{when}")
        flat.mkdir()
        for path in Path(when).glob("S*/*.csv"):
            text = f"# serial: {path.parent.name}\n{path.read_text()}"
            (flat / f"{path.parent.name}_{path.name}").write_text(text)
    told = _measured(run, "flat_old", "flat_new")
    assert [one["second"]["place"] for one in told["comparisons"]] == ["flat_new/S2"]
    assert told["alone"] == ["S1: only in flat_old", "S3: only in flat_new"]
    serials = _measured(run, "flat_old")["comparisons"]
    assert [(one["first"]["name"], one["second"]["name"]) for one in serials] == [("S1", "S2")]
    refused = run("compare", "flat_old", "--measured", "--save", "base.json")
    assert refused.code == 2
    assert "logs of 2 dampers (S1, S2); a baseline is of one" in refused.err
