"""damperfit identify: files, exit codes, failures that stay alone, sets that never mix."""

import csv
import hashlib
import json
import shutil
from pathlib import Path

import pyarrow.parquet as pq
import pytest

from damperfit.arguments import starts_of
from damperfit.cli import main
from damperfit.configuration.loading import load_configuration
from damperfit.errors import ConfigurationError
from damperfit.identification import procedures
from damperfit.run.given_starts import with_given_start
from damperfit.run.log_files import is_own_table
from damperfit.synthetic import SampleOptions, make_samples
from damperfit.units.quantities import find_unit
from tests.fakes import values_in

TABLES = ("parameters", "mse", "adjustment", "characteristics", "valve_parts")
FILES = {f"{name}.{kind}" for name in TABLES for kind in ("parquet", "csv")}
FILES |= {"responses.parquet", "report.md", "run.json"}


def record_of(folder) -> dict:
    return json.loads(Path(folder, "run.json").read_text(encoding="utf-8"))


def rows_of(name: str, folder="results") -> list[dict]:
    return pq.read_table(Path(folder, f"{name}.parquet")).to_pylist()


def cells_of(path) -> list[dict[str, str]]:
    return list(csv.DictReader(path.read_text(encoding="utf-8").splitlines()))


def test_run_json_tells_the_whole_story(logs, results) -> None:
    record = record_of(results)
    assert {"version", "configuration", "inputs", "warnings", "timings", "schema"} <= record.keys()
    assert record["failures"] == []
    first = record["inputs"][0]
    digest = hashlib.sha256((logs / "setting_01.csv").read_bytes()).hexdigest()
    assert (first["log"], first["sha256"], first["setting"]) == ("setting_01.csv", digest, 1)
    assert record["configuration"]["damper"]["rod_diameter"] == "19mm"
    names = [column["name"] for column in record["schema"]["parameters"]]
    assert names == pq.read_schema(results / "parameters.parquet").names
    for name, known in record["files"].items():
        assert hashlib.sha256((results / name).read_bytes()).hexdigest() == known


def test_when_every_log_fails_the_code_is_3_and_the_tables_are_empty(run, tmp_path) -> None:
    (tmp_path / "setting_1.csv").write_bytes(b"")
    assert run("identify", "setting_1.csv").code == 3
    assert rows_of("parameters") == rows_of("responses") == []
    assert len(record_of("results")["failures"]) == 1


def test_a_gate_that_is_not_met_is_code_4_and_everything_is_written(run, logs) -> None:
    ended = run("identify", logs / "setting_01.csv", "--max-mse", "0.00001")
    assert ended.code == 4
    assert "setting 1: MSE" in ended.err
    assert {path.name for path in Path("results").iterdir()} == FILES
    assert run("identify", logs / "setting_01.csv", "--max-mse", "1").code == 0


def test_a_log_without_a_setting_takes_the_one_given_or_fails(run, logs) -> None:
    text = (logs / "setting_02.csv").read_text().replace("# setting: 2\n", "")
    Path("run.csv").write_text(text)
    ended = run("identify", "run.csv")
    assert ended.code == 3
    assert "--setting N" in ended.err
    assert run("identify", "run.csv", "--setting", "7").code == 0
    assert [row["setting"] for row in rows_of("parameters")] == [7]


def test_settings_that_the_configuration_expects_are_explicit_gaps(run, logs) -> None:
    Path("rig.toml").write_text("[rig]\nsettings = [1, 2, 3, 4]\n")
    ended = run("identify", logs / "setting_0[13].csv", "--config", "rig.toml")
    assert ended.code == 1
    assert "setting 2: no log" in ended.err
    told = [(row["setting"], row["outcome"] == "missing") for row in rows_of("parameters")]
    assert told == [(1, False), (2, True), (3, False), (4, True)]


@pytest.mark.slow
def test_profiles_are_written_on_request_and_go_with_the_next_run(logs, tmp_path) -> None:
    command = ["identify", str(logs / "setting_*.csv"), "--out", str(tmp_path), "--quiet"]
    assert main([*command, "--profile", "k_e,r_m3", "--profile", "r_m1"]) == 0
    assert pq.read_schema(tmp_path / "profiles.parquet").field("k_e").metadata[b"unit"] == b"Pa"
    rows = rows_of("profiles", tmp_path)
    told = [float(row["value"]) for row in cells_of(tmp_path / "profiles.csv")]
    assert told == [row["value"] for row in rows]
    followed = {(row["setting"], row["parameter"]) for row in rows}
    assert followed == {(1, "r_m3")} | {(s, name) for s in (1, 2, 3) for name in ("k_e", "r_m1")}
    record = record_of(tmp_path)
    assert ("profiles" in record["schema"], len(record["profiles"])) == (True, 7)
    assert record["uncertainty"][0]["verdicts"]["k_e"].endswith("by its profile")
    assert main(command) == 0
    assert not list(tmp_path.glob("profiles.*"))
    assert record_of(tmp_path)["profiles"] == []


# What is not fitted is predicted, and told everywhere.


@pytest.fixture(scope="module")
def shorter(tmp_path_factory) -> Path:
    """Setting 1 at 16 mm."""
    folder = tmp_path_factory.mktemp("shorter")
    quiet = {"force_noise": 1.0, "displacement_noise": 2e-6, "cycles": 7.0}
    (path, *_) = make_samples(folder, SampleOptions(settings=(1,), amplitude=0.016, **quiet))
    return path.rename(folder / "setting_01_16mm.csv")


