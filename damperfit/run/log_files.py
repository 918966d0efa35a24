"""Which files a call means: paths, patterns, folders, lists, data frames; and which are our own."""

from __future__ import annotations

import csv
import glob
import os
import re
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

from damperfit.errors import ConfigurationError, LogError
from damperfit.io.files import open_regular, read_text, why_unread
from damperfit.io.formats import LOG_SUFFIXES
from damperfit.recording import Recording, Trace, natural_order
from damperfit.tables.columns import TABLES, column_kinds
from damperfit.units.quantities import units_of

if TYPE_CHECKING:
    import pandas as pd

    from damperfit.conditioning.options import ConditionOptions


# Paths and patterns


def expand(patterns: Iterable[str]) -> tuple[Path, ...]:
    """Return the files that paths and patterns name, each once, in natural order.

    A named file that does not exist is kept where others do: reading it fails, and costs it alone.
    So is a folder without logs; one of results is passed over, for the shell's ``*`` names it too.

    Raises
    ------
    ConfigurationError
        None of the files exists, or a pattern or a folder names none.
    """
    patterns = list(patterns)
    paths: dict[Path, Path] = {}
    for pattern in patterns:
        for path in matches(pattern, keeps_missing=True):
            paths.setdefault(real_path(path), path)
    if not any(_is_there(path) and not _is_folder(path) for path in paths.values()):
        for pattern in patterns:
            matches(pattern)  # raises with what is missing, and where it was named
    by_number = lambda path: (natural_order(path.name), natural_order(str(path)))  # noqa: E731
    return tuple(sorted(paths.values(), key=by_number))


def real_path(path: str | Path) -> Path:
    """Return a path without links; itself where that cannot be, as of a loop of links."""
    try:
        return Path(os.path.realpath(path))
    except (OSError, ValueError):  # the working folder is gone, or there is a NUL
        return Path(path)


def matches(pattern: str, *, keeps_missing: bool = False) -> list[Path]:
    """Return the files that a path, a pattern, a folder or ``@list.txt`` names.

    A folder stands for the logs in it, not below it: files with the suffix of a format that is
    read. A list has one path or pattern a line, relative to where the command is run; empty lines
    and those that begin with ``#`` count for nothing. With ``keeps_missing`` a named file that does
    not exist, or a folder without logs, is returned as well, for the reader to report.
    """
    if pattern == "":  # as a path it would be the folder that one is in
        raise ConfigurationError(
            "'': expected a file or folder; '.' is this folder", code="empty-name"
        )
    pattern = os.path.expanduser(pattern)  # noqa: PTH111 - a Path would raise on ~nobody
    path = Path(pattern)

    def refused(why: str, subject: str = pattern, code: str = "no-log") -> ConfigurationError:
        return ConfigurationError(why, subject=subject, code=code)

    if _is_folder(path):
        try:
            entries = sorted(path.iterdir())
        except OSError as error:
            raise refused(why_unread(error), str(path), "unreadable") from error
        names = {entry: entry.name.lower() for entry in entries if entry.name[0] != "."}
        logs = [e for e in names if names[e].endswith(LOG_SUFFIXES) and not _is_folder(e)]
        are_own = bool(logs) and all(map(is_own_table, logs))
        if logs and not are_own:
            return logs
        if keeps_missing:
            return [] if are_own else [path]
        if are_own:
            why = "contains only files that damperfit wrote; give the folder with the logs"
            raise refused(why, str(path))
        why = (
            "no log in this folder; expected files such as .csv, .txt, .xlsx, .mat or .tdms; for "
            f"logs in its subfolders give {path}/*/*.csv"
        )
        raise refused(why, str(path))
    if _is_there(path):
        return [path]
    if pattern.startswith("@"):
        return _listed(pattern, keeps_missing=keeps_missing)
    if any(c in pattern for c in "*?["):
        hits = [Path(hit) for hit in glob.glob(pattern, recursive=True)]
        if files := [hit for hit in hits if not _is_folder(hit)]:
            return files
        inside = f"{pattern.rstrip('/')}/*.csv"
        why = f"the pattern matches only folders; for the logs in them give {inside}"
        raise refused(why if hits else "the pattern matches no file")
    if keeps_missing and pattern.strip():
        return [path]
    if pattern == "-":
        raise refused("-: logs are not read from a pipe; give files, or write one first", "")
    raise refused("no such file", code="no-such-file")


