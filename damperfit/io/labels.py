"""The setting of a log: from its preamble, a column, its file's name, or a guess from all names.

A preamble takes precedence over a column, and a column over the name. Without a declared pattern
the setting is guessed from names that differ in numbers alone, as ``D7_C02.csv`` and
``D7_C08.csv``: it is the only number that differs and is no speed, serial number or count of runs.
A few names of another kind do not matter. Several such numbers are guessed where each has the word
of a stroke or speed before it, as in ``R12_C08`` and ``L06_H1``; of others a note says what to
declare if they are two adjusters. A word or a signed number in which names differ is not guessed,
as a word may mean anything and a hyphen is often no minus: the pattern is shown as an option to
copy.
"""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Container, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import PurePath
from typing import NamedTuple

from damperfit.errors import LogError
from damperfit.io.columns import visible
from damperfit.problem import Option, Problem, in_a_row, note
from damperfit.sections import SETTING_PATTERN
from damperfit.tested.identity import IDENTITY_KEYS
from damperfit.tested.setting import (
    ADJUSTER,
    Place,
    Setting,
    adjuster_of,
    parse_place,
    parse_setting,
)
from damperfit.units.quantities import is_unit

_CLICKS = {
    "click", "clicks", "clk", "clicked", "setting", "set", "pos", "position", "adj", "adjuster",
    "detent", "notch", "klick", "klicks", "raste", "rasten", "stufe", "stellung", "einstellung",
    "clic", "clics", "cran", "crans", "reglage",
}  # fmt: skip
_NO_CLICKS = {
    "sn", "serial", "ser", "nr", "no", "id", "d", "damper", "unit", "customer", "rig",
    "run", "runs", "test", "tests", "t", "rep", "repeat", "log", "part", "file", "try", "meas",
    "v", "ver", "version", "rev", "cycle", "cycles", "n", "date", "time", "day",
    "f", "freq", "frequency", "hz", "a", "amp", "amplitude", "stroke", "speed", "vel", "temp",
    "p", "pressure", "gas", "psi", "bar",
    "lauf", "versuch", "messung", "wiederholung", "wdh", "nummer", "seriennummer", "prufling",
    "pruefling", "dampfer", "daempfer", "teil", "datei", "zyklus", "datum", "hub", "frequenz",
    "essai", "mesure", "numero", "serie", "amortisseur", "piece", "fichier", "course",
    "frequence", "vitesse", "temperature", "temperatur",
}  # fmt: skip
# Words of a preamble's key that mean the clicks of an adjuster and nothing else.
_OF_CLICKS = {
    *("adjuster", "adj", "click", "clicks", "clicker", "klick", "klicks", "einstellung"),
    *("clic", "clics", "reglage", "réglage"),
}
# What the adjusters of low and of high speed are called.
_OF_SPEEDS = {"l", "h", "ls", "hs", "low", "high", "lsc", "hsc", "lsb", "hsb", "lsr", "hsr"}
FROM_NAME = "setting: from the file name"  # the note that says so
_MAY_BE_DEGREES = "c"  # 25c is as well 25 clicks of compression
# What several numbers are called that have no word before them, or the same.
_PLACES = ("a", "b", "c", "d")
_WORD = r"[^\W\d_]+"
_ENDING = re.compile(rf"({_WORD})[ _=.-]*$")  # the last word before a number
_TOKEN = re.compile(rf"{_WORD}|\d+|[\W_]+")
_SIGNED = re.compile(rf"({_WORD})[ _=.]*[+-]\d")
# A hyphen behind a blank or "_" is a minus, as in a label; behind a word it parts.
_NUMBERS = re.compile(r"((?:(?<=[\s_=])-)?\d+(?:\.\d+)?)")
# More than three digits are a serial number or a date; half clicks have the word before them.
_NUMBER = r"-?\d{1,3}"
_CLICK = r"-?\d{1,3}(\.\d)?"
# An unambiguous word: without a declared pattern it is preferred to a bare "s".
_CLICKS_SETTING_NUMBER = r"(?<![^\W_])clicks?(?:[ _=](?=-\d)|[ _=-]?)(-?\d+)(?![.]?\d)"
_SERIAL = r"(?<![^\W_])(?:sn|serial)[ _=-]?([a-z]?\d\w*?)(?![^\W_])"


