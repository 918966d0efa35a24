"""Logs of one damper beside each other: the same test twice, one motion, what differs then.

Two logs hold the same test where their signals are the same sample by sample, in whatever format
they came. Two tests of one setting contradict each other where the same motion meets other forces:
the peak forces differ by more than cycles scatter and rigs repeat.
"""

from __future__ import annotations

import itertools
import math
from collections import defaultdict
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from numpy.typing import NDArray

    from damperfit.damper.model import Model
    from damperfit.recording import Stretch, Trace
    from damperfit.tested.setting import Setting

    FloatArray = NDArray[np.float64]

__all__ = [
    "REPEATS",
    "SCATTERS",
    "Contradiction",
    "are_unlike",
    "contradiction",
    "copies_in",
    "is_same_test",
    "moves_alike",
    "rod_area_ratio",
    "share_a_motion",
]

# Of the range: text of four digits stands 1e-4 beside the binary file, and noise of 4 N in 1300 N
# makes two tests differ by 4e-3. Two tests of an adjuster that does nothing differ by their noise
# alone, a copy by a small share of it.
_SAME = 5e-4
_OF_NOISE = 0.1
_DIGITS = 2e-5
_ROUNDING = 1e-9  # of sums
_ALIKE = 0.05  # motions nearer than this are one: rigs repeat speed and stroke to 1 %
_SAME_TEMPERATURE = 0.5  # K beyond which forces may differ, where the damper follows temperature
REPEATS = 0.05  # a damper at one setting, taken off and put on again, is within 5 %
SCATTERS = 3.0  # standard deviations
_TOLD = 0.005  # a difference of the peaks that is worth a word
_WARMER = 5.0  # degC; forces fall as the oil thins
_APART = 0.1  # gas pressures nearer than this tell the rod's area badly


def copies_in(traces: Sequence[Trace], files: Mapping[str, str]) -> dict[str, list[Trace]]:
    """Return the logs that hold the same test as an earlier one, by the earlier one's name.

    Parameters
    ----------
    traces : sequence of Trace
        Of one run.
    files : mapping of str to str
        The file of each, by its name: tests in one file are no copies.
    """
    copies: dict[str, list[Trace]] = defaultdict(list)
    by_length: dict[int, list[tuple[Trace, float]]] = defaultdict(list)
    for trace in traces:
        norm, alike = float(np.linalg.norm(trace.force)), by_length[len(trace.force)]
        first = next(
            (
                one
                for one, its_norm in alike
                if abs(norm - its_norm) <= (1.0 + _ROUNDING) * _reach(one)  # no further than forces
                and files.get(one.name) != files.get(trace.name)
                and is_same_test(one, trace)
            ),
            None,
        )
        if first is None:
            alike.append((trace, norm))
        else:
            copies[first.name].append(trace)
    return dict(copies)


def _reach(trace: Trace) -> float:
    """How far another force of the same test may lie from this one, as vectors, N."""
    return math.sqrt(len(trace.force)) * _SAME * float(np.ptp(trace.force) or 1.0)


def is_same_test(one: Trace, other: Trace) -> bool:
    """Whether two logs hold the same signals."""
    if len(one.force) != len(other.force):
        return False
    if not math.isclose(one.interval, other.interval, rel_tol=1e-6):
        return False
    span = float(np.ptp(one.force)) or 1.0
    noise = min(trace.fastest.noise for trace in (one, other))
    limit = _SAME * span
    if noise > 0.0:
        limit = min(limit, max(_OF_NOISE * noise, _DIGITS * span))
    is_near = _rms(one.force - other.force) <= limit
    reach = _SAME * (float(np.ptp(one.displacement)) or 1.0)
    return is_near and _rms(one.displacement - other.displacement) <= reach


def _rms(values: FloatArray) -> float:
    return math.sqrt(float(np.mean(values**2)))


def share_a_motion(first: Trace, second: Trace) -> bool:
    """Whether two logs hold one steady motion, so that their peak forces can be compared."""
    return first.gas_pressure == second.gas_pressure and moves_alike(first, second)


def moves_alike(first: Trace, second: Trace) -> bool:
    """Whether two logs hold one steady motion, whatever the damper was filled to."""
    return any(True for _ in _common_motions(first, second))


def are_unlike(first: Trace, second: Trace) -> bool:
    """Whether two logs differ in temperature by so much that their forces may."""
    known = first.temperature, second.temperature
    return None not in known and abs(known[0] - known[1]) > _SAME_TEMPERATURE  # type: ignore[operator]


def _common_motions(first: Trace, second: Trace) -> Iterator[tuple[Stretch, Stretch]]:
    steady = [
        [one for one in trace.stretches if one.kind == "steady" and one.figures is not None]
        for trace in (first, second)
    ]
    for a, b in itertools.product(*steady):
        ratios = (a.peak_speed / b.peak_speed, a.amplitude / b.amplitude)
        if all(abs(ratio - 1.0) <= _ALIKE for ratio in ratios):
            yield a, b


