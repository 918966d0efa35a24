"""The functions of what follows a fit; the commands of the same names print what they return."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from damperfit.arguments import configured, public, results_of, usage
from damperfit.errors import blamed_on
from damperfit.problem import Option
from damperfit.store import check_writable, path_of

if TYPE_CHECKING:
    from threading import Event

    from damperfit.after_fit.advise import Advice
    from damperfit.after_fit.ride import DrivenStroke, Ride
    from damperfit.after_fit.valves import Orifices
    from damperfit.after_fit.watch import Arrival
    from damperfit.results import Run
    from damperfit.settings_and_logs import SettingResult

_RESULTS = Path("results")


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
    max_heat: str | float | None = None,
    minutes: float | None = None,
    config: str | Path | None = None,
) -> Advice:
    """Say which further test narrows an interval most, or decides between structures.

    Parameters
    ----------
    results : Run or path
        With steady cycles among its logs.
    for_ : str
        A quantity such as k_e, the force at a speed, as in "force@0.05m/s" (minus: compression), or
        "law": after ``model="auto"``, in which test the structures that remain differ most.

    Returns
    -------
    Advice
        Candidates by rank, each with the share of today's interval that is left at each setting, or
        with its evidence against each structure.
    """
    given = dict(locals())
    from damperfit.after_fit import advise as module

    run = run_of(results, "damperfit.advise", config, takes_parts=False)
    asked = configured("advise", given)
    rig = run.own_configuration.rig if config is None else asked.rig
    given = {key: value for key, value in vars(asked.rig).items() if f"rig.{key}" in asked.declared}
    limits = module.with_limits(rig.but(**given), run)
    return module.advise(run, module.Question.of(for_ or "", run), limits, _settings(run, setting))


@public
def valves(  # noqa: PLR0913 - one keyword an option of the command line
    results: Run | str | Path = _RESULTS,
    *,
    cd: float = 0.7,
    cd_spread: float = 0.1,
    seat: str | float | None = None,
    reference: Run | str | Path | None = None,
    force: str | float | None = None,
    velocity: str | float | None = None,
    stroke: str | None = None,
    config: str | Path | None = None,
) -> Orifices:
    """Show the valves as parts: holes in mm, preloads in bar and N, and where a click jumps.

    Parameters
    ----------
    results, reference : Run or path
        Of any model with orifices or preloaded valves; the reference is an earlier run.
    force, velocity : number or text, optional
        What one orifice or preload must be for this force at this speed, as of `settings`.
    """
    given = dict(locals())
    from damperfit.after_fit.valves import read_valves, sized
    from damperfit.queries.settings import parse_question, positive

    if not 0.0 < cd <= 1.0:
        raise usage("expected more than 0, and 1 at most", "out-of-range", Option("cd", cd))
    if not 0.0 <= cd_spread < cd:
        text = f"expected 0 or more, and less than the coefficient, {cd:g}"
        raise usage(text, "cd-spread", Option("cd_spread", cd_spread))
    run = run_of(results, "damperfit.valves", config)
    for name, value in (("velocity", velocity), ("stroke", stroke)):
        if force is None and value is not None:
            raise usage("{where}: which force? Give {--force} too", "no-force", Option(name, value))
    earlier = _reference(reference, "damperfit.valves", run.damper.name)
    parts = read_valves(
        run, cd, cd_spread, seat=positive(seat, "length", "seat"), reference=earlier
    )
    asked = parse_question(**{name: given[name] for name in ("force", "velocity", "stroke")})
    if asked.force is None or asked.speed is None:
        return parts
    return sized(parts, run, asked.force, -asked.speed if asked.stroke == "bump" else asked.speed)


@public
def passport(
    results: Run | str | Path = _RESULTS,
    *,
    out: str | Path | None = None,
    units: str | None = None,
    config: str | Path | None = None,
) -> tuple[Path, Path]:
    """Write the passport of a damper: one A4 page, and a JSON that compare takes as a baseline.

    Returns
    -------
    tuple of pathlib.Path
        The page and the JSON.
    """
    from damperfit.after_fit.passport import write_passport
    from damperfit.reporting.records import units_in
    from damperfit.units.shown_units import parse_units

    run = run_of(results, "damperfit.passport", config, takes_parts=False)
    shown = units_in(run.record) if units is None else parse_units(units)
    return write_passport(run, Path(out or ""), shown)


@public
def ride(
    results: Run | str | Path = _RESULTS,
    *,
    car: str | Path | Mapping[str, Any] | None = None,
    stroke: str | Path | None = None,
    setting: str | None = None,
    plot: str | Path | None = None,
    config: str | Path | None = None,
) -> Ride | DrivenStroke:
    """Show comfort and wheel load of each setting on a road, or its work along a measured stroke.

    Parameters
    ----------
    car : path or mapping
        [car] in TOML, or its keys: masses, spring, tyre, motion ratio, road, speed.
    stroke : path
        Log of time and damper displacement from a car, in place of the road.
    plot : path, optional
        Where to draw its `picture`: wheel load against comfort, or the stroke's speeds below the
        force curves.
    """
    from damperfit.after_fit.ride import drive_along, read_car, read_stroke, ride_on_road
    from damperfit.reporting.drawing import FIXED_METADATA, draw_plot
    from damperfit.store import file_set

    run = run_of(results, "damperfit.ride", config)
    wanted = _settings(run, setting)
    if (car is None) == (stroke is None):
        raise usage("expected {--car} or {--stroke}, one of them", "car-or-stroke")
    if plot is not None and Path(plot).suffix[1:].lower() not in FIXED_METADATA:
        text = f"expected a name that ends in .{', .'.join(FIXED_METADATA)}"
        raise usage(text, "wrong-suffix", Option("plot", plot))
    if plot is not None:
        check_writable(Path(plot).parent)
    answer = (
        ride_on_road(run, read_car(car if isinstance(car, Mapping) else Path(car)), wanted)
        if car is not None
        else drive_along(run, read_stroke(Path(str(stroke))), wanted)
    )
    if plot is not None:
        with file_set(Path(plot).parent) as files:
            kind = Path(plot).suffix[1:].lower()
            draw_plot(files.path(Path(plot).name), answer.picture, kind=kind)
    return answer


@public
def watch(
    folder: str | Path,
    *,
    out: str | Path | None = None,
    reference: Run | str | Path | None = None,
    config: str | Path | None = None,
    stop: Event | None = None,
) -> Iterator[Arrival]:
    """Fit each log as soon as it is complete, and answer in one line; Ctrl-C ends it.

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

    Returns
    -------
    iterator of Arrival
        One a log.
    """
    from threading import Event

    from damperfit.after_fit.watch import watched
    from damperfit.configuration.loading import load_configuration

    place = path_of(folder, "damperfit.watch", "the path of a folder").resolve()
    own, results = (None if path is None else Path(path) for path in (config, out))
    earlier = _reference(reference, "damperfit.watch", load_configuration(own).damper.name)
    if not place.is_dir():
        raise usage("no such folder", "no-folder", subject=folder)
    if results is not None and place.is_relative_to(results.resolve()):
        other = f"give another folder, such as {Path(folder) / 'results'}"
        text = f"the results would stand among the logs; {other}"
        raise usage(text, "out-is-watched", Option("out", results))
    if results is not None:
        check_writable(results)
    return watched(place, results, earlier, own, stop or Event())


def run_of(
    results: object, call: str, config: str | Path | None = None, *, takes_parts: bool = True
) -> Run:
    """Return a run as it is given, or read from its folder; one setting at least is fitted."""
    from damperfit.queries.settings import refuse_unfitted
    from damperfit.results import Run
    from damperfit.tables.files import is_part

    own = None if config is None else Path(config)
    run = results if isinstance(results, Run) else Run.load(results_of(results, call), config=own)
    if not takes_parts and run.place is not None and is_part(run.place):
        text = (
            "is a part of a fleet, which keeps neither clicks nor the noise of its logs; identify "
        )
        text += "the logs of this damper, and give that folder"
        raise usage(text, "part-of-a-fleet", subject=run.place)
    return refuse_unfitted(run)


def _reference(given: object, call: str, model: str) -> Run | None:
    """Return the run that others are held against, of the same model."""
    run = None if given is None else run_of(given, call)
    if run is not None and run.damper.name != model:
        text = (
            f"is of the model {run.damper.name}, and this one of {model}: they cannot be compared"
        )
        raise usage(text, "other-model", Option("reference", run.name))
    return run


def _settings(run: Run, setting: str | None) -> tuple[SettingResult, ...]:
    with blamed_on(Option("setting", setting)):
        return run.settings if setting is None else (run.setting(setting),)
