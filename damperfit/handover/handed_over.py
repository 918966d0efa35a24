"""What is handed over: the damper, its values by setting, and what they were found from."""

from __future__ import annotations

import hashlib
import math
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from damperfit import __version__
from damperfit.adjustment import Sine
from damperfit.damper.warmed import Warmed
from damperfit.errors import ConfigurationError
from damperfit.queries.fleet_part import is_part, part_in, results_in, title_of
from damperfit.queries.origin import configuration_of_run, motion_of_tests, warmed_to
from damperfit.tables import unlimited_names, values_from
from damperfit.tested.setting import Setting

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence
    from pathlib import Path

    from damperfit.damper.model import Model, Values
    from damperfit.simulation import SolverOptions
    from damperfit.tables import Results

__all__ = ["HandedOver", "HandedSetting", "Tested", "hand_over"]

_TABLES = ("parameters.parquet", "parameters.csv")


@dataclass(frozen=True, slots=True)
class HandedSetting:
    """One setting.

    Attributes
    ----------
    setting : Setting
        Where the adjusters stand.
    values : Values
        Of the model, SI.
    mse_percent : float
        NaN where it is not known.
    """

    setting: Setting
    values: Values
    mse_percent: float = math.nan


@dataclass(frozen=True, slots=True)
class Tested:
    """The range of the tests that were fitted, as far as run.json tells; None: it does not.

    Attributes
    ----------
    n_logs : int
        Logs that were fitted.
    stroke : float or None
        Largest amplitude of a motion that repeats, m.
    speed : float or None
        Highest peak speed, m/s.
    frequencies, temperatures : tuple of float or None
        Lowest and highest, Hz and degrees Celsius.
    """

    n_logs: int = 0
    stroke: float | None = None
    speed: float | None = None
    frequencies: tuple[float, float] | None = None
    temperatures: tuple[float, float] | None = None


@dataclass(frozen=True, slots=True)
class HandedOver:
    """A results folder as its targets need it.

    Attributes
    ----------
    name : str
        Of the folder.
    damper : Model
        Geometry, oil, gas and law.
    settings : tuple of HandedSetting
        Rising; at least one.
    motion : Sine
        The test's fastest.
    tested : Tested
        Range of the tests.
    solver : SolverOptions
        How exactly the model is integrated.
    identity : mapping of str to str
        Whose test it was: what is known of damper, serial, customer, operator, date, rig.
    version : str
        Of damperfit, as it writes.
    digest : str
        SHA-256 of the table of parameters.
    remarks : tuple of str
        What was missing or damaged.
    notes : tuple of str
        What else to know of the values.
    folder : pathlib.Path or None
        The results folder itself, for those who hand on its tables.
    """

    name: str
    damper: Model
    settings: tuple[HandedSetting, ...]
    motion: Sine
    tested: Tested
    solver: SolverOptions
    identity: Mapping[str, str] = field(default_factory=lambda: MappingProxyType({}))
    version: str = __version__
    digest: str = ""
    remarks: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    folder: Path | None = None


def _at_one_temperature(
    damper: Model, settings: tuple[HandedSetting, ...], notes: list[str]
) -> tuple[Model, tuple[HandedSetting, ...]]:
    """A damper that follows the temperature, as it is at one: other programs know of none."""
    if not isinstance(damper, Warmed):
        return damper, settings
    told = damper.oil_temperature
    notes.append(f"resistances as they are at {told:g} degC (fitted at {damper.reference:g} degC)")
    there = (replace(one, values=damper.at_reference(one.values, told)) for one in settings)
    return damper.plain, tuple(there)


