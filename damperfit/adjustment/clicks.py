"""The settings of a campaign compared: trends, forces, and what one click changes.

The offset of a setting is the rig's, and no part of what a click does. The error of a shared
parameter is the same at both settings (`force_at`).
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from damperfit.adjustment.between import BEND, BENDS, LEAST, MOST, SMOOTH, Between
from damperfit.adjustment.force_at import (
    MEASURED,
    MODEL,
    STROKE_WORDS,
    Force,
    Stage,
    credible_forces,
    force_at,
    named_speeds,
    offset_sentence,
    stage_of,
)
from damperfit.adjustment.trends import Trend, find_trends
from damperfit.arrays import FloatArray
from damperfit.identification.procedures import Campaign
from damperfit.simulation import NAMED_SPEEDS
from damperfit.statistics import NORMAL_95
from damperfit.tested.setting import ADJUSTER, Setting, SettingLine, lines_of
from damperfit.units.shown_units import SI, ShownUnits

if TYPE_CHECKING:
    from damperfit.damper.model import Model
    from damperfit.errors import OnError
    from damperfit.uncertainty.assessment import Assessment


@dataclass(frozen=True, slots=True)
class Click:
    """Change of force from one setting to the next one that was fitted, with 95 % intervals."""

    first: Setting
    second: Setting  # more than one click on where settings in between have no fit
    speed: float  # m/s, positive
    stroke: str
    change: float  # N, both without their offset; negative in bump means a harder bump
    low: float
    high: float
    # How much harder, in per cent of the first one's damping: of the force less the gas force at
    # mid-stroke and the offset. NaN where that is nothing.
    percent: float
    percent_low: float
    percent_high: float
    adjuster: str = ADJUSTER  # which was turned; the others are held


def clicks(forces: Sequence[Force]) -> tuple[Click, ...]:
    """Return the change of force between settings that differ by the next click of one adjuster."""
    by_setting = {
        setting: sorted(group, key=lambda force: force.speed)
        for setting, group in itertools.groupby(forces, lambda force: force.setting)
    }
    return tuple(
        _click(first, second, line.adjuster)
        for line in lines_of(by_setting)
        for pair in itertools.pairwise(line.settings)
        for first, second in zip(*(by_setting[setting] for setting in pair), strict=True)
    )


def _click(first: Force, second: Force, adjuster: str) -> Click:
    def spread(ratio: float) -> float:
        """Standard error of second - ratio first; NaN where one of both is not known."""
        if len(first.carried) != len(second.carried):
            return math.nan
        alone = math.hypot(second.rest, second.misfit, ratio * first.rest, ratio * first.misfit)
        return math.hypot(alone, *(second.carried - ratio * first.carried))

    change, damping = second.bare_force - first.bare_force, first.damping or math.nan
    reach = NORMAL_95 * spread(1.0)
    if math.isfinite(reach):
        # What the logs do not determine may be at its lower limit at one setting and at its upper
        # at the other; beyond the tests both have one law.
        reach = max(reach, *first.undetermined, *second.undetermined, abs(second.rise - first.rise))
    ratio = 1.0 + change / damping
    percent = 100.0 * (ratio - 1.0)
    # The first force is the denominator too: its error counts 1 + share times.
    share = 100.0 * NORMAL_95 * spread(ratio) / abs(damping)
    limits = (change, change - reach, change + reach, percent, percent - share, percent + share)
    return Click(first.setting, second.setting, first.speed, first.stroke, *limits, adjuster)


@dataclass(frozen=True, slots=True)
class Adjustment:
    """What settings show only together."""

    trends: tuple[Trend, ...] = ()  # one for each parameter that was fitted setting by setting
    # By setting, named speed and stroke: of one origin at a speed and stroke.
    forces: tuple[Force, ...] = ()
    clicks: tuple[Click, ...] = ()  # change of the forces between neighbouring settings

    @property
    def of_offset(self) -> tuple[str, ...]:
        """A note on the rigs' offsets in forces by setting; empty where there are none."""
        holds_gas = any(force.holds_gas for force in self.forces)
        sentence = offset_sentence([force.tare for force in self.forces], holds_gas=holds_gas)
        return (f"forces by setting: {sentence}",) if sentence else ()


