"""The FMU of FMI 3.0 is the same damper behind another door."""

from __future__ import annotations

import ctypes as ct
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np
import pytest

from damperfit.exporting import TARGETS, ExportOptions
from tests.exporting.fmi2_client import unzip
from tests.exporting.test_fmu import runs_here, sine

SOURCES = Path(__file__).parents[2] / "damperfit" / "exporting" / "c"


@pytest.fixture(scope="session")
def folder(handed, tmp_path_factory) -> Path:
    (content,) = TARGETS["fmu3"].export(handed, ExportOptions()).files.values()
    return unzip(content, tmp_path_factory.mktemp("fmu3"))


def root_of(folder):
    return ET.parse(folder / "modelDescription.xml").getroot()  # noqa: S314


class Unit3:
    """An instance for co-simulation or model exchange."""

    def __init__(self, folder, *, is_exchange=False):
        self.library = ct.CDLL(str(folder / "binaries" / "x86_64-linux" / "damperfit.so"))
        kind = "ModelExchange" if is_exchange else "CoSimulation"
        make = getattr(self.library, f"fmi3Instantiate{kind}")
        make.restype = ct.c_void_p
        root = root_of(folder)
        told = [b"a", root.get("instantiationToken").encode(), f"{folder}/resources/".encode()]
        flags = [ct.c_bool(False)] * (2 if is_exchange else 4)
        rest = [None, None] if is_exchange else [None, ct.c_size_t(0), None, None, None]
        self.it = ct.c_void_p(make(*told, *flags, *rest))
        assert self.it.value
        listed = root.find("ModelVariables")
        self.references = {one.get("name"): int(one.get("valueReference")) for one in listed}

    def call(self, name, *arguments):
        return getattr(self.library, f"fmi3{name}")(self.it, *arguments)

    def number(self, name, verb="Get", value=0.0):
        reference, held = (ct.c_uint32 * 1)(self.references[name]), (ct.c_double * 1)(value)
        one = ct.c_size_t(1)
        assert self.call(f"{verb}Float64", reference, one, held, one) == 0
        return held[0]

    def setting(self, value):
        one, reference = ct.c_size_t(1), (ct.c_uint32 * 1)(self.references["setting"])
        return self.call("SetInt32", reference, one, (ct.c_int32 * 1)(value), one)

    def begin(self, x, v, setting):
        assert self.setting(setting) == 0
        zero = ct.c_double(0.0)
        no = ct.c_bool(False)
        assert self.call("EnterInitializationMode", no, zero, zero, no, zero) == 0
        self.number("displacement", "Set", x)
        self.number("velocity", "Set", v)
        assert self.call("ExitInitializationMode") == 0

    def step(self, t, h):
        flags, reached = [ct.c_bool() for _ in range(3)], ct.c_double()
        code = self.call(
            "DoStep", ct.c_double(t), ct.c_double(h), ct.c_bool(True),
            *(ct.byref(one) for one in flags), ct.byref(reached),
        )  # fmt: skip
        return code, reached.value

    def run(self, x, v):
        force = []
        for i in range(len(x) - 1):
            self.number("displacement", "Set", x[i])
            self.number("velocity", "Set", v[i])
            assert self.step(i * 1e-3, 1e-3) == (0, i * 1e-3 + 1e-3)
            force.append(self.number("force"))
        return np.array(force)


@runs_here
def test_it_is_the_damper_of_fmi_2_bit_for_bit(folder, unit) -> None:
    x, v = sine(0.5)
    other = unit()
    other.initialise(x[0], v[0], setting=20)
    one = Unit3(folder)
    one.begin(x[0], v[0], 20)
    assert np.array_equal(one.run(x, v), other.run(x, v))
    assert one.setting(7) == 3  # fmi3Error
    one.number("displacement", "Set", 0.5)
    code, reached = one.step(0.5, 1e-3)
    assert (code, reached) == (2, 0.5)  # fmi3Discard
    one.call("FreeInstance")


@runs_here
def test_adjoint_and_directional_derivatives_are_of_one_matrix(folder) -> None:
    one = Unit3(folder, is_exchange=True)
    one.begin(0.01, 0.2, 10)
    y = (ct.c_double * 3)(8e-4, -2e-4, 0.0)
    assert one.call("SetContinuousStates", y, ct.c_size_t(3)) == 0
    unknowns = (ct.c_uint32 * 3)(*(one.references[n] for n in ("force", "flow_1", "flow_2")))
    knowns = (ct.c_uint32 * 3)(*(one.references[n] for n in ("oil_1", "oil_2", "displacement")))
    size = ct.c_size_t(3)

    def matrix(name):
        rows = []
        for k in range(3):
            seed, found = (ct.c_double * 3)(*np.eye(3)[k]), (ct.c_double * 3)()
            assert one.call(name, unknowns, size, knowns, size, seed, size, found, size) == 0
            rows.append(found[:])
        return np.array(rows)

    forward, back = matrix("GetDirectionalDerivative").T, matrix("GetAdjointDerivative")
    assert np.array_equal(forward, back)
    assert np.count_nonzero(forward) >= 6


def test_the_rod_is_a_terminal_with_position_speed_and_force(folder) -> None:
    told = ET.parse(folder / "terminalsAndIcons" / "terminalsAndIcons.xml").getroot()  # noqa: S314
    assert told.get("fmiVersion") == "3.0"
    (rod,) = told.iter("Terminal")
    assert (rod.get("name"), rod.get("matchingRule")) == ("rod", "plug")
    members = {
        one.get("variableName"): (one.get("memberName"), one.get("variableKind")) for one in rod
    }
    assert members == {
        "displacement": ("s", "signal"),
        "velocity": ("v", "signal"),
        "force": ("f", "inflow"),
    }
    known = {one.get("name") for one in root_of(folder).find("ModelVariables")}
    assert set(members) <= known


def test_every_unknown_and_every_indicator_tells_what_it_follows(folder) -> None:
    root = root_of(folder)
    structure = root.find("ModelStructure")
    assert all(one.get("dependencies") is not None for one in structure)
    named = {one.get("valueReference") for one in root.find("ModelVariables")}
    followed = {r for one in structure for r in one.get("dependencies").split()}
    assert followed <= named
    assert {one.get("valueReference") for one in structure} <= named
    assert len(structure.findall("EventIndicator")) == 4
    sources = ET.parse(folder / "sources" / "buildDescription.xml").getroot()  # noqa: S314
    files = {one.get("name") for one in sources.iter("SourceFile")}
    assert files == {path.name for path in (folder / "sources").glob("*.c")}
