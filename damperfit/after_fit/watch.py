"""A folder watched while a rig writes into it: each new log is fitted and answered in one line."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from damperfit.errors import DamperfitError, InstallationError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path
    from threading import Event

    from damperfit.results import Run

__all__ = ["Arrival", "answered", "arrivals"]

_SETTLED = 0.3  # s without a change: the rig has closed the log
_POLL = 100  # ms between looks for files that have settled
_OWN = (".parquet", ".json", ".html", ".toml", ".md", ".png", ".svg", ".pdf", ".ipynb")
_STROKES = {"rebound": "rebound", "bump": "compression"}


@dataclass(frozen=True, slots=True)
class Arrival:
    """One log, and what came of it.

    Attributes
    ----------
    path : pathlib.Path
        The log.
    run : Run or None
        Its fit; None: it is refused or could not be fitted.
    sentence : str
        The answer in one line.
    """

    path: Path
    run: Run | None
    sentence: str


def arrivals(folder: Path, own: Path | None, stop: Event) -> Iterator[list[Path]]:
    """Yield the logs of a folder that are complete and new or changed, until the event is set.

    An empty list is yielded when nothing has come for a moment. What was there before comes first.

    Parameters
    ----------
    folder : pathlib.Path
        Watched with the folders in it.
    own : pathlib.Path, optional
        Folder of the results: nothing in it is a log.

    Raises
    ------
    InstallationError
        The watcher's library is not installed.
    """
    try:
        from watchfiles import watch
    except ImportError:
        raise InstallationError(
            "watch needs watchfiles, which is not installed: pip install 'damperfit[watch]'"
        ) from None

    def is_log(path: Path) -> bool:
        hidden = any(part.startswith(".") for part in path.relative_to(folder).parts)
        return not hidden and path.suffix.lower() not in _OWN and not _is_in(path, own)

    seen: dict[Path, tuple[int, int]] = {}
    waiting = {path: time.monotonic() for path in folder.rglob("*") if is_log(path)}
    for changes in watch(
        folder, stop_event=stop, rust_timeout=_POLL, yield_on_timeout=True, raise_interrupt=True,
        debounce=_POLL, step=_POLL // 2,
    ):  # fmt: skip
        now = time.monotonic()
        for _, name in changes:
            path = type(folder)(name)
            if path.is_relative_to(folder) and is_log(path):
                waiting[path] = now
        settled = [path for path, at in waiting.items() if now - at >= _SETTLED]
        done = []
        for path in settled:
            del waiting[path]
            state = _state(path)
            if state is not None and seen.get(path) != state:
                seen[path] = state
                done.append(path)
        yield sorted(done)


def _is_in(path: Path, folder: Path | None) -> bool:
    return folder is not None and path.is_relative_to(folder)


def _state(path: Path) -> tuple[int, int] | None:
    """Size and time of change of a regular file with content; None: there is none."""
    try:
        found = path.stat()
    except OSError:
        return None
    return (found.st_size, found.st_mtime_ns) if path.is_file() and found.st_size else None


def answered(path: Path, fit: Callable[[Path], Run], reference: Run | None, name: str) -> Arrival:
    """Return what came of a log: good or why not, forces, and the difference from a reference."""
    try:
        run = fit(path)
    except DamperfitError as error:
        why = str(error).removeprefix("no setting could be fitted: ")
        for prefix in (f"{path.name}: ", f"{path.name}, "):
            why = why.removeprefix(prefix)
        return Arrival(path, None, f"{name}: {why}")
    if run.failures or not run.settings:
        why = "; ".join(run.failures) or "no setting was fitted"
        return Arrival(path, None, f"{name}: {why}")
    setting = run.settings[0]
    verdict = _verdict(run)
    forces = _fastest_forces(run)
    parts = [
        f"{name}: {verdict}",
        f"setting {setting.label}",
        f"MSE {setting.mse_percent:.3g} % {setting.grade}",
        *(f"{_STROKES[one['stroke']]} {one['force_N']:.0f} N" for one in forces),
    ]
    sentence = ", ".join(parts)
    if forces:
        sentence += f" at {forces[0]['speed_m_per_s']:g} m/s"
    if reference is not None:
        sentence += f"; {_difference(forces, reference, setting.label)}"
    return Arrival(path, run, sentence)


def _verdict(run: Run) -> str:
    """Good, or the names of the warnings."""
    findings = [
        finding
        for log in run.record.get("inputs", ())
        for finding in log.get("findings", ())
        if finding.get("severity") == "warning"
    ]
    names = list(dict.fromkeys(str(finding["name"]) for finding in findings))
    return f"warning: {', '.join(names)}" if names else "good"


def _fastest_forces(run: Run) -> list[dict[str, Any]]:
    """Rebound and compression at the fastest named speed that was tested."""
    rows = [dict(row) for row in run.rows("adjustment") if row["force_N"] is not None]
    fastest = max((row["speed_m_per_s"] for row in rows), default=0.0)
    return [row for row in rows if row["speed_m_per_s"] == fastest]


def _difference(forces: list[dict[str, Any]], reference: Run, label: str) -> str:
    known = {
        (row["stroke"], round(row["speed_m_per_s"], 6)): row["force_N"]
        for row in reference.rows("adjustment")
        if str(row["setting"]) == label and row["force_N"]
    }
    changes = [
        100.0 * (row["force_N"] / known[key] - 1.0)
        for row in forces
        if (key := (row["stroke"], round(row["speed_m_per_s"], 6))) in known
    ]
    if not changes:
        return f"setting {label} is not in {reference.name} at this speed"
    shown = ", ".join(f"{change:+.2g} %" for change in changes)
    return f"{shown} beside {reference.name}"