@dataclass(frozen=True, slots=True)
class Guess:
    """Settings guessed from the names of logs."""

    settings: Mapping[str, Setting] = field(default_factory=dict)  # by name; empty: none guessed
    finding: Problem | None = None  # what was guessed, and how to declare it
    advice: Problem | None = None  # what to declare where nothing was guessed
    # Names of several adjusters, where each number that differs has the word of one before it,
    adjusters: tuple[str, ...] = ()
    pattern: str = ""  # and what finds the place of each of these.


class _Field(NamedTuple):
    """One number in names that differ in numbers alone."""

    place: int
    before: str  # the text between the number before and this one
    word: str
    values: tuple[str, ...]
    may_be: bool  # nothing says that it counts something else than clicks

    @property
    def is_varied(self) -> bool:
        return len(set(self.values)) > 1

    @property
    def is_clicks(self) -> bool:
        return self.word in _CLICKS


def guess_settings(names: Iterable[str]) -> Guess:  # noqa: PLR0911 - one return a case
    r"""Return the settings, or an advice, that the names of logs without a setting show.

    Examples
    --------
    >>> guess = guess_settings(["D7_C02.csv", "D7_C08.csv"])
    >>> guess.settings["D7_C08.csv"].cell
    8
    >>> str(guess.finding).endswith("--rig 'setting_pattern=C(?P<setting>\\d+)'")
    True
    """
    kinds = _kinds(names)
    if not kinds:
        return Guess()
    names = [name for group in kinds.values() for name in group]
    if pattern := _pattern_of_signs(names) or (_pattern_of_words(names) if len(kinds) > 1 else ""):
        return Guess(advice=_declaring(pattern))
    group = max(kinds.values(), key=len)
    fields = _fields(group)
    may_be = [number for number in fields if number.may_be]
    varied = [number for number in may_be if number.is_varied]
    likely = [number for number in may_be if number.is_clicks] or varied
    is_most = len(kinds) == 1 or (len(group) > 1 and 2 * len(group) > len(names))
    if is_most and len(likely) == 1:
        chosen = likely[0]
        places = map(parse_place, chosen.values)
        settings = {name: Setting.of(place) for name, place in zip(group, places, strict=True)}
        pattern = _pattern(chosen, group)
        finding = note(
            "setting-guessed",
            "the setting is guessed from the file names: {why}, {where}; to confirm it: {option}",
            why="what differs between the names" if chosen.is_varied else "the clicks in the name",
            where=f"the number after '{chosen.before}'" if chosen.before else "the first number",
            option=Option("rig", pattern, "setting_pattern"),
        )
        # R12C08 and R06C08: two adjusters, one of which was turned.
        by_number = {number: name for number in may_be if (name := adjuster_of(number.word))}
        turned = tuple(by_number.values())
        if chosen in by_number and len(turned) == len(set(turned)) > 1 and len(kinds) == 1:
            every = _pattern_of_all(by_number, fields, group)
            return Guess(settings, finding, _declaring(pattern, turned, every), turned, every)
        return Guess(settings, finding, _declaring(pattern), pattern=pattern)
    ranked = sorted(fields, key=lambda n: (not n.is_clicks, not n.may_be, not n.is_varied))
    pattern = _pattern(ranked[0], group) if ranked else ""
    # What to call the numbers that differ, where several may be adjusters.
    if len(varied) > len(_PLACES):
        varied = [number for number in varied if number.word != "s"]  # a speed, as likely
    if not 2 <= len(varied) <= len(_PLACES):
        return Guess(advice=_declaring(pattern))
    adjusters = [adjuster_of(number.word) or number.word for number in varied]
    if len(set(adjusters)) < len(adjusters) or not all(a.isascii() and a for a in adjusters):
        adjusters = list(_PLACES[: len(varied)])
    every = _pattern_of_all(dict(zip(varied, adjusters, strict=True)), fields, group)
    advice = _declaring(pattern, adjusters, every)
    of_words = [adjuster_of(n.word) or n.word * (n.word in _OF_SPEEDS) for n in varied]
    if len(kinds) > 1 or of_words != adjusters:
        return Guess(advice=advice)
    rows = zip(*(map(parse_place, number.values) for number in varied), strict=True)
    labels = (Setting(tuple(zip(adjusters, row, strict=True))).label for row in rows)
    finding = note(
        "setting-guessed",
        "the setting is guessed from the file names, the numbers after {words}; for trends and "
        "clicks {advice}",
        words=in_a_row([f"'{number.before}'" for number in varied]),
        advice=_declaring("", adjusters, every),
    )
    settings = {name: Setting.of(label) for name, label in zip(group, labels, strict=True)}
    return Guess(settings, finding, advice, tuple(adjusters), every)


