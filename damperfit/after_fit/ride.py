"""Ride and road-holding by setting: a quarter car on a road, with the damper of a run in the core.

    m_s x_s'' = -F_k - F_d,     m_u x_u'' = F_k + F_d - k_t (x_u - r) - c_t (x_u' - r')

with F_k = k_w (x_s - x_u), and F_d at the wheel: the damper's force times the motion ratio i, its
stroke i (x_s - x_u). The road is one period of a random profile of ISO 8608, so that the linear
part is solved by Fourier series. The damper is simulated by the core along its stroke, with all its
states; both are solved in turn until they agree (a waveform iteration)::

    Z(w) X = road + D,    D = F_d - c (x_s' - x_u'),    c: a linear damping near that of F_d

Body acceleration is weighted by W_k of ISO 2631-1 (vertical, seated). A damper stroke that was
measured on a car takes the place of car and road: what each setting dissipates along it.
"""

from __future__ import annotations

import math
import tomllib
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from damperfit.arrays import FloatArray
from damperfit.conditioning.filters import apply_filter, design_filter, differentiate
from damperfit.configuration.damper_section import not_a_section, unknown_key
from damperfit.damper.model import RIG, Values
from damperfit.damper.network import without_rig
from damperfit.damper.quasi_static import quasi_static
from damperfit.errors import ConfigurationError, SimulationError, blamed_on
from damperfit.io import ReadOptions, read_log
from damperfit.io.files import read_text, why_unread
from damperfit.problem import Key
from damperfit.reporting.answer import Answer
from damperfit.reporting.plots import Line, Panel, Plot, setting_colours
from damperfit.reporting.sheet import Column, Sheet, laid_out, number, with_interval
from damperfit.sections import Section, key
from damperfit.simulation import Motion
from damperfit.statistics import NORMAL_95
from damperfit.tables.files import json_values
from damperfit.units.quantities import parse_quantity
from damperfit.workers import available_cores, executor

if TYPE_CHECKING:
    from damperfit.results import Run
    from damperfit.settings_and_logs import SettingResult

# G_d(n_0) at n_0 = 0.1 cycles/m, m3: geometric means of the classes of ISO 8608.
_ROUGHNESS = {name: 16e-6 * 4.0**k for k, name in enumerate("ABCDEFGH")}
_REFERENCE, _WAVINESS = 0.1, 2.0
_RATE, _SECONDS = 512.0, 16.0  # Hz and s of the road's period
_SLOWEST, _FASTEST = 0.01, 10.0  # cycles/m
_ROUNDS, _DEPTH, _AGREED, _LEFT = 60, 6, 1e-3, 0.05  # of the damper's force, rms
_STEP, _RESOLVED = 1e-2, 0.5  # of u, for derivatives; of what the step changes
_TOLERANCE = 3e-5  # of the static load: what a step of the integrator may be off
_ROUNDING = 1e-10  # of the products of secants
_FRICTION_BAND = 5e-3  # m/s, as in an exported FMU: with the fit's a car at rest would shake
_LIFTS = 0.33  # rms of the dynamic load over the static one: three deviations lift the wheel
_LEAD = 1.0  # s that the damper runs in, before the period
_FIRST, _LINEARISED = 2e3, 8  # N s/m, and how often it is found anew
_EDGES = (0.0, 0.025, 0.05, 0.1, 0.2, 0.5, np.inf)  # m/s, of bands of speed
_FEWEST, _BINS = 10, 40  # samples of a stroke, bins of its speed
# Hz, of a stroke: a wheel hops at 10 to 20. Sampled less than so many times faster it is as logged.
_STROKE_CORNER, _STROKE_RATE = 40.0, 4.0


