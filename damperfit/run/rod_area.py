"""The rod's area, as the level of the force over the gas pressures of several tests tells it."""

from __future__ import annotations

import itertools
from collections import defaultdict
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from damperfit.run.same_setting import moves_alike

if TYPE_CHECKING:
    from collections.abc import Sequence

    from damperfit.damper.model import Model
    from damperfit.recording import Trace
    from damperfit.run.logs import LogBatch
    from damperfit.tested.setting import Setting

__all__ = ["rod_area_ratio", "with_rod_remark"]

# Pressures nearer than this tell the rod's area badly; an area further off than that is another's.
_APART, _OFF = 0.1, 0.05


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
    by_setting: dict[Setting | None, list[int]] = defaultdict(list)
    for place, trace in enumerate(traces):
        if trace.gas_pressure is not None:
            by_setting[trace.setting].append(place)
    pairs = (itertools.combinations(places, 2) for places in by_setting.values())
    seen = expected = 0.0
    for first, second in sorted(itertools.chain.from_iterable(pairs)):
        one, other = traces[first], traces[second]
        if not moves_alike(one, other):
            continue
        levels = [_level(trace, damper) for trace in (one, other)]
        known = [gas for _, gas in levels if gas is not None]
        if len(known) < len(levels) or abs(known[0] - known[1]) < _APART * max(map(abs, known)):
            continue
        # Each pair by its own difference: a small one says little.
        weight = known[0] - known[1]
        seen += weight * (levels[0][0] - levels[1][0])
        expected += weight**2
    return seen / expected if expected else None


def with_rod_remark(batch: LogBatch, damper: Model) -> LogBatch:
    """Return the batch with a word where the pressures tell of another rod than is declared."""
    ratio = rod_area_ratio(batch.traces, damper)
    if ratio is None or abs(ratio - 1.0) <= _OFF:
        return batch
    said = (
        "the level of the force over the gas pressures of the tests corresponds to a rod of "
        f"{ratio:.3g} times the declared area: check rod_diameter, the pressures, and whether the "
        "force was tared between the tests"
    )
    return replace(batch, remarks=(*batch.remarks, said))


def _level(trace: Trace, damper: Model) -> tuple[float, float | None]:
    """Mean force of the compared part, measured and that of the gas alone, N."""
    part = trace.compared
    gas = damper.filled_to(trace.gas_pressure).rest_force(trace.displacement[part])
    return float(np.mean(trace.force[part])), None if gas is None else float(np.mean(gas))
