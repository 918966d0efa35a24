"""Logs of one setting beside each other: duplicate tests, and tests that contradict each other.

Of the same motion their cycles are compared, of other motions the forces where their speeds meet.
"""

from __future__ import annotations

import itertools
import math
from collections import defaultdict
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from damperfit.damper.warmed import Warmed
from damperfit.errors import ContradictionError, DamperfitError
from damperfit.identification import compare, identify
from damperfit.report.facts import Failure, listed_names

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from numpy.typing import NDArray

    from damperfit.configuration.options import Configuration
    from damperfit.recording import Stretch, Trace
    from damperfit.run.logs import LogBatch
    from damperfit.tested.setting import Setting

    FloatArray = NDArray[np.float64]

__all__ = [
    "REPEATS",
    "SCATTERS",
    "are_unlike",
    "contradicting",
    "moves_alike",
    "once_each",
    "share_a_motion",
    "without_contradictions",
    "without_contradictory_motions",
    "without_copies",
]

# K between two logs beyond which their forces may differ, where the damper follows temperature.
_SAME_TEMPERATURE = 0.5


# Logs of one setting beside each other: the same test twice, and tests that contradict each
# other.
#
# Two logs hold the same test where their signals are the same sample by sample, in whatever
# format they came. Two tests contradict each other where the same motion meets other forces: the
# peak forces differ by more than cycles scatter and rigs repeat. What is beyond the scatter alone
# is told.

# Of the range: text of four digits stands 1e-4 beside the binary file, and noise of 4 N in 1300 N
# makes two tests differ by 4e-3.
_SAME = 5e-4
_EARLY = 8  # share of a log that is looked at before all of it
_ROUNDING = 1e-9  # of sums
_ALIKE = 0.05  # motions nearer than this are one: rigs repeat speed and stroke to 1 %
REPEATS = 0.05  # a damper at one setting, taken off and put on again, is within 5 %
_TOLD = 0.005  # a difference of the peaks that is worth a word
SCATTERS = 3.0  # standard deviations
_WARMER = 5.0  # degC; forces fall as the oil thins
_MANY = 20


@dataclass(frozen=True, slots=True)
class _Contradiction:
    """Two tests of one motion whose forces differ by more than their scatter."""

    first: Trace
    second: Trace
    stroke: str
    forces: tuple[float, float]
    speed: float
    excess: float  # times what tests of one setting may differ by
    beyond_scatter: float  # times what the scatter of their cycles explains

    @property
    def sentence(self) -> str:
        """What differs, and where."""
        a, b = self.forces
        size = 200.0 * abs(a - b) / (abs(a) + abs(b))
        warmth = (self.first.temperature, self.second.temperature)
        how = (
            "contradict each other"
            if self.excess > 1.0
            else "differ by more than their cycles scatter"
        )
        said = (
            f"{self.first.name} and {self.second.name} {how}: peak force in "
            f"{self.stroke} {a:.4g} N and {b:.4g} N at {self.speed:.3g} m/s, {size:.3g} % apart"
        )
        if None not in warmth and abs((warmth[0] or 0.0) - (warmth[1] or 0.0)) > _WARMER:
            said += (
                f", at {warmth[0]:.3g} and {warmth[1]:.3g} degC (--covariate temperature fits both)"
            )
        return said


def once_each(batch: LogBatch) -> LogBatch:
    """Return the batch with each test once; a test under two settings is a failure of both."""
    paths = {log.log: log.path for log in batch.logs}
    twins: dict[str, list[Trace]] = {}
    kept: list[Trace] = []
    by_length: dict[int, list[tuple[Trace, float, float]]] = defaultdict(list)
    for trace in batch.traces:
        alike, norm = by_length[len(trace.force)], _early_norm(trace)
        first = next(
            (
                one
                for one, most, its_norm in alike
                if (norm - its_norm) ** 2 <= (1.0 + _ROUNDING) * most  # no further than the forces
                and paths.get(one.name) != paths.get(trace.name)
                and not _differ_early(one, trace, most)
                and _is_same(one, trace)
            ),
            None,
        )
        if first is None:
            alike.append((trace, _most(trace), norm))
            kept.append(trace)
        else:
            twins.setdefault(first.name, []).append(trace)
    named = {trace.name: trace for trace in kept}
    bad = {
        name: [one for one in copies if one.setting != named[name].setting]
        for name, copies in twins.items()
    }
    failures = [
        Failure("", "", None, ContradictionError.__name__, _two_settings(named[name], others))
        for name, others in bad.items()
        if others
    ]
    fitted = tuple(trace for trace in kept if not bad.get(trace.name))
    said = _copies_in_words({name: copies for name, copies in twins.items() if not bad[name]})
    return replace(
        batch,
        traces=fitted,
        failures=(*batch.failures, *failures),
        remarks=(*batch.remarks, *said),
    )