def _listed(pattern: str, *, keeps_missing: bool) -> list[Path]:
    path = Path(pattern[1:])
    try:
        lines = read_text(path).splitlines()
    except (OSError, ValueError) as error:
        why = f"the list {path}: {why_unread(error)}"
        raise ConfigurationError(why, subject=pattern, code="no-log") from error
    paths: list[Path] = []
    for number, line in enumerate(lines, start=1):
        text = line.strip()
        if not text or text.startswith("#"):
            continue
        if text.startswith("@"):
            raise ConfigurationError(
                f"{path}:{number}: a list in a list is not followed: {text}", code="list-in-list"
            )
        try:
            paths += matches(text, keeps_missing=keeps_missing)
        except ConfigurationError as error:
            raise ConfigurationError(
                f"{path}:{number}: {error}; paths in a list count from where the command is run",
                code="no-such-file",
            ) from error
    if not paths:
        raise ConfigurationError("the list names no log", subject=pattern, code="no-log")
    return paths


def _is_folder(path: Path) -> bool:
    with suppress(OSError, ValueError):
        return path.is_dir()
    return False


def _is_there(path: Path) -> bool:
    """Whether there is a file, or access is denied: then reading it says so."""
    try:
        path.lstat()
    except PermissionError:
        return True
    except (OSError, ValueError):
        return False
    return True


# What damperfit has written itself, so that its results are not fitted as if measured

_SPEEDS = [f"setting,speed_{unit.replace('/', '_per_')}," for unit in units_of("velocity")]
_OTHERS = {"responses", "adjustment"}  # no CSV; one in units of people
# How the tables in CSV begin, as far as their settings are of one adjuster.
_HEADINGS = tuple(
    text.encode()
    for text in (
        *(",".join([*column_kinds(table)][:3]) for table in TABLES if table not in _OTHERS),
        "serial,damper,date,setting,",
        *(speed + column for speed in _SPEEDS for column in ("stroke,", "force_")),
    )
)
# How a line of --log-file begins: time with zone, level, process.
_LOGGED = re.compile(
    rb"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d\.\d{3}[+-]\d\d:\d\d [A-Z]+ +damperfit\[\d+\] "
)
# How the text files of `export` that end as logs do begin: about the tables, tables of simulators.
_EXPORTED = re.compile(rb"(?:#1\n# |#INFOFILE[^\n]*\n## )?damperfit [^\n:]+: results, setting ")
_UNIT = re.compile(rb" \[[^\],;\n]*\]")  # behind a heading, as `export` writes it
_BEGIN = 256  # bytes; no heading is longer, and no beginning of a line of --log-file


def is_own_table(path: Path) -> bool:  # noqa: PLR0911 - one a kind of file
    """Whether a file is a table of results, by what it says of itself; run.json is one too.

    So is what --log-file wrote, and what `export` wrote of tables and text.
    """
    if path.suffix in {".md", ".html"}:  # a report
        path = path.with_name("run.json")
    try:
        if not path.is_file():
            return False
        with open_regular(path) as file:
            begin = file.read(4096 if path.name == "run.json" else _BEGIN)
    except OSError:
        return False
    if begin.startswith(b"PAR1"):
        import pyarrow as pa
        import pyarrow.parquet as pq

        try:
            return b"damperfit" in (pq.read_schema(path).metadata or {})
        except (OSError, pa.ArrowInvalid):
            return False  # whoever reads it says what is wrong
    if path.name == "run.json":
        return b'"schema_version"' in begin
    heading = _UNIT.sub(b"", begin.partition(b"\n")[0]).replace(b";", b",")
    if _LOGGED.match(begin) or _EXPORTED.match(begin) or heading.startswith(_HEADINGS):
        return True
    # A setting and quantities of a model: results, or truth.
    first, *columns = heading.decode("ascii", "replace").split(",")[:3]
    if first != "setting" or len(columns) < 2:
        return False
    from damperfit.damper.model import MODELS

    names = {quantity.name for kind in MODELS.values() for quantity in kind().quantities}
    return columns[0] in names and columns[1].strip() in names


def is_own_log_file(path: Path) -> bool:
    """Whether a file begins as --log-file writes it; an OSError: it cannot be read."""
    with open_regular(path) as file:
        return _LOGGED.match(file.read(_BEGIN)) is not None


# What Python gives: paths, patterns, data frames and arrays; recordings and traces

