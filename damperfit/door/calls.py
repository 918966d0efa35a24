"""The jobs of the command line, as calls: same words, same checks, same sentences."""

from __future__ import annotations

from collections.abc import Iterable
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from tempfile import mkdtemp
from typing import TYPE_CHECKING, Any

from damperfit.door.asked import (
    configured,
    declared_setting,
    known_as_setting,
    names_given,
    refuse_idle_share,
    texts,
    workers,
)
from damperfit.door.given_logs import as_files, in_memory
from damperfit.door.simulations import Simulation, simulated
from damperfit.door.wrong_calls import (
    answers_wrong_calls,
    in_words_of_a_call,
    path_of,
    refuse_part,
)
from damperfit.errors import ConfigurationError, LogError
from damperfit.results import Run

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from damperfit.damper.model import Model
    from damperfit.door.tables import Comparison, Inspection
    from damperfit.recording import Recording
    from damperfit.tested.setting import Setting

__all__ = ["compare", "export", "identify", "inspect", "load", "read", "simulate"]

_FEW = 3


@answers_wrong_calls("damperfit.read")
def read(log: object, *, units: Mapping[str, str] | None = None, **asked: Any) -> Recording:
    """Return one log as it was logged, in SI and with the project's signs.

    Parameters
    ----------
    log : path, or mapping of one label to a data frame
        Any format that `damperfit inspect` reads.
    units : mapping of str to str, optional
        Units of columns that do not say theirs, as in ``{"force": "kN"}``.
    **asked
        config, rig: as of `identify`.

    Raises
    ------
    LogError
        It cannot be read, or holds several tests.
    """
    from damperfit.io import read_log

    configuration = configured("damperfit.read", units=units, **asked)
    with as_files(log, call="damperfit.read") as paths:
        if len(paths) > 1:
            raise ConfigurationError("damperfit.read: found several logs; give one")
        return read_log(paths[0], configuration.reading)


@answers_wrong_calls("damperfit.inspect")
def inspect(
    logs: object,
    *,
    setting: Setting | int | str | None = None,
    units: Mapping[str, str] | None = None,
    jobs: int | None = None,
    **asked: Any,
) -> Inspection:
    """Show what is in logs and what is wrong with them; fit nothing.

    Parameters
    ----------
    logs, setting, units, jobs
        As of `identify`.
    **asked
        config, rig: as of `identify`.
    """
    from damperfit.door.tables import Inspection
    from damperfit.run.log_paths import expand
    from damperfit.run.logs import Purpose, read_batch
    from damperfit.workers import available_cores

    configuration = configured("damperfit.inspect", units=units, **asked)
    with as_files(logs, call="damperfit.inspect") as paths:
        batch = read_batch(
            expand(paths),
            configuration,
            jobs=workers(jobs, "damperfit.inspect") or available_cores(),
            setting=declared_setting(setting, configuration),
            purpose=Purpose.INSPECT,
        )
    return Inspection(batch)


