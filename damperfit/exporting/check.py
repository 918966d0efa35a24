"""What was written held against the logs of the run: an FMU is run, a table is looked up.

The force of either passes the filter that the measured one passed, and is compared with it where
neither a beginning nor the filter's edges are felt.
"""

from __future__ import annotations

import ctypes as ct
import io
import platform
import re
import sys
import zipfile
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

import numpy as np

from damperfit.conditioning.filters import apply_filter, completed, design_filter
from damperfit.configuration.loading import load_configuration
from damperfit.errors import ConfigurationError, SimulationError
from damperfit.exporting.fmu import PLATFORMS, exported_damper
from damperfit.problem import Option

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping, Sequence

    from numpy.typing import NDArray

    from damperfit.exporting.source import ExportedRun
    from damperfit.exporting.tables import ForceTable
    from damperfit.exporting.targets import Export
    from damperfit.recording import FilterDesign
    from damperfit.tables.reading import LogSignals
    from damperfit.tested.setting import Setting

    FloatArray = NDArray[np.float64]
    Forces = Callable[[LogSignals, slice], FloatArray]

__all__ = ["SettingCheck", "check_export"]

_RUN_IN, _EDGE = 0.25, 0.1  # s: a pressure settles, a filter's end is felt
_NEAR = 1.02  # of a table's end
# Value references of an FMU: `c/exported.h`.
_INPUTS, _FORCE, _SETTING, _BAND, _EXTRAPOLATION, _WITH_RIG = (1, 2), 3, 8, 9, 10, 24


@dataclass(frozen=True, slots=True)
class SettingCheck:
    """How far what was written is from the logs of a setting.

    Attributes
    ----------
    setting : Setting
        Which.
    mse_percent, fit_mse_percent : float
        Of what was written, and of the run's own simulation of the same samples.
    n_samples : int
        Compared.
    beyond_percent : float
        Samples that are left out, for they are faster than the table.
    """

    setting: Setting
    mse_percent: float
    fit_mse_percent: float
    n_samples: int
    beyond_percent: float = 0.0

    def __str__(self) -> str:
        more = (
            f"; {self.beyond_percent:.2g} % of the samples are beyond the table"
            if self.beyond_percent
            else ""
        )
        return (
            f"setting {self.setting}: MSE {self.mse_percent:.3g} % against the logs, "
            f"the fit's own {self.fit_mse_percent:.3g} %{more}"
        )


def check_export(run: ExportedRun, export: Export) -> tuple[SettingCheck, ...]:
    """Return the error of what was written, by setting.

    Raises
    ------
    ConfigurationError
        The run has no signals, or nothing here runs what was written.
    SimulationError
        The FMU refuses a step.
    """
    if not run.run.signals:
        raise ConfigurationError(
            f"{run.run.name} has no responses.parquet to check against; run damperfit "
            "identify LOGS again, and export its results folder",
            where=Option("check"),
        )
    name, content = next(iter(export.files.items()))
    if not name.endswith(".fmu"):
        if not export.lost:
            raise ConfigurationError(
                f"nothing here runs the equations of {name}; check the FMU of the same "
                "damper: {to} {check}",
                to=Option("to", "fmu2"),
                check=Option("check"),
                where=Option("check"),
            )
        return tuple(_checks(run, export.tables, _of_table))
    settings = dict(zip(exported_damper(run).settings, export.tables, strict=True))
    places = {table.setting: number for number, table in settings.items()}
    with TemporaryDirectory(prefix="damperfit-", ignore_cleanup_errors=True) as folder:
        unit = _Unit(content, Path(folder))

        def forces(log: LogSignals, part: slice) -> FloatArray:
            return unit.force(places[log.setting], run.run.solver.dead_band, log, part)

        return tuple(_checks(run, export.tables, lambda _: forces))


def _checks(
    run: ExportedRun, tables: Sequence[ForceTable], make: Callable[[ForceTable], Forces]
) -> Iterator[SettingCheck]:
    """Compare the settings one by one; samples beyond a table are left out."""
    for table in tables:
        forces, rows, n_beyond = make(table), [], 0
        for log in run.run.signals:
            if log.setting != table.setting:
                continue
            for part in _segments(log.time):
                interval = float(np.median(np.diff(log.time[part])))
                design = _filter(run.run.record, 1.0 / interval)
                force = apply_filter(design, forces(log, part))
                inner = slice(round(_RUN_IN / interval), len(force) - round(_EDGE / interval))
                both = log.force_measured[part][inner], log.force[part][inner]
                known = np.isfinite(log.force_measured[part][inner])
                if make is _of_table:
                    known &= np.abs(log.velocity[part][inner]) <= _NEAR * table.end
                n_beyond += int((~known).sum())
                rows.append(np.array([force[inner], *both])[:, known])
        if not rows:
            continue
        written, measured, fitted = np.concatenate(rows, axis=1)
        square = float(np.sum((measured - np.mean(measured)) ** 2))
        error, own = (
            100.0 * float(np.sum((one - measured) ** 2)) / square for one in (written, fitted)
        )
        share = 100.0 * n_beyond / (n_beyond + len(measured))
        yield SettingCheck(table.setting, error, own, len(measured), share)


