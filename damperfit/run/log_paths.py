"""Paths and patterns of a command line to files."""

from __future__ import annotations

import glob
import os
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

from damperfit.errors import ConfigurationError
from damperfit.io.files import read_text
from damperfit.io.formats import LOG_SUFFIXES
from damperfit.recording import natural_order
from damperfit.run.own_tables import is_own_table

if TYPE_CHECKING:
    from collections.abc import Iterable


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
    found: dict[Path, Path] = {}
    for pattern in patterns:
        for path in matches(pattern, keeps_missing=True):
            found.setdefault(real_path(path), path)
    if not any(_is_there(path) and not _is_folder(path) for path in found.values()):
        for pattern in patterns:
            matches(pattern)  # raises with what is missing, and where it was named
    return tuple(sorted(found.values(), key=_by_number))


def real_path(path: str | Path) -> Path:
    """Return a path without links; itself where that cannot be, as of a loop of links."""
    try:
        return Path(os.path.realpath(path))
    except (OSError, ValueError):  # the working folder is gone, or there is a NUL
        return Path(path)


def _by_number(path: Path) -> tuple[object, ...]:
    return natural_order(path.name), natural_order(str(path))


def matches(pattern: str, *, keeps_missing: bool = False) -> list[Path]:
    """Return the files that a path, a pattern, a folder or ``@list.txt`` names.

    A folder stands for the logs in it, not below it: files with the suffix of a format that is
    read. A list has one path or pattern a line, relative to where the command is run; empty lines
    and those that begin with ``#`` count for nothing.

    Parameters
    ----------
    pattern : str
        As given.
    keeps_missing : bool
        Return a named file that does not exist, or a folder without logs, as well, for the reader
        to report; nothing of a folder of results.

    Raises
    ------
    ConfigurationError
        There is none.
    """
    if pattern == "":  # as a path it would be the folder that one is in
        raise ConfigurationError("'': expected a file or folder; '.' is this folder")
    pattern = os.path.expanduser(pattern)  # noqa: PTH111 - a Path would raise on ~nobody
    path = Path(pattern)
    if _is_folder(path):
        return _logs_in(path, keeps_missing=keeps_missing)
    if _is_there(path):
        return [path]
    if pattern.startswith("@"):
        return _listed(pattern, keeps_missing=keeps_missing)
    if any(c in pattern for c in "*?["):
        hits = [Path(hit) for hit in glob.glob(pattern, recursive=True)]
        files = [hit for hit in hits if not _is_folder(hit)]
        if hits and not files:
            raise ConfigurationError(
                f"the pattern matches only folders; for the logs in them give "
                f"{pattern.rstrip('/')}/*.csv",
                subject=pattern,
            )
        if not files:
            raise ConfigurationError("the pattern matches no file", subject=pattern)
        return files
    if keeps_missing and pattern.strip():
        return [path]
    if pattern == "-":
        raise ConfigurationError("-: logs are not read from a pipe; give files, or write one first")
    raise ConfigurationError("no such file", subject=pattern, code="no-such-file")


def _logs_in(folder: Path, *, keeps_missing: bool) -> list[Path]:
    try:
        entries = sorted(folder.iterdir())
    except OSError as error:
        raise ConfigurationError(
            f"cannot be read: {error.strerror or error}", subject=folder
        ) from error
    names = (one for one in entries if one.name[0] != "." and not _is_folder(one))
    found = [one for one in names if one.name.lower().endswith(LOG_SUFFIXES)]
    if found and all(map(is_own_table, found)):
        if keeps_missing:
            return []
        raise ConfigurationError(
            "contains only files that damperfit wrote; give the folder with the logs",
            subject=folder,
        )
    if not found:
        if keeps_missing:
            return [folder]
        raise ConfigurationError(
            f"no log in this folder; expected files such as "
            f".csv, .txt, .xlsx, .mat or .tdms; for logs in its subfolders give {folder}/*/*.csv",
            subject=folder,
        )
    return found


def _listed(pattern: str, *, keeps_missing: bool) -> list[Path]:
    path = Path(pattern[1:])
    try:
        lines = read_text(path).splitlines()
    except (OSError, ValueError) as error:
        said = getattr(error, "strerror", None) or error
        raise ConfigurationError(
            f"the list {path} cannot be read: {said}", subject=pattern
        ) from error
    found: list[Path] = []
    for number, line in enumerate(lines, start=1):
        text = line.strip()
        if not text or text.startswith("#"):
            continue
        if text.startswith("@"):
            raise ConfigurationError(f"{path}:{number}: a list in a list is not followed: {text}")
        try:
            found += matches(text, keeps_missing=keeps_missing)
        except ConfigurationError as error:
            raise ConfigurationError(
                f"{path}:{number}: {error}; paths in a list count from where the command is run"
            ) from error
    if not found:
        raise ConfigurationError("the list names no log", subject=pattern)
    return found


def _is_folder(path: Path) -> bool:
    with suppress(OSError, ValueError):
        return path.is_dir()
    return False


def _is_there(path: Path) -> bool:
    """Whether there is a file, or nobody may look: then reading it says so."""
    try:
        path.lstat()
    except PermissionError:
        return True
    except (OSError, ValueError):
        return False
    return True