def compare_settings(
    campaign: Campaign,
    assessment: Assessment,
    damper: Model,
    *,
    speeds: Sequence[float] = NAMED_SPEEDS,
    on_error: OnError | None = None,
) -> Adjustment:
    """Compare the settings of a campaign, forces at those speeds, m/s, that were reached."""
    if not campaign.fits:
        return Adjustment()
    stages = [stage_of(fit, assessment) for fit in campaign.fits]
    reached = named_speeds(max(stage.top_speed for stage in stages), speeds)
    measured = assessment.forces
    forces = credible_forces(
        force_at(stages, damper, reached, measured=measured, on_error=on_error)
    )
    uncertainties = {errors.setting: errors for errors in assessment.uncertainties}
    return Adjustment(find_trends(campaign.fits, uncertainties), forces, clicks(forces))


# Which setting gives a wanted force: forces by setting, inverted.
#
# Between fitted settings the force is that of the damper whose areas and preloads lie between
# theirs (`damperfit.adjustment.between`). The interval of an answer is where the wanted force lies
# within the force's 95 % interval; between settings that are more than one click apart, where
# nothing was measured, it is widened by how far from the answer other curves have the force. Two
# settings alone show no curve, so that the interval is the whole gap. How many intervals hold
# the truth: `python -m tests.adjustment.gap_coverage`.
#
# A force that the model does not reach and the measured forces do is answered by these.

# No answer is shown closer, however narrow its interval.
_FINEST = 0.01
# An adjuster that changes a force by less does not move it.
_STILL = 1e-3
# In a gap the curve is sampled in so many steps a click, at least and at most.
_A_CLICK, _FEWEST, _MOST = 8, 8, 32


class Answer(NamedTuple):
    """One position of the adjuster that gives the wanted force, and its fitted neighbours."""

    position: float  # in settings; a whole number where a setting gives it exactly
    # 95 % interval of the position, NaN where no errors are known; it ends at the first and the
    # last setting.
    low: float
    high: float
    nearest: Setting  # the fitted setting beside it whose force is nearest
    below: Setting  # the fitted settings on both sides, the same where `position` is one
    above: Setting
    force_below: float  # N
    force_above: float
    # What the logs do not determine there and moves the answer, as "rebound opening at 6".
    undetermined: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Wanted:
    """The positions that give a force, N, positive in rebound."""

    force: float
    speed: float  # m/s
    stroke: str
    # By rising position; none when the force is out of reach, several when the force does not rise
    # or fall throughout.
    answers: tuple[Answer, ...]
    # Setting and force of the least and of the greatest force that the settings reach; in bump the
    # hardest is the most negative one.
    weakest: tuple[Setting, float]
    hardest: tuple[Setting, float]
    adjuster: str = ADJUSTER  # which is turned
    held: str = ""  # where the other adjusters stand, for people; empty where there are none
    origin: str = MODEL  # of the forces by setting
    gas: float = math.nan  # force of the gas that is in them; NaN: none that is known
    without_gas: bool = False  # it is taken out of them

    @property
    def sentence(self) -> str:
        """For people, in newtons and metres a second."""
        return wanted_sentences((self,))[0]

    def gas_out(self) -> Wanted:
        """Return the same with the gas force taken out of all its forces."""
        answers = (
            answer._replace(
                force_below=answer.force_below - self.gas, force_above=answer.force_above - self.gas
            )
            for answer in self.answers
        )
        return replace(
            self,
            force=self.force - self.gas,
            answers=tuple(answers),
            weakest=(self.weakest[0], self.weakest[1] - self.gas),
            hardest=(self.hardest[0], self.hardest[1] - self.gas),
            gas=math.nan,
            without_gas=True,
        )

    @property
    def is_still(self) -> bool:
        """Whether the adjuster does not move the force."""
        (_, least), (_, most) = self.weakest, self.hardest
        return abs(most - least) <= _STILL * abs(least)

    def words(self, units: ShownUnits) -> str:
        """Return the answers in words and units for people."""
        if self.is_still:
            force = units.write(self.weakest[1], "N", ".5g")
            return f"{self.adjuster} does not change it: {force} at every setting tested"
        if not self.answers:
            harder = abs(self.force - self.hardest[1]) < abs(self.force - self.weakest[1])
            setting, force_there = self.hardest if harder else self.weakest
            side = "more than the hardest" if harder else "less than the weakest"
            gas = f", gas force {units.write(self.gas, 'N', '.4g')} in it" * math.isfinite(self.gas)
            return (
                f"no setting gives it; it is {side}, setting {setting} with "
                f"{units.write(force_there, 'N', '.5g')}{gas}"
            )
        count = f"{len(self.answers)} answers, " * (len(self.answers) > 1)
        return count + "; or ".join(
            _words(answer, self.force, self.adjuster, units) for answer in self.answers
        )


