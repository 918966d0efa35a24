"""Synthetic rig logs with known parameters, the paper's from an integrator that no fit uses.

The paper's model is written out once more in plain Python and integrated by SciPy's Radau, so that
a fit of these logs also tests the compiled core: no law, stepper or start is shared with it. Other
models are simulated as they are fitted. The drive is a sine, hence the force is periodic: one cycle
is computed until it repeats, and then read at any phase.

A log starts in mid-cycle with the machine already running, at another phase for each setting, and
has noise, steps, a rig filter and a temperature. Every log says ``# rig: synthetic (damperfit
samples)``; the true values go to ``truth.csv``. The same options give the same bytes.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple, cast

import numpy as np

from damperfit.arrays import FloatArray
from damperfit.damper.model import Model, Values
from damperfit.damper.purdy.parameters import (
    PURDY_DAMPER,
    REFERENCE_SETTINGS,
    Damper,
    Parameters,
    gas_pressure,
    reference_parameters,
)
from damperfit.errors import ConfigurationError, SimulationError
from damperfit.problem import Key, Option
from damperfit.store import file_set

# Radau's error per step, relative to the oil mass: K_e rtol in pressure. Against rtol 1e-13 the
# force of the reference set is then right to 1e-4 N at every moment.
RTOL = 1e-10
_LONGEST_STEP = 3e-3  # in cycles; 2 ms on the standard test: no reversal is jumped over
_REPEATS = 1e-9  # relative, of the oil mass; the solver cannot repeat itself better
_MOST_CYCLES = 30
_DEAD_BAND = 1e-4  # m/s; friction is linear inside


class SteadyCycle(NamedTuple):
    """One steady cycle of a sine test, x = A sin(2 pi phase); phases are in cycles, shape (n,)."""

    amplitude: float  # m
    frequency: float  # Hz
    force: Callable[[FloatArray], FloatArray]  # of phases; N, friction and offset included

    def displacement(self, phase: FloatArray) -> FloatArray:
        """Return x, m."""
        return np.asarray(self.amplitude * np.sin(2.0 * np.pi * phase))


def cycle_of_masses(
    y: Parameters,
    damper: Damper,
    amplitude: float,
    frequency: float,
    masses: Callable[[FloatArray], FloatArray],
) -> SteadyCycle:
    """Return a cycle by the oil mass in chambers 1 and 2 at a phase, shape (2, n), kg."""

    def force(phase: FloatArray) -> FloatArray:
        x = cycle.displacement(phase)
        speed = 2.0 * np.pi * frequency * amplitude * np.cos(2.0 * np.pi * phase)
        volume_1 = damper.chamber_1_volume - x * damper.annulus_area
        volume_2 = damper.chamber_2_volume + x * damper.piston_area
        p_1, p_2 = (
            np.maximum(0.0, y.k_e * (m / (damper.oil_density * v) - 1.0) + damper.gas_pressure)
            for m, v in zip(masses(np.mod(phase, 1.0)), (volume_1, volume_2), strict=True)
        )
        friction = y.f_f * np.clip(speed / _DEAD_BAND, -1.0, 1.0)
        oil = p_1 * damper.annulus_area - p_2 * damper.piston_area
        return np.asarray(oil + damper.rod_area * damper.ambient_pressure + friction + y.f_0)

    cycle = SteadyCycle(amplitude, frequency, force)
    return cycle


def steady_cycle(
    parameters: Parameters, damper: Damper, *, amplitude: float, frequency: float
) -> SteadyCycle:
    """Integrate a sine test of m and Hz with SciPy's Radau until a cycle repeats the one before.

    Returns the first cycle that ends as it began, to 1e-9 of the oil mass.
    """
    from scipy.integrate import solve_ivp

    gas_pressure(damper, -amplitude)  # refuses a stroke with no room for the gas
    a_p1, a_p2 = damper.annulus_area, damper.piston_area
    v_10, v_20, v_g0 = damper.chamber_1_volume, damper.chamber_2_volume, damper.gas_volume
    rho, p_0, gamma = damper.oil_density, damper.gas_pressure, damper.gas_exponent
    r_m1, r_m2, r_m3, k_e = parameters.r_m1, parameters.r_m2, parameters.r_m3, parameters.k_e
    oil_at_rest = rho * (v_10 + v_20)
    period = 1.0 / frequency

    def rates(phase: float, masses: FloatArray) -> tuple[float, float]:
        """Return dm_1 and dm_2 per cycle, kg."""
        m_1, m_2 = float(masses[0]), float(masses[1])
        x = amplitude * math.sin(2.0 * math.pi * phase)
        p_1 = max(0.0, k_e * (m_1 / (rho * (v_10 - x * a_p1)) - 1.0) + p_0)
        p_2 = max(0.0, k_e * (m_2 / (rho * (v_20 + x * a_p2)) - 1.0) + p_0)
        gas_volume = v_g0 + (m_1 + m_2 - oil_at_rest) / rho
        if gas_volume <= 0.0:
            raise SimulationError(
                "samples: the oil fills the gas space; check stroke and gas length", code="stroke"
            )
        p_3 = p_0 * (v_g0 / gas_volume) ** gamma
        w_1 = math.copysign(math.sqrt(abs(p_1 - p_3)), p_1 - p_3) / r_m1
        w_2 = max(0.0, p_2 - p_1) / r_m2
        w_3 = max(0.0, p_3 - p_2) / r_m3
        return period * (w_2 - w_1), period * (w_3 - w_2)

    masses, gap = np.array([rho * v_10, rho * v_20]), math.inf
    for _ in range(_MOST_CYCLES):
        with np.errstate(divide="ignore", over="ignore"):  # a step without error is no trouble
            solution = solve_ivp(
                rates, (0.0, 1.0), masses, method="Radau", rtol=RTOL, atol=1e-6 * RTOL * masses,
                max_step=_LONGEST_STEP, dense_output=True,
            )  # fmt: skip
        if not solution.success or solution.sol is None:
            raise SimulationError(
                f"samples: {parameters}: {solution.message}", code="not-integrated"
            )
        end = solution.y[:, -1]
        gap = float(np.max(np.abs(end / masses - 1.0)))
        if gap <= _REPEATS:
            return cycle_of_masses(parameters, damper, amplitude, frequency, solution.sol)
        masses = end
    raise SimulationError(
        f"samples: {parameters}: no steady cycle within {_MOST_CYCLES}; state still moves by "
        f"{gap:.1g}, expected {_REPEATS:.0g}; check frequency and parameters",
        code="no-steady-cycle",
    )


# Of a steady cycle by the model's own integrator. Only the paper's is integrated once more in plain
# Python (`steady_cycle`); what is made of the others tests fits and searches for a law.
_SAMPLES = 2000  # of a cycle; 0.3 ms at 1.5 Hz
_CYCLES = 8
_PERIODIC = 1e-3  # of the force's range: what the last two cycles may differ by
_TOLERANCE = 1e-3  # N a step
# At setting 0 and more for each click, N at the highest speed; bump has so much of it.
_FORCE, _CLICK, _BUMP = 250.0, 50.0, 0.6
_OPENS, _THROUGH_BLEED = 0.4, 0.5  # of the highest pressure; of the flow there
# Of the gas pressure of a monotube: with more its upper chamber would run empty in bump.
_OF_GAS = 0.6
_BESIDE = {
    "k_e": 9e8, "f_f": 20.0, "f_0": -10.0, "k_s": 4e5, "play": 5e-4, "lag": 8e-3,
    "moving_mass": 0.5, "presliding": 5e-5, "breakaway": 15.0, "stribeck_speed": 0.02,
    "seal_area": 3e-6, "turning_speed": 2e-3, "rubber": 30.0, "rubber_bend": 4e-4,
}  # fmt: skip


def simulated_cycle(
    values: Values, damper: Model, *, amplitude: float, frequency: float
) -> SteadyCycle:
    """Simulate a sine test of m and Hz until a cycle repeats the one before."""
    from damperfit.simulation import SolverOptions, simulate, sine_motion

    motion = sine_motion(amplitude, frequency, cycles=_CYCLES, sample_rate=_SAMPLES * frequency)
    force = simulate(values, damper, motion, options=SolverOptions(tolerance=_TOLERANCE)).force
    before, last = force[-2 * _SAMPLES - 1 : -_SAMPLES - 1], force[-_SAMPLES - 1 : -1]
    gap = float(np.max(np.abs(last - before)))
    if gap > _PERIODIC * float(np.ptp(last)):
        raise SimulationError(
            f"samples: {damper.name} has no steady cycle within {_CYCLES}: the force still moves "
            f"by {gap:.2g} N; check frequency and parameters",
            code="no-steady-cycle",
        )
    phases = np.arange(_SAMPLES) / _SAMPLES
    return SteadyCycle(
        amplitude, frequency, lambda phase: np.asarray(np.interp(phase, phases, last, period=1.0))
    )


def made_up_values(damper: Model, setting: int, speed: float) -> Values:
    """Return plausible numbers of a damper of real valves, stiffer from click to click.

    `speed` is the highest of the test, m/s.
    """
    from damperfit.damper.network import PARTS
    from damperfit.damper.valve_dampers import STROKES, Monotube, ValveDamper

    if not isinstance(damper, ValveDamper):
        raise ConfigurationError(
            f"samples: no numbers of {damper.name} are known; give a table of its quantities by "
            "setting with {--parameters}, as identify writes it",
            code="no-parameters",
        )
    numbers = dict(_BESIDE)
    for stroke, area, share in zip(STROKES, damper.pressed_areas, (1.0, _BUMP), strict=True):
        highest = share * (_FORCE + _CLICK * setting) / area
        if isinstance(damper, Monotube) and stroke == "compression":
            highest = min(highest, _OF_GAS * damper.gas_pressure)
        flow = _THROUGH_BLEED * damper.oil_density * area * speed
        opening, bleed = _OPENS * highest, math.sqrt(highest) / flow
        slope = (highest - opening) / flow
        parts = {p: part.guess(opening, slope, highest, flow) for p, part in PARTS.items()}
        numbers |= {f"{stroke}_{p}": number for p, number in (parts | {"bleed": bleed}).items()}
    return damper.values({name: value for name, value in numbers.items() if name in damper.names})


_MADE_UP = "# rig: synthetic (damperfit samples)"


@dataclass(frozen=True, slots=True, kw_only=True)
class SampleOptions:
    """What the synthetic test and its instruments are like, in SI."""

    settings: tuple[int, ...] = REFERENCE_SETTINGS  # one log each
    cycles: float = 15.0  # length of a log
    sample_rate: float = 500.0  # Hz
    amplitude: float = 0.032  # m
    frequency: float = 1.5  # Hz
    force_noise: float = 4.0  # white sensor noise, rms, N; 0 for none
    displacement_noise: float = 8e-6  # m
    force_resolution: float = 0.1  # smallest step of the log, N; 0 writes all digits
    displacement_resolution: float = 1e-6  # m
    # Corner of a 4th-order Butterworth filter in the rig, both channels, after the sensors; Hz.
    # 0 for none. With it, noise is white before the filter.
    rig_filter: float = 0.0
    temperature: float = 26.0  # mean, degrees Celsius; it wanders by up to 1 degree about it
    seed: int = 2000  # same seed, same logs
    damper: Model = PURDY_DAMPER  # geometry, oil and gas of it

    def __post_init__(self) -> None:
        """Refuse options that make no log."""
        for name in ("cycles", "sample_rate", "amplitude", "frequency"):
            _expect(name, getattr(self, name), "more than 0", 0.0 < getattr(self, name) < math.inf)
        noise = ("force_noise", "displacement_noise", "rig_filter", "seed")
        for name in (*noise, "force_resolution", "displacement_resolution"):
            _expect(name, getattr(self, name), "0 or more", 0.0 <= getattr(self, name) < math.inf)
        is_list = len(self.settings) == len(set(self.settings)) > 0 and min(self.settings) >= 0
        _expect("settings", self.settings, "at least one, each once, 0 or more", is_list)
        shortest = self.damper.travel
        wanted = f"less than the chamber's length, {shortest:.4g} m"
        _expect("amplitude", self.amplitude, wanted, self.amplitude < shortest)
        wanted = f"less than half the sample rate, {self.sample_rate / 2.0:.4g} Hz"
        _expect("rig_filter", self.rig_filter, wanted, self.rig_filter < self.sample_rate / 2.0)
        _expect("cycles", self.cycles, "a log of 2 samples or more", self.n_samples >= 2)

    @property
    def n_samples(self) -> int:
        """Samples in a log."""
        return round(self.cycles * self.sample_rate / self.frequency)


def _expect(name: str, value: object, wanted: str, is_fine: bool) -> None:  # noqa: FBT001
    if not is_fine:
        if name in {"amplitude", "frequency"}:
            raise ConfigurationError(
                f"found {value}, expected {wanted}", where=Key(("rig", name)), code="out-of-range"
            )
        raise ConfigurationError(
            f"expected {wanted}", where=Option(name, value), code="out-of-range"
        )


def _through_rig_filter(
    channel: Callable[[FloatArray], FloatArray], phase: FloatArray, options: SampleOptions
) -> FloatArray:
    """Return a periodic channel at ``phase`` behind the rig's analogue filter, steady state.

    Exact by Fourier series: each harmonic is multiplied by the filter's response. Harmonics
    beyond 20 corners are dropped; the filter has taken 1.6e5 times off them.
    """
    from scipy.signal import butter, freqs

    highest = max(1, math.ceil(20.0 * options.rig_filter / options.frequency))
    n = 1 << math.ceil(math.log2(32 * highest))
    harmonics = np.fft.rfft(channel(np.arange(n) / n))[: highest + 1] / n
    numerator, denominator = butter(4, 2.0 * np.pi * options.rig_filter, analog=True)
    orders = np.arange(highest + 1)
    _, response = freqs(numerator, denominator, 2.0 * np.pi * options.frequency * orders)
    weights = harmonics * response
    total = np.full(len(phase), weights[0].real)
    for order in orders[1:]:
        total += 2.0 * (weights[order] * np.exp(2j * np.pi * order * phase)).real
    return total


def _noise(random: np.random.Generator, n: int, rms: float, options: SampleOptions) -> FloatArray:
    """Return sensor noise, behind the rig's filter if there is one."""
    if options.rig_filter == 0.0:
        return np.asarray(random.normal(0.0, 1.0, n) * rms)
    from scipy.signal import butter, sosfilt

    lead = math.ceil(options.sample_rate / options.rig_filter * 4)  # filter has settled by then
    white = random.normal(0.0, 1.0, n + lead) * rms
    sections = butter(4, options.rig_filter, fs=options.sample_rate, output="sos")
    return np.asarray(sosfilt(sections, white)[lead:])


