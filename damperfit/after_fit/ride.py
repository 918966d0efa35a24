"""Ride and road-holding by setting: a quarter car on a road, with the damper of a run in the core.

    m_s x_s'' = -F_k - F_d,     m_u x_u'' = F_k + F_d - k_t (x_u - r) - c_t (x_u' - r')

with F_k = k_w (x_s - x_u), and F_d at the wheel: the damper's force times the motion ratio i, its
stroke i (x_s - x_u). The road is one period of a random profile of ISO 8608, so that the linear
part is solved by Fourier series. The damper is simulated by the core along its stroke, with all its
states; both are solved in turn until they agree (a waveform iteration)::

    Z(w) X = road + D,    D = F_d - c (x_s' - x_u'),    c: the linear damping that fits F_d best

Body acceleration is weighted by W_k of ISO 2631-1 (vertical, seated).
"""

from __future__ import annotations

import math
import tomllib
from dataclasses import asdict, dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from damperfit.errors import ConfigurationError, SimulationError
from damperfit.reporting.sheet import Sheet
from damperfit.simulation import Motion
from damperfit.statistics import NORMAL_95
from damperfit.units.quantities import QuantityError, parse_quantity

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from damperfit.damper.model import Values
    from damperfit.results import Run, SettingResult

    FloatArray = NDArray[np.float64]

__all__ = ["Car", "Ride", "RideOfSetting", "read_car", "ride_on_road", "weighting_k"]

# G_d(n_0) at n_0 = 0.1 cycles/m, m3: geometric means of the classes of ISO 8608.
_ROUGHNESS = {name: 16e-6 * 4.0**k for k, name in enumerate("ABCDEFGH")}
_REFERENCE, _WAVINESS = 0.1, 2.0
_RATE, _SECONDS = 512.0, 16.0  # Hz and s of the road's period
_SLOWEST, _FASTEST = 0.01, 10.0  # cycles/m
_ROUNDS, _FREE_ROUNDS, _DEPTH, _AGREED = 60, 4, 6, 1e-3  # of the damper's force, rms
_STEP = 1e-2  # of u, for derivatives
_FRICTION_BAND = 5e-3  # m/s, as in an exported FMU: with the fit's a car at rest would shake
_LIFTS = 0.33  # rms of the dynamic load over the static one: three deviations lift the wheel
_LEAD = 1.0  # s that the damper runs in, before the period
_KEYS = {
    "sprung_mass": "mass",
    "unsprung_mass": "mass",
    "spring": "stiffness",
    "tyre": "stiffness",
    "tyre_damping": "",
    "motion_ratio": "",
    "road": "text",
    "speed": "velocity",
}
_NEEDED = ("sprung_mass", "unsprung_mass", "spring", "tyre")


@dataclass(frozen=True, slots=True)
class Car:
    """A corner of a car and its road, SI.

    Attributes
    ----------
    sprung_mass, unsprung_mass : float
        kg.
    spring, tyre : float
        At the wheel and of the tyre, N/m.
    tyre_damping : float
        N s/m.
    motion_ratio : float
        Stroke of the damper over that of the wheel.
    road : str
        Class of ISO 8608, A to H.
    speed : float
        m/s.
    """

    sprung_mass: float
    unsprung_mass: float
    spring: float
    tyre: float
    tyre_damping: float = 0.0
    motion_ratio: float = 1.0
    road: str = "C"
    speed: float = 20.0


@dataclass(frozen=True, slots=True)
class RideOfSetting:
    """One setting on the road; each number with half of its 95 % interval from the parameters.

    Attributes
    ----------
    setting : str
        Label.
    comfort, comfort_error : float
        Weighted body acceleration, rms, m/s2.
    wheel_load, wheel_load_error : float
        Dynamic wheel load, rms, N.
    load_share : float
        The same over the static load.
    stroke, stroke_error : float
        Of the damper, rms, m.
    outside_s : float
        Seconds of the period in which the damper is faster than its setting was tested.
    period_s : float
        Of the road.
    """

    setting: str
    comfort: float
    wheel_load: float
    load_share: float
    stroke: float
    comfort_error: float
    wheel_load_error: float
    stroke_error: float
    outside_s: float
    period_s: float


