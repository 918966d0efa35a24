"""Which setting gives a wanted force: the forces by setting, read the other way round.

Between fitted settings the force follows a monotone cubic (PCHIP), which never leaves the forces of
the two neighbours. The interval of an answer is where the wanted force lies within the force's
95 % interval; between settings that are more than one click apart half of that interval is widened
by how far the cubic lies from the straight line in that gap and the two beside it, for nothing was
measured there. Two settings alone tell no curve, so that the interval is the whole gap. Of the
shipped set with settings left out 94 to 96 of 100 hold the setting that was left out, by the cubic
at that place alone 87 to 94, of two settings none (`python -m tests.adjustment.gap_coverage`).
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from damperfit.adjustment.force_at import MEASURED, MODEL
from damperfit.tested.setting import ADJUSTER, Setting, lines_of
from damperfit.units.shown_units import SI

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from numpy.typing import NDArray
    from scipy.interpolate import PchipInterpolator

    from damperfit.adjustment.force_at import Force
    from damperfit.tested.setting import SettingLine
    from damperfit.units.shown_units import ShownUnits

    FloatArray = NDArray[np.float64]

__all__ = ["Answer", "Wanted", "which_setting"]


# Between neighbouring clicks cubic and straight line are a hundredth of a click apart: no answer is
# shown closer, however narrow its interval.
_FINEST = 0.01
# How far truth may lie from the curve: with 1.4 of how far it bends 95 of 100 intervals hold. A
# bend grows with the square of the gap; from one much narrower little is foretold: no more than
# twice.
_BEND, _WIDER = 1.4, 2.0


@dataclass(frozen=True, slots=True)
class Answer:
    """One place of the adjuster that gives the wanted force.

    Attributes
    ----------
    position : float
        In settings; a whole number where a setting gives it exactly.
    low, high : float
        95 % interval of the position, NaN where no errors are known; it ends at the first and the
        last setting.
    nearest : Setting
        The fitted setting beside it whose force is nearest.
    below, above : Setting
        The fitted settings on both sides, the same where `position` is one.
    force_below, force_above : float
        Their forces, N.
    """

    position: float
    low: float
    high: float
    nearest: Setting
    below: Setting
    above: Setting
    force_below: float
    force_above: float


@dataclass(frozen=True, slots=True)
class Wanted:
    """Where a force is found.

    Attributes
    ----------
    force : float
        The wanted force, N, positive in rebound.
    speed : float
        m/s.
    stroke : str
        "rebound" or "bump".
    answers : tuple of Answer
        By rising position; none when the force is out of reach, several when the force does not
        rise or fall throughout.
    weakest, hardest : (Setting, float)
        Setting and force of the least and of the greatest force that the settings reach, N; in
        bump the hardest is the most negative one.
    adjuster : str
        Which was looked along.
    held : str
        Where the other adjusters stand, for people; empty where there are none.
    origin : str
        Of the forces that it was looked for among.
    """

    force: float
    speed: float
    stroke: str
    answers: tuple[Answer, ...]
    weakest: tuple[Setting, float]
    hardest: tuple[Setting, float]
    adjuster: str = ADJUSTER
    held: str = ""
    origin: str = MODEL

    @property
    def sentence(self) -> str:
        """For people, in newtons and metres a second."""
        return self.said_in(SI)

    def said_in(self, units: ShownUnits) -> str:
        """Return the sentence with forces and speeds in the units that people want."""
        wanted = units.write(self.force, "N", ".5g")
        asked = f"{wanted} in {self.stroke} at {units.write_speed(self.speed)}"
        if self.origin == MEASURED:
            asked += ", as measured"
        if self.held:
            asked += f", along {self.adjuster} with {self.held}"
        if not self.answers:
            harder = abs(self.force - self.hardest[1]) < abs(self.force - self.weakest[1])
            setting, force = self.hardest if harder else self.weakest
            side = "more than the hardest" if harder else "less than the weakest"
            return (
                f"{asked}: no setting gives it; it is {side}, setting {setting} with "
                f"{units.write(force, 'N', '.5g')}"
            )
        said = "; or ".join(
            _words(answer, self.force, self.adjuster, units) for answer in self.answers
        )
        several = len(self.answers)
        return f"{asked}: {f'{several} answers, ' if several > 1 else ''}{said}"


def _gap(answer: Answer, adjuster: str) -> float:
    """How many clicks the settings on both sides are apart."""
    ends = (answer.below.number(adjuster), answer.above.number(adjuster))
    return (ends[1] or 0.0) - (ends[0] or 0.0)


def _words(answer: Answer, wanted: float, adjuster: str, units: ShownUnits) -> str:
    below, above = (units.write(f, "N", ".5g") for f in (answer.force_below, answer.force_above))
    interval = ""
    if math.isfinite(answer.low):
        ends = (answer.below.number(adjuster), answer.above.number(adjuster))
        interval = f" (95 % from {answer.low:.2f} to {answer.high:.2f})"
        if _gap(answer, adjuster) > 1 and (answer.low, answer.high) == ends:
            interval = (
                f" (anywhere from {answer.low:g} to {answer.high:g}: two settings do not show how "
                "the force changes between them)"
            )
        elif max(answer.high - answer.position, answer.position - answer.low) < _FINEST:
            interval = f" (95 % within {_FINEST:g})"
    if answer.below == answer.above:
        return f"setting {answer.below}{interval}, which gives {below}"
    said = (
        f"{adjuster} {answer.position:.2f}{interval}, between {answer.below} with {below} and "
        f"{answer.above} with {above}"
    )
    force = answer.force_below if answer.nearest == answer.below else answer.force_above
    nearest = f"{answer.nearest} ({units.write(force - wanted, 'N', '+.3g')})"
    if _gap(answer, adjuster) <= 1:
        return f"{said}; nearest is {nearest}"
    said += ", interpolated over settings without a fit"
    click = round(answer.position)
    if click in {answer.below.number(adjuster), answer.above.number(adjuster)}:
        return f"{said}; nearest of those fitted is {nearest}"
    turned = {adjuster: click}
    label = Setting(tuple((one, turned.get(one, place)) for one, place in answer.below.places))
    return f"{said}; nearest is {label}, which has no fit, and of those fitted {nearest}"


@dataclass(frozen=True, slots=True)
class _Stop:
    """A level and its place on the line of settings that is looked along."""

    at: float
    level: Force

    @property
    def force(self) -> float:
        return self.level.force

    @property
    def reach(self) -> float:
        """Half of the 95 % interval of the force, N."""
        return self.level.high - self.level.force


def which_setting(
    found: Sequence[Force], force: float, *, line: SettingLine | None = None
) -> Wanted:
    """Return the settings at which a force is reached.

    Parameters
    ----------
    found : sequence of Force
        One speed and stroke.
    force : float
        N, positive in rebound.
    line : SettingLine, optional
        Settings to look along, two or more; those of the only adjuster by default.
    """
    from scipy.interpolate import PchipInterpolator

    along = line or lines_of(level.setting for level in found)[0]
    numbers = along.numbers
    stops = [_Stop(numbers[level.setting], level) for level in found if level.setting in numbers]
    ordered = sorted(stops, key=lambda stop: stop.at)
    forces = np.array([stop.force for stop in ordered])
    curve = PchipInterpolator(np.array([stop.at for stop in ordered]), forces)
    sign = -1.0 if found[0].stroke == "bump" else 1.0
    weakest, hardest = int(np.argmin(sign * forces)), int(np.argmax(sign * forces))
    return Wanted(
        force=force,
        speed=found[0].speed,
        stroke=found[0].stroke,
        answers=tuple(
            _answer(ordered, curve, position, force)
            for position in _positions(ordered, curve, force)
        ),
        weakest=(ordered[weakest].level.setting, ordered[weakest].force),
        hardest=(ordered[hardest].level.setting, ordered[hardest].force),
        adjuster=along.adjuster,
        held=along.held,
        origin=found[0].origin,
    )


def _positions(ordered: Sequence[_Stop], curve: PchipInterpolator, force: float) -> list[float]:
    """Where the curve has the force, and an end that has it within its interval."""
    found = [stop.at for stop in ordered if stop.force == force]
    for a, b in itertools.pairwise(ordered):
        if (a.force - force) * (b.force - force) < 0.0:
            found.append(_root(curve, a.at, b.at, force))
    if not found:
        found = [stop.at for stop in ordered if abs(stop.force - force) <= stop.reach]
    return sorted(found)


def _root(curve: PchipInterpolator, low: float, high: float, force: float) -> float:
    from scipy.optimize import brentq

    return float(brentq(lambda s: float(curve(s)) - force, low, high, xtol=1e-9))


def _answer(
    ordered: Sequence[_Stop], curve: PchipInterpolator, position: float, force: float
) -> Answer:
    below = max((stop for stop in ordered if stop.at <= position), key=_at)
    above = min((stop for stop in ordered if stop.at >= position), key=_at)
    nearest = min(below, above, key=lambda stop: abs(stop.force - force))
    share = (position - below.at) / ((above.at - below.at) or 1.0)
    reach = (1.0 - share) * below.reach + share * above.reach
    first, last = ordered[0].at, ordered[-1].at
    known = math.isfinite(reach)
    ends = []
    if above.at - below.at > 1.0:
        reach += 4.0 * share * (1.0 - share) * _bend(ordered, curve, below, above)
    if len(ordered) > 2 or above.at - below.at <= 1.0:  # two tell no curve
        ends = _crossings(ordered, curve, (force - reach, force + reach))
    return Answer(
        position=position,
        low=max((s for s in ends if s < position), default=first) if known else math.nan,
        high=min((s for s in ends if s > position), default=last) if known else math.nan,
        nearest=Setting.of(nearest.level.setting),
        below=Setting.of(below.level.setting),
        above=Setting.of(above.level.setting),
        force_below=below.force,
        force_above=above.force,
    )


def _bend(ordered: Sequence[_Stop], curve: PchipInterpolator, below: _Stop, above: _Stop) -> float:
    """How far the force may lie from the curve in the middle of a gap, N: see the top."""
    at = ordered.index(below)
    beside = ordered[max(at - 1, 0) : at + 3]
    width = above.at - below.at
    shares = np.linspace(0.0, 1.0, 41)
    bends = []
    for a, b in itertools.pairwise(beside):
        straight = a.force + shares * (b.force - a.force)
        off = np.max(np.abs(curve(a.at + shares * (b.at - a.at)) - straight))
        bends.append(float(off) * min(width / (b.at - a.at), _WIDER) ** 2)
    return _BEND * max(bends)


def _crossings(
    ordered: Sequence[_Stop], curve: PchipInterpolator, forces: Iterable[float]
) -> list[float]:
    """Every place where the curve passes one of the forces."""
    return [
        _root(curve, a.at, b.at, force)
        for force in forces
        for a, b in itertools.pairwise(ordered)
        if (a.force - force) * (b.force - force) < 0.0
    ]


def _at(stop: _Stop) -> float:
    return stop.at
