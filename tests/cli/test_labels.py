"""What is tested, as a user meets it: several adjusters, whose damper it is, tests.csv."""

from __future__ import annotations

import json
from dataclasses import replace

import pyarrow.parquet as pq
import pytest

from damperfit.cli.main import main
from damperfit.damper.purdy.reference import reference_parameters
from damperfit.synthetic import SampleOptions, make_samples

PAIRS = [(r, 8) for r in (4, 6, 8, 10)] + [(8, c) for c in (4, 12)]
TOML = '[adjusters]\nrebound = "from open"\ncompression = ""\n'


@pytest.fixture(scope="module")
def bodies(tmp_path_factory):
    """Logs that say nothing of themselves: R_m1 goes by rebound, R_m2 by compression."""
    folder = tmp_path_factory.mktemp("two_adjusters")
    known = {
        100 * r + c: replace(reference_parameters(r), r_m2=reference_parameters(c).r_m2)
        for r, c in PAIRS
    }
    options = SampleOptions(settings=tuple(known), cycles=6.0, sample_rate=400.0)
    found = {}
    for path, pair in zip(make_samples(folder, options, parameters=known), PAIRS, strict=True):
        lines = path.read_text().splitlines()
        found[pair] = "\n".join(x for x in lines if "setting" not in x and "rig" not in x) + "\n"
    return found


@pytest.fixture(scope="module")
def results(bodies, tmp_path_factory):
    """The results of these logs, labelled by a table with umlauts and semicolons."""
    folder = tmp_path_factory.mktemp("labelled")
    rows = ["Datei;rebound;compression;Serial;Kunde;Farbe"]
    for (r, c), body in bodies.items():
        (folder / f"messung_{r}_{c}.csv").write_text(body)
        rows.append(f"messung_{r}_{c}.csv;{r};{c};0077;Müller;grün")
    (folder / "tests.csv").write_bytes("\n".join(rows).encode("latin-1"))
    (folder / "two.toml").write_text(TOML)
    out = folder / "out"
    arguments = [str(folder / "*.csv"), "--config", str(folder / "two.toml"), "--out", str(out)]
    assert main(["identify", *arguments, "--quiet", "--report"]) == 0
    return out


def test_every_table_has_a_column_an_adjuster(results):
    for name in ("parameters", "mse", "adjustment", "responses"):
        table = pq.read_table(results / f"{name}.parquet")
        assert table.column_names[:3] == ["setting", "rebound", "compression"]
        assert [str(kind) for kind in table.schema.types[:3]] == ["string", "int64", "int64"]
    table = pq.read_table(results / "parameters.parquet")
    assert table["setting"].to_pylist() == ["R4 C8", "R6 C8", "R8 C4", "R8 C8", "R8 C12", "R10 C8"]
    for row in table.to_pylist():
        true = reference_parameters(row["rebound"])
        assert row["r_m1"] == pytest.approx(true.r_m1, rel=0.01)
        assert row["r_m2"] == pytest.approx(reference_parameters(row["compression"]).r_m2, rel=0.02)


def test_trends_and_clicks_run_along_one_adjuster(results):
    record = json.loads((results / "run.json").read_text(encoding="utf-8"))
    assert record["adjusters"] == ["rebound", "compression"]
    lines = {(one["adjuster"], one["held"]) for one in record["trends"]}
    assert lines == {("rebound", "compression 8"), ("compression", "rebound 8")}
    r_m1 = next(
        t for t in record["trends"] if (t["parameter"], t["adjuster"]) == ("r_m1", "rebound")
    )
    assert r_m1["direction"] == "rising"
    assert [point["setting"] for point in r_m1["points"]] == [4, 5, 6, 7, 8, 9, 10]
    steps = {(one["from"], one["to"], one["adjuster"]) for one in record["clicks"]}
    assert steps == {
        ("R4 C8", "R6 C8", "rebound"),
        ("R6 C8", "R8 C8", "rebound"),
        ("R8 C8", "R10 C8", "rebound"),
        ("R8 C4", "R8 C8", "compression"),
        ("R8 C8", "R8 C12", "compression"),
    }


