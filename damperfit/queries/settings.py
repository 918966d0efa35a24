"""Forces by setting of a run, and the setting for a force."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from damperfit.adjustment.clicks import Click, clicks
from damperfit.adjustment.force_at import (
    STROKES,
    Force,
    Sine,
    credible_forces,
    determined_speed,
    force_at,
    named_speeds,
    offset_sentence,
)
from damperfit.adjustment.wanted import Wanted, which_setting
from damperfit.damper.quantity import RIG
from damperfit.damper.warmed import Warmed
from damperfit.errors import ConfigurationError, mishap_of
from damperfit.identification.sharing import of_settings
from damperfit.problem import Failure, Option
from damperfit.results import Run
from damperfit.simulation import NAMED_SPEEDS, refuse_amplitude
from damperfit.tested.setting import Setting, lines_of
from damperfit.units.quantities import parse_quantity

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from pathlib import Path

    from damperfit.adjustment.force_at import Stage
    from damperfit.damper.model import Model, Values
    from damperfit.simulation import SolverOptions
    from damperfit.uncertainty import SpeedForces

__all__ = [
    "AdjusterResults",
    "ForcesBySetting",
    "Question",
    "adjuster_of",
    "notes_on_settings",
    "notes_on_simulation",
    "parse_question",
    "read_adjuster_results",
    "refuse_unfitted",
    "tabulate_forces",
]


# A results folder read back as an adjuster: its settings with their errors, damper and motion.


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
        The test's own motion, or the one asked for: the named speeds go up to its peak.
    source : str
        At what forces are given, for people.
    solver : SolverOptions
        How exactly to integrate.
    remarks : tuple of str
        What was missing or damaged in the folder.
    forces : tuple of SpeedForces
        As measured, at the motion of the tests.
    notes : tuple of str
        What is so, and nothing to mend in the folder.
    speeds : tuple of float
        At which forces are shown where none is asked for, m/s.
    """

    stages: tuple[Stage, ...]
    damper: Model
    sine: Sine
    source: str
    solver: SolverOptions
    remarks: tuple[str, ...]
    forces: tuple[SpeedForces, ...] = ()
    notes: tuple[str, ...] = ()
    speeds: tuple[float, ...] = NAMED_SPEEDS


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
    run = Run.load(folder, parts=("parameters",), config=config, temperature=temperature)
    return adjuster_of(run, amplitude=amplitude, frequency=frequency)


def adjuster_of(
    run: Run, *, amplitude: str | None = None, frequency: str | None = None
) -> AdjusterResults:
    """Return a run as an adjuster; see `read_adjuster_results`."""
    refuse_unfitted(run)
    damper = run.damper
    own = run.motion_of_tests if amplitude and frequency else run.motion
    sine = _motion(own, amplitude, frequency)
    notes = list(run.notes)
    if sine is not own:
        outside = run.tested.outside
        beyond = list(
            outside(amplitude=sine.amplitude, frequency=sine.frequency, speed=sine.peak_speed)
        )
        if beyond:
            notes.append(f"never tested: {', '.join(beyond)}")
        notes.append(
            f"the sine of {1e3 * sine.amplitude:.4g} mm at {sine.frequency:.4g} Hz says which "
            "speeds are shown; the forces are those at constant speed, whatever the stroke"
        )
    source = "at constant speed"
    if isinstance(damper, Warmed):
        source += f" and {damper.oil_temperature:g} degC"
    refuse_amplitude(sine.amplitude, damper.travel)
    return AdjusterResults(
        run.settings,
        damper,
        sine,
        source,
        run.solver,
        (*run.remarks, *run.remarks_on_errors),
        run.speed_forces,
        tuple(notes),
        run.shown_speeds or NAMED_SPEEDS,
    )


def refuse_unfitted(run: Run) -> Run:
    """Return a run, which must have a setting with all parameters."""
    if not run.settings:
        why = f" ({'; '.join(run.remarks)})" if run.remarks else ""
        raise ConfigurationError(
            f"no setting has all parameters{why}; run damperfit identify LOGS first",
            subject=run.place,
            code="no-parameters",
        )
    return run


