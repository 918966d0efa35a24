"""Each table target written and read back by a reader of its own: curve, sign, units, account."""

from __future__ import annotations

import math
import time
from dataclasses import replace
from types import MappingProxyType

import numpy as np
import pytest

from damperfit.damper.models import MODELS
from damperfit.errors import ConfigurationError
from damperfit.handover import TARGETS, ExportOptions, HandedSetting
from damperfit.handover.force_table import force_tables
from damperfit.handover.road import road_errors, standard_road, what_is_lost
from damperfit.simulation import SolverOptions
from damperfit.tested.setting import Setting
from tests.handover.reading_back import READERS, combi_matrices, mat_variables
from tests.test_every_model import damper, truth_of

TABLES = sorted(READERS)
# Velocity unit in m/s; sign of velocity and of force in the file where the rod moves out.
# CarMaker has no sign: Pull is the side of rebound.
SIGNS = {
    "adams": (1e-3, 1, 1),
    "adams-xml": (1e-3, 1, 1),
    "carmaker": (1.0, 0, 0),
    "carsim": (1e-3, -1, -1),
    "chrono": (1.0, 1, 1),
    "combitable": (1.0, 1, 1),
    "csv": (1.0, 1, 1),
    "matlab": (1.0, 1, 1),
}
FAST = SolverOptions(tolerance=0.03)


def written(name, handed, **options):
    return TARGETS[name].write(handed, ExportOptions(**options))


def test_gas_has_the_sign_of_the_forces_of_its_file(handed) -> None:
    """A spring of CarSim is positive in compression, and the gas is added to it."""
    level = force_tables(handed)[0].level
    assert level < 0.0
    for name, said in (
        ("adams", f"{level:.4g} N at x = 0 (minus pushes the rod out)"),
        ("carsim", f"{-level:.4g} N at x = 0 (plus pushes the rod out)"),
    ):
        text = next(iter(written(name, handed).values())).decode()
        assert said in text


def test_every_table_target_has_a_reader_and_a_row_of_signs() -> None:
    tables = {name for name, one in TARGETS.items() if one.has_table and not one.physics_of}
    assert tables - {"xlsx"} == set(READERS) == set(SIGNS)  # xlsx: test_spreadsheets.py


@pytest.mark.parametrize("name", TABLES)
def test_what_is_read_back_is_the_table_of_each_setting(name, handed) -> None:
    curves = READERS[name](written(name, handed))
    tables = force_tables(handed)
    assert set(curves) == {table.slug for table in tables}
    for table in tables:
        v, f = curves[table.slug]
        assert v == pytest.approx(table.speeds, abs=5e-7)
        assert f == pytest.approx(table.forces, abs=5e-3)
        assert 0.0 in v.tolist()
        assert f[v.tolist().index(0.0)] == 0.0


@pytest.mark.parametrize("name", TABLES)
def test_units_and_sign_stand_in_the_raw_file_as_the_list_says(name, handed) -> None:
    factor, towards_v, towards_f = SIGNS[name]
    target = TARGETS[name]
    assert target.units.startswith("mm/s" if factor == 1e-3 else "m/s")
    (content, *_) = written(name, replace(handed, settings=handed.settings[1:2])).values()
    text = content.decode("utf-8")
    table = force_tables(handed)[1]
    # The stiffer stroke of this damper is rebound.
    v, f = float(table.speeds[-1]), float(table.forces[-1])
    assert f > 1.2 * abs(float(table.forces[0]))
    if name == "carmaker":
        pull = text.index("SuspF.Damp_Pull:")
        assert f"{v:.7g} {f:.3f}" in text[pull:]
        assert "no sign" in target.sign or "without sign" in target.sign
        return
    assert ("COMPRESSION is positive" in target.sign) == (towards_v < 0)
    numbers = [float(word) for word in _words(text) if _is_number(word)]
    assert any(abs(one - towards_f * f) < 5e-3 for one in numbers)
    assert any(abs(factor * one - towards_v * v) < 5e-7 for one in numbers)
    assert not any(abs(one + towards_f * f) < 5e-3 for one in numbers)


def _words(text):
    for mark in "[],;":
        text = text.replace(mark, " ")
    return text.split()