@dataclass(frozen=True, slots=True)
class Contradiction:
    """Two tests of one motion whose forces differ by more than their scatter.

    Attributes
    ----------
    first, second : Trace
        The tests.
    stroke : str
        rebound or bump.
    forces : (float, float)
        Peak forces, N.
    speed : float
        m/s.
    excess, beyond_scatter : float
        The difference, times what tests of one setting may differ by, and times what the scatter
        of their cycles explains.
    """

    first: Trace
    second: Trace
    stroke: str
    forces: tuple[float, float]
    speed: float
    excess: float
    beyond_scatter: float

    @property
    def sentence(self) -> str:
        """What differs, and where."""
        a, b = self.forces
        size = 200.0 * abs(a - b) / (abs(a) + abs(b))
        warmth = (self.first.temperature, self.second.temperature)
        how = "differ by more than their cycles scatter"
        said = (
            f"{self.first.name} and {self.second.name} "
            f"{'contradict each other' if self.excess > 1.0 else how}: peak force in "
            f"{self.stroke} {a:.4g} N and {b:.4g} N at {self.speed:.3g} m/s, {size:.3g} % apart"
        )
        if None not in warmth and abs((warmth[0] or 0.0) - (warmth[1] or 0.0)) > _WARMER:
            said += (
                f", at {warmth[0]:.3g} and {warmth[1]:.3g} degC (covariate temperature fits both)"
            )
        return said


def contradiction(traces: Sequence[Trace], *, is_warmed: bool) -> Contradiction | None:
    """Return the largest difference between tests of one motion; None within their scatter.

    Parameters
    ----------
    traces : sequence of Trace
        Of one setting.
    is_warmed : bool
        What temperature does is fitted: logs of different temperatures may differ.
    """
    found = (
        one
        for first, second in itertools.combinations(traces, 2)
        if first.gas_pressure == second.gas_pressure
        and not (is_warmed and are_unlike(first, second))
        for a, b in _common_motions(first, second)
        for one in _differences(first, second, a, b)
    )
    return max(found, key=lambda one: (one.excess, one.beyond_scatter), default=None)


def _differences(first: Trace, second: Trace, a: Stretch, b: Stretch) -> Iterator[Contradiction]:
    figures = [one for one in (a.figures, b.figures) if one is not None]
    # A quarter of both ranges is half of their mean.
    scale = 0.25 * sum(one.peak_force_rebound - one.peak_force_bump for one in figures)
    noise = math.hypot(*(0.0 if math.isnan(s.noise) else s.noise for s in (a, b)))
    for stroke in ("rebound", "bump"):
        forces = [getattr(one, f"peak_force_{stroke}") for one in figures]
        speeds = [getattr(one, f"peak_speed_{stroke}") for one in figures]
        # A force grows with the square of the speed at most.
        by_speed = 2.0 * abs(math.log(speeds[0] / speeds[1])) * max(map(abs, forces))
        apart = abs(forces[0] - forces[1])
        excess, beyond = (
            apart / (max(SCATTERS * noise, share * scale) + by_speed) for share in (REPEATS, _TOLD)
        )
        if beyond > 1.0:
            pair = (forces[0], forces[1])
            yield Contradiction(first, second, stroke, pair, a.peak_speed, excess, beyond)


def rod_area_ratio(traces: Sequence[Trace], damper: Model) -> float | None:
    """Return the rod's area over the declared one, as the level of the force over pressure tells.

    Of tests of one setting and one motion at gas pressures of their own: there the mean force
    differs by the gas alone. None where there are no such tests.

    Parameters
    ----------
    traces : sequence of Trace
        Of one damper.
    damper : Model
        As declared.
    """
    by_setting: dict[Setting | None, list[Trace]] = defaultdict(list)
    for trace in traces:
        if trace.gas_pressure is not None:
            by_setting[trace.setting].append(trace)
    seen = expected = 0.0
    for logs in by_setting.values():
        for first, second in itertools.combinations(logs, 2):
            if not moves_alike(first, second):
                continue
            (level, gas), (other_level, other_gas) = (
                _levels(trace, damper) for trace in (first, second)
            )
            if gas is None or other_gas is None:
                continue
            # Each pair by its own difference: a small one says little.
            weight = gas - other_gas
            if abs(weight) >= _APART * max(abs(gas), abs(other_gas)):
                seen += weight * (level - other_level)
                expected += weight**2
    return seen / expected if expected else None


def _levels(trace: Trace, damper: Model) -> tuple[float, float | None]:
    """Mean force of the compared part, measured and that of the gas alone, N."""
    part = trace.compared
    gas = damper.filled_to(trace.gas_pressure).rest_force(trace.displacement[part])
    return float(np.mean(trace.force[part])), None if gas is None else float(np.mean(gas))