class Car(Section):
    """[car]: a corner of a car and its road, SI."""

    name = "car"
    sprung_mass: float = key("", "of the body", "mass", above=0.0)
    unsprung_mass: float = key("", "of the wheel", "mass", above=0.0)
    spring: float = key("", "at the wheel", "stiffness", above=0.0)
    tyre: float = key("", "its stiffness", "stiffness", above=0.0)
    tyre_damping: float = key(0.0, "N s/m", least=0.0)
    motion_ratio: float = key(1.0, "stroke of the damper over that of the wheel", above=0.0)
    road: str = key("C", "class of ISO 8608", words=tuple(_ROUGHNESS))
    speed: float = key("20m/s", "of the car", "velocity", above=0.0)


class RideOfSetting(NamedTuple):
    """One setting on the road; each number with half of its 95 % interval from the parameters."""

    setting: str  # label
    comfort: float  # weighted body acceleration, rms, m/s2
    wheel_load: float  # dynamic wheel load, rms, N
    load_share: float  # the same over the static load
    stroke: float  # of the damper, rms, m
    comfort_error: float
    wheel_load_error: float
    stroke_error: float
    # Seconds of the period in which the damper is faster than its setting was tested.
    outside_s: float
    period_s: float = _SECONDS  # of the road


@dataclass(frozen=True, repr=False, eq=False)
class Ride(Answer):
    """All settings on one road."""

    car: Car
    settings: tuple[RideOfSetting, ...]
    lost: tuple[str, ...] = ()  # settings without numbers
    remarks: tuple[str, ...] = ()  # and why

    @property
    def pareto(self) -> tuple[str, ...]:
        """Settings that no other one beats in comfort and wheel load."""
        return self._unbeaten(errors=0.0)

    @property
    def undecided(self) -> tuple[str, ...]:
        """Settings that others beat, but none by more than the 95 % intervals of both."""
        return tuple(label for label in self._unbeaten(errors=1.0) if label not in self.pareto)

    def _unbeaten(self, errors: float) -> tuple[str, ...]:
        def beats(other: RideOfSetting, own: RideOfSetting) -> bool:
            comfort = math.hypot(own.comfort_error, other.comfort_error)
            load = math.hypot(own.wheel_load_error, other.wheel_load_error)
            is_softer = other.comfort < own.comfort - errors * comfort
            return is_softer and other.wheel_load < own.wheel_load - errors * load

        rows = self.settings
        return tuple(own.setting for own in rows if not any(beats(other, own) for other in rows))

    @property
    def sentence(self) -> str:  # type: ignore[override]
        """The answer in a sentence."""
        softest = min(self.settings, key=lambda row: row.comfort)
        safest = min(self.settings, key=lambda row: row.wheel_load)
        comfort, load = f"{softest.comfort:.3g} m/s2 weighted", f"{safest.wheel_load:.3g} N rms"
        text = (
            f": setting {softest.setting} is most comfortable ({comfort}), setting "
            f"{safest.setting} holds the road best ({load}); no other beats "
            f"{', '.join(self.pareto)} in both"
        )
        if self.undecided:
            text += f", nor {', '.join(self.undecided)} by more than the 95 % intervals"
        if len(self.settings) == 1:
            text = f", setting {softest.setting}: {comfort}, wheel load {load}"
        if flying := [row.setting for row in self.settings if row.load_share > _LIFTS]:
            text += (
                f"; the wheel leaves the road now and then at setting {', '.join(flying)}, where a "
                "linear tyre says nothing"
            )
        return f"road {self.car.road} at {self.car.speed:.3g} m/s{text}"

    def document(self) -> dict[str, Any]:
        """Return all of it as JSON values."""
        return {
            "car": vars(self.car),
            "sentence": self.sentence,
            "pareto": list(self.pareto),
            "undecided": list(self.undecided),
            "lost": list(self.lost),
            "remarks": list(self.remarks),
            "settings": [row._asdict() for row in self.settings],
        }

    def sheets(self) -> tuple[Sheet]:
        """Return the table."""

        def numbers(heading: str, unit: str, name: str, size: float = 1.0) -> Column:
            def cell(row: RideOfSetting) -> str:
                value, error = size * getattr(row, name), size * getattr(row, f"{name}_error")
                return with_interval(value, value - error, value + error)

            return Column(heading, unit, cell)

        marks = dict.fromkeys(self.pareto, "*") | dict.fromkeys(self.undecided, "(*)")
        columns = (
            Column("set", "", lambda row: row.setting, is_number=False),
            numbers("body acceleration", "m/s2 rms W_k ±95 %", "comfort"),
            numbers("wheel load", "N rms ±95 %", "wheel_load"),
            Column("of static", "%", lambda row: number(100.0 * row.load_share, digits=3)),
            numbers("stroke", "mm rms ±95 %", "stroke", 1e3),
            Column("untested", "s of 16", lambda row: number(row.outside_s, digits=2)),
            Column("", "", lambda row: marks.get(row.setting, ""), is_number=False),
        )
        note = "*: no other setting is better in comfort and wheel load"
        note += "; (*): none is by more than the 95 % intervals" * bool(self.undecided)
        return (laid_out(self.settings, columns, note),)

    @property
    def picture(self) -> Plot:
        """Wheel load against body acceleration."""

        def points(rows: Sequence[RideOfSetting], colour: str, **how: Any) -> Line:
            numbers = [(row.comfort, row.wheel_load, row.wheel_load_error) for row in rows]
            x, y, error = np.array(numbers).T
            return Line(x, y, "", colour, low=y - error, high=y + error, in_legend=False, **how)

        best = sorted(
            (row for row in self.settings if row.setting in self.pareto), key=lambda r: r.comfort
        )
        lines = [points(best, "ink", style="dot_line")]
        for row in self.settings:
            colour = "ink" if row in best else "muted"
            lines.append(points([row], colour, style="points", tag=row.setting))
        axes = ("body acceleration W_k, rms", "m/s2", "dynamic wheel load, rms", "N")
        title = (
            f"Road {self.car.road} at {self.car.speed:.3g} m/s; joined: beaten by no other setting"
        )
        return Plot("ride", title, (Panel(*axes, tuple(lines)),))


