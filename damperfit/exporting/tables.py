"""What is exported of a run: force by speed, the characteristic of the damper alone.

The valves at constant speed through the middle of the stroke. What the rig adds (mounting, play,
moving mass, lag, tare) is out, and so is what only moves with the stroke: the elasticity of the
oil, and the gas, which is no damping and is handed over apart. Friction is in; it jumps at rest, so
the table goes straight through 0 0 below its first speed.

Points lie close where cars are tuned, and are added where the straight line between two of them
misses the force, as at the opening of a valve. A table ends at the speed that was tested; beyond it
goes only who asks for it. Intervals, and the speed up to which the logs determine the force, are
those of `damperfit.adjustment.force_at`. What every file says of itself stands here too.
"""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import groupby
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from damperfit import __version__
from damperfit.adjustment.force_at import determined_speed, force_at
from damperfit.damper.mounting import NONE, Mounting
from damperfit.damper.quantity import RIG
from damperfit.damper.quasi_static import quasi_static
from damperfit.damper.temperature_law import WithTemperature
from damperfit.damper.valve_dampers import ValveDamper
from damperfit.errors import ConfigurationError
from damperfit.problem import Option
from damperfit.reporting.report import tested_range
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
_SHOWN = {"N/m": (1e-3, "N/mm"), "m": (1e3, "mm"), "s": (1e3, "ms")}


@dataclass(frozen=True, slots=True, eq=False)
class ExportedRun:
    """A run as the targets need it."""

    run: Run  # whose test it was, and how it was tested
    damper: Model  # at one temperature, where the run's follows it: other programs know of none
    settings: tuple[SettingResult, ...]  # rising; at least one
    notes: tuple[str, ...] = ()  # what else to know of the values


def exported_run(
    folder: Path, *, config: Path | None = None, temperature: str | None = None
) -> ExportedRun:
    """Read a results folder, or a fleet's part, for a target.

    The damper of ``config`` is taken where the run does not tell its own; ``temperature`` is the
    oil's, where the damper follows it: the reference temperature by default.
    """
    run = Run.load(folder, parts=("parameters",), config=config, temperature=temperature)
    damper, settings, notes = run.damper, run.settings, []
    if not settings:
        raise ConfigurationError(
            "no setting has all parameters; run damperfit identify LOGS first",
            subject=folder,
            code="no-parameters",
        )
    if isinstance(damper, WithTemperature):
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


def _at_one_temperature(one: SettingResult, damper: WithTemperature) -> SettingResult:
    values = damper.at_reference(one.values, damper.oil_temperature)
    kept = [k for k, name in enumerate((*one.own, *one.shared)) if name in values.names]
    return replace(
        one,
        parameters=values,
        own=tuple(name for name in one.own if name in values.names),
        shared=tuple(name for name in one.shared if name in values.names),
        covariance=None if one.covariance is None else one.covariance[np.ix_(kept, kept)],
        open_limits=tuple(pair for pair in one.open_limits if pair[0] in values.names),
    )


@dataclass(frozen=True, slots=True, eq=False)
class ForceTable:
    """The characteristic of a setting, without gas force and tare; m/s, N, positive in rebound."""

    setting: Setting
    slug: str  # for names of files; no two settings of a damper have the same
    mse_percent: float  # of the fit; NaN where it is not known
    speeds: FloatArray  # rising, through 0
    forces: FloatArray
    low: FloatArray  # 95 % interval; the force itself where no error is known
    high: FloatArray
    tested: float  # highest speed of the setting's own logs
    determined: float  # speed up to which the logs determine the force; NaN: not known
    stroke: float  # amplitude of the tested motion, m
    level: float  # what presses at rest at x = 0
    tare: float  # the rig's offset
    gas_displacements: FloatArray  # over the tested stroke, m
    gas_forces: FloatArray  # what presses at rest there; one point where the model has no gas
    has_gas: bool  # the model knows its gas; otherwise the level is of gas and tare together
    has_interval: bool  # the errors of its forces are known

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


