"""Forces by setting of a results folder, and the setting for a force."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from damperfit.adjustment import (
    STROKES,
    Click,
    Level,
    Wanted,
    beside_measured,
    clicks,
    credible_forces,
    levels,
    named_speeds,
    which_setting,
)
from damperfit.errors import ConfigurationError, Mishap, mishap_of
from damperfit.identification.sharing import of_settings
from damperfit.problem import Option
from damperfit.queries.rig_in_forces import notes_on_settings
from damperfit.tested.setting import Setting, lines_of
from damperfit.units.quantities import parse_quantity

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from damperfit.queries.adjuster_results import AdjusterResults

__all__ = ["ForcesBySetting", "Question", "parse_question", "tabulate_forces"]


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
        raise ConfigurationError(f"expected {' or '.join(STROKES)}", where=Option("stroke", stroke))
    if force is not None and velocity is None:
        raise ConfigurationError(
            "at which speed? Give --velocity too, as in --velocity 0.2m/s",
            where=Option("force", force),
        )
    if velocity is None:
        return Question(stroke=stroke)
    speed = parse_quantity(velocity, "velocity", option="--velocity")
    if speed == 0.0:
        raise ConfigurationError(
            "expected a speed other than zero", where=Option("velocity", velocity)
        )
    if force is None:
        side = "bump" if speed < 0.0 and stroke is None else stroke
        return Question(abs(speed), None, side)
    wanted = parse_quantity(force, "force", option="--force")
    if stroke is None:
        stroke = "bump" if speed < 0.0 or wanted < 0.0 else "rebound"
    return Question(abs(speed), -abs(wanted) if stroke == "bump" else wanted, stroke)


def tabulate_forces(
    adjuster: AdjusterResults, question: Question, *, jobs: int = 1
) -> ForcesBySetting:
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
            f"not reached by {adjuster.source}, which peaks at {sine.peak_speed:.3g} m/s; "
            "give a lower --velocity, or a larger --amplitude or --frequency",
            subject=at,
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
    credible = credible_forces(found)
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
            raise ConfigurationError(
                "one setting is not enough to find which gives a force; fit more logs"
            )
        mine = [level for level in credible if level.stroke == question.stroke]
        lines = [line for line in lines_of(done) if len(line.settings) > 1]
        if not lines:
            raise ConfigurationError(
                "no two settings differ in the clicks of one adjuster alone; --velocity without "
                "--force shows the forces of all"
            )
        wanted = tuple(which_setting(mine, question.force, line=line) for line in lines)
    changes = clicks(credible, adjuster.damper)
    notes = (
        *adjuster.notes,
        *notes_on_settings(adjuster.damper, adjuster.stages),
        *_cavitation_notes(adjuster, found),
        *_measured_notes(credible),
    )
    traces = tuple(mishaps[setting].trace for setting in sorted(mishaps))
    return ForcesBySetting(found, changes, wanted, remarks, notes, traces)


def _cavitation_notes(adjuster: AdjusterResults, found: Sequence[Level]) -> Iterator[str]:
    """Say at which settings the damper cavitates on the motion that was asked for."""
    settings = {level.setting for level in found if level.is_cavitating}
    if settings:
        yield (
            f"a chamber cavitates at {adjuster.source} at {of_settings(settings)}: "
            "the forces there are the model's with an empty chamber"
        )


def _measured_notes(found: Sequence[Level]) -> Iterator[str]:
    """Say where measured forces are shown in place of the model's, and by how much it misses."""
    missed = [level for level in found if level.is_measured and level.disagrees]
    if missed:
        worst = max(missed, key=lambda level: abs(level.difference / level.measured))
        share = 100.0 * abs(worst.difference / worst.measured)
        where = of_settings(dict.fromkeys(level.setting for level in missed))
        yield (
            f"the model misses measured forces at {where}, most by {share:.2g} % at "
            f"{worst.speed:g} m/s in {worst.stroke} (setting {worst.setting}): measured forces, "
            "the mean of all compared cycles, are given at those speeds"
        )
