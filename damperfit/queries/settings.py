"""Forces by setting of a run, or by measured curve, and the setting for a force."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from damperfit.adjustment.clicks import Click, Wanted, clicks, wanted_sentences, which_setting
from damperfit.adjustment.force_at import (
    STROKE_WORDS,
    STROKES,
    Force,
    Sine,
    Stage,
    credible_forces,
    determined_speed,
    force_at,
    named_speeds,
    offset_sentence,
)
from damperfit.damper.model import RIG, Model, Values
from damperfit.damper.temperature_law import WithTemperature
from damperfit.errors import ConfigurationError, failure_of
from damperfit.identification.sharing import of_settings
from damperfit.io import ReadOptions, read_curves
from damperfit.io.force_curves import ForceCurve
from damperfit.problem import Failure, Option, Problem, as_subject, note, warning
from damperfit.reporting.answer import Answer
from damperfit.reporting.inspection import curve_forces_sheet
from damperfit.reporting.records import to_record
from damperfit.reporting.sheet import Sheet, rows_in_units, sheet_in_units
from damperfit.reporting.tables import force_sheets, measured_force_sheet
from damperfit.simulation import NAMED_SPEEDS, refuse_amplitude
from damperfit.tables.files import json_values
from damperfit.tables.rows import adjustment_rows
from damperfit.tested.setting import Setting, lines_of
from damperfit.units.quantities import parse_quantity
from damperfit.units.shown_units import SI, ShownUnits

if TYPE_CHECKING:
    import pandas as pd

    from damperfit.results import Run


def refuse_unfitted(run: Run) -> Run:
    """Return a run, which must have a setting with all parameters."""
    if not run.settings:
        reason = f" ({'; '.join(map(str, run.remarks))})" if run.remarks else ""
        raise ConfigurationError(
            f"no setting has all parameters{reason}; run damperfit identify LOGS first",
            subject=run.place,
            code="no-parameters",
        )
    return run


def positive(value: str | float | None, dimension: str, name: str) -> float | None:
    """Return a quantity above zero in SI, as it was given by a keyword; of None None."""
    if value is None:
        return None
    number = parse_quantity(value, dimension, option=Option(name))
    if number <= 0.0:
        raise ConfigurationError(
            "expected more than 0", where=Option(name, f"{number:g}"), code="out-of-range"
        )
    return number


def speed_in(text: str | float) -> float:
    """Return a velocity with its sign, m/s, as it was given by a keyword; zero is refused."""
    speed = parse_quantity(text, "velocity", option=Option("velocity"))
    if speed == 0.0:
        message, where = "expected a speed other than zero", Option("velocity", str(text))
        raise ConfigurationError(message, where=where, code="out-of-range")
    return speed


# Notes on what the rig adds to forces, and what of it is left out


def notes_on_settings(damper: Model, stages: Sequence[Stage]) -> Iterator[Problem]:
    """Yield what of the rig is left out of forces by setting."""
    holds_gas = damper.rest_force(0.0) is None
    if sentence := offset_sentence([stage.offset for stage in stages], holds_gas=holds_gas):
        yield note("offset", sentence)
    if stages and (mounting := _mounting(stages[0].parameters)):
        text = "the rig's {parts} in measured forces, not in the model's"
        yield note("mounting", text, parts=as_subject(mounting))


def notes_on_simulation(damper: Model, values: Values) -> Iterator[Problem]:
    """Yield what of the rig is in a simulated force."""
    contributions = _mounting(values)
    if damper.rest_force(0.0) is not None:  # else the offset holds the gas force
        tares = [values[quantity.name] for quantity in values.quantities if quantity.is_offset]
        contributions += [f"force offset of {tare:.3g} N" for tare in tares if tare]
    if contributions:
        text = (
            "the rig's {parts} in these forces; what damperfit settings shows and damperfit export "
            "writes is of the damper alone"
        )
        yield note("mounting", text, parts=as_subject(contributions))


def _mounting(values: Values) -> list[str]:
    """Series stiffness, play, lag and moving mass, as far as the model has them."""
    return [quantity.label for quantity in values.quantities if quantity.scope == RIG]


# Forces by setting of a results folder, and the setting for a force


@dataclass(frozen=True, slots=True)
class Question:
    """What is asked of an adjuster."""

    speed: float | None = None  # m/s, positive; None: the named test speeds
    # Wanted force, N, positive in rebound; None: nothing is asked, forces are shown.
    force: float | None = None
    stroke: str | None = None  # "rebound" or "bump"; None: both


class _Forces(Answer):
    def to_frame(self) -> pd.DataFrame:
        """Return a row a setting or curve, speed and stroke."""
        import pandas as pd

        return pd.DataFrame(self.document()["forces"])


@dataclass(frozen=True, repr=False, eq=False)
class SettingForces(_Forces):
    """Force by setting and what a click changes, shown in `units`; and the setting for a force."""

    run: Run
    question: Question
    sine: Sine  # the test's own motion, or the one asked for: the named speeds go up to its peak
    source: str  # at what forces are given, for people
    forces: tuple[Force, ...]  # by setting, speed and stroke: of one origin at a speed and stroke
    clicks: tuple[Click, ...]  # between neighbouring settings
    # The answers, where a force was asked for: one for each line on which one adjuster turns.
    wanted: tuple[Wanted, ...]
    # What was missing or damaged in the run, and settings that could not be simulated.
    remarks: tuple[Problem, ...] = ()
    notes: tuple[Problem, ...] = ()  # what a reader must know of the forces; nothing is missing
    traces: tuple[str, ...] = ()  # where internal errors happened
    units: ShownUnits = SI

    @property
    def sentence(self) -> str:  # type: ignore[override]
        """The answer to the question, in SI; empty where none was asked."""
        return "; ".join(wanted_sentences(self.wanted))

    @property
    def answers(self) -> tuple[str, ...]:
        """The same in the units that people want, one for each adjuster."""
        return wanted_sentences(self.wanted, self.units)

    @property
    def heading(self) -> str:
        """What the tables show."""
        return f"force by setting, {self.source}"

    def document(self) -> dict[str, Any]:
        """Return all of it as JSON values."""
        answers = [
            {name: to_record(value) for name, value in answer._asdict().items()}
            | ({"adjuster": line.adjuster, "held": line.held} if line.held else {})
            for line in self.wanted
            for answer in line.answers
        ]
        document: dict[str, Any] = json_values(
            {
                "motion": {"amplitude_m": self.sine.amplitude, "frequency_Hz": self.sine.frequency},
                "source": self.source,
                "question": to_record(self.question) if self.wanted else None,
                "sentence": self.sentence or None,
                "answers": answers,
                "forces": adjustment_rows(self.forces, self.clicks),
                "remarks": self.remarks,
                "notes": self.notes,
            }
        )
        return document

    def sheets(self) -> tuple[Sheet, ...]:
        """Return forces by setting, a table a stroke, and measured ones beside the model's."""
        rows = rows_in_units(adjustment_rows(self.forces, self.clicks), self.units)
        question = self.question
        is_point = question.speed is not None and question.force is not None
        strokes = STROKES if is_point or question.stroke is None else (question.stroke,)
        sheets = (*force_sheets(rows, strokes), measured_force_sheet(rows))
        return tuple(sheet_in_units(sheet, self.units) for sheet in sheets if sheet.rows)


