"""What is exported of a run, and force by speed: the characteristic of the damper alone.

The valves at constant speed through the middle of the stroke. What the rig adds (mounting, play,
moving mass, lag, tare) is out, and so is what only moves with the stroke: the elasticity of the
oil, and the gas, which is no damping and is handed over apart. Friction is in; it jumps at rest, so
the table goes straight through 0 0 below its first speed.

Points lie close where cars are tuned, and are added where the straight line between two of them
misses the force, as at the opening of a valve. A table ends at the speed that was tested; beyond it
goes only who asks for it. Intervals, and the speed up to which the logs determine the force, are
those of `damperfit.adjustment.force_at`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from damperfit.adjustment.force_at import STROKES, determined_speed, force_at
from damperfit.damper.mounting import NONE, Mounting
from damperfit.damper.quasi_static import quasi_static
from damperfit.damper.valve_dampers import ValveDamper
from damperfit.damper.warmed import Warmed
from damperfit.errors import ConfigurationError
from damperfit.problem import Option
from damperfit.results import Run
from damperfit.simulation import Motion, simulate

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from numpy.typing import NDArray

    from damperfit.damper.model import Model, Values
    from damperfit.results import SettingResult
    from damperfit.simulation import SolverOptions
    from damperfit.tested.setting import Setting

    FloatArray = NDArray[np.float64]

# m/s: low-speed adjusters of cars work at 5 to 50 mm/s; beyond, each point is a fifth farther.
_TUNED = (5e-3, 7.5e-3, 0.01, 0.0125, 0.015, 0.02, 0.025, 0.03, 0.035, 0.04, 0.045, 0.05)
_FARTHER = 1.2
_HALVED = 6  # times, between two points whose line misses
_MISS, _LEAST_MISS = 3e-3, 0.1  # of the force, and N
_FARTHEST = 5.0  # times the tested speed; the model says little of the damper beyond
_GAS_POINTS = 13


@dataclass(frozen=True, slots=True, eq=False)
class ExportedRun:
    """A run as the targets need it.

    Attributes
    ----------
    run : Run
        Whose test it was, and how it was tested.
    damper : Model
        At one temperature, where the run's follows it: other programs know of none.
    settings : tuple of SettingResult
        Rising; at least one.
    notes : tuple of str
        What else to know of the values.
    """

    run: Run
    damper: Model
    settings: tuple[SettingResult, ...]
    notes: tuple[str, ...] = ()

    @property
    def fastest(self) -> float:
        """Speed of the run's fastest motion, m/s, for settings whose own tests are not known."""
        return (
            self.run.motion.peak_speed if self.run.tested.speed is None else self.run.tested.speed
        )


def exported_run(
    folder: Path, *, config: Path | None = None, temperature: str | None = None
) -> ExportedRun:
    """Read a results folder, or a fleet's part, for a target.

    The damper of ``config`` is taken where the run does not tell its own; ``temperature`` is the
    oil's, where the damper follows it: the reference temperature by default.

    Raises
    ------
    ConfigurationError
        There is no such folder, no setting in it has parameters, or ``config`` declares another
        damper.
    """
    run = Run.load(folder, parts=("parameters",), config=config, temperature=temperature)
    damper, settings, notes = run.damper, run.settings, []
    if not settings:
        raise ConfigurationError(
            "no setting has all parameters; run damperfit identify LOGS first", subject=folder
        )
    if isinstance(damper, Warmed):
        at = damper.oil_temperature
        notes.append(
            f"resistances as they are at {at:g} degC (fitted at {damper.reference:g} degC)"
        )
        settings = tuple(_at_one_temperature(one, damper) for one in settings)
        damper = damper.plain
    notes += [
        f"{', '.join(one.unlimited)} at setting {one.setting}: the logs set no upper limit, so the "
        "force beyond their speeds may be far off"
        for one in settings
        if one.unlimited
    ]
    run.motion  # noqa: B018 - where it is not known, that is remarked
    return ExportedRun(run, damper, settings, tuple(notes))


