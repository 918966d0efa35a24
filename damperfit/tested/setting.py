"""Where the adjusters of a damper stand: a label of one or more clicks, numbers or words."""

from __future__ import annotations

import re
from collections import Counter, defaultdict
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache, total_ordering
from numbers import Integral, Rational, Real
from typing import Any, NamedTuple, TypeAlias

Place: TypeAlias = int | float | str

ADJUSTER = "setting"  # the name of the only adjuster unless it was named
LONGEST_WORD = 40  # of a click that is no number; a longer text is a sentence
_HIGHEST = 1_000_000  # clicks; more is a date or a serial number
_NUMBER = re.compile(r"[+-]?\d{1,9}(?:\.\d{1,6})?", re.ASCII)
_OTHER_NUMBER = re.compile(
    r"[+-]?(nan|inf\w*|(\d[\d_]*\.?|\.\d)[\d_]*(e[+-]?\d[\d_]*)?)", re.IGNORECASE
)
# What dampers' makers and tuners call the two strokes.
_STROKES = (
    ("rebound", "reb", "extension", "ext", "r", "e"),
    ("compression", "bump", "comp", "jounce", "c", "b"),
)
_LETTERED = re.compile(r"([^\W\d_]{1,4})[+-]?\d+(?:\.\d+)?|\d+(?:\.\d+)?([^\W\d_]{1,4})")


def natural_order(name: str) -> tuple[tuple[int, int, str], ...]:
    """Return the sort key of a name that puts run_2 before run_10."""
    parts = re.split(r"([0-9]+)", name)  # every second part is digits
    return tuple((1, int(p), "") if i % 2 else (0, 0, p) for i, p in enumerate(parts))


@total_ordering
@dataclass(frozen=True, slots=True, eq=False)
class Setting:
    """Where each adjuster stands, in the order that was declared.

    A place is clicks, which may be negative or halves, or a word such as "soft". With one adjuster
    in whole clicks a setting equals its number and hashes alike: ``fit.setting == 10``.

    >>> str(Setting.of(10)), str(Setting((("rebound", 12), ("compression", 8))))
    ('10', 'R12 C8')
    >>> Setting.of(10) == 10, sorted([Setting.of("soft"), Setting.of(-2), Setting.of(10)])[0].cell
    (True, -2)
    """

    places: tuple[tuple[str, Place], ...]  # name and place of each

    @staticmethod
    def of(value: Setting | Place) -> Setting:
        """Return a setting of the only, unnamed adjuster; a setting as it is."""
        return value if isinstance(value, Setting) else Setting(((ADJUSTER, value),))

    @property
    def adjusters(self) -> tuple[str, ...]:
        """Names of the adjusters."""
        return tuple(name for name, _ in self.places)

    @property
    def label(self) -> str:
        """For people: "10", "soft", "R12 C8"."""
        if len(self.places) == 1:
            return _said(self.places[0][1])
        shorts = short_names(self.adjusters)
        return " ".join(
            f"{shorts[name]}{':' * isinstance(place, str)}{_said(place)}"
            for name, place in self.places
        )

    @property
    def cell(self) -> int | str:
        """For tables and JSON: a whole number of the only adjuster as such, else the label."""
        place = self.places[0][1]
        return place if len(self.places) == 1 and isinstance(place, int) else self.label

    @property
    def slug(self) -> str:
        """For names of files: "10", "R12_C8"; whole numbers with two digits or more."""
        if isinstance(self.cell, int):
            return f"{self.cell:02d}"
        return re.sub(r"[^\w.+-]+", "_", self.label).strip("_") or "none"

    def place(self, adjuster: str) -> Place:
        """Return where an adjuster stands; also one that is evident from the label."""
        known = dict(self.places)
        return known[adjuster] if adjuster in known else dict(self.evident)[adjuster]

    @property
    def evident(self) -> tuple[tuple[str, Place], ...]:
        """Letters and numbers of a label without declared adjusters; else the places.

        >>> Setting.of("L6 H1").evident, Setting.of("soft").evident
        ((('L', 6), ('H', 1)), (('setting', 'soft'),))
        """
        place = self.places[0][1]
        is_word = len(self.places) == 1 and isinstance(place, str)
        return (is_word and _lettered_places(place)) or self.places

    def number(self, adjuster: str | None = None) -> float | None:
        """Return where an adjuster stands as a number, None where that is a word.

        Without a name: of the only adjuster; None where there are several.
        """
        if adjuster is None and len(self.places) > 1:
            return None
        place = self.places[0][1] if adjuster is None else self.place(adjuster)
        return None if isinstance(place, str) else float(place)

    def softness(self, from_closed: Collection[str]) -> tuple[Any, ...]:
        """Return the order from soft to stiff, for adjusters of which some count from closed."""
        ends = zip(self.adjusters, self._order, strict=True)
        return tuple((a, -b if name in from_closed else b, c) for name, (a, b, c) in ends)

    def __str__(self) -> str:
        return self.label

    def __eq__(self, other: object) -> bool:
        if other.__class__ is not Setting:  # a campaign of some hundred asks a million times
            if not isinstance(other, Setting | int | float):
                return NotImplemented
            other = Setting.of(other)
        ours, theirs = self.places, other.places
        if len(ours) == len(theirs) == 1:
            return ours[0][1] == theirs[0][1]
        return ours == theirs

    def __hash__(self) -> int:
        places = self.places
        return hash(places[0][1] if len(places) == 1 else places)

    def __lt__(self, other: object) -> bool:
        if not isinstance(other, Setting | int | float):
            return NotImplemented
        return self._order < Setting.of(other)._order

    @property
    def _order(self) -> tuple[tuple[int, float, tuple[Any, ...]], ...]:
        return tuple(
            (1, 0.0, natural_order(place.casefold()))
            if isinstance(place, str)
            else (0, float(place), ())
            for _, place in self.places
        )