def read_car(given: Path | Mapping[str, Any]) -> Car:
    """Read [car] of a TOML file, or its keys."""
    subject = given if isinstance(given, Path) else ""
    try:
        table = tomllib.loads(read_text(given)) if isinstance(given, Path) else given
        section = table.get("car", table)
        if not isinstance(section, Mapping):
            raise not_a_section("car")
        car = Car(**{name: _read(name, value) for name, value in section.items()})
    except ConfigurationError as error:
        raise error.at(subject=subject) from None
    except OSError as error:
        text = f"{why_unread(error)}; give a TOML file with [car]"
        raise ConfigurationError(text, subject=subject, code="car") from None
    except ValueError as error:
        text = f"not a TOML file: {error}"
        raise ConfigurationError(text, subject=subject, code="car") from None
    if missing := [name for name, value in vars(car).items() if value == ""]:
        text = f"[car] needs {', '.join(missing)}"
        raise ConfigurationError(text, subject=subject, code="car")
    return car


def _read(name: str, given: Any) -> Any:
    entries = Car.entries()
    if name not in entries:
        raise unknown_key(name, entries, "car")
    with blamed_on(Key(("car", name))):
        dimension = entries[name].dimension
        value = parse_quantity(str(given), dimension) if dimension else given
        if name == "road":
            value = str(given).upper()
        elif not dimension:
            with suppress(ValueError, TypeError):
                value = float(given)
        if wanted := entries[name].in_place_of(value):
            raise ConfigurationError(f"expected {wanted}, found {given!r}", code="car")
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

    w3, w4, w5, w6 = (2.0 * np.pi * corner for corner in (100.0, 12.5, 2.37, 3.35))
    high = s**2 / second_order(0.4, math.sqrt(0.5))
    low = w3**2 / second_order(100.0, math.sqrt(0.5))
    transition = (1.0 + s / w4) / (1.0 + s / (0.63 * w4) + (s / w4) ** 2)
    step = second_order(2.37, 0.91) / w5**2 / (second_order(3.35, 0.91) / w6**2) * (w5 / w6) ** 2
    return np.asarray(np.abs(high * low * transition * step))