def _at_one_temperature(one: SettingResult, damper: Warmed) -> SettingResult:
    values = damper.at_reference(one.values, damper.oil_temperature)
    names = (*one.own, *one.shared)
    kept = [k for k, name in enumerate(names) if name in values.names]
    covariance = None if one.covariance is None else one.covariance[np.ix_(kept, kept)]
    return replace(
        one,
        parameters=values,
        own=tuple(name for name in one.own if name in values.names),
        shared=tuple(name for name in one.shared if name in values.names),
        covariance=covariance,
        open_limits=tuple(pair for pair in one.open_limits if pair[0] in values.names),
    )


@dataclass(frozen=True, slots=True, eq=False)
class ForceTable:
    """The characteristic of a setting, without gas force and tare.

    Attributes
    ----------
    setting : Setting
        Which.
    slug : str
        For names of files; no two settings of a damper have the same.
    mse_percent : float
        Of the fit; NaN where it is not known.
    speeds, forces : numpy.ndarray
        Rising, through 0 0; m/s and N, positive in rebound.
    low, high : numpy.ndarray
        95 % interval of each force, N; the force itself where no error is known.
    tested : float
        Highest speed of the setting's own logs, m/s.
    determined : float
        Speed up to which the logs determine the force, m/s, tested or beyond; NaN: not known.
    stroke : float
        Amplitude of the tested motion, m.
    level, tare : float
        What presses at rest at x = 0, and the rig's offset: N, in no force of the table.
    gas_displacements, gas_forces : numpy.ndarray
        What presses at rest over the tested stroke, m and N; one point where the model has no gas.
    has_gas : bool
        The model knows its gas; otherwise the level is of gas and tare together.
    has_interval : bool
        The errors of its forces are known.
    """

    setting: Setting
    slug: str
    mse_percent: float
    speeds: FloatArray
    forces: FloatArray
    low: FloatArray
    high: FloatArray
    tested: float
    determined: float
    stroke: float
    level: float
    tare: float
    gas_displacements: FloatArray
    gas_forces: FloatArray
    has_gas: bool
    has_interval: bool

    @property
    def end(self) -> float:
        """Its highest speed, m/s."""
        return float(self.speeds[-1])

    @property
    def is_extended(self) -> bool:
        """Whether it goes beyond the tested speed."""
        return self.range_of(self.end) != "tested"

    def range_of(self, speed: float) -> str:
        """Return whether a speed is "tested", "untested", or even "not determined"."""
        if abs(speed) <= self.tested * (1.0 + 1e-9):
            return "tested"
        return "not determined" if abs(speed) > self.determined else "untested"

    def rows(self, side: float = 1.0) -> list[tuple[float, float]]:
        """Return speeds and forces, rising; with side -1 those of bump are positive."""
        pairs = zip(side * self.speeds, side * self.forces, strict=True)
        return sorted((float(v) + 0.0, float(force) + 0.0) for v, force in pairs)

    def said_at(self, speed: float) -> str:
        """Return a force with its 95 % interval in words; nothing beyond the table."""
        if abs(speed) > self.end:
            return ""
        rows = self.forces, self.low, self.high
        force, low, high = (float(np.interp(speed, self.speeds, row)) for row in rows)
        return f"{force:.4g} ± {max(high - force, force - low):.2g}"

    def at_rest(self, displacement: FloatArray) -> FloatArray:
        """Return the force at no speed, N."""
        return np.asarray(np.interp(displacement, self.gas_displacements, self.gas_forces))


class RoadMiss(NamedTuple):
    """Force of a table less the model's on a road on which the damper reaches `speed`, m/s.

    `rms` in N; `percent` is its mean square over the variance of the model's force, as an MSE.
    """

    speed: float
    rms: float
    percent: float


