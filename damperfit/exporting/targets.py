"""What is exported of a run, and the targets that write it. Nothing here writes to disk.

The force by speed is the characteristic of the damper alone, at constant speed through the middle
of the stroke. It leaves out what the rig adds (mounting, play, moving mass, lag, tare), the
elasticity of the oil, and the gas, which is exported separately. Friction is included; it jumps at
rest, so the table is a straight line through 0 0 below its first speed. Points are dense where cars
are tuned, and where linear interpolation misses the force, as at the opening of a valve. A table
ends at the tested speed unless it is extended; intervals, and the speed up to which the logs
determine the force, are those of `damperfit.adjustment.force_at`.
"""

from __future__ import annotations

import csv
import io
import math
import re
import tomllib
import zipfile
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cache, lru_cache
from importlib import resources
from itertools import groupby
from pathlib import Path
from typing import Any, NamedTuple, cast

import numpy as np
from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup, escape

from damperfit import __version__
from damperfit.adjustment.force_at import determined_speed, force_at
from damperfit.arrays import FloatArray
from damperfit.damper.model import RIG, Model, Values
from damperfit.damper.mounting import NONE
from damperfit.damper.network import without_rig
from damperfit.damper.purdy.parameters import Damper
from damperfit.damper.quasi_static import quasi_static
from damperfit.damper.temperature_law import WithTemperature
from damperfit.errors import ConfigurationError, did_you_mean
from damperfit.problem import Option, Problem, note
from damperfit.queries.settings import refuse_unfitted
from damperfit.reporting.report import tested_range
from damperfit.reporting.sheet import printable
from damperfit.results import Run
from damperfit.settings_and_logs import SettingResult
from damperfit.simulation import Motion, SolverOptions, simulate
from damperfit.tables.files import safe_cell
from damperfit.tested.setting import Setting
from damperfit.units.shown_units import SI, ShownUnits

# m/s: low-speed adjusters of cars work at 5 to 50 mm/s; beyond, each point is a fifth farther.
_TUNED = (5e-3, 7.5e-3, 0.01, 0.0125, 0.015, 0.02, 0.025, 0.03, 0.035, 0.04, 0.045, 0.05)
_FARTHER = 1.2
_HALVED = 6  # times, between two points
_MISS, _LEAST_MISS = 3e-3, 0.1  # of the force, and N
_FARTHEST = 5.0  # times the tested speed; the model says little of the damper beyond
_GAS_POINTS = 13
_SHOWN = {"N/m": (1e-3, " N/mm"), "m": (1e3, " mm"), "s": (1e3, " ms")}  # play of 0.2 mm
_REBOUND = "velocity in m/s and force in N are positive in rebound; displacement in m likewise"
_SIGN = "forces, displacement and velocity are positive in rebound (rod out)"
_OF_PAPER = ("r_m1", "r_m2", "r_m3", "k_e", "f_f")
_STORED = ("parameters", "mse", "adjustment", "characteristics")
_DATE = (1980, 1, 1, 0, 0, 0)
_PARTS = {
    "[Content_Types].xml": "xlsx_types.xml",
    "_rels/.rels": "xlsx_rels.xml",
    "xl/workbook.xml": "xlsx_workbook.xml",
    "xl/_rels/workbook.xml.rels": "xlsx_workbook_rels.xml",
    "xl/styles.xml": "xlsx_styles.xml",
}


@dataclass(frozen=True, slots=True, eq=False)
class ExportedRun:
    """A run as the targets need it."""

    run: Run  # identity and tested range
    damper: Model  # at one temperature, where the run's depends on it: other programs have none
    settings: tuple[SettingResult, ...]  # rising; at least one
    notes: tuple[Problem, ...] = ()  # on the values


def exported_run(
    results: Path | Run, *, config: Path | None = None, temperature: str | None = None
) -> ExportedRun:
    """Return a run, of a results folder or a fleet's part, for a target.

    The damper of ``config`` is taken where the run does not hold its own; ``temperature`` is the
    oil's, where the damper follows it: the reference temperature by default.
    """
    run = Run.load(results, parts=("parameters",), config=config, temperature=temperature)
    damper, settings, notes = run.damper, refuse_unfitted(run).settings, []
    if isinstance(damper, WithTemperature):
        at = damper.oil_temperature
        text = f"resistances as they are at {at:g} degC (fitted at {damper.reference:g} degC)"
        notes.append(note("at-temperature", text))
        settings = tuple(_at_one_temperature(fit, damper) for fit in settings)
        damper = damper.plain
    text = "the logs set no upper limit; the speeds to which the force is determined allow for it"
    notes += [
        note("no-upper-limit", text, f"{', '.join(fit.unlimited)} at setting {fit.setting}")
        for fit in settings
        if fit.unlimited
    ]
    run.motion  # noqa: B018 - where it is not known, that is a warning of the run
    return ExportedRun(run, damper, settings, tuple(notes))