def force_tables(
    run: ExportedRun, *, extend: float | None = None, common: bool = False
) -> tuple[ForceTable, ...]:
    """Return the table of each setting, to ``extend``, m/s; ``common``: all on the same speeds."""
    known = run.run.tested.speed
    fastest = run.run.motion.peak_speed if known is None else known
    tested = [_rounded_down(min(one.top_speed, fastest)) for one in run.settings]
    if max(tested) < 1.02 * min(tested):  # the same test, but for noise
        tested = [min(tested)] * len(tested)
    if extend is not None and not min(tested) < extend <= _FARTHEST * max(tested):
        raise ConfigurationError(
            f"expected a speed above the tested {min(tested):.4g} m/s and "
            f"up to {_FARTHEST:g} times it; leave {{extend}} out for a table of what was tested",
            extend=Option("extend"),
            where=Option("extend", f"{extend:g} m/s"),
            code="out-of-range",
        )
    tables: list[ForceTable] = []
    slugs: Counter[str] = Counter()
    settings = list(zip(run.settings, tested, strict=True))
    for group in [settings] if common else [[one] for one in settings]:
        own = {speed for _, speed in group}
        end = max(min(own), extend or 0.0)
        grid = _grid({end, *(speed for speed in own if speed < end)})
        grid, forces = _characteristics(run.damper, [one for one, _ in group], grid)
        for (setting, speed), row in zip(group, forces, strict=True):
            # Labels that differ in signs alone, or in capitals, must not share a file.
            slug = setting.setting.slug
            slugs[slug.casefold()] += 1
            slug += f"_{n}" if (n := slugs[slug.casefold()]) > 1 else ""
            tables.append(_table(run, setting, slug, speed, grid, row))
    return tuple(tables)


def _rounded_down(speed: float) -> float:
    """To three digits: what a log reached, not what its noise did."""
    size = 10.0 ** (2 - math.floor(math.log10(speed)))
    return math.floor(speed * size * (1.0 + 1e-9)) / size


def _grid(tops: set[float]) -> FloatArray:
    """Speeds of both strokes and 0, up to the highest of some that are among them."""
    top = max(tops)
    scale = min(1.0, top / (2.0 * _TUNED[-1]))
    side = [scale * speed for speed in _TUNED]
    while side[-1] * _FARTHER < top:
        side.append(side[-1] * _FARTHER)
    side = [v for v in side if all(abs(v / one - 1.0) > 0.02 for one in tops)]
    side = sorted({*side, *tops})
    return np.array([*(-v for v in reversed(side)), 0.0, *side])


def _at_rest(damper: Model, values: Values) -> tuple[float, float]:
    """Return what presses at rest and the rig's offset, N."""
    rest = quasi_static(damper, values, np.zeros(1))
    return float(rest.forces[0]) - rest.tare, rest.tare