@dataclass(frozen=True, slots=True)
class Ride:
    """All settings on one road, and which of them no other beats in both."""

    car: Car
    settings: tuple[RideOfSetting, ...]

    @property
    def pareto(self) -> tuple[str, ...]:
        """Settings that no other one beats in comfort and wheel load."""
        return tuple(
            one.setting
            for one in self.settings
            if not any(
                other.comfort < one.comfort and other.wheel_load < one.wheel_load
                for other in self.settings
            )
        )

    @property
    def sentence(self) -> str:
        """The answer in a sentence."""
        softest = min(self.settings, key=lambda one: one.comfort)
        safest = min(self.settings, key=lambda one: one.wheel_load)
        flying = [one.setting for one in self.settings if one.load_share > _LIFTS]
        warning = (
            "; the wheel leaves the road now and then at setting "
            f"{', '.join(flying)}, where a linear tyre says nothing"
            if flying
            else ""
        )
        if len(self.settings) == 1:
            return (
                f"road {self.car.road} at {self.car.speed:.3g} m/s, setting {softest.setting}: "
                f"{softest.comfort:.3g} m/s2 weighted, wheel load {softest.wheel_load:.3g} N rms"
                f"{warning}"
            )
        return (
            f"road {self.car.road} at {self.car.speed:.3g} m/s: setting {softest.setting} is most "
            f"comfortable ({softest.comfort:.3g} m/s2 weighted), setting {safest.setting} holds "
            f"the road best ({safest.wheel_load:.3g} N rms); no other beats "
            f"{', '.join(self.pareto)} in both{warning}"
        )

    def document(self) -> dict[str, Any]:
        """Return all of it as JSON values."""
        return {
            "car": asdict(self.car),
            "sentence": self.sentence,
            "pareto": list(self.pareto),
            "settings": [asdict(one) for one in self.settings],
        }

    def sheet(self) -> Sheet:
        """Return the table."""
        best = set(self.pareto)
        rows = tuple(
            (
                one.setting,
                f"{one.comfort:.4g} ± {one.comfort_error:.1g}",
                f"{one.wheel_load:.4g} ± {one.wheel_load_error:.1g}",
                f"{100.0 * one.load_share:.3g}",
                f"{1e3 * one.stroke:.3g} ± {1e3 * one.stroke_error:.1g}",
                f"{one.outside_s:.2g}",
                "*" if one.setting in best else "",
            )
            for one in self.settings
        )
        return Sheet(
            ("set", "body acceleration", "wheel load", "of static", "stroke", "untested", ""),
            ("", "m/s2 rms W_k ±95 %", "N rms ±95 %", "%", "mm rms ±95 %", "s of 16", ""),
            rows,
            (False, *(True,) * 5, False),
            ("*: no other setting is better in comfort and wheel load",),
        )


def read_car(path: Path) -> Car:
    """Read [car] of a TOML file.

    Raises
    ------
    ConfigurationError
        A key is missing, unknown or no quantity of its kind.
    """
    from damperfit.io.files import read_text

    if not path.is_file():
        raise ConfigurationError("no such file", subject=path, code="car")
    try:
        table = tomllib.loads(read_text(path))
    except (tomllib.TOMLDecodeError, OSError, UnicodeDecodeError) as error:
        raise ConfigurationError(f"not a TOML file: {error}", subject=path, code="car") from None
    section = table.get("car", table)
    unknown = sorted(set(section) - set(_KEYS))
    missing = sorted(set(_NEEDED) - set(section))
    if unknown or missing:
        raise ConfigurationError(
            f"[car]: {_named('unknown', unknown)}{_named('missing', missing)}"
            f"expected {', '.join(_KEYS)}",
            subject=path,
            code="car",
        )
    values = {name: _value(path, name, section[name]) for name in _KEYS if name in section}
    car = Car(**values)
    if car.road not in _ROUGHNESS:
        raise ConfigurationError(
            f"car.road: found {car.road!r}; expected a class of ISO 8608, A to H",
            subject=path,
            code="car",
        )
    return car


def _named(word: str, keys: list[str]) -> str:
    return f"{word} {', '.join(keys)}; " if keys else ""


