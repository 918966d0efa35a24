"""`damperfit compare` end to end, on campaigns of one damper and of a changed one."""

from __future__ import annotations

import json
import re
import shutil
from pathlib import Path

import pytest

from damperfit.cli import main
from damperfit.damper.purdy.reference import reference_parameters
from damperfit.units.quantities import find_unit
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


def test_settings_of_one_run_alone_are_named(run, campaigns) -> None:
    found = _document(run, campaigns / "before", campaigns / "fewer")
    sentences = [one["sentence"] for one in found["circumstances"]]
    assert sentences == ["setting 1 only in before: not compared"]
    assert found["settings"] == [2]


def test_the_same_logs_behind_both_are_named(run, campaigns) -> None:
    shutil.copytree(campaigns / "before", "copy")
    found = _document(run, campaigns / "before", "copy")
    assert "both are based on the same logs" in found["circumstances"][0]["sentence"]
    assert all(line["difference"] == 0.0 for line in found["lines"] if line["difference"])


def test_another_gas_and_an_older_version_are_named_first(run, campaigns) -> None:
    shutil.copytree(campaigns / "again", "other")
    record = json.loads(Path("other/run.json").read_text())
    record["configuration"]["damper"]["gas_pressure"] = "6bara"
    record |= {"version": "0.0.9", "schema_version": 1}
    Path("other/run.json").write_text(json.dumps(record))
    ended = run("compare", campaigns / "before", "other")
    head = ended.out[: ended.out.index("forces: ")]
    for part in ("damper.gas_pressure: 460000 Pa, then 600000 Pa", "declared gas", "0.0.9"):
        assert part in " ".join(head.split())
    assert "what the older run lacks is not compared" in " ".join(head.split())


def test_results_without_errors_are_compared_without_verdicts(run, campaigns) -> None:
    shutil.copytree(campaigns / "again", "bare")
    record = json.loads(Path("bare/run.json").read_text())
    del record["uncertainty"]
    Path("bare/run.json").write_text(json.dumps(record))
    ended = run("compare", campaigns / "before", "bare", "--json")
    assert ended.code == 1
    assert "errors and correlations of all settings are missing" in ended.err
    (found,) = json.loads(ended.out)["comparisons"]
    forces = [line for line in found["lines"] if line["kind"] == "force"]
    assert {line["verdict"] for line in forces} == {"untold"}
    assert forces[0]["words"] == "cannot be determined: no errors are known"


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


def test_curves_without_time_have_no_errors(run) -> None:
    for name, factor in (("old.csv", 1.0), ("new.csv", 1.1)):
        rows = [f"{v},{factor * 2000.0 * v}" for v in (-0.3, -0.1, -0.05, 0.05, 0.1, 0.3)]
        Path(name).write_text("velocity_m/s,force_N\n" + "\n".join(rows) + "\n")
    found = _document(run, "old.csv", "new.csv", "--measured")
    assert found["lines"]
    for line in found["lines"]:
        assert line["percent"] == pytest.approx(10.0)
        assert line["verdict"] == "untold"


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