def one_of_several(name: str) -> str:
    """Return the number after a bare "s" where others in the name may count clicks too."""
    fields = [number for number in _fields([name]) if number.may_be]
    chosen = [number.values[0] for number in fields if number.word == "s"]
    return chosen[-1] if len(fields) > len(chosen) > 0 else ""


def unclear_names(names: Iterable[str]) -> frozenset[str]:
    """Return the names of a run in which the number after a bare "s" is no setting for certain.

    Others in them vary too, and may count clicks: then "s" may be the speed of the test. A number
    that is another one in each name counts the logs.
    """
    unclear: set[str] = set()
    for group in _kinds(names).values():
        fields = [number for number in _fields(group) if number.may_be]
        others = [number for number in fields if number.word != "s" and number.is_varied]
        is_count = len(others) == 1 and len(set(others[0].values)) == len(group)
        if others and not is_count and any(number.word == "s" for number in fields):
            unclear.update(group)
    return frozenset(unclear)


def _kinds(names: Iterable[str]) -> dict[tuple[str, ...], list[str]]:
    """Return names, each once, by what they have besides numbers."""
    kinds: dict[tuple[str, ...], list[str]] = {}
    for name in dict.fromkeys(names):
        texts = tuple(text.casefold() for text in _NUMBERS.split(_stem(name))[::2])
        kinds.setdefault(texts, []).append(name)
    return kinds


def _stem(name: str) -> str:
    path = PurePath(name)
    while re.fullmatch(r"\.[A-Za-z]\w{0,7}", path.suffix):
        path = path.with_suffix("")
    return path.name


def _fields(names: Sequence[str]) -> list[_Field]:
    """Return the numbers in names of one kind."""
    numbers = [_NUMBERS.split(_stem(name))[1::2] for name in names]
    texts = _NUMBERS.split(_stem(names[0]))[::2]
    fields = []
    for k, (before, behind) in enumerate(pairwise(texts)):
        # Without accents, however a file system wrote them.
        letters = unicodedata.normalize("NFD", before.casefold())
        ending = _ENDING.search("".join(c for c in letters if not unicodedata.combining(c)))
        # What stands at a number is its unit, and no word of the next one: 1.5Hz_3.
        unit = re.fullmatch(rf" ?({_WORD})[ _=.-]+", before) if k else None
        is_behind_unit = unit is not None and (is_unit(unit[1]) or is_unit(unit[1].casefold()))
        word = ending[1] if ending and not is_behind_unit else ""
        # As written: degC and kN are units.
        following = re.match(rf" ?(?:[\u00b0\u00ba\u02da] ?)?({_WORD})", behind)
        after = following[1] if following else ""
        low = after.casefold()
        counts_other = is_unit(after) or is_unit(low) or low in {*_NO_CLICKS, _MAY_BE_DEGREES}
        # R12C08: the letter is of the number behind it.
        is_of_next = len(after) == 1 and behind == after and k + 2 < len(texts)
        is_other = word in _NO_CLICKS or (counts_other and not is_of_next)
        values = tuple(row[k] for row in numbers)
        digits = _CLICK if word in _CLICKS else _NUMBER
        may_be = not is_other and all(re.fullmatch(digits, value) for value in values)
        fields.append(_Field(k, before, word, values, may_be))
    return fields


# Patterns to copy: each is tried on the names it was made from.


def _declaring(pattern: str, adjusters: Sequence[str] = (), every: str = "") -> Problem | None:
    """Return an advice: the pattern to declare, and one for several adjusters."""
    texts, values = [], {}
    if pattern:
        texts, values = ["{option}"], {"option": Option("rig", pattern, "setting_pattern")}
    if adjusters:
        declared = ", ".join(f'{name} = ""' for name in adjusters)
        texts.append(
            f"{'or, where several adjusters were turned, ' if pattern else ''}declare them in a "
            f"configuration (damperfit init LOGS writes it), [adjusters] {declared}, and give it "
            "with {config} and {every}"
        )
        values |= {"config": Option("config"), "every": Option("rig", every, "setting_pattern")}
    return note("setting-in-names", "; ".join(texts), **values) if texts else None


