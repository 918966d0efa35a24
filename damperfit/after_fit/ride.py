"""Ride and road-holding by setting: a quarter car on a road, with the damper of a run in the core.

    m_s x_s'' = -F_k - F_d,     m_u x_u'' = F_k + F_d - k_t (x_u - r) - c_t (x_u' - r')

with F_k = k_w (x_s - x_u), and F_d at the wheel: the damper's force times the motion ratio i, its
stroke i (x_s - x_u). The road is one period of a random profile of ISO 8608, so that the linear
part is solved by Fourier series. The damper is simulated by the core along its stroke, with all its
states; both are solved in turn until they agree (a waveform iteration)::

    Z(w) X = road + D,    D = F_d - c (x_s' - x_u'),    c: the linear damping that fits F_d best

Body acceleration is weighted by W_k of ISO 2631-1 (vertical, seated). A damper stroke that was
measured on a car takes the place of car and road: what each setting dissipates along it.
"""

from __future__ import annotations

import math
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from damperfit.conditioning.filters import apply_filter, design_filter, differentiate
from damperfit.errors import ConfigurationError, SimulationError
from damperfit.io import ReadOptions, read_log
from damperfit.io.files import read_text
from damperfit.reporting.answer import Answer
from damperfit.reporting.sheet import Column, Sheet, laid_out
from damperfit.simulation import Motion
from damperfit.statistics import NORMAL_95
from damperfit.tables.files import json_values
from damperfit.units.quantities import QuantityError, parse_quantity

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from damperfit.damper.model import Values
    from damperfit.results import Run, SettingResult

    FloatArray = NDArray[np.float64]

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
_EDGES = (0.0, 0.025, 0.05, 0.1, 0.2, 0.5, np.inf)  # m/s, of bands of speed
_FEWEST = 10  # samples of a stroke
# Hz, of a stroke: a wheel hops at 10 to 20. Sampled less than so many times faster it is as logged.
_STROKE_CORNER, _STROKE_RATE = 40.0, 4.0
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


class Car(NamedTuple):
    """A corner of a car and its road, SI."""

    sprung_mass: float  # kg
    unsprung_mass: float  # kg
    spring: float  # at the wheel, N/m
    tyre: float  # N/m
    tyre_damping: float = 0.0  # N s/m
    motion_ratio: float = 1.0  # stroke of the damper over that of the wheel
    road: str = "C"  # class of ISO 8608, A to H
    speed: float = 20.0  # m/s


class RideOfSetting(NamedTuple):
    """One setting on the road; each number with half of its 95 % interval from the parameters."""

    setting: str  # label
    comfort: float  # weighted body acceleration, rms, m/s2
    wheel_load: float  # dynamic wheel load, rms, N
    load_share: float  # the same over the static load
    stroke: float  # of the damper, rms, m
    comfort_error: float  # weighted body acceleration, rms, m/s2
    wheel_load_error: float  # dynamic wheel load, rms, N
    stroke_error: float  # of the damper, rms, m
    # Seconds of the period in which the damper is faster than its setting was tested.
    outside_s: float
    period_s: float = _SECONDS  # of the road


