"""``damperfit fleet``: many dampers, one Parquet part each, never done twice."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from damperfit.cli.console import print_json, print_lines, say
from damperfit.cli.option_values import configured, covaried, rig_entries
from damperfit.cli.options import (
    ConfigOption,
    CovariateOption,
    DebugOption,
    JobsOption,
    JsonOption,
    ModelOption,
    ProcedureOption,
    QuietOption,
    RigOption,
    RigProfileOption,
    StrictOption,
    TestsOption,
    ToleranceOption,
    VersionOption,
)
from damperfit.errors import ConfigurationError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from damperfit.comparison import Tolerance
    from damperfit.configuration.options import Configuration
    from damperfit.fleet.run import DamperTask, Done
    from damperfit.fleet.survey import HeldFleet

__all__ = ["fleet"]

_MANY = 20  # failures that are listed one by one; the parts hold them all


def fleet(
    logs: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="[LOGS...]",
            help="Folders, files, patterns, or addresses such as s3://bucket/runs.",
        ),
    ] = None,
    out: Annotated[Path, typer.Option(metavar="DIR", help="Folder of the fleet's parts.")] = Path(
        "fleet"
    ),
    jobs: JobsOption = None,
    scheduler: Annotated[
        str | None,
        typer.Option(metavar="ADDRESS", help="Work on a Dask cluster, as in tcp://10.0.0.1:8786."),
    ] = None,
    part: Annotated[
        str | None,
        typer.Option(metavar="I/N", help="Only part I of N, as in a job array: 3/100."),
    ] = None,
    collect: Annotated[
        bool,
        typer.Option("--collect", help="Then write one table of all parts: fleet.parquet, .csv."),
    ] = False,
    report: Annotated[
        bool,
        typer.Option(
            "--report", help="Also write the tables and one page of the fleet: fleet.html."
        ),
    ] = False,
    tolerance: ToleranceOption = None,
    model: ModelOption = None,
    procedure: ProcedureOption = None,
    covariate: CovariateOption = None,
    tests: TestsOption = None,
    strict: StrictOption = False,
    rig_profile: RigProfileOption = None,
    rig: RigOption = None,
    config: ConfigOption = None,
    json: JsonOption = False,
    quiet: QuietOption = False,
    debug: DebugOption = False,
    version: VersionOption = False,
) -> int:
    """Fit many dampers, one part each; finished ones are not fitted again.

    Example: damperfit fleet runs --out fleet --collect
    """
    from damperfit.cli.interrupt import stop_on_signal
    from damperfit.cli.progress import fleet_progress
    from damperfit.fleet.run import planned, share_of
    from damperfit.queries.comparisons import parse_bands
    from damperfit.store import check_writable

    asked = [
        option
        for option, is_given in (
            ("--collect", collect),
            ("--report", report),
            ("--tolerance", tolerance is not None),
        )
        if is_given
    ]
    _refuse(asked, logs, out, scheduler=scheduler, jobs=jobs, part=part)
    bands = parse_bands(tolerance)
    configuration = configured(
        config,
        ("--model", "damper.model", model),
        (
            "--covariate",
            "damper.reference_temperature",
            covaried(covariate, model=model, config=config, of_fleet=True),
        ),
        ("--procedure", "identification.procedure", procedure),
        ("--tests", "test.table", str(tests.resolve()) if tests is not None else None),
        ("--strict", "rig.strict", strict or None),
        *rig_entries(rig),
        ("--rig-profile", "rig.profile", rig_profile),
    )
    share = None if part is None else share_of(part)
    done: list[Done] = []
    n_tasks, is_stopped = 0, False
    if logs:
        check_writable(out)
        tasks = planned(configuration, logs, out, share)
        n_tasks = len(tasks)
        with (
            stop_on_signal("dampers that are done are kept") as cancelled,
            fleet_progress(n_tasks, is_wanted=not quiet) as advance,
        ):
            for one in _each(configuration, tasks, out, scheduler, jobs, cancelled):
                done.append(one)
                advance()
            is_stopped = cancelled()
    _say(done, n_tasks, out, is_quiet=quiet, is_stopped=is_stopped)
    held = None
    if asked and not is_stopped:
        held = _collect(out, bands, is_reported=report, is_quiet=quiet)
    if json:
        print_json(_document(done, n_tasks, held, is_stopped=is_stopped))
    else:
        print_lines([*(_summary(done, n_tasks) if logs else ()), *_held_lines(held)])
    return _code(done, held, is_stopped=is_stopped)


def _refuse(
    asked: Sequence[str],
    logs: Sequence[str] | None,
    out: Path,
    *,
    scheduler: str | None,
    jobs: int | None,
    part: str | None,
) -> None:
    """Refuse options that do not go together."""
    if not logs and not asked:
        raise ConfigurationError(
            "fleet: expected LOGS, or --collect or --report for the parts that are there"
        )
    if scheduler is not None and jobs is not None:
        raise ConfigurationError(
            "--jobs cannot be combined with --scheduler: the cluster has its own workers; leave "
            "one out"
        )
    if part is not None and asked:
        raise ConfigurationError(
            f"{asked[0]} cannot be combined with --part: other parts may not be done yet; collect "
            f"with damperfit fleet --out {out} {asked[0]} when all are"
        )


def _collect(
    out: Path, bands: Tolerance | None, *, is_reported: bool, is_quiet: bool
) -> HeldFleet | None:
    """Make the one table of all parts, its page, and hold its forces against bands."""
    from damperfit.fleet.parts import collect as collected

    table = collected(out)
    if not is_quiet:
        say(f"damperfit: {table.num_rows} rows of the fleet in {out / 'fleet.parquet'} and .csv")
    if bands is None and not is_reported:
        return None
    from damperfit.fleet.survey import fleet_against_bands, survey

    found = survey(table)
    held = None if bands is None else fleet_against_bands(found, bands)
    if is_reported:
        from damperfit.fleet.page import write_page

        write_page(out, found, held)
        if not is_quiet:
            say(f"damperfit: {out / 'fleet.html'} written, with tables of dampers and outliers")
    return held


def _held_lines(held: HeldFleet | None) -> list[str]:
    if held is None:
        return []
    lines = [
        f"{point.run or 'unknown'}{f', setting {point.setting}' if str(point.setting) else ''}"
        f"{f', {point.speed:g} m/s {point.stroke}' if point.stroke else ''}: {point.words}"
        for point in held.worst[:_MANY]
    ]
    more = len(held.worst) - _MANY
    if more > 0:
        lines.append(f"and {more} more damper{'s' * (more > 1)}; --report lists them")
    return [f"tolerance {held.source}: {held.sentence}", *lines]


def _each(
    configuration: Configuration,
    tasks: Sequence[DamperTask],
    out: Path,
    scheduler: str | None,
    jobs: int | None,
    cancelled: Callable[[], bool],
) -> Iterator[Done]:
    """Do the tasks where the user wants them done."""
    from damperfit.fleet.run import run_fleet
    from damperfit.workers import Cluster, Processes, available_cores

    folder = out.resolve()
    if scheduler is None:
        engine = Processes(min(jobs or available_cores(), max(1, len(tasks))))
        yield from run_fleet(configuration, tasks, folder, engine, cancelled=cancelled)
        return
    cluster = Cluster(scheduler)
    try:
        yield from run_fleet(configuration, tasks, folder, cluster, cancelled=cancelled)
    finally:
        cluster.close()


def _say(
    done: Sequence[Done], n_tasks: int, out: Path, *, is_quiet: bool, is_stopped: bool
) -> None:
    lines = [f"{one.owner or 'logs'}: {line}" for one in done for line in one.failures]
    for line in lines[:_MANY]:
        say(f"damperfit: {line}")
    if len(lines) > _MANY:
        say(f"damperfit: and {len(lines) - _MANY} more failures; the parts in {out} hold them all")
    for one in done:
        for gate in one.gates:
            say(f"damperfit: {one.owner or 'logs'}: {gate}")
    n_before = sum(one.n_failures for one in done) - len(lines)
    if n_before and not is_quiet:
        count = "1 failure" if n_before == 1 else f"{n_before} failures"
        verb, them = ("counts", "it") if n_before == 1 else ("count", "them")
        say(f"damperfit: {count} of an earlier run {verb} too; the parts hold {them}")
    if is_stopped:
        left = n_tasks - len(done)
        say(
            f"damperfit: interrupted; {left} of {n_tasks} dampers left, the same command goes on "
            "with them"
        )
    elif n_tasks and not is_quiet:
        say(f"damperfit: parts in {out}")


def _counts(done: Sequence[Done]) -> dict[str, int]:
    from damperfit.fleet.run import State

    return {state.value: sum(one.state is state for one in done) for state in State}


def _summary(done: Sequence[Done], n_tasks: int) -> list[str]:
    counts = _counts(done)
    words = {
        "fitted": "fitted now",
        "known": "done before",
        "failed": "without any fit",
        "later": "not done, tried again next time",
    }
    parts = [
        f"{counts[key]} {said}" for key, said in words.items() if counts[key] or key == "fitted"
    ]
    n_settings = sum(one.n_settings for one in done)
    n_logs = sum(one.n_logs for one in done)
    dampers = f"{n_tasks} damper{'' if n_tasks == 1 else 's'}"
    return [f"{dampers}: {', '.join(parts)}; {n_logs} logs, {n_settings} settings with a fit"]


def _document(
    done: Sequence[Done], n_tasks: int, held: HeldFleet | None, *, is_stopped: bool
) -> dict[str, Any]:
    from damperfit.report.compared import tolerance_rows

    return {
        "dampers": n_tasks,
        **_counts(done),
        "logs": sum(one.n_logs for one in done),
        "settings": sum(one.n_settings for one in done),
        "interrupted": is_stopped,
        "failures": [
            {"damper": one.owner, "message": line} for one in done for line in one.failures
        ],
        "gates_missed": [
            {"damper": one.owner, "message": line} for one in done for line in one.gates
        ],
        "tolerance": None if held is None else held.source,
        "dampers_out_of_tolerance": [] if held is None else [one.run for one in held.worst],
        "points": [] if held is None else tolerance_rows(held.missed),
    }


def _code(done: Sequence[Done], held: HeldFleet | None, *, is_stopped: bool) -> int:
    """Return the exit code; failures of parts that were there count like those of new ones."""
    if is_stopped:
        return 130
    has_failed = any(one.n_failures for one in done)
    if has_failed and not any(one.n_settings for one in done):
        return 3
    if has_failed:
        return 1
    is_missed = held is not None and bool(held.missed)
    return 4 if is_missed or any(one.n_gates for one in done) else 0