def force_tables(
    run: ExportedRun, *, extend: float | None = None, common: bool = False
) -> tuple[ForceTable, ...]:
    """Return the table of each setting, to the tested speed or to ``extend``, m/s.

    ``common``: all on the same speeds, up to what every setting was tested at.

    Raises
    ------
    ConfigurationError
        ``extend`` is not beyond the tested speed, or far beyond it.
    SimulationError
        The model cannot be simulated.
    """
    curves = [_Curve(run, one) for one in run.settings]
    tested = [curve.tested for curve in curves]
    if max(tested) < 1.02 * min(tested):  # the same test, but for noise
        for curve in curves:
            curve.tested = min(tested)
    if extend is not None and not min(tested) < extend <= _FARTHEST * max(tested):
        raise ConfigurationError(
            f"expected a speed above the tested {min(tested):.4g} m/s and "
            f"up to {_FARTHEST:g} times it; leave {{extend}} out for a table of what was tested",
            extend=Option("extend"),
            where=Option("extend", f"{extend:g} m/s"),
        )
    tables = []
    for group in [curves] if common else [[curve] for curve in curves]:
        end = max(min(curve.tested for curve in group), extend or 0.0)
        grid = _refined(_grid({end, *(one.tested for one in group if one.tested < end)}), group)
        tables += [_table(run, curve, grid) for curve in group]
    slugs: dict[str, int] = {}
    for k, table in enumerate(tables):
        # Labels that differ in signs alone, or in capitals, must not share a file.
        seen = slugs[table.slug.casefold()] = slugs.get(table.slug.casefold(), 0) + 1
        tables[k] = table if seen == 1 else replace(table, slug=f"{table.slug}_{seen}")
    return tuple(tables)


def _rounded_down(speed: float) -> float:
    """To three digits: what a log reached, not what its noise did."""
    size = 10.0 ** (2 - math.floor(math.log10(speed)))
    return math.floor(speed * size * (1.0 + 1e-9)) / size