def _at_one_temperature(fit: SettingResult, damper: WithTemperature) -> SettingResult:
    values = damper.at_reference(fit.values, damper.oil_temperature)
    own, shared = (tuple(n for n in names if n in values.names) for names in (fit.own, fit.shared))
    indices = [k for k, name in enumerate((*fit.own, *fit.shared)) if name in values.names]
    covariance = None if fit.covariance is None else fit.covariance[np.ix_(indices, indices)]
    limits = tuple(pair for pair in fit.open_limits if pair[0] in values.names)
    return replace(
        fit, parameters=values, own=own, shared=shared, covariance=covariance, open_limits=limits
    )


# Force by speed


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
    level: float  # force at rest at x = 0
    tare: float  # the rig's offset
    gas_displacements: FloatArray  # over the tested stroke, m
    gas_forces: FloatArray  # at rest, N; one point where the model has no gas
    has_gas: bool  # the model has a gas; otherwise the level is of gas and tare together
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

    def words_at(self, speed: float) -> str:
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
    speed = run.run.tested.speed
    fastest = run.run.motion.peak_speed if speed is None else speed
    tested = []
    for fit in run.settings:  # to three digits: without the noise of the log
        top = min(fit.top_speed, fastest)
        size = 10.0 ** (2 - math.floor(math.log10(top)))
        tested.append(math.floor(top * size * (1.0 + 1e-9)) / size)
    if max(tested) < 1.02 * min(tested):  # the same test, but for noise
        tested = [min(tested)] * len(tested)
    if extend is not None and not min(tested) < extend <= _FARTHEST * max(tested):
        raise ConfigurationError(
            f"expected a speed above the tested {min(tested):.4g} m/s and "
            f"up to {_FARTHEST:g} times it; leave {{--extend}} out for a table of what was tested",
            where=Option("extend", f"{extend:g} m/s"),
            code="out-of-range",
        )
    tables: list[ForceTable] = []
    slugs: Counter[str] = Counter()
    pairs = list(zip(run.settings, tested, strict=True))
    for group in [pairs] if common else [[pair] for pair in pairs]:
        fits, speeds = zip(*group, strict=True)
        end = max(min(speeds), extend or 0.0)
        tops = {end, *(speed for speed in speeds if speed < end)}
        grid, forces = _characteristics(run.damper, fits, tops)
        for (fit, speed), row in zip(group, forces, strict=True):
            # Labels that differ in signs alone, or in capitals, must not share a file.
            slug = fit.setting.slug
            slugs[slug.casefold()] += 1
            slug += f"_{n}" if (n := slugs[slug.casefold()]) > 1 else ""
            tables.append(_table(run, fit, slug, speed, grid, row))
    return tuple(tables)


def _characteristics(
    damper: Model, fits: Sequence[SettingResult], tops: set[float]
) -> tuple[FloatArray, FloatArray]:
    """Return speeds of both strokes, with those of ``tops``, and forces (n settings, m speeds)."""
    top = max(tops)
    side = [min(1.0, top / (2.0 * _TUNED[-1])) * speed for speed in _TUNED]
    while side[-1] * _FARTHER < top:
        side.append(side[-1] * _FARTHER)
    side = sorted({*(v for v in side if all(abs(v / w - 1.0) > 0.02 for w in tops)), *tops})
    grid = np.array([*(-v for v in reversed(side)), 0.0, *side])
    offsets = [quasi_static(damper, fit.values, np.zeros(1)).forces[0] for fit in fits]

    def at(speeds: FloatArray) -> FloatArray:
        rows = zip(fits, offsets, strict=True)
        return np.array(
            [quasi_static(damper, fit.values, speeds).forces - f_0 for fit, f_0 in rows]
        )

    forces = at(grid)
    forces[:, grid == 0.0] = 0.0
    is_new = (grid[1:] != 0.0) & (grid[:-1] != 0.0)  # friction jumps at rest
    for _ in range(_HALVED):  # where linear interpolation misses
        place = np.flatnonzero(is_new)
        middle = 0.5 * (grid[place] + grid[place + 1])
        line, exact = 0.5 * (forces[:, place] + forces[:, place + 1]), at(middle)
        missed = (np.abs(line - exact) > _MISS * np.abs(exact) + _LEAST_MISS).any(axis=0)
        if not missed.any():
            break
        place = place[missed]
        grid = np.insert(grid, place + 1, middle[missed])
        forces = np.insert(forces, place + 1, exact[:, missed], axis=1)
        is_new = np.isin(np.arange(len(is_new)), place)
        is_new = np.repeat(is_new, 1 + is_new)  # both halves
    return grid, forces


