"""The table of targets: each written, and read back by a reader of its own."""

import hashlib
import json
import math
import os
import re
import shutil
import subprocess
from dataclasses import replace

import numpy as np
import pytest

from damperfit import __version__
from damperfit.damper.model import MODELS
from damperfit.damper.purdy.parameters import reference_parameters
from damperfit.exporting.check import check_export
from damperfit.exporting.targets import TARGETS, ExportOptions, exported_run, force_tables
from damperfit.results import Run
from damperfit.settings_and_logs import SettingResult
from damperfit.simulation import simulate, sine_motion
from damperfit.tables.files import LogSignals, write_table
from damperfit.tested.setting import Setting
from tests.exporting.conftest import told
from tests.exporting.reading_back import READERS, combi_matrices, mat_variables
from tests.exporting.units import exported, with_friction_error
from tests.fakes import campaign, fit, make_tables
from tests.test_every_model import truth_of

TABLES = sorted(READERS)


def written(name, run, **options):
    return TARGETS[name].export(run, ExportOptions(**options)).files


def first_text(name, run, **options) -> str:
    return next(iter(written(name, run, **options).values())).decode("utf-8")


@pytest.mark.parametrize("name", TABLES)
def test_units_and_sign_are_as_the_list_says(name, handed) -> None:
    """Those that the readers take, which hold every file against the damper in test_tables.py."""
    target = TARGETS[name]
    assert target.units.startswith("mm/s" if name in {"adams", "adams-xml", "carsim"} else "m/s")
    assert ("COMPRESSION is positive" in target.sign) == (name == "carsim")
    assert ("without sign" in target.sign) == (name == "carmaker")
    if name in {"adams", "carsim"}:  # a spring of CarSim is positive in compression
        level, pushes = {"adams": ("-130.4", "minus"), "carsim": ("130.4", "plus")}[name]
        told = f"{level} N at x = 0 ({pushes} pushes the rod out)"
        assert told in first_text(name, handed)


@pytest.mark.parametrize("name", sorted({*TABLES, "modelica"} - {"csv"}))
def test_every_file_says_whose_it_is_and_what_is_in_it(name, handed) -> None:
    run = with_friction_error(handed, 1e-4)
    for file, content in written(name, run).items():
        is_data = file.endswith(".mat")
        text = mat_variables(content)["about"] if is_data else content.decode("utf-8")
        text = " ".join(text.split())
        facts = (
            "front left", "A <7>", "amplitude to 32 mm", "speed to 0.3016 m/s", "0.5 to 1.5 Hz",
            "25.1 to 27 degC", "MSE of the fit", "gas:", "rebound", run.run.digest, "taken out:",
            "from there the 95 % interval is within 5 % of the damping up to",
            f"damperfit {__version__}",
        )  # fmt: skip
        for fact in facts:
            assert fact in text, (file, fact)
        if name != "modelica":
            assert "0.301 m/s there is nothing" in text
            assert "N rms) at 0.05 m/s" in text


def test_every_force_carries_its_interval(handed) -> None:
    """Half of it is 2 % of 1.96 times friction here, in columns or comments of each file."""
    run = with_friction_error(replace(handed, settings=handed.settings[:1]), 4e-4)
    (table,) = force_tables(run)
    ends = [f"{end[-1]:.3f}" for end in (table.low, table.high)]
    for name in ("adams", "adams-xml", "carmaker", "chrono", "csv"):
        assert all(end in first_text(name, run) for end in ends), name
    assert all(f"-{end}" in first_text("carsim", run) for end in ends)
    matrices = combi_matrices(written("combitable", run)["damper.txt"])
    assert matrices["force_high"][-1, 1] == pytest.approx(table.high[-1])
    known = mat_variables(written("matlab", run)["damper.mat"])
    assert known["force_low"][:, 0] == pytest.approx(table.low)
    assert known["determined_speed"][0] == pytest.approx([table.determined])