def parse_question(
    *, force: str | None = None, velocity: str | None = None, stroke: str | None = None
) -> Question:
    """Return the question that the texts of a command line ask.

    Rebound is positive and bump negative. A minus before force or velocity asks for bump, where
    the size of both counts. With ``stroke`` the signs of the velocity and, in bump, of the force
    do not matter; in rebound a negative force is one: at low speed the gas still pushes.

    Examples
    --------
    >>> parse_question(force="900N", velocity="0.2m/s")
    Question(speed=0.2, force=900.0, stroke='rebound')
    >>> parse_question(force="900N", velocity="200mm/s", stroke="bump")
    Question(speed=0.2, force=-900.0, stroke='bump')
    >>> parse_question(force="-900N", velocity="0.2m/s").stroke
    'bump'
    """
    stroke = "bump" if stroke == "compression" else stroke
    if stroke is not None and stroke not in STROKES:
        raise ConfigurationError(
            "expected rebound or compression", where=Option("stroke", stroke), code="unknown-stroke"
        )
    if velocity is None:
        if force is None:
            return Question(stroke=stroke)
        raise ConfigurationError(
            "at which speed? Give {velocity} too, as in {example}",
            velocity=Option("velocity"),
            example=Option("velocity", "0.2m/s"),
            where=Option("force", force),
            code="no-speed",
        )
    speed = speed_in(velocity)
    target = None if force is None else parse_quantity(force, "force", option=Option("force"))
    if stroke is None and (speed < 0.0 or (target is not None and target < 0.0)):
        stroke = "bump"
    if target is None:
        return Question(abs(speed), None, stroke)
    stroke = stroke or "rebound"
    return Question(abs(speed), -abs(target) if stroke == "bump" else target, stroke)