def test_a_result_says_whose_it_is(results):
    record = json.loads((results / "run.json").read_text(encoding="utf-8"))
    whose = {"serial": "0077", "customer": "Müller", "Farbe": "grün"}
    assert record["test"] == whose
    assert record["inputs"][0]["test"] == whose
    assert "Tested: serial 0077; customer: Müller; Farbe: grün." in (
        results / "report.md"
    ).read_text(encoding="utf-8")
    page = (results / "report.html").read_text(encoding="utf-8")
    for key, value in whose.items():
        assert f"<dt>{key}</dt><dd>{value}</dd>" in page
    facts = json.loads(pq.read_schema(results / "mse.parquet").metadata[b"damperfit"])
    assert facts["test"] == whose


def test_settings_answers_for_all_adjusters(results, run):
    ended = run("settings", results, "--force", "500N", "--velocity", "0.2m/s", "--json")
    assert ended.code == 0, ended.err
    document = json.loads(ended.out)
    assert [(a["adjuster"], a["held"]) for a in document["answers"]] == [
        ("rebound", "compression 8")
    ]
    (answer,) = document["answers"]
    assert (answer["below"], answer["above"]) == ("R6 C8", "R8 C8")
    assert 6.0 < answer["position"] < 8.0
    assert "along compression with rebound 8: no setting gives it" in document["sentence"]


@pytest.mark.parametrize("label", ["R8 C12", "r8c12", "rebound=8, compression=12", "8/12"])
def test_simulate_takes_a_label(results, run, label):
    ended = run("simulate", "--parameters", results, "--setting", label, "--json")
    assert ended.code == 0, ended.err
    assert json.loads(ended.out)["setting"] == "R8 C12"


def test_inspect_never_needs_a_setting(bodies, run, tmp_path):
    (tmp_path / "log.csv").write_text(bodies[4, 8])
    ended = run("inspect", tmp_path / "log.csv")
    assert ended.code == 0, ended.err
    assert "1 good" in ended.out


def test_identify_says_what_to_write(bodies, run, tmp_path):
    for pair in ((4, 8), (8, 12)):
        (tmp_path / f"D7_R{pair[0]:02d}_C{pair[1]:02d}.csv").write_text(bodies[pair])
    ended = run("identify", tmp_path / "*.csv", "--out", tmp_path / "out")
    assert ended.code == 3
    assert r"--rig 'setting_pattern=R(?P<setting>\d+)'" in ended.err
    (tmp_path / "two.toml").write_text(TOML)
    ended = run("inspect", tmp_path / "*.csv", "--config", tmp_path / "two.toml", "--json")
    assert [log["setting"] for log in json.loads(ended.out)["logs"]] == ["R4 C8", "R8 C12"]


def test_a_guess_is_said(bodies, run, tmp_path):
    for r in (4, 6):
        (tmp_path / f"D7_b{r:02d}_1.5Hz.csv").write_text(bodies[r, 8])
    ended = run("inspect", tmp_path / "*.csv", "--json")
    assert [log["setting"] for log in json.loads(ended.out)["logs"]] == [4, 6]
    assert r"guessed from the file names" in ended.err
    assert r"--rig 'setting_pattern=b(?P<setting>\d+)'" in ended.err


def test_a_declared_setting_against_the_log_is_an_error(bodies, run, tmp_path):
    (tmp_path / "a.csv").write_text("# setting: 3\n" + bodies[4, 8])
    for command in ("identify", "inspect"):
        ended = run(command, tmp_path / "a.csv", "--setting", "4", *OUT(tmp_path, command))
        assert ended.code == 2
        assert "--setting 4: a.csv says setting 3" in ended.err
    assert not (tmp_path / "out").exists()


def OUT(tmp_path, command):  # noqa: N802 - reads as what it stands for
    return ("--out", tmp_path / "out") if command == "identify" else ()


