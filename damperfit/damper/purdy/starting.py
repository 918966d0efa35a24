"""Starting values: the incompressible closed form for the valves, several bulk moduli."""

from __future__ import annotations

from dataclasses import replace
from itertools import chain, combinations
from typing import TYPE_CHECKING

import numpy as np

from damperfit.damper.model import FurtherStart
from damperfit.damper.purdy.closed_forms import gas_pressure, incompressible_design
from damperfit.damper.purdy.parameters import Parameters

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from damperfit.damper.model import Values
    from damperfit.damper.purdy.parameters import Damper
    from damperfit.recording import Trace

    FloatArray = NDArray[np.float64]

# A few hundred samples a log fix four numbers well enough to start from.
_SAMPLES_A_LOG = 400
# K_e of oil with 5 % to 0.1 % of undissolved gas at 20 bar, Appendix 1 (28); the likeliest first.
_BULK_MODULI = (6e8, 6e7, 2e8, 1.8e9)
# Where the closed form gives nothing for a valve, start from a tenth of the other valves' effect.
_SMALL_SHARE = 0.1
# Start this far below the R_m3 at which chamber 2 would cavitate, where the misfit has a second,
# wrong local minimum (R_m3 up, f_f to zero).
_CAVITATION_DISTANCE = 0.8
# Starts for a damper that cavitates, in units of `cavitation_limit`: 1.5 and 5 times the onset.
_BEYOND_ONSET = (1.9, 6.0)
# What a start holds until the others have settled: at stiff settings R_m1 carries the rebound, and
# one that is off in K_e lets R_m3 run into cavitation.
REBOUND = frozenset({"r_m3", "f_f"})


def starts(
    traces: Sequence[Trace], damper: Damper, fixed: Mapping[str, float]
) -> tuple[Parameters, ...]:
    """Return the closed form's values, with several bulk moduli unless that is fixed."""
    if "k_e" in fixed:
        return (starting_values(traces, damper, fixed, fixed["k_e"]),)
    likeliest = starting_values(traces, damper, fixed, _BULK_MODULI[0])
    return tuple(replace(likeliest, k_e=k_e) for k_e in _BULK_MODULI)


def starting_values(
    traces: Sequence[Trace], damper: Damper, fixed: Mapping[str, float], k_e: float
) -> Parameters:
    """Return starting values from the incompressible limit of the model, at a bulk modulus, Pa.

    Non-negative linear least squares in (R_m1^2, R_m2, R_m3, f_f) and, unless fixed, f_0.
    """
    columns, force = _stack(traces, damper)
    if "f_0" in fixed:
        force = force - fixed["f_0"]
        columns = columns[:, :4]
    scale = np.sqrt(np.mean(columns * columns, axis=0)) + 1e-300
    known = {"r_m1": 0, "r_m2": 1, "r_m3": 2, "f_f": 3}
    held = [known[name] for name in fixed if name in known]
    for name, value in fixed.items():
        if name in known:
            power = value * value if name == "r_m1" else value
            force = force - columns[:, known[name]] * power
    free = [j for j in range(columns.shape[1]) if j not in held]
    solution = np.zeros(columns.shape[1])
    if free:
        scaled = columns[:, free] / scale[free]
        solution[free] = nonnegative_least_squares(scaled, force) / scale[free]
    with np.errstate(over="ignore"):  # a parameter held far off: the simulation will say so
        floor = _SMALL_SHARE * float(np.std(force)) / scale
    start = Parameters(
        r_m1=float(np.sqrt(max(solution[0], floor[0]))),
        r_m2=float(max(solution[1], floor[1])),
        r_m3=float(min(max(solution[2], floor[2]), cavitation_limit(traces, damper))),
        k_e=k_e,
        f_f=float(max(solution[3], 0.1 * floor[3])),
        f_0=float(solution[4] - solution[5]) if len(solution) > 4 else 0.0,
    )
    return replace(start, **dict(fixed))


def further_starts(
    start: Values, traces: Sequence[Trace], damper: Damper, free: Sequence[str]
) -> tuple[FurtherStart, ...]:
    """Return descents that R_m3, where it is free, begins below the onset of cavitation or beyond.

    What the closed form makes of cavitation, which it does not know, is an offset: beyond the onset
    a free one begins at nothing.
    """
    if "r_m3" not in free:
        return ()
    limit = cavitation_limit(traces, damper)
    is_offset_free = "f_0" in free
    offset = 0.0 if is_offset_free else start.f_0
    stages = (REBOUND | {"f_0"}, *([frozenset({"f_0"})] if is_offset_free else []))
    beyond = (
        FurtherStart(start.replace(r_m3=factor * limit, f_0=offset), stages, is_last_resort=True)
        for factor in _BEYOND_ONSET
    )
    return (FurtherStart(start.replace(r_m3=min(start.r_m3, limit)), (REBOUND,)), *beyond)


def cavitation_limit(traces: Sequence[Trace], damper: Damper) -> float:
    """Return an R_m3 that keeps chamber 2 full in rebound: 0.8 P_3/(rho_0 a_p2 v) at its least."""
    limits = []
    for trace in traces:
        x, v = trace.displacement[trace.compared], trace.velocity[trace.compared]
        flow = damper.oil_density * damper.piston_area * np.maximum(v, 1e-6)
        limits.append(float(np.min(gas_pressure(damper, x) / flow)))
    return _CAVITATION_DISTANCE * min(limits)


def _stack(traces: Sequence[Trace], damper: Damper) -> tuple[FloatArray, FloatArray]:
    """Thinned rows of the closed form's matrix, with two columns for an offset of either sign."""
    rows, forces = [], []
    for trace in traces:
        stride = max(1, trace.n_samples // _SAMPLES_A_LOG)
        part = np.arange(len(trace.force))[trace.compared][::stride]
        columns, offset = incompressible_design(
            damper.filled_to(trace.gas_pressure), trace.displacement[part], trace.velocity[part]
        )
        tare = np.ones((len(columns), 1))
        rows.append(np.hstack([columns, tare, -tare]))
        forces.append(trace.force[part] - offset)
    return np.vstack(rows), np.concatenate(forces)


def nonnegative_least_squares(columns: FloatArray, values: FloatArray) -> FloatArray:
    """Return x >= 0 that makes |columns x - values| least; few columns (n, k) of about one length.

    The best of all choices of columns that has no negative number: `scipy.optimize` takes longer to
    load than all starts take.

    Examples
    --------
    >>> nonnegative_least_squares(np.eye(2), np.array([3.0, -1.0])).tolist()
    [3.0, 0.0]
    """
    triangle = np.asarray(np.linalg.qr(np.column_stack([columns, values]), mode="r"))
    a, b = triangle[:, :-1], triangle[:, -1]
    best, least, places = np.zeros(a.shape[1]), float(b @ b), range(a.shape[1])
    for some in chain.from_iterable(combinations(places, size + 1) for size in places):
        solution = np.linalg.lstsq(a[:, some], b, rcond=None)[0]
        rest = a[:, some] @ solution - b
        if np.all(solution >= 0.0) and rest @ rest < least:
            best, least = np.zeros(a.shape[1]), float(rest @ rest)
            best[list(some)] = solution
    return best
