"""Logs of several dampers in one command: each gets a result of its own, never one together."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import TYPE_CHECKING

from damperfit.errors import ConfigurationError, LogError
from damperfit.problem import Failure, Problem
from damperfit.recording import natural_order

if TYPE_CHECKING:
    from collections.abc import Mapping

    from damperfit.run.logs import LogBatch


_FEW = 5


def by_damper(batch: LogBatch) -> dict[str, LogBatch]:
    """Return the logs of each damper, by serial number or name.

    Where no log or one damper alone is named there is one entry. Logs that say nothing then count
    as that damper's, which is said; beside several dampers they fail.

    Parameters
    ----------
    batch : LogBatch
        Everything that was read.
    """
    owners = {log.log: _owner(batch, log.log) for log in batch.logs}
    named = sorted({owner for owner in owners.values() if owner}, key=natural_order)
    nameless = [log for log, owner in owners.items() if not owner]
    if len(named) <= 1:
        remarks = batch.remarks
        if named and nameless:
            remarks = (
                *remarks,
                f"{_listed(nameless)}: assumed to belong to damper {named[0]}, like the others",
            )
        return {named[0] if named else "": replace(batch, remarks=remarks)}
    lost = tuple(
        Failure(
            Problem(
                "no-owner",
                "the log does not say which damper it belongs to, and there are "
                f"{_listed(named)}; give it a line '# serial: {named[0]}' or a row in tests.csv",
                subject=log.log,
            ),
            *(LogError.__name__, log.log, log.path, log.facts.get("setting")),
        )
        for log in batch.logs
        if log.log in nameless and not _has_failed(batch, log.log)
    )
    groups = {owner: _part(batch, owners, owner) for owner in named}
    first = groups[named[0]]
    groups[named[0]] = replace(
        first,
        failures=(*first.failures, *_nameless(batch, nameless), *lost),
        remarks=(*batch.remarks, *first.remarks),
        notes=batch.notes,
        skipped=batch.skipped,
        logs=(*first.logs, *(log for log in batch.logs if log.log in nameless)),
    )
    return groups


def of_one_damper(batch: LogBatch) -> LogBatch:
    """Return the batch where its logs are of one damper.

    Raises
    ------
    ConfigurationError
        They are of several.
    """
    groups = by_damper(batch)
    if len(groups) > 1:
        raise ConfigurationError(
            f"logs of {len(groups)} dampers: {_listed(list(groups))}; give the logs of one"
        )
    return next(iter(groups.values()))


def _owner(batch: LogBatch, log: str) -> str:
    identity = batch.identities.get(log)
    return "" if identity is None else identity.owner


def _has_failed(batch: LogBatch, log: str) -> bool:
    return any(failure.log == log for failure in batch.failures)


def _nameless(batch: LogBatch, nameless: list[str]) -> tuple[Failure, ...]:
    return tuple(one for one in batch.failures if one.log in nameless)


def _part(batch: LogBatch, owners: Mapping[str, str], owner: str) -> LogBatch:
    mine = {log for log, whose in owners.items() if whose == owner}
    failures = tuple(one for one in batch.failures if one.log in mine)
    return replace(
        batch,
        traces=tuple(trace for trace in batch.traces if trace.name in mine),
        logs=tuple(log for log in batch.logs if log.log in mine),
        failures=failures,
        skipped=(),
        n_good=len(mine) - len(failures),
        remarks=(),
        notes=(),
        identities={log: one for log, one in batch.identities.items() if log in mine},
    )


def folder_name(owner: str) -> str:
    """Return the name of a damper's folder: its serial number, in letters that every disk takes.

    Examples
    --------
    >>> folder_name("SN 12/34"), folder_name("..")
    ('SN_12_34', 'damper')
    """
    return re.sub(r"[^\w.-]+", "_", owner).strip("._") or "damper"


def _listed(names: list[str]) -> str:
    more = f" and {len(names) - _FEW} more" if len(names) > _FEW else ""
    return ", ".join(names[:_FEW]) + more
