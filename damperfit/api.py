"""The jobs of damperfit as functions; the commands call them and print what they return.

Every option of a command is a keyword of the function of the same name (`damperfit.arguments` says
what each is), with the same checks and the same sentences. A function writes nothing without
an `out`, but for `export` and `report`, whose job it is.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack, closing
from pathlib import Path
from typing import TYPE_CHECKING, Any

from damperfit.arguments import (
    configured,
    covaried,
    declared_setting,
    known_as_setting,
    public,
    reading_as,
    refuse_idle,
    results_of,
    starts_of,
    usage,
    workers,
)
from damperfit.errors import DamperfitError, LogError, blamed_on, did_you_mean
from damperfit.problem import Option, Words, note
from damperfit.store import check_writable, file_set, path_of, write_text
from damperfit.tested.setting import Setting

if TYPE_CHECKING:
    from damperfit.answers import Files, FirstConfiguration
    from damperfit.configuration.options import Configuration
    from damperfit.damper.model import Model
    from damperfit.fleets.done import FleetDone
    from damperfit.queries.compared import Comparison
    from damperfit.queries.settings import CurveForces, SettingForces
    from damperfit.queries.simulated import Simulation, Sweep
    from damperfit.recording import Recording
    from damperfit.reporting.inspection import Inspection
    from damperfit.results import Run
    from damperfit.run.auto_model import LawChoice
    from damperfit.run.identify import Identified, Watch

_FEW = 3
_AUTO = "auto"
_RESULTS = Path("results")


# Logs


@public
def read(
    log: object,
    *,
    units: Mapping[str, str] | None = None,
    rig: Mapping[str, Any] | Sequence[str] | None = None,
    config: str | Path | None = None,
) -> Recording:
    """Return one log as it was logged, in SI and with the project's signs.

    Parameters
    ----------
    log : path, or mapping of one label to a data frame
        Any format that `damperfit inspect` reads.

    Raises
    ------
    LogError
        It cannot be read, or holds several tests.
    """
    from damperfit.io import read_log
    from damperfit.run.log_files import as_files

    configuration = configured("read", {"units": units, "rig": rig, "config": config})
    with as_files(log, call="damperfit.read") as paths:
        if len(paths) > 1:
            raise usage("damperfit.read: found several logs; give one", "several-logs")
        return read_log(paths[0], configuration.reading)


@public
def inspect(  # noqa: PLR0913 - one keyword an option of the command line
    logs: object,
    *,
    setting: Setting | int | str | None = None,
    tests: str | Path | None = None,
    strict: bool = False,
    skew: str | float | None = None,
    rig_profile: str | None = None,
    rig: Mapping[str, Any] | Sequence[str] | None = None,
    allow_truncated: bool = False,
    jobs: int | None = None,
    config: str | Path | None = None,
    units: Mapping[str, str] | None = None,
) -> Inspection:
    """Show what is in logs and what is wrong with them; fit nothing."""
    given = dict(locals())
    from damperfit.reporting.inspection import Inspection
    from damperfit.run.log_files import as_files, expand
    from damperfit.run.logs import Purpose, read_batch

    # No model is asked for; the file may be one for `model="auto"`.
    configuration = configured("inspect", given, is_law_open=True)
    declared = declared_setting(setting, configuration)
    how: dict[str, Any] = {"jobs": workers(jobs), "setting": declared, "purpose": Purpose.INSPECT}
    with as_files(logs, call="damperfit.inspect") as paths:
        return Inspection(read_batch(expand(paths), configuration, **how))


# Fits


@public
def identify(  # noqa: PLR0913 - one keyword an option of the command line
    logs: object,
    *,
    free: Sequence[str] | str | None = None,
    fix: Mapping[str, Any] | None = None,
    model: str | None = None,
    rivals: bool = False,
    procedure: str | None = None,
    share: Sequence[str] | str | None = None,
    untie: Sequence[str] | str | None = None,
    hold_out: Sequence[str] | str | None = None,
    hold_out_cycles: float | None = None,
    covariate: str | None = None,
    bulk_modulus: str | None = None,
    starts: int | None = None,
    start: Mapping[str, Any] | str | Path | None = None,
    profile: Sequence[str] | str | None = None,
    max_mse: float | None = None,
    check: Sequence[str] | str | None = None,
    setting: Setting | int | str | None = None,
    tests: str | Path | None = None,
    strict: bool = False,
    skew: str | float | None = None,
    rig_profile: str | None = None,
    rig: Mapping[str, Any] | None = None,
    allow_truncated: bool = False,
    out: str | Path | None = None,
    report: bool = False,
    figures: str | None = None,
    velocity: Sequence[str] | str | None = None,
    units: Mapping[str, str] | str | None = None,
    jobs: int | None = None,
    config: str | Path | None = None,
    damper: Model | Mapping[str, Any] | None = None,
    watch: Watch | None = None,
) -> Run:
    """Fit every setting in the logs of one damper.

    Parameters
    ----------
    logs : path, pattern, trace, recording, list of such, or mapping of labels to data frames
        A label is the setting, as in ``{"10": frame}`` or ``{"R12 C8": frame}``; a frame, or a
        mapping of arrays, has time, displacement and force, with units in its names
        (``displacement_mm``) or in `units`.
    fix, start, rig : mapping
        As in ``{"f_f": "50N"}``; keys of [rig]. `start` may be a path too.
    units : mapping, or str
        Units of columns that do not say theirs, as in ``{"force": "kN"}``; as text those that
        results are shown in.
    out : path, optional
        Folder for the results; by default nothing is written, see `Run.save`.

    Returns
    -------
    Run
        It has the settings that could be fitted; `Run.failures` has the others.

    Raises
    ------
    ConfigurationError
        A keyword is wrong, or the logs are of several dampers.
    LogError
        No log could be fitted.
    """
    given = dict(locals())
    if out is None and (report or figures):
        raise usage("a report is written; give {--out FOLDER}", "no-folder")
    (ended,) = identify_each(**given, is_one=True, is_written=out is not None)
    if ended.error is not None:
        raise ended.error
    if not ended.run.settings:
        words = Words("damperfit.identify")
        lines = [failure.placed.sentence(words) for failure in ended.failures]
        more = f" (and {len(lines) - _FEW} more)" if len(lines) > _FEW else ""
        text = f"no setting could be fitted: {'; '.join(lines[:_FEW])}{more}"
        error = LogError(text, code="no-setting-fitted")
        error.failures = tuple(ended.failures)
        raise error
    return ended.run


@reading_as("identify")
def identify_each(
    logs: Any,
    *,
    is_one: bool = False,
    is_written: bool = True,
    watch: Watch | None = None,
    **given: Any,
) -> list[Identified]:
    """Fit every setting in the logs of one damper or several, each into a folder of its own.

    Keywords are as of `identify`; without ``out`` results go where the configuration says.
    `is_one`: logs of several dampers are refused; `is_written`: anything is written.
    """
    from damperfit.run.identify import Watch, identified, written
    from damperfit.run.log_files import as_files, in_memory

    started, watch = time.perf_counter(), watch or Watch()
    configuration = _identification(given)
    jobs = workers(given.get("jobs"))
    declared = declared_setting(given.get("setting"), configuration)
    unread, traces = in_memory(logs, configuration.conditioning)
    with ExitStack() as stack:
        paths: Sequence[str] = []
        if not traces or unread:
            paths = stack.enter_context(as_files(unread, call="damperfit.identify"))
        if given.get("model") == _AUTO:
            from damperfit.run.auto_model import with_chosen_law

            on_law = watch.on_law
            choice = _chosen(configuration, paths, given, on_law, jobs=jobs, setting=declared)
            made = with_chosen_law(configuration, choice)
            watch.on_choice(choice, configuration, made)
            configuration = made
        stack.enter_context(watch.during_work())
        how: dict[str, Any] = {"jobs": jobs, "setting": declared, "traces": traces, "watch": watch}
        work = written if is_written else identified
        done = list(work(configuration, paths, is_one=is_one, started=started, **how))
    page, figures = given.get("report", False), given.get("figures")
    for damper in done:
        if damper.run.settings and (page or figures) and damper.is_written:
            try:
                _write_report(damper.folder, damper.folder, page=page, figures=figures)
            except DamperfitError as error:
                damper.error = error
    return done


def _identification(given: Mapping[str, Any]) -> Configuration:
    """The configuration that `identify` is asked for, once nothing is asked in vain."""
    if given.get("max_mse") == 0.0:
        text = (
            "expected more than 0, as every fit leaves some misfit; for no gate leave the option "
            "out (output.max_mse_percent = 0)"
        )
        raise usage(text, "out-of-range", Option("max_mse", "0"))
    if given.get("free") == []:
        text = "no parameter is named; leave it out, or hold what must not be fitted with {--fix}"
        raise usage(text, "nothing-named", Option("free"))
    is_open = given.get("model") == _AUTO
    start_file, start_values = starts_of(given.get("start"))
    configuration = configured(
        "identify",
        {**given, "model": None if is_open else given.get("model")},
        ("covariate", "damper.reference_temperature", covaried("identify", given)),
        ("start", "identification.start", start_file),
        ("start", "identification.start_values", None if is_open else start_values or None),
        is_law_open=is_open,
    )
    fit = configuration.identification
    for name in fit.untied:
        untie = Option("untie", name)
        if name in fit.fixed:
            text = f"{{where}} has no effect: {name} is held by {{fix}}; leave one of the two out"
            raise usage(text, "no-effect", untie, fix=Option("fix", fit.fixed[name], name))
        if is_open:  # the law that the logs choose may have what the declared model has not
            continue
        with blamed_on(Option("untie")):
            quantity = configuration.damper.quantity(name)
        if quantity.default is not None and name not in (fit.free or ()):
            text = f"{{where}} has no effect: {name} is held at {quantity.default:g}; free it"
            raise usage(f"{text} too: {{--free}}", "no-effect", untie)
    alone = [key for key in ("share", "untie") if given.get(key) is not None]
    if alone and fit.procedure != "joint" and not (is_open and alone == ["untie"]):
        text = (
            "{where} has no effect: only procedure joint fits shared parameters, found procedure "
            f"{fit.procedure}; add {{--procedure joint}}"
        )
        raise usage(text, "no-effect", Option(alone[0], ",".join(given[alone[0]])))
    if is_open and fit.free:
        text = (
            "{--free} has no effect: with {--model auto} the logs choose what is fitted; hold a "
            "parameter with {--fix}, or name the model"
        )
        raise usage(text, "no-effect")
    if given.get("rivals") and not is_open:
        text = (
            "models are ranked where the logs choose one; add {--model auto}, or ask damperfit "
            "models LOGS {--rivals}"
        )
        raise usage(text, "not-together", Option("rivals"))
    return configuration


def _chosen(
    configuration: Configuration,
    paths: Sequence[str],
    given: Mapping[str, Any],
    on_law: Callable[[str], None],
    **how: Any,
) -> LawChoice:
    """The law that the logs support, as `models` and `identify` ask for it."""
    from damperfit.run.auto_model import choose_law
    from damperfit.run.given_starts import start_of_laws

    return choose_law(
        configuration,
        paths,
        start=start_of_laws(configuration, starts_of(given.get("start"))[1]),
        on_law=lambda law: on_law(law.candidate.title),
        on_rival=(lambda law: on_law(law.title)) if given.get("rivals") else None,
        **how,
    )


@public
def models(  # noqa: PLR0913 - one keyword an option of the command line
    logs: object,
    *,
    hold_out: Sequence[str] | str | None = None,
    layout: str | None = None,
    rivals: bool = False,
    start: Mapping[str, Any] | str | Path | None = None,
    setting: Setting | int | str | None = None,
    rig_profile: str | None = None,
    rig: Mapping[str, Any] | None = None,
    jobs: int | None = None,
    config: str | Path | None = None,
    damper: Model | Mapping[str, Any] | None = None,
    on_law: Callable[[str], None] = lambda _: None,
) -> LawChoice:
    """Fit one model structure after the other to the logs and say which one they support.

    Returns
    -------
    LawChoice
        `LawChoice.supported` names the law; `identify(model="auto")` fits it.
    """
    given = dict(locals())
    from damperfit.laws.structures import LAYOUTS
    from damperfit.run.log_files import as_files

    if layout is not None and layout not in LAYOUTS:
        text = f"no layout {layout!r}; there are {', '.join(LAYOUTS)}."
        text += did_you_mean(layout, LAYOUTS)
        raise usage(text, "unknown-layout", Option("layout"))
    file = ("start", "identification.start", starts_of(start)[0])
    configuration = configured("models", given, file, is_law_open=True)
    how: dict[str, Any] = {"layout": layout, "jobs": workers(jobs)}
    how["setting"] = declared_setting(setting, configuration)
    with as_files(logs, call="damperfit.models") as paths:
        return _chosen(configuration, paths, given, on_law, **how)


@public
def fleet(  # noqa: PLR0913 - one keyword an option of the command line
    logs: object = None,
    *,
    out: str | Path = Path("fleet"),
    jobs: int | None = None,
    scheduler: str | None = None,
    part: str | None = None,
    collect: bool = False,
    report: bool = False,
    tolerance: str | Path | None = None,
    model: str | None = None,
    procedure: str | None = None,
    covariate: str | None = None,
    tests: str | Path | None = None,
    strict: bool = False,
    rig_profile: str | None = None,
    rig: Mapping[str, Any] | None = None,
    config: str | Path | None = None,
    watch: Watch | None = None,
) -> FleetDone:
    """Fit many dampers, one part each; finished ones are not fitted again.

    Parameters
    ----------
    logs : path, list of such, optional
        Folders, files, patterns, or addresses; without it only the parts that are there are read.
    """
    given = dict(locals())
    from damperfit.comparison.tolerance import parse_bands
    from damperfit.fleets.done import FleetDone
    from damperfit.fleets.run import planned, run_fleet, share_of
    from damperfit.run.identify import Watch
    from damperfit.run.log_files import as_files
    from damperfit.workers import Cluster, Processes

    watch = watch or Watch()
    folder: Any = out
    has_logs = logs is not None and logs != []
    asked = [name for name in ("collect", "report", "tolerance") if given[name]]
    if not has_logs and not asked:
        text = "fleet: expected LOGS, or {--collect} or {--report} for the parts that are there"
        raise usage(text, "nothing-to-do")
    if scheduler is not None and jobs is not None:
        text = (
            "{--jobs} cannot be combined with {--scheduler}: the cluster has its own workers; "
            "leave one out"
        )
        raise usage(text, "not-together")
    if part is not None and asked:
        text = (
            "{where} cannot be combined with {--part}: other parts may not be done yet; collect "
            f"with damperfit fleet --out {out} --{asked[0]} when all are"
        )
        raise usage(text, "not-together", Option(asked[0]))
    bands = parse_bands(given["tolerance"])
    configuration = configured(
        "fleet",
        {**given, "tests": given["tests"] and given["tests"].resolve()},
        ("covariate", "damper.reference_temperature", covaried("fleet", given, of_fleet=True)),
    )
    takes = (lambda _: True) if part is None else share_of(part)
    done = FleetDone(folder, has_logs=has_logs)
    if has_logs:
        check_writable(folder)
        with ExitStack() as stack:
            paths = stack.enter_context(as_files(logs, call="damperfit.fleet"))
            tasks = planned(configuration, paths, folder, takes)
            done.n_tasks = len(tasks)
            if scheduler is None:
                engine: Any = Processes(min(workers(jobs), max(1, len(tasks))))
            else:
                engine = stack.enter_context(closing(Cluster(scheduler)))
            stack.enter_context(watch.during_work())
            watch.on_start(done.n_tasks)
            how: dict[str, Any] = {"cancelled": watch.cancelled}
            for damper in run_fleet(configuration, tasks, folder.resolve(), engine, **how):
                done.done.append(damper)
                watch.on_fit(damper)
            done.is_stopped = watch.cancelled()
    if asked and not done.is_stopped:
        try:
            done.collect(bands, is_reported=report)
        except DamperfitError as error:
            error.done = done  # type: ignore[attr-defined] # it is printed first
            raise
    return done


# What is asked of results


@public
def load(folder: str | Path) -> Run:
    """Return the run in a folder, as `damperfit identify` wrote it.

    Raises
    ------
    ConfigurationError
        There is no such folder, or no results in it.
    """
    from damperfit.results import Run
    from damperfit.tables.files import is_part

    place = path_of(folder, "damperfit.load", "the path of a results folder")
    if is_part(place):
        text = (
            f"damperfit.load: {place} is a part of a fleet, which keeps no more than a table; "
            "expected a folder that damperfit identify wrote; pandas reads parts"
        )
        raise usage(text, "part-of-a-fleet")
    return Run.load(place, parts=("parameters", "mse"))


@public
def simulate(  # noqa: PLR0913 - one keyword an option of the command line
    setting: Setting | Run | int | str | None = None,
    *,
    parameters: Run | str | Path | None = None,
    set: Mapping[str, Any] | None = None,  # noqa: A002 - the option's name
    amplitude: float | str | None = None,
    frequency: float | str | None = None,
    cycles: float | None = None,
    sample_rate: float | str | None = None,
    wave: str | None = None,
    max_steps: int | None = None,
    temperature: str | float | None = None,
    displacement: str | Path | None = None,
    out: str | Path | None = None,
    plot: str | Path | None = None,
    overwrite: bool = False,
    config: str | Path | None = None,
    damper: Model | Mapping[str, Any] | None = None,
) -> Simulation:
    """Simulate one setting."""
    given = dict(locals())
    from damperfit.damper.temperature_law import WithTemperature
    from damperfit.queries.simulated import Simulation
    from damperfit.results import with_temperature

    if displacement is not None:
        names = ("amplitude", "frequency", "cycles", "sample_rate", "wave", "max_steps")
        refuse_idle(given, names, "the log is the motion", beside=Option("displacement"))
    own = configured("simulate", given)
    for name, suffixes in (("out", (".csv", ".parquet")), ("plot", (".png", ".svg", ".pdf"))):
        if (path := given[name]) is not None:
            if path.suffix.lower() not in suffixes:
                text = f"expected a name that ends in {', '.join(suffixes)}"
                raise usage(text, "wrong-suffix", Option(name, path))
            check_writable(path.parent)
    choice, configuration, sentence = _parameters("simulate", given, own)
    configuration = with_temperature(configuration, given["temperature"])
    if temperature is not None and isinstance(configuration.damper, WithTemperature):
        sentence += f" Simulated at {configuration.damper.oil_temperature:g} degC."
    log = given["displacement"]
    if log is not None and not log.exists():
        raise usage("no such file", "no-such-file", Option("displacement", log))
    done = Simulation(choice, configuration, log, sentence)
    done.write(given["out"], given["plot"], spares_others=not overwrite)
    return done


def _parameters(
    command: str, given: Mapping[str, Any], configuration: Configuration
) -> tuple[Any, Configuration, str]:
    """What to simulate with: the parameters, the damper that they belong to, and a line on it."""
    from damperfit.queries.simulations import choose_parameters, damper_of
    from damperfit.results import Run

    call = f"damperfit.{command}"
    if isinstance(given["setting"], Run):
        text = (
            f"{call}: found a result in place of a setting; give {call}(10, parameters=result), or "
            "result.setting(10).simulate()"
        )
        raise usage(text, "not-a-setting")
    choice = choose_parameters(
        known_as_setting(given["setting"]),
        table=given["parameters"],
        replaced=given["set"] or {},
        folder=configuration.output.folder,
        damper=configuration.damper,
    )
    return (choice, *damper_of(choice, configuration, config=given["config"]))


@public
def sweep(  # noqa: PLR0913 - one keyword an option of the command line
    setting: Setting | int | str | None = None,
    *,
    vary: Mapping[str, Sequence[float]] | Sequence[str] | str | None = None,
    paper: bool = False,
    parameters: Run | str | Path | None = None,
    set: Mapping[str, Any] | None = None,  # noqa: A002 - the option's name
    max_steps: int | None = None,
    figures: str = "png",
    out: str | Path | None = None,
    overwrite: bool = False,
    config: str | Path | None = None,
) -> Sweep:
    """Scale one parameter by factors and show what it does to the force.

    Parameters
    ----------
    vary : mapping of str to sequence of float, or text
        As in ``{"r_m1": [0.8, 1, 1.2]}`` or "r_m1=0.8,1,1.2".
    out : path, optional
        Folder for the table and the figures; without it none is written.
    """
    given = dict(locals())
    from damperfit.queries.simulated import Sweep
    from damperfit.queries.simulations import PAPER_SWEEPS, parse_variation

    texts: Any = [vary] if isinstance(vary, str) else vary or []
    if isinstance(texts, dict):
        texts = [f"{name}={','.join(map(str, factors))}" for name, factors in texts.items()]
    if not texts and not paper:
        text = "nothing to vary: give {--vary} NAME=F1,F2,... or {--paper}"
        raise usage(text, "nothing-to-do")
    check_writable(given["out"])
    own = configured("sweep", {"config": config, "max_steps": max_steps})
    given["setting"] = "10" if paper and setting is None else setting
    choice, configuration, sentence = _parameters("sweep", given, own)
    variations = [parse_variation(text, configuration.damper) for text in texts]
    if len({variation.name for variation in variations}) < len(variations):
        text = "a name is given twice; put its factors into one list"
        raise usage(text, "given-twice", Option("vary"))
    if paper and configuration.damper.name != "purdy":
        text = (
            f"the figures are of the paper's model; these parameters are of "
            f"{configuration.damper.name!r}: give {{--vary}} NAME=F1,F2,..."
        )
        raise usage(text, "other-model", Option("paper"))
    both = [(v, False) for v in variations] + [(v, True) for v in PAPER_SWEEPS if paper]
    done = Sweep(choice, configuration, sentence, both)
    if out is not None:
        done.write(given["out"], kind=figures, spares_others=not overwrite)
    return done


@public
def settings(  # noqa: PLR0913 - one keyword an option of the command line
    results: Run | str | Path | Sequence[str | Path] = _RESULTS,
    *,
    force: str | float | None = None,
    velocity: str | float | None = None,
    stroke: str | None = None,
    without_gas: bool = False,
    amplitude: str | float | None = None,
    frequency: str | float | None = None,
    temperature: str | float | None = None,
    rig: Mapping[str, Any] | None = None,
    rig_profile: str | None = None,
    units: str | None = None,
    config: str | Path | None = None,
) -> SettingForces | CurveForces:
    """Show force by setting and what a click changes; find the setting for a force."""
    given = dict(locals())
    from damperfit.queries.settings import parse_question, tabulate_forces
    from damperfit.results import Run
    from damperfit.units.shown_units import SI, parse_units

    shown = SI if units is None else parse_units(units)
    question = parse_question(**{name: given[name] for name in ("force", "velocity", "stroke")})
    asked = results if isinstance(results, list | tuple) else [results]
    places = [results_of(place, "damperfit.settings") for place in asked] or [_RESULTS]
    paths = [place for place in places if isinstance(place, Path) and place.is_file()]
    if len(paths) == len(places):
        from damperfit.queries.settings import measured_forces

        idle = ("amplitude", "frequency", "temperature", "units", "without_gas")
        given |= {"without_gas": without_gas or None}
        refuse_idle(given, idle, f"the forces of {paths[0]} were measured, not simulated")
        reading = {name: given[name] for name in ("rig", "rig_profile", "config")}
        options = configured("settings", reading, is_law_open=True).reading
        return measured_forces(paths, question, reading=options)
    named = [place if isinstance(place, Path) else place.shown_as for place in places]
    if len(places) > 1:
        listed = ", ".join(map(str, named[:3]))
        text = f"found {listed}; expected one results folder, or files of measured curves alone"
        raise usage(text, "several-results")
    refuse_idle(given, ("rig", "rig_profile"), f"{named[0]} holds results, and no log is read")
    how = {name: given[name] for name in ("config", "temperature")}
    run = Run.load(places[0], parts=("parameters",), **how)
    motion = {name: given[name] for name in ("amplitude", "frequency")}
    return tabulate_forces(run, question, **motion, without_gas=without_gas, units=shown)


@public
def compare(  # noqa: PLR0913 - one keyword an option of the command line
    *runs: Run | str | Path,
    repeats: Sequence[str | Path] | None = None,
    tolerance: str | Path | None = None,
    measured: bool = False,
    velocity: Sequence[str | float] | str | float | None = None,
    amplitude: str | float | None = None,
    frequency: str | float | None = None,
    out: str | Path | None = None,
    save: str | Path | None = None,
    junit: str | Path | None = None,
    units: str | None = None,
    rig_profile: str | None = None,
    rig: Mapping[str, Any] | None = None,
    jobs: int | None = None,
    config: str | Path | None = None,
) -> Comparison:
    """Show what differs between results, and whether it is more than chance."""
    given = dict(locals())
    from damperfit.comparison.tolerance import parse_bands
    from damperfit.queries.compared import compare_all, comparison_options
    from damperfit.results import Run

    places: list[Path] = []
    unsaved: dict[Path, Run] = {}  # by what they are called
    for k, run in enumerate(runs, 1):
        place = results_of(run, "damperfit.compare")
        if isinstance(place, Run):
            same = (path for path, earlier in unsaved.items() if earlier is place)
            path = next(same, Path(f"result {k}"))
            unsaved[path], place = place, path
        places.append(place)
    is_alone = len(runs) == 1 and not (tolerance or save)
    if not places or (is_alone and isinstance(runs[0], Run)):
        number = "one result" if places else "no result"
        text = (
            f"damperfit.compare: found {number}; expected two or more, or tolerance=FILE with "
            "nominal forces"
        )
        raise usage(text, "too-few-results")
    files = [given[name].parent for name in ("save", "junit") if given[name] is not None]
    for place in (given["out"], *files):
        check_writable(place)
    reading = None
    if measured:
        asked = {name: given[name] for name in ("rig", "rig_profile", "config")}
        reading = configured("compare", asked, is_law_open=True)
    else:
        refuse_idle(given, ("rig", "rig_profile"), "no log is read without {--measured}")
    bands = parse_bands(given["tolerance"])
    if junit is not None and bands is None:
        text = "holds the points of {--tolerance}, which was not given"
        raise usage(text, "nothing-to-do", Option("junit"))
    options = comparison_options(given | {"jobs": workers(jobs)})
    how: dict[str, Any] = {name: given[name] for name in ("config", "save")}
    how["repeats"] = given["repeats"] or ()
    done = compare_all(places, options, tolerance=bands, reading=reading, unsaved=unsaved, **how)
    done.write(given["out"], given["junit"])
    return done


# What is written


def _own_folder(results: Path | Run, call: str) -> Path:
    """Return the folder of results; those that are in none of the user's need `out`."""
    if not isinstance(results, Path):
        text = f"{call}: these results are in no folder of yours; give out=FOLDER"
        raise usage(text, "no-folder")
    return results