def wanted_sentences(lines: Sequence[Wanted], units: ShownUnits = SI) -> tuple[str, ...]:
    """Return a sentence an adjuster; one for all where no setting gives the force."""
    by_adjuster: dict[str, list[Wanted]] = {}
    has_answer = any(line.answers for line in lines)
    for line in lines:
        by_adjuster.setdefault(line.adjuster if has_answer else "", []).append(line)
    return tuple(_sentence(group, units, has_answer=has_answer) for group in by_adjuster.values())


def _sentence(lines: Sequence[Wanted], units: ShownUnits, *, has_answer: bool) -> str:
    first, *others = lines
    text = f"{units.write(first.force, 'N', '.5g')} in {STROKE_WORDS[first.stroke]} at "
    text += units.write_speed(first.speed) + ", as measured" * (first.origin == MEASURED)
    text += ", without the gas force" * first.without_gas
    if not others:
        along = f", along {first.adjuster} with {first.held}" * bool(first.held)
        return f"{text}{along}: {first.words(units)}"
    if has_answer and all(line.is_still for line in lines):
        return f"{text}: {first.adjuster} does not change it"
    answered = [line for line in lines if line.answers]
    if answered:
        words = [f"with {line.held}: {line.words(units)}" for line in answered]
        if unanswered := [line.held for line in lines if line not in answered]:
            words.append(f"none with {' or '.join(unanswered)}")
        return f"{text}, along {first.adjuster} {'; '.join(words)}"
    extremes = [extreme for line in lines for extreme in (line.weakest, line.hardest)]
    weakest, *_, hardest = sorted(
        extremes, key=lambda extreme: extreme[1], reverse=first.stroke == "bump"
    )
    if has_answer:
        return f"{text}, along {first.adjuster}: no setting gives it"
    if (first.force - weakest[1]) * (first.force - hardest[1]) < 0.0:  # between two lines
        return f"{text}: no setting gives it"
    return f"{text}: {replace(first, weakest=weakest, hardest=hardest).words(units)}"


