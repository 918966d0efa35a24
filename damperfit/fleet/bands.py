"""The forces of a fleet held against bands: around the median of the fleet, or nominal ones."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from damperfit.comparison import Point
from damperfit.errors import ConfigurationError
from damperfit.simulation.characteristics import NAMED_SPEEDS

if TYPE_CHECKING:
    from collections.abc import Iterator

    from damperfit.comparison import Tolerance
    from damperfit.comparison.tolerance import Band as Nominal
    from damperfit.fleet.survey import Series, Spread, Survey

__all__ = ["HeldFleet", "fleet_against_bands"]

_NEAR = 1e-9  # m/s


@dataclass(frozen=True, slots=True)
class HeldFleet:
    """A fleet held against a tolerance.

    Attributes
    ----------
    source : str
        The tolerance, as it was given.
    n_points, n_dampers : int
        Forces and dampers that were held against it.
    missed : tuple of Point
        Forces outside, and those that could not be looked at; these first, then the farthest.
    """

    source: str
    n_points: int
    n_dampers: int
    missed: tuple[Point, ...]

    @property
    def worst(self) -> tuple[Point, ...]:
        """The first of `missed` of each damper that has one."""
        found: dict[str, Point] = {}
        for point in self.missed:
            found.setdefault(point.run, point)
        return tuple(found.values())

    @property
    def sentence(self) -> str:
        """The result in a sentence."""
        if not self.missed:
            return (
                f"All {self.n_dampers} dampers are within the tolerance, at {self.n_points} points."
            )
        unseen = sum(math.isnan(point.margin) for point in self.missed)
        beside = f", {unseen} of them not evaluated" if unseen else ""
        or_not = " or not evaluated" if unseen else ""
        return (
            f"{len(self.worst)} of {self.n_dampers} dampers are outside the tolerance{or_not}, at "
            f"{len(self.missed)} of {self.n_points} points{beside}."
        )


def fleet_against_bands(found: Survey, tolerance: Tolerance) -> HeldFleet:
    """Return the forces of a fleet that do not keep a tolerance.

    Per cent and newtons are around the median force of the setting over the fleet, and a damper
    without any force misses them; a table of nominal forces holds for every damper, and what a
    damper lacks of it is missed.

    Parameters
    ----------
    found : Survey
        Of the fleet.
    tolerance : Tolerance
        The bands.

    Raises
    ------
    ConfigurationError
        A nominal force is at a speed that a fleet's table does not have.
    """
    forces = [one for one in found.series if one.stroke]
    everyone = tuple(one.damper for one in found.dampers)
    n_points, missed = 0, []
    pieces = (
        _nominal(found, forces, tolerance, everyone)
        if tolerance.bands
        else _around(found, forces, tolerance, everyone)
    )
    for number, points in pieces:
        n_points += number
        missed += points
    missed.sort(key=lambda one: (not math.isnan(one.margin), one.margin))
    return HeldFleet(tolerance.source, n_points, len(everyone), tuple(missed))


def _around(
    found: Survey, forces: list[Series], tolerance: Tolerance, everyone: tuple[str, ...]
) -> Iterator[tuple[int, list[Point]]]:
    having = {str(found.names[k]) for one in forces for band in one.bands for k in band.rows}
    nothing = (math.nan, "", math.nan, math.nan, math.nan)  # speed, stroke, force and band
    lost = [
        Point(name, "", *nothing, reason="it has no force at any named speed")
        for name in everyone
        if name not in having
    ]
    yield len(lost), lost
    for series in forces:
        for band in series.bands:
            reach = max(tolerance.share * abs(band.median), tolerance.newtons)
            yield _held(found, series, band, band.median - reach, band.median + reach)


def _held(
    found: Survey, series: Series, band: Spread, low: float, high: float
) -> tuple[int, list[Point]]:
    values = series.values[band.rows]
    outside = [
        Point(
            *(str(found.names[row]), band.setting, series.speed, series.stroke),
            *(float(series.values[row]), low, high),
        )
        for row in band.rows[(values < low) | (values > high)]
    ]
    return len(band.rows), outside


def _nominal(
    found: Survey, forces: list[Series], tolerance: Tolerance, everyone: tuple[str, ...]
) -> Iterator[tuple[int, list[Point]]]:
    fitted: dict[str, set[str]] = {}
    for name, setting in zip(found.names, found.settings, strict=True):
        fitted.setdefault(str(setting), set()).add(str(name))
    for wanted in tolerance.bands:
        _refuse_speed(wanted.speed, tolerance.source)
        places = {k: own for k, own in fitted.items() if wanted.setting in {"", k}}
        reached: set[tuple[str, str]] = set()
        for one in forces:
            if one.stroke != wanted.stroke or abs(one.speed - wanted.speed) > _NEAR:
                continue
            for band in one.bands:
                if str(band.setting) in places:
                    yield _held(found, one, band, wanted.low, wanted.high)
                    reached |= {(str(found.names[k]), str(band.setting)) for k in band.rows}
        lost = [
            _unseen(name, setting, wanted, "the test does not reach the speed")
            for setting, names in places.items()
            for name in sorted(names)
            if (name, setting) not in reached
        ]
        having = {name for names in places.values() for name in names}
        why = "the setting was not tested" if wanted.setting else "nothing was fitted"
        lost += [
            _unseen(name, wanted.setting, wanted, why) for name in everyone if name not in having
        ]
        yield len(lost), lost


def _unseen(name: str, setting: str, wanted: Nominal, reason: str) -> Point:
    return Point(
        *(name, setting, wanted.speed, wanted.stroke, math.nan, wanted.low, wanted.high),
        reason=reason,
    )


def _refuse_speed(speed: float, source: str) -> None:
    if not any(abs(one - speed) <= _NEAR for one in NAMED_SPEEDS):
        raise ConfigurationError(
            f"--tolerance {source}: a fleet has no forces at {speed:g} m/s; expected its named "
            f"speeds, {', '.join(f'{one:g}' for one in NAMED_SPEEDS)} m/s"
        )