@public
def export(  # noqa: PLR0913 - one keyword an option of the command line
    results: Run | str | Path = _RESULTS,
    to: str | None = None,
    out: str | Path | None = None,
    *,
    extend: float | str | None = None,
    units: str | None = None,
    decimal: str = ".",
    temperature: str | float | None = None,
    check: bool = False,
    overwrite: bool = False,
    config: str | Path | None = None,
) -> Files:
    """Hand a damper over to another program.

    Returns
    -------
    Files
        A tuple of the paths that were written, with `Files.remarks` and `Files.notes`.
    """
    given = dict(locals())
    from damperfit.answers import Files
    from damperfit.exporting.check import check_export
    from damperfit.exporting.targets import TARGETS, ExportOptions, exported_run, find_target
    from damperfit.tables.files import is_part, written_of
    from damperfit.units.quantities import parse_quantity
    from damperfit.units.shown_units import SI, parse_units

    if to is None:
        text = (
            f"export: no target: give {{--to}}, one of {', '.join(TARGETS)}; damperfit export "
            "--list shows what they are"
        )
        raise usage(text, "no-target")
    target = find_target(str(to))
    for option, value, default in (("units", units, None), ("decimal", decimal, ".")):
        if value != default and option not in target.takes:
            text = f"{target.name} has units and marks of its own ({target.units}); leave it out"
            raise usage(text, "no-effect", Option(option, value))
    shown = SI if units is None else parse_units(units)
    speed = None if extend is None else parse_quantity(extend, "velocity", option=Option("extend"))
    place = results_of(results, "damperfit.export")
    if out is not None:
        where, stem = target.place_of(given["out"])
    else:
        folder = _own_folder(place, "damperfit.export")
        where, stem = written_of(folder, "export"), "damper"
        where = where if is_part(folder) else where / "export"
    check_writable(where)
    run = exported_run(place, **{name: given[name] for name in ("config", "temperature")})
    made = target.export(run, ExportOptions(stem, speed, shown, decimal))
    checked = check_export(run, made) if check else ()
    with file_set(where, spares_others=not overwrite) as drafts:
        for name, content in made.files.items():
            drafts.path(name).write_bytes(content)
    paths, remarks = [where / name for name in made.files], run.run.remarks
    return Files(paths, remarks=remarks, notes=made.notes, made=made, checked=tuple(checked))


