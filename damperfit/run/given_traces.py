"""Logs that a notebook has conditioned itself, beside those that are read."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from typing import TYPE_CHECKING

from damperfit.errors import ConfigurationError, LogError
from damperfit.recording import natural_order
from damperfit.run.logs import LogBatch, LogFacts
from damperfit.tested.identity import Identity

if TYPE_CHECKING:
    from collections.abc import Sequence

    from damperfit.recording import Trace
    from damperfit.tested.setting import Setting


def with_traces(batch: LogBatch, traces: Sequence[Trace], setting: Setting | None) -> LogBatch:
    """Return the logs of a run with traces that are there already, as if they had been read.

    Parameters
    ----------
    batch : LogBatch
        What was read.
    traces : sequence of Trace
        As `condition` returned them.
    setting : Setting, optional
        Of traces that do not say theirs.

    Raises
    ------
    ConfigurationError
        Two logs have one name, by which tables tell them apart.
    LogError
        A trace has no setting.
    """
    if not traces:
        return batch
    known = [one if one.setting is not None else replace(one, setting=setting) for one in traces]
    for one in known:
        if one.setting is None:
            raise LogError("this trace has no setting; give setting=N", subject=one.name)
    names = Counter([*(one.log for one in batch.logs), *(one.name for one in known)])
    if twice := [name for name, count in names.items() if count > 1]:
        raise ConfigurationError(
            f"two logs are called {twice[0]}; give each trace a name of its own, as with "
            "dataclasses.replace(trace, name=...)"
        )
    return replace(
        batch,
        traces=tuple(sorted([*batch.traces, *known], key=lambda one: natural_order(one.name))),
        logs=(*batch.logs, *map(_facts, known)),
        n_good=batch.n_good + len(known),
        identities={**batch.identities, **{one.name: Identity() for one in known}},
    )


def _facts(trace: Trace) -> LogFacts:
    sentences = (one.sentence for one in trace.findings)
    facts = trace.describe() | {
        "n_samples_read": len(trace.force),
        "notes": list(dict.fromkeys([*trace.notes, *sentences])),
        "verdict": "warnings" if trace.warnings else "good",
    }
    return LogFacts(trace.name, "", "", facts)