def _characteristics(
    damper: Model, settings: Sequence[SettingResult], grid: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return speeds, with those between them where a straight line misses, and forces (n, m)."""
    offsets = [sum(_at_rest(damper, one.values)) for one in settings]

    def at(speeds: FloatArray) -> FloatArray:
        rows = zip(settings, offsets, strict=True)
        return np.array([quasi_static(damper, s.values, speeds).forces - off for s, off in rows])

    forces = at(grid)
    forces[:, grid == 0.0] = 0.0
    is_new = (grid[1:] != 0.0) & (grid[:-1] != 0.0)  # friction jumps at rest
    for _ in range(_HALVED):
        place = np.flatnonzero(is_new)
        middle = 0.5 * (grid[place] + grid[place + 1])
        line, there = 0.5 * (forces[:, place] + forces[:, place + 1]), at(middle)
        missed = (np.abs(line - there) > _MISS * np.abs(there) + _LEAST_MISS).any(axis=0)
        if not missed.any():
            break
        place = place[missed]
        grid = np.insert(grid, place + 1, middle[missed])
        forces = np.insert(forces, place + 1, there[:, missed], axis=1)
        is_new = np.isin(np.arange(len(is_new)), place)
        is_new = np.repeat(is_new, 1 + is_new)  # both halves
    return grid, forces


def _table(
    run: ExportedRun, of: SettingResult, slug: str, tested: float, grid: FloatArray, row: FloatArray
) -> ForceTable:
    low, high = row.copy(), row.copy()
    if of.covariance is not None:
        measured = [one for one in run.run.speed_forces if one.setting == of.setting]
        sizes = sorted(set(np.abs(grid).tolist()) - {0.0})
        for one in force_at([of], run.damper, sizes, measured=measured):
            at = grid == (one.speed if one.stroke == "rebound" else -one.speed)
            low[at] -= one.force - one.low
            high[at] += one.high - one.force
    level, _ = _at_rest(run.damper, of.values)
    stroke = run.run.motion.amplitude
    x = np.linspace(-stroke, stroke, _GAS_POINTS)
    gas = run.damper.rest_force(x)
    return ForceTable(
        setting=of.setting,
        slug=slug,
        mse_percent=of.mse_percent,
        speeds=grid,
        forces=row,
        low=low,
        high=high,
        tested=tested,
        determined=determined_speed(of, run.damper),
        stroke=stroke,
        level=level,
        tare=0.0 if gas is None else of.offset,
        gas_displacements=np.zeros(1) if gas is None else x,
        gas_forces=np.array([level]) if gas is None else gas,
        has_gas=gas is not None,
        has_interval=of.covariance is not None,
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


class RoadMiss(NamedTuple):
    """Force of a table less the model's on a road on which the damper reaches `speed`, m/s.

    `rms` in N; `percent` is its mean square over the variance of the model's force, as an MSE.
    """

    speed: float
    rms: float
    percent: float


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
    damper = run.damper
    if isinstance(damper, ValveDamper):  # without the rig: mounting, late channel, tare
        bare = replace(damper, mounting=Mounting(series_stiffness=NONE))
        values = bare.values({name: getattr(values, name) for name in bare.names})
        damper = bare
    if damper.rest_force(0.0) is not None:  # else the offset holds the gas force, and stays
        values = values.replace({one.name: 0.0 for one in values.quantities if one.is_offset})
    road, first = standard_road(), int(_RUN_IN * _RATE)
    top, widest = float(np.abs(road.velocity).max()), float(np.abs(road.displacement).max())
    is_reached = table.end >= _ROAD_SPEEDS[-1]
    misses = []
    for speed in _ROAD_SPEEDS if is_reached else [share * table.end for share in _SLOWER]:
        scale = min(speed / top, table.stroke / widest)
        force = _on_road(damper, values, scale, run.run.solver)[first:]
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


# What every file says of itself: plain lines; each target puts its own mark of a comment before.


def header_lines(
    run: ExportedRun, tables: Sequence[ForceTable], *, sign: str, gas: str, has_table: bool = True
) -> list[str]:
    """Return whose damper it is, tested where, how good; what is in the file and what is not.

    What is positive (``sign``), where the gas force is (``gas``); of force by speed, or of the
    equations.
    """
    about = run.run
    lines = [
        f"damperfit {__version__}: {about.name}, setting "
        + ", ".join(str(one.setting) for one in tables),
        f"identity: {'; '.join(f'{k} {v}' for k, v in about.identity.items()) or 'not named'}",
        f"model: {run.damper.sentence}",
        f"tested: {tested_range(about.tested)}",
        f"MSE of the fit: {_mse(tables)}",
    ]
    if has_table:
        lines.append(
            "table: force of the damper alone at constant speed, in the middle of the stroke"
        )
    lines += [f"taken out: {taken_out(run)}", determined_line(tables)]
    if has_table:
        lines += [_beyond(tables), road_line(run, tables)]
    lines += [f"gas: {gas}", f"sign: {sign}", f"results: sha256 {about.digest or 'not known'}"]
    return list(map(one_line, lines))


def one_line(text: str) -> str:
    """Return text that ends no comment and holds no control characters."""
    return "".join(letter if letter.isprintable() else " " for letter in text)


def _mse(tables: Sequence[ForceTable]) -> str:
    known = [one for one in tables if math.isfinite(one.mse_percent)]
    ranked = sorted(known, key=lambda one: one.mse_percent)
    if len(ranked) < 2:
        return " ".join(f"{one.mse_percent:.3g} %" for one in ranked) or "not known"
    ends = (ranked[0], ranked[-1])
    return " to ".join(f"{one.mse_percent:.3g} % (setting {one.setting})" for one in ends)


def taken_out(run: ExportedRun) -> str:
    """Return what the fit found and the file does not hold: mounting, play, mass, lag, tare."""
    parts = []
    for one in run.damper.quantities:
        values = [setting.values for setting in run.settings]
        numbers = [getattr(known, one.name) for known in values if one.name in known.names]
        is_tare = one.is_offset and run.damper.rest_force(0.0) is not None
        if any(numbers) and (is_tare or one.scope == RIG):
            factor, unit = _SHOWN.get(one.unit, (1.0, one.unit))
            ends = dict.fromkeys(f"{factor * end:.4g}" for end in (min(numbers), max(numbers)))
            label = "tare of the rig" if is_tare else one.label
            parts.append(f"{label} {' to '.join(ends)} {unit}")
    if getattr(getattr(run.damper, "mounting", None), "series_stiffness", NONE) == NONE:
        parts.insert(0, "no mounting (rigid)")
    return ", ".join(parts)


def gas_line(table: ForceTable, place: str, *, is_bump_positive: bool = False) -> str:
    """Return what presses at rest, and what to do with it (``place``: "add it to the spring").

    The table may be of any setting: the gas is the damper's. Where a file counts compression as
    positive the gas has the sign of its spring.
    """
    sign, way = (-1.0, "plus") if is_bump_positive else (1.0, "minus")
    what = "gas force" if table.has_gas else "force at rest, gas and tare of the rig together,"
    sentence = (
        f"not in the table; {what} {sign * table.level:.4g} N at x = 0 ({way} pushes the rod out)"
    )
    if table.has_gas:
        in_bump, in_rebound = sign * table.gas_forces[0], sign * table.gas_forces[-1]
        sentence += (
            f", {in_bump:.4g} N at -{1e3 * table.stroke:.3g} mm, "
            f"{in_rebound:.4g} N at +{1e3 * table.stroke:.3g} mm of rebound"
        )
    return f"{sentence}; {place}"


def determined_line(tables: Sequence[ForceTable]) -> str:
    """Return up to which speed the logs determine the force of each setting."""

    def speed_of(one: ForceTable) -> str:
        return "not known" if math.isnan(one.determined) else f"{one.determined:.2g} m/s"

    parts = []
    for speed, group in groupby(tables, key=speed_of):
        names = [str(one.setting) for one in group]
        which = f"s {names[0]} to {names[-1]}" if len(names) > 1 else f" {names[0]}"
        parts.append(f"{speed} at setting{which}")
    tested = {f"{one.tested:.3g}" for one in tables}
    return (
        f"force determined by the logs (95 % interval within 5 %) to {', '.join(parts)}; tested to "
        f"{' to '.join(sorted({min(tested), max(tested)}))} m/s"
    )


def _beyond(tables: Sequence[ForceTable]) -> str:
    if any(one.is_extended for one in tables):
        end, tested = max(one.end for one in tables), min(one.tested for one in tables)
        return (
            f"beyond {tested:.4g} m/s UNTESTED: up to {end:.4g} m/s the table is the model's, "
            "unmeasured there"
        )
    return (
        f"beyond {tables[0].end:.4g} m/s there is nothing: do not let a program hold the last "
        "value, the damper's force goes on rising; an extended table has rows of the model"
    )


def road_line(run: ExportedRun, tables: Sequence[ForceTable]) -> str:
    """Return how far the damper's dynamics are from its tables on a road, at three speeds."""

    def shares(misses: Sequence[RoadMiss]) -> str:
        return ", ".join(
            f"{one.percent:.2g} % MSE ({one.rms:.3g} N rms) at {one.speed:.2g} m/s"
            for one in misses
        )

    ranked = [(road_misses(run, one), one) for one in tables]
    ranked.sort(key=lambda pair: max(one.percent for one in pair[0]))
    (least, _), (most, table) = ranked[0], ranked[-1]
    sentence = (
        "the table has no elasticity of the oil; on a class B road it misses the model by "
        + shares(most)
    )
    if len(tables) > 1:
        sentence += f" at setting {table.setting}, the worst, and by {shares(least)} at the best"
    return sentence


def interval_lines(table: ForceTable, speed: float = 1.0, sign: float = 1.0) -> list[str]:
    """Return the 95 % interval of each force, in a file's units and signs, as lines."""
    if not table.has_interval:
        return ["95 % interval of the forces: not known"]
    rows = [f"95 % interval of the forces: {'mm/s' if abs(speed) > 1.0 else 'm/s'}, low N, high N"]
    for v, *ends in zip(table.speeds, table.low, table.high, strict=True):
        low, high = sorted(sign * end for end in ends)
        rows.append(f"  {speed * v + 0.0:.6g} {low:.3f} {high:.3f}")
    return rows
