"""What is tested, as a user meets it: several adjusters, whose damper it is, tests.csv."""

import json
from dataclasses import replace

import pyarrow.parquet as pq
import pytest

from damperfit.cli.main import main
from damperfit.damper.purdy.parameters import reference_parameters
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


def test_settings_that_differ_in_both_adjusters_are_fitted(bodies, tmp_path, run):
    for r, c in ((4, 8), (8, 12)):  # no click leads from one to the other
        (tmp_path / f"R{r}_C{c}.csv").write_text(bodies[r, c])
    (tmp_path / "two.toml").write_text(TOML)
    ended = run("identify", tmp_path / "R*.csv", "--config", tmp_path / "two.toml")
    assert (ended.code, "R8 C12" in ended.out) == (0, True), ended.err


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
    assert (
        "along compression with rebound 8: compression does not change it" in document["sentence"]
    )


def test_one_setting_declared_for_logs_that_plainly_differ_is_an_error(bodies, run, tmp_path):
    for name, pair in (("a.csv", (4, 8)), ("b.csv", (10, 8))):
        (tmp_path / name).write_text(bodies[pair])
    ended = run("identify", tmp_path / "*.csv", "--setting", "4", "--out", tmp_path / "out")
    assert ended.code == 3
    assert "setting 4: a.csv and b.csv contradict each other" in ended.err


def test_several_dampers_get_a_result_each(bodies, run, tmp_path):
    for serial, r in (("A1", 4), ("A1", 6), ("B 2", 6)):
        text = f"# setting: {r}\n# serial: {serial}\n# damper: D7\n{bodies[r, 8]}"
        if serial == "B 2":
            text = text.replace("# damper: D7", "# damper: D8")
        (tmp_path / f"{serial[0]}_{r}.csv").write_text(text)
    (tmp_path / "stray.csv").write_text("# setting: 8\n" + bodies[8, 8])
    # One that cannot be used makes no damper of its own.
    short = "\n".join(bodies[8, 8].splitlines()[:40])
    (tmp_path / "short.csv").write_text(f"# setting: 9\n# serial: C3\n{short}\n")
    ended = run("identify", tmp_path / "*.csv", "--out", tmp_path / "out", "--json")
    assert ended.code == 1
    assert (
        "stray.csv: the log does not say which damper it belongs to, and there are A1, B 2"
        in ended.err
    )
    document = json.loads(ended.out)
    assert list(document["dampers"]) == ["A1", "B 2"]
    failed = {one["log"] for one in document["dampers"]["A1"]["failures"]}
    assert failed == {"short.csv", "stray.csv"}
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


@pytest.mark.parametrize(("words", "is_offered"), [("soft hard", False), ("R2_C2 R8_C8", True)])
def test_words_are_no_clicks(run, logs, tmp_path, words, is_offered) -> None:
    """Of words without numbers this was an internal error."""
    for k, word in enumerate(words.split(), 1):
        text = (logs / f"setting_0{k}.csv").read_text(encoding="utf-8")
        changed = text.replace(f"# setting: {k}", f"# setting: {word.replace('_', ' ')}")
        (tmp_path / f"{k}.csv").write_text(changed, encoding="utf-8")
    assert run("identify", "1.csv", "2.csv", "--quiet").code in {0, 1}
    ended = run("settings", "--force", "500N", "--velocity", "0.2m/s")
    assert ended.code == 2
    assert ("[adjusters]" in ended.err) is is_offered
