"""The summary page of a job on GitHub Actions."""

from __future__ import annotations

import os
from pathlib import Path

from damperfit.errors import ConfigurationError, OutputError
from damperfit.problem import Option

__all__ = ["append_summary", "summary_file"]

_MOST_BYTES = 1_000_000


def summary_file() -> Path:
    """Return where GitHub Actions collects the summary of a job.

    Raises
    ------
    ConfigurationError
        This is none of its jobs.
    """
    name = os.environ.get("GITHUB_STEP_SUMMARY", "")
    if not name:
        raise ConfigurationError(
            "GITHUB_STEP_SUMMARY is not set; it is only inside GitHub Actions",
            where=Option("github_summary"),
        )
    return Path(name)


def append_summary(path: Path, report: str, *, instead: str) -> None:
    """Add Markdown to the summary of a job; of what is too long only a line that says so.

    Raises
    ------
    OutputError
        It cannot be written.
    """
    text = report.encode("utf-8", "backslashreplace")
    try:
        with path.open("ab") as file:
            # Actions refuses a step's summary above 1 MiB as a whole.
            file.write(text if len(text) < _MOST_BYTES else f"{instead}\n".encode())
    except OSError as error:
        raise OutputError(
            f"cannot write {path}: {error.strerror}", where=Option("github_summary")
        ) from error
