"""Parameters and a displacement to the damper's response; the only door to the compiled core.

The core integrates the oil masses of chambers 1 and 2 (theory: `damperfit.damper.parameters` for
the symbols)::

    dm_1/dt = -w_1 + w_2        dm_2/dt = -w_2 + w_3        dm_3 = -(dm_1 + dm_2)
    P_i = max(0, K_e (m_i/(rho_0 V_i) - 1) + P_0)           (4) (7) (11) (12)
    P_3 = P_0 (V_g0/(V_g0 - dm_3/rho_0))^gamma              (17)
    f = P_1 a_p1 - P_2 a_p2 + f_f(v) + f_0                  (20)

by TR-BDF2 with a step that adapts to the reversals, and differentiates every converged stage, so
that the sensitivities are those of the numbers it returns. Three misprints of the paper are put
right here: (5) lacks a factor 1/rho_0, (17) has the wrong sign before m_3, and the root of (18) is
signed, because P_1 falls below P_3 for a fraction of a per cent of a cycle.
"""

from __future__ import annotations

from dataclasses import astuple, dataclass, field
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from damperfit.damper.network import Network
from damperfit.damper.parameters import PARAMETER_NAMES, Damper, Parameters
from damperfit.errors import ConfigurationError, InstallationError, SimulationError, did_you_mean

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from types import ModuleType

    from numpy.typing import NDArray

    FloatArray = NDArray[np.float64]

__all__ = [
    "SENSITIVITY_NAMES",
    "Motion",
    "Response",
    "SolverOptions",
    "Work",
    "refuse_amplitude",
    "simulate",
    "simulate_network",
    "sine_motion",
    "triangle_motion",
]

# The order of `df_parameters` in core.h.
SENSITIVITY_NAMES: tuple[str, ...] = (*PARAMETER_NAMES, "gas_pressure", "gas_exponent")

