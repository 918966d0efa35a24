"""Logs of one damper beside each other: the same test twice, one motion, what differs then.

Two logs hold the same test where their signals are the same sample by sample, in whatever format
they came. Two tests of one setting contradict each other where the same motion meets other forces:
the peak forces differ by more than cycles scatter and rigs repeat.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from itertools import combinations, product
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from damperfit.recording import Segment, Trace
from damperfit.tested.setting import Setting

if TYPE_CHECKING:
    from damperfit.damper.model import Model

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
_APART = 0.1  # closer gas pressures determine the rod's area badly


def copies_in(traces: Sequence[Trace], files: Mapping[str, str]) -> dict[str, list[Trace]]:
    """Return the logs that hold the same test as one of another file, by the earlier one's name."""
    copies: dict[str, list[Trace]] = defaultdict(list)
    by_length: dict[int, list[tuple[Trace, float]]] = defaultdict(list)
    for trace in traces:
        norm, alike = float(np.linalg.norm(trace.force)), by_length[len(trace.force)]
        file = files.get(trace.name)  # none of what is given in memory, each of which is its own
        reach = (1.0 + _ROUNDING) * math.sqrt(len(trace.force)) * _SAME
        for other, its_norm in alike:
            # No further than forces of the same test may lie from each other, as vectors.
            is_near = abs(norm - its_norm) <= reach * float(np.ptp(other.force) or 1.0)
            is_other_file = not file or files.get(other.name) != file
            if is_near and is_other_file and is_same_test(other, trace):
                copies[other.name].append(trace)
                break
        else:
            alike.append((trace, norm))
    return dict(copies)


def is_same_test(first: Trace, other: Trace) -> bool:
    """Whether two logs hold the same signals."""
    if len(first.force) != len(other.force):
        return False
    if not math.isclose(first.interval, other.interval, rel_tol=1e-6):
        return False
    span, stroke = (float(np.ptp(values)) or 1.0 for values in (first.force, first.displacement))
    noise = min(trace.fastest.noise for trace in (first, other))
    force, way = _SAME * span, _SAME * stroke
    if noise > 0.0:
        force = min(force, max(_OF_NOISE * noise, _DIGITS * span))
    pairs = (first.force - other.force, force), (first.displacement - other.displacement, way)
    return all(math.sqrt(float(np.mean(apart**2))) <= limit for apart, limit in pairs)


def share_a_motion(first: Trace, second: Trace) -> bool:
    """Whether two logs hold one steady motion, so that their peak forces can be compared."""
    return first.gas_pressure == second.gas_pressure and bool(_common_motions(first, second))


def are_unlike(first: Trace, second: Trace) -> bool:
    """Whether two logs differ in temperature by so much that their forces may."""
    known = first.temperature, second.temperature
    return None not in known and abs(known[0] - known[1]) > _SAME_TEMPERATURE  # type: ignore[operator]


def _common_motions(first: Trace, second: Trace) -> list[tuple[Segment, Segment]]:
    steady = [
        [x for x in trace.segments if x.kind == "steady" and x.figures is not None]
        for trace in (first, second)
    ]
    return [
        (a, b)
        for a, b in product(*steady)
        if abs(a.peak_speed / b.peak_speed - 1.0) <= _ALIKE
        and abs(a.amplitude / b.amplitude - 1.0) <= _ALIKE
    ]


class Contradiction(NamedTuple):
    """Two tests of one motion whose forces differ by more than their scatter."""

    first: Trace
    second: Trace
    stroke: str  # rebound or compression
    forces: tuple[float, float]  # peaks, N
    speed: float  # m/s
    # The difference, times what tests of one setting may differ by, and times what the scatter of
    # their cycles explains.
    excess: float
    beyond_scatter: float

    @property
    def sentence(self) -> str:
        """What differs, and where."""
        a, b = self.forces
        size = 200.0 * abs(a - b) / (abs(a) + abs(b))
        first, second = self.first.temperature, self.second.temperature
        how = "contradict each other"
        if not self.excess > 1.0:
            how = "differ by more than their cycles scatter"
        text = (
            f"{self.first.name} and {self.second.name} {how}: peak force in {self.stroke} {a:.4g} "
            f"N and {b:.4g} N at {self.speed:.3g} m/s, {size:.3g} % apart"
        )
        if first is not None and second is not None and abs(first - second) > _WARMER:
            text += f", at {first:.3g} and {second:.3g} degC (covariate temperature fits both)"
        return text


def contradiction(traces: Sequence[Trace], *, has_temperature_law: bool) -> Contradiction | None:
    """Return the largest difference between a setting's tests of one motion beyond scatter."""
    differences = (
        difference
        for first, second in combinations(traces, 2)
        if first.gas_pressure == second.gas_pressure
        and not (has_temperature_law and are_unlike(first, second))
        for a, b in _common_motions(first, second)
        for difference in _differences(first, second, a, b)
    )
    return max(differences, key=lambda pair: (pair.excess, pair.beyond_scatter), default=None)


def _differences(first: Trace, second: Trace, a: Segment, b: Segment) -> Iterator[Contradiction]:
    figures = [figure for figure in (a.figures, b.figures) if figure is not None]
    # A quarter of both ranges is half of their mean.
    scale = 0.25 * sum(figure.peak_force_rebound - figure.peak_force_bump for figure in figures)
    noise = math.hypot(*(s.noise for s in (a, b) if not math.isnan(s.noise)))
    for stroke, name in (("rebound", "rebound"), ("compression", "bump")):
        forces = [getattr(figure, f"peak_force_{name}") for figure in figures]
        speeds = [getattr(figure, f"peak_speed_{name}") for figure in figures]
        # A force grows with the square of the speed at most.
        by_speed = 2.0 * abs(math.log(speeds[0] / speeds[1])) * max(map(abs, forces))
        gap = abs(forces[0] - forces[1])
        excess, beyond = (
            gap / (max(SCATTERS * noise, share * scale) + by_speed) for share in (REPEATS, _TOLD)
        )
        if beyond > 1.0:
            pair = (forces[0], forces[1])
            yield Contradiction(first, second, stroke, pair, a.peak_speed, excess, beyond)


def rod_area_ratio(traces: Sequence[Trace], damper: Model) -> float | None:
    """Return the rod's area over the declared one, from the level of the force over pressure.

    Of tests of one setting and motion at gas pressures of their own; None where there are none.
    """
    by_setting: dict[Setting | None, list[Trace]] = defaultdict(list)
    for trace in traces:
        if trace.gas_pressure is not None:
            by_setting[trace.setting].append(trace)
    seen = expected = 0.0
    for logs in by_setting.values():
        for pair in combinations(logs, 2):
            if not _common_motions(*pair):
                continue
            levels = [float(np.mean(log.force[log.compared])) for log in pair]
            rests = [
                damper.filled_to(log.gas_pressure).rest_force(log.displacement[log.compared])
                for log in pair
            ]
            gas = [float(np.mean(rest)) for rest in rests if rest is not None]
            # Each pair by its own difference: a small one says little.
            if len(gas) == len(pair) and abs(gas[0] - gas[1]) >= _APART * max(map(abs, gas)):
                seen += (gas[0] - gas[1]) * (levels[0] - levels[1])
                expected += (gas[0] - gas[1]) ** 2
    return seen / expected if expected else None
