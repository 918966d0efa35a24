"""Paths and patterns of a command line to files."""

from __future__ import annotations

import glob
from contextlib import suppress
from pathlib import Path

from damperfit.errors import ConfigurationError

__all__ = ["matches"]


def matches(pattern: str) -> list[Path]:
    """Return the files that a path or pattern names.

    Raises
    ------
    ConfigurationError
        There is none, or it is a folder.
    """
    path = Path(pattern)
    if _is_folder(path):
        raise ConfigurationError(f"{pattern}: is a folder; name the logs in it, as in {path}/*.csv")
    if _may_exist(path):
        return [path]
    if any(c in pattern for c in "*?["):
        hits = [Path(hit) for hit in glob.glob(pattern, recursive=True)]
        files = [hit for hit in hits if not _is_folder(hit)]
        if not files:
            raise ConfigurationError(f"{pattern}: the pattern matches no file")
        return files
    raise ConfigurationError(f"{pattern}: no such file")


def _is_folder(path: Path) -> bool:
    with suppress(OSError, ValueError):
        return path.is_dir()
    return False


def _may_exist(path: Path) -> bool:
    """Whether there is a file, or nobody may look: then reading it says so."""
    try:
        path.lstat()
    except PermissionError:
        return True
    except (OSError, ValueError):
        return False
    return True
