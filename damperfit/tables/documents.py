"""JSON documents: values that JSON knows, and text that is laid out a line an entry."""

from __future__ import annotations

import json
from math import isfinite
from typing import TYPE_CHECKING, Any

from damperfit.tested.setting import Setting

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping


_PLAIN = frozenset({int, str, bool, type(None)})
_ENCODER = json.JSONEncoder(ensure_ascii=False, allow_nan=False)


def json_values(value: Any) -> Any:
    """Return the value with every number that JSON does not know (NaN, infinity) as None."""
    if type(value) in _PLAIN:  # with numbers, lists and dictionaries of them nearly all there is
        return value
    if isinstance(value, float):
        return value if isfinite(value) else None
    if isinstance(value, dict):
        return {str(key): _json_value(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_json_value(item) for item in value]
    return value.cell if isinstance(value, Setting) else value


def _json_value(item: Any) -> Any:
    # A number asks for no more: of some hundred settings there are a hundred thousand.
    kind = type(item)
    return item if kind in _PLAIN or (kind is float and isfinite(item)) else json_values(item)


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
        for place, (key, item) in enumerate(value.items()):
            yield ("," if place else "{") + deeper + f"{_ENCODER.encode(key)}: "
            yield from _laid_out(item, deeper)
        yield line + "}"
    elif isinstance(value, list) and any(isinstance(item, dict) for item in value):
        for place, item in enumerate(value):
            yield ("," if place else "[") + deeper
            yield _ENCODER.encode(item)
        yield line + "]"
    else:
        yield _ENCODER.encode(value)