def tabulate_forces(
    run: Run,
    question: Question,
    *,
    amplitude: str | None = None,
    frequency: str | None = None,
    without_gas: bool = False,
    units: ShownUnits = SI,
) -> SettingForces:
    """Return forces and clicks of a run, and where a wanted force is found.

    ``without_gas`` leaves the gas force out of all forces, the wanted one too. With a sine
    forces are shown up to its peak speed, instead of that of the test's own motion.
    """
    damper = refuse_unfitted(run).damper
    size = positive(amplitude, "length", "amplitude")
    rate = positive(frequency, "frequency", "frequency")
    tested = run.motion_of_tests if size and rate else run.motion
    sine = tested
    if sine is None or size or rate:
        base = tested or Sine(math.nan, math.nan)
        sine = Sine(size or base.amplitude, rate or base.frequency)
    refuse_amplitude(sine.amplitude, damper.travel)
    speeds = named_speeds(sine.peak_speed, run.shown_speeds or NAMED_SPEEDS)
    if question.speed is not None:
        speeds = (question.speed,)
    if not speeds:
        raise ConfigurationError(
            f"none is reached by {sine.peak_speed:.3g} m/s; give {{velocity}}, or a "
            "larger {amplitude} or {frequency}",
            velocity=Option("velocity"),
            amplitude=Option("amplitude"),
            frequency=Option("frequency"),
            subject="the named test speeds",
            code="no-speed",
        )
    failures: dict[Setting, Failure] = {}

    def take(setting: Setting, error: Exception) -> None:
        failures[setting] = failure_of(error, f"simulating setting {setting}")

    forces = force_at(run.settings, damper, speeds, measured=run.speed_forces, on_error=take)
    credible = credible_forces(forces)
    simulated = {force.setting for force in forces}
    source = "at constant speed"
    if isinstance(damper, WithTemperature):
        source += f" and {damper.oil_temperature:g} degC"
    problems = (
        failures[stage.setting].problem
        if stage.setting in failures
        else warning("simulation", f"setting {stage.setting} cannot be simulated {source}")
        for stage in run.settings
        if stage.setting not in simulated
    )
    notes = [*run.notes]
    if sine is not tested:
        beyond = ", ".join(
            run.tested.outside(
                amplitude=sine.amplitude, frequency=sine.frequency, speed=sine.peak_speed
            )
        )
        notes += [note("never-tested", "never tested: {what}", what=beyond)] if beyond else []
        text = (
            f"the sine of {1e3 * sine.amplitude:.4g} mm at {sine.frequency:.4g} Hz says which "
            "speeds are shown; the forces are those at constant speed, whatever the stroke"
        )
        notes.append(note("sine", text))
    notes += [*notes_on_settings(damper, run.settings), *_force_notes(run, forces, credible)]
    target, changes, gas = question.force, clicks(credible), 0.0
    if without_gas and math.isnan(gas := credible[0].gas):
        text = f"{{where}} has no effect: the model {damper.name} knows no gas force; leave it out"
        raise ConfigurationError(text, where=Option("without_gas"), code="no-effect")
    answers = () if target is None else _wanted(run, credible, question, target + gas)
    if without_gas:
        credible = tuple(force.gas_out for force in credible)
        answers = tuple(answer.gas_out() for answer in answers)
        source += f", without the gas force, {units.write(gas, 'N', '.4g')} at mid-stroke"
    return SettingForces(
        run,
        question,
        sine,
        source,
        credible,
        changes,
        answers,
        (*run.remarks, *run.remarks_on_errors, *problems),
        tuple(notes),
        tuple(failures[setting].trace for setting in sorted(failures)),
        units,
    )