def without_copies(
    batch: LogBatch, held_out: Sequence[Trace]
) -> tuple[LogBatch, tuple[Trace, ...]]:
    """Return the batch, and what is held out without the tests that are fitted by another name."""
    kept, said = [], []
    for trace in held_out:
        same = (one for one in batch.traces if one.name != trace.name and _is_copy(one, trace))
        first = next(same, None)
        if first is None:
            kept.append(trace)
        else:
            said.append(
                f"{trace.name}: the same test as {first.name}, which is fitted; it is not held out"
            )
    return replace(batch, remarks=(*batch.remarks, *said)), tuple(kept)


def _is_copy(one: Trace, other: Trace) -> bool:
    return len(one.force) == len(other.force) and _is_same(one, other)


def _most(trace: Trace) -> float:
    """Sum of squares, N^2, beyond which no other force is the same as this one."""
    return len(trace.force) * (_SAME * float(np.ptp(trace.force) or 1.0)) ** 2


def _early_norm(trace: Trace) -> float:
    """Length of the first samples' force as a vector, N."""
    return float(np.linalg.norm(trace.force[: len(trace.force) // _EARLY]))


def _differ_early(one: Trace, other: Trace, most: float) -> bool:
    """Whether the first samples alone differ by more than all may: of most logs they do."""
    part = slice(0, len(one.force) // _EARLY)
    misses = one.force[part] - other.force[part]
    return float(misses @ misses) > (1.0 + _ROUNDING) * most


def _is_same(one: Trace, other: Trace) -> bool:
    if not math.isclose(one.interval, other.interval, rel_tol=1e-6):
        return False
    return all(
        _relative_difference(getattr(one, name), getattr(other, name)) <= _SAME
        for name in ("force", "displacement")
    )


def _relative_difference(a: np.ndarray, b: np.ndarray) -> float:
    return float(np.sqrt(np.mean((a - b) ** 2)) / (np.ptp(a) or 1.0))


def _two_settings(first: Trace, others: Sequence[Trace]) -> str:
    listed = listed_names([f"{one.name} setting {one.setting}" for one in (first, *others)])
    return (
        f"the same test under several settings: {listed}; check which is right and leave out the "
        "rest"
    )


def _copies_in_words(twins: dict[str, list[Trace]]) -> Iterator[str]:
    for first, copies in list(twins.items())[:_MANY]:
        n = len(copies) - 1
        others = f" and {n} other log{'s' * (n > 1)}" if n else ""
        yield f"{copies[0].name}{others}: the same test as {first}; it counts once"
    if len(twins) > _MANY:
        yield f"and so do {len(twins) - _MANY} other tests that were given several times"


def without_contradictions(
    batch: LogBatch, *, is_averaging: bool, is_warmed: bool = False
) -> LogBatch:
    """Return the batch without the settings whose logs contradict each other, which fail.

    Parameters
    ----------
    batch : LogBatch
        What was read.
    is_averaging : bool
        Such logs are to be fitted together all the same; then it is only said.
    is_warmed : bool
        What temperature does is fitted: logs of different temperatures may differ.
    """
    groups: dict[Setting, list[Trace]] = defaultdict(list)
    for trace in batch.traces:
        if trace.setting is not None:
            groups[trace.setting].append(trace)
    worst = {
        setting: max(found, key=lambda one: (one.excess, one.beyond_scatter))
        for setting, traces in groups.items()
        if (found := list(_contradictions(traces, is_warmed=is_warmed)))
    }
    said = {one: found.sentence for one, found in worst.items() if found.excess > 1.0}
    together = tuple(
        f"setting {one}: {found.sentence}; fitted together, as one damper repeats within "
        f"{100.0 * REPEATS:g} %: leave one out if the setting or the damper differs"
        for one, found in worst.items()
        if found.excess <= 1.0
    )
    batch = replace(batch, remarks=(*batch.remarks, *together))
    return contradicting(batch, said, is_averaging=is_averaging)


def contradicting(
    batch: LogBatch, sentences: Mapping[Setting, str], *, is_averaging: bool
) -> LogBatch:
    """Return the batch without settings whose logs contradict each other, or with a word on them.

    Parameters
    ----------
    batch : LogBatch
        What was read.
    sentences : mapping of Setting to str
        Which logs differ, and where.
    is_averaging : bool
        Such logs are to be fitted together all the same.
    """
    if is_averaging:
        said = (f"setting {one}: {sentence}; averaged" for one, sentence in sentences.items())
        return replace(batch, remarks=(*batch.remarks, *said))
    failures = [
        Failure(
            *("", "", setting, ContradictionError.__name__),
            f"setting {setting}: {sentence}, more than their scatter; check whether the setting or "
            "the damper differs, leave one out, or fit them together by "
            "--rig contradictions=average",
        )
        for setting, sentence in sentences.items()
    ]
    kept = tuple(trace for trace in batch.traces if trace.setting not in sentences)
    return replace(batch, traces=kept, failures=(*batch.failures, *failures))


def share_a_motion(first: Trace, second: Trace) -> bool:
    """Whether two logs hold one steady motion, so that their peak forces can be compared."""
    return first.gas_pressure == second.gas_pressure and moves_alike(first, second)


def are_unlike(first: Trace, second: Trace) -> bool:
    """Whether two logs differ in temperature by so much that their forces may."""
    known = first.temperature, second.temperature
    return None not in known and abs(known[0] - known[1]) > _SAME_TEMPERATURE  # type: ignore[operator]


def moves_alike(first: Trace, second: Trace) -> bool:
    """Whether two logs hold one steady motion, whatever the damper was filled to."""
    return any(_is_one_motion(a, b) for a in _steady_parts(first) for b in _steady_parts(second))


def _contradictions(traces: Sequence[Trace], *, is_warmed: bool) -> Iterator[_Contradiction]:
    for first, second in itertools.combinations(traces, 2):
        if first.gas_pressure != second.gas_pressure or (is_warmed and are_unlike(first, second)):
            continue
        for a, b in itertools.product(_steady_parts(first), _steady_parts(second)):
            if _is_one_motion(a, b):
                yield from _compared(first, second, a, b)


def _steady_parts(trace: Trace) -> list[Stretch]:
    return [one for one in trace.stretches if one.kind == "steady" and one.figures is not None]


def _is_one_motion(a: Stretch, b: Stretch) -> bool:
    return all(
        abs(getattr(a, name) / getattr(b, name) - 1.0) <= _ALIKE
        for name in ("peak_speed", "amplitude")
    )


def _compared(first: Trace, second: Trace, a: Stretch, b: Stretch) -> Iterator[_Contradiction]:
    one, other = a.figures, b.figures
    assert one is not None
    assert other is not None
    scale = 0.25 * sum(
        f.peak_force_rebound - f.peak_force_bump for f in (one, other)
    )  # half of the mean range
    noise = math.hypot(*(0.0 if math.isnan(s.noise) else s.noise for s in (a, b)))
    for stroke in ("rebound", "bump"):
        forces = (getattr(one, f"peak_force_{stroke}"), getattr(other, f"peak_force_{stroke}"))
        speeds = (getattr(one, f"peak_speed_{stroke}"), getattr(other, f"peak_speed_{stroke}"))
        # A force grows with the square of the speed at most.
        by_speed = 2.0 * abs(math.log(speeds[0] / speeds[1])) * max(map(abs, forces))
        apart = abs(forces[0] - forces[1])
        excess = apart / (max(SCATTERS * noise, REPEATS * scale) + by_speed)
        beyond = apart / (max(SCATTERS * noise, _TOLD * scale) + by_speed)
        if beyond > 1.0:
            yield _Contradiction(first, second, stroke, forces, a.peak_speed, excess, beyond)


# Logs of one setting under different motions that contradict each other where their speeds meet.
#
# A slow test and a fast one of one damper pass through the same speeds. The damping force there,
# half the difference of rebound and bump, is what an offset and the gas have no part in; read on
# both ways through the speed it does not know the oil's compression either, to first order. Where
# it differs, the two logs are fitted together, and what the fit leaves over is read in the same
# way. Where fits of each log apart leave hardly any of that over, the logs are of different
# dampers or settings.

_WINDOW = (0.75, 0.95)  # of the slower log's peak speed; nearer to it there is one way only
# Of what a fit of both misses. Logs one click apart: 0.000 to 0.07; of a damper of real valves
# under the paper's law: 0.7 and more.
_EXPLAINED = 0.25
_FEWEST = 12  # samples of a stroke in the window


@dataclass(frozen=True, slots=True)
class _Meeting:
    """The damping forces of two logs at a speed that both pass."""

    first: Trace
    second: Trace
    speed: float
    forces: tuple[float, float]
    allowed: float

    @property
    def differs(self) -> bool:
        return abs(self.forces[0] - self.forces[1]) > self.allowed

    @property
    def sentence(self) -> str:
        a, b = self.forces
        return (
            f"{self.first.name} and {self.second.name} contradict each other: both reach "
            f"{self.speed:.3g} m/s, where their damping forces are {a:.4g} N and {b:.4g} N, "
            f"{200.0 * abs(a - b) / (abs(a) + abs(b)):.3g} % apart, which a fit of both "
            "does not explain"
        )


def without_contradictory_motions(batch: LogBatch, configuration: Configuration) -> LogBatch:
    """Return the batch without the settings whose logs of other motions contradict each other.

    Parameters
    ----------
    batch : LogBatch
        What was read; logs of one motion have been compared.
    configuration : Configuration
        The model, how it is fitted, and whether such logs are averaged.
    """
    groups: dict[Setting, list[Trace]] = defaultdict(list)
    for trace in batch.traces:
        if trace.setting is not None:
            groups[trace.setting].append(trace)
    worst = {
        setting: found.sentence
        for setting, traces in groups.items()
        if (found := next(_contradictions_at_speeds(traces, configuration), None))
    }
    return contradicting(batch, worst, is_averaging=configuration.rig.is_averaging)


def _contradictions_at_speeds(
    traces: Sequence[Trace], configuration: Configuration
) -> Iterator[_Meeting]:
    """Yield the pairs, of logs that are neighbours by their fastest speed."""
    ranked = sorted(traces, key=_top_speed)
    for first, second in itertools.pairwise(ranked):
        is_warmed = isinstance(configuration.damper, Warmed)
        if share_a_motion(first, second) or (is_warmed and are_unlike(first, second)):
            continue
        met = _meeting(first, second, (first.force, second.force))
        if met is not None and met.differs and _is_left_by_fits(met, configuration):
            yield met


def _top_speed(trace: Trace) -> float:
    """Return the speed that a log reaches in both strokes, m/s."""
    v = trace.velocity[trace.compared]
    return float(min(np.max(v), -np.min(v)))


def _meeting(first: Trace, second: Trace, forces: tuple[FloatArray, FloatArray]) -> _Meeting | None:
    """Return what two logs say where their speeds meet; None where they do not."""
    top = min(_top_speed(first), _top_speed(second))
    speed = 0.5 * sum(_WINDOW) * top
    read = [_damping(one, force, top) for one, force in zip((first, second), forces, strict=True)]
    scales = [_damping(one, one.force, top) for one in (first, second)]
    if None in read or None in scales:
        return None
    noise = math.hypot(*(_noise(one) for one in (first, second)))
    scale = 0.5 * sum(abs(one) for one in scales if one is not None)
    a, b = (float(one) for one in read if one is not None)
    return _Meeting(first, second, speed, (a, b), max(SCATTERS * noise, REPEATS * scale))


def _damping(trace: Trace, force: FloatArray, top: float) -> float | None:
    """Return half the difference of rebound and bump in the middle of the window, N."""
    v, f = trace.velocity[trace.compared], force[trace.compared]
    found = []
    for sign in (1.0, -1.0):
        speed = sign * v
        inside = (speed >= _WINDOW[0] * top) & (speed <= _WINDOW[1] * top)
        if np.count_nonzero(inside) < _FEWEST:
            return None
        # Samples of a slow test lie nearer to its peak than those of a fast one.
        away = speed[inside] - 0.5 * sum(_WINDOW) * top
        slope = np.stack([np.ones(len(away)), away], axis=1)
        found.append(float(np.linalg.lstsq(slope, f[inside], rcond=None)[0][0]))
    return 0.5 * (found[0] - found[1])


def _noise(trace: Trace) -> float:
    return max((one.noise for one in trace.stretches if math.isfinite(one.noise)), default=0.0)


def _is_left_by_fits(met: _Meeting, configuration: Configuration) -> bool:
    """Whether a fit of both logs leaves that difference over, and fits of each leave nothing.

    Where the law does not suit the damper each log is missed too, and nothing is reported.
    """
    pair = (met.first, met.second)
    try:
        both = _missed(pair, configuration)
        rest = _meeting(*pair, (both[0], both[1]))
        if rest is None or not rest.differs:
            return False
        apart = [_missed((one,), configuration)[0] for one in pair]
    except DamperfitError:
        return False  # the run itself tells why this setting cannot be fitted
    missed, explained = (sum(map(_power, pair, left)) for left in (both, apart))
    return explained <= _EXPLAINED * missed


def _missed(traces: Sequence[Trace], configuration: Configuration) -> list[FloatArray]:
    """Return what a fit of some logs leaves over of each."""
    options = replace(
        configuration.identification, procedure="plain", share=None, bulk_modulus="free", starts=1
    )
    (fit,) = identify(traces, configuration.damper, options).fits
    values, damper = fit.parameters, configuration.damper
    return [one.force - compare(values, one, damper, solver=options.solver).force for one in traces]


def _power(trace: Trace, left: FloatArray) -> float:
    """Return the mean square of what is left over of a log, of its force's variance."""
    part = trace.compared
    return float(np.mean(left[part] ** 2) / np.var(trace.force[part]))
