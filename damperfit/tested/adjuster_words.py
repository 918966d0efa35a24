"""Words and letters that name an adjuster in a label: "L6 H1" of low_speed and high_speed."""

from __future__ import annotations

import re
from collections import Counter
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence


# What dampers' makers and tuners call the two strokes.
_STROKES = (
    ("rebound", "reb", "extension", "ext", "r", "e"),
    ("compression", "bump", "comp", "jounce", "c", "b"),
)
_LETTERED = re.compile(r"([^\W\d_]{1,4})[+-]?\d+(?:\.\d+)?|\d+(?:\.\d+)?([^\W\d_]{1,4})")


def adjuster_by_word(adjusters: Sequence[str], shorts: Mapping[str, str]) -> dict[str, str]:
    """Return the adjuster that each word or letter names, where it names one alone.

    Its name and the first letters of its words go before the first letter alone, and that before
    other words of its stroke, as bump for compression.

    Parameters
    ----------
    adjusters : sequence of str
        Their names.
    shorts : mapping of str to str
        First letters of their words.

    Examples
    --------
    >>> shorts = {"low_speed": "LS", "high_speed": "HS"}
    >>> names = adjuster_by_word(["low_speed", "high_speed"], shorts)
    >>> names["l"], names["hs"]
    ('low_speed', 'high_speed')
    >>> adjuster_by_word(["bump", "rebound"], {"bump": "B", "rebound": "R"})["c"]
    'bump'
    """
    found: dict[str, str] = {}
    for pairs in (
        [(name.casefold(), name) for name in adjusters],
        [(shorts[name].casefold(), name) for name in adjusters],
        [(name[:1].casefold(), name) for name in adjusters],
        [(word, name) for name in adjusters for word in _alike(name)],
    ):
        counts = Counter(word for word, _ in pairs)
        # A word of two adjusters names neither, nor does it name a third.
        for word, name in pairs:
            found.setdefault(word, name if counts[word] == 1 else "")
    return {word: name for word, name in found.items() if name}


def adjuster_of(word: str) -> str:
    """Return the stroke whose adjuster a word or letter names; empty where it names none.

    Examples
    --------
    >>> adjuster_of("R"), adjuster_of("bump"), adjuster_of("HSC")
    ('rebound', 'compression', '')
    """
    return next((words[0] for words in _STROKES if word.casefold() in words), "")


def _alike(name: str) -> Iterable[str]:
    return next((words for words in _STROKES if name.casefold() in words), ())


def letters_of(label: str) -> list[str]:
    """Return the letters of a label that is letters with numbers throughout; none of another.

    Examples
    --------
    >>> letters_of("L6 H1"), letters_of("c3r5"), letters_of("soft"), letters_of("10")
    (['l', 'h'], ['c', 'r'], [], [])
    """
    one = r"([^\W\d_]{1,4})[ _=:]?[+-]?\d+(?:\.\d+)?"
    if not re.fullmatch(rf"(?:{one}[ _,;/|-]*)+", label):
        return []
    return [found.casefold() for found in re.findall(one, label)]


def lettered(parts: Iterable[str]) -> list[str] | None:
    """Return the letters of parts that are each letters with a number; None where one is not.

    Examples
    --------
    >>> lettered(["L6", "H1"]), lettered(["12r", "8c"]), lettered(["soft", "H1"])
    (['L', 'H'], ['r', 'c'], None)
    """
    found = [_LETTERED.fullmatch(part) for part in parts]
    return None if None in found or not found else [m[1] or m[2] for m in found if m]
