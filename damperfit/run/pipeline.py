"""The whole story on one page: logs in, parameters and reports out.

    expand -> read and condition each log -> identify -> tables -> files

Failures of single logs and settings are collected; what can be done is done and written.
"""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from functools import partial
from itertools import chain
from typing import TYPE_CHECKING, Any

from damperfit.atomic import check_writable, file_set, reserved
from damperfit.errors import ConfigurationError, OutputError
from damperfit.identification import Campaign
from damperfit.report import markdown_report
from damperfit.run.dampers import by_damper, folder_name
from damperfit.run.earlier import PAGE, forget_figures
from damperfit.run.hold_out import Parted, fitting, named_files, note_unpredicted, part
from damperfit.run.judging import assessed, judge, with_profiles
from damperfit.run.logs import available_cores, expand, read_batch
from damperfit.run.mishaps import Mishaps
from damperfit.run.run_json import (
    Ending,
    Judgement,
    ending_of,
    provenance,
    record,
    report_facts,
)
from damperfit.run.same_setting import once_each, without_contradictions, without_copies
from damperfit.run.work import Clock, comparisons, fitted, profile_points, sha256_of
from damperfit.tables import make_tables, write_responses, write_table
from damperfit.uncertainty import Bench

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping, Sequence

    import pyarrow as pa

    from damperfit.configuration.options import Configuration
    from damperfit.identification import Fit
    from damperfit.report import Failure, ReportFacts
    from damperfit.run.logs import LogBatch
    from damperfit.setting import Setting
    from damperfit.tables import Tables

__all__ = ["RunResult", "UnwrittenError", "Watch", "run", "run_each"]

# Tables that are written only when they were asked for.
_ON_REQUEST = {"profiles"}


@dataclass(frozen=True, slots=True)
class Watch:
    """Who looks on while a run goes: progress, and the wish to stop.

    Attributes
    ----------
    on_start : callable
        Called with the number of settings when all logs are read.
    on_fit : callable
        Called with each `Fit` when it is done, from any thread.
    cancelled : callable
        Asked now and then; once it says True, finished settings are written and the run ends.
    """

    on_start: Callable[[int], None] = lambda _: None
    on_fit: Callable[[Fit], None] = lambda _: None
    cancelled: Callable[[], bool] = lambda: False


@dataclass(frozen=True, slots=True, eq=False)
class RunResult:
    """What a run found.

    Attributes
    ----------
    ending : Ending
        How it ended.
    campaign : Campaign
        The fits.
    tables : Tables
        Parameters and MSE.
    facts : ReportFacts
        Failures, warnings, procedure.
    record : dict
        What stands in run.json.
    profiles : pyarrow.Table or None
        Points of the profiles that were asked for.
    """

    ending: Ending
    campaign: Campaign
    tables: Tables
    facts: ReportFacts
    record: dict[str, Any]
    profiles: pa.Table | None = None

    @property
    def written(self) -> dict[str, pa.Table]:
        """Tables by the name of their files."""
        always = {
            "parameters": self.tables.parameters,
            "mse": self.tables.mse,
            "adjustment": self.tables.adjustment,
        }
        return always if self.profiles is None else always | {"profiles": self.profiles}

    def document(self) -> dict[str, Any]:
        """Return run.json and the rows of both tables as one JSON document."""
        return self.record | {
            "parameters": self.tables.parameters.to_pylist(),
            "mse": self.tables.mse.to_pylist(),
        }


class UnwrittenError(OutputError):
    """The results cannot be written; what was found is not lost with them.

    Attributes
    ----------
    result : RunResult
        What the run found.
    owner : str
        Of several dampers, whose result it is.
    """

    def __init__(self, message: str, result: RunResult, owner: str = "") -> None:
        super().__init__(message)
        self.result = result
        self.owner = owner