def _escaped(text: str) -> str:
    return re.escape(text).replace(r"\ ", " ").replace(r"\-", "-")


def _finds(pattern: str, name: str) -> list[tuple[str, ...]]:
    return [match.groups() for match in re.finditer(pattern, name, re.IGNORECASE)]


def _pattern(chosen: _Field, names: Sequence[str]) -> str:
    r"""Return an expression that finds the number, and nothing else, in every name."""
    ending = re.search(rf"{_WORD}[ _=.-]*$|[ _=.-]+$", chosen.before)
    sign = "-?" if any(value.startswith("-") for value in chosen.values) else ""
    half = r"(?:\.\d)?" if any("." in value for value in chosen.values) else ""
    number = rf"(?P<setting>{sign}\d+{half})"
    for start in (ending[0] if ending else "", chosen.before):
        pattern = f"{_escaped(start)}{number}"
        pairs = zip(names, chosen.values, strict=True)
        if start and all(_finds(pattern, name)[-1:] == [(value,)] for name, value in pairs):
            return pattern
    return "^" + r"\D*\d+" * chosen.place + (r"\D*?" if sign else r"\D*") + number


def _pattern_of_all(
    adjusters: Mapping[_Field, str], fields: Sequence[_Field], names: Sequence[str]
) -> str:
    """Return an expression that finds each of several numbers under its name."""
    varied = list(adjusters)
    sign = "-?" if any(value.startswith("-") for n in fields for value in n.values) else ""
    groups = {number.place: rf"(?P<{name}>{sign}\d+)" for number, name in adjusters.items()}
    pieces = [_escaped(n.before) + groups.get(n.place, rf"{sign}\d+") for n in fields]
    first, last = varied[0].place, varied[-1].place
    if ending := _ENDING.search(varied[0].before):
        short = "".join([_escaped(ending[0]), groups[first], *pieces[first + 1 : last + 1]])
        values = list(zip(*(number.values for number in varied), strict=True))
        if [_finds(short, name)[:1] for name in names] == [[row] for row in values]:
            return short
    return "^" + "".join(pieces[: last + 1])


def _pattern_of_words(names: Sequence[str]) -> str:
    """Return an expression that finds the one word in which names differ; empty where none does."""
    rows = [_TOKEN.findall(_stem(name)) for name in names]
    if len({len(row) for row in rows}) != 1 or len(rows) < 2:
        return ""
    columns = list(zip(*rows, strict=True))
    differ = [
        k
        for k, column in enumerate(columns)
        if len({token.casefold() for token in column}) > 1
        and all(re.fullmatch(_WORD, token) for token in column)
    ]
    if len(differ) != 1:
        return ""
    (place,) = differ
    before = next((k for k in range(place - 1, -1, -1) if re.search(r"[^\W_]", rows[0][k])), None)
    if before is not None and len(set(columns[before])) > 1:
        return ""
    start = "^" if before is None else _escaped("".join(rows[0][before:place]))
    pattern = f"{start}(?P<setting>{_WORD})"
    words = [_finds(pattern, PurePath(name).name)[:1] for name in names]
    return pattern if words == [[(word,)] for word in columns[place]] else ""


def _pattern_of_signs(names: Sequence[str]) -> str:
    """Return an expression that finds a number with its sign; empty where no name has a plus."""
    words = {match[1] for name in names if "+" in name and (match := _SIGNED.search(name))}
    if len(words) != 1:
        return ""
    (word,) = words
    patterns = (f"{word}{gap}(?P<setting>[+-]?\\d+)" for gap in ("", "[ _=.]*"))
    return next((p for p in patterns if all(_finds(p, name) for name in names)), "")


# The setting that a log states: in its preamble, a column, or its file's name. A text there that is
# no setting is a LogError.


