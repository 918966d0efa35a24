"""--start FILE and --start NAME=VALUE of identify and models, and what is refused of them."""

import json

import pytest

from damperfit.arguments import starts_of
from damperfit.cli import main
from damperfit.configuration.loading import load_configuration
from damperfit.errors import ConfigurationError
from damperfit.identification import procedures
from damperfit.run.given_starts import with_given_start
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


def test_a_file_whose_name_looks_like_a_value_is_a_file(tmp_path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "day=2.csv").write_text("setting\n")
    assert starts_of(["day=2.csv", "k_e=3"]) == ("day=2.csv", {"k_e": "3"})
    (tmp_path / "a=1,b=2").write_text("setting\n")
    assert starts_of(["a=1,b=2"]) == ("a=1,b=2", {})
    assert starts_of(None) == (None, {})