def run(
    configuration: Configuration,
    logs: Sequence[str],
    *,
    jobs: int | None = None,
    setting: Setting | None = None,
    watch: Watch = Watch(),
) -> RunResult:
    """Identify every setting in the logs of one damper and write the results as a set.

    Parameters
    ----------
    configuration : Configuration
        The complete configuration.
    logs : sequence of str
        Paths and patterns.
    jobs : int, optional
        Workers; the cores available by default. The results do not depend on it.
    setting : Setting, optional
        Setting of the logs that do not say theirs.
    watch : Watch
        Progress and cancellation.

    Returns
    -------
    RunResult

    Raises
    ------
    ConfigurationError
        A path or pattern names no file, or the logs are of several dampers; nothing was touched.
    OutputError
        The results cannot be written; earlier results are untouched. At the end of a run it is an
        `UnwrittenError` that holds the result.
    """
    workers = jobs or available_cores()
    check_writable(configuration.output.folder)
    with reserved(configuration.output.folder):
        parts = _read(configuration, logs, jobs=workers, setting=setting, watch=watch)
        if len(parts) > 1:
            raise ConfigurationError(
                f"logs of {len(parts)} dampers: {', '.join(one.owner for one in parts)}; run_each "
                "gives each a result of its own"
            )
        return parts[0].run(watch)


def run_each(
    configuration: Configuration,
    logs: Sequence[str],
    *,
    jobs: int | None = None,
    setting: Setting | None = None,
    watch: Watch = Watch(),
) -> Iterator[tuple[str, RunResult]]:
    """Identify the dampers in the logs one after the other; each writes a set of its own.

    Several dampers write into folders of their own inside the results' folder, by serial number or
    name. Parameters and errors are those of `run`; each damper is yielded with its name, empty
    where there is one.
    """
    workers = jobs or available_cores()
    check_writable(configuration.output.folder)
    with reserved(configuration.output.folder):
        parts = _read(configuration, logs, jobs=workers, setting=setting, watch=watch)
        for one in parts:
            try:
                yield one.folder_owner, one.run(watch)
            except UnwrittenError as error:
                raise UnwrittenError(str(error), error.result, one.folder_owner) from error


@dataclass(frozen=True, slots=True, eq=False)
class _OneDamper:
    """The logs of one damper, read, and where its results go."""

    owner: str
    folder_owner: str
    configuration: Configuration
    parted: Parted
    clock: Clock
    jobs: int

    def run(self, watch: Watch) -> RunResult:
        fit = partial(
            _run, self.configuration, self.parted, clock=self.clock, jobs=self.jobs, watch=watch
        )
        if not self.folder_owner:
            return fit()
        check_writable(self.configuration.output.folder)
        with reserved(self.configuration.output.folder):
            return fit()


def _read(
    configuration: Configuration,
    logs: Sequence[str],
    *,
    jobs: int,
    setting: Setting | None,
    watch: Watch,
) -> list[_OneDamper]:
    """Read the logs and part them by damper; what is held out is parted from each."""
    clock = Clock()
    folder = configuration.output.folder
    paths = expand(logs)
    named = named_files(configuration.hold_out.patterns, paths)
    paths = tuple(dict.fromkeys((*paths, *chain.from_iterable(named.values()))))
    with clock.lap("read_s"):
        batch = read_batch(
            paths, configuration, jobs=jobs, setting=setting, cancelled=watch.cancelled
        )
    if not batch.logs and not watch.cancelled():
        raise ConfigurationError(
            "no logs among the files given: they are all parameter tables or tables of tests"
        )
    groups = by_damper(batch)
    is_averaging = configuration.rig.is_averaging
    found = []
    for owner, mine in groups.items():
        parted = Parted(mine)
        if not watch.cancelled():
            options = configuration.hold_out
            if len(groups) > 1:
                part(batch, options, named)  # a pattern that fits no log at all is refused
                options = fitting(mine, options, named)
            parted = part(mine, options, named)
            once = once_each(parted.batch)
            left = without_contradictions(once, is_averaging=is_averaging)
            left, held_out = without_copies(left, parted.held_out)
            parted = replace(parted, batch=left, held_out=held_out)
        own = configuration
        if len(groups) > 1:
            output = replace(configuration.output, folder=folder / folder_name(owner))
            own = replace(configuration, output=output)
        found.append(_OneDamper(owner, owner if len(groups) > 1 else "", own, parted, clock, jobs))
    return found


