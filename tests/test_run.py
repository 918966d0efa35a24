"""A run as an object: what it offers, and that older folders are still read."""

import json
import shutil
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow.parquet as pq
import pytest

import damperfit
from damperfit.cli.main import main
from damperfit.errors import ConfigurationError

LOGS = [f"sample_runs/setting_0{n}.csv" for n in (1, 2, 3)]
ROOT = Path(__file__).parents[1]


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    where = tmp_path_factory.mktemp("run")
    paths = [str(ROOT / log) for log in LOGS]
    assert main(["identify", *paths, "--profile", "r_m2", "--out", str(where), "--quiet"]) == 0
    return where


@pytest.fixture(scope="module")
def run(folder: Path) -> damperfit.Run:
    return damperfit.load(folder)


def test_the_covariance_is_that_of_the_standard_errors(run) -> None:
    table, errors = run.covariance, run.parameters.set_index("setting")
    for setting in (1, 2, 3):
        block = table.loc[str(setting)]
        names = list(block.index)
        assert names == list(block.columns)
        told = np.sqrt(np.diag(block))
        assert told == pytest.approx([errors.loc[setting, f"{name}_se"] for name in names])
        ones = run.correlations.loc[str(setting)]
        assert np.diag(ones) == pytest.approx(1.0)
        assert (np.abs(ones) <= 1.0 + 1e-12).to_numpy().all()
    assert table.attrs["units"]["k_e"] == "Pa"


def test_a_setting_has_its_values_by_name_and_attribute(run) -> None:
    two = run.setting(2)
    assert dict(two.values)["r_m1"] == two.values.r_m1 == run.parameters["r_m1"][1]
    assert ({*two.own}, {*two.shared}) == ({"r_m1", "r_m2", "k_e"}, {"r_m3", "f_f"})
    assert (two.status["f_0"], two.covariance.shape) == ("fixed", (5, 5))
    with pytest.raises(KeyError):
        two.values["nothing"]


def test_logs_have_segments_and_signals(run) -> None:
    assert [(one.name, one.role) for one in run.logs] == [
        (Path(log).name, "fitted") for log in LOGS
    ]
    (segment,) = run.logs[0].segments
    assert segment["measured_energy_J"] == run.energy["measured_energy_J"][0]
    assert len(run.logs[0].signals.force) == len(run.residuals.query("setting == 1"))
    assert run.logs[0].temperature == pytest.approx(26.4, abs=0.1)
    assert run.tested.n_logs == 3
    assert run.tested.speed == pytest.approx(0.302, abs=1e-3)


def test_frames_of_forces_profiles_and_problems(run) -> None:
    assert (set(run.clicks["setting"]), set(run.profile("r_m2")["setting"])) == ({2, 3}, {1, 2, 3})
    assert run.plot("profile_r_m2").get_ylabel() == "rise of the misfit"
    with pytest.raises(ConfigurationError, match="no profile of 'k_e'; there are r_m2"):
        run.profile("k_e")
    assert all(one.code and one.sentence() for one in run.problems)


def test_it_counts_what_failed_and_lists_no_table_that_is_lost(folder: Path, tmp_path) -> None:
    where = Path(shutil.copytree(folder, tmp_path / "run"))
    (where / "responses.parquet").unlink()
    profiles = pq.read_table(where / "profiles.parquet").drop_columns(["value"])
    pq.write_table(profiles, where / "profiles.parquet")
    record = json.loads((where / "run.json").read_text())
    failures = [{"name": f"{k}.csv", "kind": "LogError", "message": "empty"} for k in range(7)]
    (where / "run.json").write_text(json.dumps(record | {"failures": failures}))
    run = damperfit.load(where)
    assert repr(run).splitlines()[0].endswith(" 7 failed.")
    with pytest.raises(ConfigurationError, match=r"no table 'responses'.* are .*profiles"):
        run.frame("responses")
    with pytest.raises(ConfigurationError, match=r"there are (?!.*responses)"):
        run.frame("responses")
    with pytest.raises(ConfigurationError, match="no figure 'profile_r_m2'"):
        run.plot("profile_r_m2")


@pytest.fixture
def older(folder: Path, tmp_path: Path) -> Path:
    """The same run as the first versions wrote it: fewer tables, columns and keys."""
    where = tmp_path / "older"
    shutil.copytree(folder, where)
    for path in (*where.glob("characteristics*"), *where.glob("profiles*")):
        path.unlink()
    record = json.loads((where / "run.json").read_text())
    for name, lost in {"mse": ["role"], "adjustment": ["measured_N"]}.items():
        pq.write_table(
            pq.read_table(where / f"{name}.parquet").drop_columns(lost), where / f"{name}.parquet"
        )
        columns = record["schema"][name]
        record["schema"][name] = [one for one in columns if one["name"] not in lost]
    record |= {"version": "0.0.1", "schema_version": 1}
    for key in ("quantities", "files", "stretches", "speed_forces", "adjusters"):
        del record[key]
    for entry in record["inputs"]:
        del entry["stretches"]
    for entry in record["uncertainty"]:
        entry.pop("shared", None)
    (where / "run.json").write_text(json.dumps(record))
    return where


def test_an_older_folder_is_read(run, older: Path, capsys) -> None:
    old = damperfit.load(older)
    assert old.remarks == ()
    assert [one.label for one in old.settings] == ["1", "2", "3"]
    for one, other in zip(old.settings, run.settings, strict=True):
        assert one.values == other.values
        assert set(one.shared) == set(other.shared)
        assert one.covariance == pytest.approx(other.covariance)
    assert old.motion.amplitude == pytest.approx(0.032, rel=1e-3)
    assert [one.role for one in old.logs] == ["fitted"] * 3
    assert main(["settings", str(older)]) == 0
    assert main(["report", str(older)]) == 0
    assert main(["export", str(older), "--to", "csv", "--out", str(older / "x")]) == 0
    capsys.readouterr()
    assert main(["compare", str(older), str(run.folder), "--json"]) in {0, 1}
    lines = json.loads(capsys.readouterr().out)["comparisons"][0]["lines"]
    forces = [one for one in lines if one["name"] == "force"]
    assert forces
    for line in forces:
        assert line["first_value"] == pytest.approx(line["second_value"], rel=1e-3)


def test_a_table_alone_is_a_run(folder: Path, tmp_path: Path) -> None:
    table = tmp_path / "mine.csv"
    pd.read_csv(folder / "parameters.csv").to_csv(table, index=False)
    alone = damperfit.Run.load(table)
    assert alone.setting(2).values == damperfit.load(folder).setting(2).values
    assert alone.declared_damper is None


def test_a_log_is_predicted_as_it_was_fitted_and_a_force_found(run) -> None:
    (entry,) = (one for one in run.logs if one.setting == 2)
    own, other = (run.predict(ROOT / LOGS[1], **how) for how in ({}, {"setting": 3}))
    assert own.attrs["mse_percent"] == pytest.approx(entry.mse_percent, rel=0.02)
    assert other.attrs["mse_percent"] > 10.0 * entry.mse_percent
    assert "600" in run.which_setting(600, "0.26m/s").sentence
