"""A folder watched while a rig writes into it: each new log is fitted and answered in one line."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from damperfit.adjustment.force_at import STROKE_WORDS
from damperfit.after_fit.valves import unlike
from damperfit.api import identify
from damperfit.errors import DamperfitError, InstallationError
from damperfit.io.files import sha256_of
from damperfit.problem import findings_in
from damperfit.tables.files import json_values

if TYPE_CHECKING:
    from threading import Event

    from damperfit.results import Run

_SETTLED = 0.3  # s without a change: the rig has closed the log
_POLL = 100  # ms between looks for files that have settled
_OWN = (".parquet", ".json", ".html", ".toml", ".md", ".png", ".svg", ".pdf", ".ipynb")
_SHOWN = ("stroke", "speed_m_per_s", "force_N", "origin")


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
        first = self.run and self.run.settings[0]
        known: dict[str, Any] = {"log": str(self.path), "is_fitted": first is not None}
        for name in ("setting", "mse_percent", "grade"):
            known[name] = first and getattr(first, name)
        known["parameters"] = first and dict(first.values)
        known |= {
            name: getattr(self, name) for name in ("sentence", "verdict", "forces", "remarks")
        }
        document: dict[str, Any] = json_values(known)
        return document


def watched(
    folder: Path, out: Path | None, reference: Run | None, config: Path | None, stop: Event
) -> Iterator[Arrival]:
    """Yield what comes of each log; the results of all are written whenever no log waits."""
    fitted: dict[Path, None] = {}
    first: dict[str, Path] = {}  # by content
    is_stale = False

    def write() -> None:
        logs = [path for path in fitted if path.exists()]
        if is_stale and logs:
            identify(logs, config=config, out=out, report=True)

    try:
        for paths in _arrivals(folder, None if out is None else out.resolve(), stop):
            for path in paths:
                name = str(path.relative_to(folder))
                try:
                    original = first.setdefault(sha256_of(path), path)
                except OSError:  # it has gone
                    continue
                fitted.pop(path, None)
                if original != path and original.exists():
                    why = f"the same log as {original.relative_to(folder)}; not fitted again"
                    yield Arrival(path, None, f"{name}: {why}", why)
                    continue
                arrival = _answered(path, config, reference, name)
                if arrival.run is not None:
                    fitted[path] = None
                    is_stale = out is not None
                yield arrival
            if not paths:
                write()
                is_stale = False
    except KeyboardInterrupt:
        pass
    finally:
        write()


def _arrivals(folder: Path, own: Path | None, stop: Event) -> Iterator[list[Path]]:
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
        now, done = time.monotonic(), []
        paths = (Path(name) for _, name in changes)
        waiting |= {path: now for path in paths if path.is_relative_to(folder) and is_log(path)}
        for path in [path for path, at in waiting.items() if now - at >= _SETTLED]:
            del waiting[path]
            with suppress(OSError):
                state = path.stat()
                known = (state.st_size, state.st_mtime_ns)
                if path.is_file() and state.st_size and seen.get(path) != known:
                    seen[path] = known
                    done.append((state.st_mtime_ns, path))
        yield [path for _, path in sorted(done)]


def _answered(path: Path, config: Path | None, reference: Run | None, name: str) -> Arrival:
    """Good or why not, forces, and the difference from a reference."""
    run = None
    try:
        run = identify([path], config=config)
        why = "; ".join(run.failures)
    except DamperfitError as error:
        problems = [failure.problem for failure in error.failures] or [error.problem]
        why = "; ".join(problem.message() for problem in problems)
    if run is None or why:
        return Arrival(path, None, f"{name}: {why}", why)
    findings = (finding for log in run.record["inputs"] for finding in findings_in(log))
    warnings = dict.fromkeys(f.code for f in findings if f.severity == "warning")
    verdict = f"warning: {', '.join(warnings)}" if warnings else "good"
    setting = run.settings[0]
    rows = [row for row in run.rows("adjustment") if row["force_N"] is not None]
    fastest = max((row["speed_m_per_s"] for row in rows), default=0.0)
    rows = [row for row in rows if row["speed_m_per_s"] == fastest]
    forces = tuple({key: row[key] for key in _SHOWN} for row in rows)
    fit = f"MSE {setting.mse_percent:.3g} % {setting.grade}"
    shown = [f"{STROKE_WORDS[row['stroke']]} {row['force_N']:.0f} N" for row in forces]
    sentence = ", ".join((f"{name}: {verdict}", f"setting {setting.label}", fit, *shown))
    sentence += f" at {fastest:g} m/s" * bool(forces)
    if reference is None:
        return Arrival(path, run, sentence, verdict, forces)
    known = {
        (str(row["setting"]), row["stroke"], round(row["speed_m_per_s"], 6)): row["force_N"]
        for row in reference.rows("adjustment")
    }
    for row in forces:
        before = known.get((setting.label, row["stroke"], round(fastest, 6)))
        row["change_percent"] = before and 100.0 * (row["force_N"] / before - 1.0)
    changes = [f"{row['change_percent']:+.2g} %" for row in forces if row["change_percent"]]
    beside = f"setting {setting.label} is not in {reference.name} at this speed"
    if changes:
        beside = f"{', '.join(changes)} beside {reference.name}"
    remarks = tuple(unlike(run, reference))
    return Arrival(path, run, "; ".join((sentence, beside, *remarks)), verdict, forces, remarks)
