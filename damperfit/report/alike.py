"""Of many sentences that say the same with other numbers: the first, and how many more.

What is wrong with hundreds of logs is a few lines, one for each kind of cause; run.json keeps all.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

__all__ = [
    "FEW",
    "MANY_KINDS",
    "by_words",
    "listed_names",
    "shape_of",
    "short_listing",
    "summarised",
    "with_ranges",
]

MANY_KINDS = 20  # kinds of sentences that are shown
_SHOWN = 3  # sentences of one kind that are shown one by one where there are many
FEW = 20  # sentences in all that are shown one by one; a damper has some twenty settings
_LONG = 200  # characters; a page of one paragraph again and again is not read
_NAMES = 5  # names that are listed
_QUOTED = re.compile(r"'(?:[^'\\]|\\.)*'|\"(?:[^\"\\]|\\.)*\"")
_NUMBER = re.compile(r"(?<![^\W_])[+-]?\d[\w.+-]*")
_RANGE_WITH_ERROR = re.compile(r"(\S+)(?: to (\S+))? \+- (\S+(?: to \S+)?) (\w+)")
_LISTED = re.compile(r"''(?:,? (?:and |or )?'')+")


def shape_of(sentence: str, name: str = "") -> str:
    """Return what is left of a sentence without numbers, quoted words and the log's name.

    Examples
    --------
    >>> shape_of("a_7.csv, line 12: force is 'OVR', in 3 of 4 rows", "a_7.csv")
    ", line #: force is '', in # of # rows"
    """
    without = sentence.replace(name, "") if name else sentence
    return _NUMBER.sub("#", _LISTED.sub("''", _QUOTED.sub("''", without)))


def by_words(sentences: Iterable[str]) -> list[list[str]]:
    """Return sentences in groups that differ in numbers alone, in the order of their first."""
    groups: dict[str, list[str]] = {}
    for one in sentences:
        groups.setdefault(_NUMBER.sub("#", one), []).append(one)
    return list(groups.values())


def with_ranges(sentences: Sequence[str]) -> str:
    """Return sentences that differ in numbers alone as one, with the range of each number.

    Examples
    --------
    >>> with_ranges(["noise of 0.28 um, 3 % of it", "noise of 0.374 um, 3 % of it"])
    'noise of 0.28 to 0.374 um, 3 % of it'
    """
    columns = zip(*(_NUMBER.findall(one) for one in sentences), strict=True)
    ranges = [_range(column) for column in columns]
    words = iter(ranges)
    return _RANGE_WITH_ERROR.sub(_plainly, _NUMBER.sub(lambda _: next(words), sentences[0]))


def _plainly(found: re.Match[str]) -> str:
    """Say "-132 to 9 +- 6 to 21 N" as one reads it."""
    low, high, error, unit = found.groups()
    if not high and " to " not in error:
        return found[0]
    value = f"between {low} and {high} {unit}" if high else f"{low} {unit}"
    return f"{value} (uncertain by {error} {unit})"


def _range(texts: Sequence[str]) -> str:
    """As in "12 to 13"; texts that are no plain numbers have the first and no range."""
    try:
        ordered = sorted(texts, key=float)
    except ValueError:
        return texts[0]
    low, high = ordered[0], ordered[-1]
    return low if float(low) == float(high) else f"{low} to {high}"


def listed_names(names: Sequence[str], *, few: int = _NAMES + 1) -> str:
    """Return names in a row; of more than a few the first five, and how many more.

    Examples
    --------
    >>> listed_names(["a", "b"]), listed_names(list("abcdefg"))
    ('a, b', 'a, b, c, d, e and 2 more')
    """
    if len(names) <= few:
        return ", ".join(names)
    return f"{', '.join(names[:_NAMES])} and {len(names) - _NAMES} more"


def summarised(sentences: Iterable[tuple[str, str]]) -> Iterator[str]:
    """Yield sentences, each with the name it is about; of many alike the first and how many more.

    A few are all shown, but for long ones that differ in nothing but the name.

    Parameters
    ----------
    sentences : iterable of (str, str)
        Name and whole sentence.
    """
    everything = list(sentences)
    if len(everything) <= FEW:
        yield from _few(everything)
        return
    kinds: dict[str, list[tuple[str, str]]] = {}
    for name, sentence in everything:
        kinds.setdefault(shape_of(sentence, name), []).append((name, sentence))
    for group in list(kinds.values())[:MANY_KINDS]:
        yield from _of_one_kind(group)
    if len(kinds) > MANY_KINDS:
        rest = sum(len(group) for group in list(kinds.values())[MANY_KINDS:])
        n = len(kinds) - MANY_KINDS
        yield f"and {rest} more of {n} other kinds; run.json and --json list them all"


def _few(sentences: Sequence[tuple[str, str]]) -> Iterator[str]:
    """Yield all, in their order, but long ones that differ in the name alone."""
    kinds: dict[str, list[tuple[str, str]]] = {}
    alike = [sentence.replace(name, "") if name else sentence for name, sentence in sentences]
    for kind, one in zip(alike, sentences, strict=True):
        kinds.setdefault(kind, []).append(one)
    for kind, (name, sentence) in zip(alike, sentences, strict=True):
        group = kinds[kind]
        if len(group) <= _SHOWN or len(sentence) < _LONG:
            yield sentence
        elif (name, sentence) == group[0]:
            yield from _of_one_kind(group)


def _of_one_kind(group: Sequence[tuple[str, str]]) -> Iterator[str]:
    if len(group) <= _SHOWN:
        yield from (sentence for _, sentence in group)
        return
    (_, first), *others = group
    names = listed_names([name for name in dict.fromkeys(name for name, _ in others) if name])
    yield f"{first} (and {len(others)} alike{': ' * bool(names)}{names})"


def short_listing(sentences: Iterable[str]) -> list[str]:
    """Return sentences that say themselves what they are about; of many alike the first."""
    return list(summarised(("", str(sentence)) for sentence in sentences))
