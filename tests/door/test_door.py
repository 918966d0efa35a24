"""`import damperfit` and what it offers: a notebook needs no second import."""

from __future__ import annotations

import gc
import pickle
import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

import damperfit
from damperfit.conditioning import condition
from damperfit.errors import (
    ConfigurationError,
    DamperfitError,
    LogError,
    refuse_wrong_arguments,
)
from damperfit.run import identify

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


def test_every_name_is_there_and_told():
    assert set(dir(damperfit)) >= NAMES
    for name in NAMES:
        assert getattr(damperfit, name).__doc__


def test_importing_it_imports_nothing_of_weight():
    heavy = ("numpy", "pandas", "pyarrow", "scipy", "matplotlib")
    code = f"import sys, damperfit\nprint([name for name in {heavy} if name in sys.modules])"
    said = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert said.stdout.strip() == "[]"


def test_a_name_that_is_none_is_an_attribute_error_with_the_nearest():
    with pytest.raises(AttributeError, match=r"no 'identifi'\. Did you mean 'identify'"):
        _ = damperfit.identifi
    assert not hasattr(damperfit, "anything_else")


def test_a_result_has_values_intervals_and_verdicts_without_a_second_call(result):
    table = result.parameters
    assert table["setting"].tolist() == [1, 10]
    assert table["r_m1"].tolist() == pytest.approx([14012.0, 23952.0], rel=1e-3)
    assert (table["r_m1_ci_low"] < table["r_m1"]).all()
    assert (table["r_m1"] < table["r_m1_ci_high"]).all()
    assert result.to_frame().equals(table)
    ten = result.setting(10)
    assert (ten.label, ten.grade) == ("10", "excellent")
    assert ten.values["r_m1"] == table["r_m1"][1]
    assert ten.intervals["k_e"] == (table["k_e_ci_low"][1], table["k_e_ci_high"][1])
    assert ten.mse_percent == table["mse_percent"][1]
    assert result.setting(10.0).label == "10"
    assert result.failures == ()
    assert "name" in result.checks


def test_a_result_prints_itself(result):
    assert repr(result) == "<Run: 2 settings, MSE 0.00043 to 0.0012 %>"
    assert repr(result.setting("1")) == "<setting 1: MSE 0.00121 %, excellent>"
    lines = str(result).splitlines()
    assert lines[0].split()[:3] == ["set", "R_m1", "R_m2"]
    assert lines[2].split()[:3] == ["1", "14.01", "±"]
    page = result._repr_html_()
    assert page.startswith("<table><caption>Run: 2 settings")
    assert page.count("<tr>") == 4
    assert "14.01 ± 0.03" in page


def test_a_setting_simulates_itself(result):
    seen = result.setting(10).simulate("sine", amplitude=0.04, frequency=2)
    assert np.ptp(seen.displacement) == pytest.approx(0.08, rel=1e-4)
    assert seen.force.max() == pytest.approx(4121.6, abs=0.5)
    assert len(seen.time) == len(seen.velocity) == seen.pressures.shape[1]
    assert list(seen.to_frame())[:4] == [
        "time_s",
        "displacement_m",
        "velocity_m_per_s",
        "force_N",
    ]
    assert "sine of 40 mm at 2 Hz" in repr(seen)
    same = damperfit.simulate(10, parameters=result, amplitude="40mm", frequency="2Hz")
    assert np.array_equal(same.force, seen.force)


def test_the_reference_set_is_simulated_where_nothing_is_given():
    plain = damperfit.simulate(10)
    firm = damperfit.simulate(10, set={"r_m1": 4e4})
    assert firm.force.max() > 1.5 * plain.force.max()


def test_figures_return_their_axes(result):
    axes = result.plot()
    assert axes.get_title(loc="left").startswith("Force against velocity")
    assert len(result.plot("setting_10_force_time")) == 2
    left, right = result.setting(1).simulate().plot()
    assert (left.get_xlabel(), right.get_xlabel()) == ("velocity, m/s", "displacement, mm")