def test_one_setting_declared_for_logs_that_plainly_differ_is_an_error(bodies, run, tmp_path):
    (tmp_path / "a.csv").write_text(bodies[4, 8])
    (tmp_path / "b.csv").write_text(bodies[10, 8])
    ended = run("identify", tmp_path / "*.csv", "--setting", "4", "--out", tmp_path / "out")
    assert ended.code == 3
    assert "setting 4: a.csv and b.csv contradict each other" in ended.err
    averaged = ("--rig", "contradictions=average", "--out", tmp_path / "out")
    averaged += ("--procedure", "plain", "--free", "r_m1", "--fix", "r_m2=4.9e6,r_m3=2.6e6")
    averaged += ("--fix", "k_e=0.7GPa,f_f=50N")
    ended = run("identify", tmp_path / "*.csv", "--setting", "4", *averaged)
    assert ended.code == 0, ended.err
    assert "averaged" in ended.err


def test_several_dampers_get_a_result_each(bodies, run, tmp_path):
    for serial, r in (("A1", 4), ("A1", 6), ("B 2", 6)):
        text = f"# setting: {r}\n# serial: {serial}\n# damper: D7\n{bodies[r, 8]}"
        if serial == "B 2":
            text = text.replace("# damper: D7", "# damper: D8")
        (tmp_path / f"{serial[0]}_{r}.csv").write_text(text)
    (tmp_path / "stray.csv").write_text("# setting: 8\n" + bodies[8, 8])
    ended = run("identify", tmp_path / "*.csv", "--out", tmp_path / "out", "--json")
    assert ended.code == 1
    assert (
        "stray.csv: the log does not say which damper it belongs to, and there are A1, B 2"
        in ended.err
    )
    document = json.loads(ended.out)
    assert list(document["dampers"]) == ["A1", "B 2"]
    for owner, folder, settings in (("A1", "A1", [4, 6]), ("B 2", "B_2", [6])):
        table = pq.read_table(tmp_path / "out" / folder / "parameters.parquet")
        assert table["setting"].to_pylist() == settings
        assert document["dampers"][owner]["test"]["serial"] == owner
        record = json.loads((tmp_path / "out" / folder / "run.json").read_text(encoding="utf-8"))
        assert record["folders_of_this_run"] == ["A1", "B_2"]
    assert not (tmp_path / "out" / "run.json").exists()
    ended = run("models", tmp_path / "*_6.csv")
    assert ended.code == 2
    assert "logs of 2 dampers: A1, B 2; give the logs of one" in ended.err
    # The folder holds one run only.
    ended = run("identify", tmp_path / "B_6.csv", "--out", tmp_path / "out")
    assert ended.code == 0, ended.err
    assert (tmp_path / "out" / "run.json").exists()
    assert not [path.name for path in (tmp_path / "out").iterdir() if path.is_dir()]


def test_a_configured_serial_against_the_log_is_an_error(bodies, run, tmp_path):
    (tmp_path / "a.csv").write_text("# setting: 3\n# serial: 12\n" + bodies[4, 8])
    (tmp_path / "c.toml").write_text('[test]\nserial = "13"\n')
    ended = run("identify", tmp_path / "a.csv", "--config", tmp_path / "c.toml")
    assert ended.code == 2
    assert "test.serial: found '13', but a.csv is of serial '12'" in ended.err


def test_the_same_test_in_another_dialect_counts_once(bodies, run, tmp_path):
    text = "# setting: 4\n" + bodies[4, 8]
    (tmp_path / "a.csv").write_text(text)
    (tmp_path / "b.csv").write_text(text.replace(",", ";").replace(".", ","))
    ended = run("identify", tmp_path / "*.csv", "--out", tmp_path / "out")
    assert ended.code == 0, ended.err
    assert "b.csv: the same test as a.csv; it counts once" in ended.err
    assert pq.read_table(tmp_path / "out" / "parameters.parquet")["n_logs"].to_pylist() == [1]


