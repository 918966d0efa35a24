"""`damperfit compare` end to end: fitted runs and raw logs of one damper and of a changed one."""

import json
import re
import shutil
from html import unescape
from pathlib import Path

import pytest

from damperfit.cli import main
from damperfit.damper.purdy.parameters import reference_parameters
from damperfit.synthetic import SampleOptions, make_samples

SETTINGS = (1, 2)


@pytest.fixture(scope="session")
def raw(tmp_path_factory) -> Path:
    """Folders of logs: `before`, `again`, and `after` with R_m1 5 % up at setting 2."""
    root = tmp_path_factory.mktemp("campaigns")
    for seed, name in enumerate(("before", "again", "after"), 1):
        known = {one: reference_parameters(one) for one in SETTINGS}
        if name == "after":
            known[2] = known[2].replace(r_m1=1.05 * known[2].r_m1)
        options = SampleOptions(
            settings=SETTINGS, cycles=8.0, force_noise=2.0, displacement_noise=2e-6, seed=seed
        )
        make_samples(root / name, options, parameters=known)
        (root / name / "truth.csv").unlink()
    return root


@pytest.fixture(scope="session")
def campaigns(raw) -> Path:
    """What was fitted to each folder, below `fitted`."""
    for name in ("before", "again", "after"):
        out = str(raw / "fitted" / name)
        assert main(["identify", str(raw / name / "*.csv"), "--out", out, "--quiet"]) in {0, 1}
    return raw / "fitted"


def compared(run, *arguments, code: int = 0) -> dict:
    ended = run("compare", *arguments, "--json")
    assert ended.code == code, ended.err
    return json.loads(ended.out)


def pair(run, *arguments) -> dict:
    return compared(run, *arguments)["comparisons"][0]


def forces_of(found: dict) -> dict:
    return {
        (line["setting"], line["stroke"], line["speed_m_per_s"]): line
        for line in found["lines"]
        if line["kind"] == "force"
    }


def test_a_changed_valve_is_found_where_it_is_and_nothing_where_none_changed(
    run, campaigns
) -> None:
    same = pair(run, campaigns / "before", campaigns / "again")
    assert (same["circumstances"], [1 for one in same["lines"] if one["is_sure"]]) == ([], [])
    forces = forces_of(same).values()
    assert len(forces) == len(SETTINGS) * 5 * 2
    assert sum(line["verdict"] == "same" for line in forces) >= 0.9 * len(forces)
    found = pair(run, campaigns / "before", campaigns / "after")
    told = {(line["name"], line["setting"]): line for line in found["lines"]}
    assert not told["r_m1", "1"]["is_sure"]
    line = told["r_m1", "2"]
    assert (line["verdict"], line["is_sure"]) == ("different", True)
    assert line["percent_ci_low"] <= 5.0 <= line["percent_ci_high"]
    assert told["r_m3", None]["verdict"] != "different"


@pytest.mark.parametrize("form", ["folders", "pattern", "list", "results"])
def test_measured_curves_are_compared_without_a_model(run, raw, campaigns, form) -> None:
    """Whatever names the logs: setting 2 is harder and setting 1 is not."""
    Path("list.txt").write_text("# the morning\n" + f"{raw}/before/*.csv\n")
    first = {"folders": raw / "before", "pattern": raw / "before" / "*.csv", "list": "@list.txt"}
    second = campaigns / "after" if form == "results" else raw / "after"
    found = pair(run, first.get(form, campaigns / "before"), second, "--measured")
    assert found["settings"] == [1, 2]
    assert found["motion"] == "the motion of each test"
    assert found["sentences"][0].startswith("forces as measured: ")
    assert {line["kind"] for line in found["lines"]} == {"force", "figure"}
    forces = forces_of(found)
    assert {key[2] for key in forces} == {0.05, 0.1, 0.13, 0.26, 0.3}
    for (setting, stroke, speed), line in forces.items():
        assert line["source"] == "measured"
        if speed >= 0.13 and stroke == "rebound":
            assert (line["verdict"] == "different") == (setting == "2"), line
    line = forces["2", "rebound", 0.26]
    assert 5.0 < line["percent_ci_low"] < line["percent_ci_high"] < 10.0  # between R and R squared


def test_repeats_of_the_reference_are_named(run, campaigns) -> None:
    found = pair(
        run, *map(campaigns.joinpath, ("before", "after")), "--repeats", campaigns / "again"
    )
    assert [repeat["name"] for repeat in found["repeats"]] == ["again"]
    assert "2 runs, 1 degree of freedom" in found["notes"][0]


def test_a_gate_that_is_missed_ends_with_code_4(run, campaigns) -> None:
    before, after = campaigns / "before", campaigns / "after"
    points = compared(run, before, after, "--tolerance", "2%", "--junit", "j.xml", code=4)["points"]
    failed = [point for point in points if not point["is_met"]]
    assert 0 < len(failed) < len(points)
    assert f'tests="{len(points)}" failures="{len(failed)}"' in Path("j.xml").read_text()
    met = run("compare", before, after, "--tolerance", "8%,4N", "--quiet")
    assert met.code == 0
    assert "20 of 20 points within the tolerance" in met.out