def test_a_result_pickles_with_its_files(result):
    again = pickle.loads(pickle.dumps(result))  # noqa: S301
    assert again.folder != result.folder
    assert again.parameters.equals(result.parameters)
    assert again.frame("responses").equals(result.frame("responses"))
    assert again.setting(1).simulate().force.tolist() == result.setting(1).simulate().force.tolist()


def test_a_temporary_folder_goes_with_its_result(result):
    again = pickle.loads(pickle.dumps(result))  # noqa: S301
    folder = again.folder
    assert folder.is_dir()
    del again
    gc.collect()
    assert not folder.exists()
    assert result.folder.is_dir()


def test_a_result_is_saved_and_loaded(result, tmp_path):
    where = result.save(tmp_path / "kept")
    names = {path.name for path in where.iterdir()}
    assert {"parameters.parquet", "parameters.csv", "run.json", "report.md"} <= names
    again = damperfit.load(where)
    assert again.parameters.equals(result.parameters)
    with pytest.raises(DamperfitError, match="there already"):
        again.save(where)
    page = again.report(tmp_path / "page.html")
    assert page.read_text().startswith("<!DOCTYPE html>")


def test_out_is_where_the_command_line_writes_too(tmp_path):
    found = damperfit.identify(LOGS[1], out=tmp_path / "results")
    assert found.folder == tmp_path / "results"
    assert (tmp_path / "results" / "report.md").exists()