@pytest.mark.parametrize(
    ("rows", "says"),
    [
        ("file,setting\na.csv,4\na.csv,5\n", "tests.csv:3: 'a.csv' is in line 2 too"),
        ("file,setting\na.csv,1e9\n", "tests.csv:2: setting: found '1e9', expected clicks"),
    ],
)
def test_a_bad_table_of_tests_is_one_sentence(bodies, run, tmp_path, rows, says):
    (tmp_path / "a.csv").write_text(bodies[4, 8])
    (tmp_path / "tests.csv").write_text(rows)
    ended = run("identify", tmp_path / "a.csv", "--out", tmp_path / "out")
    assert ended.code == 2
    assert says in ended.err
    assert len(ended.err.splitlines()) == 1


def test_a_table_elsewhere_and_rows_without_a_file(bodies, run, tmp_path):
    (tmp_path / "a.csv").write_text("# setting: 3\n" + bodies[4, 8])
    (tmp_path / "my.csv").write_text("file,setting\na.csv,4\nb.csv,5\n")
    ended = run("inspect", tmp_path / "a.csv", "--tests", tmp_path / "my.csv", "--json")
    (log,) = json.loads(ended.out)["logs"]
    assert log["setting"] == 4
    assert any("4 of the table of tests; the log says 3" in note for note in log["notes"])
    assert "no such file: line 3 'b.csv'" in ended.err
    ended = run("inspect", tmp_path / "a.csv", "--tests", tmp_path / "none.csv")
    assert ended.code == 2
    assert "none.csv: cannot be read" in ended.err


def test_words_are_settings_of_their_own(bodies, run, tmp_path):
    for word, r in (("soft", 4), ("hard", 10)):
        (tmp_path / f"{word}.csv").write_text(f"# setting: {word}\n{bodies[r, 8]}")
    ended = run("identify", tmp_path / "*.csv", "--out", tmp_path / "out", "--report")
    assert ended.code == 0, ended.err
    table = pq.read_table(tmp_path / "out" / "parameters.parquet")
    assert table.column_names[:2] == ["setting", "r_m1"]
    assert table["setting"].to_pylist() == ["hard", "soft"]
    ended = run("settings", tmp_path / "out", "--velocity", "0.2m/s", "--force", "500N")
    assert ended.code == 2
    assert "no two settings differ in the clicks of one adjuster alone" in ended.err


@pytest.fixture
def two_speeds(logs, tmp_path):
    """Three logs whose preambles say settings as tuners write them."""
    folder = tmp_path / "runs"
    folder.mkdir()
    for number, label in enumerate(("L6 H1", "L4 H1", "L2 H1"), start=1):
        text = (logs / f"setting_{number:02d}.csv").read_text()
        (folder / f"run_{number}.csv").write_text(
            text.replace(f"# setting: {number}", f"# setting: {label}")
        )
    return folder


def test_letters_are_the_initials_of_the_declared_adjusters(run, two_speeds, tmp_path) -> None:
    (tmp_path / "mine.toml").write_text('[adjusters]\nlow_speed = ""\nhigh_speed = ""\n')
    ended = run("inspect", two_speeds, "--config", tmp_path / "mine.toml", "--json")
    assert ended.code == 0
    document = json.loads(ended.out)
    assert [one["setting"] for one in document["logs"]] == ["LS6 HS1", "LS4 HS1", "LS2 HS1"]
    assert "words" not in ended.err


def test_letters_that_nobody_declared_are_words_with_a_warning(run, two_speeds) -> None:
    ended = run("inspect", two_speeds)
    assert ended.code == 0
    assert "'L6 H1' and 'L4 H1' are taken as words" in ended.err
    assert '[adjusters] l = "", h = ""' in ended.err


def test_letters_of_no_declared_adjuster_are_asked_for(run, two_speeds, tmp_path) -> None:
    (tmp_path / "mine.toml").write_text('[adjusters]\nrebound = ""\nbump = ""\n')
    ended = run("inspect", two_speeds, "--config", tmp_path / "mine.toml")
    assert ended.code == 3
    assert "the letters L, H name none of the adjusters rebound, bump" in ended.err
