"""A results folder read back as an adjuster: forces by setting, and the setting for a force."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from damperfit.adjustment import (
    STROKES,
    Click,
    Level,
    Sine,
    Stage,
    Wanted,
    beside_measured,
    clicks,
    credible_forces,
    levels,
    named_speeds,
    which_setting,
)
from damperfit.configuration.loading import load_configuration
from damperfit.errors import ConfigurationError, Mishap, mishap_of
from damperfit.identification.sharing import listed_settings
from damperfit.quantities import parse_quantity
from damperfit.queries.origin import Origin, configured_as, motion_of_tests
from damperfit.report.json_records import listed_in, read_back
from damperfit.setting import Setting, lines_of
from damperfit.simulation import refuse_amplitude
from damperfit.tables import read_results, values_from
from damperfit.uncertainty import SpeedForces

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence
    from pathlib import Path

    from damperfit.configuration.options import Configuration
    from damperfit.damper.model import Model, Values
    from damperfit.simulation import SolverOptions
    from damperfit.tables import Results

__all__ = [
    "AdjusterResults",
    "ForceTable",
    "Question",
    "parse_question",
    "read_adjuster",
    "tabulate_forces",
]


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
    """

    stages: tuple[Stage, ...]
    damper: Model
    sine: Sine
    source: str
    solver: SolverOptions
    remarks: tuple[str, ...]
    forces: tuple[SpeedForces, ...] = ()


@dataclass(frozen=True, slots=True)
class Question:
    """What is asked of an adjuster.

    Attributes
    ----------
    speed : float or None
        m/s, positive; None: the named test speeds.
    force : float or None
        Wanted force, N, positive in rebound; None: nothing is asked, forces are shown.
    stroke : str or None
        "rebound" or "bump"; None: both.
    """

    speed: float | None = None
    force: float | None = None
    stroke: str | None = None


@dataclass(frozen=True, slots=True)
class ForceTable:
    """Forces by setting, their changes by click, and the answer.

    Attributes
    ----------
    levels : tuple of Level
        By setting, speed and stroke.
    clicks : tuple of Click
        Between neighbouring settings.
    wanted : tuple of Wanted
        The answers, where a force was asked for: one for each line on which one adjuster turns.
    remarks : tuple of str
        Settings that could not be simulated.
    traces : tuple of str
        Where internal errors among them happened.
    notes : tuple of str
        What a reader must know of the forces; nothing is missing.
    """

    levels: tuple[Level, ...]
    clicks: tuple[Click, ...]
    wanted: tuple[Wanted, ...]
    remarks: tuple[str, ...]
    notes: tuple[str, ...] = ()
    traces: tuple[str, ...] = ()


def parse_question(
    *, force: str | None = None, velocity: str | None = None, stroke: str | None = None
) -> Question:
    """Return the question that the texts of a command line ask.

    Rebound is positive and bump negative. A minus before force or velocity asks for bump, where
    the size of both counts. With ``stroke`` the signs of the velocity and, in bump, of the force
    do not matter; in rebound a negative force is one: at low speed the gas still pushes.

    Raises
    ------
    ConfigurationError
        A quantity cannot be understood, the speed is zero, or a force comes without a speed.

    Examples
    --------
    >>> parse_question(force="900N", velocity="0.2m/s")
    Question(speed=0.2, force=900.0, stroke='rebound')
    >>> parse_question(force="900N", velocity="200mm/s", stroke="bump")
    Question(speed=0.2, force=-900.0, stroke='bump')
    >>> parse_question(force="-900N", velocity="0.2m/s").stroke
    'bump'
    """
    if stroke is not None and stroke not in STROKES:
        raise ConfigurationError(f"--stroke {stroke}: expected {' or '.join(STROKES)}")
    if force is not None and velocity is None:
        raise ConfigurationError(
            f"--force {force}: at which speed? Give --velocity too, as in --velocity 0.2m/s"
        )
    if velocity is None:
        return Question(stroke=stroke)
    speed = parse_quantity(velocity, "velocity")
    if speed == 0.0:
        raise ConfigurationError(f"--velocity {velocity}: expected a speed other than zero")
    if force is None:
        side = "bump" if speed < 0.0 and stroke is None else stroke
        return Question(abs(speed), None, side)
    wanted = parse_quantity(force, "force")
    if stroke is None:
        stroke = "bump" if speed < 0.0 or wanted < 0.0 else "rebound"
    return Question(abs(speed), -abs(wanted) if stroke == "bump" else wanted, stroke)