def test_held_out_logs_are_predicted_and_told_everywhere(run, logs, shorter) -> None:
    fitted = logs / "setting_0[12].csv"
    ended = run("identify", fitted, shorter, "--hold-out", "*_16mm.csv")
    assert ended.code == 0
    assert "predicted as well as fitted" in ended.out
    mse = rows_of("mse")
    assert [(row["setting"], row["log"] or "", row["role"]) for row in mse] == [
        *((1, "", "fitted"), (1, "setting_01.csv", "fitted")),
        *((1, "setting_01_16mm.csv", "held_out"), (2, "", "fitted")),
        (2, "setting_02.csv", "fitted"),
    ]
    report = Path("results/report.md").read_text(encoding="utf-8")
    assert r"| 1 | setting_01_16mm.csv | all | 16.0 | 1.50 |" in report
    (held,) = record_of("results")["held_out"]
    assert (held["setting"], held["log"], held["cycles"]) == (1, "setting_01_16mm.csv", "all")
    assert held["mse_percent"] == pytest.approx(mse[2]["mse_percent"])
    # The parameters are those of the other logs alone.
    with_them = rows_of("parameters")
    assert run("identify", fitted).code == 0
    assert rows_of("parameters") == with_them


def test_a_setting_that_is_only_held_out_is_a_failure_of_that_log(run, logs) -> None:
    ended = run("identify", logs / "setting_0[12].csv", "--hold-out", "setting_01*.csv")
    assert ended.code == 1
    assert "setting_01.csv: held out, but cannot be predicted: setting 1 has no fit" in ended.err
    assert [row["setting"] for row in rows_of("parameters")] == [2]


# --start FILE and --start NAME=VALUE.


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


@pytest.mark.parametrize("name", ["", "parameters.csv"])
def test_a_run_begins_where_an_earlier_one_ended_or_at_values(
    run, logs, results, began, tmp_path, name
) -> None:
    earlier = shutil.copytree(results, tmp_path / "earlier")
    for path in earlier.glob("parameters.*"):  # settings 1 and 3 alone
        table = pq.read_table(path) if path.suffix == ".parquet" else None
        if table is None:
            lines = path.read_text().splitlines()
            path.write_text("\n".join([*lines[:2], lines[3]]) + "\n")
        else:
            pq.write_table(table.take([0, 2]), path)
    command = ["identify", logs / "setting_0[12].csv", "--procedure", "plain", "--json", "--quiet"]
    values = ("--start", "k_e=900MPa", "--start", "r_m1 = 2e4")
    known = values_in(results / "parameters.parquet")[1]
    for more, start in (((), known), (values, known.replace(k_e=9e8, r_m1=2e4))):
        done = run(*command, "--start", earlier / name, *more)
        assert done.code == 0, done.err
        assert began == {1: start, 2: start}  # 1 and 3 are as near to 2: the first counts
        told = json.loads(done.out)["configuration"]["identification"]
        assert told["start"] == str(earlier / name)
        assert told["start_values"] == ({"k_e": "900MPa", "r_m1": "2e4"} if more else {})


def test_a_log_or_another_models_table_is_no_start(run, logs, results, tmp_path) -> None:
    done = run("identify", logs / "setting_01.csv", "--start", logs / "setting_01.csv", "--quiet")
    assert done.code == 2
    assert "not a parameters table: it has no column 'setting'" in done.err
    other = {"damper": {"model": "twin_tube"}, "identification": {"start": str(results)}}
    with pytest.raises(ConfigurationError, match="belong to another model than twin_tube"):
        with_given_start(load_configuration(overlay=other))
    empty = tmp_path / "empty.csv"
    empty.write_text("setting,r_m1,r_m2\n")
    with pytest.raises(ConfigurationError, match="contain no parameter"):
        with_given_start(load_configuration(overlay={"identification": {"start": str(empty)}}))


def test_a_file_whose_name_looks_like_a_value_is_a_file(tmp_path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    for name in ("day=2.csv", "a=1,b=2"):
        Path(name).write_text("setting\n")
    assert starts_of(["day=2.csv", "k_e=3"]) == ("day=2.csv", {"k_e": "3"})
    assert starts_of(["a=1,b=2"]) == ("a=1,b=2", {})
    assert starts_of(None) == (None, {})


# --units: the terminal, the page and files for people; `report` repeats it.


@pytest.mark.slow
def test_files_for_people_are_in_the_units_asked_for_and_those_for_programs_are_not(
    run, logs, results
) -> None:
    us = Path("us")
    ended = run("identify", logs / "setting_*.csv", "--out", us, "--units", "lbf,in/s", "--report")
    assert ended.code == 0
    cells, shown = (cells_of(place / "characteristics.csv")[0] for place in (results, us))
    force = next(name for name in cells if name.endswith("_N") and cells[name])
    in_pounds = float(cells[force]) / find_unit("lbf", "force").factor
    assert float(shown[f"{force[:-2]}_lbf"]) == pytest.approx(in_pounds)
    speed = next(name for name in cells if name.endswith("_m_per_s") and cells[name])
    in_inches = float(cells[speed]) / 0.0254
    assert float(shown[speed.replace("_m_per_s", "_in_per_s")]) == pytest.approx(in_inches)
    assert not [name for name in shown if name.endswith(("_N", "_m_per_s"))]
    assert all(is_own_table(path) for path in (us / "run.json", *us.glob("*.csv")))
    for path in results.glob("*.parquet"):
        assert pq.read_schema(us / path.name).names == pq.read_schema(path).names
    assert cells_of(results / "parameters.csv") == cells_of(us / "parameters.csv")
    page = us / "report.html"
    first = page.read_text(encoding="utf-8")
    assert "in/s" in first
    assert run("report", us, "-q").code == 0
    assert page.read_text(encoding="utf-8") == first
    assert run("report", us, "--units", "N,m/s", "-q").code == 0
    assert "in/s" not in page.read_text(encoding="utf-8")