def _run(
    configuration: Configuration, parted: Parted, *, clock: Clock, jobs: int, watch: Watch
) -> RunResult:
    """Fit, judge and write what was read."""
    batch = parted.batch
    watch.on_start(len({trace.setting for trace in batch.traces}))
    with clock.lap("fit_s"):
        campaign = fitted(
            configuration,
            batch.traces,
            jobs=jobs,
            on_fit=watch.on_fit,
            cancelled=watch.cancelled,
        )
    mishaps = Mishaps(batch)
    if campaign.mishap is not None:
        mishaps.add(campaign.mishap)
    bench = Bench(configuration.damper, configuration.identification.solver, watch.cancelled, jobs)
    with clock.lap("judge_s"):
        assessment = assessed(campaign, bench, mishaps)
    if configuration.profile and campaign.fits and not watch.cancelled():
        with clock.lap("profile_s"):
            assessment = with_profiles(
                campaign, assessment, bench, mishaps, names=configuration.profile
            )
    with clock.lap("judge_s"):
        campaign, judgement = judge(configuration, parted, campaign, assessment, mishaps, jobs=jobs)
    if not watch.cancelled():
        batch = note_unpredicted(parted, campaign, judgement.predictions, mishaps.failures)
    told = _Told(
        configuration,
        batch,
        campaign,
        judgement,
        provenance(configuration, batch, campaign, judgement.predictions),
        is_interrupted=watch.cancelled(),
    )
    if not campaign.fits and watch.cancelled():
        return told.result(mishaps.failures)
    try:
        return _write(told, mishaps, clock=clock, jobs=jobs)
    except OutputError as error:
        raise UnwrittenError(str(error), told.result(mishaps.failures)) from error


@dataclass(frozen=True, slots=True, eq=False)
class _Told:
    """All that a run has found, from which its account is made."""

    configuration: Configuration
    batch: LogBatch
    campaign: Campaign
    judgement: Judgement
    origin: Mapping[str, Any]
    is_interrupted: bool

    def result(self, mishaps: tuple[Failure, ...]) -> RunResult:
        judgement = replace(self.judgement, failures=mishaps)
        facts = report_facts(
            self.configuration,
            self.batch,
            self.campaign,
            judgement,
            is_interrupted=self.is_interrupted,
        )
        ending = ending_of(self.campaign, facts)
        return RunResult(
            ending=ending,
            campaign=self.campaign,
            tables=make_tables(
                self.campaign,
                assessment=judgement.assessment,
                predictions=judgement.predictions,
                adjustment=judgement.adjustment,
                expected=self.configuration.rig.settings,
                provenance=self.origin,
            ),
            facts=facts,
            record=record(
                self.configuration, self.batch, facts, self.campaign, judgement, ending=ending
            ),
            profiles=profile_points(self.configuration, judgement, self.origin),
        )


def _write(told: _Told, mishaps: Mishaps, *, clock: Clock, jobs: int) -> RunResult:
    """Write all files as a set, run.json last; page and figures of an earlier run go."""
    configuration, campaign = told.configuration, told.campaign
    folder = configuration.output.folder
    with file_set(folder) as files:
        with clock.lap("write_s"):
            # First, for what fails in it is told in the others.
            write_responses(
                files.path("responses.parquet"),
                campaign,
                comparisons(configuration, campaign, mishaps, jobs=jobs),
                provenance=told.origin,
            )
            result = told.result(mishaps.failures)
            for name, table in result.written.items():
                for suffix in (".parquet", ".csv"):
                    write_table(files.path(name + suffix), table, suffix=suffix)
            for name in _ON_REQUEST - result.written.keys():
                for suffix in (".parquet", ".csv"):
                    files.without(name + suffix)
            files.without(PAGE)
            report = markdown_report(result.tables, result.facts)
            files.path("report.md").write_bytes(report.encode("utf-8", "backslashreplace"))
        result.record["files"] = {name: sha256_of(files.path(name)) for name in sorted(files.names)}
        result.record["timings"] = clock.read()
        text = json.dumps(result.record, indent=2, ensure_ascii=False, allow_nan=False) + "\n"
        files.path("run.json").write_bytes(text.encode("utf-8", "backslashreplace"))
    forget_figures(folder)
    return result