def _words(answer: Answer, target: float, adjuster: str, units: ShownUnits) -> str:
    below, above = (units.write(f, "N", ".5g") for f in (answer.force_below, answer.force_above))
    places = tuple(setting.number(adjuster) or 0.0 for setting in (answer.below, answer.above))
    has_gap = places[1] - places[0] > 1
    interval = ""
    if math.isfinite(answer.low):
        interval = f" (95 % from {answer.low:.2f} to {answer.high:.2f})"
        if has_gap and (answer.low, answer.high) == places:
            interval = (
                f" (anywhere from {answer.low:g} to {answer.high:g}: two settings do not show how "
                "the force changes between them)"
            )
        elif max(answer.high - answer.position, answer.position - answer.low) < _FINEST:
            interval = f" (95 % within {_FINEST:g})"
    if answer.undetermined:
        interval += f" (not determined there: {', '.join(answer.undetermined)})"
    if answer.below == answer.above:
        return f"setting {answer.below}{interval}, which gives {below}"
    text = (
        f"{adjuster} {answer.position:.2f}{interval}, between {answer.below} ({below}) and "
        f"{answer.above} ({above})"
    )
    force = answer.force_below if answer.nearest == answer.below else answer.force_above
    nearest = f"{answer.nearest} ({units.write(force - target, 'N', '+.3g')})"
    if not has_gap:
        return f"{text}; nearest is {nearest}"
    text += ", none tested between them"
    click = round(answer.position)
    if click in places:
        return f"{text}; nearest tested is {nearest}"
    turned = {adjuster: click}
    label = Setting(tuple((name, turned.get(name, place)) for name, place in answer.below.places))
    return f"{text}; nearest is {label}, nearest tested {nearest}"


def which_setting(
    forces: Sequence[Force],
    force: float,
    *,
    line: SettingLine | None = None,
    stages: Sequence[Stage] = (),
    damper: Model | None = None,
) -> Wanted:
    """Return the settings at which a force is reached, of forces at one speed and stroke.

    Between settings the force is the damper's with values between those of the stages; without
    these the forces themselves are interpolated.
    """
    line = line or lines_of(f.setting for f in forces)[0]
    on_line = [f for f in forces if f.setting in line.numbers]
    result = _Curve(on_line, line, stages, damper).wanted(force)
    measured = [f.as_measured for f in on_line if f.measured is not None]
    if not result.answers and len(measured) > 1:
        as_measured = _Curve(measured, line, stages, damper).wanted(force)
        return as_measured if as_measured.answers else result
    return result


