"""The table of targets: each written and read back by a reader of its own."""

from __future__ import annotations

import hashlib
import json
import math
from dataclasses import replace

import numpy as np
import pytest

from damperfit import __version__
from damperfit.damper.purdy.parameters import PURDY_DAMPER
from damperfit.damper.purdy.reference import reference_parameters
from damperfit.errors import ConfigurationError
from damperfit.exporting import TARGETS, ExportOptions, exported_run
from damperfit.exporting.tables import force_tables
from damperfit.results import SettingResult
from damperfit.tables.files import write_table
from damperfit.tables.rows import make_tables
from damperfit.tested.setting import Setting
from tests.exporting.conftest import told
from tests.exporting.reading_back import READERS, SIGNS, combi_matrices, mat_variables
from tests.fakes import campaign, fit

TABLES = sorted(READERS)


def written(name, run, **options):
    return TARGETS[name].export(run, ExportOptions(**options)).files


@pytest.mark.parametrize("name", sorted(TARGETS))
def test_every_target_writes_files_of_its_pattern_and_says_what_it_is(name, handed) -> None:
    target = TARGETS[name]
    assert target.name == name
    assert all((target.title, target.units, target.sign, target.place))
    files = written(name, handed, stem="front")
    slugs = [one.setting.slug for one in handed.settings]
    patterns = target.file.split(", ")
    possible = {one.format(stem="front", setting=slug) for slug in slugs for one in patterns}
    beside = {"front_about.txt", "front_parameters.csv"} if name == "csv" else set()
    assert set(files) - beside == possible
    assert all(files.values())


@pytest.mark.parametrize("name", TABLES)
def test_what_is_read_back_is_the_table_of_each_setting(name, handed) -> None:
    curves = READERS[name](written(name, handed))
    tables = force_tables(handed, common="{setting}" not in TARGETS[name].file)
    assert set(curves) == {table.slug for table in tables}
    for table in tables:
        v, f = curves[table.slug]
        assert v == pytest.approx(table.speeds, abs=5e-7)
        assert f == pytest.approx(table.forces, abs=5e-3)


@pytest.mark.parametrize("name", TABLES)
def test_units_and_sign_stand_in_the_raw_file_as_the_list_says(name, handed) -> None:
    factor, towards_v, towards_f = SIGNS[name]
    target = TARGETS[name]
    assert target.units.startswith("mm/s" if factor == 1e-3 else "m/s")
    one = replace(handed, settings=handed.settings[1:2])
    (content, *_) = written(name, one).values()
    text = content.decode("utf-8")
    (table,) = force_tables(one)
    # The stiffer stroke of this damper is rebound.
    v, f = float(table.speeds[-1]), float(table.forces[-1])
    assert f > 1.2 * abs(float(table.forces[0]))
    if name == "carmaker":
        assert f"{v:.7g} {f:.3f}" in text[text.index("SuspF.Damp_Pull:") :]
        assert "without sign" in target.sign
        return
    assert ("COMPRESSION is positive" in target.sign) == (towards_v < 0)
    for mark in "[],;":
        text = text.replace(mark, " ")
    numbers = [float(word) for word in text.split() if _is_number(word)]
    assert any(abs(one - towards_f * f) < 5e-3 for one in numbers)
    assert any(abs(factor * one - towards_v * v) < 5e-7 for one in numbers)
    assert not any(abs(one + towards_f * f) < 5e-3 for one in numbers)


def _is_number(word):
    try:
        return math.isfinite(float(word))
    except ValueError:
        return False


def test_gas_has_the_sign_of_the_forces_of_its_file(handed) -> None:
    """A spring of CarSim is positive in compression, and the gas is added to it."""
    level = force_tables(handed)[0].level
    assert level < 0.0
    for name, expected in (
        ("adams", f"{level:.4g} N at x = 0 (minus pushes the rod out)"),
        ("carsim", f"{-level:.4g} N at x = 0 (plus pushes the rod out)"),
    ):
        assert expected in next(iter(written(name, handed).values())).decode()


@pytest.mark.parametrize("name", sorted({*TABLES, "modelica"} - {"csv"}))
def test_every_file_says_whose_it_is_and_what_is_in_it(name, handed) -> None:
    run = replace(
        handed,
        settings=tuple(
            replace(one, own=("f_f",), shared=(), covariance=np.array([[1e-4]]))
            for one in handed.settings
        ),
    )
    for file, content in written(name, run).items():
        is_data = file.endswith(".mat")
        text = mat_variables(content)["about"] if is_data else content.decode("utf-8")
        text = " ".join(text.split())
        facts = (
            "front left", "A <7>", "stroke to +-32 mm", "speed to 0.3016 m/s", "0.5 to 1.5 Hz",
            "25.1 to 27 degC", "MSE of the fit", "gas:", "rebound", run.run.digest, "taken out:",
            "force determined by the logs (95 % interval within 5 %) to",
            f"damperfit {__version__}",
        )  # fmt: skip
        for fact in facts:
            assert fact in text, (file, fact)
        if name != "modelica":
            assert "0.301 m/s there is nothing" in text
            assert "N rms) at 0.05 m/s" in text