class TestFrames:
    """A data frame or arrays are as good as a file."""

    def test_a_frame_gives_what_its_file_gives(self, frame):
        alone = damperfit.identify(LOGS[1])
        found = damperfit.identify({"10": frame})
        assert found.parameters["r_m1"].tolist() == alone.parameters["r_m1"].tolist()

    def test_arrays_with_units_do_too(self, frame):
        arrays = {
            "time": frame["time_s"].to_numpy(),
            "displacement": frame["displacement_mm"].to_numpy() / 10.0,
            "force": frame["force_N"].to_numpy() / 1e3,
        }
        units = {"time": "s", "displacement": "cm", "force": "kN"}
        alone = damperfit.identify(LOGS[1]).parameters["r_m1"]
        found = damperfit.identify({10: arrays}, units=units).parameters["r_m1"]
        assert found.tolist() == pytest.approx(alone.tolist(), rel=1e-9)

    def test_a_label_may_be_a_word(self, frame):
        found = damperfit.identify({"soft": frame})
        assert [one.label for one in found.settings] == ["soft"]

    def test_time_may_be_the_index(self, frame):
        found = damperfit.read({"10": frame.set_index("time_s")})
        assert len(found.time) == len(frame)

    def test_units_that_are_missing_are_asked_for_in_words_of_a_call(self, frame):
        bare = frame.rename(columns={"force_N": "force"})
        with pytest.raises(LogError, match=r"units=\{'force': 'N'\}") as caught:
            damperfit.identify({"10": bare})
        assert "--rig" not in str(caught.value)

    def test_a_frame_of_two_columns_of_one_name_is_refused(self, frame):
        doubled = pd.concat([frame, frame[["force_N"]]], axis=1)
        with pytest.raises(LogError, match="10: the data frame cannot be read as a log"):
            damperfit.identify({"10": doubled})

    def test_columns_of_different_lengths_are_refused(self):
        with pytest.raises(LogError, match="give columns of one length"):
            damperfit.identify({"10": {"time_s": [0.0, 1.0], "force_N": [1.0]}})


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda f, _: damperfit.identify(f), "without a label; give {'10': frame}"),
        (lambda *_: damperfit.identify(3), "found int; expected paths or patterns"),
        (lambda f, _: damperfit.identify([f]), "found DataFrame in a list"),
        (lambda *_: damperfit.identify([]), "found no log"),
        (lambda *_: damperfit.identify({}), "found no log"),
        (lambda *_: damperfit.identify({"10": 3}), "'10' is of type int"),
        (lambda *_: damperfit.identify("nowhere.csv"), "nowhere.csv: no such file"),
        (lambda *_: damperfit.compare(3, 4), "damperfit.compare: found int; expected a result"),
        (lambda *_: damperfit.export(7, "csv"), "damperfit.export: found int; expected a result"),
        (lambda *_: damperfit.identify(LOGS, free=["r_m9"]), r"(free=...): no parameter 'r_m9'"),
        (lambda *_: damperfit.identify(LOGS, fix={"f_f": "x"}), "(fix=...): f_f = x: expected"),
        (lambda *_: damperfit.identify(LOGS, damper=3), "(damper=...): found int"),
        (
            lambda *_: damperfit.identify(LOGS, damper={"rod": "1mm"}),
            "damperfit.identify: unknown key 'rod' in [damper]",
        ),
        (lambda *_: damperfit.identify(LOGS, units={"force": "stone"}), "no unit of force"),
        (lambda *_: damperfit.identify(LOGS, setting=""), "setting=''"),
        (lambda _, r: r.frame("params"), "Did you mean 'parameters'?"),
        (lambda _, r: r.setting(7), "no setting 7; there are 1, 10"),
        (lambda _, r: r.plot("fann"), "Did you mean 'fan'?"),
        (lambda *_: damperfit.load(3), "expected the path of a results folder"),
        (lambda *_: damperfit.load("/nowhere"), "nowhere"),
        (lambda *_: damperfit.compare(), "found no result"),
        (lambda *_: damperfit.read(LOGS), "found several logs"),
        (lambda _, r: damperfit.simulate(r), "damperfit.simulate(10, parameters=result)"),
        (lambda *_: damperfit.simulate(), "give setting=N or set= them all"),
        (lambda _, r: damperfit.export(r, "csv"), "give out=FOLDER"),
        (lambda *_: damperfit.inspect(LOGS, test="t.csv"), "no keyword 'test'"),
        (lambda *_: damperfit.simulate(10, frequncy=2), "no keyword 'frequncy'"),
        (lambda *_: damperfit.identify(LOGS, fix="f_f=50N"), "expected a mapping of names"),
        (lambda *_: damperfit.identify(LOGS, rig="strict"), "(rig=...): found 'strict'"),
        (lambda *_: damperfit.identify(LOGS, units="kN,stone"), "stone"),
        (lambda *_: damperfit.identify(LOGS, fix=["k_e"]), "damperfit.identify(fix=...): found"),
        (lambda *_: damperfit.identify(LOGS, fixed={"k_e": 1e9}), "no keyword 'fixed'"),
        (lambda *_: damperfit.identify(LOGS, jobs=0), "(jobs=...): found 0; expected a whole"),
        (lambda *_: damperfit.inspect(LOGS, jobs=1.5), "(jobs=...): found 1.5"),
        (lambda _, r: damperfit.export(r), "damperfit.export: no target given"),
        (
            lambda *_: damperfit.Damper(rod_diameter="19mm"),
            "rod_diameter: expected a number in m, found '19mm'",
        ),
    ],
)
def test_a_wrong_call_gets_a_sentence(call, said, frame, result):
    with pytest.raises(ConfigurationError) as caught:
        call(frame, result)
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)