@dataclass(frozen=True, repr=False, eq=False)
class Ride(Answer):
    """All settings on one road."""

    car: Car
    settings: tuple[RideOfSetting, ...]
    lost: tuple[str, ...] = ()  # settings so stiff that the iteration does not settle

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
    def sentence(self) -> str:  # type: ignore[override]
        """The answer in a sentence."""
        softest = min(self.settings, key=lambda one: one.comfort)
        safest = min(self.settings, key=lambda one: one.wheel_load)
        comfort, load = f"{softest.comfort:.3g} m/s2 weighted", f"{safest.wheel_load:.3g} N rms"
        road = f"road {self.car.road} at {self.car.speed:.3g} m/s"
        text = f"{road}, setting {softest.setting}: {comfort}, wheel load {load}"
        if len(self.settings) > 1:
            text = (
                f"{road}: setting {softest.setting} is most comfortable ({comfort}), setting "
                f"{safest.setting} holds the road best ({load}); no other beats "
                f"{', '.join(self.pareto)} in both"
            )
        if flying := [one.setting for one in self.settings if one.load_share > _LIFTS]:
            text += (
                f"; the wheel leaves the road now and then at setting {', '.join(flying)}, where a "
                "linear tyre says nothing"
            )
        if self.lost:
            text += f"; not settled, left out: setting {', '.join(self.lost)}"
        return text

    def document(self) -> dict[str, Any]:
        """Return all of it as JSON values."""
        return {
            "car": self.car._asdict(),
            "sentence": self.sentence,
            "pareto": list(self.pareto),
            "lost": list(self.lost),
            "settings": [one._asdict() for one in self.settings],
        }

    def sheets(self) -> tuple[Sheet]:
        """Return the table."""
        best = set(self.pareto)

        def numbers(heading: str, unit: str, name: str, size: float = 1.0) -> Column:
            def cell(row: RideOfSetting) -> str:
                value, error = getattr(row, name), getattr(row, f"{name}_error")
                digits = 3 if size != 1.0 else 4
                return f"{size * value:.{digits}g} ± {size * error:.1g}"

            return Column(heading, unit, cell)

        columns = (
            Column("set", "", lambda row: row.setting, is_number=False),
            numbers("body acceleration", "m/s2 rms W_k ±95 %", "comfort"),
            numbers("wheel load", "N rms ±95 %", "wheel_load"),
            Column("of static", "%", lambda row: f"{100.0 * row.load_share:.3g}"),
            numbers("stroke", "mm rms ±95 %", "stroke", 1e3),
            Column("untested", "s of 16", lambda row: f"{row.outside_s:.2g}"),
            Column("", "", lambda row: "*" * (row.setting in best), is_number=False),
        )
        note = "*: no other setting is better in comfort and wheel load"
        return (laid_out(self.settings, columns, note),)


def read_car(given: Path | Mapping[str, Any]) -> Car:
    """Read [car] of a TOML file, or its keys."""

    def wrong(text: str) -> ConfigurationError:
        subject = given if isinstance(given, Path) else ""
        return ConfigurationError(text, subject=subject, code="car")

    table: Mapping[str, Any] = {}
    if isinstance(given, Mapping):
        table = given
    elif not given.is_file():
        raise wrong("no such file")
    else:
        try:
            table = tomllib.loads(read_text(given))
        except (tomllib.TOMLDecodeError, OSError, UnicodeDecodeError) as error:
            raise wrong(f"not a TOML file: {error}") from None
    section = table.get("car", table)
    unknown, missing = sorted({*section} - {*_KEYS}), sorted({*_NEEDED} - {*section})
    if unknown or missing:
        lists = {"unknown": unknown, "missing": missing}
        words = (f"{word} {', '.join(keys)}; " for word, keys in lists.items() if keys)
        raise wrong(f"[car]: {''.join(words)}expected {', '.join(_KEYS)}")
    values: dict[str, Any] = {}
    for name, value in section.items():
        kind = _KEYS[name]
        try:
            if kind == "text":
                values[name] = str(value).upper()
                continue
            values[name] = parse_quantity(str(value), kind) if kind else float(value)
        except (QuantityError, TypeError, ValueError) as error:
            raise wrong(f"car.{name}: {error}") from None
        if not 0.0 < values[name] < math.inf and name != "tyre_damping":
            raise wrong(f"car.{name}: found {values[name]:g}; expected more than 0")
    car = Car(**values)
    if car.road not in _ROUGHNESS:
        raise wrong(f"car.road: found {car.road!r}; expected a class of ISO 8608, A to H")
    return car


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


def ride_on_road(run: Run, car: Car, settings: Sequence[SettingResult]) -> Ride:
    """Return every setting on the same road."""
    road = _Road(run, car)
    ridden: list[RideOfSetting] = []
    lost: list[str] = []
    for setting in settings:
        try:
            ridden.append(road.ride(setting))
        except SimulationError:
            lost.append(setting.label)
            if len(lost) == len(settings):
                raise
    return Ride(car, tuple(ridden), tuple(lost))


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
                f"was {100.0 * left:.2g} % of its force",
                code="not-settled",
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


class Band(NamedTuple):
    """One band of speed: share of the time in it, and the mean power of each setting there, W."""

    low: float
    high: float
    share: float
    powers: dict[str, float]