@public
def report(
    results: Run | str | Path,
    *,
    figures: str | None = None,
    out: str | Path | None = None,
    units: str | None = None,
    config: str | Path | None = None,
) -> Files:
    """Write report.html, one page that opens anywhere, from results."""
    configured("report", {"config": config})
    from damperfit.tables.files import written_of

    where: Any = out
    check_writable(where)
    place = results_of(results, "damperfit.report")
    where = where or written_of(_own_folder(place, "damperfit.report"), "reports")
    return _write_report(place, where, page=True, figures=figures, units=units)


def _write_report(
    results: Path | Run, folder: Path, *, page: bool, figures: str | None, units: str | None = None
) -> Files:
    """Write the page and the figures of a run, or of a results folder."""
    from damperfit.answers import Files
    from damperfit.reporting.figures import report_plots
    from damperfit.reporting.page import html_report
    from damperfit.results import Run
    from damperfit.units.shown_units import parse_units

    run = Run.load(results)
    shown = report_plots(run, None if units is None else parse_units(units))
    written: list[Path] = []
    if page:
        text = html_report(shown, title=run.name)
        with file_set(folder) as files:
            files.path("report.html").write_bytes(text.encode("utf-8", "backslashreplace"))
        written.append(folder / "report.html")
    if figures is not None:
        from damperfit.reporting.drawing import draw_plot

        with file_set(folder / "figures") as files:
            for plot in shown.plots:
                draw_plot(files.path(f"{plot.name}.{figures}"), plot, kind=figures)
        written += [folder / "figures" / f"{plot.name}.{figures}" for plot in shown.plots]
    return Files(written, remarks=run.remarks)


