"""Exported files compared with the logs of the run: tables are read back, models and FMUs are run.

Their force passes the filter of the measured one and is compared with it away from the beginning
and the filter's edges. Tables are read in the file's units and signs; equations are solved as they
are written in the file.
"""

from __future__ import annotations

import csv
import ctypes as ct
import io
import json
import re
import zipfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any, cast
from xml.etree import ElementTree as ET

import numpy as np

from damperfit.arrays import FloatArray
from damperfit.conditioning.filters import apply_filter, passed_filter
from damperfit.errors import ConfigurationError, SimulationError
from damperfit.exporting.fmu import PLATFORMS, exported_damper
from damperfit.exporting.fmu_build import this_platform
from damperfit.exporting.targets import Export, ExportedRun
from damperfit.problem import Option
from damperfit.tested.setting import Setting

if TYPE_CHECKING:
    Force = Callable[[FloatArray, FloatArray, FloatArray], FloatArray]

_RUN_IN, _EDGE = 0.25, 0.1  # s: until pressures settle; length of a filter's end effect
_NEAR = 1.02  # of a table's end
# Value references of an FMU: `c/exported.h`.
_INPUTS, _FORCE, _SETTING, _BAND, _EXTRAPOLATION, _WITH_RIG = (1, 2), 3, 8, 9, 10, 24
_SHEETS = "{http://schemas.openxmlformats.org/spreadsheetml/2006/main}"
_NUMBER = r"(-?\d[\d.]*(?:e[-+]?\d+)?)"


@dataclass(frozen=True, slots=True)
class SettingCheck:
    """Misfit of an exported file to the logs of a setting."""

    setting: Setting
    mse_percent: float  # of the file
    fit_mse_percent: float  # of the run's own simulation of the same samples
    n_samples: int  # compared
    beyond_percent: float = 0.0  # samples left out: they are faster than the table

    def __str__(self) -> str:
        beyond = f"; {self.beyond_percent:.2g} % of the samples are beyond the table"
        return (
            f"setting {self.setting}: MSE {self.mse_percent:.3g} % against the logs; the model's "
            f"is {self.fit_mse_percent:.3g} % on the same samples (the ends are left out)"
            f"{beyond * bool(self.beyond_percent)}"
        )


def check_export(run: ExportedRun, export: Export) -> tuple[SettingCheck, ...]:
    """Return the error of the exported files, by setting."""
    if not run.run.signals:
        raise ConfigurationError(
            f"{run.run.name} has no responses.parquet to check against; run damperfit "
            "identify LOGS again, and export its results folder",
            where=Option("check"),
            code="no-signals",
        )
    conditioning = run.run.own_configuration.conditioning
    checks = []
    with TemporaryDirectory(prefix="damperfit-", ignore_cleanup_errors=True) as folder:
        forces, tops = _forces(run, export, Path(folder))
        for table, force_of, top in zip(export.tables, forces, tops, strict=True):
            rows, n_beyond = [], 0
            for log in run.run.signals:
                for segment in _segments(log.time) if log.setting == table.setting else ():
                    time, x, v = log.time[segment], log.displacement[segment], log.velocity[segment]
                    interval = float(np.median(np.diff(time)))
                    design = passed_filter(conditioning, 1.0 / interval)
                    force = apply_filter(design, force_of(time, x, v))
                    inner = slice(round(_RUN_IN / interval), len(force) - round(_EDGE / interval))
                    responses = log.force_measured[segment][inner], log.force[segment][inner]
                    is_compared = np.isfinite(responses[0]) & (np.abs(v[inner]) <= _NEAR * top)
                    n_beyond += int((~is_compared).sum())
                    rows.append(np.array([force[inner], *responses])[:, is_compared])
            if rows:
                written, measured, fitted = np.concatenate(rows, axis=1)
                square = float(np.sum((measured - np.mean(measured)) ** 2))
                error, fit_error = (
                    100.0 * float(np.sum((simulated - measured) ** 2)) / square
                    for simulated in (written, fitted)
                )
                share = 100.0 * n_beyond / (n_beyond + len(measured))
                checks.append(SettingCheck(table.setting, error, fit_error, len(measured), share))
    return tuple(checks)