_ENDINGS = {
    1: "the state or the displacement is not a finite number",
    2: "the integrator needs more than {limit} steps between two samples",
    3: "the stroke leaves no volume in a chamber or in the gas",
    4: "a parameter, the sample interval or a solver option is zero, negative or not finite",
}


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
        0.013 N on dampers of this kind and make its sensitivities a hundred times smoother.
    """

    tolerance: float = 3e-3
    dead_band: float = 1e-4
    max_steps_per_sample: int = 10_000
    rounding: float = 100.0


@dataclass(frozen=True, slots=True, eq=False)
class Motion:
    """A displacement as uniform samples of position and velocity.

    Between samples x is the cubic Hermite piece of (x, v). With v from a cubic spline through x
    that is the spline itself.

    Attributes
    ----------
    interval : float
        Sample interval, s.
    displacement, velocity : numpy.ndarray
        Shape (n,); m and m/s, positive in rebound.
    start_time : float
        Time of the first sample, s.
    """

    interval: float
    displacement: FloatArray
    velocity: FloatArray
    start_time: float = 0.0


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


def refuse_amplitude(amplitude: float, damper: Damper) -> None:
    """Refuse an amplitude, m, that leaves the shorter chamber no volume.

    Raises
    ------
    ConfigurationError
        It is the chamber's length or more.
    """
    room = min(damper.chamber_1_length, damper.chamber_2_length)
    if amplitude >= room:
        raise ConfigurationError(
            f"amplitude {1e3 * amplitude:g} mm is beyond the damper's travel; expected less "
            f"than the shorter chamber, {1e3 * room:g} mm"
        )


def sine_motion(amplitude: float, frequency: float, *, cycles: float, sample_rate: float) -> Motion:
    """Return x = A sin(2 pi f t), sampled from t = 0 to the end of the last cycle.

    Parameters
    ----------
    amplitude, frequency : float
        A in m and f in Hz.
    cycles : float
        Length of the motion in cycles.
    sample_rate : float
        Samples per second, Hz.
    """
    phase = 2.0 * np.pi * frequency * _times(cycles / frequency, sample_rate)
    velocity = amplitude * 2.0 * np.pi * frequency * np.cos(phase)
    return Motion(1.0 / sample_rate, amplitude * np.sin(phase), velocity)


def triangle_motion(
    amplitude: float, frequency: float, *, cycles: float, sample_rate: float
) -> Motion:
    """Return a triangle wave that starts upwards from 0, sampled like `sine_motion`."""
    phase = frequency * _times(cycles / frequency, sample_rate) + 0.25
    part = phase - np.floor(phase)
    displacement = amplitude * (1.0 - 4.0 * np.abs(part - 0.5))
    speed = 4.0 * amplitude * frequency
    velocity = np.where(part < 0.5, speed, -speed)
    # At a corner the velocity is the mean of both sides.
    at_corner = np.isclose(part, 0.0, atol=1e-9) | np.isclose(part, 0.5, atol=1e-9)
    at_corner |= np.isclose(part, 1.0, atol=1e-9)
    return Motion(1.0 / sample_rate, displacement, np.where(at_corner, 0.0, velocity))


def simulate(
    parameters: Parameters,
    damper: Damper,
    motion: Motion,
    *,
    sensitivities: Sequence[str] = (),
    options: SolverOptions = SolverOptions(),
) -> Response:
    """Simulate a damper that is driven by a displacement.

    The first sample has one pressure in all chambers and the oil mass of the damper at x = 0;
    the steady cycle is reached within one cycle from there.

    Parameters
    ----------
    parameters : Parameters
        R_m1, R_m2, R_m3, K_e, f_f, f_0 in SI.
    damper : Damper
        Geometry, oil and gas.
    motion : Motion
        Uniform samples of displacement and velocity.
    sensitivities : sequence of str
        Parameters to differentiate the force by: any of `SENSITIVITY_NAMES`.
    options : SolverOptions
        Tolerance and dead band.

    Returns
    -------
    Response
        Force, pressures, masses and sensitivities at the samples.

    Raises
    ------
    SimulationError
        When a state is not finite, a chamber has no volume left, or the step limit is met.

    Examples
    --------
    >>> from damperfit.damper.parameters import PURDY_DAMPER
    >>> y = Parameters(r_m1=1.8e4, r_m2=3.527e6, r_m3=2.597e6, k_e=3.65e8, f_f=50.0)
    >>> response = simulate(y, PURDY_DAMPER, sine_motion(0.032, 1.5, cycles=4, sample_rate=1500))
    >>> round(float(response.force[3100]))  # a tenth into the fourth cycle
    673
    """
    names = tuple(sensitivities)
    for name in names:
        if name not in SENSITIVITY_NAMES:
            hint = did_you_mean(name, SENSITIVITY_NAMES)
            known = ", ".join(SENSITIVITY_NAMES)
            raise SimulationError(f"no sensitivity by {name!r}; there are {known}.{hint}")
    x = np.ascontiguousarray(motion.displacement, dtype=np.float64)
    v = np.ascontiguousarray(motion.velocity, dtype=np.float64)
    n = len(x)
    which = np.array([SENSITIVITY_NAMES.index(name) for name in names], dtype=np.intc)
    pressures, masses, force = np.empty((3, n)), np.empty((2, n)), np.empty(n)
    rows = np.empty((len(names), n))
    numbers = np.array([*astuple(parameters), damper.gas_pressure, damper.gas_exponent])
    code, steps, rejected, newton, sample = _core().simulate(
        _geometry(damper), numbers, x, v, which, pressures, masses, force, rows,
        motion.interval, options.tolerance, options.dead_band, options.max_steps_per_sample,
    )  # fmt: skip
    if code:
        raise SimulationError(_explain(code, sample, motion, options))
    return Response(
        time=motion.start_time + motion.interval * np.arange(n, dtype=np.float64),
        displacement=x,
        velocity=v,
        force=force,
        pressures=pressures,
        masses=masses,
        sensitivities=dict(zip(names, rows, strict=True)),
        work=Work(steps, rejected, newton),
    )


def simulate_network(
    network: Network,
    values: Mapping[str, float],
    damper: Damper,
    motion: Motion,
    *,
    sensitivities: Sequence[str] = (),
    options: SolverOptions = SolverOptions(),
) -> Response:
    """Simulate a damper of any layout that is driven by a displacement.

    The start is that of `simulate`: one pressure in all chambers, the oil mass of x = 0.

    Parameters
    ----------
    network : Network
        Passages between the chambers.
    values : mapping of str to float
        SI, by the names of ``network.numbers``. Of the body's own only ``k_e`` and ``f_f`` are
        needed: free gas and offset are 0, the gas is the damper's, the mounting rigid.
    damper : Damper
        Geometry, oil and gas.
    motion : Motion
        Uniform samples of displacement and velocity.
    sensitivities : sequence of str
        Numbers to differentiate the force by: any of ``network.numbers``.
    options : SolverOptions
        Tolerance, dead band, rounding of the orifices' roots.

    Returns
    -------
    Response
        Force, pressures, masses and sensitivities at the samples. With a floating piston the second
        mass is that of chamber 2 at rest.

    Raises
    ------
    ConfigurationError
        A number is missing or unknown.
    SimulationError
        As `simulate`, and where a number is negative or not finite, or a passage has no resistance.

    Examples
    --------
    >>> from damperfit.damper.network import purdy
    >>> from damperfit.damper.parameters import PURDY_DAMPER
    >>> y = {"r_m1": 1.8e4, "r_m2": 3.527e6, "r_m3": 2.597e6, "k_e": 3.65e8, "f_f": 50.0}
    >>> motion = sine_motion(0.032, 1.5, cycles=4, sample_rate=1500)
    >>> round(float(simulate_network(purdy(), y, PURDY_DAMPER, motion).force[3100]))
    673
    """
    at_rest = {
        "free_gas": 0.0,
        "f_0": 0.0,
        "gas_pressure": damper.gas_pressure,
        "gas_exponent": damper.gas_exponent,
        "gas_volume": damper.gas_volume,
        "series_stiffness": 0.0,
        "play": 0.0,
        "drag": 0.0,
    }
    known = network.numbers
    numbers = at_rest | dict(values)
    for name in (*numbers, *sensitivities):
        if name not in known:
            raise ConfigurationError(
                f"no number {name!r} in {network.name}; there are {', '.join(known)}."
                f"{did_you_mean(name, known)}"
            )
    missing = [name for name in known if name not in numbers]
    if missing:
        raise ConfigurationError(f"{network.name} needs a value of {', '.join(missing)}")
    place = {"": -1} | {name: k for k, name in enumerate(known)}
    passages = [
        [p.start, p.end, *(place[name] for name in p.numbers), p.is_two_way]
        for p in network.passages
    ]
    x = np.ascontiguousarray(motion.displacement, dtype=np.float64)
    v = np.ascontiguousarray(motion.velocity, dtype=np.float64)
    n = len(x)
    pressures, masses, force = np.empty((3, n)), np.empty((2, n)), np.empty(n)
    rows = np.empty((len(sensitivities), n))
    code, steps, rejected, newton, sample = _core().simulate_network(
        _body(damper, network), np.array([numbers[name] for name in known], dtype=np.float64),
        np.array(passages, dtype=np.intc), x, v,
        np.array([place[name] for name in sensitivities], dtype=np.intc),
        pressures, masses, force, rows, motion.interval, options.rounding,
        network.has_floating_piston, options.tolerance, options.dead_band,
        options.max_steps_per_sample,
    )  # fmt: skip
    if code:
        raise SimulationError(_explain(code, sample, motion, options))
    return Response(
        time=motion.start_time + motion.interval * np.arange(n, dtype=np.float64),
        displacement=x,
        velocity=v,
        force=force,
        pressures=pressures,
        masses=masses,
        sensitivities=dict(zip(sensitivities, rows, strict=True)),
        work=Work(steps, rejected, newton),
    )


def _body(damper: Damper, network: Network) -> FloatArray:
    """The order of `df_network` in network.h."""
    return np.array(
        [
            damper.annulus_area,
            damper.piston_area,
            damper.chamber_1_volume,
            damper.chamber_2_volume,
            damper.oil_density,
            damper.rod_area * network.ambient_pressure,
        ]
    )


def _times(duration: float, sample_rate: float) -> FloatArray:
    n = int(np.floor(duration * sample_rate + 1e-9)) + 1
    return np.arange(n, dtype=np.float64) / sample_rate


def _geometry(damper: Damper) -> FloatArray:
    """The order of `df_geometry` in laws.h."""
    return np.array(
        [
            damper.annulus_area,
            damper.piston_area,
            damper.rod_area,
            damper.chamber_1_volume,
            damper.chamber_2_volume,
            damper.gas_volume,
            damper.oil_density,
        ]
    )


def _explain(code: int, sample: int, motion: Motion, options: SolverOptions) -> str:
    what = _ENDINGS[code].format(limit=options.max_steps_per_sample)
    if sample >= len(motion.displacement):
        return f"simulation failed: {what}."
    moment = motion.start_time + sample * motion.interval
    x = motion.displacement[sample]
    return f"simulation failed at sample {sample} ({moment:.6g} s, x = {x:.6g} m): {what}."


def _core() -> ModuleType:
    try:
        from damperfit.damper import _core as core
    except ImportError as error:
        installed = _installed_core()
        if installed is None:
            raise InstallationError(
                f"the compiled core does not load ({error}). "
                "Reinstall it for this Python with: pip install --force-reinstall damperfit"
            ) from error
        return installed
    return core


@lru_cache(maxsize=1)
def _installed_core() -> ModuleType | None:
    """Return the core of the installed package when a checkout without one hides that package.

    Python started in a checkout takes the sources there, after ``pip install .`` too.
    """
    import sys
    from importlib import metadata
    from importlib.machinery import PathFinder
    from importlib.util import module_from_spec
    from pathlib import Path

    from damperfit import __version__

    folders = [str(Path(entry) / "damperfit" / "damper") for entry in sys.path]
    spec = PathFinder.find_spec("damperfit.damper._core", folders)
    try:
        if spec is None or spec.loader is None or metadata.version("damperfit") != __version__:
            return None
        module = module_from_spec(spec)
        spec.loader.exec_module(module)
    except (ImportError, metadata.PackageNotFoundError):
        return None
    return module
