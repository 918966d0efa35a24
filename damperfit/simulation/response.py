"""A model of a damper asked for its response to a motion, and how exactly."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, NamedTuple

if TYPE_CHECKING:
    from collections.abc import Sequence

    import numpy as np
    from numpy.typing import NDArray

    from damperfit.simulation.motion import Motion

    FloatArray = NDArray[np.float64]


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
        less than 0.03 N (`tests/damper/test_core.py`) and make its sensitivities smoother.
    """

    tolerance: float = 3e-3
    dead_band: float = 1e-4
    max_steps_per_sample: int = 10_000
    rounding: float = 100.0


class Work(NamedTuple):
    """What a simulation cost."""

    steps: int
    rejected: int
    newton_iterations: int


@dataclass(frozen=True, slots=True, eq=False)
class Response:
    """A damper's answer to a motion: arrays of shape (n,), but for those that tell theirs."""

    time: FloatArray  # s
    displacement: FloatArray  # m
    velocity: FloatArray  # m/s
    force: FloatArray  # N
    pressures: FloatArray  # shape (3, n), absolute pressure of chambers 1, 2, 3, Pa
    masses: FloatArray  # shape (2, n), oil mass in chambers 1 and 2, kg
    # By name the derivative of the force by that parameter, in SI.
    sensitivities: dict[str, FloatArray] = field(default_factory=dict)
    work: Work = field(default_factory=lambda: Work(0, 0, 0))


def simulate(
    values: Any,
    damper: Any,
    motion: Motion,
    *,
    sensitivities: Sequence[str] = (),
    options: SolverOptions = SolverOptions(),
) -> Response:
    """Simulate a damper that is driven by a displacement.

    The start of the paper's model and of networks has one pressure in all chambers and the oil mass
    of the damper at x = 0; the steady cycle is reached within one cycle from there.

    Examples
    --------
    >>> from damperfit.damper.purdy.parameters import PURDY_DAMPER, Parameters
    >>> from damperfit.simulation import sine_motion
    >>> y = Parameters(r_m1=1.8e4, r_m2=3.527e6, r_m3=2.597e6, k_e=3.65e8, f_f=50.0)
    >>> response = simulate(y, PURDY_DAMPER, sine_motion(0.032, 1.5, cycles=4, sample_rate=1500))
    >>> round(float(response.force[3100]))  # a tenth into the fourth cycle
    673
    """
    response: Response = damper.simulate(
        values, motion, sensitivities=tuple(sensitivities), options=options
    )
    return response


_ENDINGS = {
    1: "the state or the displacement is not a finite number",
    2: "the integrator needs more than {limit} steps between two samples",
    3: "the stroke leaves no volume in a chamber or in the gas",
    4: "a parameter or a solver option is zero, negative or not finite",
}


def describe_ending(code: int, sample: int, motion: Motion, options: SolverOptions) -> str:
    """Return the sentence of a simulation that ended with a code other than 0, at a sample."""
    what = _ENDINGS[code].format(limit=options.max_steps_per_sample)
    if sample >= len(motion.displacement):
        return f"simulation failed: {what}."
    moment = motion.start_time + sample * motion.interval
    x = motion.displacement[sample]
    return f"simulation failed at sample {sample} ({moment:.6g} s, x = {x:.6g} m): {what}."