def _segments(time: FloatArray) -> Iterator[slice]:
    """Yield the parts of a log without a gap that are long enough."""
    step = np.diff(time)
    gaps = np.flatnonzero(step > 1.5 * float(np.median(step))) + 1
    for start, stop in pairwise([0, *gaps, len(time)]):
        if time[stop - 1] - time[start] > 2.0 * (_RUN_IN + _EDGE):
            yield slice(int(start), int(stop))


def _forces(run: ExportedRun, export: Export, folder: Path) -> tuple[list[Force], list[float]]:
    """Return the force function of each setting, with the rig's tare, and its top speed."""
    tables, band = export.tables, run.run.solver.dead_band
    tops = [table.end if export.lost else np.inf for table in tables]
    name, content = next(iter(export.files.items()))
    if name.endswith(".fmu"):  # with the rig, hence with its tare
        unit = _Unit(content, folder)
        return [unit.at(place, band) for place in exported_damper(run).settings], tops
    if name.endswith(".mo"):
        model = _Model(content.decode("utf-8"))
        return [model.at(k, band, table.tare) for k, table in enumerate(tables, 1)], tops
    curves = read_back(export)

    def looked_up(k: int) -> Force:
        return lambda _, x, v: np.interp(v, *curves[k]) + tables[k].at_rest(x) + tables[k].tare

    return list(map(looked_up, range(len(tables)))), [float(v[-1]) for v, _ in curves]


# Tables, read back from the files that were written


def read_back(export: Export) -> list[tuple[FloatArray, FloatArray]]:
    """Return speeds and forces as they stand in the files, for each table: m/s and N, rebound +."""
    readers = {"csv": _from_csv, "xlsx": _from_workbook, "matlab": _from_matlab}
    curves, units = [], export.options.units
    rows_of = readers.get(export.target.name, _from_texts)(export)
    for table, rows in zip(export.tables, rows_of, strict=True):
        v, force = np.array(rows, dtype=np.float64).reshape(-1, 2).T + 0.0
        if len(v) < 2 or not (np.diff(v) > 0.0).all():
            raise SimulationError(
                f"setting {table.setting}: the {export.target.name} file does not hold its table",
                code="not-as-written",
            )
        if "units" in export.target.takes:
            v, force = v / units.show(1.0, "m/s"), force / units.show(1.0, "N")
        curves.append((v, force))
    return curves


def _from_texts(export: Export) -> Iterator[Any]:
    """Find the rows of each setting by the pattern of the target, ``read`` in targets.toml."""
    target, rules = export.target, export.target.read
    row = rules["row"].replace("@", _NUMBER)
    for table in export.tables:
        file = target.file.format(stem=export.options.stem, setting=table.slug)
        text = export.files[file].decode(target.encoding)
        text = "\n".join(
            line for line in text.splitlines() if not line.startswith(rules["comment"])
        )
        if "begins" in rules:
            name = re.sub(r"[^A-Za-z0-9]", "_", table.slug)
            text = text.partition(rules["begins"].format(setting=name))[2].partition("double")[0]
        rows = set()
        for heading, side in rules.get("sides", {"": 1.0}).items():
            block = re.search(rf"{heading}[^\n]*\n(?:\t[^\n]*\n?)*", text) if heading else None
            for v, force in re.findall(row, block[0] if block else text, re.MULTILINE):
                rows.add((side * rules["speed"] * float(v), side * rules["force"] * float(force)))
        yield sorted(rows)


def _from_csv(export: Export) -> list[Any]:
    mark = export.options.decimal
    text = export.files[f"{export.options.stem}.csv"].decode("utf-8").replace(mark, ".")
    _, *rows = csv.reader(io.StringIO(text), delimiter=";" if mark == "," else ",")
    of_setting: dict[str, list[tuple[float, float]]] = {}
    for name, v, force, *_ in rows:
        of_setting.setdefault(name, []).append((float(v), float(force)))
    return list(of_setting.values())