_WRONG = [
    ("identify()", "damperfit.identify: logs missing"),
    ("identify(LOG, LOG)", "too many arguments; give those after the first by name: logs, free"),
    ("identify(None)", "found NoneType; expected paths"),
    ("identify(result)", "found Run; expected paths"),
    ("identify([[LOG]])", "found list in a list"),
    ("identify(LOG, free=3)", "(free=...): found 3; expected a list of names"),
    ("identify(LOG, share=3)", "(share=...): found 3"),
    ("identify(LOG, hold_out=3)", "(hold_out=...): found 3"),
    ("identify(LOG, profile=True)", "(profile=...): found True"),
    ("identify(LOG, hold_out='no.csv')", "as in hold_out='*_16mm.csv'"),
    ("identify(LOG, rig={3: 3})", "(rig=...): found 3 in place of a name"),
    ("identify(LOG, units={3: 4})", "(units=...): found 3 in place of a name"),
    ("identify(LOG, damper={3: 4})", "(damper=...): found 3 in place of a name"),
    ("identify(LOG, damper={'bore': '32mm'})", "unknown key 'bore' in [damper]"),
    ("identify(LOG, damper={'rod_diameter': '32kg'})", "no unit of length 'kg'"),
    ("identify(LOG, damper=damperfit.Damper)", "found the class Damper; expected a damper"),
    ("identify(LOG, damper=damperfit.Motion(1.0, [1], [0]))", "(damper=...): found Motion"),
    ("identify(LOG, config=3)", "(config=...): found int; expected the path of a TOML file"),
    ("identify(LOG, out=3)", "(out=...): found int; expected the path of a folder"),
    ("identify(LOG, tests=3)", "(tests=...): found int; expected the path of a table"),
    ("identify(LOG, jobs=True)", "(jobs=...): found True; expected a whole number"),
    ("identify(LOG, setting=3j)", "setting=...: found complex; expected a setting"),
    ("inspect(LOG, setting=object())", "setting=...: found object; expected a setting"),
    (
        "inspect(LOG, setting=9)",
        "(setting=9): setting_10.csv says setting 10; leave the option out",
    ),
    ("read()", "damperfit.read: log missing"),
    ("simulate(setting='x')", "(setting=x): not in the reference set; expected a whole number"),
    ("simulate(frame)", "(setting=...): found DataFrame; expected a setting"),
    ("simulate(10, 'sine')", "damperfit.simulate: too many arguments"),
    ("simulate(10, parameters=3)", "(parameters=...): found int; expected a result"),
    ("simulate(10, displacement=frame)", "(displacement=...): found DataFrame; expected the path"),
    ("simulate(10, wave='square')", "expected 'sine' or 'triangle', found 'square'"),
    ("compare(result)", "or tolerance=FILE with nominal forces"),
    ("compare(result, result, tolerance=5)", "(tolerance=...): found 5; expected '5%'"),
    ("compare(result, result, tolerance='x')", "(tolerance=x): expected per cent, newtons"),
    ("compare(result, result, toleranz=3)", "Did you mean 'tolerance'?"),
    ("compare(result, result, velocity=3j)", "(velocity=...): found 3j; expected speeds"),
    ("compare(result, result, jobs='x')", "(jobs=...): found 'x'"),
    ("compare(result, result, measured='x')", "(measured=...): found 'x'; expected True"),
    ("compare(result, result, amplitude='5mm')", "amplitude= and frequency= make the sine"),
    ("export(result, to='fmu9')", "(to=fmu9): expected one of csv, xlsx"),
    ("export(result, to=3)", "(to=3): expected one of csv, xlsx"),
    (
        "export(result, to='csv', out=3)",
        "(out=...): found int; expected the path of a file or folder",
    ),
    (
        "export(result, 'csv', 'x', extend=[])",
        "or a text such as '1.5m/s' for a velocity, found []",
    ),
    ("export(result, 'fmu2', 'x.csv')", "(out=x.csv): fmu2 writes .fmu files"),
    ("export(result, 'csv', '')", "damperfit.export(out=...): found ''; expected the path"),
    ("identify('')", "damperfit.identify: found ''; expected paths or patterns"),
    ("identify(['a.csv', ''])", "damperfit.identify: found ''; expected paths or patterns"),
    ("inspect('')", "damperfit.inspect: found ''; expected paths or patterns"),
    ("identify(LOG, out='')", "(out=...): found ''; expected the path of a folder, '.' for this"),
    ("identify(LOG, share=['r_m3'])", "(share=...): only procedure joint fits shared"),
    ("simulate(10, damper={'model': 'auto'})", "let the logs choose"),
    ("compare(result, '')", "damperfit.compare: found ''; expected a result, or the path"),
    ("load('')", "damperfit.load: found ''; expected the path of a results folder"),
    ("load(None)", "damperfit.load: found NoneType; expected the path of a results folder"),
    ("Damper(bore='32')", "damperfit.Damper: no keyword 'bore'; there are rod_diameter,"),
    ("Damper(rod_diamter=0.03)", "Did you mean 'rod_diameter'?"),
    ("Motion([1, 2], [3])", "damperfit.Motion: velocity missing"),
    ("Motion('x', [1, 2], [3, 4])", "motion: expected a number for interval, found 'x'"),
    ("Motion(0.001, [1, 2], [3, 4], 'x')", "motion: expected a number for start_time, found 'x'"),
    ("Motion(0.001, [1, 2], [3, 4], gas_pressure='x')", "number for gas_pressure, found 'x'"),
    ("Motion(0.001, ['a', 'b'], [3, 4])", "expected an array of numbers for displacement"),
    ("Motion(0.001, [1, 2], [[1, 2], [3]])", "expected an array of numbers for velocity"),
    ("Run.load(3)", "damperfit.load: found int; expected the path of a results folder"),
    ("result.setting()", "run.setting: setting missing"),
    ("result.setting(frame)", "run.setting: found DataFrame; expected a setting"),
    ("result.setting(True)", "run.setting: found bool; expected a setting"),
    ("result.setting(10).simulate(setting=3)", "the parameters are those of setting 10"),
    ("result.plot([])", "no figure '[]'; there are fan"),
    ("result.frame(3)", "no table '3' in these results"),
    ("result.report(3)", "run.report: found int; expected the path of a page"),
    ("result.save(3)", "run.save: found int; expected the path of a folder"),
    ("identify({'10': {}})", "10: the data frame has no columns"),
    ("identify({'10': frame.drop(columns='time_s')})", "rig.columns.time = 'NAME'"),
    ("identify({'10': {'time_s': 3, 'force_N': 4}})", "10: found single numbers"),
]