def _wanted(
    run: Run, forces: Sequence[Force], question: Question, force: float
) -> tuple[Wanted, ...]:
    settings = {row.setting for row in forces}
    if len(settings) < 2:
        raise ConfigurationError(
            "one setting is not enough to find which gives a force; fit more logs",
            code="one-setting",
        )
    lines = [line for line in lines_of(settings) if len(line.settings) > 1]
    if not lines:
        word = min((s for s in settings if len(s.evident) > len(s.places)), default=None)
        undeclared = f"; {word} is a word until [adjusters] is declared (damperfit init writes it)"
        raise ConfigurationError(
            "no two settings differ in the clicks of one adjuster alone"
            f"{undeclared if word else ''}; {{velocity}} without {{force}} shows the forces of all",
            velocity=Option("velocity"),
            force=Option("force"),
            code="one-setting",
        )
    on_stroke = [row for row in forces if row.stroke == question.stroke]
    return tuple(
        which_setting(on_stroke, force, line=line, stages=run.settings, damper=run.damper)
        for line in lines
    )


def _force_notes(run: Run, forces: Sequence[Force], credible: Sequence[Force]) -> Iterator[Problem]:
    """Yield which forces are extrapolated, cavitate or are measured, and where peaks differ."""
    untested = {force.setting: force.speed for force in credible if not force.is_tested}
    if untested:
        stages = [stage for stage in run.settings if stage.setting in untested]
        top = min(stage.top_speed for stage in stages)
        text = (
            f"{max(untested.values()):g} m/s was never tested at {of_settings(untested)} (tested: "
            f"up to {top:.3g} m/s): the force there is the model's, extrapolated; from the tested "
            "speed on it may rise by half of that or twice, which its interval holds"
        )
        yield note("extrapolated", text)
        if loose := [f.setting for f in credible if not (f.is_tested or f.is_determined)]:
            reached = min(determined_speed(stage, run.damper) for stage in stages)
            text = (
                f"the logs do not determine the force there at {of_settings(dict.fromkeys(loose))}:"
                f" within 5 % it is known up to {reached:.3g} m/s; the intervals are what is left "
                "open"
            )
            yield note("not-determined", text)
    if empty := [force for force in forces if force.is_cavitating]:
        text = (
            f"a chamber cavitates from {min(force.speed for force in empty):g} m/s on at "
            f"{of_settings(dict.fromkeys(force.setting for force in empty))}: the forces there are "
            "the model's with an empty chamber"
        )
        yield note("cavitation", text)
    if missed := [force for force in credible if force.is_measured and force.disagrees]:
        worst = max(missed, key=lambda force: abs(force.difference / force.measured_force))
        text = (
            "the model misses measured forces at "
            f"{of_settings(dict.fromkeys(force.setting for force in missed))}, most by "
            f"{100.0 * abs(worst.difference / worst.measured_force):.2g} % at {worst.speed:g} m/s "
            f"in {STROKE_WORDS[worst.stroke]} (setting {worst.setting}): measured forces are given "
            "at those speeds"
        )
        yield note("model-misses", text)
    peaks = [
        (abs(reading.peak - reading.force), reading, force)
        for force in credible
        if (reading := force.measured) is not None and reading.peak_differs
    ]
    if peaks:
        _, reading, force = max(peaks, key=lambda peak: peak[0])
        text = (
            f"the largest force of a segment is not that at its peak speed, most at setting "
            f"{force.setting} in {STROKE_WORDS[force.stroke]} at {force.speed:g} m/s: "
            f"{reading.peak:.4g} N for {reading.force:.4g} N; measured forces are those at the "
            "peak speed"
        )
        yield note("peaks-differ", text)