@answers_wrong_calls("damperfit.identify")
def identify(  # noqa: PLR0913 - one keyword an option of the command line
    logs: object,
    *,
    damper: Model | Mapping[str, Any] | None = None,
    model: str | None = None,
    setting: Setting | int | str | None = None,
    free: Sequence[str] | None = None,
    fix: Mapping[str, Any] | None = None,
    procedure: str | None = None,
    share: Sequence[str] | None = None,
    hold_out: Sequence[str] | None = None,
    starts: int | None = None,
    profile: Sequence[str] | None = None,
    units: Mapping[str, str] | None = None,
    rig: Mapping[str, Any] | None = None,
    tests: str | Path | None = None,
    config: str | Path | None = None,
    out: str | Path | None = None,
    jobs: int | None = None,
    **unknown: Any,
) -> Run:
    """Fit every setting in the logs of one damper.

    Parameters
    ----------
    logs : path, pattern, trace, recording, list of such, or mapping of labels to data frames
        A label is the setting, as in ``{"10": frame}`` or ``{"R12 C8": frame}``; a frame, or a
        mapping of arrays, has time, displacement and force, with units in its names
        (``displacement_mm``) or in `units`.
    damper : Model or mapping, optional
        The damper, or keys of [damper]; the paper's where neither it nor `config` says it.
    model : str, optional
        Of `damperfit models`.
    setting : optional
        Setting of logs that do not say theirs.
    free, fix, procedure, share, hold_out, starts, profile, tests, jobs
        As the options of `damperfit identify`; ``fix={"f_f": "50N"}``.
    units, rig : mapping, optional
        Of the rig: keys of [rig.units] and [rig].
    config : path, optional
        TOML file.
    out : path, optional
        Folder for the results; by default they go when the result does.

    Returns
    -------
    Run
        It has the settings that could be fitted; `Run.failures` tells of the others.

    Raises
    ------
    ConfigurationError
        A keyword is wrong, or the logs are of several dampers.
    LogError
        No log could be fitted.
    """
    from damperfit.run.pipeline import run

    configuration = configured(
        "damperfit.identify",
        config=config,
        damper=damper,
        rig=rig,
        units=units,
        model=("damper.model", model),
        free=("identification.free", names_given(free, "free")),
        fix=("identification.fix", texts(fix, "damperfit.identify", "fix")),
        procedure=("identification.procedure", procedure),
        share=("identification.share", names_given(share, "share")),
        hold_out=("identification.hold_out", names_given(hold_out, "hold_out")),
        starts=("identification.starts", starts),
        profile=("identification.profile", names_given(profile, "profile")),
        tests=("test.table", tests if tests is None else str(_table_of_tests(tests))),
        **unknown,
    )
    if share is not None:
        refuse_idle_share(configuration, "damperfit.identify")
    cores = workers(jobs, "damperfit.identify")
    folder = (
        Path(mkdtemp(prefix="damperfit-result-"))
        if out is None
        else path_of(out, "damperfit.identify(out=...)", "the path of a folder")
    )
    configuration = replace(configuration, output=replace(configuration.output, folder=folder))
    declared = declared_setting(setting, configuration)
    unread, traces = in_memory(logs, configuration.conditioning)
    with ExitStack() as stack:
        is_ready = bool(traces) and not unread
        paths = [] if is_ready else stack.enter_context(as_files(unread, call="damperfit.identify"))
        found = run(configuration, paths, jobs=cores, setting=declared, traces=traces)
    if not found.campaign.fits:
        said = [in_words_of_a_call(failure.message) for failure in found.facts.failures]
        more = f" (and {len(said) - _FEW} more)" if len(said) > _FEW else ""
        raise LogError(f"no setting could be fitted: {'; '.join(said[:_FEW])}{more}")
    return Run.load(folder, parts=("parameters", "mse"), is_temporary=out is None)


def _table_of_tests(tests: object) -> Path:
    return path_of(tests, "damperfit.identify(tests=...)", "the path of a table of tests")


@answers_wrong_calls("damperfit.load")
def load(folder: str | Path) -> Run:
    """Return the run in a folder, as `damperfit identify` wrote it.

    Raises
    ------
    ConfigurationError
        There is no such folder, or no results in it.
    """
    place = path_of(folder, "damperfit.load", "the path of a results folder")
    refuse_part(place, "damperfit.load")
    return Run.load(place, parts=("parameters", "mse"))


@answers_wrong_calls("damperfit.simulate")
def simulate(  # noqa: PLR0913 - one keyword an option of the command line
    setting: Setting | Run | int | str | None = None,
    *,
    parameters: Run | str | Path | None = None,
    set: Mapping[str, Any] | None = None,  # noqa: A002 - the option's name
    wave: str = "sine",
    amplitude: float | str | None = None,
    frequency: float | str | None = None,
    cycles: float | None = None,
    sample_rate: float | str | None = None,
    displacement: str | Path | None = None,
    **asked: Any,
) -> Simulation:
    """Simulate one setting.

    Parameters
    ----------
    setting : optional
        Whose parameters; not needed where `set` gives all of them.
    parameters : Run or path, optional
        Results, their folder or a parameters table; by default the reference set.
    set : mapping, optional
        Parameters that replace the setting's.
    wave : str
        sine or triangle.
    amplitude, frequency, cycles, sample_rate : optional
        Of the wave, SI or text with a unit; by default those of the test.
    displacement : path, optional
        A log whose displacement drives the damper instead.
    **asked
        config, damper: as of `identify`.
    """
    if isinstance(setting, Run):
        raise ConfigurationError(
            "damperfit.simulate: found a result in place of a setting; give "
            "damperfit.simulate(10, parameters=result), or result.setting(10).simulate()"
        )
    configuration = configured(
        "damperfit.simulate",
        wave=("simulation.wave", None if displacement is not None else wave),
        amplitude=("rig.amplitude", amplitude),
        frequency=("rig.frequency", frequency),
        cycles=("simulation.cycles", cycles),
        sample_rate=("simulation.sample_rate", sample_rate),
        **asked,
    )
    table = parameters.folder if isinstance(parameters, Run) else parameters
    results = "a result, or the path of results or of a parameters table"
    log = displacement
    return simulated(
        known_as_setting(setting, "damperfit.simulate(setting=...)"),
        configuration,
        table=None
        if table is None
        else path_of(table, "damperfit.simulate(parameters=...)", results),
        replaced=texts(set, "damperfit.simulate", "set") or {},
        log=None
        if log is None
        else path_of(log, "damperfit.simulate(displacement=...)", "the path of a log"),
    )


