"""FMUs of dampers of valves: stepped like the core, on the rigid mounting of a car."""

from __future__ import annotations

import zipfile
from dataclasses import replace
from io import BytesIO

import numpy as np
import pytest

from damperfit.damper.declared_network import DeclaredNetwork, DeclaredPassage
from damperfit.damper.mounting import Mounting
from damperfit.damper.network_model import simulate_network
from damperfit.damper.valve_dampers import Monotube, ThroughFlow, TwinTube
from damperfit.exporting import TARGETS, ExportOptions
from damperfit.exporting.fmu import exported_damper
from damperfit.results import SettingResult
from damperfit.simulation import Motion, SolverOptions
from damperfit.tested.setting import Setting
from tests.exporting.fmi2_client import ERROR, OK, Unit, unzip
from tests.exporting.test_fmu import BAND, rms, road, runs_here, sine
from tests.exporting.test_fmu3 import Unit3

SOFT = {
    "rebound_bleed": 5e4, "rebound_opening": 4.5e5, "rebound_slope": 5e6,
    "compression_bleed": 6e4, "compression_opening": 3e5, "compression_slope": 4e6,
    "f_f": 30.0, "f_0": 7.0, "k_e": 9e8,
}  # fmt: skip
STIFF = SOFT | {"rebound_bleed": 9e4, "rebound_opening": 9e5, "k_e": 1.2e9}
# What a rig has and a car has not: its elasticity, play and lag.
RIG = {"k_s": 4e5, "play": 2e-4, "lag": 6e-3}
RIGID = Mounting("none", "none", "none")
LAYOUTS = (
    TwinTube(mounting=RIGID),
    Monotube(gas_pressure=2e6, mounting=RIGID),
    ThroughFlow(mounting=Mounting(*RIG.values())),
)


def of_valves(handed, damper, numbers=(SOFT, STIFF)):
    told = zip((1, 2), numbers, strict=True)
    settings = tuple(SettingResult(Setting.of(n), damper.values(known)) for n, known in told)
    return replace(handed, damper=damper, settings=settings)


@pytest.fixture(scope="session")
def folders(handed, tmp_path_factory):
    made = {}
    for damper in LAYOUTS:
        for version in (2, 3):
            (content,) = (
                TARGETS[f"fmu{version}"]
                .export(of_valves(handed, damper), ExportOptions())
                .files.values()
            )
            folder = tmp_path_factory.mktemp(f"{damper.name}_{version}")
            made[damper.name, version] = unzip(content, folder)
    return made


def core(damper, known, x, v, interval=1e-4):
    numbers = {one: getattr(damper.values(known), one) for one in damper.names if one not in RIG}
    options = SolverOptions(tolerance=3e-4, dead_band=BAND)
    motion = Motion(interval, x, v)
    return simulate_network(
        damper.network, numbers | {"f_0": 0.0}, damper, motion, options=options
    ).force


@runs_here
@pytest.mark.parametrize("damper", LAYOUTS, ids=lambda one: one.name)
@pytest.mark.parametrize(("motion", "limit"), [(sine, 0.1), (road, 5.0)])
def test_co_simulation_at_1_ms(folders, damper, motion, limit) -> None:
    fine, coarse = motion(1.0, 1e-4), motion(1.0, 1e-3)
    scale = 0.5 if motion is road else 1.0  # rougher than a race car's damper is ever driven
    x, v = (scale * one for one in coarse)
    for setting, known in ((1, SOFT), (2, STIFF)):
        expected = core(damper, known, scale * fine[0], scale * fine[1])[10::10]
        one = Unit(folders[damper.name, 2])
        one.initialise(x[0], v[0], setting=setting)
        assert rms(one.run(x, v) - expected) < limit
        one.close()


@runs_here
@pytest.mark.parametrize("damper", LAYOUTS, ids=lambda one: one.name)
def test_fmi_3_is_the_same_bit_for_bit(folders, damper) -> None:
    x, v = sine(0.3)
    one, other = Unit(folders[damper.name, 2]), Unit3(folders[damper.name, 3])
    one.initialise(x[0], v[0], setting=2)
    other.begin(x[0], v[0], 2)
    assert np.array_equal(one.run(x, v), other.run(x, v))
    one.close()


@runs_here
def test_a_number_is_changed_and_nonsense_is_refused(folders) -> None:
    x, v = sine(0.7)
    damper = LAYOUTS[0]
    one = Unit(folders["twin_tube", 2])
    one.initialise(x[0], v[0], setting=1, rebound_opening=6e5)
    expected = core(damper, SOFT | {"rebound_opening": 6e5}, *sine(0.7, 1e-4))[10::10]
    assert rms(one.run(x, v) - expected) < 0.1
    assert one.set("k_e", -1.0) == ERROR
    assert one.set("setting", 3) == ERROR
    one.set("k_e", 0.0)
    assert one.step(0.7, 1e-3) != OK
    one.set("k_e", 9e8)
    assert one.step(0.7, 1e-3) == OK
    one.close()