def _table(
    run: ExportedRun,
    fit: SettingResult,
    slug: str,
    tested: float,
    grid: FloatArray,
    row: FloatArray,
) -> ForceTable:
    low, high = row.copy(), row.copy()
    if fit.covariance is not None:
        measured = [force for force in run.run.speed_forces if force.setting == fit.setting]
        sizes = sorted(set(np.abs(grid).tolist()) - {0.0})
        for point in force_at([fit], run.damper, sizes, measured=measured):
            at = grid == (point.speed if point.stroke == "rebound" else -point.speed)
            low[at] -= point.force - point.low
            high[at] += point.high - point.force
    still = quasi_static(run.damper, fit.values, np.zeros(1))
    level, stroke = float(still.forces[0]) - still.tare, run.run.motion.amplitude
    x = np.linspace(-stroke, stroke, _GAS_POINTS)
    gas = run.damper.rest_force(x)
    return ForceTable(
        setting=fit.setting,
        slug=slug,
        mse_percent=fit.mse_percent,
        speeds=grid,
        forces=row,
        low=low,
        high=high,
        tested=tested,
        determined=determined_speed(fit, run.damper),
        stroke=stroke,
        level=level,
        tare=0.0 if gas is None else fit.offset,
        gas_displacements=np.zeros(1) if gas is None else x,
        gas_forces=np.array([level]) if gas is None else gas,
        has_gas=gas is not None,
        has_interval=fit.covariance is not None,
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
    """Return the errors of a table against the damper's dynamics on the road, at three speeds."""
    fitted = next(fit.values for fit in run.settings if fit.setting == table.setting)
    damper, values = run.damper, without_rig(fitted)
    if damper.rest_force(0.0) is None:  # the offset holds the gas force, and stays
        offsets = (quantity.name for quantity in fitted.quantities if quantity.is_offset)
        values = values.replace({name: fitted[name] for name in offsets})
    road, start = standard_road(), int(_RUN_IN * _RATE)
    top, widest = float(np.abs(road.velocity).max()), float(np.abs(road.displacement).max())
    is_reached = table.end >= _ROAD_SPEEDS[-1]
    misses = []
    for speed in _ROAD_SPEEDS if is_reached else [share * table.end for share in _SLOWER]:
        scale = min(speed / top, table.stroke / widest)
        force = _on_road(damper, values, scale, run.run.solver)[start:]
        x, v = scale * road.displacement[start:], scale * road.velocity[start:]
        miss = np.interp(v, table.speeds, table.forces) + table.at_rest(x) - force
        square = float(np.mean(miss * miss))
        percent = 100.0 * square / float(np.var(force))
        misses.append(RoadMiss(scale * top, math.sqrt(square), percent))
    return tuple(misses)


@lru_cache(maxsize=512)
def _on_road(damper: Model, values: Values, scale: float, solver: SolverOptions) -> FloatArray:
    road = standard_road()
    motion = Motion(road.interval, scale * road.displacement, scale * road.velocity)
    return simulate(values, damper, motion, options=solver).force


# The head of every file: plain lines, which each target writes as its comments.


def one_line(text: str) -> str:
    """Return text that ends no comment and holds no control characters."""
    return "".join(letter if letter.isprintable() else " " for letter in text)


def header_lines(
    run: ExportedRun, tables: Sequence[ForceTable], *, sign: str, gas: str, has_table: bool = True
) -> list[str]:
    """Return the head of a file: identity, tested range, MSE, and what the file leaves out.

    ``sign`` says what is positive, ``gas`` where the gas force is. Without a table the file holds
    the equations.
    """
    results = run.run
    with_mse = [table for table in tables if math.isfinite(table.mse_percent)]
    ranked = sorted(with_mse, key=lambda table: table.mse_percent)
    errors = [
        f"{table.mse_percent:.3g} %" + f" (setting {table.setting})" * (len(ranked) > 1)
        for table in ranked[:: max(1, len(ranked) - 1)]  # the best and the worst
    ]
    lines = [
        f"damperfit {__version__}: {results.name}, setting "
        + ", ".join(str(table.setting) for table in tables),
        f"identity: {'; '.join(f'{k} {v}' for k, v in results.identity.items()) or 'not named'}",
        f"model: {run.damper.sentence}",
        f"tested: {tested_range(results.tested, SI)}",
        f"MSE of the fit: {' to '.join(errors) or 'not known'}",
    ]
    if has_table:
        lines.append(
            "table: force of the damper alone at constant speed, in the middle of the stroke"
        )
    lines += [f"taken out: {taken_out(run)}", determined_line(tables)]
    if has_table and any(table.is_extended for table in tables):
        end, tested = max(table.end for table in tables), min(table.tested for table in tables)
        lines.append(
            f"beyond {tested:.4g} m/s UNTESTED: up to {end:.4g} m/s the table is the model's, "
            "unmeasured there; intervals hold half and twice of its rise"
        )
    elif has_table:
        lines.append(
            f"beyond {tables[0].end:.4g} m/s there is nothing: do not let a program hold the last "
            "value, the damper's force goes on rising; an extended table has rows of the model"
        )
    lines += [road_line(run, tables)] if has_table else []
    lines += [f"gas: {gas}", f"sign: {sign}", f"results: sha256 {results.digest or 'not known'}"]
    return list(map(one_line, lines))


def taken_out(run: ExportedRun) -> str:
    """Return the fitted values that are not in the file: mounting, play, mass, lag, tare."""
    items = []
    for quantity in run.damper.quantities:
        name = quantity.name
        numbers = [fit.values[name] for fit in run.settings if name in fit.values.names]
        is_tare = quantity.is_offset and run.damper.rest_force(0.0) is not None
        if any(numbers) and (is_tare or quantity.scope == RIG):
            factor, unit = _SHOWN.get(quantity.unit, quantity.shown)
            limits = min(numbers), max(numbers)
            texts = dict.fromkeys(f"{factor * limit:.4g}" for limit in limits)
            label = "tare of the rig" if is_tare else quantity.label
            items.append(f"{label} {' to '.join(texts)}{unit}")
    if getattr(getattr(run.damper, "mounting", None), "series_stiffness", NONE) == NONE:
        items.insert(0, "no mounting (rigid)")
    return ", ".join(items)


def gas_line(table: ForceTable, place: str, *, is_bump_positive: bool = False) -> str:
    """Return the force at rest, and what to do with it (``place``: "add it to the spring").

    The table may be of any setting: the gas is the damper's. Where a file counts compression as
    positive the gas has the sign of its spring.
    """
    sign, outward = (-1.0, "plus") if is_bump_positive else (1.0, "minus")
    name = "gas force" if table.has_gas else "force at rest, gas and tare of the rig together,"
    level = f"{name} {sign * table.level:.4g} N at x = 0 ({outward} pushes the rod out)"
    if table.has_gas:
        stroke, forces = 1e3 * table.stroke, sign * table.gas_forces
        level += f", {forces[0]:.4g} N at -{stroke:.3g} mm, "
        level += f"{forces[-1]:.4g} N at +{stroke:.3g} mm of rebound"
    return f"not in the table; {level}; {place}"


def determined_line(tables: Sequence[ForceTable]) -> str:
    """Return up to which speed the logs determine the force of each setting."""

    def speed_of(table: ForceTable) -> str:
        return "not known" if math.isnan(table.determined) else f"{table.determined:.2g} m/s"

    items = []
    for speed, group in groupby(tables, key=speed_of):
        names = [str(table.setting) for table in group]
        which = f"s {names[0]} to {names[-1]}" if len(names) > 1 else f" {names[0]}"
        items.append(f"{speed} at setting{which}")
    tested = {f"{table.tested:.3g}" for table in tables}
    beyond = ", if the valves go on as fitted, which no log shows"
    beyond *= any(table.determined > table.tested for table in tables)
    return (
        f"tested to {' to '.join(sorted({min(tested), max(tested)}))} m/s; from there the 95 % "
        f"interval is within 5 % of the damping up to {', '.join(items)}{beyond}"
    )


def road_line(run: ExportedRun, tables: Sequence[ForceTable]) -> str:
    """Return the errors of tables against the damper's dynamics on a road, as a sentence."""

    def shares(misses: Sequence[RoadMiss]) -> str:
        texts = (f"{m.percent:.2g} % MSE ({m.rms:.3g} N rms) at {m.speed:.2g} m/s" for m in misses)
        return ", ".join(texts)

    ranked = [(road_misses(run, table), table) for table in tables]
    ranked.sort(key=lambda pair: max(miss.percent for miss in pair[0]))
    (least, _), (most, table) = ranked[0], ranked[-1]
    sentence = (
        "the table has no elasticity of the oil; on a class B road it misses the model by "
        + shares(most)
    )
    if len(tables) > 1:
        sentence += f" at setting {table.setting}, the worst, and by {shares(least)} at the best"
    return sentence


def interval_lines(table: ForceTable, speed: float) -> list[str]:
    """Return the 95 % interval of each force, in a file's units and signs, as lines."""
    if not table.has_interval:
        return ["95 % interval of the forces: not known"]
    rows = [f"95 % interval of the forces: {'mm/s' if abs(speed) > 1.0 else 'm/s'}, low N, high N"]
    for v, *limits in zip(table.speeds, table.low, table.high, strict=True):
        low, high = sorted(math.copysign(1.0, speed) * limit for limit in limits)
        rows.append(f"  {speed * v + 0.0:.6g} {low:.3f} {high:.3f}")
    return rows


# Targets: the entries of ``targets.toml``


@dataclass(frozen=True, slots=True)
class ExportOptions:
    """What the user may choose."""

    stem: str = "damper"  # the names of the files begin with it
    extend: float | None = None  # speed up to which tables go, m/s; None: to the tested speed
    units: ShownUnits = SI  # of spreadsheets; simulators fix their units
    decimal: str = "."  # mark of the decimals in CSV: a point or a comma


class Export(NamedTuple):
    """The files of one target."""

    target: Target
    options: ExportOptions
    files: Mapping[str, bytes]  # by name
    tables: tuple[ForceTable, ...]  # of each setting, as they stand in the files, or would
    lost: str  # error of the tables against the damper's dynamics; empty without a table
    determined: str  # up to which speed the logs determine the force
    notes: tuple[Problem, ...]


@dataclass(frozen=True, slots=True)
class Target:
    """A program or format that a damper can be exported to: an entry of ``targets.toml``."""

    name: str  # as on the command line
    title: str  # for people, as are units of speed and force, what is positive, and where it goes
    file: str  # pattern of names: {stem}.csv, {stem}_s{setting}.dpr for one a setting; or several
    units: str
    sign: str
    place: str
    template: str = ""  # of a text that a template makes
    encoding: str = "utf-8"  # what it cannot hold becomes a question mark
    read: Mapping[str, Any] = field(default_factory=dict)  # how `check` finds the table again
    has_table: bool = True  # it holds force by speed
    physics_of: Sequence[str] = ()  # models whose own equations it holds instead
    takes: Sequence[str] = ()  # options that only some targets heed: "units", "decimal"

    def place_of(self, out: Path) -> tuple[Path, str]:
        """Return the folder to write to and the stem of the files' names.

        ``out`` is a file if it has a suffix, else a folder.
        """
        if not out.suffix or out.is_dir():
            return out, "damper"
        suffixes = ["." + pattern.rpartition(".")[2] for pattern in self.file.split(", ")]
        if out.suffix.lower() not in suffixes:
            raise ConfigurationError(
                f"{self.name} writes {' and '.join(suffixes)} files; give a "
                "name that ends so, or a folder",
                where=Option("out", out),
                code="wrong-suffix",
            )
        return out.parent, out.stem

    def export(self, run: ExportedRun, options: ExportOptions = ExportOptions()) -> Export:
        """Return the files of this target for a run."""
        from damperfit.exporting.fmu import missing_platforms, write_fmu

        has_table = self.has_table and run.damper.name not in self.physics_of
        if options.extend is not None and not has_table:
            raise ConfigurationError(
                f"{self.name} holds no table here; leave it out",
                where=Option("extend", f"{options.extend:g}"),
                code="no-effect",
            )
        is_one_each = "{setting}" in self.file
        tables = force_tables(run, extend=options.extend, common=not is_one_each)
        notes, files = run.notes, {}
        if self.name in ("fmu2", "fmu3"):
            version = int(self.name[-1])
            files[f"{options.stem}.fmu"] = write_fmu(run, tables, version=version)
            notes += missing_platforms(version)
        elif self.name in _WRITERS:
            files = _WRITERS[self.name](run, tables, options)
        else:
            for group in [(table,) for table in tables] if is_one_each else [tables]:
                text = rendered(self.template, **_context(run, group, options)).rstrip("\n") + "\n"
                name = self.file.format(stem=options.stem, setting=group[0].slug)
                errors = "xmlcharrefreplace" if text.startswith("<?xml") else "replace"
                files[name] = text.encode(self.encoding, errors)
        lost = road_line(run, tables) if has_table else ""
        return Export(self, options, files, tables, lost, determined_line(tables), notes)


# Texts: a template gets the run, its tables (`table` is the first), the options and functions


def rendered(template: str, **context: Any) -> str:
    """Return a template of this package, filled in; texts cannot leave their place in XML, HTML."""
    is_marked = template.endswith((".xml", ".html"))
    return _environment(is_marked=is_marked).get_template(template).render(**context)


@cache
def _environment(*, is_marked: bool) -> Environment:
    def escaped(text: object) -> Markup:
        return text if isinstance(text, Markup) else escape(printable(str(text)))

    environment = Environment(
        loader=PackageLoader("damperfit.exporting"),
        autoescape=is_marked,  # noqa: S701 - other texts are no markup
        finalize=escaped if is_marked else None,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    environment.filters["one_line"] = one_line
    return environment


def _context(
    run: ExportedRun, tables: Sequence[ForceTable], options: ExportOptions
) -> dict[str, Any]:
    """The variables of every template."""
    first, numbers = tables[0], _setting_numbers(tables)

    def header(
        sign: str, place: str, *, is_bump_positive: bool = False, has_table: bool = True
    ) -> list[str]:
        gas = gas_line(first, place, is_bump_positive=is_bump_positive) if has_table else place
        return header_lines(run, tables, sign=sign, gas=gas, has_table=has_table)

    def grid_of(column: str) -> FloatArray:
        columns = [first.speeds, *(getattr(table, column) for table in tables)]
        return np.vstack([[0.0, *numbers], np.column_stack(columns)])

    gas = list(zip(first.gas_displacements, first.gas_forces, strict=True))
    if len(gas) == 1:  # a table needs two points
        gas = [(-first.stroke, first.level), (first.stroke, first.level)]
    ranges = groupby(first.rows(), key=lambda row: first.range_of(row[0]))
    return {
        "run": run,
        "version": __version__,
        "tables": tables,
        "table": first,
        "options": options,
        "header": header,
        "intervals": lambda speed=1.0, of=first: interval_lines(of, speed),
        "comments": lambda mark, lines: "\n".join(f"{mark} {line}".rstrip() for line in lines),
        "rebound": _REBOUND,
        "ranges": [(range_, list(rows)) for range_, rows in ranges],
        "grid_of": grid_of,
        "gas_rows": gas,
        # A name that programs take as an identifier: 10, _3.
        "identifier": lambda table: re.sub(r"[^A-Za-z0-9]", "_", table.slug),
        "labels": [
            f"column {at:g} is setting {one_line(str(table.setting))}"
            for at, table in zip(numbers, tables, strict=True)
            if len(tables) > 1 and str(table.setting) != f"{at:g}"
        ],
    }


def _setting_numbers(tables: Sequence[ForceTable]) -> list[float]:
    """Return a number for each setting, rising: where it stands, else 1, 2, ..."""
    numbers = [n for table in tables if (n := table.setting.number()) is not None]
    is_rising = len(numbers) == len(tables) and bool(np.all(np.diff(numbers) > 0.0))
    return list(map(float, numbers)) if is_rising else [1.0 + k for k in range(len(tables))]


def _modelica(
    run: ExportedRun, tables: Sequence[ForceTable], options: ExportOptions
) -> dict[str, bytes]:
    """Return a Modelica model with all settings; ``setting`` counts them from 1."""
    first, stem = tables[0], options.stem
    slopes = [np.diff(table.forces) / np.diff(first.speeds) for table in tables]
    x, gas = first.gas_displacements, first.gas_forces
    name = re.sub(r"\W", "_", stem, flags=re.ASCII).strip("_") or "damper"
    name = name if name[0].isalpha() else f"D_{name}"
    quantities = [quantity for quantity in run.damper.quantities if quantity.name in _OF_PAPER]
    text = rendered(
        "modelica.mo",
        **_context(run, tables, options),
        name=name[0].upper() + name[1:],
        sign="s_rel in m, v_rel in m/s and f in N are positive in rebound (tension)",
        physics=isinstance(run.damper, Damper),
        damper=run.damper,
        quantities=quantities,
        values={
            quantity.name: [fit.values[quantity.name] for fit in run.settings]
            for quantity in quantities
        },
        speeds=first.speeds[:-1].tolist(),
        firsts=[float(table.forces[0]) for table in tables],
        bends=[[float(slope[0]), *np.diff(slope).tolist()] for slope in slopes],
        gas=np.polyfit(x, gas, min(3, len(x) - 1))[::-1].tolist(),
    )
    return {f"{stem}.mo": (text.rstrip("\n") + "\n").encode("utf-8", "replace")}


def _matlab(
    run: ExportedRun, tables: Sequence[ForceTable], options: ExportOptions
) -> dict[str, bytes]:
    """Return a script (.m) and a data file (.mat, version 5) with the same variables."""
    from scipy.io import savemat

    first, context, stem = tables[0], _context(run, tables, options), options.stem
    labels = [str(table.setting) for table in tables]
    lines = [
        *context["header"](_REBOUND, "gas_force at gas_displacement; add it to the table's force"),
        "set the table's extrapolation: linear or error, never the last value",
        *(f"column {k} of force: setting {label}" for k, label in enumerate(labels, 1)),
    ]

    def columns(name: str) -> FloatArray:
        return np.column_stack([getattr(table, name) for table in tables])

    variables: dict[str, FloatArray] = {
        "setting": np.array([_setting_numbers(tables)]),
        "velocity": first.speeds[:, None],
        "force": columns("forces"),
        "force_low": columns("low"),
        "force_high": columns("high"),
        "determined_speed": columns("determined"),
        "tested_speed": np.array([[max(table.tested for table in tables)]]),
        "gas_displacement": first.gas_displacements[:, None],
        "gas_force": first.gas_forces[:, None],
    }
    script = rendered("matlab.m", **context, about=map(one_line, lines), variables=variables)
    cells = np.array(labels, dtype=object)[None, :]
    document = {"setting_label": cells, **variables, "about": "\n".join(lines)}
    file = io.BytesIO()
    savemat(cast("Any", file), document, format="5")
    content = b"MATLAB 5.0 MAT-file, damperfit".ljust(116) + file.getvalue()[116:]  # no date
    return {f"{stem}.m": script.encode("utf-8", "replace"), f"{stem}.mat": content}


# Spreadsheets: text is stored as text, so that no cell can become a formula; no date in their bytes


class _Table(NamedTuple):
    """A table of numbers, text, or None where nothing is known."""

    name: str
    headings: Sequence[str]
    units: Sequence[str]
    rows: Sequence[Sequence[Any]]


def _stored(run: ExportedRun, units: ShownUnits) -> Iterator[_Table]:
    """Yield the stored tables that the run has."""
    for name in filter(run.run.rows, _STORED):
        table, columns = run.run.table(name), []
        for column in table.schema:
            unit, cells = column.metadata[b"unit"].decode(), table[column.name].to_pylist()
            unit = "" if unit == "1" else unit
            if units.of(unit) != unit:
                cells = [None if cell is None else units.show(cell, unit) for cell in cells]
            columns.append((units.column(column.name, unit), units.of(unit), cells))
        headings, units_of, cells_of = zip(*columns, strict=True)
        yield _Table(name, headings, units_of, list(zip(*cells_of, strict=True)))


def _about(run: ExportedRun, tables: Sequence[ForceTable]) -> list[str]:
    gas = gas_line(tables[0], "add it to the force")
    return header_lines(run, tables, sign=_SIGN, gas=gas)


def _workbook(
    run: ExportedRun, tables: Sequence[ForceTable], options: ExportOptions
) -> dict[str, bytes]:
    """Return one workbook: what it is about, forces with half intervals, tables of the results."""
    units = options.units
    with_interval = [table for table in tables if table.has_interval]
    halves = (0.5 * (table.high - table.low) for table in with_interval)
    forces = [units.show(force, "N") for force in (*(table.forces for table in tables), *halves)]
    headings = [
        units.column("speed_m_per_s", "m/s"),
        *(f"setting {table.setting}" for table in tables),
        *(f"± 95 % of setting {table.setting}" for table in with_interval),
    ]
    unit_row = [units.of("m/s"), *(units.of("N") for _ in forces)]
    rows = np.column_stack([units.show(tables[0].speeds, "m/s"), *forces]).tolist()
    sheets = (
        _Table("about", ["about"], [""], [[line] for line in _about(run, tables)]),
        _Table("forces", headings, unit_row, rows),
        *_stored(run, units),
    )

    def letters(place: int) -> str:
        """Of a column counted from 0: A, Z, AA."""
        rounds, letter = divmod(place, 26)
        return (letters(rounds - 1) if rounds else "") + chr(ord("A") + letter)

    parts = {name: rendered(template, sheets=sheets) for name, template in _PARTS.items()}
    for k, sheet in enumerate(sheets, 1):
        heads = [sheet.headings, *([sheet.units] if any(sheet.units) else [])]
        parts[f"xl/worksheets/sheet{k}.xml"] = rendered(
            "xlsx_sheet.xml", headings=sheet.headings, heads=heads, rows=sheet.rows, column=letters
        )
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.comment = b"damperfit"
        for name, text in parts.items():
            entry = zipfile.ZipInfo(name, _DATE)
            archive.writestr(entry, text.encode("utf-8", "replace"), zipfile.ZIP_DEFLATED)
    return {f"{options.stem}.xlsx": file.getvalue()}


def _csv_files(
    run: ExportedRun, tables: Sequence[ForceTable], options: ExportOptions
) -> dict[str, bytes]:
    """Return a row a setting and speed, all tables of the results, and their header as text."""
    units, mark, stem = options.units, options.decimal, options.stem

    def text_of(cell: Any) -> str:
        """A text that no spreadsheet takes for a formula; numbers stay numbers."""
        text = repr(cell).replace(".", mark) if isinstance(cell, float) else str(cell)
        with suppress(ValueError):
            float(text.replace(",", "."))
            return text
        return safe_cell(text)

    def content(head: Sequence[str], rows: Iterable[Sequence[Any]]) -> bytes:
        file = io.StringIO()
        # With a decimal comma spreadsheets expect semicolons between cells.
        writer = csv.writer(file, delimiter=";" if mark == "," else ",", lineterminator="\n")
        writer.writerow(head)
        writer.writerows(["" if cell is None else text_of(cell) for cell in row] for row in rows)
        return file.getvalue().encode("utf-8", "backslashreplace")

    rows = []
    for table in tables:
        columns = [units.show(column, "N") for column in (table.forces, table.low, table.high)]
        columns.insert(0, units.show(table.speeds, "m/s"))
        for v, speed, *numbers in zip(table.speeds, *columns, strict=True):
            force, *interval = (f"{value:.3f}".replace(".", mark) for value in numbers)
            interval = interval if table.has_interval else ["", ""]
            speed_cell = f"{speed:.6g}".replace(".", mark)
            rows.append((str(table.setting), speed_cell, force, table.range_of(v), *interval))
    names = ("force_N", "force_ci_low_N", "force_ci_high_N")
    force, *interval = (units.column(name, "N") for name in names)
    head = ("setting", units.column("speed_m_per_s", "m/s"), force, "range", *interval)
    about = "\n".join(_about(run, tables)) + "\n"
    files = {
        f"{stem}.csv": content(head, rows),
        f"{stem}_about.txt": about.encode("utf-8", "backslashreplace"),
    }
    for stored in _stored(run, units):
        # The unit stands with the name, where that does not end with it already.
        headings = [
            f"{name} [{unit}]" if unit and not name.endswith("_" + unit.replace("/", "_per_"))
            else name
            for name, unit in zip(stored.headings, stored.units, strict=True)
        ]  # fmt: skip
        files[f"{stem}_{stored.name}.csv"] = content(headings, stored.rows)
    return files


# Targets that one template cannot write.
_WRITERS: Mapping[
    str, Callable[[ExportedRun, Sequence[ForceTable], ExportOptions], dict[str, bytes]]
] = {"csv": _csv_files, "xlsx": _workbook, "matlab": _matlab, "modelica": _modelica}
# By name; a new target is a template and an entry there.
TARGETS: Mapping[str, Target] = {
    name: Target(name, **entry)
    for name, entry in tomllib.loads(
        resources.files("damperfit.exporting").joinpath("targets.toml").read_text("utf-8")
    ).items()
}


def find_target(name: str) -> Target:
    """Return the target of a name."""
    if name not in TARGETS:
        raise ConfigurationError(
            f"expected one of {', '.join(TARGETS)}.{did_you_mean(name, TARGETS)} "
            "damperfit export --list shows them",
            where=Option("to", name),
            code="unknown-target",
        )
    return TARGETS[name]