@public
def samples(  # noqa: PLR0913 - one keyword an option of the command line
    folder: str | Path,
    *,
    settings: str | Sequence[int] = "1-20",
    parameters: str | Path | None = None,
    cycles: float = 15.0,
    sample_rate: str | float = "500Hz",
    force_noise: str | float = "4N",
    displacement_noise: str | float = "8um",
    rig_filter: str | float = "0Hz",
    seed: int = 2000,
    model: str | None = None,
    config: str | Path | None = None,
    watch: Watch | None = None,
) -> Files:
    """Write synthetic rig logs with known parameters."""
    given = dict(locals())
    from damperfit.answers import Files
    from damperfit.queries.simulations import numbers_in, truth_of
    from damperfit.run.identify import Watch
    from damperfit.synthetic import SampleOptions, make_samples
    from damperfit.units.quantities import parse_quantity

    where = path_of(folder, "damperfit.samples", "the path of a folder")
    check_writable(where)
    loaded = configured("samples", {"config": config, "model": model})
    truth, sentence = None, loaded.damper_sentence()
    if parameters is not None:
        truth, loaded, sentence = truth_of(given["parameters"], loaded, given["config"])
    quantities = {
        name: parse_quantity(given[name], dimension, option=Option(name))
        for name, dimension in (
            ("sample_rate", "frequency"),
            ("force_noise", "force"),
            ("displacement_noise", "length"),
            ("rig_filter", "frequency"),
        )
    }
    options = SampleOptions(
        settings=numbers_in(settings),
        cycles=cycles,
        amplitude=loaded.rig.amplitude,
        frequency=loaded.rig.frequency,
        seed=seed,
        damper=loaded.damper,
        **quantities,
    )
    watch = watch or Watch()
    with watch.during_work():
        watch.on_start(len(options.settings))
        logs = make_samples(where, options, parameters=truth, on_log=watch.on_fit)
    return Files(
        (*logs, where / "truth.csv", where / "README.md"), notes=(note("damper", sentence),)
    )


