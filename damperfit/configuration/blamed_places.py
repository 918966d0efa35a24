"""Where a mistake was typed that only shows when values meet, or in the library below."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any, Protocol

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

__all__ = ["with_place"]

# What the options of the layers below call the facts of a rig.
_OF_RIG = "rig_"


class _Layer(Protocol):
    values: Mapping[str, Any]

    def name_of(self, section: str, key: str) -> str: ...


def with_place(message: str, layers: Sequence[_Layer]) -> str:
    """Return a mistake with the place of the key that it names, else of the value that it quotes.

    Parameters
    ----------
    message : str
        As in "steadiness: found 2, expected ...".
    layers : sequence
        What was typed: each has `values` by section and `name_of` a key; the last goes first.
    """
    named = re.match(r"(\w+): ", message)
    for layer in reversed(layers):
        for section, key in _keys_called(named[1]) if named else ():
            values = layer.values.get(section)
            if isinstance(values, dict) and key in values:
                return f"{layer.name_of(section, key)}: {message.partition(': ')[2]}"
    quoted = {word for pair in re.findall(r"'([^']*)'|= (\S+?):", message) for word in pair if word}
    for layer in reversed(layers):
        for section, values in layer.values.items():
            for key, value in values.items():
                if quoted & set(_leaves(value)):
                    return f"{layer.name_of(section, key)}: {message}"
    return message


def _keys_called(name: str) -> Iterator[tuple[str, str]]:
    """Yield the keys that options of the layers below may mean by a name."""
    if name.startswith(_OF_RIG):
        yield "rig", name.removeprefix(_OF_RIG)
    for section in ("conditioning", "rig", "identification", "simulation"):
        yield section, name


def _leaves(value: object) -> Iterator[str]:
    """Yield the texts that a value consists of, keys too."""
    if isinstance(value, dict):
        for key, item in value.items():
            yield from (str(key), *_leaves(item))
    elif isinstance(value, list | tuple):
        for item in value:
            yield from _leaves(item)
    else:
        yield str(value)
