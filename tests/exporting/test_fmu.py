"""The FMU of FMI 2.0, run by a small importer of our own against the core that fits."""

from __future__ import annotations

import ctypes as ct
import io
import re
import sys
import time
import zipfile
from dataclasses import replace
from io import BytesIO
from xml.etree import ElementTree as ET
from zipfile import ZipFile

import numpy as np
import pytest

from damperfit.damper.purdy.reference import reference_parameters
from damperfit.damper.rivals.linear import Linear
from damperfit.errors import ConfigurationError
from damperfit.exporting import TARGETS, ExportOptions
from damperfit.exporting import fmu as libraries
from damperfit.exporting.fmu import _data, exported_damper, missing_platforms, source_files
from damperfit.exporting.fmu_description import variables
from damperfit.results import SettingResult
from damperfit.simulation import Motion, SolverOptions, simulate
from damperfit.tested.setting import Setting
from tests.exporting.fmi2_client import ERROR, OK, Unit, unzip

BAND = 0.005
NUMBERS = ("r_m1", "r_m2", "r_m3", "k_e", "f_f", "f_0", "gas_pressure", "gas_exponent")

runs_here = pytest.mark.skipif(
    sys.platform != "linux", reason="the little importer loads the library of Linux"
)


def sine(duration=2.0, interval=1e-3, amplitude=0.032):
    t = np.arange(round(duration / interval) + 1) * interval
    w = 2.0 * np.pi * 1.5
    return amplitude * np.sin(w * t), amplitude * w * np.cos(w * t)


def road(duration=2.0, interval=1e-3):
    """Content from 0.5 to 25 Hz, 0.3 m/s rms."""
    t = np.arange(round(duration / interval) + 1) * interval
    noise = np.random.default_rng(3)
    f = np.linspace(0.5, 25.0, 80)[:, None]
    phase = noise.uniform(0.0, 2.0 * np.pi, f.shape)
    v = (np.cos(2.0 * np.pi * f * t + phase) / f).sum(axis=0)
    x = (np.sin(2.0 * np.pi * f * t + phase) / (2.0 * np.pi * f**2)).sum(axis=0)
    scale = 0.3 / np.sqrt((0.5 / f**2).sum())
    return scale * x, scale * v


def core(handed, setting, x, v, interval=1e-4, band=BAND, **changed):
    values = reference_parameters(setting).replace(changed)
    options = SolverOptions(tolerance=3e-4, dead_band=band)
    return simulate(values, handed.damper, Motion(interval, x, v), options=options).force