def _value(path: Path, name: str, given: object) -> Any:
    kind = _KEYS[name]
    if kind == "text":
        return str(given).upper()
    try:
        value = parse_quantity(str(given), kind) if kind else float(str(given))
    except (QuantityError, ValueError) as error:
        raise ConfigurationError(f"car.{name}: {error}", subject=path, code="car") from None
    if not 0.0 < value < math.inf and name != "tyre_damping":
        raise ConfigurationError(
            f"car.{name}: found {value:g}; expected more than 0", subject=path, code="car"
        )
    return value


def weighting_k(frequencies: NDArray[np.floating[Any]]) -> FloatArray:
    """Return the gain of W_k of ISO 2631-1 at frequencies in Hz.

    Band limits 0.4 and 100 Hz (Q = 1/sqrt 2), transition at 12.5 Hz (Q = 0.63), step at 2.37 and
    3.35 Hz (Q = 0.91).
    """
    s = 2j * np.pi * np.maximum(np.abs(frequencies), 1e-6)

    def second_order(corner: float, q: float) -> Any:
        w = 2.0 * np.pi * corner
        return s**2 + w * s / q + w**2

    butterworth = 1.0 / math.sqrt(2.0)
    w4 = 2.0 * np.pi * 12.5
    w5, w6 = 2.0 * np.pi * 2.37, 2.0 * np.pi * 3.35
    high = s**2 / second_order(0.4, butterworth)
    low = (2.0 * np.pi * 100.0) ** 2 / second_order(100.0, butterworth)
    transition = (1.0 + s / w4) / (1.0 + s / (0.63 * w4) + (s / w4) ** 2)
    step = second_order(2.37, 0.91) / w5**2 / (second_order(3.35, 0.91) / w6**2) * (w5 / w6) ** 2
    return np.asarray(np.abs(high * low * transition * step))


def ride_on_road(run: Run, car: Car, settings: tuple[SettingResult, ...]) -> Ride:
    """Return every setting on the same road.

    Raises
    ------
    SimulationError
        The damper or its solution in the car cannot be found at a setting.
    """
    road = _Road(run, car)
    return Ride(car, tuple(road.ride(setting) for setting in settings))


