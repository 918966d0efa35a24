"""A run's signals, tables and report into its set of files; run.json comes after them.

The signals of many logs take as long to write as all the rest: copies of this process do that, and
read the characteristics off them, while this one makes the tables and the report.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from damperfit.report.markdown import markdown_report
from damperfit.run.earlier import PAGE
from damperfit.run.readings import Readings
from damperfit.run.work import comparisons, sha256_of
from damperfit.tables.columns import PAPER_QUANTITIES
from damperfit.tables.files import table_in_units, write_responses, write_table
from damperfit.tables.rows import signals_of
from damperfit.workers import meanwhile, release_memory

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    import pyarrow as pa

    from damperfit.configuration.options import Configuration
    from damperfit.identification import SimulatedLog
    from damperfit.run.mishaps import Mishaps
    from damperfit.run.result import Found, RunResult
    from damperfit.store import FileSet

__all__ = ["write_results"]

_SIGNALS, _READ_OFF, _REPORT = "responses.parquet", "characteristics", "report.md"
# Tables that are written only when they were asked for, or the model has what they are of.
_ON_REQUEST = ("profiles", "valves")


def write_results(
    files: FileSet, found: Found, mishaps: Mishaps, *, jobs: int
) -> tuple[RunResult, dict[str, str]]:
    """Write what a run has found, but for run.json; page and tables of an earlier run go.

    Parameters
    ----------
    files : FileSet
        Where to.
    found : Found
        What it has found.
    mishaps : Mishaps
        Takes what goes wrong with one log, which the results then report.
    jobs : int
        Workers.

    Returns
    -------
    RunResult
        The account of it.
    dict of str to str
        The hash of each file, by name.
    """
    configuration, campaign = found.configuration, found.campaign
    path = files.path(_SIGNALS)
    readings = Readings(configuration, campaign, mishaps)
    valves = readings.valves(found.origin)
    logs = readings.logs
    light = found.without_responses

    def write(seen: Iterator[SimulatedLog | None]) -> str:
        logs_of_fits = ((fit, log) for fit in campaign.fits for log in fit.logs)
        write_responses(
            path,
            (
                signals_of(fit.setting, log.trace, one)
                for (fit, log), one in zip(logs_of_fits, seen, strict=True)
                if one is not None
            ),
            settings=[fit.setting for fit in campaign.fits],
            quantities=campaign.quantities or PAPER_QUANTITIES,
            facts=found.origin,
        )
        return sha256_of(path)

    def seen() -> Iterator[SimulatedLog | None]:
        return comparisons(configuration, campaign, mishaps, jobs=jobs)

    def one(place: int | None) -> Any:
        """Read a log's rows off it; without one write the signals of all, and tell the hash."""
        return write(seen()) if place is None else readings.of_log(*logs[place])

    def account() -> RunResult:
        result = light.result(mishaps.failures, valves=valves)
        _write_tables(files, result.tables, configuration)
        report = markdown_report(result.tables, result.facts, result.quantities)
        files.path(_REPORT).write_bytes(report.encode("utf-8", "backslashreplace"))
        return result

    with meanwhile(one, [None, *range(len(logs))], jobs=jobs) as coming:
        if coming is None:
            digest = write(readings.noted(seen()))
            result = account()
        else:
            # The copies have what simulations have left; here it would lie beside the account.
            found, campaign = light, light.campaign
            readings.campaign = campaign
            logs = readings.logs
            release_memory()
            told = mishaps.failures
            result = account()
            digest, *rows = coming
            readings.rows = [row for of_log in rows for row in of_log]
            if mishaps.failures != told:  # with what has come to nothing meanwhile
                result = account()
    result.tables[_READ_OFF] = readings.table(found.origin)
    _write_tables(files, {_READ_OFF: result.tables[_READ_OFF]}, configuration)
    for name in set(_ON_REQUEST) - result.tables.keys():
        for suffix in (".parquet", ".csv"):
            files.without(name + suffix)
    files.without(PAGE)
    hashes = {name: sha256_of(files.path(name)) for name in files.names if name != _SIGNALS}
    return result, dict(sorted((hashes | {_SIGNALS: digest}).items()))


def _write_tables(
    files: FileSet, tables: Mapping[str, pa.Table], configuration: Configuration
) -> None:
    for name, table in tables.items():
        shown = table_in_units(table, configuration.output.units)
        for suffix, content in ((".parquet", table), (".csv", shown)):
            write_table(files.path(name + suffix), content, suffix=suffix)
