"""How exactly to integrate, and a damper's answer to a motion."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    FloatArray = NDArray[np.float64]

__all__ = ["Response", "SolverOptions", "Work"]


@dataclass(frozen=True, slots=True)
class SolverOptions:
    """How exactly to integrate.

    Attributes
    ----------
    tolerance : float
        Force error that one step may make, N. At 3 mN the force agrees with SciPy's Radau at
        rtol 1e-10 within 0.1 N at every instant of the standard test, reversals included, and
        within 0.02 N rms.
    dead_band : float
        Half width of the friction's dead band, m/s: friction is f_f clip(v/dead_band, -1, 1).
        0.1 mm/s lasts 0.07 ms at a reversal of the standard test.
    max_steps_per_sample : int
        Limit of work between two samples.
    rounding : float
        Of a network only: pressure below which the root of an orifice is rounded, Pa. 100 Pa cost
        less than 0.03 N (`tests/damper/test_rounded_root.py`) and make its sensitivities smoother.
    settling : float
        Of the paper's damper only: time in which a start is forgotten, s. A motion of twice that or
        more is then simulated as four parts side by side, each of which begins so much before the
        last ends; where two have not met it is done as one. 0: as one.
    settles_unseen : bool
        Whether nobody asks for the time in which the start is forgotten: it is then run through in
        long steps, and what the response has there may be NaN.
    """

    tolerance: float = 3e-3
    dead_band: float = 1e-4
    max_steps_per_sample: int = 10_000
    rounding: float = 100.0
    settling: float = 0.0
    settles_unseen: bool = False


@dataclass(frozen=True, slots=True)
class Work:
    """What a simulation cost."""

    steps: int
    rejected: int
    newton_iterations: int


@dataclass(frozen=True, slots=True, eq=False)
class Response:
    """A damper's answer to a motion.

    Attributes
    ----------
    time, displacement, velocity, force : numpy.ndarray
        Shape (n,); s, m, m/s, N.
    pressures : numpy.ndarray
        Shape (3, n), absolute pressure of chambers 1, 2, 3, Pa.
    masses : numpy.ndarray
        Shape (2, n), oil mass in chambers 1 and 2, kg.
    sensitivities : dict of str to numpy.ndarray
        Name to shape (n,): derivative of the force by that parameter, in SI.
    work : Work
        Steps taken, refused, and Newton iterations.
    """

    time: FloatArray
    displacement: FloatArray
    velocity: FloatArray
    force: FloatArray
    pressures: FloatArray
    masses: FloatArray
    sensitivities: dict[str, FloatArray] = field(default_factory=dict)
    work: Work = field(default_factory=lambda: Work(0, 0, 0))