@lru_cache(maxsize=1024)
def _lettered_places(label: str) -> tuple[tuple[str, Place], ...]:
    letters = letters_of(label)
    if len(letters) < 2 or len({*letters}) < len(letters):
        return ()
    numbers = re.findall(r"[+-]?\d+(?:\.\d+)?", label)
    return tuple((a.upper(), parse_place(b)) for a, b in zip(letters, numbers, strict=True))


def label_of(given: object) -> str | None:
    """Return the label of a setting as a user gives it, a number too; None: it is none."""
    if isinstance(given, bool) or not isinstance(given, Real):
        return str(given) if isinstance(given, Setting | str) else None
    if isinstance(given, Integral):  # of any length
        return str(given)
    number = float(given)
    if number.is_integer():
        return f"{number:.0f}"
    return str(number if isinstance(given, Rational) else given)


def _said(place: Place) -> str:
    return f"{place:g}" if isinstance(place, float) else str(place)


# Names, words and letters of adjusters: "L6 H1" of low_speed and high_speed.


def short_names(adjusters: Sequence[str]) -> dict[str, str]:
    """Return the first letters of each adjuster's words; its name where these are not its own."""
    shorts = {
        name: "".join(word[:1] for word in re.split(r"[_\W]+", name)).upper() for name in adjusters
    }
    given = list(shorts.values())
    return {name: short if given.count(short) == 1 else name for name, short in shorts.items()}


def adjuster_of(word: str) -> str:
    """Return the stroke whose adjuster a word or letter names; empty where it names none."""
    return next((words[0] for words in _STROKES if word.casefold() in words), "")


def letters_of(label: str) -> list[str]:
    """Return the letters of a label that is letters with numbers throughout; none of another."""
    pattern = r"([^\W\d_]{1,4})[ _=:]?[+-]?\d+(?:\.\d+)?"
    if not re.fullmatch(rf"(?:{pattern}[ _,;/|-]*)+", label):
        return []
    return [letters.casefold() for letters in re.findall(pattern, label)]


def _adjuster_by_word(adjusters: Sequence[str]) -> dict[str, str]:
    """Return the adjuster that each word or letter names, where it names one alone.

    Its name and the first letters of its words go before the first letter alone, and that before
    other words of its stroke, as bump for compression.
    """
    shorts = short_names(adjusters)
    adjuster_by_word: dict[str, str] = {}
    for pairs in (
        [(name.casefold(), name) for name in adjusters],
        [(shorts[name].casefold(), name) for name in adjusters],
        [(name[:1].casefold(), name) for name in adjusters],
        [(w, name) for name in adjusters for s in _STROKES if name.casefold() in s for w in s],
    ):
        counts = Counter(word for word, _ in pairs)
        # A word of two adjusters names neither, nor does it name a third.
        for word, name in pairs:
            adjuster_by_word.setdefault(word, name if counts[word] == 1 else "")
    return {word: name for word, name in adjuster_by_word.items() if name}