def _is_number(word):
    try:
        return math.isfinite(float(word))
    except ValueError:
        return False


@pytest.mark.parametrize("name", sorted({*TABLES, "modelica"} - {"csv"}))
def test_every_file_says_whose_it_is_and_what_is_in_it(name, handed) -> None:
    for file, content in written(name, handed).items():
        is_data = file.endswith(".mat")
        told = mat_variables(content)["about"] if is_data else content.decode("utf-8")
        text = " ".join(told.split())
        for said in (
            "front left",
            "A <7>",
            "stroke to +-32 mm",
            "speed to 0.3016 m/s",
            "0.5 to 1.5 Hz",
            "25.1 to 27 degC",
            "MSE of the fit",
            "gas:",
            "rebound",
            handed.digest,
            f"damperfit {handed.version}",
        ):
            assert said in text, (file, said)
        if name != "modelica":
            assert "0.3016 m/s there is nothing" in text
            assert "N rms" in text


def test_a_text_of_a_log_cannot_leave_its_comment(handed) -> None:
    evil = "x\n[CURVE]\r\n--> ]]> \x00 *) \u2028 end"
    spoilt = replace(handed, identity=MappingProxyType({"damper": evil, "operator": 'a"b--<'}))
    for name in TABLES:
        curves = READERS[name](written(name, spoilt))
        assert len(curves) == 3, name
    assert "[CURVE]" in written("modelica", spoilt)["damper.mo"].decode().splitlines()[2]


def test_nothing_beyond_the_tested_speed_unless_asked_and_then_marked(handed) -> None:
    plain, more = force_tables(handed)[1], force_tables(handed, extend=0.45)[1]
    top = handed.motion.peak_speed
    assert plain.speeds[-1] == pytest.approx(top)
    assert not plain.is_extended
    assert more.is_extended
    assert more.speeds[-1] == 0.45
    inside = np.abs(more.speeds) <= top * (1 + 1e-9)
    assert np.array_equal(more.forces[inside], plain.forces)
    # No step where the untested part begins: the slope goes on.
    slopes = np.diff(more.forces) / np.diff(more.speeds)
    at = int(np.flatnonzero(inside)[-1])
    assert slopes[at] == pytest.approx(slopes[at - 1], rel=0.05)
    for name in TABLES:
        files = written(name, handed, extend=0.45)
        text = b"".join(files.values()).replace(b"\x00", b"").decode("utf-8", "replace")
        assert name == "csv" or "UNTESTED" in text, name


@pytest.mark.parametrize(("speed", "is_refused"), [(0.3015, True), (0.302, False), (1.6, True)])
def test_limits_of_extending(handed, speed, is_refused) -> None:
    one = replace(handed, settings=handed.settings[:1], solver=FAST)
    if not is_refused:
        assert force_tables(one, extend=speed)[0].speeds[-1] == speed
        return
    with pytest.raises(ConfigurationError, match=r"--extend .* above the tested 0.3016 m/s"):
        force_tables(one, extend=speed)


def test_the_gas_is_handed_over_beside_the_table_with_its_sign(handed) -> None:
    level = -handed.damper.rod_area * handed.damper.gas_pressure
    table = force_tables(handed)[0]
    assert table.level == pytest.approx(level)
    assert table.at_rest(np.array([-0.032]))[0] < level < table.at_rest(np.array([0.032]))[0]
    xml = written("adams-xml", handed)["damper_s01.xml"].decode("iso-8859-1")
    assert f'gasPreloadMethod="constant" gasPreloadConstant="{-level:.3f}"' in xml
    gas = combi_matrices(written("combitable", handed)["damper.txt"])["gas"]
    assert np.interp(0.0, gas[:, 0], gas[:, 1]) == pytest.approx(level, rel=1e-6)
    known = mat_variables(written("matlab", handed)["damper.mat"])
    assert known["gas_force"][0, 0] == pytest.approx(float(table.gas_forces[0]))


def test_a_tare_of_the_rig_is_not_in_the_table(handed) -> None:
    bare, tared = (
        replace(
            handed,
            settings=tuple(replace(s, values=s.values.replace(f_0=f)) for s in handed.settings[:1]),
        )
        for f in (0.0, 250.0)
    )
    assert np.array_equal(force_tables(bare)[0].forces, force_tables(tared)[0].forces)