def _written(values: FloatArray, resolution: float) -> list[str]:
    """Return numbers as text, in whole steps of ``resolution``, or with all digits for 0."""
    if resolution == 0.0:
        return [repr(value) for value in values.tolist()]
    decimals = max(0, -math.floor(math.log10(resolution) + 1e-9))
    while decimals < 12 and abs(round(resolution, decimals) - resolution) > 1e-9 * resolution:
        decimals += 1
    steps = np.round(values / resolution) * resolution + 0.0  # + 0.0 makes -0.0 a plain zero
    return [f"{value:.{decimals}f}" for value in steps.tolist()]


def _log_text(cycle: SteadyCycle, setting: int, options: SampleOptions) -> str:
    """Return one log in the project's dialect."""
    random = np.random.default_rng([options.seed, setting])
    n = options.n_samples
    time = np.arange(n) / options.sample_rate
    phase = random.uniform(0.0, 1.0) + options.frequency * time
    displacement, force = cycle.displacement(phase), cycle.force(phase)
    if options.rig_filter > 0.0:
        displacement = _through_rig_filter(cycle.displacement, phase, options)
        force = _through_rig_filter(cycle.force, phase, options)
    displacement = displacement + _noise(random, n, options.displacement_noise, options)
    force = force + _noise(random, n, options.force_noise, options)
    is_whole_ms = abs(1e3 / options.sample_rate - round(1e3 / options.sample_rate)) < 1e-12
    # A slow drift that stays within 1 degree of the mean.
    turn = np.linspace(0.0, 2.0 * np.pi * random.uniform(0.2, 0.8), n)
    start = random.uniform(0.0, 2.0 * np.pi)
    drift = random.uniform(0.3, 0.7) * np.sin(turn + start)
    ripple = 0.2 * np.sin(7.3 * turn + random.uniform(0.0, 2.0 * np.pi))
    columns = (
        _written(time, 1e-3 if is_whole_ms else 0.0),
        _written(1e3 * displacement, 1e3 * options.displacement_resolution),
        _written(force, options.force_resolution),
        _written(options.temperature + drift + ripple, 0.1),
    )
    preamble = (
        "# damperfit rig log",
        f"# setting: {setting}",
        _MADE_UP,
        "time_s,displacement_mm,force_N,temperature_degC",
    )
    return "\n".join([*preamble, *(",".join(row) for row in zip(*columns, strict=True)), ""])