# Labels.


def parse_place(text: str) -> Place:
    """Return where an adjuster stands, as a text says it.

    >>> [parse_place(text) for text in ("08", "-3", "2.5", "10.0", "soft")]
    [8, -3, 2.5, 10, 'soft']
    """
    text = text.strip()
    if _NUMBER.fullmatch(text):
        number = float(text)
        if abs(number) <= _HIGHEST:
            return int(number) if number.is_integer() else number
    is_word = any(c.isalpha() for c in text) and not _OTHER_NUMBER.fullmatch(text)
    if not is_word or len(text) > LONGEST_WORD or not text.isprintable():
        raise ValueError(
            f"expected clicks, a number from -{_HIGHEST} to {_HIGHEST}, or a word of "
            f"{LONGEST_WORD} letters at most"
        )
    return text


def parse_setting(text: str, adjusters: Sequence[str] = (ADJUSTER,)) -> Setting:
    """Return the setting that a label names.

    For one adjuster as in "10", "10 clicks from open" or "soft"; for several "R12 C08", "12r/8c",
    "rebound=12, compression=8", "b12-r8", or "12/8" in the declared order.

    >>> parse_setting("R12 C08", ["rebound", "compression"]).places
    (('rebound', 12), ('compression', 8))
    >>> parse_setting("12/-8", ["rebound", "compression"]).label
    'R12 C-8'
    >>> parse_setting("12r/8c", ["rebound", "compression"]).label
    'R12 C8'
    """
    if len(adjusters) == 1:
        named, numbered = _ways_to_say(adjusters[0])
        plain = named.sub("", text)
        number = numbered.fullmatch(plain.strip())
        return Setting(((adjusters[0], parse_place(number[1] or number[2] if number else plain)),))
    stated = _named_places(text, adjusters)
    if not stated:
        parts = re.split(r"\s*[/;|,]\s*|\s+", text.strip())
        lettered = [match for part in parts if (match := _LETTERED.fullmatch(part))]
        if len(lettered) == len(parts):
            raise ValueError(
                f"the letters {', '.join(m[1] or m[2] for m in lettered)} name none of the "
                f"adjusters {', '.join(adjusters)}, or several; expected {_example(adjusters)}, or "
                "names in [adjusters] that begin with these letters"
            )
        stated = dict(zip(adjusters, parts, strict=False)) if len(parts) == len(adjusters) else {}
    if any(name not in stated for name in adjusters):
        raise ValueError(f"expected {_example(adjusters)}")
    return Setting(tuple((name, parse_place(stated[name])) for name in adjusters))


@lru_cache(maxsize=64)  # of each log its name, its label and its row are asked
def _ways_to_say(adjuster: str) -> tuple[re.Pattern[str], re.Pattern[str]]:
    """Return what stands ahead of a place of the only adjuster, and how a number of it is said."""
    words = "|".join(map(re.escape, _adjuster_by_word([adjuster])))
    named = re.compile(rf"^\s*{re.escape(adjuster)}\s*[=:]\s*", re.IGNORECASE)
    number = r"[+-]?\d{1,9}(?:\.\d{1,6})?"
    # A hyphen directly behind the word parts it from the number, as in names of files.
    parted = r"(?:\s*[=:]\s*|[ _-])?"
    words = rf"(?:{words}|[ck]lic(?:ks?|s)?|crans?|rasten?)"
    counted = r"(?: ?(?:out )?(?:from|von|ab|depuis) .+)?"
    ahead = rf"(?:{words}{parted}({number})|({number}) ?{words}?){counted}"
    return named, re.compile(ahead, re.IGNORECASE)


