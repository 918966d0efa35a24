"""What a user would write without damperfit: general solvers and general optimisers.

Each peer fits R_m1, R_m2 and K_e to one conditioned log with the same model, the same filter on
both sides and log parameters, as SciPy's and lmfit's documentation lead one to do it.
"""

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline

from damperfit.conditioning import apply_filter
from damperfit.damper.purdy.parameters import PURDY_DAMPER as DAMPER
from damperfit.recording import Trace

FREE = ("r_m1", "r_m2", "k_e")
R_M3, F_F = 2.597e6, 50.0

FloatArray = NDArray[np.float64]


def force_by_lsoda(values: dict[str, float], trace: Trace) -> FloatArray:
    """Return the filtered model force of a trace by SciPy's LSODA, shape (n,), N."""
    r_m1, r_m2, k_e = (values[name] for name in FREE)
    rho, p_0 = DAMPER.oil_density, DAMPER.gas_pressure
    a_p1, a_p2 = DAMPER.annulus_area, DAMPER.piston_area
    v_10, v_20, v_g0 = DAMPER.chamber_1_volume, DAMPER.chamber_2_volume, DAMPER.gas_volume
    start = np.array([rho * v_10, rho * v_20])
    time = trace.interval * np.arange(len(trace.displacement))
    x_of = CubicSpline(time, trace.displacement)

    def pressures(x, m_1, m_2):  # type: ignore[no-untyped-def]
        p_1 = np.maximum(0.0, k_e * (m_1 / (rho * (v_10 - x * a_p1)) - 1.0) + p_0)
        p_2 = np.maximum(0.0, k_e * (m_2 / (rho * (v_20 + x * a_p2)) - 1.0) + p_0)
        gained = (m_1 + m_2 - start.sum()) / rho
        return p_1, p_2, p_0 * (v_g0 / (v_g0 + gained)) ** DAMPER.gas_exponent

    def rates(t: float, m: FloatArray) -> list[float]:
        p_1, p_2, p_3 = pressures(float(x_of(t)), m[0], m[1])
        w_1 = math.copysign(math.sqrt(abs(p_1 - p_3)), p_1 - p_3) / r_m1
        w_2, w_3 = max(0.0, p_2 - p_1) / r_m2, max(0.0, p_3 - p_2) / R_M3
        return [w_2 - w_1, w_3 - w_2]

    x_0 = float(trace.displacement[0])
    first = rho * np.array([v_10 - x_0 * a_p1, v_20 + x_0 * a_p2])
    solution = solve_ivp(
        rates, (0.0, time[-1]), first, method="LSODA", t_eval=time, rtol=1e-6, atol=1e-11
    )
    p_1, p_2, _ = pressures(trace.displacement, solution.y[0], solution.y[1])
    force = p_1 * a_p1 - p_2 * a_p2 + F_F * np.clip(trace.velocity / 1e-4, -1.0, 1.0)
    return apply_filter(trace.model_filter, force)


def misfit(values: dict[str, float], trace: Trace) -> FloatArray:
    """Return the residual in the window, N."""
    return (force_by_lsoda(values, trace) - trace.force)[trace.compared]


def fit_with_scipy(trace: Trace, start: dict[str, float]) -> dict[str, float]:
    """Fit with `scipy.optimize.least_squares` and differences that suit the solver's tolerance."""
    from scipy.optimize import least_squares

    ended = least_squares(
        lambda u: misfit(dict(zip(FREE, np.exp(u), strict=True)), trace),
        np.log([start[name] for name in FREE]),
        method="lm",
        diff_step=1e-3,
    )
    return dict(zip(FREE, np.exp(ended.x), strict=True))


def fit_with_lmfit(trace: Trace, start: dict[str, float]) -> dict[str, float]:
    """Fit with `lmfit.minimize`, its leastsq method and the same differences."""
    import lmfit

    parameters = lmfit.Parameters()
    for name in FREE:
        parameters.add(name, value=math.log(start[name]))
    ended = lmfit.minimize(
        lambda p: misfit({name: math.exp(p[name].value) for name in FREE}, trace),
        parameters,
        method="leastsq",
        epsfcn=1e-6,
    )
    return {name: math.exp(ended.params[name].value) for name in FREE}


PEERS: dict[str, Callable[[Trace, dict[str, float]], dict[str, float]]] = {
    "SciPy LSODA + least_squares": fit_with_scipy,
    "lmfit + solve_ivp": fit_with_lmfit,
}