def test_a_baseline_stands_for_its_run(run, campaigns) -> None:
    before, after = campaigns / "before", campaigns / "after"
    assert run("compare", before, "--save", "base.json").code == 0
    kept, fresh = pair(run, "base.json", after), pair(run, before, after)
    for a, b in zip(kept["lines"], fresh["lines"], strict=True):
        for key in ("verdict", "is_sure", "name"):
            assert a[key] == b[key]
        for key in ("first_value", "difference_ci_low", "difference_ci_high", "chance"):
            assert a[key] == (None if b[key] is None else pytest.approx(b[key], rel=1e-4, abs=1e-4))
    measured = pair(run, "base.json", after, "--measured")
    assert {line["source"] for line in measured["lines"]} == {"measured"}
    text = Path("base.json").read_text()
    whole = json.loads(text)
    flat = {"strokes": {"rebound": [1.0, 2.0], "bump": [1.0, 2.0]}}
    wrong = ({"speeds": 3}, {"force": None}, {"force": [[1.0]]}, {"force": [1.0]}, flat)
    edited = [json.dumps(whole | {"tests": [whole["tests"][0] | values]}) for values in wrong]
    for damage in (text[:5000], *edited):
        Path("base.json").write_text(damage)
        damaged = run("compare", "base.json", after)
        assert damaged.code == 2
        assert "base.json: a damaged baseline" in damaged.err


@pytest.mark.slow
def test_page_markdown_json_and_tables_are_written_as_a_set(run, campaigns) -> None:
    pytest.importorskip("plotly")
    runs = [campaigns / name for name in ("before", "after", "again")]
    ended = run("compare", *runs, "--tolerance", "9%", "--out", "out", "--quiet")
    assert ended.code == 0
    assert sorted(path.name for path in Path("out").iterdir()) == [
        *("comparison.html", "comparison.json", "comparison.md", "differences.csv"),
        *("differences.parquet", "tolerance.csv", "tolerance.parquet"),
    ]
    page, markdown = (Path(f"out/comparison.{kind}").read_text() for kind in ("html", "md"))
    comparisons = json.loads(Path("out/comparison.json").read_text())["comparisons"]
    assert len(comparisons) == 2
    for sentence in comparisons[0]["sentences"]:
        assert sentence in unescape(page)
        assert sentence.split(" (")[0] in markdown
    for setting in SETTINGS:
        for kind in ("velocity", "displacement"):
            assert f'data-name="setting_{setting:02d}_force_{kind}"' in page
    names = re.findall(r'data-name="([^"]+)"', page)  # two comparisons have plots of their own
    assert len(names) == len(set(names))
    table = Path("out/differences.csv").read_text().splitlines()
    assert len(table) == 1 + sum(len(one["lines"]) for one in comparisons)


# Raw logs: one that is bad, and whose they are.


@pytest.mark.slow
def test_a_bad_log_costs_itself(run, raw) -> None:
    for name in ("before", "after"):
        shutil.copytree(raw / name, name)
    Path("after/setting_03.csv").write_text("# setting: 3\ntime_s,displacement_mm,force_N\n0,1,2\n")
    text = Path("before/setting_01.csv").read_text().replace("setting: 1", "setting: 3")
    Path("before/setting_03.csv").write_text(text)
    found = compared(run, "before", "after", "--measured", code=1)
    assert found["comparisons"][0]["settings"] == [1, 2]
    (remark,) = found["remarks"]
    assert remark.startswith("after: setting_03.csv: 1 sample;")
    ended = run("compare", "before", "after", "--measured", "--debug")
    assert ended.code == 1
    assert "setting 3 only in before: not compared" in ended.out
    assert "Traceback" not in ended.err


@pytest.mark.slow
def test_folders_of_serials_and_serials_in_the_logs_are_paired(run, raw) -> None:
    for when, source, serials in (("old", "before", "12"), ("new", "again", "23")):
        Path(f"flat_{when}").mkdir()
        for serial in serials:
            shutil.copytree(raw / source, Path(when, f"S{serial}"))
            for path in Path(when, f"S{serial}").glob("*.csv"):
                flat = Path(f"flat_{when}", f"{serial}_{path.name}")
                flat.write_text(f"# serial: S{serial}\n{path.read_text()}")
        Path(when, "notes").mkdir()
    told = compared(run, "old", "new", "--measured")
    assert [one["first"]["place"] for one in told["comparisons"]] == ["old/S2"]
    assert told["alone"] == ["S1: only in old", "S3: only in new"]
    told = compared(run, "flat_old", "flat_new", "--measured")
    assert [one["second"]["place"] for one in told["comparisons"]] == ["flat_new/S2"]
    assert told["alone"] == ["S1: only in flat_old", "S3: only in flat_new"]
    serials = compared(run, "flat_old", "--measured")["comparisons"]
    assert [(one["first"]["name"], one["second"]["name"]) for one in serials] == [("S1", "S2")]
    refused = run("compare", "flat_old", "--measured", "--save", "base.json")
    assert refused.code == 2
    assert "logs of 2 dampers (S1, S2); a baseline is of one" in refused.err