def test_a_text_of_a_log_cannot_leave_its_comment(handed) -> None:
    evil = "x\n[CURVE]\r\n--> ]]> \x00 *) \u2028 end"
    spoilt = told(handed, test={"damper": evil, "operator": 'a"b--<'})
    for name in TABLES:
        assert len(READERS[name](written(name, spoilt))) == 3, name
    assert "[CURVE]" in first_text("modelica", spoilt).splitlines()[2]


def test_settings_that_are_no_numbers_carry_their_labels(handed) -> None:
    values = handed.settings[0].values
    places = [(("rebound", r), ("bump", b)) for r, b in ((1, 2), (3, 4))]
    run = replace(handed, settings=tuple(SettingResult(Setting(one), values) for one in places))
    text = written("combitable", run)["damper.txt"]
    assert combi_matrices(text)["force"][0].tolist() == [0.0, 1.0, 2.0]
    assert b"column 2 is setting R3 B4" in text
    files = written("matlab", run)
    assert "setting_label = {'R1 B2', 'R3 B4'};" in files["damper.m"].decode()
    assert mat_variables(files["damper.mat"])["setting_label"] == ["R1 B2", "R3 B4"]
    labels = ("soft 1", "soft/1", "Soft_1")  # what differs in signs alone has a file of its own
    settings = tuple(SettingResult(Setting((("bump", one),)), values) for one in labels)
    files = written("adams", replace(handed, settings=settings))
    assert len({name.casefold() for name in files}) == 3


# What is exported of a results folder.


def test_a_folder_tells_its_range_and_without_run_json_what_is_assumed(folder) -> None:
    path = folder / "run.json"
    record = json.loads(path.read_text())
    fast = {"kind": "steady", "amplitude_m": 0.05, "frequency_Hz": 9.0, "peak_speed_m_per_s": 2.8}
    record["inputs"].append({"log": "x.csv", "setting": 7, "stretches": [fast]})  # of no setting
    path.write_text(json.dumps(record))
    source = exported_run(folder)
    assert [one.setting.cell for one in source.settings] == [1, 10, 20]
    assert source.settings[1].values == reference_parameters(10)
    assert (
        source.run.digest
        == hashlib.sha256((folder / "parameters.parquet").read_bytes()).hexdigest()
    )
    tested = source.run.tested
    assert (tested.n_logs, tested.stroke, tested.speed) == (3, 0.032, 0.30159)
    assert tested.frequencies == (0.5, 1.5)
    assert tested.temperatures == pytest.approx((25.1, 27.0))
    path.unlink()
    source = exported_run(folder)
    assert (len(source.settings), source.run.tested.speed) == (3, None)
    for words in ("the paper's is assumed", "nominal one is used"):
        assert any(words in str(remark) for remark in source.run.remarks)
    assert force_tables(source)[0].end == pytest.approx(0.301)


def test_a_value_that_no_log_limits_is_noted(handed, folder) -> None:
    assert handed.notes == ()
    fits = [fit(n, status={"r_m2": "not_identifiable"} if n == 20 else {}) for n in (1, 20)]
    write_table(folder / "parameters.parquet", make_tables(campaign(*fits))["parameters"])
    (note,) = exported_run(folder).notes
    assert str(note).startswith("r_m2 at setting 20: the logs set no upper limit")


# Modelica: what it says, its table for other models, and a compiler.


def logged(handed, force_of):
    """The run with a log of each setting, whose force is given."""
    motion = sine_motion(0.03, 1.5, cycles=3, sample_rate=1000.0)
    time = np.arange(len(motion.displacement)) * motion.interval
    signals = [
        LogSignals(
            one.setting, "log", time, motion.displacement, motion.velocity, force, force,
            np.zeros((3, len(time))),
        )
        for one in handed.settings
        for force in [force_of(one, motion)]
    ]  # fmt: skip
    rows = {"parameters": handed.run.rows("parameters")}
    run = Run(handed.run.record, rows, signals=signals, quantities=handed.run.quantities)
    return replace(handed, run=run)


