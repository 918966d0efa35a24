"""A folder watched while a rig writes into it: each new log is fitted and answered in one line."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Any, NamedTuple

from damperfit.after_fit.valves import unlike
from damperfit.errors import DamperfitError, InstallationError
from damperfit.io.files import sha256_of
from damperfit.tables.files import json_values

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path
    from threading import Event

    from damperfit.results import Run

_SETTLED = 0.3  # s without a change: the rig has closed the log
_POLL = 100  # ms between looks for files that have settled
_OWN = (".parquet", ".json", ".html", ".toml", ".md", ".png", ".svg", ".pdf", ".ipynb")
_STROKES = {"rebound": "rebound", "bump": "compression"}


class Arrival(NamedTuple):
    """One log, and what came of it."""

    path: Path  # the log
    run: Run | None  # its fit; None: it is refused, could not be fitted or is a copy
    sentence: str  # the answer in one line
    verdict: str  # good, the names of its warnings, or why there is no fit
    # Rebound and compression at the fastest named speed that was tested, with their difference
    # from the reference.
    forces: tuple[dict[str, Any], ...] = ()
    remarks: tuple[str, ...] = ()  # in what it is unlike the reference

    def __repr__(self) -> str:
        return self.sentence

    def document(self) -> dict[str, Any]:
        """Return all of it as JSON values; what is not known is null."""
        found = () if self.run is None else self.run.settings[:1]
        document: dict[str, Any] = json_values(
            {
                "log": str(self.path),
                "sentence": self.sentence,
                "is_fitted": self.run is not None,
                "verdict": self.verdict,
                "setting": found[0].setting if found else None,
                "mse_percent": found[0].mse_percent if found else None,
                "grade": found[0].grade if found else None,
                "parameters": dict(found[0].values) if found else None,
                "forces": list(self.forces),
                "remarks": list(self.remarks),
            }
        )
        return document


def arrivals(folder: Path, own: Path | None, stop: Event) -> Iterator[list[Path]]:
    """Yield the logs of a folder that are complete and new or changed, until the event is set.

    An empty list is yielded when nothing has come for a moment. What was there before comes first;
    nothing in the folder of the results, `own`, is a log.
    """
    try:
        from watchfiles import watch
    except ImportError:
        raise InstallationError(
            "watch needs watchfiles, which is not installed: pip install 'damperfit[watch]'",
            code="missing-library",
        ) from None

    def is_log(path: Path) -> bool:
        hidden = any(part.startswith(".") for part in path.relative_to(folder).parts)
        is_own = own is not None and path.is_relative_to(own)
        return not hidden and path.suffix.lower() not in _OWN and not is_own

    seen: dict[Path, tuple[int, int]] = {}
    waiting = {path: time.monotonic() for path in folder.rglob("*") if is_log(path)}
    for changes in watch(
        folder, stop_event=stop, rust_timeout=_POLL, yield_on_timeout=True, raise_interrupt=True,
        debounce=_POLL, step=_POLL // 2,
    ):  # fmt: skip
        if not folder.is_dir():
            raise DamperfitError("the watched folder is gone", subject=folder, code="no-folder")
        now = time.monotonic()
        paths = (type(folder)(name) for _, name in changes)
        waiting |= {path: now for path in paths if path.is_relative_to(folder) and is_log(path)}
        done = []
        for path in [path for path, at in waiting.items() if now - at >= _SETTLED]:
            del waiting[path]
            try:
                state = path.stat()
            except OSError:
                continue
            known = (state.st_size, state.st_mtime_ns)
            if path.is_file() and state.st_size and seen.get(path) != known:
                seen[path] = known
                done.append((state.st_mtime_ns, path))
        yield [path for _, path in sorted(done)]


def answers(
    folder: Path,
    own: Path | None,
    stop: Event,
    fit: Callable[[Path], Run],
    reference: Run | None,
) -> Iterator[Arrival | None]:
    """Yield what comes of each log of a folder; None when nothing has come for a moment."""
    first: dict[str, Path] = {}  # by content
    for paths in arrivals(folder, own, stop):
        for path in paths:
            name = str(path.relative_to(folder))
            try:
                original = first.setdefault(sha256_of(path), path)
            except OSError:  # it has gone
                continue
            if original != path and original.exists():
                why = f"the same log as {original.relative_to(folder)}; not fitted again"
                yield Arrival(path, None, f"{name}: {why}", why)
                continue
            yield _answered(path, fit, reference, name)
        if not paths:
            yield None


def _answered(path: Path, fit: Callable[[Path], Run], reference: Run | None, name: str) -> Arrival:
    """Good or why not, forces, and the difference from a reference."""
    run = None
    try:
        run = fit(path)
        why = "; ".join(run.failures) or ("" if run.settings else "no setting was fitted")
    except DamperfitError as error:
        problems = [one.problem for one in error.failures] or [error.problem]
        why = "; ".join(one.message() for one in problems)
    if run is None or why:
        return Arrival(path, None, f"{name}: {why}", why)
    findings = (finding for log in run.record["inputs"] for finding in log.get("findings", ()))
    warnings = [str(one["name"]) for one in findings if one.get("severity") == "warning"]
    verdict = f"warning: {', '.join(dict.fromkeys(warnings))}" if warnings else "good"
    setting = run.settings[0]
    rows = [dict(row) for row in run.rows("adjustment") if row["force_N"] is not None]
    fastest = max((row["speed_m_per_s"] for row in rows), default=0.0)
    forces = tuple(
        {name: row[name] for name in ("stroke", "speed_m_per_s", "force_N", "origin")}
        for row in rows
        if row["speed_m_per_s"] == fastest
    )
    parts = [
        f"{name}: {verdict}",
        f"setting {setting.label}",
        f"MSE {setting.mse_percent:.3g} % {setting.grade}",
        *(f"{_STROKES[one['stroke']]} {one['force_N']:.0f} N" for one in forces),
    ]
    sentence = ", ".join(parts) + (f" at {fastest:g} m/s" if forces else "")
    remarks = () if reference is None else tuple(unlike(run, reference))
    if reference is not None:
        sentence += "; " + "; ".join([_compared(forces, reference, setting.label), *remarks])
    return Arrival(path, run, sentence, verdict, forces, remarks)


def _compared(forces: tuple[dict[str, Any], ...], reference: Run, label: str) -> str:
    """Put the change from the reference into the forces, and say it."""
    known = {
        (row["stroke"], round(row["speed_m_per_s"], 6)): row["force_N"]
        for row in reference.rows("adjustment")
        if str(row["setting"]) == label and row["force_N"]
    }
    for row in forces:
        before = known.get((row["stroke"], round(row["speed_m_per_s"], 6)))
        row["change_percent"] = before and 100.0 * (row["force_N"] / before - 1.0)
    changes = [f"{row['change_percent']:+.2g} %" for row in forces if row["change_percent"]]
    if not changes:
        return f"setting {label} is not in {reference.name} at this speed"
    return f"{', '.join(changes)} beside {reference.name}"
