"""`import damperfit` and what it offers: a notebook needs no second import."""

import json
import pickle
import re
import subprocess
import sys
from dataclasses import replace
from fractions import Fraction
from inspect import signature, unwrap
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import typer

import damperfit
from damperfit import arguments
from damperfit.arguments import PRESENTATION, keyword_of
from damperfit.cli.main import app
from damperfit.conditioning import condition
from damperfit.configuration.loading import load_configuration
from damperfit.errors import ConfigurationError, DamperfitError, LogError, refuse_wrong_arguments
from damperfit.tested.setting import Setting

ROOT = Path(__file__).parents[2]
LOGS = [str(ROOT / "sample_runs" / f"setting_{number:02d}.csv") for number in (1, 10)]
NAMES = {
    *("Damper", "Motion", "Run"),
    *("compare", "export", "fleet", "identify", "init", "inspect", "load", "models", "read"),
    *("report", "samples", "settings", "simulate", "sweep"),
}


@pytest.fixture(scope="module")
def result():
    return damperfit.identify(LOGS)


@pytest.fixture(scope="module")
def frame():
    return pd.read_csv(LOGS[1], comment="#")


def copy_of(run):
    return pickle.loads(pickle.dumps(run))  # noqa: S301 - our own


def test_every_name_is_there_and_importing_it_imports_nothing_of_weight():
    assert all(getattr(damperfit, name).__doc__ for name in NAMES & {*dir(damperfit)})
    assert "setting= is not needed" in str(damperfit.simulate.__doc__)
    assert "--list" in str(damperfit.export.__doc__)  # no keyword of it
    heavy = ("numpy", "pandas", "pyarrow", "scipy", "matplotlib")
    code = f"import sys, damperfit\nprint([name for name in {heavy} if name in sys.modules])"
    said = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert (said.stdout.strip(), NAMES - {*dir(damperfit)}) == ("[]", set())
    with pytest.raises(AttributeError, match=r"no 'identifi'\. Did you mean 'identify'"):
        _ = damperfit.identifi
    assert not hasattr(damperfit, "anything_else")


def test_a_result_has_values_intervals_and_verdicts_and_prints_itself(result):
    table = result.parameters
    assert table["setting"].tolist() == [1, 10]
    assert table["r_m1"].tolist() == pytest.approx([14012.0, 23952.0], rel=1e-3)
    assert (table["r_m1_ci_low"] < table["r_m1"]).all()
    assert (table["r_m1"] < table["r_m1_ci_high"]).all()
    ten = result.setting(10)
    assert (ten.label, ten.grade) == ("10", "excellent")
    assert (ten.values["r_m1"], ten.mse_percent) == (table["r_m1"][1], table["mse_percent"][1])
    assert ten.intervals["k_e"] == (table["k_e_ci_low"][1], table["k_e_ci_high"][1])
    for same in (10.0, np.int64(10), np.float32(10.0), Fraction(10), Setting.of(10), " 10"):
        assert result.setting(same).label == "10"
    assert (result.failures, "name" in result.checks) == ((), True)
    headline, heads, _, first, *_ = repr(result).splitlines()
    assert headline.startswith("Run: 2 settings fitted, 2 excellent; MSE median 0.0008")
    assert repr(result.setting("1")) == "<setting 1: MSE 0.00121 %, excellent>"
    assert (heads.split()[:3], first.split()[:3]) == (["set", "R_m1", "R_m2"], ["1", "14.01", "±"])
    page = result._repr_html_()
    assert page.startswith("<table><caption>Run: 2 settings")
    assert "14.01 ± 0.03" in page
    assert all(f"<td>{name}</td>" in page for name in result.checks["name"])


def test_a_setting_simulates_itself(result):
    seen = result.setting(10).simulate("sine", amplitude=0.04, frequency=2)
    assert np.ptp(seen.displacement) == pytest.approx(0.08, rel=1e-4)
    assert seen.force.max() == pytest.approx(4121.6, abs=0.5)
    assert len(seen.time) == len(seen.velocity) == seen.pressures.shape[1]
    names = ["time_s", "displacement_m", "velocity_m_per_s", "force_N"]
    assert list(seen.to_frame())[:4] == names
    assert "sine of 40 mm at 2 Hz" in repr(seen)
    same = damperfit.simulate(10, parameters=result, amplitude="40mm", frequency="2Hz")
    assert np.array_equal(same.force, seen.force)
    # The reference set, where nothing is given.
    plain, firm = damperfit.simulate(10), damperfit.simulate(10, set={"r_m1": 4e4})
    assert firm.force.max() > 1.5 * plain.force.max()


