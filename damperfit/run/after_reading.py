"""What comes after reading: the logs of one damper fitted, judged and written.

A module of its own, so that a run can load all of this while copies of it read.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

# Not used here, and long to load.
import damperfit.run.conditions
import damperfit.run.duplicate_tests  # noqa: F401
from damperfit.errors import OutputError
from damperfit.run.earlier import BESIDE, forget_figures, holds_fits
from damperfit.run.ending import json_pieces
from damperfit.run.hold_out import note_unpredicted
from damperfit.run.judging import assessed, judge, with_profiles
from damperfit.run.mishaps import Mishaps
from damperfit.run.result import Found, RunResult
from damperfit.run.run_json import provenance
from damperfit.run.unwritten import UnwrittenError
from damperfit.run.work import fitted
from damperfit.run.writing import write_results
from damperfit.store import file_set
from damperfit.uncertainty import Bench

if TYPE_CHECKING:
    from damperfit.configuration.options import Configuration
    from damperfit.run.hold_out import Parted
    from damperfit.run.watching import Clock, Watch

__all__ = ["found_in", "write_found"]


def write_found(
    configuration: Configuration,
    parted: Parted,
    *,
    clock: Clock,
    jobs: int,
    watch: Watch,
    beside: tuple[str, ...] = (),
) -> RunResult:
    """Fit, judge and write what was read.

    Parameters
    ----------
    configuration : Configuration
        Of the damper.
    parted : Parted
        Its logs, and which of them are held out.
    clock : Clock
        Takes how long each part lasts.
    jobs : int
        Workers.
    watch : Watch
        Progress and cancellation.
    beside : tuple of str
        Folders of all dampers of the command, where these are several.

    Raises
    ------
    UnwrittenError
        The results cannot be written; it holds them.
    """
    found, mishaps = found_in(configuration, parted, clock=clock, jobs=jobs, watch=watch)
    if not found.campaign.fits and watch.cancelled():
        return found.result(mishaps.failures)
    if not found.campaign.fits and holds_fits(configuration.output.folder):
        result = found.result(mishaps.failures)
        result.keeps_earlier = True
        return result
    whole = [found]  # whoever writes takes it out: nobody else keeps what the simulations left
    found = found.without_responses
    try:
        with file_set(configuration.output.folder) as files:
            with clock.lap("write_s"):
                result, hashes = write_results(files, whole.pop(), mishaps, jobs=jobs)
            record = result.record
            record["files"] = hashes
            record["timings"] = clock.read()
            if beside:
                record[BESIDE] = list(beside)
            with files.path("run.json").open("wb") as file:
                for piece in json_pieces(record):
                    file.write(piece.encode("utf-8", "backslashreplace"))
    except OutputError as error:
        raise UnwrittenError(error, found.result(mishaps.failures)) from error
    forget_figures(configuration.output.folder)
    return result


def found_in(
    configuration: Configuration, parted: Parted, *, clock: Clock, jobs: int, watch: Watch
) -> tuple[Found, Mishaps]:
    """Fit and judge what was read, as `write_found` does; what went wrong comes beside it."""
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
    origin = provenance(configuration, batch, campaign, judgement.predictions)
    is_interrupted = watch.cancelled()
    return Found(configuration, batch, campaign, judgement, origin, is_interrupted), mishaps