def test_before_and_after_of_several_dampers_are_paired_by_name(run, campaigns) -> None:
    for where, pairs in (
        ("old", {"S1": "before", "S2": "again", "S3": "before"}),
        ("new", {"S2": "after", "S1": "again", "S4": "before"}),
    ):
        for serial, source in pairs.items():
            shutil.copytree(campaigns / source, Path(where, serial))
    ended = run("compare", "old", "new", "--json")
    found = json.loads(ended.out)
    places = [(one["first"]["place"], one["second"]["place"]) for one in found["comparisons"]]
    assert places == [("old/S1", "new/S1"), ("old/S2", "new/S2")]
    assert found["alone"] == ["S3: only in old", "S4: only in new"]
    serials = json.loads(run("compare", "old", "--json").out)["comparisons"]
    assert [one["second"]["name"] for one in serials] == ["S2", "S3"]
    assert {one["first"]["name"] for one in serials} == {"S1"}


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("missing", "BEFORE"), "missing: no such file or folder"),
        (("BEFORE", "missing"), "missing: no such file or folder"),
        (("SEVERAL", "missing"), "missing: no such file or folder"),
        (("empty", "BEFORE"), "holds any; expected run.json and parameters.parquet"),
        (("LOGS", "LOGS"), "logs_before OTHER --measured"),
        (("LOGS", "LOGS"), "but setting_01.csv and 1 more; if these are logs, run damperfit"),
        (("BEFORE",), "one run alone has nothing to be compared with"),
        (("BEFORE", "LOG"), "to compare logs and files of curves"),
        (("BEFORE", "FEW2"), "no setting is common to all"),
        (("BEFORE", "AGAIN", "--velocity", "0"), "expected a speed other than zero"),
        (("BEFORE", "AGAIN", "--amplitude", "20mm"), "give both or neither"),
        (("BEFORE", "AGAIN", "--repeats", "BEFORE"), "is A itself; give further runs"),
        (("BEFORE", "AGAIN", "--repeats", "AGAIN"), "is what is compared with it"),
        (("DAMAGED", "AGAIN"), "no setting has all parameters (parameters.parquet is not the"),
        (
            ("BEFORE", "AGAIN", "--measured", "--amplitude", "20mm", "--frequency", "1"),
            "cannot be combined with --measured",
        ),
    ],
)
def test_bad_input_is_one_sentence_and_code_2(run, campaigns, arguments, said) -> None:
    Path("empty").mkdir()
    shutil.copytree(campaigns / "before", "few2")
    _keep_settings(Path("few2"), "9")
    shutil.copytree(campaigns / "before", "damaged")
    Path("damaged/parameters.csv").unlink()
    Path("damaged/parameters.parquet").write_bytes(b"no table")
    places = {
        "DAMAGED": "damaged",
        "BEFORE": campaigns / "before",
        "SEVERAL": campaigns,
        "LOGS": campaigns / "logs_before",
        "AGAIN": campaigns / "again",
        "LOG": campaigns / "logs_before" / "setting_01.csv",
        "FEW2": "few2",
    }
    ended = run("compare", *(places.get(one, one) for one in arguments))
    assert ended.code == 2
    assert said in ended.err
    assert ended.out == ""
    assert len(ended.err.splitlines()) == 1


def _keep_settings(folder: Path, name: str) -> None:
    """Call the only setting of a folder otherwise."""
    lines = (folder / "parameters.csv").read_text().splitlines()
    first = name + lines[1][lines[1].index(",") :]
    (folder / "parameters.csv").write_text("\n".join([lines[0], first]) + "\n")
    (folder / "parameters.parquet").unlink()
    for table in ("mse.parquet", "mse.csv", "responses.parquet"):
        (folder / table).unlink(missing_ok=True)
    record = json.loads((folder / "run.json").read_text())
    record["uncertainty"] = []
    (folder / "run.json").write_text(json.dumps(record))


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


def test_one_run_is_held_against_nominal_forces(run, campaigns) -> None:
    Path("nominal.csv").write_text("speed,stroke,low,high\n0.26,rebound,300,700\n")
    assert run("compare", campaigns / "before", "--tolerance", "nominal.csv").code == 0
    Path("nominal.csv").write_text("speed,stroke,low,high\n0.26,rebound,300,480\n")
    missed = run("compare", campaigns / "before", "--tolerance", "nominal.csv")
    assert missed.code == 4
    assert "FAILS" in missed.out
    assert run("compare", campaigns / "before", "--tolerance", "none.csv").code == 2


def test_a_speed_that_was_never_tested_is_compared_and_said(run, campaigns) -> None:
    ended = run("compare", campaigns / "before", campaigns / "again", "--velocity", "2m/s")
    assert ended.code == 0
    assert "2 m/s was never tested (tested: up to 0.302 m/s)" in " ".join(ended.out.split())


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
    assert {line["told_from"] for line in measured["lines"]} == {"measured"}
    Path("base.json").write_text(Path("base.json").read_text()[:5000])
    damaged = run("compare", "base.json", after)
    assert damaged.code == 2
    assert "base.json: a damaged baseline" in damaged.err