def hand_over(
    folder: Path, *, config: Path | None = None, temperature: str | None = None
) -> HandedOver:
    """Read what `identify` wrote, for a target.

    Parameters
    ----------
    folder : pathlib.Path
        Results folder.
    config : pathlib.Path, optional
        Configuration; its damper is taken where the run does not tell its own.
    temperature : str, optional
        Of the oil, where the damper follows it; the reference temperature by default.

    Raises
    ------
    ConfigurationError
        There is no such folder, no setting in it has parameters, or ``config`` declares another
        damper.
    """
    results = results_in(folder, parts=("parameters",))
    record, remarks = results.record, list(results.remarks)
    configuration = warmed_to(configuration_of_run(folder, config, record, remarks), temperature)
    notes: list[str] = []
    damper, settings = _at_one_temperature(configuration.damper, tuple(_settings(results)), notes)
    if not settings:
        raise ConfigurationError(
            f"{folder}: no setting has all parameters; run damperfit identify LOGS first"
        )
    for row in results.parameters:
        names = ", ".join(unlimited_names(row, results.quantities))
        if names:
            notes.append(
                f"{names} at setting {Setting.of(row['setting'])}: the logs set no upper limit, so "
                "the force beyond their speeds may be far off"
            )
    motion = motion_of_tests(record, {one.setting.cell for one in settings})
    if motion is None:
        motion = Sine(configuration.rig.amplitude, configuration.rig.frequency)
        remarks.append("the motion of the test is not known: the nominal one is used")
    test = record.get("test")
    identity = {
        str(key): value
        for key, value in (test if isinstance(test, dict) else {}).items()
        if isinstance(value, str) and value
    }
    return HandedOver(
        title_of(folder),
        damper,
        settings,
        motion,
        _tested(record, {one.setting.cell for one in settings}),
        configuration.simulation.solver,
        MappingProxyType(identity),
        digest=_digest(folder),
        remarks=tuple(remarks),
        notes=tuple(notes),
        folder=folder,
    )


def _settings(results: Results) -> Iterator[HandedSetting]:
    """Yield the settings that have all parameters, rising."""
    for row in sorted(results.parameters, key=lambda row: Setting.of(row["setting"])):
        values = [
            one.default if row[one.name] is None else row[one.name] for one in results.quantities
        ]
        numbers = [one for one in values if one is not None]
        if len(numbers) == len(results.quantities):
            mse = row.get("mse_percent")
            yield HandedSetting(
                Setting.of(row["setting"]),
                values_from(results.quantities, numbers),
                math.nan if mse is None else mse,
            )


def _tested(record: Mapping[str, Any], settings: set[int | str]) -> Tested:
    logs = record.get("inputs")
    mine = [
        log
        for log in (logs if isinstance(logs, list) else ())
        if isinstance(log, dict) and log.get("setting") in settings
    ]
    runs = [one for log in mine for one in _stretches(log)]
    strokes = _numbers(runs, "amplitude_m")
    speeds = _numbers(runs, "peak_speed_m_per_s")
    rates = _numbers(runs, "frequency_Hz")
    if not speeds:
        speeds = [
            2.0 * math.pi * a * f
            for run in runs
            for a, f in zip(
                _numbers([run], "amplitude_m"), _numbers([run], "frequency_Hz"), strict=False
            )
        ]
    warm = _numbers(mine, "temperature_degC")
    return Tested(
        len(mine),
        max(strokes, default=None),
        max(speeds, default=None),
        (min(rates), max(rates)) if rates else None,
        (min(warm), max(warm)) if warm else None,
    )


def _stretches(log: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    """The stretches of a log; older runs tell of one only, in the log's own entry."""
    stretches = log.get("stretches")
    return (
        [one for one in stretches if isinstance(one, dict)]
        if isinstance(stretches, list)
        else [log]
    )


def _numbers(rows: Sequence[Mapping[str, Any]], key: str) -> list[float]:
    cells = (row.get(key) for row in rows)
    return [float(one) for one in cells if isinstance(one, int | float) and math.isfinite(one)]


def _digest(folder: Path) -> str:
    for path in [part_in(folder)] if is_part(folder) else [folder / name for name in _TABLES]:
        if path.is_file():
            with path.open("rb") as file:
                return hashlib.file_digest(file, "sha256").hexdigest()
    return ""