class _Curve:
    """The characteristic of one setting at any speeds, each of them asked for once."""

    def __init__(self, run: ExportedRun, setting: SettingResult) -> None:
        self.run, self.of = run, setting
        self.tested = _rounded_down(min(setting.top_speed, run.fastest))
        rest = quasi_static(run.damper, setting.values, np.zeros(1))
        self.tare, self.level = rest.tare, float(rest.forces[0]) - rest.tare
        self.known: dict[float, float] = {}

    def forces(self, speeds: FloatArray) -> FloatArray:
        """Return the forces without what presses at rest, N."""
        new = np.array([v for v in speeds.tolist() if v not in self.known])
        if len(new):
            found = quasi_static(self.run.damper, self.of.values, new).forces
            self.known |= dict(zip(new.tolist(), found - self.tare - self.level, strict=True))
        self.known[0.0] = 0.0
        return np.array([self.known[v] for v in speeds.tolist()])

    def interval(self, speeds: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return how far the forces may lie below and above, N, with 95 % confidence."""
        down, up = np.zeros(len(speeds)), np.zeros(len(speeds))
        if self.of.covariance is None:
            return down, up
        measured = [one for one in self.run.run.speed_forces if one.setting == self.of.setting]
        sizes = sorted({abs(v) for v in speeds.tolist()} - {0.0})
        for one in force_at([self.of], self.run.damper, sizes, measured=measured):
            at = speeds == (one.speed if one.stroke == STROKES[0] else -one.speed)
            down[at], up[at] = one.force - one.low, one.high - one.force
        return down, up


@lru_cache(maxsize=128)
def without_rig(damper: Model, values: Values) -> tuple[Model, Values]:
    """Return the damper without what the rig adds to its force: tare, mounting, late channel.

    Where the model knows no gas of its own the offset holds the gas force, and stays.
    """
    if isinstance(damper, ValveDamper):
        bare: Model = replace(damper, mounting=Mounting(series_stiffness=NONE))
        values = bare.values({name: getattr(values, name) for name in bare.names})
        damper = bare
    if damper.rest_force(0.0) is not None:
        offsets = {one.name: 0.0 for one in values.quantities if one.is_offset}
        values = values.replace(offsets)
    return damper, values


def _grid(tops: set[float]) -> FloatArray:
    """Speeds of both strokes and 0, up to the highest of some that are among them."""
    top = max(tops)
    scale = min(1.0, top / (2.0 * _TUNED[-1]))
    side = [scale * speed for speed in _TUNED]
    while side[-1] * _FARTHER < top:
        side.append(side[-1] * _FARTHER)
    others = [v for v in side if all(abs(v / one - 1.0) > 0.02 for one in tops if one)]
    side = sorted({*others, *(one for one in tops if one)})
    return np.array([*(-v for v in reversed(side)), 0.0, *side])


def _refined(grid: FloatArray, curves: Sequence[_Curve]) -> FloatArray:
    """Return the speeds and those between them where a straight line misses the force."""
    for _ in range(_HALVED):
        middle = 0.5 * (grid[1:] + grid[:-1])
        beside = (grid[1:] != 0.0) & (grid[:-1] != 0.0)  # friction jumps at rest
        missed = np.zeros(len(middle), dtype=bool)
        for curve in curves:
            known, there = curve.forces(grid), curve.forces(middle[beside])
            line = 0.5 * (known[1:] + known[:-1])[beside]
            missed[beside] |= np.abs(line - there) > _MISS * np.abs(there) + _LEAST_MISS
        if not missed.any():
            break
        grid = np.sort(np.concatenate([grid, middle[missed]]))
    return grid


def _table(run: ExportedRun, curve: _Curve, grid: FloatArray) -> ForceTable:
    forces, (down, up) = curve.forces(grid), curve.interval(grid)
    stroke = run.run.motion.amplitude
    x = np.linspace(-stroke, stroke, _GAS_POINTS)
    gas = run.damper.rest_force(x)
    return ForceTable(
        curve.of.setting,
        curve.of.setting.slug,
        curve.of.mse_percent,
        grid,
        forces,
        forces - down,
        forces + up,
        curve.tested,
        determined_speed(curve.of, run.damper),
        stroke,
        curve.level,
        0.0 if gas is None else curve.of.offset,
        np.zeros(1) if gas is None else x,
        np.array([curve.level]) if gas is None else gas,
        gas is not None,
        curve.of.covariance is not None,
    )


# A road of class B (ISO 8608, 64e-6 m3 at 0.1 cycles/m) at 20 m/s, from 0.5 to 25 Hz, under a
# quarter car: the same motion for every damper, scaled to the speeds of interest. It is made of
# sines whose phases are fixed, hence the same in every run.
_ROUGHNESS, _WAVENUMBER, _DRIVEN = 64e-6, 0.1, 20.0  # m3 at cycles/m, m/s
_BODY, _WHEEL, _SPRING, _TYRE, _DAMPING = 350.0, 40.0, 25e3, 200e3, 1.5e3  # kg, N/m, N s/m
_RATE, _SECONDS, _RUN_IN = 1000.0, 8.0, 1.0  # Hz, s
_LOWEST, _HIGHEST, _STEP = 0.5, 25.0, 1.0 / _SECONDS  # Hz
_GOLDEN = 0.6180339887498949  # its multiples by squares spread phases evenly, without a generator
_ROAD_SPEEDS = (0.05, 0.1, 0.25)  # m/s
_SLOWER = (0.2, 0.4, 1.0)  # of the table's end, where that is not reached


@lru_cache(maxsize=1)
def standard_road() -> Motion:
    """Return displacement and velocity of the damper on the road; positive in rebound."""
    frequency = np.arange(_LOWEST, _HIGHEST + 0.5 * _STEP, _STEP)
    omega = 2.0 * np.pi * frequency
    density = _ROUGHNESS * _WAVENUMBER**2 * _DRIVEN / frequency**2
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


def road_misses(run: ExportedRun, table: ForceTable) -> tuple[RoadMiss, ...]:
    """Return how far the damper's dynamics are from a table, at three speeds of the same road."""
    values = next(one.values for one in run.settings if one.setting == table.setting)
    damper, bare = without_rig(run.damper, values)
    road, first = standard_road(), int(_RUN_IN * _RATE)
    top, widest = float(np.abs(road.velocity).max()), float(np.abs(road.displacement).max())
    is_reached = table.end >= _ROAD_SPEEDS[-1]
    misses = []
    for speed in _ROAD_SPEEDS if is_reached else [share * table.end for share in _SLOWER]:
        scale = min(speed / top, table.stroke / widest)
        force = _on_road(damper, bare, scale, run.run.solver)[first:]
        x, v = scale * road.displacement[first:], scale * road.velocity[first:]
        miss = np.interp(v, table.speeds, table.forces) + table.at_rest(x) - force
        square = float(np.mean(miss * miss))
        share = 100.0 * square / float(np.var(force))
        misses.append(RoadMiss(scale * top, math.sqrt(square), share))
    return tuple(misses)


@lru_cache(maxsize=512)
def _on_road(damper: Model, values: Values, scale: float, solver: SolverOptions) -> FloatArray:
    road = standard_road()
    motion = Motion(road.interval, scale * road.displacement, scale * road.velocity)
    return simulate(values, damper, motion, options=solver).force
