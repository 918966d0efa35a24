"""What a run computes between reading and writing."""

from __future__ import annotations

import hashlib
import logging
from typing import TYPE_CHECKING, Any

from damperfit.identification import Campaign, identify
from damperfit.io.files import open_regular
from damperfit.tables.files import lay_out
from damperfit.tables.rows import profile_rows
from damperfit.workers import executor, told_here

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping, Sequence
    from pathlib import Path

    import pyarrow as pa

    from damperfit.configuration.options import Configuration
    from damperfit.damper.model import Values
    from damperfit.identification import Fit, LogFit, SimulatedLog
    from damperfit.recording import Trace
    from damperfit.run.mishaps import Mishaps
    from damperfit.run.run_json import Judgement

__all__ = ["comparisons", "fitted", "profile_points", "sha256_of"]

_LOGGER = logging.getLogger(__name__)


def fitted(
    configuration: Configuration,
    traces: Sequence[Trace],
    *,
    jobs: int,
    on_fit: Callable[[Fit], None],
    cancelled: Callable[[], bool],
) -> Campaign:
    """Return the fits of all settings; none where there is no log, or the user has stopped."""
    if not traces or cancelled():
        return Campaign(
            procedure=configuration.identification.procedure,
            fits=(),
            named=configuration.damper.quantities,
        )

    def note(fit: Fit) -> None:
        _LOGGER.debug(
            "setting %s: MSE %.4g %%, %s, %d evaluations, %d samples of %d cycles; %s",
            fit.setting,
            fit.mse_percent,
            fit.outcome.value,
            fit.evaluations,
            fit.n_samples,
            fit.n_cycles,
            fit.parameters,
        )
        on_fit(fit)

    return identify(
        traces,
        configuration.damper,
        configuration.identification,
        jobs=jobs,
        on_fit=note,
        cancelled=cancelled,
    )


def profile_points(
    configuration: Configuration, judgement: Judgement, origin: Mapping[str, Any]
) -> pa.Table | None:
    """Return the table of the profiles that were asked for."""
    if not configuration.profile:
        return None
    profiles = judgement.assessment.profiles
    wanted = [one for one in profiles if one.name in configuration.profile]
    return lay_out(
        "profiles",
        profile_rows(wanted),
        facts=origin,
        settings={one.setting for one in wanted},
        quantities=configuration.damper.quantities,
    )


def comparisons(
    configuration: Configuration, campaign: Campaign, mishaps: Mishaps, *, jobs: int
) -> Iterator[SimulatedLog | None]:
    """Yield each log as the fit saw it last, else simulated anew, a few at a time: so large."""
    take = told_here(mishaps.at_log("simulating the response of"))

    def one(pair: tuple[Values, LogFit]) -> SimulatedLog | None:
        parameters, log = pair
        try:
            return log.compared(
                parameters, configuration.damper, configuration.identification.solver
            )
        except Exception as error:  # noqa: BLE001 - the other logs have their signals
            take(log.trace, error)
            return None

    pairs = [(fit.parameters, log) for fit in campaign.fits for log in fit.logs]
    # What the fit has left needs no thread, beside which no other work could be done in processes.
    is_left = all(log.seen is not None for _, log in pairs)
    with executor(1 if is_left else jobs) as pool:
        for start in range(0, len(pairs), 2 * jobs):
            yield from pool.map(one, pairs[start : start + 2 * jobs])


def sha256_of(path: Path) -> str:
    """Return the hash of a file, hexadecimal."""
    with open_regular(path) as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
