"""--start FILE and --start NAME=VALUE of identify and models, and what is refused of them."""

from __future__ import annotations

import json

import pytest

from damperfit.arguments import starts_of
from damperfit.cli import main
from damperfit.configuration.loading import load_configuration
from damperfit.errors import ConfigurationError
from damperfit.identification import procedures
from damperfit.run.given_starts import start_of_laws, with_given_start
from tests.fakes import values_in


@pytest.fixture(scope="module")
def earlier(logs, tmp_path_factory):
    """Results of two settings, each by itself."""
    folder = tmp_path_factory.mktemp("earlier")
    log = [str(logs / "setting_01.csv"), str(logs / "setting_03.csv")]
    assert main(["identify", *log, "--procedure", "plain", "--out", str(folder), "--quiet"]) == 0
    return folder


@pytest.fixture
def began(monkeypatch, fitted_anew):
    """Where the fits of a run begin, by setting."""
    found = {}

    def fit_from(setting, problem, start, **more):
        found[setting] = start
        return real_fit(setting, problem, start, **more)

    real_fit = procedures.fit_from
    monkeypatch.setattr(procedures, "fit_from", fit_from)
    return found


@pytest.mark.parametrize("name", ["", "parameters.parquet", "parameters.csv"])
def test_a_run_begins_where_an_earlier_one_ended(run, logs, earlier, began, name) -> None:
    command = ["identify", logs / "setting_0[12].csv", "--procedure", "plain", "--json", "--quiet"]
    done = run(*command, "--start", earlier / name)
    assert done.code == 0
    known = values_in(earlier / "parameters.parquet")
    assert began == {1: known[1], 2: known[1]}  # 1 and 3 are as near to 2: the first counts
    told = json.loads(done.out)["configuration"]["identification"]
    assert told["start"] == str(earlier / name)


def test_values_come_in_a_list_and_may_be_written_as_in_the_paper(run, logs, began) -> None:
    log = logs / "setting_02.csv"
    command = ["identify", log, "--procedure", "plain", "--json", "--quiet"]
    done = run(*command, "--start", "f_f=30, K_e=2e9", "--start", "r_m1=2e4", "--fix", "F_0=0")
    assert done.code == 0
    assert (began[2].f_f, began[2].k_e, began[2].r_m1) == (30.0, 2e9, 2e4)
    told = json.loads(done.out)["configuration"]["identification"]
    assert told["start_values"] == {"f_f": "30", "k_e": "2e9", "r_m1": "2e4"}
    assert told["fix"] == {"f_0": "0"}


def test_values_go_before_the_file_and_stand_in_run_json(run, logs, earlier, began) -> None:
    log = logs / "setting_02.csv"
    command = ["identify", log, "--procedure", "plain", "--json", "--quiet"]
    done = run(*command, "--start", earlier, "--start", "k_e=900MPa", "--start", "r_m1 = 2e4")
    assert done.code == 0
    values = json.loads(done.out)["configuration"]["identification"]["start_values"]
    assert values == {"k_e": "900MPa", "r_m1": "2e4"}
    known = values_in(earlier / "parameters.parquet")[1]
    assert began == {2: known.replace(k_e=9e8, r_m1=2e4)}


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--start", "nowhere.csv"], "--start nowhere.csv: cannot be read"),
        (["--start", "k_e="], "--start k_e=: expected NAME=VALUE"),
        (["--start", "k_e=1e9", "--start", "k_e=2e9"], "k_e is given twice"),
        (["--start", "k_e=1e9,K_e=2e9"], "--start k_e=2e9: k_e is given twice"),
        (["--start", "k_e=1e9,"], "k_e = 1e9,: expected a number in Pa"),
        (["--start", "a", "--start", "b"], "--start b: a is given already"),
        (["--start", ""], "expected a file or NAME=VALUE"),
        (["--start", "k_g=1e9"], "no parameter 'k_g'"),
        (["--start", "k_e=1e99"], "far from any damper's"),
        (["--start", "k_e=much"], "k_e = much: expected a number in Pa"),
        (["--fix", "k_e=1e9", "--start", "k_e=1e9"], "k_e is fixed and also given a start"),
    ],
)
def test_identify_refuses_in_one_sentence(run, logs, options, said) -> None:
    done = run("identify", logs / "setting_01.csv", *options, "--quiet")
    assert done.code == 2
    assert said in done.err
    assert done.err.count("\n") == 1
    assert "Traceback" not in done.err


def test_models_refuses_in_one_sentence(run, logs) -> None:
    for options, said in (
        (["--start", "rebound_openning=5bar"], "Did you mean 'rebound_opening'?"),
        (["--start", "play=1"], "play = 1 is given as a start, far from any damper's"),
        (["--start", "nowhere"], "--start nowhere: cannot be read"),
    ):
        done = run("models", logs / "setting_01.csv", *options, "--quiet")
        assert (done.code, done.err.count("\n")) == (2, 1)
        assert said in done.err


def test_a_log_or_another_models_table_is_no_start(run, logs, earlier, tmp_path) -> None:
    done = run("identify", logs / "setting_01.csv", "--start", logs / "setting_01.csv", "--quiet")
    assert done.code == 2
    assert "not a parameters table: it has no column 'setting'" in done.err
    told = "model twin_tube"
    start = with_given_start
    configuration = load_configuration(
        overlay={"damper": {"model": "twin_tube"}, "identification": {"start": str(earlier)}}
    )
    with pytest.raises(ConfigurationError, match="belong to another model than twin_tube") as found:
        start(configuration)
    assert told not in str(found.value)
    empty = tmp_path / "empty.csv"
    empty.write_text("setting,r_m1,r_m2\n")
    with pytest.raises(ConfigurationError, match="contain no parameter"):
        start(load_configuration(overlay={"identification": {"start": str(empty)}}))


def test_a_law_that_is_only_chosen_may_be_given_a_start_of_any_law(earlier) -> None:
    configuration = load_configuration(overlay={"identification": {"start": str(earlier)}})
    start = start_of_laws(configuration, {"rebound_opening": "5bar", "lag": "8ms", "r_m1": "2e4"})
    assert start.named == {"rebound_opening": 5e5, "lag": pytest.approx(8e-3), "r_m1": 2e4}
    assert sorted(one.cell for one in start.by_setting) == [1, 3]
    assert start.of(2)["k_e"] == start.by_setting[1]["k_e"]


def test_a_file_whose_name_looks_like_a_value_is_a_file(tmp_path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "day=2.csv").write_text("setting\n")
    assert starts_of(["day=2.csv", "k_e=3"]) == ("day=2.csv", {"k_e": "3"})
    (tmp_path / "a=1,b=2").write_text("setting\n")
    assert starts_of(["a=1,b=2"]) == ("a=1,b=2", {})
    assert starts_of(None) == (None, {})


def test_a_list_of_values_may_be_longer_than_a_file_name() -> None:
    given = {f"quantity_{i}": "1e-3" for i in range(30)}
    text = ",".join(f"{name}={value}" for name, value in given.items())
    assert starts_of([text]) == (None, given)
    assert starts_of([f"k_e={'1' * 300}"]) == (None, {"k_e": "1" * 300})