def test_a_later_baseline_says_so(run, campaigns) -> None:
    Path("base.json").write_text('{"damperfit_baseline": 99, "version": "9.9"}')
    ended = run("compare", "base.json", campaigns / "after")
    assert ended.code == 2
    assert "a baseline of form 99 (damperfit 9.9), and this damperfit knows 1" in ended.err


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


def test_units_of_people_are_on_terminal_page_and_markdown_and_numbers_of_programs_stay(
    run, campaigns
) -> None:
    pytest.importorskip("plotly")
    runs = [campaigns / name for name in ("before", "after")]
    asked = (*runs, "--tolerance", "3%", "--junit", "j.xml", "--out")
    assert run("compare", *asked, "si").code == 4
    ended = run("compare", *asked, "us", "--units", "lbf,in/s")
    assert ended.code == 4
    told = json.loads(Path("us/comparison.json").read_text())
    before = json.loads(Path("si/comparison.json").read_text())
    names = {name for name, value in before["points"][0].items() if isinstance(value, float)}
    for now, then in zip(told["points"], before["points"], strict=True):
        assert {name: now[name] for name in names} == {name: then[name] for name in names}
    assert told["comparisons"][0]["lines"] == before["comparisons"][0]["lines"]
    page = Path("us/comparison.html").read_text()
    body = page[page.index("<main") : page.index("</main")]
    markdown = Path("us/comparison.md").read_text()
    for text in (ended.out, body, markdown, Path("j.xml").read_text()):
        assert "in/s" in text
        assert "lbf" in text
        assert not re.search(r"\bm/s\b|\d N\b|(?<=[>|]) ?N ?(?=[<|])|in N(?![/\w]| s)", text)
    assert '"in/s"' in page
    line = next(one for one in before["comparisons"][0]["lines"] if one["speed_m_per_s"] == 0.26)
    row = next(one for one in markdown.splitlines() if one.startswith("| 1 | 10.24 |"))
    pound = find_unit("lbf", "force").factor
    assert float(row.split("|")[4]) == pytest.approx(line["first_value"] / pound, rel=1e-3)
    assert float(row.split("|")[6].split()[0]) == pytest.approx(
        line["difference"] / pound, rel=0.05
    )


def test_the_summary_of_a_job_gets_the_markdown(run, campaigns, monkeypatch) -> None:
    arguments = ("compare", campaigns / "before", campaigns / "again", "--github-summary")
    monkeypatch.delenv("GITHUB_STEP_SUMMARY", raising=False)
    assert run(*arguments).code == 2
    monkeypatch.setenv("GITHUB_STEP_SUMMARY", "summary.md")
    assert run(*arguments, "--quiet").code == 0
    assert Path("summary.md").read_text().startswith("# Comparison")


def test_two_models_have_their_forces_compared_as_measured(run, campaigns) -> None:
    logs = sorted(map(str, (campaigns / "logs_again").glob("*.csv")))
    assert main(["identify", *logs, "--model", "linear", "--out", "linear", "--quiet"]) in {0, 1}
    ended = run("compare", campaigns / "before", "linear", "--json")
    (found,) = json.loads(ended.out)["comparisons"]
    assert {line["kind"] for line in found["lines"]} == {"measured", "force", "figure"}
    forces = [line for line in found["lines"] if line["kind"] == "force"]
    # A straight line misses the force somewhere at every setting: it is not asked at the others.
    assert {line["told_from"] for line in forces} == {"measured"}
    assert not [line for line in forces if line["is_sure"]]
    assert "model: purdy, then linear" in found["circumstances"][0]["sentence"]
    assert "fitted with different models: no parameter is common to both" in found["notes"]
    alike = json.loads(run("compare", "linear", "linear", "--json").out)["comparisons"][0]
    assert {line["name"] for line in alike["lines"] if line["kind"] == "parameter"}


