"""Objects of a store that have not changed since an earlier run, seen without fetching them.

A part says of each object what its store told when it was fetched (ETag, size, time of change) and
what was found in it. Where the store tells the same today, the object is taken for the same. What
another version found is not trusted: it may have read otherwise whose a log is.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

from damperfit import __version__
from damperfit.fleet.parts import parts_in, read_facts_of
from damperfit.fleet.sources import KnownObject
from damperfit.fleet.stores import UnreachableError, stamp_of
from damperfit.parallel import executor

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from damperfit.fleet.sources import FleetLog

__all__ = ["AT_ONCE", "recognised"]

AT_ONCE = 16  # requests; nearly all of the time is waiting


def recognised(sources: Sequence[FleetLog], folder: Path) -> tuple[FleetLog, ...]:
    """Return sources with what is known of those that have not changed since an earlier run.

    Parameters
    ----------
    sources : sequence of FleetLog
        Logs and tables of tests, in stores or not.
    folder : pathlib.Path
        Of the fleet.
    """
    if not any(one.is_remote for one in sources):
        return tuple(sources)
    known = _seen_in(folder)

    def one(source: FleetLog) -> FleetLog:
        seen = known.get(source.place) if source.is_remote else None
        if seen is None:
            return source
        try:
            is_same = stamp_of(source.place) == seen.stamp
        except UnreachableError:  # whoever fetches it says so
            return source
        return replace(source, seen=seen) if is_same else source

    with executor(AT_ONCE) as pool:
        return tuple(pool.map(one, sources))


def _seen_in(folder: Path) -> dict[str, KnownObject]:
    found: dict[str, KnownObject] = {}
    for path in parts_in(folder):
        facts = read_facts_of(path)
        seen_before: Any = facts.get("seen") if facts.get("version") == __version__ else None
        for place, seen in seen_before.items() if isinstance(seen_before, dict) else ():
            found[place] = KnownObject(*map(str, seen))
    return found
