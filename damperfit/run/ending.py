"""How a run ends, and what a run that only reads says.

Apart from `run_json`, which loads what fitted.
"""

from __future__ import annotations

import json
from enum import Enum
from math import isfinite
from typing import TYPE_CHECKING, Any

from damperfit.tested.setting import Setting

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from damperfit.run.logs import LogBatch, LogFacts

__all__ = [
    "Ending",
    "json_pieces",
    "json_values",
    "log_documents",
    "log_input",
    "reading_ending",
]

_PLAIN = frozenset({int, str, bool, type(None)})
_ENCODER = json.JSONEncoder(ensure_ascii=False, allow_nan=False)


class Ending(Enum):
    """How a run ended; the value is the exit code of the command."""

    COMPLETE = 0
    SOME_FAILED = 1
    ALL_FAILED = 3
    GATE_MISSED = 4
    INTERRUPTED = 130


def log_documents(batch: LogBatch) -> dict[str, Any]:
    """Return what `inspect` tells, as JSON values."""
    document: dict[str, Any] = json_values(
        {
            "logs": [log_input(log) for log in batch.logs],
            "skipped": list(batch.skipped),
            "failures": [failure.describe() for failure in batch.failures],
        }
    )
    return document


def reading_ending(batch: LogBatch) -> Ending:
    """Return how reading alone ended."""
    if any(not failure.is_left_out for failure in batch.failures):
        return Ending.SOME_FAILED if batch.n_good else Ending.ALL_FAILED
    return Ending.GATE_MISSED if batch.failures else Ending.COMPLETE


def log_input(log: LogFacts) -> dict[str, Any]:
    """Return a log as the file of the run lists it."""
    facts = {key: value for key, value in log.facts.items() if key != "name"}
    return {"log": log.log, "path": log.path, "sha256": log.sha256, **facts}


def json_values(value: Any) -> Any:
    """Return the value with every number that JSON does not know (NaN, infinity) as None."""
    if type(value) in _PLAIN:  # with numbers, lists and dictionaries of them nearly all there is
        return value
    if isinstance(value, float):
        return value if isfinite(value) else None
    # A number asks for no call: of some hundred settings there are a hundred thousand.
    if isinstance(value, dict):
        return {
            str(key): one
            if (kind := type(one)) in _PLAIN or (kind is float and isfinite(one))
            else json_values(one)
            for key, one in value.items()
        }
    if isinstance(value, list | tuple):
        return [
            one
            if (kind := type(one)) in _PLAIN or (kind is float and isfinite(one))
            else json_values(one)
            for one in value
        ]
    return value.cell if isinstance(value, Setting) else value


def json_pieces(document: Mapping[str, Any]) -> Iterator[str]:
    """Yield JSON values as text, piece by piece: what is listed has a line for each entry.

    Of some hundred settings the usual layout, every number on a line, costs more time than all else
    that is in the file; as one text it would take more memory than all else.

    Examples
    --------
    >>> print("".join(json_pieces({"a": [{"b": 1, "c": [2]}, {"b": 3}], "d": {"e": [4]}})), end="")
    {
      "a": [
        {"b": 1, "c": [2]},
        {"b": 3}
      ],
      "d": {
        "e": [4]
      }
    }
    """
    yield from _laid_out(document, "\n")
    yield "\n"


def _laid_out(value: Any, line: str) -> Iterator[str]:
    deeper = line + "  "
    if isinstance(value, dict) and value:
        for place, (key, one) in enumerate(value.items()):
            yield ("," if place else "{") + deeper + f"{_ENCODER.encode(key)}: "
            yield from _laid_out(one, deeper)
        yield line + "}"
    elif isinstance(value, list) and any(isinstance(one, dict) for one in value):
        for place, one in enumerate(value):
            yield ("," if place else "[") + deeper
            yield _ENCODER.encode(one)
        yield line + "]"
    else:
        yield _ENCODER.encode(value)
