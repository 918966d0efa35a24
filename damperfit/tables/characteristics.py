"""What a dyno's software reads off each stretch, as rows: measured beside simulated.

One row of the peaks (PVP) and one of each named speed that both strokes reach. The gas force is
that of the damper's data at the displacement of each sample; a model without gas has none, and
the cells stay empty. Of a motion that does not repeat there are the peaks alone.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from damperfit.conditioning import branch_forces
from damperfit.conditioning.measured_characteristics import (
    counted_edges,
    figures_in,
    mean_energy,
    mean_extremes,
)
from damperfit.simulation import NAMED_SPEEDS
from damperfit.statistics import mean_of

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator, Sequence

    from numpy.typing import NDArray

    from damperfit.damper.model import Model
    from damperfit.identification import SimulatedLog
    from damperfit.recording import Stretch, Trace
    from damperfit.tested.setting import Setting

    FloatArray = NDArray[np.float64]

__all__ = ["characteristic_rows"]

_STROKES = (("rebound", 1.0), ("bump", -1.0))
_UNREPEATED = ((math.nan, math.nan),) * len(_STROKES)


def characteristic_rows(
    setting: Setting, trace: Trace, seen: SimulatedLog, damper: Model
) -> Iterator[dict[str, Any]]:
    """Yield the rows of a log: of each stretch the peaks, then the named speeds.

    Parameters
    ----------
    setting : Setting
        Of the log.
    trace : Trace
        The log.
    seen : SimulatedLog
        The model's force as compared.
    damper : Model
        Whose gas force is taken off.
    """
    for place, stretch in enumerate(trace.stretches, start=1):
        facts = {
            "setting": setting,
            "log": trace.name,
            "stretch": place,
            "kind": stretch.kind,
            "start_s": trace.start_time + stretch.first * trace.interval,
            "cycles": stretch.n_cycles,
            "frequency_Hz": stretch.frequency,
            "amplitude_m": stretch.amplitude,
            "temperature_degC": trace.temperature,
        }
        for row in _stretch_rows(trace, stretch, seen.force, damper):
            cells = facts | row
            yield {
                name: None if isinstance(cell, float) and not math.isfinite(cell) else cell
                for name, cell in cells.items()
            }


def _stretch_rows(
    trace: Trace, stretch: Stretch, simulated: FloatArray, damper: Model
) -> Iterator[dict[str, Any]]:
    edges = counted_edges(stretch)
    part = slice(int(edges[0]), int(edges[-1]))
    velocity, begins = trace.velocity[part], edges[:-1] - edges[0]
    forces = {("measured", ""): trace.force[part], ("simulated", ""): simulated[part]}
    gas = damper.rest_force(trace.displacement[part])
    level = {}
    if gas is not None:
        level = {"mean_gas_force_N": mean_of(gas)}
        forces = {
            (whose, suffix): force if not suffix else force - gas
            for (whose, _), force in forces.items()
            for suffix in ("", "_without_gas")
        }
    stacked = np.stack(list(forces.values()))
    measured = figures_in(trace, stretch)
    top = min(measured.peak_speed_rebound, measured.peak_speed_bump)
    half = measured.hysteresis_speed
    speeds = [speed for speed in NAMED_SPEEDS if speed < top] if stretch.n_cycles else []
    passed = sorted({*speeds, half}) if stretch.n_cycles else []
    # By speed and force: of each stroke the opening and the closing branch.
    both = [branch_forces(velocity, stacked, passed, sign=sign) for _, sign in _STROKES]
    branches = dict(zip(passed, np.transpose(both, (2, 3, 0, 1)).tolist(), strict=True))
    peak: dict[str, Any] = {
        "point": "peak",
        "speed_rebound_m_per_s": measured.peak_speed_rebound,
        "speed_bump_m_per_s": measured.peak_speed_bump,
        "hysteresis_speed_m_per_s": half,
    }
    tops, bottoms = mean_extremes(stacked, begins)
    for (whose, suffix), rebound, bump in zip(forces, tops, bottoms, strict=True):
        peak |= _pair(whose, suffix, rebound, bump)
    peak |= {
        "measured_energy_J": measured.energy,
        "simulated_energy_J": mean_energy(trace, stretch, simulated),
        "measured_energy_se_J": measured.energy_se,
        "measured_hysteresis_rebound_se_N": measured.hysteresis_rebound_se,
        "measured_hysteresis_bump_se_N": measured.hysteresis_bump_se,
    }
    yield level | peak | _hysteresis(forces, branches.get(half, [_UNREPEATED] * len(forces)))
    for speed in speeds:
        row: dict[str, Any] = {
            "point": "speed",
            "speed_rebound_m_per_s": speed,
            "speed_bump_m_per_s": speed,
            "hysteresis_speed_m_per_s": speed,
        }
        for (whose, suffix), of in zip(forces, branches[speed], strict=True):
            rebound, bump = (0.5 * (opening + closing) for opening, closing in of)
            row |= _pair(whose, suffix, rebound, bump)
        yield level | row | _hysteresis(forces, branches[speed])


def _hysteresis(
    forces: Collection[tuple[str, str]], branches: Sequence[Sequence[tuple[float, float]]]
) -> dict[str, float]:
    """Of each force its opening less its closing branch, by stroke."""
    return {
        f"{whose}_hysteresis_{stroke}_N": opening - closing
        for (whose, suffix), of in zip(forces, branches, strict=True)
        if not suffix
        for (stroke, _), (opening, closing) in zip(_STROKES, of, strict=True)
    }


def _pair(whose: str, suffix: str, rebound: float, bump: float) -> dict[str, float | None]:
    # Where the gas pushes both strokes to one side there is no ratio.
    ratio = -rebound / bump if rebound > 0.0 > bump else None
    return {
        f"{whose}_rebound{suffix}_N": rebound,
        f"{whose}_bump{suffix}_N": bump,
        f"{whose}_ratio{suffix}": ratio,
    }