def test_figures_return_their_axes(result):
    assert result.plot().get_title(loc="left").startswith("Force against velocity")
    assert len(result.plot("setting_10_force_time")) == 2
    names = [axes.get_xlabel() for axes in result.setting(1).simulate().plot()]
    assert [name.split()[0] for name in names] == ["displacement", "velocity"]


# A run in memory


def test_nothing_is_written_without_a_folder(tmp_path, monkeypatch):
    monkeypatch.setenv("TMPDIR", str(tmp_path / "tmp"))
    monkeypatch.setattr("tempfile.tempdir", None)
    (tmp_path / "tmp").mkdir()
    monkeypatch.chdir(tmp_path)
    run = damperfit.identify(LOGS[1])
    assert len(run.traces) == len(run.residuals)
    assert len(damperfit.settings(run).to_frame()) > 0
    assert damperfit.simulate(run.settings[0].label, parameters=run).warnings == ()
    assert damperfit.compare(run, run).is_met
    assert run.folder is None
    assert sorted(path.name for path in tmp_path.rglob("*")) == ["tmp"]


def test_a_saved_result_is_what_the_command_line_writes(result, tmp_path):
    where = result.save(tmp_path / "kept")
    written = damperfit.identify(LOGS, out=tmp_path / "results")
    assert written.folder == tmp_path / "results"
    names = {path.name for path in where.iterdir()}
    assert {"parameters.parquet", "parameters.csv", "run.json", "report.md"} <= names
    assert names == {path.name for path in written.folder.iterdir()}
    for name in names - {"run.json"}:
        assert (where / name).read_bytes() == (written.folder / name).read_bytes()
    again = damperfit.load(where)
    for name in ("parameters", "mse", "characteristics", "adjustment", "responses"):
        assert again.frame(name).equals(result.frame(name))
    other = {"files": 0, "timings": 0, "configuration": 0}
    assert {**again.record, **other} == {**written.record, **other}
    with pytest.raises(DamperfitError, match="there already"):
        again.save(where)
    assert damperfit.load(again.save(tmp_path / "moved")).parameters.equals(result.parameters)
    assert again.report(tmp_path / "page.html").read_text().startswith("<!DOCTYPE html>")


def test_a_pickle_holds_the_whole_result_whether_or_not_it_was_saved(result, tmp_path):
    kept = damperfit.load(result.save(tmp_path / "kept"))
    for again in (copy_of(result), copy_of(kept), copy_of(copy_of(kept))):
        assert again.folder is None
        for name in ("parameters", "mse", "responses", "characteristics"):
            assert again.frame(name).equals(result.frame(name))
        force = again.setting(1).simulate().force
        assert force.tolist() == result.setting(1).simulate().force.tolist()


_UNKNOWN_MOTION = {"rig": {"amplitude": None, "frequency": None}}


@pytest.mark.parametrize(
    ("edit", "remark"),
    [
        (lambda record: record.update(schema={"parameters": 5}), ""),
        (lambda record: record["speed_forces"][0].update(measured=[1.0]), ""),
        (lambda record: record["speed_forces"][0].pop("misfit"), ""),
        (lambda record: [log.update(sha256=["x"]) for log in record["inputs"]], ""),
        (lambda record: record["configuration"].update(_UNKNOWN_MOTION), ""),
        (lambda record: record.update(uncertainty=[]), "of all settings are missing in run.json"),
        (lambda record: record["uncertainty"].pop(), "errors and correlations of setting "),
    ],
)
def test_an_edited_record_costs_what_it_told_alone(result, tmp_path, edit, remark):
    where = result.save(tmp_path / "edited")
    record = json.loads((where / "run.json").read_text(encoding="utf-8"))
    edit(record)
    (where / "run.json").write_text(json.dumps(record), encoding="utf-8")
    answer = damperfit.settings(where)
    assert [remark in str(told) for told in answer.remarks] == [True] * bool(remark)
    assert not any("no errors are known" in str(note) for note in answer.notes)
    assert damperfit.compare(where, where).is_met


def test_results_are_compared_by_their_place_in_the_call_where_they_are_unsaved(result, tmp_path):
    copy = copy_of(result)
    same = damperfit.compare(result, copy)
    assert same.sentences[0].startswith("measured: identical")
    assert same.sentences[1].startswith("forces: all 20 the same")
    assert "same within errors" in same._repr_html_()
    both = same.comparisons[0]
    assert (both.first.name, both.second.name) == ("result 1", "result 2")
    saved = damperfit.compare(result.save(tmp_path / "kept"), copy)
    table = saved.to_frame()
    assert (set(table["first"]), set(table["second"])) == ({"kept"}, {"result 2"})