def _motion(own: Sine | None, amplitude: str | None, frequency: str | None) -> Sine:
    """Return the motion asked for, else the test's own."""
    size = parse_quantity(amplitude, "length", option="--amplitude") if amplitude else None
    rate = parse_quantity(frequency, "frequency", option="--frequency") if frequency else None
    for option, value in (("--amplitude", size), ("--frequency", rate)):
        if value is not None and value <= 0.0:
            raise ConfigurationError(f"{option} {value:g}: expected more than 0")
    if own is not None and size is None and rate is None:
        return own
    a = size if size is not None else own.amplitude if own else math.nan
    f = rate if rate is not None else own.frequency if own else math.nan
    return Sine(a, f)


# What of the rig is in forces that are shown, and what is left out, in words.


def notes_on_settings(damper: Model, stages: Sequence[Stage]) -> Iterator[str]:
    """Yield what of the rig is left out of forces by setting."""
    holds_gas = damper.rest_force(0.0) is None
    if said := offset_sentence([stage.offset for stage in stages], holds_gas=holds_gas):
        yield said
    if stages and (parts := _mounting(stages[0].parameters)):
        listed, verb = _listed(parts)
        yield f"the rig's {listed} {verb} in measured forces, not in the model's"


def notes_on_simulation(damper: Model, values: Values) -> Iterator[str]:
    """Yield what of the rig is in a simulated force."""
    offsets = []
    if damper.rest_force(0.0) is not None:  # else it holds the gas force
        tares = [float(getattr(values, one.name)) for one in values.quantities if one.is_offset]
        offsets = [f"force offset of {tare:.3g} N" for tare in tares if tare]
    yield from _on_rig([*_mounting(values), *offsets])


def _mounting(values: Values) -> list[str]:
    """Series stiffness, play, lag and moving mass, as far as the model has them."""
    return [one.label for one in values.quantities if one.scope == RIG]


def _on_rig(parts: Sequence[str]) -> Iterator[str]:
    if not parts:
        return
    listed, verb = _listed(parts)
    yield (
        f"the rig's {listed} {verb} in these forces; what damperfit settings shows and damperfit "
        "export writes is of the damper alone"
    )


def _listed(parts: Sequence[str]) -> tuple[str, str]:
    *before, last = parts
    return (f"{', '.join(before)} and {last}", "are") if before else (last, "is")


