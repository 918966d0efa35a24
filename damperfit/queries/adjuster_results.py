"""A results folder read back as an adjuster: its settings with their errors, damper and motion."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from damperfit.adjustment import Sine, Stage, has_lost_errors
from damperfit.damper.warmed import Warmed
from damperfit.errors import ConfigurationError
from damperfit.identification.sharing import of_settings
from damperfit.queries.fleet_part import results_in
from damperfit.queries.origin import configuration_of_run, motion_of_tests, warmed_to
from damperfit.report.records import listed_in, read_back
from damperfit.simulation import refuse_amplitude
from damperfit.tables import values_from
from damperfit.tested.setting import Setting
from damperfit.uncertainty import SpeedForces
from damperfit.units.quantities import parse_quantity

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping
    from pathlib import Path

    from damperfit.damper.model import Model, Values
    from damperfit.simulation import SolverOptions
    from damperfit.tables import Results

__all__ = ["AdjusterResults", "adjuster_results_in", "read_adjuster_results"]


@dataclass(frozen=True, slots=True, eq=False)
class AdjusterResults:
    """The settings of a results folder, and the motion at which they are compared.

    Attributes
    ----------
    stages : tuple of Stage
        By rising setting.
    damper : Model
        Geometry, oil and gas of the run.
    sine : Sine
        The test's own motion, or the one asked for.
    source : str
        Where the motion comes from, for people.
    solver : SolverOptions
        How exactly to integrate.
    remarks : tuple of str
        What was missing or damaged in the folder.
    forces : tuple of SpeedForces
        As measured, at the motion of the tests.
    notes : tuple of str
        What is so, and nothing to mend in the folder.
    """

    stages: tuple[Stage, ...]
    damper: Model
    sine: Sine
    source: str
    solver: SolverOptions
    remarks: tuple[str, ...]
    forces: tuple[SpeedForces, ...] = ()
    notes: tuple[str, ...] = ()


def read_adjuster_results(
    folder: Path,
    *,
    config: Path | None = None,
    amplitude: str | None = None,
    frequency: str | None = None,
    temperature: str | None = None,
) -> AdjusterResults:
    """Read the settings, damper and motion of a results folder.

    Parameters
    ----------
    folder : pathlib.Path
        What `identify` wrote.
    config : pathlib.Path, optional
        Configuration; its damper is taken where the run does not tell its own.
    amplitude, frequency : str, optional
        Motion instead of the test's own.
    temperature : str, optional
        Of the oil, instead of the reference temperature.

    Raises
    ------
    ConfigurationError
        There is no such folder, no setting in it has parameters, ``config`` declares another
        damper, or the motion is none.
    """
    return adjuster_results_in(
        results_in(folder, parts=("parameters",)),
        folder,
        config=config,
        amplitude=amplitude,
        frequency=frequency,
        temperature=temperature,
    )


def adjuster_results_in(
    results: Results,
    folder: Path,
    *,
    config: Path | None = None,
    amplitude: str | None = None,
    frequency: str | None = None,
    temperature: str | None = None,
) -> AdjusterResults:
    """Return settings, damper and motion of results that were read; see `read_adjuster_results`.

    Parameters
    ----------
    results : Results
        With its parameters.
    folder : pathlib.Path
        Where they stand, for messages.
    config, amplitude, frequency, temperature
        As `read_adjuster_results` takes them.
    """
    remarks = list(results.remarks)
    configuration = warmed_to(
        configuration_of_run(folder, config, results.record, remarks), temperature
    )
    notes: list[str] = []
    stages = tuple(_stages(results, remarks, notes))
    if not stages:
        why = f" ({'; '.join(results.remarks)})" if results.remarks else ""
        raise ConfigurationError(
            f"{folder}: no setting has all parameters{why}; run damperfit identify LOGS first"
        )
    own = motion_of_tests(results.record, {stage.setting.cell for stage in stages})
    if own is None and not (amplitude and frequency):
        own = Sine(configuration.rig.amplitude, configuration.rig.frequency)
        remarks.append("the motion of the test is not known: the nominal one is used")
    sine, source = _motion(own, amplitude, frequency)
    if isinstance(configuration.damper, Warmed):
        source += f", at {configuration.damper.oil_temperature:g} degC"
    refuse_amplitude(sine.amplitude, configuration.damper.travel)
    return AdjusterResults(
        stages,
        configuration.damper,
        sine,
        source,
        configuration.simulation.solver,
        tuple(remarks),
        tuple(_forces(results.record)),
        tuple(notes),
    )


def _forces(record: Mapping[str, Any]) -> Iterator[SpeedForces]:
    """Yield the measured forces of a run; older runs have none."""
    for entry in listed_in(record, "speed_forces"):
        one = read_back(SpeedForces, entry)
        rows = () if one is None else (one.measured, one.measured_se, one.difference, one.misfit)
        if one is not None and all(len(row) == len(one.speeds) for row in rows):
            yield one


def _stages(results: Results, remarks: list[str], notes: list[str]) -> Iterator[Stage]:
    rows, quantities = results.parameters, results.quantities
    entries = results.record.get("uncertainty")
    known = {
        entry["setting"]: entry
        for entry in (entries if isinstance(entries, list) else ())
        if isinstance(entry, dict) and "setting" in entry
    }
    without, unsettled = [], []
    for row in sorted(rows, key=lambda row: Setting.of(row["setting"])):
        values = [one.default if row[one.name] is None else row[one.name] for one in quantities]
        numbers = [one for one in values if one is not None]
        if len(numbers) < len(quantities):
            continue
        setting, parameters = Setting.of(row["setting"]), values_from(quantities, numbers)
        try:
            stage = _stage(setting, parameters, row, known[setting.cell])
        except (KeyError, TypeError, ValueError):
            without.append(setting)
            stage = Stage(setting, parameters)
        else:
            if stage.covariance is None:
                unsettled.append(setting)
        yield stage
    if unsettled:
        notes.append(
            f"the fit met no minimum at {of_settings(unsettled)}: the forces there have no interval"
        )
    if without:
        which = "all settings" if len(without) == len(rows) else of_settings(without)
        remarks.append(
            f"errors and correlations of {which} are missing (an older version, or a damaged "
            "run.json): forces without intervals"
        )


def _stage(
    setting: Setting, parameters: Values, row: Mapping[str, Any], entry: Mapping[str, Any]
) -> Stage:
    """Return a stage with the covariance of ln y from standard errors and correlations."""
    names = tuple(str(name) for name in entry["parameters"])
    if has_lost_errors(names, {name: row[f"{name}_status"] for name in parameters.names}):
        return Stage(setting, parameters)
    # Older versions left it to the status, which tells of a shared value only that it is unsound.
    shared_names = entry.get(
        "shared", [name for name in names if row[f"{name}_status"] == "shared"]
    )
    shared = tuple(name for name in names if name in shared_names)
    own = tuple(name for name in names if name not in shared_names)
    scales = np.array(
        [
            getattr(parameters, name) if parameters.quantity(name).is_logarithmic else 1.0
            for name in names
        ]
    )
    errors = np.array([float(row[f"{name}_se"]) for name in names]) / scales
    correlation = np.array(entry["correlation"], dtype=np.float64).reshape(len(names), len(names))
    order = [names.index(name) for name in (*own, *shared)]
    covariance = (correlation * np.outer(errors, errors))[np.ix_(order, order)]
    if not np.all(np.isfinite(covariance)):
        raise ValueError("a correlation or an error is missing")
    return Stage(setting, parameters, own, shared, covariance)


def _motion(own: Sine | None, amplitude: str | None, frequency: str | None) -> tuple[Sine, str]:
    """Return the motion asked for, else the test's own."""
    size = parse_quantity(amplitude, "length", option="--amplitude") if amplitude else None
    rate = parse_quantity(frequency, "frequency", option="--frequency") if frequency else None
    for option, value in (("--amplitude", size), ("--frequency", rate)):
        if value is not None and value <= 0.0:
            raise ConfigurationError(f"{option} {value:g}: expected more than 0")
    a = size if size is not None else own.amplitude if own else math.nan
    f = rate if rate is not None else own.frequency if own else math.nan
    sine = f"sine of {1e3 * a:.4g} mm at {f:.4g} Hz"
    if size is not None or rate is not None:
        return Sine(a, f), f"a {sine}"
    if own is not None and not own.was_run:
        return Sine(a, f), f"a {sine}, the stroke and highest speed of the test"
    return Sine(a, f), f"the test's {sine}"