def test_a_result_is_handed_over_also_when_the_package_of_targets_is_loaded(result, tmp_path):
    import damperfit.exporting

    (one,) = damperfit.export(result, to="fmu2", out=tmp_path / "mine.fmu")
    assert (one, one.is_file()) == (tmp_path / "mine.fmu", True)  # a file, as on the command line
    files = damperfit.export(result, to="csv", out=tmp_path / "out")
    tables = {path.name: path.read_text() for path in files if path.suffix == ".csv"}
    assert "damper.csv" in tables
    assert all(text.startswith("setting") for text in tables.values())


# What is given


def test_a_frame_gives_what_its_file_gives(frame):
    by_file = damperfit.identify(LOGS[1]).parameters["r_m1"].tolist()
    assert damperfit.identify({"10": frame}).parameters["r_m1"].tolist() == by_file
    arrays = {
        "time": frame["time_s"].to_numpy(),
        "displacement": frame["displacement_mm"].to_numpy() / 10.0,
        "force": frame["force_N"].to_numpy() / 1e3,
    }
    units = {"time": "s", "displacement": "cm", "force": "kN"}
    found = damperfit.identify({10: arrays}, units=units).parameters["r_m1"].tolist()
    assert found == pytest.approx(by_file, rel=1e-9)
    assert [one.label for one in damperfit.identify({"soft": frame}).settings] == ["soft"]
    assert len(damperfit.read({"10": frame.set_index("time_s")}).time) == len(frame)


def test_traces_and_recordings_are_as_good_as_paths(result):
    """What is in memory is fitted as it is, beside what must be read."""
    recordings = [damperfit.read(path) for path in LOGS]
    traces = [condition(one) for one in recordings]
    for given in ([LOGS[0], traces[1]], [recordings[0], traces[1]]):
        found = damperfit.identify(given)
        assert found.parameters.equals(result.parameters)
        assert [one["log"] for one in found.record["inputs"]] == [Path(p).name for p in LOGS]
        assert found.failures == ()
    assert damperfit.identify(traces[0]).settings[0].label == "1"
    assert damperfit.identify(replace(traces[0], setting=None), setting=7).setting(7)
    with pytest.raises(LogError, match="has no setting; give setting=N"):
        damperfit.identify(replace(traces[0], setting=None))
    with pytest.raises(ConfigurationError, match=r"two logs are called setting_01\.csv"):
        damperfit.identify([LOGS[0], traces[0]])


def test_a_damper_is_declared_as_an_object_or_as_keys():
    thick = damperfit.Damper(rod_diameter=0.014)
    held = {"fix": {"r_m3": 2.6e6, "f_f": 50.0}}
    as_object = damperfit.identify(LOGS[1], damper=thick, **held).parameters
    as_keys = damperfit.identify(LOGS[1], damper={"rod_diameter": "14mm"}, **held).parameters
    assert as_object["r_m1"].tolist() == as_keys["r_m1"].tolist()
    assert as_object["r_m1"][0] != pytest.approx(23952.0, rel=0.01)