# Curves that were measured without time: forces by curve, and which curve gives a force


@dataclass(frozen=True, repr=False, eq=False)
class CurveForces(_Forces):
    """Forces of measured curves at some speeds, and the answer where one is asked."""

    paths: tuple[Path, ...]
    question: Question
    curves: tuple[ForceCurve, ...]  # as the files have them
    speeds: tuple[float, ...]  # m/s, positive
    sentence: str  # which curve gives the wanted force; empty where none was asked for

    @property
    def notes(self) -> tuple[str, ...]:  # type: ignore[override]
        """What to know of the curves."""
        return tuple(dict.fromkeys(note for curve in self.curves for note in curve.notes))

    def document(self) -> dict[str, Any]:
        """Return the forces by curve, stroke and speed that were reached, as JSON values."""
        question = self.question
        document: dict[str, Any] = json_values(
            {
                "source": ", ".join(map(str, self.paths)),
                "question": None if question.force is None else to_record(question),
                "sentence": self.sentence or None,
                "forces": [
                    {"curve": curve.label, "stroke": side, "speed_m_per_s": speed, "force_N": force}
                    for curve in self.curves
                    for side in STROKES
                    for speed in self.speeds
                    if math.isfinite(force := curve.force_at(speed, side))
                ],
            }
        )
        return document

    def sheets(self) -> tuple[Sheet, ...]:
        """Return the forces of the fastest speeds by curve."""
        return (curve_forces_sheet(self.curves, self.speeds[-5:]),)


def measured_forces(
    paths: Sequence[Path], question: Question, *, reading: ReadOptions
) -> CurveForces:
    """Return the forces of curves without time, and the answer to a question."""
    curves = tuple(curve for path in paths for curve in read_curves(path, reading))
    files = Counter(label for _, label in {(curve.path, curve.label) for curve in curves})
    curves = tuple(  # the file's name before labels that several files use
        replace(curve, label=f"{curve.name} {curve.label}") if files[curve.label] > 1 else curve
        for curve in curves
    )
    strokes = (question.stroke,) if question.stroke else STROKES
    tops = [float(v.max()) for c in curves for s in strokes if len(v := c.points(s)[0])]
    speeds = tuple(speed for speed in NAMED_SPEEDS if speed <= max(tops, default=0.0))
    if question.speed is not None:
        speeds = (question.speed,)
    forces = [
        (force, curve.label)
        for curve in curves
        for stroke in strokes
        for speed in speeds
        if math.isfinite(force := curve.force_at(speed, stroke))
    ]
    if not forces:
        place = f"{question.speed:g} m/s" if question.speed else "the named test speeds"
        side = f" in {STROKE_WORDS[question.stroke]}" if question.stroke else ""
        names = ", ".join(path.name for path in paths)
        raise ConfigurationError(
            f"no curve of {names} has points on both sides of it{side}; the highest "
            f"measured speed is {max(tops, default=0.0):.3g} m/s",
            subject=place,
            code="no-speed",
        )
    sentence = "" if question.force is None else _answer(question, question.force, forces)
    return CurveForces(tuple(paths), question, curves, speeds, sentence)


def _answer(question: Question, target: float, forces: Sequence[tuple[float, str]]) -> str:
    """Say between which curves a force lies; labels need no order for that."""
    aim = (
        f"{target:.5g} N in {STROKE_WORDS[question.stroke or 'rebound']} at {question.speed:g} m/s"
    )
    below = max((point for point in forces if point[0] <= target), default=None)
    above = min((point for point in forces if point[0] >= target), default=None)
    if below is None or above is None:
        force, label = above or below or (math.nan, "")
        return f"{aim}: no curve gives it; the nearest is {label} with {force:.5g} N"
    if below[0] == above[0]:
        return f"{aim}: {below[1]} gives it"
    force, label = min(below, above, key=lambda point: abs(point[0] - target))
    return (
        f"{aim}: between {below[1]} with {below[0]:.5g} N and {above[1]} with {above[0]:.5g} N; "
        f"nearest is {label} ({force - target:+.3g} N)"
    )
