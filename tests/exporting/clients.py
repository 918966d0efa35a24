"""Small importers of FMI 2.0 and 3.0 by ctypes, from the standards: unzip, load, step."""

import ctypes as ct
import zipfile
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import numpy as np

OK, WARNING, DISCARD, ERROR = range(4)
INTEGERS = {"setting", "input_extrapolation", "carry_derivatives", "with_rig"}
LOGGER = ct.CFUNCTYPE(
    None, ct.c_void_p, ct.c_char_p, ct.c_int, ct.c_char_p, ct.c_char_p, ct.c_char_p
)


class Callbacks(ct.Structure):
    """fmi2CallbackFunctions; the logger's one variable argument is always a text here."""

    _fields_ = (
        ("logger", LOGGER),
        ("allocate", ct.c_void_p),
        ("free", ct.c_void_p),
        ("finished", ct.c_void_p),
        ("environment", ct.c_void_p),
    )


@dataclass
class Unit:
    """One instance of an FMU that lies unzipped in a folder."""

    folder: Path
    is_exchange: bool = False
    token: str | None = None
    said: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        root = ET.parse(self.folder / "modelDescription.xml").getroot()  # noqa: S314
        listed = root.iter("ScalarVariable")
        self.references = {one.get("name"): int(one.get("valueReference")) for one in listed}
        self.library = ct.CDLL(str(self.folder / "binaries" / "linux64" / "damperfit.so"))
        self.library.fmi2Instantiate.restype = ct.c_void_p
        self.logger = LOGGER(lambda *told: self.said.append(told[5].decode()))
        self.callbacks = Callbacks(self.logger, None, None, None, None)
        uri = (self.folder / "resources").as_uri()
        token = self.token or root.get("guid")
        kind = 0 if self.is_exchange else 1
        self.component = self.library.fmi2Instantiate(
            b"unit", kind, token.encode(), uri.encode(), ct.byref(self.callbacks), 0, 0
        )

    def call(self, name: str, *arguments: Any) -> int:
        return int(getattr(self.library, f"fmi2{name}")(ct.c_void_p(self.component), *arguments))

    def initialise(self, x: float = 0.0, v: float = 0.0, **parameters: float) -> None:
        for name, value in parameters.items():
            assert self.set(name, value) == OK
        zero = ct.c_double(0.0)
        assert self.call("SetupExperiment", 0, zero, zero, 0, zero) == OK
        assert self.call("EnterInitializationMode") == OK
        assert self.set("displacement", x) == OK
        assert self.set("velocity", v) == OK
        assert self.call("ExitInitializationMode") == OK

    def set(self, name: str, value: float) -> int:
        reference = (ct.c_uint * 1)(self.references[name])
        if name in INTEGERS:
            return self.call("SetInteger", reference, ct.c_size_t(1), (ct.c_int * 1)(int(value)))
        return self.call("SetReal", reference, ct.c_size_t(1), (ct.c_double * 1)(value))

    def get(self, name: str) -> float:
        value, number = (ct.c_double * 1)(), (ct.c_int * 1)()
        reference = (ct.c_uint * 1)(self.references[name])
        if name in INTEGERS:
            assert self.call("GetInteger", reference, ct.c_size_t(1), number) == OK
            return number[0]
        assert self.call("GetReal", reference, ct.c_size_t(1), value) == OK
        return value[0]

    def step(self, time: float, interval: float) -> int:
        return self.call("DoStep", ct.c_double(time), ct.c_double(interval), 1)

    def run(self, x, v, interval: float = 1e-3, *, start: float = 0.0, is_of_end: bool = False):
        """Drive it with samples; the force at each but the first."""
        force = np.empty(len(x) - 1)
        for i in range(len(force)):
            k = i + 1 if is_of_end else i
            self.set("displacement", x[k])
            self.set("velocity", v[k])
            assert self.step(start + i * interval, interval) == OK, self.said
            force[i] = self.get("force")
        return force

    def slope(self, unknown: str, known: str) -> float:
        found = (ct.c_double * 1)()
        left, right = (
            (ct.c_uint * 1)(self.references[unknown]),
            (ct.c_uint * 1)(self.references[known]),
        )
        one = ct.c_size_t(1)
        seed = (ct.c_double * 1)(1.0)
        assert self.call("GetDirectionalDerivative", left, one, right, one, seed, found) == OK
        return found[0]

    def state(self) -> ct.c_void_p:
        kept = ct.c_void_p(None)
        assert self.call("GetFMUstate", ct.byref(kept)) == OK
        return kept

    def restore(self, kept: ct.c_void_p) -> None:
        assert self.call("SetFMUstate", kept) == OK

    # Model exchange
    def at(self, time: float, x: float, v: float, states) -> None:
        self.call("SetTime", ct.c_double(time))
        self.set("displacement", x)
        self.set("velocity", v)
        y = (ct.c_double * len(states))(*states)
        assert self.call("SetContinuousStates", y, ct.c_size_t(len(states))) == OK

    def numbers(self, name: str, n: int) -> np.ndarray:
        found = (ct.c_double * n)()
        assert self.call(name, found, ct.c_size_t(n)) == OK
        return np.array(found[:])

    def close(self) -> None:
        self.call("Terminate")
        self.library.fmi2FreeInstance(ct.c_void_p(self.component))


class Unit3:
    """An instance for co-simulation or model exchange."""

    def __init__(self, folder, *, is_exchange=False):
        self.library = ct.CDLL(str(folder / "binaries" / "x86_64-linux" / "damperfit.so"))
        kind = "ModelExchange" if is_exchange else "CoSimulation"
        make = getattr(self.library, f"fmi3Instantiate{kind}")
        make.restype = ct.c_void_p
        root = ET.parse(folder / "modelDescription.xml").getroot()  # noqa: S314
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


def unzip(content: bytes, folder: Path) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / "unit.fmu"
    path.write_bytes(content)
    with zipfile.ZipFile(path) as archive:
        archive.extractall(folder)
    return folder
