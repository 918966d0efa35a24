"""Logs as a notebook has them: paths, patterns, data frames and arrays; recordings and traces."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Mapping
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

from damperfit.errors import ConfigurationError, LogError
from damperfit.recording import Recording, Trace

if TYPE_CHECKING:
    from collections.abc import Iterator

    import pandas as pd

    from damperfit.conditioning import ConditionOptions


_EXPECTED = (
    "expected paths or patterns, or a mapping of labels to data frames, such as "
    "{'R12 C8': frame} with columns time_s, displacement_mm and force_N"
)


@contextmanager
def as_files(logs: object, *, call: str) -> Iterator[list[str]]:
    """Yield paths of logs, whatever they were given as.

    Frames are written to a temporary folder, with a table that says the setting of each; its label
    is the setting's. The folder goes when the block ends.

    Parameters
    ----------
    logs : path, pattern, data frame, or an iterable or mapping of such
        What the user gave.
    call : str
        The function, for the message.

    Raises
    ------
    ConfigurationError
        It is nothing of the kind.
    LogError
        A frame has columns of different lengths, or none.
    """
    several = logs if isinstance(logs, list | tuple) else (logs,)
    if any(isinstance(one, str) and not one for one in several):  # it would be this folder
        raise ConfigurationError(f"found ''; {_EXPECTED}")
    if isinstance(logs, str | os.PathLike):
        yield [os.fspath(logs)]
        return
    if isinstance(logs, Trace | Recording):
        raise ConfigurationError(f"found a {type(logs).__name__}; {_EXPECTED}")
    if _is_frame(logs):
        raise ConfigurationError(
            "found a data frame without a label; give {'10': frame}, where '10' is the "
            "setting of the adjuster",
        )
    if isinstance(logs, Mapping):
        with TemporaryDirectory(prefix="damperfit-frames-") as folder:
            yield _written(logs, Path(folder), call)
        return
    if not isinstance(logs, Iterable):
        raise ConfigurationError(f"found {type(logs).__name__}; {_EXPECTED}")
    paths = list(logs)
    for one in paths:
        if not isinstance(one, str | os.PathLike):
            raise ConfigurationError(
                f"found {type(one).__name__} in a list; {_EXPECTED}", subject=call
            )
    if not paths:
        raise ConfigurationError(f"found no log; {_EXPECTED}")
    yield [os.fspath(one) for one in paths]


def in_memory(logs: object, options: ConditionOptions) -> tuple[object, list[Trace]]:
    """Return what must be read yet, and what needs no reading: traces, recordings conditioned."""
    from damperfit.conditioning import condition

    if isinstance(logs, Trace | Recording):
        logs = [logs]
    if isinstance(logs, str | os.PathLike | Mapping) or not isinstance(logs, Iterable):
        return logs, []
    if _is_frame(logs):
        return logs, []
    listed = list(logs)
    ready = [one for one in listed if isinstance(one, Trace | Recording)]
    traces = [one if isinstance(one, Trace) else condition(one, options) for one in ready]
    return [one for one in listed if not isinstance(one, Trace | Recording)], traces


def _is_frame(value: object) -> bool:
    return hasattr(value, "columns") and hasattr(value, "to_dict")


def _written(frames: Mapping[Any, Any], folder: Path, call: str) -> list[str]:
    import csv

    from pyarrow import ArrowException

    if not frames:
        raise ConfigurationError(f"found no log; {_EXPECTED}", subject=call)
    rows = []
    for k, (label, value) in enumerate(frames.items()):
        frame = _frame(label, value, call)
        path = folder / f"{_file_name(str(label))}_{k}.parquet"
        try:
            frame.to_parquet(path, index=False)
        except (ValueError, TypeError, ArrowException) as error:
            raise LogError(
                f"the data frame cannot be read as a log: {error}", subject=label
            ) from error
        rows.append((path.name, str(label)))
    with (folder / "tests.csv").open("w", newline="", encoding="utf-8") as file:
        csv.writer(file).writerows([("file", "setting"), *rows])
    return [str(folder / name) for name, _ in rows]


def _file_name(label: str) -> str:
    return re.sub(r"[^A-Za-z0-9+-]+", "-", label).strip("-") or "log"


def _frame(label: object, value: object, call: str) -> pd.DataFrame:
    import numpy as np
    import pandas as pd

    if _is_frame(value) and isinstance(value, pd.DataFrame):
        frame = value
    elif isinstance(value, Mapping):
        if value and all(np.ndim(one) == 0 for one in value.values()):
            raise LogError("found single numbers; give columns of one length", subject=label)
        try:
            frame = pd.DataFrame(dict(value))
        except ValueError as error:
            raise LogError(f"{error}; give columns of one length", subject=label) from error
    else:
        raise ConfigurationError(
            f"{label!r} is of type {type(value).__name__}; {_EXPECTED}", subject=call
        )
    if not len(frame.columns):
        raise LogError(
            "the data frame has no columns; expected time, displacement, force", subject=label
        )
    # Where time is the index of a frame it is a column of a log.
    if frame.index.name is not None and frame.index.name not in frame.columns:
        frame = frame.reset_index()
    return frame.rename(columns=str)