def _from_workbook(export: Export) -> Iterator[Any]:
    content = export.files[f"{export.options.stem}.xlsx"]
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        book = ET.fromstring(archive.read("xl/workbook.xml"))  # noqa: S314 - our own file
        names = [sheet.get("name") for sheet in book.iter(f"{_SHEETS}sheet")]
        place = f"xl/worksheets/sheet{names.index('forces') + 1}.xml"
        sheet = ET.fromstring(archive.read(place))  # noqa: S314
    rows = (
        [float(cell.text or "nan") for cell in row.iter(f"{_SHEETS}v")]
        for row in sheet.iter(f"{_SHEETS}row")
    )
    numbers = np.array([row for row in rows if row])  # the heads are texts
    return (numbers[:, [0, k]] for k in range(1, len(export.tables) + 1))


def _from_matlab(export: Export) -> Iterator[Any]:
    """Read the data file, and the script, which must hold the same."""
    from scipy.io import loadmat

    stem = export.options.stem
    variables = loadmat(cast("Any", io.BytesIO(export.files[f"{stem}.mat"])))
    script = export.files[f"{stem}.m"].decode("utf-8")
    for name in ("velocity", "force"):
        matrix = re.search(rf"^{name} = \[([^\]]*)\];", script, re.MULTILINE)
        rows = [row.split() for row in matrix[1].split(";")] if matrix else []
        if not rows or not np.allclose(np.array(rows, dtype=float), variables[name], rtol=1e-8):
            raise SimulationError(
                f"{stem}.m and {stem}.mat do not hold the same {name}", code="not-as-written"
            )
    return (np.column_stack([variables["velocity"][:, 0], force]) for force in variables["force"].T)


# Equations of a Modelica model


class _Model:
    """A Modelica model: its parameters, and its equations as assignments."""

    def __init__(self, text: str) -> None:
        source = " ".join(re.sub(r'//[^\n]*|"[^"]*"', "", text).split())
        head, separator, body = source.rpartition(" equation ")
        if not separator or not re.fullmatch(r"[\w\s()\[\]{}.,;=+*/^-]*", source):
            raise SimulationError(
                "the Modelica file holds no equations that could be solved", code="not-as-written"
            )
        parameters = r"parameter (?:Real|Integer) (\w+)(?:\[[^\]]*\])?(?:\([^)]*\))? = ([^;]+);"
        self.parameters = {
            name: json.loads(value.replace("{", "[").replace("}", "]"))
            for name, value in re.findall(parameters, head)
        }
        starts = re.findall(r"Real (\w+)\(unit = , start = ([^)]+)\)", head)
        self.starts = {name: float(value) for name, value in starts}
        self.begin = self._compiled(head.partition(" initial equation ")[2])
        self.body = self._compiled(body)

    @staticmethod
    def _compiled(equations: str) -> Any:
        """Return assignments of Modelica as code, in their order."""
        lines = []
        for left, right in re.findall(r"([\w()]+) = ([^;]+);", equations):
            places = re.sub(
                r"\[([^\]]+)\]",
                lambda index: "".join(f"[{place} - 1]" for place in index[1].split(",")),
                right.strip(),
            )
            name = re.sub(r"der\((\w+)\)", r"rate_of_\1", left)
            lines.append(f"{name} = {places.replace('^', '**')}")
        return compile("\n".join(lines), "equations", "exec")

    def at(self, setting: int, band: float, tare: float) -> Force:
        """Return the function of the force of a setting, counted from 1."""
        constants = {**self.parameters, "setting": setting, "friction_band": band}
        functions = {"__builtins__": {}, "max": np.maximum, "min": np.minimum}

        def solved(x: Any, v: Any, *codes: Any, **states: Any) -> dict[str, Any]:
            names = {**constants, "s_rel": x, "v_rel": v, **states}
            for code in codes or (self.body,):
                exec(code, functions, names)  # noqa: S102 - read by `_compiled`
            return names

        def force(time: FloatArray, x: FloatArray, v: FloatArray) -> FloatArray:
            if not self.starts:
                return np.asarray(solved(x, v)["f"]) + tare
            from scipy.integrate import solve_ivp
            from scipy.interpolate import CubicHermiteSpline

            motion = CubicHermiteSpline(time, x, v)
            speed = motion.derivative()

            def rates(t: float, masses: FloatArray) -> list[float]:
                states = dict(zip(self.starts, masses, strict=True))
                values = solved(float(motion(t)), float(speed(t)), **states)
                return [values[f"rate_of_{name}"] for name in self.starts]

            initial = solved(x[0], v[0], self.body, self.begin, **self.starts)
            solution = solve_ivp(
                rates, (time[0], time[-1]), [float(initial[name]) for name in self.starts],
                method="LSODA", t_eval=time, rtol=1e-7, atol=1e-11, max_step=5e-3,
            )  # fmt: skip
            if not solution.success:
                raise SimulationError(
                    f"the equations cannot be solved: {solution.message}", code="not-integrated"
                )
            states = dict(zip(self.starts, solution.y, strict=True))
            return np.asarray(solved(x, v, **states)["f"]) + tare

        return force