def _named_places(text: str, adjusters: Sequence[str]) -> dict[str, str]:
    """Return the text of each adjuster that is named."""
    names = _adjuster_by_word(adjusters)
    known = "|".join(sorted(map(re.escape, names), key=len, reverse=True))
    mark = re.compile(
        rf"(?<![^\W\d_])({known})(?:\s*[=:]\s*([^\s,;/|]+)|[\s_]*([+-]?\d+(?:\.\d+)?))",
        re.IGNORECASE,
    )
    pairs = [(m[1].casefold(), m[2] or m[3]) for m in mark.finditer(text)]
    if len(pairs) < len(adjusters):
        # As in 12r/8c: the number first.
        ahead = re.compile(
            rf"(?<![\w.])([+-]?\d+(?:\.\d+)?) ?({known})(?![^\W_])|"
            rf"(?<=_)([+-]?\d+(?:\.\d+)?)({known})(?![^\W_])",
            re.IGNORECASE,
        )
        turned = [((m[2] or m[4]).casefold(), m[1] or m[3]) for m in ahead.finditer(text)]
        pairs = turned if len(turned) == len(adjusters) else pairs
    if len({names[word] for word, _ in pairs}) < len(pairs):
        raise ValueError("one adjuster is named twice")
    return {names[word]: place for word, place in pairs}


def _example(adjusters: Sequence[str]) -> str:
    named = ", ".join(f"{name}=12" for name in adjusters)
    return f"a place for each adjuster, as in '{named}'"


# Settings side by side.


class SettingLine(NamedTuple):
    """Settings that differ in one adjuster alone, by rising number."""

    adjuster: str  # the one that runs
    held: str  # where the others stand, for people; empty where there are none
    settings: tuple[Setting, ...]

    @property
    def numbers(self) -> Mapping[Setting, float]:
        """Where each setting stands on the line."""
        return {setting: float(setting.place(self.adjuster)) for setting in self.settings}


def clicks_between(first: Setting | Place, second: Setting | Place) -> float | None:
    """Return by how many clicks the only adjuster that differs does; None where there is none."""
    here, other = Setting.of(first), Setting.of(second)
    turned = [name for name in here.adjusters if here.place(name) != other.place(name)]
    ends = [side.number(name) for name in turned for side in (here, other)]
    if len(turned) != 1 or ends[0] is None or ends[1] is None:
        return None
    return ends[1] - ends[0]


def nearest_setting(wanted: Setting | Place, known: Iterable[Setting]) -> Setting | None:
    """Return the setting itself, or that with the fewest other words and clicks between; or None.

    Of two alike it is the one that comes first in their order.
    """

    def distance(setting: Setting) -> tuple[int, float, Setting]:
        if setting.adjusters != here.adjusters:
            return len(here.places), 0.0, setting
        ends = [(here.place(name), setting.place(name)) for name in here.adjusters]
        clicks = [abs(a - b) for a, b in ends if not isinstance(a, str) and not isinstance(b, str)]
        words = [a != b for a, b in ends if isinstance(a, str) or isinstance(b, str)]
        return sum(words), float(sum(clicks)), setting

    here = Setting.of(wanted)
    return min(known, key=distance, default=None)


def lines_of(settings: Iterable[Setting | Place]) -> tuple[SettingLine, ...]:
    """Return the lines that settings lie on; a word lies on none.

    With one adjuster there is one line, which may hold no setting; with several, those of two
    settings or more.

    >>> [(line.adjuster, line.held, len(line.settings)) for line in lines_of([1, 2, 3])]
    [('setting', '', 3)]
    """
    known = sorted({Setting.of(setting) for setting in settings})
    return tuple(_lines(known)) if known else ()


def _lines(known: Sequence[Setting]) -> Iterator[SettingLine]:
    adjusters = known[0].adjusters
    for name in adjusters:
        groups: dict[tuple[tuple[str, Place], ...], list[Setting]] = defaultdict(list)
        for setting in known:
            if setting.number(name) is not None:
                groups[tuple(pair for pair in setting.places if pair[0] != name)].append(setting)
        if len(adjusters) == 1 and not groups:
            yield SettingLine(name, "", ())
        for held, settings in groups.items():
            if len(adjusters) == 1 or len(settings) > 1:
                beside = ", ".join(f"{other} {_said(place)}" for other, place in held)
                settings.sort(key=lambda s: s.number(name) or 0.0)
                yield SettingLine(name, beside, tuple(settings))