def test_what_is_the_rigs_stays_there(handed) -> None:
    damper = exported_damper(of_valves(handed, LAYOUTS[2]))
    names = [one.name for one in damper.numbers]
    assert not {"k_s", "series_stiffness", "play", "lag"} & set(names)
    assert {"rebound_opening", "compression_bleed", "gas_volume", "k_e", "f_f"} <= set(names)
    (line,) = [one for one in damper.text.splitlines() if one.startswith("network")]
    assert len(line.split()) == 11
    with zipfile.ZipFile(
        BytesIO(
            TARGETS["fmu2"]
            .export(of_valves(handed, LAYOUTS[2]), ExportOptions())
            .files["damper.fmu"]
        )
    ) as archive:
        page = archive.read("documentation/index.html").decode()
    assert "with mounting, play, lag, moving mass and tare of the rig" in page


# No preset: a stack that lifts further in rebound, a leak about the piston, a base with a port.
PASSAGES = (
    DeclaredPassage(1, 2, "piston", "orifice", is_two_way=True),
    DeclaredPassage(1, 2, "low", "lifting"),
    DeclaredPassage(2, 1, "intake", "check"),
    DeclaredPassage(1, 2, "ring", "leak", is_two_way=True),
    DeclaredPassage(2, 3, "base", "orifice", is_two_way=True),
    DeclaredPassage(2, 3, "base", "port"),
    DeclaredPassage(3, 2, "foot", "check"),
)
DECLARED = {
    "piston_bleed": 9e4, "low_opening": 4e5, "low_slope": 6e6, "low_lift": 2e-6,
    "intake_slope": 3e5,
    "ring_leak": 3e7, "base_bleed": 6e4, "base_opening": 9e5, "base_slope": 9e6, "base_port": 4e4,
    "foot_slope": 2e5, "f_f": 15.0, "f_0": 4.0, "k_e": 9e8,
}  # fmt: skip
FIRM = DECLARED | {"piston_bleed": 1.5e5, "low_opening": 8e5, "base_bleed": 9e4}


@pytest.fixture(scope="session")
def declared(handed, tmp_path_factory):
    """A network declared passage by passage, with its FMUs unzipped by version."""
    damper = DeclaredNetwork(gas_pressure=5e5, mounting=RIGID, passages=PASSAGES)
    one = of_valves(handed, damper, (DECLARED, FIRM))
    folders = {}
    for version in (2, 3):
        (content,) = TARGETS[f"fmu{version}"].export(one, ExportOptions()).files.values()
        folders[version] = unzip(content, tmp_path_factory.mktemp(f"declared_{version}"))
    return damper, folders


@runs_here
@pytest.mark.parametrize(("motion", "limit"), [(sine, 0.1), (road, 5.0)])
def test_a_declared_network_is_stepped_like_the_core(declared, motion, limit) -> None:
    damper, folders = declared
    fine, coarse = motion(1.0, 1e-4), motion(1.0, 1e-3)
    scale = 0.5 if motion is road else 1.0
    x, v = (scale * one for one in coarse)
    forces = []
    for setting, known in ((1, DECLARED), (2, FIRM)):
        expected = core(damper, known, scale * fine[0], scale * fine[1])[10::10]
        one = Unit(folders[2])
        one.initialise(x[0], v[0], setting=setting)
        forces.append(one.run(x, v))
        assert rms(forces[-1] - expected) < limit
        one.close()
        other = Unit3(folders[3])
        other.begin(x[0], v[0], setting)
        assert np.array_equal(other.run(x, v), forces[-1])
    assert rms(forces[1] - forces[0]) > 50.0


@runs_here
def test_setting_and_numbers_of_a_declared_network_change_in_mid_run(declared) -> None:
    damper, folders = declared
    x, v = sine(1.4)
    own = {"low_opening": 6e5, "piston_bleed": 1.2e5, "base_port": 6e4}
    for change, known in (({"setting": 2}, FIRM), (own, DECLARED | own)):
        one = Unit(folders[2])
        one.initialise(x[0], v[0], setting=1)
        one.run(x[:251], v[:251])
        old = one.get("force")
        for name, value in change.items():
            assert one.set(name, value) == OK
        assert one.get("force") == pytest.approx(old, abs=2.0)  # the pressures stay
        force = one.run(x[250:], v[250:], start=0.25)
        expected = core(damper, known, *sine(1.4, 1e-4))[2510::10]
        assert rms(force[700:] - expected[700:]) < 0.1
        one.close()