def ride_on_road(run: Run, car: Car, settings: Sequence[SettingResult]) -> Ride:
    """Return every setting on the same road."""
    road = _Road(run, car)

    def ride(setting: SettingResult) -> RideOfSetting | SimulationError:
        try:
            return road.ride(setting)
        except SimulationError as error:
            return error

    with executor(available_cores()) as pool:
        ridden = dict(zip((s.label for s in settings), pool.map(ride, settings), strict=True))
    rows = tuple(row for row in ridden.values() if isinstance(row, RideOfSetting))
    lost = {label: row for label, row in ridden.items() if isinstance(row, SimulationError)}
    if not rows:
        raise next(iter(lost.values()))
    remarks = (f"setting {label} is left out: {error}" for label, error in lost.items())
    return Ride(car, rows, tuple(lost), tuple(remarks))


class _Settled(NamedTuple):
    """A damper in the car, as far as both agree."""

    numbers: FloatArray  # comfort, wheel load and stroke, rms, of the last D
    before: FloatArray  # the same of the D before, as is what follows
    rest: FloatArray
    residual: FloatArray
    path: FloatArray  # stroke and speed of the damper, shape (2, n)
    left: float  # of the damper's force, rms


class _Road:
    """One period of a road, and the linear car on it."""

    def __init__(self, run: Run, car: Car) -> None:
        self.run, self.car = run, car
        self.static = (car.sprung_mass + car.unsprung_mass) * 9.81
        tolerance = max(run.solver.tolerance, _TOLERANCE * self.static)
        self.solver = replace(run.solver, dead_band=_FRICTION_BAND, tolerance=tolerance)
        self.n = round(_RATE * _SECONDS)
        self.frequencies = np.fft.rfftfreq(self.n, 1.0 / _RATE)
        self.s = 2j * np.pi * self.frequencies
        spatial = self.frequencies / car.speed
        phases = np.exp(2j * np.pi * np.random.default_rng(8608).random(len(spatial)))
        is_in = (spatial >= _SLOWEST) & (spatial <= _FASTEST)
        shape = np.where(is_in, spatial, np.inf) / _REFERENCE  # nothing beyond
        density = _ROUGHNESS[car.road] * shape**-_WAVINESS / car.speed
        self.profile = phases * np.sqrt(2.0 * density * self.frequencies[1]) * self.n / 2.0

    def ride(self, setting: SettingResult) -> RideOfSetting:
        """The setting's numbers with their errors."""
        values = without_rig(setting.parameters)
        c, rest = self._linear(values)
        secants: list[tuple[FloatArray, FloatArray]] = []
        settled = self._settled(values, c, rest, secants, _AGREED)
        covariance, names = np.asarray(setting.covariance), setting.names
        if setting.covariance is None:
            covariance, names = np.zeros((0, 0)), ()
        # Of the rig and its tare the car feels nothing.
        quantities = [q for q in map(values.quantity, names) if q.scope != RIG and not q.is_offset]
        felt = tuple(quantity.name for quantity in quantities)
        force, *sensitivities = self._force(values, settled.path, felt)
        slopes = np.zeros((len(names), 3))
        for quantity, sensitivity in zip(quantities, sensitivities, strict=True):
            name, row, value = quantity.name, names.index(quantity.name), values[quantity.name]
            unit = value if quantity.is_logarithmic else 1.0
            step = _STEP * (1.0 if quantity.is_logarithmic else quantity.size)
            to = value * math.exp(step) if quantity.is_logarithmic else value + step
            change = (to - value) * sensitivity
            goal = max(_RESOLVED * float(np.std(change) / np.std(force)), settled.left)
            start, moved = settled.rest + _mixed(change, secants), values.replace({name: to})
            there = self._settled(moved, c, start, secants, goal, settled.residual)
            # The model's misfit is taken to be correlated as the noise.
            noise, misfit = math.sqrt(covariance[row, row]), setting.misfits.get(name, 0.0) / unit
            wider = math.hypot(noise, misfit) / noise if noise > 0.0 else 1.0
            slopes[row] = wider * (there.numbers - settled.before) / step
        variances = np.einsum("ik,ij,jk->k", slopes, covariance, slopes)
        # What the iteration leaves.
        left = settled.numbers - settled.before
        if settled.left > _AGREED:
            left = settled.left * settled.numbers
        errors = np.hypot(NORMAL_95 * np.sqrt(np.maximum(variances, 0.0)), left)
        outside = int(np.count_nonzero(np.abs(settled.path[1]) > setting.top_speed)) / _RATE
        comfort, load, stroke = settled.numbers.tolist()
        shown = comfort, load, load / self.static, stroke, *errors.tolist(), outside, _SECONDS
        return RideOfSetting._make((setting.label, *shown))

    def _linear(self, values: Values) -> tuple[float, FloatArray]:
        """The damping that takes the same power as the curve at constant speed, and its D."""
        c, rest, ratio = _FIRST, np.zeros(self.n), self.car.motion_ratio
        for _ in range(_LINEARISED):
            speed = self._moved(c, np.zeros(self.n))[1][1]
            speeds = np.linspace(speed.min(), speed.max(), _BINS + 1)
            force = np.interp(speed, speeds, quasi_static(self.run.damper, values, speeds).forces)
            force = ratio * (force - force.mean())
            c = max(ratio * float(force @ speed / (speed @ speed)), 1.0)
            rest = force - c / ratio * speed
        return c, rest

    def _settled(
        self,
        values: Values,
        c: float,
        rest: FloatArray,
        secants: list[tuple[FloatArray, FloatArray]],
        goal: float,
        offset: FloatArray | float = 0.0,
    ) -> _Settled:
        """The fixed point of D, less an offset that is left of it.

        A damper that differs a little has nearly the same secants. Of one that hardly lets the
        wheel move its steps leave more than the goal: the nearest round is taken.
        """
        step, last, best = rest, None, None
        for _ in range(_ROUNDS):
            numbers, path = self._moved(c, rest)
            (force,) = self._force(values, path)
            residual = force - c / self.car.motion_ratio * path[1] - rest - offset
            left = float(np.std(residual) / np.std(force))
            if last is not None:
                secants.append((step, residual - last))
                del secants[:-_DEPTH]
            step, last = _mixed(residual, secants), residual
            if best is None or left < best.left:
                after = self._moved(c, rest + step)[0]
                best = _Settled(after, numbers, rest, residual, path, left)
            if left <= goal:
                break
            rest = rest + step
        if best is None or best.left > max(goal, _LEFT):
            raise SimulationError(
                "the damper hardly lets the wheel move, and its force in the car does not settle",
                code="not-settled",
            )
        return best

    def _moved(self, c: float, rest: FloatArray) -> tuple[FloatArray, FloatArray]:
        """The car with linear damping c and D: its numbers, and the damper's stroke and speed."""
        car, s, d = self.car, self.s, np.fft.rfft(rest)
        tyre, link = car.tyre + car.tyre_damping * s, car.spring + c * s
        a = car.sprung_mass * s**2 + link
        b = car.unsprung_mass * s**2 + link + tyre
        push, determinant = tyre * self.profile + d, a * b - link**2
        body, axle = (link * push - d * b) / determinant, (a * push - link * d) / determinant
        stroke = car.motion_ratio * (body - axle)
        felt = s**2 * body * weighting_k(self.frequencies)
        powers = np.sum(np.abs([felt, tyre * (axle - self.profile), stroke])[:, 1:] ** 2, axis=1)
        return np.sqrt(2.0 * powers) / self.n, np.fft.irfft([stroke, s * stroke], self.n)

    def _force(self, values: Values, path: FloatArray, names: Sequence[str] = ()) -> FloatArray:
        """The damper's force at the wheel along a period, and its sensitivities: (1 + k, n).

        Their means are out: gas, tare, and what would move the body off the middle of the stroke.
        """
        lead, reach, travel = round(_LEAD * _RATE), np.abs(path[0]).max(), self.run.damper.travel
        if reach >= travel:
            raise SimulationError(
                f"the damper has {1e3 * travel:.3g} mm to either side, and the car without bump "
                f"stops takes {1e3 * reach:.3g} mm on this road; drive slower or take a smoother "
                "one",
                code="stroke",
            )
        motion = Motion(1.0 / _RATE, *np.concatenate([path[:, -lead:], path], axis=1))
        seen = self.run.damper.simulate(values, motion, sensitivities=names, options=self.solver)
        rows = np.stack([seen.force, *(seen.sensitivities[name] for name in names)])[:, lead:]
        return self.car.motion_ratio * np.asarray(rows - rows.mean(axis=1, keepdims=True))