# FMUs


class _Unit:
    """An FMU unpacked on the disk, run through FMI 3, which every library exports."""

    def __init__(self, content: bytes, folder: Path) -> None:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            archive.extractall(folder)
        host, binaries = this_platform(), folder / "binaries"
        paths = [
            binaries / name / platform.library
            for platform in PLATFORMS
            for name in (platform.name, platform.fmi2)
            if platform.name == host and (binaries / name / platform.library).is_file()
        ]
        if not paths:
            raise ConfigurationError(
                f"the FMU holds no library for {host}; python -m "
                "damperfit.exporting.fmu_build builds it",
                where=Option("check"),
                code="no-library",
            )
        self.library = ct.CDLL(str(paths[0]))
        self.library.fmi3InstantiateCoSimulation.restype = ct.c_void_p
        description = (folder / "modelDescription.xml").read_text(encoding="utf-8")
        tokens = re.findall(r'(?:guid|instantiationToken)="([^"]*)"', description)
        self.token, self.resources = tokens[0].encode(), f"{folder}/resources/".encode()

    def at(self, setting: int, band: float) -> Force:
        """Return the function of the force of a setting as the rig would log it."""
        no, zero = ct.c_bool(False), ct.c_double(0.0)

        def force(time: FloatArray, x: FloatArray, v: FloatArray) -> FloatArray:
            instance = ct.c_void_p(
                self.library.fmi3InstantiateCoSimulation(
                    b"check", self.token, self.resources, no, no, no, no, None, ct.c_size_t(0),
                    None, None, None,
                )
            )  # fmt: skip
            if not instance.value:
                raise SimulationError("the FMU cannot be instantiated", code="fmu")

            def call(name: str, *arguments: Any) -> None:
                if getattr(self.library, f"fmi3{name}")(instance, *arguments):
                    raise SimulationError(
                        f"setting {setting}: the FMU refuses fmi3{name}", code="fmu"
                    )

            def number(verb: str, references: tuple[int, ...], *values: float) -> Any:
                n, places = len(references), (ct.c_uint32 * len(references))(*references)
                is_whole = any(isinstance(value, int) for value in values)
                cells = ((ct.c_int32 if is_whole else ct.c_double) * n)(*cast("Any", values))
                kind = "Int32" if is_whole else "Float64"
                call(f"{verb}{kind}", places, ct.c_size_t(n), cells, ct.c_size_t(n))
                return cells[0]

            try:
                # Inputs are those of a step's end: between samples they go as in the fit.
                number("Set", (_SETTING, _EXTRAPOLATION, _WITH_RIG), setting, 0, 1)
                number("Set", (_BAND,), band)
                call("EnterInitializationMode", no, zero, zero, no, zero)
                number("Set", _INPUTS, x[0], v[0])
                call("ExitInitializationMode")
                forces = [number("Get", (_FORCE,))]
                done = [ct.byref(ct.c_bool()) for _ in range(3)]
                for k in range(1, len(x)):
                    number("Set", _INPUTS, x[k], v[k])
                    begin, step = time[k - 1] - time[0], time[k] - time[k - 1]
                    call("DoStep", ct.c_double(begin), ct.c_double(step), no, *done,
                         ct.byref(ct.c_double()))  # fmt: skip
                    forces.append(number("Get", (_FORCE,)))
            finally:
                self.library.fmi3FreeInstance(instance)
            return np.array(forces)

        return force