def read_adjuster(
    folder: Path,
    *,
    config: Path | None = None,
    amplitude: str | None = None,
    frequency: str | None = None,
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

    Raises
    ------
    ConfigurationError
        There is no such folder, no setting in it has parameters, ``config`` declares another
        damper, or the motion is none.
    """
    results = read_results(folder, parts=("parameters",))
    remarks = list(results.remarks)
    configuration = _configuration(folder, config, results.record, remarks)
    stages = tuple(_stages(results, remarks))
    if not stages:
        raise ConfigurationError(
            f"{folder}: no setting has all parameters; run damperfit identify LOGS first"
        )
    own = motion_of_tests(results.record, {stage.setting.cell for stage in stages})
    if own is None and not (amplitude and frequency):
        own = Sine(configuration.rig.amplitude, configuration.rig.frequency)
        remarks.append("the motion of the test is not known: the nominal one is taken")
    sine, source = _motion(own, amplitude, frequency)
    refuse_amplitude(sine.amplitude, configuration.damper.travel)
    return AdjusterResults(
        stages,
        configuration.damper,
        sine,
        source,
        configuration.simulation.solver,
        tuple(remarks),
        tuple(_forces(results.record)),
    )


def tabulate_forces(adjuster: AdjusterResults, question: Question, *, jobs: int = 1) -> ForceTable:
    """Return forces and clicks of an adjuster, and where a wanted force is found.

    Raises
    ------
    ConfigurationError
        The motion does not reach the speed, or there are not two settings to look between.
    """
    sine = adjuster.sine
    speeds = named_speeds(sine) if question.speed is None else (question.speed,)
    if not speeds or max(speeds) >= sine.peak_speed:
        at = f"{question.speed:g} m/s" if question.speed else "the named test speeds"
        raise ConfigurationError(
            f"{at}: not reached by {adjuster.source}, which peaks at {sine.peak_speed:.3g} m/s; "
            "give a lower --velocity, or a larger --amplitude or --frequency"
        )
    mishaps: dict[Setting, Mishap] = {}

    def take(setting: Setting, error: Exception) -> None:
        mishaps[setting] = mishap_of(error, f"simulating setting {setting}")

    modelled = levels(
        adjuster.stages,
        adjuster.damper,
        sine,
        speeds=speeds,
        solver=adjuster.solver,
        jobs=jobs,
        on_error=take,
    )
    found = beside_measured(modelled, adjuster.forces, sine)
    told = credible_forces(found)
    done = {level.setting for level in found}
    remarks = tuple(
        mishaps[stage.setting].message
        if stage.setting in mishaps
        else f"setting {stage.setting} cannot be simulated at {adjuster.source}"
        for stage in adjuster.stages
        if stage.setting not in done
    )
    wanted: tuple[Wanted, ...] = ()
    if question.force is not None:
        if len(done) < 2:
            raise ConfigurationError("one setting does not tell which gives a force; fit more logs")
        mine = [level for level in told if level.stroke == question.stroke]
        lines = [line for line in lines_of(done) if len(line.settings) > 1]
        if not lines:
            raise ConfigurationError(
                "no two settings differ in the clicks of one adjuster alone; --velocity without "
                "--force shows the forces of all"
            )
        wanted = tuple(which_setting(mine, question.force, line=line) for line in lines)
    changes = clicks(told, adjuster.damper)
    notes = (*_cavitation_notes(adjuster, found), *_measured_notes(told))
    traces = tuple(mishaps[setting].trace for setting in sorted(mishaps))
    return ForceTable(found, changes, wanted, remarks, notes, traces)


def _cavitation_notes(adjuster: AdjusterResults, found: Sequence[Level]) -> Iterator[str]:
    """Say at which settings the damper cavitates on the motion that was asked for."""
    settings = {level.setting for level in found if level.is_cavitating}
    if settings:
        yield (
            f"a chamber cavitates at {adjuster.source} at setting {listed_settings(settings)}: "
            "the forces there are the model's with an empty chamber"
        )


def _measured_notes(found: Sequence[Level]) -> Iterator[str]:
    """Say where measured forces are told in place of the model's, and by how much it misses."""
    missed = [level for level in found if level.is_measured and level.disagrees]
    if missed:
        worst = max(missed, key=lambda level: abs(level.difference / level.measured))
        share = 100.0 * abs(worst.difference / worst.measured)
        where = listed_settings(dict.fromkeys(level.setting for level in missed))
        yield (
            f"the model misses measured forces at setting {where}, most by {share:.2g} % at "
            f"{worst.speed:g} m/s in {worst.stroke} (setting {worst.setting}): measured forces, "
            "the mean of all compared cycles, are told at those speeds"
        )


def _forces(record: Mapping[str, Any]) -> Iterator[SpeedForces]:
    """Yield the measured forces of a run; older runs have none."""
    for entry in listed_in(record, "speed_forces"):
        one = read_back(SpeedForces, entry)
        rows = () if one is None else (one.measured, one.measured_se, one.difference, one.misfit)
        if one is not None and all(len(row) == len(one.speeds) for row in rows):
            yield one


def _configuration(
    folder: Path, config: Path | None, record: Mapping[str, Any], remarks: list[str]
) -> Configuration:
    """Return the configuration that has the run's damper, whatever else is in its document."""
    given = load_configuration(config)
    document = record.get("configuration")
    damper = document.get("damper") if isinstance(document, dict) else None
    if isinstance(damper, dict):
        return configured_as(given, Origin(str(folder / "run.json"), damper), config=config)
    if config is None:
        remarks.append("the damper of the run is not known: the paper's is taken; give --config")
    return given


def _stages(results: Results, remarks: list[str]) -> Iterator[Stage]:
    rows, quantities = results.parameters, results.quantities
    entries = results.record.get("uncertainty")
    known = {
        entry["setting"]: entry
        for entry in (entries if isinstance(entries, list) else ())
        if isinstance(entry, dict) and "setting" in entry
    }
    without = []
    for row in sorted(rows, key=lambda row: Setting.of(row["setting"])):
        told = [one.default if row[one.name] is None else row[one.name] for one in quantities]
        numbers = [one for one in told if one is not None]
        if len(numbers) < len(quantities):
            continue
        setting, parameters = Setting.of(row["setting"]), values_from(quantities, numbers)
        try:
            yield _stage(setting, parameters, row, known[setting.cell])
        except (KeyError, TypeError, ValueError):
            without.append(setting)
            yield Stage(setting, parameters)
    if without:
        which = (
            "all settings" if len(without) == len(rows) else f"setting {listed_settings(without)}"
        )
        remarks.append(
            f"errors and correlations of {which} are missing (an older version, or a damaged "
            "run.json): forces without intervals"
        )


def _stage(
    setting: Setting, parameters: Values, row: Mapping[str, Any], entry: Mapping[str, Any]
) -> Stage:
    """Return a stage with the covariance of ln y from standard errors and correlations."""
    names = tuple(str(name) for name in entry["parameters"])
    # Older versions left it to the status, which tells of a shared value only that it is unsound.
    told = entry.get("shared", [name for name in names if row[f"{name}_status"] == "shared"])
    shared = tuple(name for name in names if name in told)
    own = tuple(name for name in names if name not in told)
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
    size = parse_quantity(amplitude, "length") if amplitude else None
    rate = parse_quantity(frequency, "frequency") if frequency else None
    for option, value in (("--amplitude", size), ("--frequency", rate)):
        if value is not None and value <= 0.0:
            raise ConfigurationError(f"{option} {value:g}: expected more than 0")
    a = size if size is not None else own.amplitude if own else math.nan
    f = rate if rate is not None else own.frequency if own else math.nan
    whose = "the test's sine" if size is None and rate is None else "a sine"
    return Sine(a, f), f"{whose} of {1e3 * a:.4g} mm at {f:.4g} Hz"