def _mixed(residual: FloatArray, secants: Sequence[tuple[FloatArray, FloatArray]]) -> FloatArray:
    """The step of Anderson mixing: to the least residual that the last secants combine to.

    A stiff damper is no small disturbance of a linear one, as a step by the residual would need.
    """
    if not secants:
        return residual
    moved, changed = map(np.array, zip(*secants, strict=True))
    gram = changed @ changed.T
    weights = np.linalg.lstsq(gram, changed @ residual, rcond=_ROUNDING)[0]
    return np.asarray(residual - weights @ (moved + changed))


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
    picture: Plot  # the velocity histogram below the curves

    @property
    def sentence(self) -> str:  # type: ignore[override]
        """Where most of the energy goes, and where the clicks act."""
        first, *_, last = (*self.outside, *self.outside)
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
        bands = [band._asdict() for band in self.bands]
        known = {"seconds": self.seconds, "sentence": self.sentence, "bands": bands}
        document: dict[str, Any] = json_values(known | {"outside_s": self.outside})
        return document

    def sheets(self) -> tuple[Sheet]:
        """Return one row a setting, one column a band of speed."""

        def power(band: Band) -> Column:
            def cell(label: str) -> str:
                if label:
                    return number(band.powers[label], digits=3)
                return f"{number(100.0 * band.share, digits=3)} %"

            return Column(f"{band.low:g} to {band.high:g}", "W at m/s", cell)

        columns = (
            Column("set", "", lambda label: label or "time", is_number=False),
            *(power(band) for band in self.bands if band.share > 0.0),
            Column("untested", "s", lambda label: number(self.outside.get(label), digits=2)),
        )
        return (laid_out(["", *self.outside], columns),)