@dataclass(frozen=True, slots=True)
class LogLabel:
    """Setting and identity of a test, by one source."""

    places: Mapping[str, Place] = field(default_factory=dict)  # by adjuster; some may be missing
    others: Mapping[str, str] = field(default_factory=dict)  # as damper or serial number
    notes: tuple[str, ...] = ()

    def setting(self, adjusters: Sequence[str]) -> Setting | None:
        """Return the setting where every adjuster is known."""
        if any(name not in self.places for name in adjusters):
            return None
        return Setting(tuple((name, self.places[name]) for name in adjusters))

    def over(self, other: LogLabel) -> LogLabel:
        """Return this, completed from another source."""
        is_new = not self.places.keys() >= other.places.keys()
        return LogLabel(
            {**other.places, **self.places},
            {**other.others, **self.others},
            (*self.notes, *(other.notes if is_new else ())),
        )


def setting_in_words(text: str, subject: str, adjusters: Sequence[str] = (ADJUSTER,)) -> Setting:
    """Return the setting that a text states, or raise LogError."""
    try:
        return parse_setting(text, adjusters)
    except ValueError as error:
        raise LogError(
            f"setting {visible(text)}; {error}", subject=subject, code="unknown-setting"
        ) from error


def preamble_setting(
    metadata: Mapping[str, str], name: str, adjusters: Sequence[str], columns: Container[str] = ()
) -> LogLabel:
    """Return the label of a preamble: under ``setting``, or each adjuster by its name.

    Words for clicks may stand beside that name, where a number follows: ``Adjuster: 3 clicks``;
    they are not read for an adjuster that has a column.
    """
    if ADJUSTER in metadata:
        stated = setting_in_words(metadata[ADJUSTER], f"{name}: metadata '{ADJUSTER}'", adjusters)
        return LogLabel(dict(stated.places))
    names = {adjuster.casefold(): adjuster for adjuster in adjusters}
    by_name: dict[str, Place] = {}
    counted: dict[str, Place] = {}
    notes = []
    for key, text in metadata.items():
        words = re.findall(r"[^\W_]+", key)
        if adjuster := names.get("_".join(words)):
            stated = setting_in_words(text, f"{name}: metadata '{adjuster}'")
            by_name[adjuster] = stated.places[0][1]
            continue
        adjuster = names.get("_".join(word for word in words if word not in _OF_CLICKS) or ADJUSTER)
        with suppress(ValueError):
            place = parse_setting(text).places[0][1]
            if adjuster and adjuster not in columns and not isinstance(place, str):
                counted[adjuster] = place
                notes.append(f"{adjuster}: {place}, from the preamble: {key}: {text}")
    return LogLabel(counted | by_name, notes=tuple(notes))


def file_setting(name: str, pattern: str, adjusters: Sequence[str] = (ADJUSTER,)) -> LogLabel:
    """Return the label that a pattern finds in a file's name.

    Named groups are adjusters, damper or serial number; a group without a name is the label.
    """
    is_default = pattern == SETTING_PATTERN
    serial = re.search(_SERIAL, name, re.IGNORECASE)
    label = LogLabel(others={"serial": serial[1]} if serial else {})
    for expression in (_CLICKS_SETTING_NUMBER, pattern) if is_default else (pattern,):
        if matches := list(re.finditer(expression, name, re.IGNORECASE)):
            label = _label_in(matches, name, adjusters).over(label)
        if label.places:
            break
    if len(adjusters) > 1 and not label.places and is_default:
        with suppress(ValueError):
            places = dict(parse_setting(name.rpartition(".")[0] or name, adjusters).places)
            return LogLabel(places, notes=(FROM_NAME,)).over(label)
    return label


def _label_in(matches: list[re.Match[str]], name: str, adjusters: Sequence[str]) -> LogLabel:
    subject = f"{name}: file name"
    groups: dict[str, str] = {}
    for match in matches:
        groups |= {key: text for key, text in match.groupdict().items() if text is not None}
    places = {
        key: setting_in_words(text, subject).places[0][1]
        for key, text in groups.items()
        if key in adjusters
    }
    indexed = set(matches[-1].re.groupindex.values())
    plain = [text for k, text in enumerate(matches[-1].groups(), 1) if k not in indexed and text]
    if plain and not places:
        with suppress(ValueError):  # a bare number names no adjuster where there are several
            if len(adjusters) > 1:
                parse_setting(plain[-1], adjusters)
            places = dict(setting_in_words(plain[-1], subject, adjusters).places)
    others = {key: text for key, text in groups.items() if key in IDENTITY_KEYS}
    return LogLabel(places, others, (FROM_NAME,) if places else ())