@pytest.mark.parametrize(("call", "said"), _WRONG)
def test_no_wrong_call_ends_inside(call, said, frame, result):
    names = {"damperfit": damperfit, "result": result, "frame": frame, "LOG": LOGS[1]}
    with pytest.raises(DamperfitError) as caught:
        eval(call if call.startswith("result.") else f"damperfit.{call}", names)  # noqa: S307
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)
    assert not re.search(r"(?<!export )--[a-z]", str(caught.value))


def test_a_type_error_that_is_no_wrong_call_stays_what_it_is():
    @refuse_wrong_arguments("door")
    def door(number):
        return number + "x"

    with pytest.raises(TypeError, match="unsupported operand"):
        door(3)
    with pytest.raises(ConfigurationError, match="door: number missing"):
        door()
    with pytest.raises(ConfigurationError, match="door: number given twice"):
        door(3, number=4)


def test_traces_and_recordings_are_as_good_as_paths(result):
    """What is in memory is fitted as it is, beside what must be read."""
    paths, by_path = LOGS, result
    recordings = [damperfit.read(path) for path in paths]
    traces = [condition(one) for one in recordings]
    for given in (traces, recordings, [paths[0], traces[1]], [recordings[0], traces[1]]):
        found = damperfit.identify(given)
        assert found.parameters.equals(by_path.parameters)
        assert [one["log"] for one in found.record["inputs"]] == [Path(p).name for p in paths]
        assert found.failures == ()
    assert damperfit.identify(traces[0]).settings[0].label == "1"
    assert damperfit.identify(replace(traces[0], setting=None), setting=7).setting(7)
    with pytest.raises(LogError, match="has no setting; give setting=N"):
        damperfit.identify(replace(traces[0], setting=None))
    with pytest.raises(ConfigurationError, match=r"two logs are called setting_01\.csv"):
        damperfit.identify([paths[0], traces[0]])


def test_a_damper_is_declared_as_an_object_or_as_keys():
    thick = damperfit.Damper(rod_diameter=0.014)
    held = {"fix": {"r_m3": 2.6e6, "f_f": 50.0}}
    as_object = damperfit.identify(LOGS[1], damper=thick, **held).parameters
    as_keys = damperfit.identify(LOGS[1], damper={"rod_diameter": "14mm"}, **held).parameters
    assert as_object["r_m1"].tolist() == as_keys["r_m1"].tolist()
    assert as_object["r_m1"][0] != pytest.approx(23952.0, rel=0.01)