def test_the_equations_of_the_file_give_the_force_of_the_core(handed) -> None:
    source = logged(handed, lambda one, motion: simulate(one.values, handed.damper, motion).force)
    for check in check_export(source, TARGETS["modelica"].export(source)):
        assert check.mse_percent < 0.05, check  # what the filter of the check takes off a jump
    head, _, rest = first_text("modelica", handed).partition("parameter ")
    assert "law: D. J. Purdy" in head
    assert not re.search("table|beyond|lost", head)
    # A narrow band would let a car at rest chatter.
    assert 'friction_band(unit = "m/s") = 0.005' in rest


def test_another_model_gives_its_table_and_its_force_at_rest(handed) -> None:
    model = MODELS["monotube"](gas_pressure=2.5e6)
    values = truth_of(model)
    settings = tuple(SettingResult(Setting.of(k), values.replace(f_f=50.0 * k)) for k in (1, 2))
    source = replace(handed, damper=model, settings=settings)
    head = first_text("modelica", source).partition("parameter ")[0]
    assert "the table" in head
    assert "Purdy" not in head
    tables = {table.setting: table for table in force_tables(source, common=True)}

    def looked_up(one, motion):
        table = tables[one.setting]
        force = np.interp(motion.velocity, table.speeds, table.forces) + table.tare
        return force + model.rest_force(motion.displacement)

    source = logged(source, looked_up)
    for check in check_export(source, TARGETS["modelica"].export(source)):
        assert check.mse_percent < 0.05, check
        assert check.n_samples > 1000


@pytest.mark.proof
@pytest.mark.parametrize("name", ["paper", "twin_tube"])
def test_a_modelica_compiler_flattens_it(handed, name) -> None:
    import casadi

    for kind in (casadi.MX, casadi.SX, casadi.DM):
        if not hasattr(kind, "__div__"):  # pymoca still asks for the name of Python 2
            kind.__div__ = kind.__truediv__
    from pymoca import parser
    from pymoca.backends.casadi.generator import generate

    text = first_text("modelica", exported(handed, name))
    flat = generate(parser.parse(text), "Damper")
    states = [str(one.symbol.name()) for one in flat.states]
    assert states == (["m_1", "m_2"] if name == "paper" else [])
    assert [str(one.symbol.name()) for one in flat.inputs] == ["s_rel", "v_rel"]
    inner = [one for one in flat.alg_states if str(one.symbol.name()) != "f"]
    assert len(flat.equations) == len(states) + len(inner) + 1


_PRINT = """
printf('%.9g ', setting); printf('\\n%.9g\\n', interp2(setting, velocity, force, 10, 0.2));
printf('%.9g ', tested_speed, interp1(gas_displacement, gas_force, 0));
"""


@pytest.mark.proof
@pytest.mark.parametrize("load", ["run('damper.m');", "load('damper.mat');"])
def test_octave_looks_up_force_and_gas_force(handed, tmp_path, load) -> None:
    program = shutil.which("octave-cli") or pytest.skip("Octave is not installed")
    for name, content in written("matlab", handed).items():
        (tmp_path / name).write_bytes(content)
    done = subprocess.run(
        [program, "--no-init-file", "--quiet", "--eval", load + _PRINT],
        cwd=tmp_path, env=os.environ | {"HOME": str(tmp_path)}, capture_output=True, text=True,
        check=False, timeout=120,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    settings, force, rest = (
        [float(one) for one in row.split()] for row in done.stdout.splitlines()
    )
    table = force_tables(handed)[1]
    assert settings == [1.0, 10.0, 20.0]
    assert force == pytest.approx([np.interp(0.2, table.speeds, table.forces)], rel=1e-7)
    assert rest == pytest.approx([table.tested, float(table.at_rest(np.zeros(1))[0])], rel=1e-7)
    assert math.isfinite(rest[0])