def rms(error) -> float:
    return float(np.sqrt(np.mean(error[len(error) // 10 :] ** 2)))


def test_what_stands_in_the_file(content, handed) -> None:
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        names = set(archive.namelist())
        files = [one.filename for one in archive.infolist() if not one.filename.startswith("bin")]
        bare = io.BytesIO()
        with zipfile.ZipFile(bare, "w", zipfile.ZIP_DEFLATED) as smaller:
            for name in files:
                smaller.writestr(name, archive.read(name))
        root = ET.fromstring(archive.read("modelDescription.xml"))  # noqa: S314
        page = archive.read("documentation/index.html").decode()
        licence = archive.read("documentation/licenses/LICENSE.txt").decode()
    assert len(bare.getvalue()) < 60_000
    assert {"resources/damper.txt", "sources/fmi2.c", "sources/network.c"} <= names
    sources = {one.get("name") for one in root.iter("File")}
    assert {f"sources/{name}" for name in sources} <= names
    assert sources == {name[8:] for name in names if name.endswith(".c")}
    assert licence.startswith("MIT License")
    # Who made it and where it holds, and nothing of it as markup.
    assert "A &lt;7&gt; &amp;" in page
    assert handed.run.digest in page
    assert "stroke to +-32 mm" in page
    assert root.get("modelName") == 'front left A <7> & "8"'


@pytest.mark.parametrize("version", [2, 3])
def test_twenty_settings_are_below_60_kb_and_their_sources_are_those_of_the_core(
    handed, version
) -> None:
    settings = tuple(SettingResult(Setting.of(n), reference_parameters(n)) for n in range(1, 21))
    many = replace(handed, settings=settings)
    (content,) = TARGETS[f"fmu{version}"].export(many, ExportOptions()).files.values()
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        kept = [one for one in archive.infolist() if not one.filename.startswith("binaries")]
        bare = io.BytesIO()
        with zipfile.ZipFile(bare, "w", zipfile.ZIP_DEFLATED, compresslevel=9) as smaller:
            for one in kept:
                smaller.writestr(one.filename, archive.read(one))
        core = {name: code.decode() for name, code in source_files().items() if name != "data.c"}
        told = {name: archive.read(f"sources/{name}").decode() for name in core}
    assert len(bare.getvalue()) < 60_000
    for name, whole in core.items():
        # Comments aside it is the same, and what a file is for is still said.
        assert re.sub(r"\s|/\*.*?\*/", "", told[name], flags=re.DOTALL) == re.sub(
            r"\s|/\*.*?\*/", "", whole, flags=re.DOTALL
        )
        if whole.startswith("/*"):
            assert told[name].startswith(whole.partition("*/")[0])


def test_exporting_takes_milliseconds_and_no_compiler(handed, monkeypatch) -> None:
    monkeypatch.setenv("PATH", "")
    best = 9.0
    for _ in range(3):
        start = time.process_time()
        assert TARGETS["fmu2"].export(handed).files
        best = min(best, time.process_time() - start)
    assert best < 0.25


def test_only_missing_libraries_are_told_with_their_command(monkeypatch) -> None:
    monkeypatch.setattr("damperfit.exporting.fmu.built", lambda: dict.fromkeys(libraries.PLATFORMS))
    assert missing_platforms(2) == ()
    some = {one: b"" for one in libraries.PLATFORMS if one.name != "x86_64-windows"}
    monkeypatch.setattr("damperfit.exporting.fmu.built", lambda: some)
    (said,) = missing_platforms(2)
    assert "for x86_64-windows, only" in said
    assert "python -m damperfit.exporting.fmu_build" in said
    assert len(missing_platforms(3)) == 1


def test_a_library_of_other_sources_is_none(tmp_path, monkeypatch) -> None:
    folder = tmp_path / "x86_64-linux"
    folder.mkdir()
    (folder / "damperfit.so").write_bytes(b"library")
    monkeypatch.setattr(libraries, "BINARIES", tmp_path)
    assert libraries.built() == {}
    (folder / libraries.DIGEST).write_text("0" * 64)
    assert libraries.built() == {}
    (folder / libraries.DIGEST).write_text(libraries.sources_digest())
    assert [one.fmi2 for one in libraries.built()] == ["linux64"]


def test_another_model_is_refused_in_a_sentence_that_names_the_tables(handed) -> None:
    linear = Linear()
    one = replace(handed.settings[0], parameters=linear.values({"c": 1e3, "f_0": 0.0}))
    with pytest.raises(ConfigurationError, match=r"linear cannot be an FMU.*--list"):
        TARGETS["fmu2"].export(replace(handed, damper=linear, settings=(one,)))


def test_settings_that_are_no_whole_numbers_are_counted(handed) -> None:
    words = [
        replace(one, setting=Setting.of(w))
        for one, w in zip(handed.settings, ("soft", 1.5, "C8"), strict=True)
    ]
    damper = exported_damper(replace(handed, settings=tuple(words)))
    assert damper.settings == {1: "soft", 2: "1.5", 3: "C8"}
    assert (
        "one of 1: soft, 2: 1.5, 3: C8"
        in {v.name: v for v in variables(damper)}["setting"].description
    )
    assert damper.start == 2
    negative = [
        replace(one, setting=Setting.of(n))
        for one, n in zip(handed.settings, (-3, 0, 2), strict=True)
    ]
    assert list(exported_damper(replace(handed, settings=tuple(negative))).settings) == [-3, 0, 2]


def test_the_tare_of_the_rig_is_left_out_and_that_is_said(handed) -> None:
    (first, *others) = handed.settings
    tared = replace(first, parameters=first.values.replace(f_0=-12.5))
    damper = replace(handed, settings=(tared, *others))
    page = ZipFile(BytesIO(TARGETS["fmu2"].export(damper).files["damper.fmu"])).read(
        "documentation/index.html"
    )
    assert "Taken out: no mounting (rigid), tare of the rig -12.5 to 0 N" in page.decode()


@runs_here
@pytest.mark.parametrize("setting", [1, 10, 20])
@pytest.mark.parametrize(("motion", "limit"), [(sine, 0.1), (road, 5.0)])
def test_co_simulation_at_1_ms(unit, handed, setting, motion, limit) -> None:
    x, v = motion()
    expected = core(handed, setting, *motion(interval=1e-4))[10::10]
    one = unit()
    one.initialise(x[0], v[0], setting=setting)
    assert rms(one.run(x, v) - expected) < limit
    last = unit()
    last.initialise(x[0], v[0], setting=setting, input_extrapolation=0)
    assert rms(last.run(x, v, is_of_end=True) - expected) < 0.1


@runs_here
def test_the_air_on_the_rod_goes_along(handed, unit, tmp_path) -> None:
    one = replace(handed, damper=replace(handed.damper, ambient_pressure=101325.0))
    content = TARGETS["fmu2"].export(one, ExportOptions()).files["damper.fmu"]
    with_air = Unit(unzip(content, tmp_path / "unit"))
    forces = []
    for each in (with_air, unit()):
        each.initialise(0.01, 0.1, setting=10)
        forces.append(each.get("force"))
    with_air.close()
    assert forces[0] - forces[1] == pytest.approx(handed.damper.rod_area * 101325.0, rel=1e-9)


@runs_here
def test_outputs_at_the_beginning_are_those_of_rest(unit, handed) -> None:
    one = unit()
    one.initialise(0.01, 0.1, setting=10)
    assert one.get("force") == pytest.approx(core(handed, 10, np.array([0.01]), np.array([0.1]))[0])
    pressures = [one.get(f"pressure_{i}") for i in (1, 2, 3)]
    assert max(pressures) - min(pressures) < 1.0
    assert one.get("seconds_outside_tested_range") == 0.0


@runs_here
def test_a_number_follows_the_setting_unless_it_was_changed(unit, handed) -> None:
    echoed = unit()
    start = {name: echoed.get(name) for name in NUMBERS}
    echoed.initialise(0.0, 0.3, setting=20, **start)  # as importers do that set everything
    assert echoed.get("k_e") == reference_parameters(20).k_e
    changed = unit()
    changed.initialise(0.0, 0.3, r_m1=3e4, setting=1)
    assert changed.get("r_m1") == 3e4
    assert changed.get("k_e") == reference_parameters(1).k_e
    x, v = sine(1.0)
    other = unit()
    other.initialise(x[0], v[0], setting=1, r_m1=3e4)
    expected = core(handed, 1, *sine(1.0, interval=1e-4), r_m1=3e4)[10::10]
    assert rms(other.run(x, v) - expected) < 0.1


@runs_here
def test_what_cannot_be_set_is_refused(unit) -> None:
    one = unit()
    one.initialise()
    assert one.set("setting", 7) == ERROR
    assert "was not identified" in one.said[-1]
    for name, value in (
        ("k_e", 0.0), ("r_m1", -1.0), ("friction_band", 0.0), ("displacement", np.nan),
        ("velocity", np.inf), ("input_extrapolation", 3), ("force", 1.0),
    ):  # fmt: skip
        assert one.set(name, value) == ERROR, name
    assert one.set("f_f", 0.0) == OK
    assert one.set("f_0", -5.0) == OK


@runs_here
def test_another_files_token_is_refused(unit) -> None:
    one = unit(token="{1234}")  # noqa: S106
    assert one.component is None
    assert "token" in one.said[-1]


@runs_here
def test_a_step_that_cannot_be_is_discarded_and_may_be_tried_again(unit, handed) -> None:
    x, v = sine()
    one = unit()
    one.initialise(x[0], v[0], setting=10)
    one.run(x[:101], v[:101])
    before = one.get("force")
    one.set("displacement", 0.5)
    assert one.step(0.1, 1e-3) == 2  # fmi2Discard
    assert "no volume" in one.said[-1]
    reached = ct.c_double()
    assert one.call("GetRealStatus", 2, ct.byref(reached)) == OK
    assert reached.value == pytest.approx(0.1)
    assert one.get("force") == before
    expected = core(handed, 10, *sine(interval=1e-4))[1010::10]
    assert rms(one.run(x[100:], v[100:], start=0.1) - expected) < 0.1


@runs_here
def test_instances_do_not_disturb_each_other(unit) -> None:
    x, v = sine(0.2)
    both = unit(), unit()
    mixed = np.empty((2, len(x) - 1))
    for one, setting in zip(both, (1, 20), strict=True):
        one.initialise(x[0], v[0], setting=setting)
    for i in range(len(x) - 1):
        for k, one in enumerate(both):
            one.set("displacement", x[i])
            one.set("velocity", v[i])
            assert one.step(i * 1e-3, 1e-3) == OK
            mixed[k, i] = one.get("force")
    for row, setting in zip(mixed, (1, 20), strict=True):
        alone = unit()
        alone.initialise(x[0], v[0], setting=setting)
        assert np.array_equal(alone.run(x, v), row)


@runs_here
def test_time_outside_of_the_tested_range_is_counted(unit) -> None:
    def seconds(amplitude: float) -> float:
        x, v = sine(2.0 / 3.0, amplitude=amplitude)
        one = unit()
        one.initialise(x[0], v[0], setting=10)
        one.run(x, v)
        return one.get("seconds_outside_tested_range")

    assert seconds(0.032 * 1.009) == 0.0
    # Beyond |x| or |v| of the test by 1 % around each of the eight extremes of a cycle.
    share = 8.0 * np.arccos(1.01 * 0.032 / 0.036) / (2.0 * np.pi)
    assert seconds(0.036) == pytest.approx(share * 2.0 / 3.0, abs=0.006)


@runs_here
def test_slopes_in_co_simulation_are_those_of_the_run(unit, handed) -> None:
    x, v = sine(0.401)
    one = unit()
    one.initialise(x[0], v[0], setting=10, input_extrapolation=0)
    one.run(x, v, is_of_end=True)
    values = reference_parameters(10)
    names = ("r_m1", "r_m2", "r_m3", "k_e", "f_f", "gas_pressure", "gas_exponent")
    options = SolverOptions(dead_band=BAND)
    response = simulate(
        values, handed.damper, Motion(1e-3, x, v), sensitivities=names, options=options
    )
    for name in names:
        row = response.sensitivities[name]
        error = abs(one.slope("force", name) - row[-1])
        assert error < 2e-5 * np.abs(row).max(), name
    assert one.slope("force", "f_0") == 1.0
    assert one.slope("force", "velocity") == 0.0  # it slides
    assert one.slope("seconds_outside_tested_range", "displacement") == 0.0


@runs_here
def test_in_model_exchange_held_inputs_go_on_by_the_velocity(unit) -> None:
    one = unit(is_exchange=True)
    one.initialise(0.01, 0.2, setting=10)
    states = one.numbers("GetContinuousStates", 3)
    one.at(0.0, 0.01, 0.2, states)
    one.get("force")
    one.call("SetTime", ct.c_double(1e-3))
    held = one.get("pressure_3")
    one.at(1e-3, 0.0102, 0.2, states)
    assert one.get("pressure_3") == pytest.approx(held, rel=1e-12)
    one.set("input_extrapolation", 0)
    one.at(1e-3, 0.01, 0.2, states)
    one.call("SetTime", ct.c_double(2e-3))
    assert one.get("pressure_3") != pytest.approx(held, rel=1e-5)


@pytest.mark.parametrize("length", [1, 399, 400, 401, 800, 801])
def test_each_line_of_the_data_ends_in_c_as_it_does_in_the_text(length) -> None:
    """Long lines are several strings in C: the last of them alone ends the line."""
    text = f"{'x' * length}\nnext\n"
    code = _data(text).decode()
    strings = re.findall(r'"(x*(?:next)?(?:\\n)?)"', code)
    assert "".join(strings).replace("\\n", "\n") == text
    assert max(map(len, strings)) <= 402