def test_what_two_models_of_the_same_logs_measured_says_nothing_of_the_models(
    run, campaigns
) -> None:
    logs = sorted(map(str, (campaigns / "logs_before").glob("*.csv")))
    assert main(["identify", *logs, "--model", "linear", "--out", "linear", "--quiet"]) in {0, 1}
    arguments = ("compare", campaigns / "before", "linear", "--tolerance", "5%", "--out", "out")
    ended = run(*arguments)
    said = " ".join(ended.out.split())
    for part in (
        "forces as measured: all 20 the same within errors",
        "note: linear: its model (linear) misses the measured force at settings 1, 2, most setting",
        "at settings 1, 2 the measured forces of both are compared: both are based on the same",
        "same logs, so this says nothing about the models",
        "note: both are based on the same logs (setting_01.csv, setting_02.csv): what differs",
        "Forces as measured at constant speed",
        "20 of 20 points within the tolerance; 20 compared as measured, without a model",
    ):
        assert part in said
    assert "differs besides: the same" not in said
    document = json.loads(Path("out/comparison.json").read_text())
    (found,) = document["comparisons"]
    words = {line["words"] for line in found["lines"] if line["kind"] == "force"}
    assert words == {"identical: the same logs (measured)"}
    assert {point["told_from"] for point in document["points"]} == {"measured"}
    assert all(point["words"].endswith("(measured)") for point in document["points"])
    for name in ("comparison.html", "comparison.md"):
        text = Path("out", name).read_text()
        for part in ("identical: the same logs (measured)", "says nothing about the models"):
            assert part in text
        assert "Forces as measured" in text
    by_model = run("compare", campaigns / "before", campaigns / "again", "--tolerance", "9%")
    assert "forces as measured" not in by_model.out
    assert "(measured)" not in by_model.out


def test_labels_of_several_adjusters_are_settings_too(run, campaigns) -> None:
    Path("two.toml").write_text('[adjusters]\nrebound = ""\ncompression = ""\n')
    for name in ("before", "after"):
        Path(name).mkdir()
        rows = ["file,rebound,compression"]
        for setting in SETTINGS:
            text = (campaigns / f"logs_{name}" / f"setting_{setting:02d}.csv").read_text()
            body = [line for line in text.splitlines() if "setting" not in line]
            Path(name, f"log_{setting}.csv").write_text("\n".join(body) + "\n")
            rows.append(f"log_{setting}.csv,{setting},7")
        Path(name, "tests.csv").write_text("\n".join(rows) + "\n")
        logs = sorted(map(str, Path(name).glob("log_*.csv")))
        arguments = ["--config", "two.toml", "--out", f"{name}_out", "--quiet"]
        assert main(["identify", *logs, *arguments]) in {0, 1}
    found = _document(run, "before_out", "after_out")
    assert found["settings"] == ["R1 C7", "R2 C7"]
    told = [line for line in found["lines"] if line["name"] == "r_m1"]
    assert [line["verdict"] for line in told] == ["different"] * 2
    assert run("compare", "before_out", "--save", "base.json").code == 0
    kept = _document(run, "base.json", "after_out")
    assert [a["verdict"] for a in kept["lines"]] == [b["verdict"] for b in found["lines"]]
    mixed = run("compare", campaigns / "before", "after_out")
    assert mixed.code == 2
    assert "no setting is common to all" in mixed.err


def test_older_results_do_not_tell_what_their_model_misses(run, campaigns) -> None:
    shutil.copytree(campaigns / "again", "older")
    record = json.loads(Path("older/run.json").read_text())
    del record["speed_forces"]
    for log in record["inputs"]:
        del log["stretches"]
    Path("older/run.json").write_text(json.dumps(record))
    found = _document(run, campaigns / "before", "older")
    assert any(note.startswith("older: the lack of fit") for note in found["notes"])
    energy = [line for line in found["lines"] if line["name"] == "energy"]
    assert [line["verdict"] for line in energy] == ["untold"] * len(SETTINGS)