@answers_wrong_calls("damperfit.compare")
def compare(
    *runs: Run | str | Path,
    tolerance: str | Path | None = None,
    velocities: Sequence[str | float] | str | float = (),
    amplitude: str | float | None = None,
    frequency: str | float | None = None,
    is_measured: bool = False,
    jobs: int | None = 1,
) -> Comparison:
    """Show what differs between results, and whether it is more than chance.

    Parameters
    ----------
    *runs : Run or path
        The first is the reference.
    tolerance : str, optional
        "5%", "20N" or a table of bands.
    velocities, amplitude, frequency, is_measured, jobs
        As the options of `damperfit compare`; ``velocities=["0.1m/s", "0.3m/s"]``.
    """
    from damperfit.door.tables import Comparison
    from damperfit.queries.comparisons import compare_all, comparison_options, parse_bands
    from damperfit.workers import available_cores

    places, names = [_folder_of(one, "damperfit.compare") for one in runs], _names_of_unsaved(runs)
    if not places or (len(runs) == 1 and isinstance(runs[0], Run) and tolerance is None):
        raise ConfigurationError(
            f"damperfit.compare: found {'one result' if places else 'no result'}; expected two or "
            "more, or tolerance=FILE with nominal forces"
        )
    if tolerance is not None and not isinstance(tolerance, str | Path):
        raise ConfigurationError(
            f"damperfit.compare(tolerance=...): found {tolerance!r}; expected '5%', '20N' or the "
            "path of a table of bands"
        )
    if not isinstance(is_measured, bool):
        raise ConfigurationError(
            f"damperfit.compare(is_measured=...): found {is_measured!r}; expected True or False"
        )
    speeds = [velocities] if isinstance(velocities, str | float | int) else velocities
    if not isinstance(speeds, Iterable):
        raise ConfigurationError(
            f"damperfit.compare(velocities=...): found {velocities!r}; expected speeds such as "
            "['0.1m/s', '0.3m/s']"
        )
    options = comparison_options(
        velocities=list(speeds),
        amplitude=amplitude,
        frequency=frequency,
        is_measured=is_measured,
        jobs=workers(jobs, "damperfit.compare") or available_cores(),
    )
    bands = parse_bands(None if tolerance is None else str(tolerance))
    return Comparison(compare_all(places, replace(options, names=names), tolerance=bands))


@answers_wrong_calls("damperfit.export")
def export(
    results: Run | str | Path,
    to: str | None = None,
    out: str | Path | None = None,
    *,
    extend: float | str | None = None,
    overwrite: bool = False,
) -> tuple[Path, ...]:
    """Hand a damper over to another program.

    Parameters
    ----------
    results : Run or path
        What `identify` found.
    to : str
        A target of `damperfit export --list`.
    out : path, optional
        A file if it has a suffix of the target's, else a folder; by default ``export`` in the
        results' own.
    extend : speed, optional
        Tables beyond the tested speed, from the model.
    overwrite : bool
        Replace files that are there already, also those that damperfit did not write.

    Returns
    -------
    tuple of pathlib.Path
        What was written.
    """
    from damperfit.exporting import ExportOptions, exported_run, find_target
    from damperfit.store import file_set
    from damperfit.units.quantities import parse_quantity

    if to is None:
        raise ConfigurationError(
            "damperfit.export: no target given; give one, as in damperfit.export(results, 'fmu2'); "
            "damperfit export --list names them all"
        )
    target = find_target(str(to))
    folder = _folder_of(results, "damperfit.export")
    if out is None and isinstance(results, Run) and results.is_temporary:
        raise ConfigurationError(
            "damperfit.export: these results are in no folder of yours; give out=FOLDER"
        )
    where, stem = folder / "export", "damper"
    if out is not None:
        asked = path_of(out, "damperfit.export(out=...)", "the path of a file or folder")
        where, stem = target.place_of(asked)
    speed = None if extend is None else parse_quantity(extend, "velocity")
    made = target.export(exported_run(folder), ExportOptions(stem=stem, extend=speed))
    with file_set(where, spares_others=not overwrite) as drafts:
        for name, content in made.files.items():
            drafts.path(name).write_bytes(content)
    return tuple(where / name for name in made.files)


def _folder_of(given: object, call: str) -> Path:
    """Return the folder of results, or of the path to them.

    Raises
    ------
    ConfigurationError
        It is neither a result nor a path.
    """
    if isinstance(given, Run):
        return given.folder
    if isinstance(given, str | Path):
        return path_of(given, call, "a result, or the path of a results folder")
    raise ConfigurationError(
        f"found {type(given).__name__}; expected a result, or the path of a results folder",
        subject=call,
    )


def _names_of_unsaved(runs: Iterable[object]) -> dict[Path, str]:
    """Return what to call the results among some runs that are in no folder of the user's."""
    names: dict[Path, str] = {}
    for k, one in enumerate(runs, 1):
        if isinstance(one, Run) and one.is_temporary:
            names.setdefault(one.folder, f"result {k}")
    return names