def _readme_text(options: SampleOptions, *, is_reference: bool) -> str:
    """Return the page that says what these files are, and what they are not."""
    source = "They are values that the caller of `make_samples` gave."
    if is_reference:
        source = (
            "They are the project's own reference\n  set, chosen so that it shows what Purdy's "
            "paper describes in words; of its numbers only\n  R_m3 = 2.597e6 and f_f = 50 N are "
            "the paper's."
        )
    damper = options.damper
    at_rest = damper.rest_force(np.zeros(1))
    push = 0.0 if at_rest is None else -float(at_rest[0])
    integrator = f"SciPy's Radau, relative tolerance {RTOL:g}; damperfit fits with another one"
    if damper.name != PURDY_DAMPER.name:
        integrator = (
            "the one that damperfit fits with: these logs prove fits, not the integrator.\n"
            f"- Model: {damper.name}: {damper.sentence}"
        )
        if is_reference:
            source = "They are synthetic: plausible, and stiffer from setting to setting."
    corner = f"{options.rig_filter:g} Hz (4th-order Butterworth, analogue)"
    return f"""# Synthetic rig logs

**No damper was ever measured for these files.** They are computed by `damperfit samples`, for
trying and testing damperfit, and must not be taken for measurements of any real damper.

- `truth.csv` holds the true parameters in SI units. {source}
- Drive: sine, {1e3 * options.amplitude:g} mm, {options.frequency:g} Hz; {options.cycles:g} cycles \
logged at {options.sample_rate:g} Hz. The machine is
  already running when a log starts, at another point of the cycle in each log.
- Integrator: {integrator}.
- Noise (white, rms): {options.force_noise:g} N, {1e6 * options.displacement_noise:g} um.
- Smallest step (0: all digits): {options.force_resolution:g} N, \
{1e6 * options.displacement_resolution:g} um.
- Filter in the rig, both channels: {corner if options.rig_filter > 0.0 else "none"}.
- Signs: positive is rebound (rod out, tension). The force is not tared: at mid-stroke the gas
  pushes the rod out with {push:.1f} N.
- The temperature is decoration; it has no effect on the force.
- Seed {options.seed}: the same options give the same bytes.
"""


