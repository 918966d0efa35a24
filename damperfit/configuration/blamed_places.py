"""Where a mistake was typed that only shows when values meet, or in the library below."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any, Protocol

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

__all__ = ["section_explained", "with_place"]

# What the options of the layers below call the facts of a rig.
_OF_RIG = "rig_"
# Words of a mistake about a quantity, and the keys of [identification] that it may be typed in.
_SAID_OF = {"a start": "start_values", "shared": "share", "free": "free", "fixed": "fix"}


class _Layer(Protocol):
    values: Mapping[str, Any]
    options: Mapping[str, str]

    def place(self, *keys: str) -> str: ...

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
    blamed = _numbers_blamed(message)
    for layer in reversed(layers):
        for key in blamed[1:]:
            if blamed[0] in layer.values.get("identification", {}).get(key, ()):
                return f"{layer.name_of('identification', key)}: {message}"
    quoted = {word for pair in re.findall(r"'([^']*)'|= (\S+?):", message) for word in pair if word}
    for layer in reversed(layers):
        for section, values in layer.values.items():
            for key, value in values.items():
                if quoted & set(_leaves(value)):
                    return f"{layer.name_of(section, key)}: {message}"
    return message


def _numbers_blamed(message: str) -> tuple[str, ...]:
    """The quantity that a mistake is about and the keys that may name it, the likeliest first."""
    about = re.match(r"(\w+)(?: = \S+)? (?:is|follows) ", message)
    return (
        (about[1], *(key for word, key in _SAID_OF.items() if word in message)) if about else ("",)
    )


def _keys_called(name: str) -> Iterator[tuple[str, str]]:
    """Yield the keys that options of the layers below may mean by a name."""
    if name.startswith(_OF_RIG):
        yield "rig", name.removeprefix(_OF_RIG)
    for section in ("conditioning", "rig", "identification", "simulation", "damper"):
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


def section_explained(section: str, reason: str, layers: Sequence[_Layer]) -> str:
    """Return why values of a section do not go together, with the place of the one to blame.

    Parameters
    ----------
    section : str
        As in "damper".
    reason : str
        As in "rod_diameter: expected less than piston_diameter".
    layers : sequence
        The defaults first, which have every key.
    """
    named = [key for key in layers[0].values[section] if re.search(rf"\b{key}\b", reason)]
    if not named:
        return f"{section}: {reason}"

    def last(key: str) -> int:
        given = [n for n, one in enumerate(layers) if key in one.values.get(section, {})]
        return given[-1]

    # Of several the one that was given last; of one layer's the one that the reason begins with.
    key = max(named, key=lambda name: (last(name), reason.startswith(f"{name}: ")))
    source = layers[last(key)]
    if f"{section}.{key}" in source.options:
        return f"{source.name_of(section, key)}: {reason.removeprefix(f'{key}: ')}"
    return f"{source.place(section, key)}: {section}.{reason}"