def test_every_force_carries_its_interval(handed) -> None:
    """Half of it is 2 % of 1.96 times friction here, in columns or comments of each file."""
    run = replace(
        handed,
        settings=tuple(
            replace(one, own=("f_f",), shared=(), covariance=np.array([[4e-4]]))
            for one in handed.settings[:1]
        ),
    )
    (table,) = force_tables(run)
    ends = [f"{end[-1]:.3f}" for end in (table.low, table.high)]
    for name in ("adams", "adams-xml", "carmaker", "chrono", "csv"):
        text = written(name, run).popitem() if name != "csv" else written(name, run).items()
        content = dict([text])[text[0]] if name != "csv" else dict(text)["damper.csv"]
        assert all(end in content.decode() for end in ends), name
    text = next(iter(written("carsim", run).values())).decode()
    assert all(f"-{end}" in text for end in ends)
    assert combi_matrices(written("combitable", run)["damper.txt"])["force_high"][-1, 1] == (
        pytest.approx(table.high[-1])
    )
    known = mat_variables(written("matlab", run)["damper.mat"])
    assert known["force_low"][:, 0] == pytest.approx(table.low)
    assert known["determined_speed"][0] == pytest.approx([table.determined])


def test_a_text_of_a_log_cannot_leave_its_comment(handed) -> None:
    evil = "x\n[CURVE]\r\n--> ]]> \x00 *) \u2028 end"
    spoilt = told(handed, test={"damper": evil, "operator": 'a"b--<'})
    for name in TABLES:
        assert len(READERS[name](written(name, spoilt))) == 3, name
    assert "[CURVE]" in written("modelica", spoilt)["damper.mo"].decode().splitlines()[2]


def test_settings_that_are_no_numbers_carry_their_labels(handed) -> None:
    values = handed.settings[0].values
    places = [(("rebound", r), ("bump", b)) for r, b in ((1, 2), (3, 4))]
    settings = tuple(SettingResult(Setting(place), values) for place in places)
    run = replace(handed, settings=settings)
    matrices = combi_matrices(written("combitable", run)["damper.txt"])
    assert matrices["force"][0].tolist() == [0.0, 1.0, 2.0]
    files = written("matlab", run)
    assert "setting_label = {'R1 B2', 'R3 B4'};" in files["damper.m"].decode()
    assert mat_variables(files["damper.mat"])["setting_label"] == ["R1 B2", "R3 B4"]
    assert b"column 2 is setting R3 B4" in written("combitable", run)["damper.txt"]
    page = TARGETS["fmu2"].export(run).files["damper.fmu"]
    assert page.startswith(b"PK")


def test_values_of_a_template_that_are_not_this_damper_s_are_left_out(handed) -> None:
    text = next(iter(written("adams-xml", handed).values())).decode()
    assert 'upperDiameter="' not in text
    assert "upperDiameter, upperLength" in text


# What is exported of a results folder.


def test_damper_values_motion_and_range_come_back(handed, results) -> None:
    assert handed.damper == PURDY_DAMPER
    assert [one.setting.cell for one in handed.settings] == [1, 10, 20]
    assert handed.settings[1].values == reference_parameters(10)
    assert handed.settings[1].mse_percent == 0.0123
    assert handed.settings[1].top_speed == 0.30159
    assert (handed.run.motion.amplitude, handed.run.motion.frequency) == (0.032, 1.5)
    assert handed.run.identity["damper"] == "front left"
    table = (results / "parameters.parquet").read_bytes()
    assert handed.run.digest == hashlib.sha256(table).hexdigest()
    tested = handed.run.tested
    assert (tested.n_logs, tested.stroke, tested.speed) == (3, 0.032, 0.30159)
    assert tested.frequencies == (0.5, 1.5)
    assert tested.temperatures == pytest.approx((25.1, 27.0))


def test_a_log_of_another_setting_adds_nothing_to_the_range(folder) -> None:
    record = json.loads((folder / "run.json").read_text())
    fast = {"kind": "steady", "amplitude_m": 0.05, "frequency_Hz": 9.0, "peak_speed_m_per_s": 2.8}
    record["inputs"].append({"log": "x.csv", "setting": 7, "stretches": [fast]})
    (folder / "run.json").write_text(json.dumps(record))
    assert exported_run(folder).run.tested.speed == 0.30159


def test_a_folder_without_run_json_is_exported_with_remarks(folder) -> None:
    (folder / "run.json").unlink()
    run = exported_run(folder)
    assert len(run.settings) == 3
    assert run.run.tested.speed is None
    assert any("the paper's is assumed" in remark for remark in run.run.remarks)
    assert any("nominal one is used" in remark for remark in run.run.remarks)
    assert force_tables(run)[0].end == pytest.approx(0.301)


def test_a_value_that_no_log_limits_is_noted(handed, folder) -> None:
    assert handed.notes == ()
    fits = [fit(n, status={"r_m2": "not_identifiable"} if n == 20 else {}) for n in (1, 20)]
    write_table(folder / "parameters.parquet", make_tables(campaign(*fits))["parameters"])
    (note,) = exported_run(folder).notes
    assert note.startswith("r_m2 at setting 20: the logs set no upper limit")


def test_no_folder_is_refused(tmp_path) -> None:
    with pytest.raises(ConfigurationError, match="no such folder"):
        exported_run(tmp_path / "nothing")