@public
def init(
    logs: object = None,
    *,
    model: str | None = None,
    set: Mapping[str, Any] | None = None,  # noqa: A002 - the option's name
    out: str | Path | None = None,
    overwrite: bool = False,
) -> FirstConfiguration:
    """Make a commented configuration for a damper of your own, with what its logs show.

    Parameters
    ----------
    out : path, optional
        The file to write; by default nothing is written.
    """
    from damperfit.answers import FirstConfiguration
    from damperfit.queries.first_configuration import (
        Guessed,
        check_damper,
        first_configuration,
        guess_from_logs,
    )
    from damperfit.run.log_files import as_files, expand

    path: Any = out
    check_writable(None if path is None else path.parent)
    if path is not None and path.exists() and not overwrite:
        text = "is there already; give {--overwrite} to replace it, or {--out}"
        raise usage(text, "is-there", str(path))
    keys: dict[str, str] = dict(set or {})
    kind, guessed = model or "purdy", Guessed({}, {})
    check_damper(kind, keys)
    if logs is not None and logs != []:
        with as_files(logs, call="damperfit.init") as paths:
            guessed = guess_from_logs(expand(paths), kind, keys)
    if model is None:
        guessed = guessed.without_model
    text = first_configuration(model, keys, guessed)
    if path is not None:
        write_text(path, text)
    return FirstConfiguration(text, guessed.why, guessed.open)