_EXPECTED = (
    "expected paths or patterns, or a mapping of labels to data frames, such as "
    "{'R12 C8': frame} with columns time_s, displacement_mm and force_N"
)


@contextmanager
def as_files(logs: object, *, call: str) -> Iterator[list[str]]:
    """Yield paths of logs, whatever they were given as; ``call`` is the function, for the message.

    Frames are written to a temporary folder, with a table that says the setting of each; its label
    is the setting's. The folder goes when the block ends.
    """
    if isinstance(logs, Mapping) and logs:
        with TemporaryDirectory(prefix="damperfit-frames-") as folder:
            yield _written(logs, Path(folder), call)
        return
    if isinstance(logs, str | os.PathLike):
        logs = [logs]

    def refused(text: str, code: str = "not-a-log", subject: str = "") -> ConfigurationError:
        return ConfigurationError(text, subject=subject, code=code)

    if isinstance(logs, Trace | Recording) or not isinstance(logs, Iterable):
        raise refused(f"found {type(logs).__name__}; {_EXPECTED}")
    if _is_frame(logs):
        text = (
            "found a data frame without a label; give {'10': frame}, where '10' is the setting of "
            "the adjuster"
        )
        raise refused(text, "no-setting")
    paths = list(logs)
    if not paths:
        raise refused(f"found no log; {_EXPECTED}", "no-log")
    for path in paths:
        if not isinstance(path, str | os.PathLike):
            raise refused(f"found {type(path).__name__} in a list; {_EXPECTED}", subject=call)
        if path == "":  # it would be this folder
            raise refused(f"found ''; {_EXPECTED}", "empty-name")
    yield [os.fspath(path) for path in paths]


def in_memory(logs: object, options: ConditionOptions) -> tuple[object, list[Trace]]:
    """Return what must be read yet, and what needs no reading: traces, recordings conditioned."""
    from damperfit.conditioning.log_to_trace import condition

    if isinstance(logs, Trace | Recording):
        logs = [logs]
    is_whole = isinstance(logs, str | os.PathLike | Mapping) or _is_frame(logs)
    if is_whole or not isinstance(logs, Iterable):
        return logs, []
    items = list(logs)
    traces = [log for log in items if isinstance(log, Trace | Recording)]
    unread = [log for log in items if not isinstance(log, Trace | Recording)]
    return unread, [log if isinstance(log, Trace) else condition(log, options) for log in traces]


def _is_frame(value: object) -> bool:
    return hasattr(value, "columns") and hasattr(value, "to_dict")


def _written(frames: Mapping[Any, Any], folder: Path, call: str) -> list[str]:
    from pyarrow import ArrowException

    rows = []
    for k, (label, value) in enumerate(frames.items()):
        stem = re.sub(r"[^A-Za-z0-9+-]+", "-", str(label)).strip("-") or "log"
        path = folder / f"{stem}_{k}.parquet"
        try:
            _frame(label, value, call).to_parquet(path, index=False)
        except (ValueError, TypeError, ArrowException) as error:
            raise LogError(
                f"the data frame cannot be read as a log: {error}", subject=label, code="unreadable"
            ) from error
        rows.append((path.name, str(label)))
    with (folder / "tests.csv").open("w", newline="", encoding="utf-8") as file:
        csv.writer(file).writerows([("file", "setting"), *rows])
    return [str(folder / name) for name, _ in rows]


def _frame(label: object, value: object, call: str) -> pd.DataFrame:
    import numpy as np
    import pandas as pd

    if not isinstance(value, pd.DataFrame | Mapping):
        raise ConfigurationError(
            f"{label!r} is of type {type(value).__name__}; {_EXPECTED}",
            subject=call,
            code="not-a-log",
        )

    def no_data(text: str) -> LogError:
        return LogError(text, subject=label, code="no-data")

    if isinstance(value, Mapping):
        if value and all(np.ndim(column) == 0 for column in value.values()):
            raise no_data("found single numbers; give columns of one length")
        try:
            value = pd.DataFrame(dict(value))
        except ValueError as error:
            raise no_data(f"{error}; give columns of one length") from error
    frame: pd.DataFrame = value
    if not len(frame.columns):
        raise no_data("the data frame has no columns; expected time, displacement, force")
    # Where time is the index of a frame it is a column of a log.
    if frame.index.name is not None and frame.index.name not in frame.columns:
        frame = frame.reset_index()
    return frame.rename(columns=str)