# Forces by setting of a results folder, and the setting for a force.


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
class ForcesBySetting:
    """Forces by setting, their changes by click, and the answer.

    Attributes
    ----------
    forces : tuple of Force
        By setting, speed and stroke: of one origin at a speed and stroke.
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

    forces: tuple[Force, ...]
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
        raise ConfigurationError(
            f"expected {' or '.join(STROKES)}",
            where=Option("stroke", stroke),
            code="unknown-stroke",
        )
    if force is not None and velocity is None:
        raise ConfigurationError(
            "at which speed? Give {velocity} too, as in {example}",
            velocity=Option("velocity"),
            example=Option("velocity", "0.2m/s"),
            where=Option("force", force),
            code="no-speed",
        )
    if velocity is None:
        return Question(stroke=stroke)
    speed = parse_quantity(velocity, "velocity", option="--velocity")
    if speed == 0.0:
        raise ConfigurationError(
            "expected a speed other than zero",
            where=Option("velocity", velocity),
            code="out-of-range",
        )
    if force is None:
        side = "bump" if speed < 0.0 and stroke is None else stroke
        return Question(abs(speed), None, side)
    wanted = parse_quantity(force, "force", option="--force")
    if stroke is None:
        stroke = "bump" if speed < 0.0 or wanted < 0.0 else "rebound"
    return Question(abs(speed), -abs(wanted) if stroke == "bump" else wanted, stroke)


def tabulate_forces(adjuster: AdjusterResults, question: Question) -> ForcesBySetting:
    """Return forces and clicks of an adjuster, and where a wanted force is found.

    Raises
    ------
    ConfigurationError
        No named speed is reached, or there are not two settings to look between.
    """
    speeds = (
        named_speeds(adjuster.sine.peak_speed, adjuster.speeds)
        if question.speed is None
        else (question.speed,)
    )
    if not speeds:
        raise ConfigurationError(
            f"none is reached by {adjuster.sine.peak_speed:.3g} m/s; give {{velocity}}, or a "
            "larger {amplitude} or {frequency}",
            velocity=Option("velocity"),
            amplitude=Option("amplitude"),
            frequency=Option("frequency"),
            subject="the named test speeds",
            code="no-speed",
        )
    mishaps: dict[Setting, Failure] = {}

    def take(setting: Setting, error: Exception) -> None:
        mishaps[setting] = mishap_of(error, f"simulating setting {setting}")

    found = force_at(
        adjuster.stages, adjuster.damper, speeds, measured=adjuster.forces, on_error=take
    )
    told = credible_forces(found)
    done = {one.setting for one in found}
    remarks = tuple(
        mishaps[stage.setting].message
        if stage.setting in mishaps
        else f"setting {stage.setting} cannot be simulated {adjuster.source}"
        for stage in adjuster.stages
        if stage.setting not in done
    )
    wanted: tuple[Wanted, ...] = ()
    if question.force is not None:
        if len(done) < 2:
            raise ConfigurationError(
                "one setting is not enough to find which gives a force; fit more logs",
                code="one-setting",
            )
        mine = [one for one in told if one.stroke == question.stroke]
        lines = [line for line in lines_of(done) if len(line.settings) > 1]
        if not lines:
            raise ConfigurationError(
                "no two settings differ in the clicks of one adjuster alone; {velocity} without "
                "{force} shows the forces of all",
                velocity=Option("velocity"),
                force=Option("force"),
                code="one-setting",
            )
        wanted = tuple(which_setting(mine, question.force, line=line) for line in lines)
    notes = (
        *adjuster.notes,
        *notes_on_settings(adjuster.damper, adjuster.stages),
        *_untested_notes(adjuster, told),
        *_cavitation_notes(found),
        *_measured_notes(told),
    )
    traces = tuple(mishaps[setting].trace for setting in sorted(mishaps))
    return ForcesBySetting(told, clicks(told), wanted, remarks, notes, traces)


def _untested_notes(adjuster: AdjusterResults, told: Sequence[Force]) -> Iterator[str]:
    """Say which speeds no test of a setting has reached, and what the logs leave open there."""
    untested = {one.setting: one.speed for one in told if not one.is_tested}
    if not untested:
        return
    stages = [stage for stage in adjuster.stages if stage.setting in untested]
    top = min(stage.top_speed for stage in stages)
    yield (
        f"{max(untested.values()):g} m/s was never tested at {of_settings(untested)} (tested: up "
        f"to {top:.3g} m/s): the force there is the model's, extrapolated"
    )
    loose = [one.setting for one in told if not (one.is_tested or one.is_determined)]
    if loose:
        reached = min(determined_speed(stage, adjuster.damper) for stage in stages)
        yield (
            f"the logs do not determine the force there at {of_settings(dict.fromkeys(loose))}: "
            f"within 5 % it is known up to {reached:.3g} m/s; the intervals are what is left open"
        )


def _cavitation_notes(found: Sequence[Force]) -> Iterator[str]:
    """Say at which settings and from which speed on the damper cavitates."""
    empty = [one for one in found if one.is_cavitating]
    if empty:
        settings = dict.fromkeys(one.setting for one in empty)
        yield (
            f"a chamber cavitates from {min(one.speed for one in empty):g} m/s on at "
            f"{of_settings(settings)}: the forces there are the model's with an empty chamber"
        )


def _measured_notes(told: Sequence[Force]) -> Iterator[str]:
    """Say where measured forces are given in place of the model's, and where peaks differ."""
    missed = [one for one in told if one.is_measured and one.disagrees]
    if missed:
        worst = max(missed, key=lambda one: abs(one.difference / one.measured_force))
        share = 100.0 * abs(worst.difference / worst.measured_force)
        where = of_settings(dict.fromkeys(one.setting for one in missed))
        yield (
            f"the model misses measured forces at {where}, most by {share:.2g} % at "
            f"{worst.speed:g} m/s in {worst.stroke} (setting {worst.setting}): measured forces "
            "are given at those speeds"
        )
    peaks = [
        (abs(seen.peak - seen.force), seen, one)
        for one in told
        if (seen := one.measured) is not None and seen.peak_differs
    ]
    if peaks:
        _, seen, one = max(peaks, key=lambda peak: peak[0])
        yield (
            f"the largest force of a segment is not that at its peak speed, most at setting "
            f"{one.setting} in {one.stroke} at {one.speed:g} m/s: {seen.peak:.4g} N for "
            f"{seen.force:.4g} N; measured forces are those at the peak speed"
        )
