r"""What names of logs differ in besides plain numbers: a word, or numbers with signs.

Neither is guessed: a word may be anybody's, and a hyphen parts as often as it is a minus. It is
shown as an option to copy.
"""

from __future__ import annotations

import re
from pathlib import PurePath
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Sequence

__all__ = ["pattern_of_signs", "pattern_of_words"]

_WORD = r"[^\W\d_]+"
_SIGNED = re.compile(r"([^\W\d_]+)[ _=.]*[+-]\d")


def pattern_of_words(names: Sequence[str]) -> str:
    r"""Return an expression that finds the one word in which names differ; empty where none does.

    Parameters
    ----------
    names : sequence of str
        Of the files whose setting nobody said.

    Examples
    --------
    >>> pattern_of_words(["D7_soft.csv", "D7_hard.csv"])
    '7_(?P<setting>[^\\W\\d_]+)'
    >>> pattern_of_words(["soft.csv", "hard_02.csv"])
    ''
    """
    rows = [_tokens(name) for name in names]
    if len({len(row) for row in rows}) != 1 or len(rows) < 2:
        return ""
    columns = list(zip(*rows, strict=True))
    differ = [
        k
        for k, column in enumerate(columns)
        if len({one.casefold() for one in column}) > 1
        and all(re.fullmatch(_WORD, one) for one in column)
    ]
    if len(differ) != 1:
        return ""
    (place,) = differ
    before = next((k for k in range(place - 1, -1, -1) if re.search(r"[^\W_]", rows[0][k])), None)
    start = "^" if before is None else ""
    if before is not None:
        if len(set(columns[before])) > 1:
            return ""
        start = re.escape("".join(rows[0][before:place])).replace(r"\ ", " ").replace(r"\-", "-")
    pattern = f"{start}(?P<setting>{_WORD})"
    found = [re.search(pattern, PurePath(name).name, re.IGNORECASE) for name in names]
    words = [None if one is None else one["setting"] for one in found]
    return pattern if words == list(columns[place]) else ""


def pattern_of_signs(names: Sequence[str]) -> str:
    r"""Return an expression that finds a number with its sign; empty where no name has a plus.

    Examples
    --------
    >>> pattern_of_signs(["clk-8.csv", "clk+4.csv"])
    'clk(?P<setting>[+-]?\\d+)'
    """
    words = {found[1] for name in names if "+" in name and (found := _SIGNED.search(name))}
    if len(words) != 1:
        return ""
    pattern = rf"{words.pop()}[ _=.]*(?P<setting>[+-]?\d+)"
    if all(re.search(pattern.replace("[ _=.]*", ""), name, re.IGNORECASE) for name in names):
        pattern = pattern.replace("[ _=.]*", "")
    return pattern if all(re.search(pattern, name, re.IGNORECASE) for name in names) else ""


def _tokens(name: str) -> list[str]:
    """Return words, numbers and what stands between them, in turn; the suffixes are left out."""
    path = PurePath(name)
    while re.fullmatch(r"\.[A-Za-z]\w{0,7}", path.suffix):
        path = path.with_suffix("")
    return re.findall(rf"{_WORD}|\d+|[\W_]+", path.name)