@dataclass(frozen=True, repr=False, eq=False)
class DrivenStroke(Answer):
    """What settings do along a measured stroke; outside: s beyond the tested speed by setting."""

    seconds: float
    bands: tuple[Band, ...]
    outside: dict[str, float]

    @property
    def sentence(self) -> str:  # type: ignore[override]
        """Where most of the energy goes, and where the clicks act."""
        labels = list(self.outside)
        first, last = labels[0], labels[-1]
        most = max(self.bands, key=lambda band: sum(band.powers.values()))
        text = (
            f"{self.seconds:.3g} s; most energy is dissipated at {most.low:g} to "
            f"{most.high:g} m/s, in {100.0 * most.share:.2g} % of the time"
        )
        if first == last:
            return text
        acting = max(self.bands, key=lambda band: abs(band.powers[last] - band.powers[first]))
        return (
            f"{text}; from setting {first} to {last} the clicks act most at {acting.low:g} to "
            f"{acting.high:g} m/s"
        )

    def document(self) -> dict[str, Any]:
        """Return all of it as JSON values."""
        document: dict[str, Any] = json_values(
            {
                "seconds": self.seconds,
                "sentence": self.sentence,
                "bands": [band._asdict() for band in self.bands],
                "outside_s": self.outside,
            }
        )
        return document

    def sheets(self) -> tuple[Sheet]:
        """Return one row a setting, one column a band of speed."""

        def power(band: Band) -> Column:
            def cell(label: str) -> str:
                return f"{band.powers[label]:.3g}" if label else f"{100.0 * band.share:.3g} %"

            return Column(f"{band.low:g} to {band.high:g}", "W at m/s", cell)

        columns = (
            Column("set", "", lambda label: label or "time", is_number=False),
            *(power(band) for band in self.bands if band.share > 0.0),
            Column("untested", "s", lambda label: f"{self.outside[label]:.2g}" if label else ""),
        )
        return (laid_out(["", *self.outside], columns),)


def drive_along(run: Run, motion: Motion, settings: Sequence[SettingResult]) -> DrivenStroke:
    """Return what settings of a run dissipate along a stroke, by band of speed."""
    speed = np.abs(motion.velocity)
    inside = [(low <= speed) & (speed < high) for low, high in pairwise(_EDGES)]
    powers: dict[str, list[float]] = {}
    outside: dict[str, float] = {}
    for setting in settings:
        seen = run.damper.simulate(setting.parameters, motion, sensitivities=(), options=run.solver)
        rest = run.damper.rest_force(motion.displacement)
        work = (seen.force - (0.0 if rest is None else rest)) * motion.velocity
        powers[setting.label] = [float(work[part].sum() / len(speed)) for part in inside]
        outside[setting.label] = float(np.sum(speed > setting.top_speed) * motion.interval)
    bands = tuple(
        Band(low, high, float(np.mean(part)), {label: mine[k] for label, mine in powers.items()})
        for k, ((low, high), part) in enumerate(zip(pairwise(_EDGES), inside, strict=True))
    )
    return DrivenStroke(len(speed) * motion.interval, bands, outside)


def read_stroke(path: Path) -> Motion:
    """Read time and displacement of a log of a car, as in ``time_s,displacement_mm``.

    Steps of its converter would be speed: above `_STROKE_CORNER` nothing of them is left.
    """
    if not path.is_file():
        raise ConfigurationError("no such file", subject=path, code="stroke")
    log = read_log(path, ReadOptions(needs_force=False))
    if len(log.time) < _FEWEST:
        sentence = f"found {len(log.time)} rows; expected {_FEWEST} or more"
        raise ConfigurationError(sentence, subject=path, code="stroke")
    interval = float(np.median(np.diff(log.time)))
    x = np.interp(np.arange(log.time[0], log.time[-1], interval), log.time, log.displacement)
    x -= 0.5 * (x.max() + x.min())
    if interval < 1.0 / (_STROKE_RATE * _STROKE_CORNER):
        low_pass = design_filter("zero_phase", _STROKE_CORNER, sample_rate=1.0 / interval, order=4)
        x = apply_filter(low_pass, x)
    return Motion(interval, x, differentiate(x, interval))
