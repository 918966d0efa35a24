"""What a dyno's software reads off each stretch, as rows: measured beside simulated.

One row of the peaks (PVP) and one of each named speed that both strokes reach. The gas force is
that of the damper's data at the displacement of each sample; a model without gas has none, and
the cells stay empty. Of a motion that does not repeat there are the peaks alone.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from damperfit.conditioning import branch_forces, clean_cycles, figures_of
from damperfit.simulation import NAMED_SPEEDS

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from numpy.typing import NDArray

    from damperfit.damper.model import Model
    from damperfit.identification import SimulatedLog
    from damperfit.recording import Stretch, StretchFigures, Trace
    from damperfit.tested.setting import Setting

    FloatArray = NDArray[np.float64]

__all__ = ["characteristic_rows"]

_STROKES = (("rebound", 1.0), ("bump", -1.0))


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
    gas = damper.rest_force(trace.displacement)
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
        for row in _stretch_rows(trace, stretch, seen.force, gas):
            yield {name: _finite(cell) for name, cell in (facts | row).items()}


def _stretch_rows(
    trace: Trace, stretch: Stretch, simulated: FloatArray, gas: FloatArray | None
) -> Iterator[dict[str, Any]]:
    edges = np.array([stretch.first, stretch.stop])
    if stretch.n_cycles:
        edges = np.rint(clean_cycles(stretch)).astype(np.int64)
    part = slice(int(edges[0]), int(edges[-1]))
    velocity = trace.velocity[part]
    forces = {"measured": trace.force[part], "simulated": simulated[part]}
    pressed = None if gas is None else gas[part]
    figures = {
        (whose, suffix): figures_of(
            velocity,
            force,
            edges - edges[0],
            interval=trace.interval,
            is_steady=stretch.n_cycles > 0 and not suffix,  # of these alone the hysteresis is told
        )
        for (whose, suffix), force in _with_and_without(forces, pressed)
    }
    level = {} if pressed is None else {"mean_gas_force_N": float(np.mean(pressed))}
    yield level | _peaks(figures)
    top = min(figures["measured", ""].peak_speed_rebound, figures["measured", ""].peak_speed_bump)
    if stretch.n_cycles:
        speeds = [speed for speed in NAMED_SPEEDS if speed < top]
        for row in _at_speeds(velocity, forces, pressed, speeds):
            yield level | row


def _with_and_without(
    forces: Mapping[str, FloatArray], gas: FloatArray | None
) -> Iterator[tuple[tuple[str, str], FloatArray]]:
    for whose, force in forces.items():
        yield (whose, ""), force
        if gas is not None:
            yield (whose, "_without_gas"), force - gas


def _peaks(figures: Mapping[tuple[str, str], StretchFigures]) -> dict[str, Any]:
    first = figures["measured", ""]
    row: dict[str, Any] = {
        "point": "peak",
        "speed_rebound_m_per_s": first.peak_speed_rebound,
        "speed_bump_m_per_s": first.peak_speed_bump,
        "hysteresis_speed_m_per_s": first.hysteresis_speed,
    }
    for (whose, suffix), one in figures.items():
        row |= _pair(whose, suffix, one.peak_force_rebound, one.peak_force_bump)
        if not suffix:
            row[f"{whose}_energy_J"] = one.energy
            row[f"{whose}_hysteresis_rebound_N"] = one.hysteresis_rebound
            row[f"{whose}_hysteresis_bump_N"] = one.hysteresis_bump
    return row


def _at_speeds(
    velocity: FloatArray,
    forces: Mapping[str, FloatArray],
    gas: FloatArray | None,
    speeds: Sequence[float],
) -> Iterator[dict[str, Any]]:
    kinds = dict(_with_and_without(forces, gas))
    stacked = np.stack(list(kinds.values()))
    both = [branch_forces(velocity, stacked, speeds, sign=sign) for _, sign in _STROKES]
    # By speed and force: of each stroke the opening and the closing branch.
    for speed, branches_of in zip(speeds, np.transpose(both, (2, 3, 0, 1)).tolist(), strict=True):
        row: dict[str, Any] = {
            "point": "speed",
            "speed_rebound_m_per_s": speed,
            "speed_bump_m_per_s": speed,
            "hysteresis_speed_m_per_s": speed,
        }
        for (whose, suffix), branches in zip(kinds, branches_of, strict=True):
            rebound, bump = (0.5 * (opening + closing) for opening, closing in branches)
            row |= _pair(whose, suffix, rebound, bump)
            if not suffix:
                for (stroke, _), (opening, closing) in zip(_STROKES, branches, strict=True):
                    row[f"{whose}_hysteresis_{stroke}_N"] = opening - closing
        yield row


def _pair(whose: str, suffix: str, rebound: float, bump: float) -> dict[str, float | None]:
    # Where the gas pushes both strokes to one side there is no ratio.
    ratio = -rebound / bump if rebound > 0.0 > bump else None
    return {
        f"{whose}_rebound{suffix}_N": rebound,
        f"{whose}_bump{suffix}_N": bump,
        f"{whose}_ratio{suffix}": ratio,
    }


def _finite(cell: Any) -> Any:
    return None if isinstance(cell, float) and not math.isfinite(cell) else cell
