"""Logs of one setting beside each other: the same test twice, and tests that contradict each other.

Two logs hold the same test where their signals are the same sample by sample, in whatever format
they came. Two tests contradict each other where the same motion meets other forces: the peak forces
differ by more than cycles scatter and rigs repeat. What is beyond the scatter alone is told.
"""

from __future__ import annotations

import itertools
import math
from collections import defaultdict
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from damperfit.errors import ContradictionError
from damperfit.report.facts import Failure, listed_names
from damperfit.run.warmth import are_unlike

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from damperfit.recording import Stretch, Trace
    from damperfit.run.logs import LogBatch
    from damperfit.tested.setting import Setting

__all__ = [
    "REPEATS",
    "SCATTERS",
    "contradicting",
    "moves_alike",
    "once_each",
    "share_a_motion",
    "without_contradictions",
    "without_copies",
]

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