@pytest.mark.parametrize("model", sorted(MODELS))
def test_every_model_and_any_label_is_handed_over(model, handed) -> None:
    made = damper(model)
    values = truth_of(made)
    labels = (
        Setting((("rebound", 3), ("bump", "soft/1"))),
        Setting((("rebound", 4), ("bump", "a b"))),
    )
    settings = tuple(HandedSetting(label, values) for label in labels)
    mine = replace(handed, damper=made, settings=settings, solver=FAST)
    tables = force_tables(mine)
    assert len({table.slug for table in tables}) == 2
    for table in tables:
        assert np.isfinite(table.forces).all()
        assert table.forces[-1] > 0.0 > table.forces[0]
        assert table.forces[30] == 0.0
    for name in sorted(set(TARGETS) - {"fmu2", "fmu3"}):
        if TARGETS[name].has_table:
            files = written(name, mine)
            assert all(files.values())


def test_labels_that_differ_in_signs_alone_have_files_of_their_own(handed) -> None:
    values = handed.settings[0].values
    labels = ("soft 1", "soft/1", "Soft_1")
    settings = tuple(HandedSetting(Setting((("bump", one),)), values) for one in labels)
    files = written("adams", replace(handed, settings=settings, solver=FAST))
    assert len({name.casefold() for name in files}) == 3


def test_the_road_is_the_standard_one_and_velocity_is_its_derivative() -> None:
    road = standard_road()
    x, v = road.displacement, road.velocity
    # It repeats after 8 s, so its derivative is exact by its spectrum.
    n = len(x)
    lines = np.fft.rfft(x) * 2j * np.pi * np.fft.rfftfreq(n, road.interval)
    assert np.fft.irfft(lines, n) == pytest.approx(v, abs=1e-9)
    assert 0.1 < float(np.std(v)) < 0.16
    assert 0.3 < float(np.abs(v).max()) < 0.4


def test_what_a_table_loses_is_told_and_grows_with_the_stiffness(handed) -> None:
    tables = force_tables(handed)
    errors = road_errors(handed, tables)
    shares = [one.percent for one in errors]
    assert shares == sorted(shares)
    assert 0.3 < shares[0] < 1.5
    assert 5.0 < shares[-1] < 30.0
    assert errors[0].speed < tables[0].tested_speed
    assert errors[0].scale < 1.0
    said = what_is_lost(handed)
    assert f"{errors[-1].rms:.3g} N rms" in said
    assert errors[-1].peak > 999.5
    assert f" {errors[-1].peak:.0f} N at most" in said  # it was 2e+03
    assert f"at setting 20, {shares[0]:.2g} % at the best" in said  # in N the best may lose more
    assert f"scaled to {100.0 * errors[-1].scale:.0f} %, the tested range (up to 0.3 m/s), " in said


def test_a_damper_without_storage_loses_hardly_anything(handed) -> None:
    linear = MODELS["linear"]()
    values = truth_of(linear)
    one = replace(handed, damper=linear, settings=(HandedSetting(Setting.of(1), values),))
    (error,) = road_errors(one, force_tables(one))
    assert error.percent < 1e-6


def test_all_targets_of_twenty_settings_take_a_second(handed) -> None:
    settings = tuple(
        HandedSetting(Setting.of(k), handed.settings[k % 3].values.replace(f_f=40.0 + k))
        for k in range(1, 21)
    )
    mine = replace(handed, settings=settings)
    begin = time.process_time()
    for name, target in TARGETS.items():
        if not name.startswith("fmu"):
            target.write(mine, ExportOptions())
    assert time.process_time() - begin < 1.0


def test_a_table_of_carmaker_begins_at_zero_without_a_sign(handed) -> None:
    for content in TARGETS["carmaker"].write(handed, ExportOptions()).values():
        lines = content.decode().splitlines()
        firsts = [lines[i + 1] for i, line in enumerate(lines) if line.endswith(("Push:", "Pull:"))]
        assert firsts == ["\t0 0.000", "\t0 0.000"]