def drive_along(run: Run, motion: Motion, settings: Sequence[SettingResult]) -> DrivenStroke:
    """Return what settings of a run dissipate along a stroke, by band of speed."""
    speed, n = np.abs(motion.velocity), len(motion.velocity)
    outside: dict[str, float] = {}
    counts, edges = np.histogram(motion.velocity, _BINS)
    speeds = 0.5 * (edges[1:] + edges[:-1])
    colours, curves = setting_colours([setting.setting for setting in settings]), []
    rest, work = run.damper.rest_force(motion.displacement), {}
    for setting in settings:
        label, values = setting.label, without_rig(setting.parameters)
        seen = run.damper.simulate(values, motion, sensitivities=(), options=run.solver)
        work[label] = (seen.force - (0.0 if rest is None else rest)) * motion.velocity
        outside[label] = float(np.sum(speed > setting.top_speed) * motion.interval)
        force = quasi_static(run.damper, values, speeds).forces
        curves.append(Line(speeds, force, f"setting {label}", colours[setting.setting]))
    bands = []
    for low, high in pairwise(_EDGES):
        inside = (low <= speed) & (speed < high)
        powers = {label: float(power[inside].sum() / n) for label, power in work.items()}
        bands.append(Band(low, high, float(np.mean(inside)), powers))
    share = Line(speeds, 100.0 * counts / n, "share of the time", "ink", style="dot_line")
    axis = ("velocity (positive: rebound)", "m/s")
    panels = (Panel(*axis, "force", "N", tuple(curves)), Panel(*axis, "time", "%", (share,)))
    picture = Plot("stroke", "Forces by setting, and time at each speed", panels)
    return DrivenStroke(n * motion.interval, tuple(bands), outside, picture)


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
