"""Sentences on the trends of several parameters that say the same, told once."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable

__all__ = ["in_few_words"]


def in_few_words(sentences: Iterable[str]) -> tuple[str, ...]:
    """Return sentences on trends, those that differ in their parameter alone as one.

    Parameters
    ----------
    sentences : iterable of str
        As `Trend.sentence`.

    Examples
    --------
    >>> in_few_words(["R_m1: no trend", "R_m2: no trend", "K_e rises"])
    ('R_m1, R_m2: no trend', 'K_e rises')
    """
    symbols: dict[str, list[str]] = {}
    for sentence in sentences:
        symbol, colon, rest = sentence.partition(": ")
        is_alike = colon and " " not in symbol
        symbols.setdefault(rest if is_alike else sentence, []).append(symbol if is_alike else "")
    return tuple(
        f"{', '.join(names)}: {rest}" if names[0] else rest for rest, names in symbols.items()
    )
