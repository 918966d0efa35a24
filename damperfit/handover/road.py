"""What a table loses: the force of table and model on a standard road, with numbers.

The road is of class B (ISO 8608, 64e-6 m3 at 0.1 cycles/m) at 20 m/s, from 0.5 to 25 Hz, under a
quarter car of 350 and 40 kg on 25 and 200 kN/m with 1.5 kN s/m: the same stroke for every damper,
so that figures can be compared. It is made of sines whose phases are fixed, hence the same in every
run. A damper that was tested slower or shorter gets the road scaled down to its tested range: what
lies beyond the table is not its error.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from damperfit.handover.force_table import force_tables, without_rig
from damperfit.simulation import Motion, simulate

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from damperfit.damper.model import Model, Values
    from damperfit.handover.force_table import ForceTable
    from damperfit.handover.handed_over import HandedOver
    from damperfit.simulation import SolverOptions

    FloatArray = NDArray[np.float64]

__all__ = ["RoadError", "road_errors", "road_sentence", "standard_road", "what_is_lost"]

_ROUGHNESS, _WAVENUMBER = 64e-6, 0.1  # m3 at cycles/m: middle of class B
_SPEED = 20.0  # m/s
_BODY, _WHEEL, _SPRING, _TYRE, _DAMPING = 350.0, 40.0, 25e3, 200e3, 1.5e3  # kg, N/m, N s/m
_RATE, _SECONDS, _RUN_IN = 1000.0, 8.0, 1.0  # Hz, s
_LOWEST, _HIGHEST, _STEP = 0.5, 25.0, 1.0 / _SECONDS  # Hz
_GOLDEN = 0.6180339887498949  # its multiples by squares spread phases evenly, without a generator


@dataclass(frozen=True, slots=True)
class RoadError:
    """Force of a table less the model's on the standard road.

    Attributes
    ----------
    rms, peak : float
        N.
    percent : float
        Mean square of the error over the variance of the model's force, as an MSE.
    speed, stroke : float
        Highest speed and displacement of the motion, m/s and m.
    scale : float
        What the standard road was multiplied by to stay inside the tested range.
    """

    rms: float
    peak: float
    percent: float
    speed: float
    stroke: float
    scale: float


def road_errors(handed: HandedOver, tables: Sequence[ForceTable]) -> tuple[RoadError, ...]:
    """Return the error of the table of each setting, gas force added as it is handed over."""
    known = {one.setting: one.values for one in handed.settings}
    return tuple(_error(handed, known[table.setting], table) for table in tables)


def what_is_lost(handed: HandedOver) -> str:
    """Return what tables of this damper lose, in a sentence for people."""
    tables = force_tables(handed)
    return road_sentence(road_errors(handed, tables), tables)


def _error(handed: HandedOver, values: Values, table: ForceTable) -> RoadError:
    damper, bare = without_rig(handed.damper, values)
    full = standard_road()
    # Inside the table, not at its edge.
    scale = min(
        1.0,
        0.98 * table.tested_speed / float(np.abs(full.velocity).max()),
        0.98 * table.stroke / float(np.abs(full.displacement).max()),
    )
    x, v = scale * full.displacement, scale * full.velocity
    first = int(_RUN_IN * _RATE)
    force = _model_force(damper, bare, scale, handed.solver)[first:]
    tabulated = np.interp(v, table.speeds, table.forces) + table.at_rest(x)
    miss = tabulated[first:] - force
    mean_square = float(np.mean(miss * miss))
    return RoadError(
        float(np.sqrt(mean_square)),
        float(np.abs(miss).max()),
        100.0 * mean_square / float(np.var(force)),
        float(np.abs(v).max()),
        float(np.abs(x).max()),
        scale,
    )


@lru_cache(maxsize=512)
def _model_force(damper: Model, values: Values, scale: float, solver: SolverOptions) -> FloatArray:
    road = standard_road()
    motion = Motion(road.interval, scale * road.displacement, scale * road.velocity)
    force = simulate(values, damper, motion, options=solver).force
    force.flags.writeable = False
    return force


@lru_cache(maxsize=1)
def standard_road() -> Motion:
    """Return displacement and velocity of the damper on the road; positive in rebound."""
    frequency = np.arange(_LOWEST, _HIGHEST + 0.5 * _STEP, _STEP)
    omega = 2.0 * np.pi * frequency
    density = _ROUGHNESS * _WAVENUMBER**2 * _SPEED / frequency**2
    order = np.arange(1, len(frequency) + 1)
    phase = 2.0 * np.pi * ((_GOLDEN * order * order) % 1.0)
    height = np.sqrt(2.0 * density * _STEP) * np.exp(1j * phase)
    link = _SPRING + 1j * omega * _DAMPING
    body, wheel = link - _BODY * omega**2, _TYRE + link - _WHEEL * omega**2
    lift = _TYRE * height / (wheel - link * link / body)  # of the wheel
    stroke = (link / body - 1.0) * lift  # the body rises from the wheel: rebound
    n = int(_SECONDS * _RATE)
    lines = np.zeros((2, n // 2 + 1), dtype=np.complex128)
    lines[:, np.rint(frequency * _SECONDS).astype(np.int64)] = stroke, 1j * omega * stroke
    x, v = np.fft.irfft(0.5 * n * lines, n)
    return Motion(1.0 / _RATE, x, v)


def road_sentence(errors: Sequence[RoadError], tables: Sequence[ForceTable]) -> str:
    """Return what the tables lose, in a sentence for people."""
    by_share = sorted(zip(errors, tables, strict=True), key=lambda pair: pair[0].percent)
    (least, _), (most, where) = by_share[0], by_share[-1]
    road = "a class B road at 20 m/s"
    if most.scale < 1.0:
        road += f" scaled to {100.0 * most.scale:.0f} %, the tested range"
    size = f"{_short(most.rms)} N rms, {_short(most.peak)} N at most ({most.percent:.2g} % MSE)"
    said = f"against the model on {road} (up to {most.speed:.2g} m/s), the table misses {size}"
    if len(errors) == 1:
        return said
    return f"{said} at setting {where.setting}, {least.percent:.2g} % at the best"


def _short(force: float) -> str:
    return f"{force:.0f}" if force >= 999.5 else f"{force:.3g}"  # 1996 N, not 2e+03 N