def _segments(time: FloatArray) -> Iterator[slice]:
    """Yield what of a log goes on without a gap, where it is long enough."""
    step = np.diff(time)
    gaps = np.flatnonzero(step > 1.5 * float(np.median(step))) + 1
    for start, stop in zip([0, *gaps], [*gaps, len(time)], strict=True):
        if time[stop - 1] - time[start] > 2.0 * (_RUN_IN + _EDGE):
            yield slice(int(start), int(stop))


def _filter(record: Mapping[str, Any], sample_rate: float) -> FilterDesign:
    """What the measured force of the run has passed: `conditioning.behind_filter`."""
    document = record.get("configuration") or {}
    names = ("filter", "filter_corner", "filter_order")
    overlay = {
        section: {name: (document.get(section) or {})[name] for name in names}
        for section in ("conditioning", "rig")
        if set(names) <= (document.get(section) or {}).keys()
    }
    options = load_configuration(overlay=overlay).conditioning
    corner, order = options.filter_corner, options.filter_order
    if options.rig_filter == "none" and options.filter != "causal":
        return design_filter(options.filter, corner, sample_rate=sample_rate, order=order)
    if options.rig_filter != "none":
        corner, order = options.rig_filter_corner, options.rig_filter_order
    causal = design_filter("causal", corner, sample_rate=sample_rate, order=order)
    return completed(causal, corner, order)


def _of_table(table: ForceTable) -> Forces:
    def forces(log: LogSignals, part: slice) -> FloatArray:
        v = log.velocity[part]
        force = np.interp(v, table.speeds, table.forces) + table.at_rest(log.displacement[part])
        return np.asarray(force + table.tare)

    return forces


class _Unit:
    """An FMU on the disk for a while, run by the doors of FMI 3, which the library of both has."""

    def __init__(self, content: bytes, folder: Path) -> None:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            archive.extractall(folder)
        here = f"{platform.machine().lower()}-{sys.platform}".replace("arm64", "aarch64")
        here = here.replace("amd64", "x86_64").replace("win32", "windows")
        paths = [
            folder / "binaries" / name / one.library
            for one in PLATFORMS
            for name in (one.name, one.fmi2)
            if one.name == here and name
        ]
        path = next((one for one in paths if one.is_file()), None)
        if path is None:
            raise ConfigurationError(
                f"the FMU holds no library for {here}; python -m "
                "damperfit.exporting.fmu_build builds it",
                where=Option("check"),
            )
        self.library = ct.CDLL(str(path))
        self.library.fmi3InstantiateCoSimulation.restype = ct.c_void_p
        description = (folder / "modelDescription.xml").read_text(encoding="utf-8")
        tokens = re.findall(r'(?:guid|instantiationToken)="([^"]*)"', description)
        self.token, self.resources = tokens[0].encode(), f"{folder}/resources/".encode()

    def force(self, setting: int, band: float, log: LogSignals, part: slice) -> FloatArray:
        """Return the force as the rig would log it, at the samples of a segment, N."""
        x, v, time = (row[part] for row in (log.displacement, log.velocity, log.time))
        no, zero = ct.c_bool(False), ct.c_double(0.0)
        flags = [no] * 4
        instance = ct.c_void_p(
            self.library.fmi3InstantiateCoSimulation(
                b"check", self.token, self.resources, *flags, None, ct.c_size_t(0), None, None, None
            )
        )
        if not instance.value:
            raise SimulationError("the FMU cannot be instantiated")

        def call(name: str, *arguments: Any) -> None:
            if getattr(self.library, f"fmi3{name}")(instance, *arguments):
                raise SimulationError(f"setting {log.setting}: the FMU refuses fmi3{name}")

        def number(verb: str, kind: str, references: Sequence[int], *values: float) -> Any:
            n, places = len(references), (ct.c_uint32 * len(references))(*references)
            held: Any = (ct.c_double * n)(*values)
            if kind == "Int32":
                held = (ct.c_int32 * n)(*map(int, values))
            call(f"{verb}{kind}", places, ct.c_size_t(n), held, ct.c_size_t(n))
            return held

        try:
            # Inputs are those of a step's end: between samples they go as in the fit.
            number("Set", "Int32", (_SETTING, _EXTRAPOLATION, _WITH_RIG), setting, 0, 1)
            number("Set", "Float64", (_BAND,), band)
            call("EnterInitializationMode", no, zero, zero, no, zero)
            number("Set", "Float64", _INPUTS, x[0], v[0])
            call("ExitInitializationMode")
            force = [number("Get", "Float64", (_FORCE,))[0]]
            done = [ct.byref(ct.c_bool()) for _ in range(3)]
            for k in range(1, len(x)):
                number("Set", "Float64", _INPUTS, x[k], v[k])
                start, step = time[k - 1] - time[0], time[k] - time[k - 1]
                call("DoStep", ct.c_double(start), ct.c_double(step), no, *done,
                     ct.byref(ct.c_double()))  # fmt: skip
                force.append(number("Get", "Float64", (_FORCE,))[0])
        finally:
            self.library.fmi3FreeInstance(instance)
        return np.array(force)