def _is_own(path: Path) -> bool:
    """Whether a file was made by this module: one that a rig wrote is never touched."""
    begins = {"README.md": "# Synthetic rig logs", "truth.csv": "setting,"}.get(path.name)
    try:
        with path.open("rb") as file:
            head = file.read(200).decode("ascii", "replace")
    except OSError:
        return False
    return head.startswith(begins) if begins else _MADE_UP in head


def make_samples(  # noqa: PLR0912  # refuses first, then writes the set
    folder: str | Path,
    options: SampleOptions | None = None,
    *,
    parameters: Mapping[int, Values] | None = None,
    on_log: Callable[[Path], None] | None = None,
) -> tuple[Path, ...]:
    """Write one synthetic log for each setting, ``truth.csv`` and ``README.md``, as a set.

    The folder is made when it does not exist; files of the same name are replaced, and synthetic
    logs of other settings go. Returns the logs, in the order of ``options.settings``.

    Parameters
    ----------
    options : SampleOptions, optional
        Test, instruments, damper; the default is the paper's test at 500 Hz.
    parameters : mapping of int to Values, optional
        True values by setting, of the options' damper; default: the reference set of the paper's
        model, synthetic valves of the others.
    on_log : callable, optional
        Called with the path of each log when it is computed (for progress).

    Raises
    ------
    ConfigurationError
        A setting has no parameters, or there are none for such a model; a file of another
        origin stands where one is to go.
    SimulationError
        The model cannot be integrated.
    OutputError
        A file cannot be written.
    """
    options = options or SampleOptions()
    damper, folder = options.damper, Path(folder)
    missing = [s for s in options.settings if parameters is not None and s not in parameters]
    if missing:
        raise ConfigurationError(
            f"samples: no parameters given for settings {missing}", code="no-parameters"
        )
    truth: dict[int, Values] = {}
    speed = 2.0 * math.pi * options.frequency * options.amplitude
    for setting in options.settings:
        if parameters is not None:
            truth[setting] = parameters[setting]
        elif isinstance(damper, Damper):
            truth[setting] = reference_parameters(setting)
        else:
            truth[setting] = made_up_values(damper, setting, speed)
        if truth[setting].names != damper.names:
            raise ConfigurationError(
                f"samples: the parameters are of {', '.join(truth[setting].names)}; {damper.name} "
                f"has {', '.join(damper.names)}: name their own model ({{--model}}, damper.model)",
                code="other-model",
            )
    paths = {setting: folder / f"setting_{setting:02d}.csv" for setting in truth}
    for path in (*paths.values(), folder / "README.md", folder / "truth.csv"):
        if path.is_file() and not _is_own(path):
            raise ConfigurationError(
                "is there, and was not written by samples; choose another folder, or move "
                "that file",
                subject=path,
                code="is-there",
            )
    drive = {"amplitude": options.amplitude, "frequency": options.frequency}
    with file_set(folder) as files:
        for path in folder.glob("setting_*.csv"):
            if path not in paths.values() and _is_own(path):  # truth.csv will not speak of it
                files.without(path.name)
        for setting, true in truth.items():
            if isinstance(damper, Damper):
                cycle = steady_cycle(cast("Parameters", true), damper, **drive)
            else:
                cycle = simulated_cycle(true, damper, **drive)
            text = _log_text(cycle, setting, options)
            files.path(paths[setting].name).write_bytes(text.encode())
            if on_log is not None:
                on_log(paths[setting])
        readme = _readme_text(options, is_reference=parameters is None)
        files.path("README.md").write_bytes(readme.encode())
        numbers = {setting: map(repr, map(float, true.numbers)) for setting, true in truth.items()}
        rows = [("setting", *damper.names), *((str(s), *own) for s, own in numbers.items())]
        lines = "".join(",".join(row) + "\n" for row in rows)
        files.path("truth.csv").write_bytes(lines.encode())  # every digit, SI
    return tuple(paths.values())
