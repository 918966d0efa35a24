"""Two runs compared: the whole story."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

from damperfit.adjustment.force_at import REPEATS, named_speeds
from damperfit.comparison.circumstances import (
    Circumstance,
    circumstances,
    identical_settings,
    missed_notes,
)
from damperfit.comparison.forces import (
    SAME_MOTION,
    by_repeats,
    comparable_quantities,
    figure_lines,
    figure_readings,
    force_readings,
    measured_readings,
    parameter_readings,
    repeat_scatter,
    tare_notes,
)
from damperfit.comparison.reading import (
    Difference,
    Reading,
    Sameness,
    Topic,
    compared,
    outcome_of,
    surely_different,
)
from damperfit.errors import ConfigurationError, mishap_of
from damperfit.identification.sharing import listed_settings, of_settings
from damperfit.problem import Option
from damperfit.units.shown_units import SI

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence
    from pathlib import Path

    from damperfit.adjustment.force_at import Sine
    from damperfit.comparison.run import ComparedRun
    from damperfit.problem import Failure
    from damperfit.results import Run
    from damperfit.tested.setting import Setting
    from damperfit.units.shown_units import ShownUnits

__all__ = ["ComparisonOptions", "RunComparison", "compare_runs"]

_EACH, _CONSTANT = "the motion of each test", "constant speed"
_FEW_REPEATS = 3  # fewer tell little of a scatter
_Tables = tuple[dict[Topic, Reading], ...]


@dataclass(frozen=True, slots=True)
class ComparisonOptions:
    """What is compared.

    Attributes
    ----------
    sine : Sine or None
        Whose peak speed the named test speeds go up to; None: the slower test's.
    speeds : tuple of float
        m/s, positive; none: the named test speeds.
    is_measured : bool
        Measured curves alone, without a model.
    jobs : int
        Threads.
    units : ShownUnits
        In which forces and speeds are told in words; every number stays SI.
    names : mapping of pathlib.Path to str
        What runs are called whose folders mean nothing to a reader.
    """

    sine: Sine | None = None
    speeds: tuple[float, ...] = ()
    is_measured: bool = False
    jobs: int = 1
    units: ShownUnits = SI
    names: Mapping[Path, str] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, eq=False)
class RunComparison:
    """Two runs beside each other.

    Attributes
    ----------
    first, second : ComparedRun
        The reference and the other.
    repeats : tuple of ComparedRun
        Of the reference, whose scatter is the measure; empty: the errors of both are.
    circumstances : tuple of Circumstance
        What they differ in besides.
    settings : tuple of Setting
        That both have.
    motion : str
        At which forces are compared, for people.
    lines : tuple of Difference
        Measured forces, forces, parameters, figures.
    identical : tuple of Setting
        At which both have the same logs, byte for byte.
    notes : tuple of str
        What a reader must know; nothing is missing.
    remarks : tuple of str
        What could not be compared.
    traces : tuple of str
        Where internal errors happened.
    units : ShownUnits
        In which people want it told.
    """

    first: ComparedRun
    second: ComparedRun
    repeats: tuple[ComparedRun, ...]
    circumstances: tuple[Circumstance, ...]
    settings: tuple[Setting, ...]
    motion: str
    lines: tuple[Difference, ...]
    identical: tuple[Setting, ...] = ()
    notes: tuple[str, ...] = ()
    remarks: tuple[str, ...] = ()
    traces: tuple[str, ...] = ()
    units: ShownUnits = SI

    def of(self, kind: str) -> tuple[Difference, ...]:
        """Return the lines of a kind: "measured", "force", "parameter" or "figure"."""
        return tuple(line for line in self.lines if line.subject.kind == kind)

    @property
    def sentences(self) -> tuple[str, ...]:
        """The outcome in words: what was measured first, then forces and parameters."""
        measured: tuple[Difference, ...] = self.of("measured")
        if measured:
            measured += tuple(one for one in self.of("figure") if one.is_measured)
        groups = [
            (measured, "measured forces and energies"),
            (self.of("force"), "forces"),
            (self.of("parameter"), "parameters"),
        ]
        told = []
        if self.identical and len(self.identical) == len(self.settings):
            told = ["measured: identical, both have the same logs, byte for byte"]
            groups = groups[1:]
        told += [outcome_of(lines, words, self.units) for lines, words in groups if lines]
        return tuple(told)

    @property
    def is_without_model(self) -> bool:
        """Whether measured curves alone are compared."""
        return self.motion == _EACH

    @property
    def forces_title(self) -> str:
        """What forces are compared, as in "forces as measured at the motion of each test"."""
        forces = self.of("force")
        is_measured = bool(forces) and all(line.is_measured for line in forces)
        motion = self.units.say_lengths(self.motion)
        return f"forces {'as measured ' if is_measured else ''}at {motion}"

    @property
    def differing(self) -> tuple[str, ...]:
        """Sentences of what else differs, which may be the reason."""
        return tuple(one.sentence for one in self.circumstances if not one.is_alike)

    @property
    def to_know(self) -> tuple[str, ...]:
        """Sentences of what both have in common, and the notes."""
        alike = tuple(one.sentence for one in self.circumstances if one.is_alike)
        return (*alike, *self.notes)


def compare_runs(
    first: ComparedRun,
    second: ComparedRun,
    options: ComparisonOptions = ComparisonOptions(),
    *,
    repeats: Sequence[ComparedRun] = (),
) -> RunComparison:
    """Return a run beside the reference.

    Parameters
    ----------
    first, second : ComparedRun
        The reference and the other.
    options : ComparisonOptions
        What is compared.
    repeats : sequence of ComparedRun
        Further runs of the reference: their scatter is then the measure.

    Raises
    ------
    ConfigurationError
        They have no setting in common, or no motion reaches the speeds that were asked for.
    """
    runs = (first, *repeats, second)
    settings = _common(runs)
    mishaps: list[Failure] = []

    def take(setting: Setting, error: Exception) -> None:
        mishaps.append(mishap_of(error, f"simulating setting {setting}"))

    fitted = [run.fitted for run in runs if run.fitted is not None]
    if options.is_measured or len(fitted) < len(runs):
        motion = _EACH
        forces = measured_readings(runs, settings, speeds=options.speeds)
        measured: _Tables = tuple({} for _ in runs)
        is_same = True
        parameters: _Tables = tuple({} for _ in runs)
        of_figures: Iterator[Difference] = iter(())
    else:
        motion = _CONSTANT
        speeds = _speeds(fitted, options)
        forces = force_readings(runs, settings, speeds=speeds, on_error=take)
        measured = measured_readings(runs, settings, kind="measured")
        parameters = parameter_readings(fitted, settings)
        is_same = _is_one_test(fitted)
        of_figures = figure_lines(fitted[0], fitted[-1], settings)
    figures = figure_readings(runs, settings)
    merged: _Tables = tuple(
        {**a, **b, **c, **d}
        for a, b, c, d in zip(measured, forces, parameters, figures, strict=True)
    )
    if not any(merged[0]):
        raise ConfigurationError(
            f"{first.place} and {second.place}: nothing can be compared at setting "
            f"{listed_settings(settings)}: no motion is common to both"
        )
    identical = tuple(identical_settings(runs, settings))
    lines = tuple(_identical(one, identical) for one in _lines(merged, is_same_motion=is_same))
    return RunComparison(
        first,
        second,
        tuple(repeats),
        circumstances(first, second, options.units),
        settings,
        motion,
        (*lines, *of_figures),
        identical,
        notes=(
            *_on_repeats(repeats),
            *_not_compared(settings, lines),
            *_untested(fitted, lines, options.units),
            *_notes(runs, forces, lines, options.units),
        ),
        remarks=tuple(dict.fromkeys(one.message for one in mishaps)),
        traces=tuple(one.trace for one in mishaps if one.trace),
        units=options.units,
    )


def _lines(tables: _Tables, *, is_same_motion: bool) -> tuple[Difference, ...]:
    *reference, other = tables
    means = reference[0]
    if len(reference) > 1:
        means, other = by_repeats(reference, other)
    found = [
        compared(subject, means[subject], second, is_same_motion=is_same_motion)
        for subject, second in other.items()
        if subject in means
    ]
    kinds = dict.fromkeys(line.subject.kind for line in found)
    # What is asked of the forces and of the parameters are two questions.
    return tuple(
        line
        for kind in kinds
        for line in surely_different([one for one in found if one.subject.kind == kind])
    )


def _identical(line: Difference, settings: Sequence[Setting]) -> Difference:
    """Return what was measured of the same logs as the same, whatever a filter has made of it."""
    if not line.is_measured or line.subject.setting not in settings:
        return line
    return replace(line, verdict=Sameness.SAME, is_sure=False, words="identical: the same logs")


def _common(runs: Sequence[ComparedRun]) -> tuple[Setting, ...]:
    known = [set(run.settings) for run in runs]
    common = tuple(setting for setting in runs[0].settings if all(setting in s for s in known))
    if not common:
        said = "; ".join(f"{run.place} has {_listed(run)}" for run in runs[:3])
        raise ConfigurationError(f"no setting is common to all: {said}")
    return common


def _listed(run: ComparedRun) -> str:
    return of_settings(run.settings) if run.settings else "none"


def _is_near(a: Sine, b: Sine) -> bool:
    ratios = (a.amplitude / b.amplitude, a.frequency / b.frequency)
    return all(abs(ratio - 1.0) <= SAME_MOTION for ratio in ratios)


def _is_one_test(fitted: Sequence[Run]) -> bool:
    """Whether all were tested with one motion: what each model misses there was measured."""
    return all(_is_near(one.motion, fitted[0].motion) for one in fitted)


def _speeds(fitted: Sequence[Run], options: ComparisonOptions) -> tuple[float, ...]:
    """Return the speeds asked for, else the named ones that the sine or all tests have reached."""
    if options.speeds:
        return options.speeds
    top = min(run.motion.peak_speed for run in fitted)
    if options.sine is not None:
        top = options.sine.peak_speed
    if not (speeds := named_speeds(top)):
        raise ConfigurationError(
            f"none is reached by {top:.3g} m/s; give {{velocity}}",
            velocity=Option("velocity"),
            subject="the named test speeds",
        )
    return speeds


def _on_repeats(repeats: Sequence[ComparedRun]) -> Iterator[str]:
    if 0 < len(repeats) < _FEW_REPEATS:
        n = len(repeats) + 1
        yield (
            f"the scatter of A is that of {n} runs, {n - 1} degree{'s' * (n > 2)} of freedom: "
            f"intervals are {'six times' if n == 2 else 'twice'} as wide as those of many would be"
        )


def _not_compared(settings: Sequence[Setting], lines: Sequence[Difference]) -> Iterator[str]:
    compared = {line.subject.setting for line in lines if line.subject.kind == "force"}
    lost = [one for one in settings if compared and one not in compared]
    if lost:
        yield f"{of_settings(lost)}: no motion is common to both: not compared"


def _untested(
    fitted: Sequence[Run], lines: Sequence[Difference], units: ShownUnits
) -> Iterator[str]:
    """Say which forces are at a speed that not every run has tested."""
    top = min((stage.top_speed for run in fitted for stage in run.settings), default=math.inf)
    speeds = {line.subject.speed for line in lines if not line.is_measured} - {None}
    beyond = sorted(speed for speed in speeds if speed and speed > (1.0 + REPEATS) * top)
    if beyond:
        listed = ", ".join(units.write_speed(speed) for speed in beyond)
        reached = units.write_speed(float(f"{top:.3g}"))
        yield (
            f"{listed} was never tested (tested: up to {reached}): the forces there are the "
            "models', extrapolated"
        )


def _notes(
    runs: Sequence[ComparedRun], tables: _Tables, lines: Sequence[Difference], units: ShownUnits
) -> Iterator[str]:
    for run in runs:
        yield from (f"{run.name}: {note}" for note in run.notes)
        share, freedom = repeat_scatter(run)
        if share:
            yield (
                f"{run.name}: tests of one setting differ by {100.0 * share:.2g} % of the damping "
                f"beyond their noise ({freedom:.0f} degrees of freedom): counted in the errors of "
                "forces, energy and hysteresis, not in those of parameters"
            )
        if run.fitted is not None and not run.fitted.speed_forces:
            yield (
                f"{run.name}: what the model misses of the measured force is not known (an older "
                "version, or no motion repeats): it is not in the errors of forces"
            )
    fitted = [run.fitted for run in runs if run.fitted is not None]
    forces = [line for line in lines if line.subject.kind == "force"]
    if len(fitted) == len(runs) and forces:
        yield from missed_notes(runs, tables, forces, units)
        yield from tare_notes(runs, [one.subject.setting for one in forces if one.subject.setting])
        if not comparable_quantities(fitted):
            yield "fitted with different models: no parameter is common to both"