class _Road:
    """One period of a road, and the linear car on it."""

    def __init__(self, run: Run, car: Car) -> None:
        self.run, self.car = run, car
        self.solver = replace(run.solver, dead_band=_FRICTION_BAND)
        n = round(_RATE * _SECONDS)
        self.frequencies = np.fft.rfftfreq(n, 1.0 / _RATE)
        random = np.random.default_rng(8608)
        spatial = self.frequencies / car.speed
        inside = (spatial >= _SLOWEST) & (spatial <= _FASTEST)
        density = np.zeros(len(spatial))
        density[inside] = (
            _ROUGHNESS[car.road] * (spatial[inside] / _REFERENCE) ** -_WAVINESS / car.speed
        )
        width = self.frequencies[1]
        phases = np.exp(2j * np.pi * random.random(len(spatial)))
        self.profile = phases * np.sqrt(2.0 * density * width) * n / 2.0
        self.n = n

    def ride(self, setting: SettingResult) -> RideOfSetting:
        """The setting's numbers with their errors."""
        values = setting.parameters
        numbers, rest, c, speed = self._solve(values)
        errors = np.zeros(3)
        if setting.covariance is not None and len(setting.names):
            slopes = []
            for name in setting.names:
                quantity = values.quantity(name)
                step = _STEP if quantity.is_logarithmic else _STEP * quantity.size
                u = math.log(values[name]) if quantity.is_logarithmic else values[name]
                moved = math.exp(u + step) if quantity.is_logarithmic else u + step
                changed, *_ = self._solve(values.replace({name: moved}), (rest, c))
                slopes.append((changed - numbers) / step)
            table = np.array(slopes)
            variances = np.einsum("ik,ij,jk->k", table, setting.covariance, table)
            errors = NORMAL_95 * np.sqrt(np.maximum(variances, 0.0))
        errors = np.hypot(errors, _AGREED * numbers)  # what the iteration leaves
        static = (self.car.sprung_mass + self.car.unsprung_mass) * 9.81
        outside = np.abs(speed) > setting.top_speed
        return RideOfSetting(
            setting.label,
            *(float(numbers[0]), float(numbers[1]), float(numbers[1] / static), float(numbers[2])),
            *(float(errors[0]), float(errors[1]), float(errors[2])),
            float(np.count_nonzero(outside) / _RATE),
            _SECONDS,
        )

    def _solve(
        self, values: Values, start: tuple[FloatArray, float] | None = None
    ) -> tuple[FloatArray, FloatArray, float, FloatArray]:
        """Comfort, wheel load and stroke (rms); D and c of the damper; its speed.

        The fixed point of D is found by Anderson mixing: a stiff damper is no small disturbance of
        a linear one.
        """
        car, ratio = self.car, self.car.motion_ratio
        s = 2j * np.pi * self.frequencies
        rest, c = start or (np.zeros(self.n), 0.6 * math.sqrt(car.spring * car.sprung_mass))
        tried: list[tuple[FloatArray, FloatArray]] = []
        left = math.inf
        for round_ in range(_ROUNDS):
            x = self._linear(s, c, rest)
            relative = x[0] - x[1]
            wheel = np.fft.irfft(s * relative, self.n)
            stroke, speed = ratio * np.fft.irfft(relative, self.n), ratio * wheel
            force = ratio * self._damper(values, stroke, speed)
            if start is None and round_ < _FREE_ROUNDS:  # find the linear damping first
                c = max(float(wheel @ force / (wheel @ wheel)), 1.0)
                rest = force - c * wheel
                continue
            residual = force - c * wheel - rest
            left = float(np.std(residual) / np.std(force))
            if left <= _AGREED:
                break
            tried.append((rest, residual))
            rest = _mixed(tried[-_DEPTH:])
        else:
            raise SimulationError(
                f"the damper in the car did not settle within {_ROUNDS} rounds; the last change "
                f"was {100.0 * left:.2g} % of its force"
            )
        body = s**2 * x[0] * weighting_k(self.frequencies)
        load = (car.tyre + car.tyre_damping * s) * (x[1] - self.profile)
        numbers = np.array([_rms(body, self.n), _rms(load, self.n), float(np.std(stroke))])
        return numbers, rest, c, speed

    def _linear(self, s: Any, c: float, rest: FloatArray) -> Any:
        """Body and wheel with linear damping c and a further force of the damper, by frequency."""
        car = self.car
        d = np.fft.rfft(rest)
        tyre = car.tyre + car.tyre_damping * s
        link = car.spring + c * s
        a = car.sprung_mass * s**2 + link
        b = car.unsprung_mass * s**2 + link + tyre
        determinant = a * b - link**2
        push = tyre * self.profile + d
        return np.stack([(link * push - d * b) / determinant, (a * push - link * d) / determinant])

    def _damper(self, values: Values, stroke: FloatArray, speed: FloatArray) -> FloatArray:
        """The damper's own force along one period of its stroke; gas force and tare at rest out."""
        lead = round(_LEAD * _RATE)
        motion = Motion(
            1.0 / _RATE,
            np.concatenate([stroke[-lead:], stroke]),
            np.concatenate([speed[-lead:], speed]),
        )
        seen = self.run.damper.simulate(values, motion, sensitivities=(), options=self.solver)
        force = np.asarray(seen.force[lead:], dtype=np.float64)
        return force - float(np.mean(force))


def _mixed(tried: list[tuple[FloatArray, FloatArray]]) -> FloatArray:
    """The next point of Anderson mixing: least residual of the last ones, combined linearly."""
    point, residual = tried[-1]
    if len(tried) < 2:
        return point + residual
    points = np.stack([point - other for other, _ in tried[:-1]], axis=1)
    residuals = np.stack([residual - other for _, other in tried[:-1]], axis=1)
    weights = np.linalg.lstsq(residuals, residual, rcond=1e-8)[0]
    return np.asarray(point + residual - (points + residuals) @ weights)


def _rms(spectrum: Any, n: int) -> float:
    power = np.abs(spectrum[1:]) ** 2
    return float(np.sqrt(2.0 * power.sum()) / n)