def test_logs_are_inspected(result):
    seen = damperfit.inspect(LOGS)
    assert seen.to_frame()["setting"].tolist() == ["1", "10"]
    assert repr(seen) == "<Inspection: 2 logs, 0 cannot be used>"
    assert "setting_10.csv" in str(seen)
    assert "<td>setting_10.csv</td>" in seen._repr_html_()


def test_results_are_compared(result):
    same = damperfit.compare(result, pickle.loads(pickle.dumps(result)))  # noqa: S301
    assert same.sentences[0].startswith("measured: identical")
    assert same.sentences[1].startswith("forces: all 20 the same")
    assert len(same.to_frame()) > 20
    assert "same within errors" in same._repr_html_()


def test_unsaved_results_are_called_by_their_place_in_the_call(result, tmp_path):
    copy = pickle.loads(pickle.dumps(result))  # noqa: S301
    kept = result.save(tmp_path / "kept")
    both = damperfit.compare(result, copy).compared.comparisons[0]
    assert (both.first.name, both.second.name) == ("result 1", "result 2")
    one = damperfit.compare(kept, copy)
    assert one.compared.comparisons[0].first.name == "kept"
    frame = one.to_frame()
    assert set(frame["first"]) == {"kept"}
    assert set(frame["second"]) == {"result 2"}
    assert str(copy.folder) not in one._repr_html_() + str(one)


def test_a_suggestion_is_near():
    with pytest.raises(AttributeError, match="Did you mean 'identify'"):
        damperfit.identfy  # noqa: B018
    with pytest.raises(AttributeError, match=r"damperfit has no 'nothing'\.$"):
        damperfit.nothing  # noqa: B018


def test_calls_of_the_layers_below_say_what_they_want():
    from damperfit.conditioning import condition
    from damperfit.identification import identify

    with pytest.raises(ConfigurationError, match=r"found str; expected a recording"):
        condition(LOGS[0])
    with pytest.raises(ConfigurationError, match=r"found str among the traces"):
        identify(LOGS, damperfit.Damper())


def test_a_result_is_handed_over_also_when_the_package_of_targets_is_loaded(result, tmp_path):
    import damperfit.exporting

    (one,) = damperfit.export(result, to="fmu2", out=tmp_path / "mine.fmu")
    assert one == tmp_path / "mine.fmu"  # a file, as on the command line
    assert one.is_file()
    files = damperfit.export(result, to="csv", out=tmp_path / "out")
    tables = [path for path in files if path.suffix == ".csv"]
    assert "damper.csv" in {path.name for path in tables}
    assert all(path.read_text().startswith("setting") for path in tables)
    with pytest.raises(ConfigurationError, match="Did you mean 'fmu2'"):
        damperfit.export(result, to="fmu22", out=tmp_path)


@pytest.mark.parametrize(("n", "more"), [(3, ""), (4, " (and 1 more)")])
def test_three_logs_that_could_not_be_fitted_are_named(monkeypatch, tmp_path, n, more):
    failures = [SimpleNamespace(message=f"{k}.csv: empty", problem=None) for k in range(n)]
    found = SimpleNamespace(
        campaign=SimpleNamespace(fits=()), facts=SimpleNamespace(failures=failures), error=None
    )
    monkeypatch.setattr(identify, "written", lambda *_, **__: [found])
    with pytest.raises(LogError) as caught:
        damperfit.identify(LOGS, out=tmp_path / "results")
    said = "no setting could be fitted: 0.csv: empty; 1.csv: empty; 2.csv: empty"
    assert str(caught.value) == f"{said}{more}"


def test_a_damaged_file_of_results_is_told(result, tmp_path):
    where = result.save(tmp_path / "damaged")
    (where / "run.json").write_text("{")
    assert any("run.json" in said for said in damperfit.load(where).warnings)
    assert damperfit.export(damperfit.load(where), "csv")[0].parent == where / "export"