# A wrong call, and what its sentence says: that, on one line, without an option's dashes
_WRONG = """
identify() -> damperfit.identify: missing a required argument: 'logs'
identify(None) -> found NoneType; expected paths
identify(['a.csv', '']) -> damperfit.identify: found ''; expected paths
identify('nowhere.csv') -> nowhere.csv: no such file
identify([frame]) -> found DataFrame in a list
identify(frame) -> without a label; give {'10': frame}
identify({'10': {'time_s': [0.0, 1.0], 'force_N': [1.0]}}) -> give columns of one length
identify({'10': frame.drop(columns='time_s')}) -> rig.columns.time = 'NAME'
identify({'10': frame.rename(columns={'force_N': 'force'})}) -> units={'force': 'N'}
identify(result) -> found Run; expected paths
identify(LOG, free=['r_m9']) -> (free=...): no parameter 'r_m9'
identify(LOG, fix='f_f=50N') -> expected a mapping of names
identify(LOG, fixed={'k_e': 1e9}) -> no keyword 'fixed'
identify(LOG, share=['r_m3']) -> (share='r_m3') has no effect: only procedure joint
identify(LOG, hold_out='no.csv') -> as in hold_out='*_16mm.csv'
identify(LOG, damper=3) -> (damper=...): found int
identify(LOG, damper={'bore': '32mm'}) -> damperfit.identify: unknown key 'bore' in [damper]
identify(LOG, damper=damperfit.Damper) -> found the class Damper; expected a damper
identify(LOG, out='') -> (out=...): found ''; expected the path of a folder, '.' for this
identify(LOG, jobs=0) -> (jobs=0): expected 1 or more
inspect(LOG, setting=9) -> (setting=9): setting_10.csv says setting 10; leave the option out
read([LOG, LOG]) -> found several logs
simulate() -> give setting=N or set= them all
simulate(result) -> damperfit.simulate(10, parameters=result)
simulate(10, wave='square') -> expected 'sine' or 'triangle', found 'square'
simulate(10, damper={'model': 'auto'}) -> let the logs choose
compare() -> found no result
compare(result) -> or tolerance=FILE with nominal forces
compare(result, result, tolerance='x') -> (tolerance='x'): expected per cent, newtons
compare(result, result, tolerance=5) -> found 5; expected '5%', '20N' or the path of a table
compare(result, result, tolerance=Path('no.csv')) -> (tolerance='no.csv'): no such file
settings(result, force=True, velocity=0.2) -> 'True' cannot be read as force
compare(result, result, measured='x') -> (measured=...): found 'x'; expected True
compare(result, result, amplitude='5mm') -> amplitude= and frequency= make the sine
export(result) -> export: no target: give to=
export(result, 'csv') -> give out=FOLDER
export(result, to='fmu22', out='x') -> Did you mean 'fmu2'
export(result, 'fmu2', 'x.csv') -> (out='x.csv'): fmu2 writes .fmu files
report(result) -> give out=FOLDER
Run.load(3) -> damperfit.load: found int; expected the path of a results folder
Damper(bore='32') -> damperfit.Damper: no keyword 'bore'; there are rod_diameter,
Damper(rod_diameter='19mm') -> rod_diameter: expected a number in m, found '19mm'
Motion([1, 2], [3]) -> damperfit.Motion: missing a required argument: 'velocity'
Motion(0.001, ['a', 'b'], [3, 4]) -> expected an array of numbers for displacement
result.setting(7) -> no setting 7; there are 1, 10
result.setting(True) -> run.setting: found bool; expected a setting
result.setting(10).simulate(setting=3) -> the parameters are those of setting 10
result.plot('fann') -> Did you mean 'fan'?
result.frame('params') -> Did you mean 'parameters'?
"""


@pytest.mark.parametrize("line", _WRONG.strip().splitlines())
def test_no_wrong_call_ends_inside(line, frame, result, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    call, said = line.split(" -> ")
    names = {"damperfit": damperfit, "result": result, "frame": frame, "LOG": LOGS[1]}
    names["Path"] = Path
    with pytest.raises(DamperfitError) as caught:
        eval(call if call.startswith("result.") else f"damperfit.{call}", names)  # noqa: S307
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)
    assert not re.search(r"(?<!export )--[a-z]", str(caught.value))
    assert list(tmp_path.iterdir()) == []


def test_logs_are_inspected():
    seen = damperfit.inspect(LOGS)
    assert seen.to_frame()["setting"].tolist() == ["1", "10"]
    assert repr(seen).startswith("2 logs, 0 cannot be used")
    assert "<td>setting_10.csv</td>" in seen._repr_html_()
    assert "setting_10.csv" in str(seen)
    rate = next(finding for finding in seen.findings if finding["name"] == "sample_rate")
    assert (rate["log"], rate["severity"]) == ("setting_01.csv", "note")


def test_a_type_error_that_is_no_wrong_call_stays_what_it_is():
    @refuse_wrong_arguments("door")
    def door(number):
        return number + "x"

    with pytest.raises(TypeError, match="unsupported operand"):
        door(3)
    for given, named, says in (
        ((), {}, "missing a required argument: 'number'"),
        ((3,), {"number": 4}, "multiple values for argument 'number'"),
    ):
        with pytest.raises(ConfigurationError, match=f"door: {says}"):
            door(*given, **named)


# Every option of a command is a keyword of the function of the same name, and vice versa.

COMMANDS = typer.main.get_command(app).commands
OF_MACHINE = {"config", "doctor", "help"}  # nothing of them is asked from Python
BOTH = sorted(set(COMMANDS) - OF_MACHINE)


@pytest.mark.parametrize("name", BOTH)
def test_options_are_keywords_and_keywords_are_options(name) -> None:
    options = {param.name for param in COMMANDS[name].params} - {*PRESENTATION}
    taken = set(signature(unwrap(getattr(damperfit, name))).parameters)
    assert options == {one for one in taken if keyword_of(name, one) is not None}
    for param in COMMANDS[name].params:
        if param.param_type_name == "option" and param.name != "help":
            assert param.help == keyword_of(name, param.name).help


def test_what_sets_a_key_sets_one_that_is_there() -> None:
    document = load_configuration().document
    for name, one in arguments._keywords().items():
        section, _, key = (one.key or "").partition(".")
        assert not key or key in document[section], name
