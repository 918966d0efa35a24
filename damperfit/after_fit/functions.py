"""The functions of what follows a fit; the commands of the same names print what they return."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING

from damperfit.arguments import folder_of, path_of, public
from damperfit.errors import ConfigurationError
from damperfit.problem import Option
from damperfit.units.quantities import parse_quantity

if TYPE_CHECKING:
    from collections.abc import Iterator
    from threading import Event

    from damperfit.after_fit.advise import Advice
    from damperfit.after_fit.car_log import DrivenStroke
    from damperfit.after_fit.ride import Ride
    from damperfit.after_fit.valves import Orifices
    from damperfit.after_fit.watch import Arrival
    from damperfit.results import Run, SettingResult

__all__ = ["advise", "passport", "ride", "valves", "watch"]

_RESULTS = Path("results")
_FASTER = 2.0  # times the tested speed, where the rig's is not declared
_OF_TRAVEL = 0.9  # what a candidate may take of the damper's travel
_FASTEST = 10.0  # Hz, likewise


@public
def advise(  # noqa: PLR0913 - one keyword an option of the command line
    results: Run | str | Path = _RESULTS,
    *,
    for_: str | None = None,
    setting: str | None = None,
    max_stroke: str | float | None = None,
    max_speed: str | float | None = None,
    max_force: str | float | None = None,
    max_frequency: str | float | None = None,
    minutes: float = 2.0,
    config: str | Path | None = None,
) -> Advice:
    """Say which further test narrows an interval most.

    Parameters
    ----------
    results : Run or path
        With steady cycles among its logs.
    for_ : str
        A quantity such as k_e, or the force at a speed, as in "force@0.05m/s" (minus: compression).

    Returns
    -------
    Advice
        Candidates by rank, each with the share of today's interval that is left at each setting.
    """
    from damperfit.after_fit.advise import Limits, Question
    from damperfit.after_fit.advise import advise as advised

    if for_ is None:
        raise ConfigurationError(
            "expected {for_}, what is to be known better: a quantity such as k_e, or force@0.05m/s",
            for_=Option("for_"),
            code="question",
        )
    run = run_of(results, "damperfit.advise", config)
    wanted = run.settings if setting is None else (_setting(run, setting),)
    rig = run.configuration.rig
    stroke = _limit("max_stroke", max_stroke, rig.max_stroke, "length") or run.tested.stroke
    speed = _limit("max_speed", max_speed, rig.max_speed, "velocity") or _FASTER * (
        run.tested.speed or 0.0
    )
    if not stroke or not speed:
        raise ConfigurationError(
            f"{run.name}: the tested stroke and speed are not known; declare rig.max_stroke and "
            "rig.max_speed",
            code="no-limits",
        )
    stroke = min(stroke, _OF_TRAVEL * run.damper.travel)
    limits = Limits(
        stroke,
        speed,
        _limit("max_force", max_force, rig.max_force, "force") or math.inf,
        _limit("max_frequency", max_frequency, rig.max_frequency, "frequency") or _FASTEST,
        _positive("minutes", minutes),
    )
    return advised(run, Question.of(for_), limits, wanted)


@public
def valves(
    results: Run | str | Path = _RESULTS,
    *,
    cd: float = 0.7,
    cd_spread: float = 0.1,
    seat: str | float | None = None,
    reference: Run | str | Path | None = None,
    config: str | Path | None = None,
) -> Orifices:
    """Return the valves as parts: holes in mm, preloads in bar and N, and where a click jumps.

    Parameters
    ----------
    results, reference : Run or path
        Of any model with orifices or preloaded valves; the reference is an earlier run.
    """
    from damperfit.after_fit.valves import read_valves

    return read_valves(
        run_of(results, "damperfit.valves", config),
        discharge=_positive("cd", cd),
        discharge_spread=_spread(cd, cd_spread),
        seat=None if seat is None else _positive("seat", seat, "length"),
        reference=None if reference is None else run_of(reference, "damperfit.valves"),
    )


@public
def passport(
    results: Run | str | Path = _RESULTS,
    *,
    out: str | Path | None = None,
    units: str | None = None,
    config: str | Path | None = None,
) -> tuple[Path, Path]:
    """Write the passport of a damper: one A4 page, and a JSON that `compare` takes as a baseline.

    Parameters
    ----------
    results : Run or path
        Of one damper.

    Returns
    -------
    tuple of pathlib.Path
        The page and the JSON.
    """
    from damperfit.after_fit.passport import write_passport
    from damperfit.reporting.records import units_in
    from damperfit.units.shown_units import parse_units

    run = run_of(results, "damperfit.passport", config)
    shown = units_in(run.record) if units is None else parse_units(units)
    return write_passport(run, Path(out) if out is not None else Path(), shown)


@public
def ride(
    results: Run | str | Path = _RESULTS,
    *,
    car: str | Path | None = None,
    stroke: str | Path | None = None,
    setting: str | None = None,
    config: str | Path | None = None,
) -> Ride | DrivenStroke:
    """Show comfort and wheel load of each setting on a road, or its work along a measured stroke.

    Parameters
    ----------
    results : Run or path
        Of one damper.
    car : path
        [car] in TOML: masses, spring, tyre, motion ratio, road, speed.
    stroke : path
        Log of time and damper displacement from a car, in place of the road.
    """
    from damperfit.after_fit.car_log import drive_along, read_stroke
    from damperfit.after_fit.ride import read_car, ride_on_road

    run = run_of(results, "damperfit.ride", config)
    wanted = run.settings if setting is None else (_setting(run, setting),)
    if (car is None) == (stroke is None):
        raise ConfigurationError(
            "expected {car} or {stroke}, one of them",
            car=Option("car"),
            stroke=Option("stroke"),
            code="car-or-stroke",
        )
    if stroke is not None:
        return drive_along(run, read_stroke(Path(stroke)), wanted)
    return ride_on_road(run, read_car(Path(str(car))), wanted)


@public
def watch(
    folder: str | Path,
    *,
    out: str | Path | None = None,
    reference: Run | str | Path | None = None,
    config: str | Path | None = None,
    stop: Event | None = None,
) -> Iterator[Arrival]:
    """Yield what comes of each new log in a folder, until it is stopped.

    Results and page of all logs so far are written whenever no log waits.

    Parameters
    ----------
    folder : path
        Where the rig writes.
    out : path, optional
        Folder of the results; by default nothing is written.
    reference : Run or path, optional
        What forces are compared with.
    stop : threading.Event, optional
        Ends it when it is set; Ctrl-C does so too.
    """
    from threading import Event

    place = path_of(folder, "damperfit.watch", "the path of a folder")
    earlier = None if reference is None else run_of(reference, "damperfit.watch")
    if not place.is_dir():
        raise ConfigurationError("no such folder", subject=place, code="no-folder")
    if out is not None:
        from damperfit.store import check_writable

        if place.resolve().is_relative_to(Path(out).resolve()):
            raise ConfigurationError(
                "the results would stand among the logs; give another folder, such as "
                f"{place / 'results'}",
                where=Option("out", out),
                code="out-is-watched",
            )
        check_writable(Path(out))
    return _watched(place, out, earlier, config, stop or Event())


def _watched(
    folder: Path,
    out: str | Path | None,
    reference: Run | None,
    config: str | Path | None,
    stop: Event,
) -> Iterator[Arrival]:
    from damperfit.after_fit.watch import answered, arrivals
    from damperfit.api import identify

    folder = folder.resolve()
    own = None if out is None else Path(out).resolve()
    fitted: dict[Path, None] = {}
    is_stale = False
    try:
        for paths in arrivals(folder, own, stop):
            for path in paths:
                found = answered(
                    path,
                    lambda log: identify([log], config=config),
                    reference,
                    str(path.relative_to(folder)),
                )
                fitted.pop(path, None)
                if found.run is not None:
                    fitted[path] = None
                    is_stale = out is not None
                yield found
            if is_stale and not paths:
                identify(list(fitted), config=config, out=out, report=True)
                is_stale = False
    except KeyboardInterrupt:
        pass
    finally:
        if is_stale:
            identify(list(fitted), config=config, out=out, report=True)


def run_of(results: object, call: str, config: str | Path | None = None) -> Run:
    """Return a run as it is given, or read from its folder; one setting at least is fitted."""
    from damperfit.queries.settings import refuse_unfitted
    from damperfit.results import Run

    if isinstance(results, Run):
        return refuse_unfitted(results)
    own = None if config is None else Path(config)
    return refuse_unfitted(Run.load(folder_of(results, call), config=own))


def _spread(cd: float, spread: float) -> float:
    if not 0.0 <= spread < cd:
        raise ConfigurationError(
            f"expected 0 or more, and less than the coefficient, {cd:g}",
            where=Option("cd_spread", spread),
            code="cd-spread",
        )
    return spread


def _setting(run: Run, setting: str) -> SettingResult:
    try:
        return run.setting(setting)
    except ConfigurationError as error:
        raise ConfigurationError(str(error), where=Option("setting", setting)) from None


def _limit(name: str, given: str | float | None, declared: float, dimension: str) -> float:
    return declared if given is None else _positive(name, given, dimension)


def _positive(name: str, given: object, dimension: str = "") -> float:
    """Read a number above 0, of a dimension or plain."""
    if dimension:
        value = parse_quantity(str(given), dimension, option=Option(name))
    else:
        value = float(str(given))
    if not 0.0 < value < math.inf:
        raise ConfigurationError(
            "expected more than 0", where=Option(name, given), code="not-above-0"
        )
    return value