class _Curve:
    """Force over the clicks of one adjuster."""

    def __init__(
        self,
        forces: Sequence[Force],
        line: SettingLine,
        stages: Sequence[Stage],
        damper: Model | None,
    ) -> None:
        self.line, self.ordered = line, sorted(forces, key=lambda f: line.numbers[f.setting])
        self.places = np.array([line.numbers[force.setting] for force in self.ordered])
        self.forces = np.array([force.force for force in self.ordered])
        reaches = [max(force.high - force.force, force.force - force.low) for force in self.ordered]
        self.reaches = np.array(reaches)
        by_setting = {stage.setting: stage for stage in stages}
        on_line = [by_setting[f.setting] for f in self.ordered if f.setting in by_setting]
        self.between = Between(
            damper if len(on_line) == len(self.ordered) else None,
            on_line,
            self.places,
            self.forces,
            speed=self.ordered[0].speed,
            stroke=self.ordered[0].stroke,
        )
        self._samples: dict[tuple[int, str], tuple[FloatArray, FloatArray]] = {}

    def wanted(self, force: float) -> Wanted:
        """Answer where the curve has a force, else a setting that has it within its interval."""
        sign = -1.0 if self.ordered[0].stroke == "bump" else 1.0
        weakest, *_, hardest = sorted(self.ordered, key=lambda f: sign * f.force)
        exact = self.places[self.forces == force].tolist()
        off = self.forces - force
        for gap in np.flatnonzero(off[:-1] * off[1:] < 0.0).tolist():
            roots = self.crossings(force, [gap])  # of an odd number that in the middle
            exact.append(roots[len(roots) // 2])
        within = np.abs(off) - self.reaches
        near = self.places[[int(np.argmin(within))]].tolist() if within.min() <= 0.0 else []
        return Wanted(
            force=force,
            speed=weakest.speed,
            stroke=weakest.stroke,
            answers=tuple(self.answer(position, force) for position in sorted(exact or near)),
            weakest=(weakest.setting, weakest.force),
            hardest=(hardest.setting, hardest.force),
            adjuster=self.line.adjuster,
            held=self.line.held,
            origin=weakest.origin,
            gas=weakest.gas,
        )

    def samples(self, gap: int, kind: str = SMOOTH) -> tuple[FloatArray, FloatArray]:
        """Positions in a gap, both ends among them, and the forces there by a curve of a kind."""
        if (gap, kind) not in self._samples:
            ends = self.places[gap], self.places[gap + 1]
            steps = min(max(_A_CLICK * math.ceil(ends[1] - ends[0]), _FEWEST), _MOST)
            at = np.linspace(*ends, steps + 1)
            forces = self.between.forces(at, kind)
            forces[[0, -1]] = self.forces[gap : gap + 2]
            self._samples[gap, kind] = at, forces
        return self._samples[gap, kind]

    def crossings(self, force: float, gaps: Iterable[int], kind: str = SMOOTH) -> list[float]:
        """Every place in those gaps where the curve passes a force."""
        roots: list[float] = []
        for gap in gaps:
            at, forces = self.samples(gap, kind)
            off = forces - force
            k = np.flatnonzero((off[:-1] < 0.0) != (off[1:] < 0.0))
            roots += (at[k] - off[k] * (at[k + 1] - at[k]) / (off[k + 1] - off[k])).tolist()
        return roots

    def answer(self, position: float, force: float) -> Answer:
        """Return a position of the curve with its interval and its neighbours."""
        above = int(np.searchsorted(self.places, position))
        below = above if self.places[above] == position else above - 1
        ends = float(self.places[below]), float(self.places[above])
        gap = ends[1] - ends[0]
        share = (position - ends[0]) / (gap or 1.0)
        reach = (1.0 - share) * self.reaches[below] + share * self.reaches[above]
        low = high = math.nan
        undetermined: tuple[str, ...] = ()
        if math.isfinite(reach):
            edges: list[float] = []
            if len(self.places) > 2 or gap <= 1.0:  # two settings show no curve
                neighbours = {above - 1, above} & {*range(len(self.places) - 1)}
                for end in (force - reach, force + reach):
                    off = self.forces - end
                    crossed = np.flatnonzero(off[:-1] * off[1:] <= 0.0).tolist()
                    edges += self.crossings(end, {*crossed, *neighbours})
            low = max((s for s in edges if s < position), default=float(self.places[0]))
            high = min((s for s in edges if s > position), default=float(self.places[-1]))
            if gap > 1.0:
                down, up, undetermined = self.hidden(position, force, below)
                low = min(low, max(ends[0], low - down))
                high = max(high, min(ends[1], high + up))
        nearest = min(below, above, key=lambda k: abs(self.forces[k] - force))
        closest, first, second = (
            Setting.of(self.ordered[k].setting) for k in (nearest, below, above)
        )
        forces = float(self.forces[below]), float(self.forces[above])
        return Answer(position, low, high, closest, first, second, *forces, undetermined)

    def hidden(
        self, position: float, force: float, gap: int
    ) -> tuple[float, float, tuple[str, ...]]:
        """How far a position in a gap may be lower and higher, and what is not determined there."""
        shifts = {
            kind: [root - position for root in self.crossings(force, [gap], kind)]
            for kind in self.between.kinds[1:]
        }
        bend = max((abs(step) for kind in BENDS for step in shifts.get(kind, ())), default=0.0)
        extremes = [0.0, *(step for kind in (LEAST, MOST) for step in shifts.get(kind, ()))]
        down, up = -min(extremes), max(extremes)
        undetermined = self.between.undetermined(gap, position) if max(down, up) > _FINEST else ()
        return max(BEND * bend, down), max(BEND * bend, up), undetermined
