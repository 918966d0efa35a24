"""Which setting a log is of: its preamble, a column or its file's name say it, or names tell it.

A preamble goes before a column, this before the name. Where nobody said where the setting stands in
names, those that differ in numbers alone, as in ``D7_C02.csv`` and ``D7_C08.csv``, show what was
turned: the one number that differs and is no speed, serial number or count of runs. Names of
another kind tell nothing, and cost most of the names nothing. Several such numbers are no guess but
a question, with what to declare where they are two adjusters.
"""

from __future__ import annotations

import re
import unicodedata
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import PurePath
from typing import TYPE_CHECKING

from damperfit.errors import LogError
from damperfit.io.channels import visible
from damperfit.io.options import SETTING_PATTERN
from damperfit.problem import Option, Problem, note
from damperfit.tested.adjuster_words import adjuster_of
from damperfit.tested.identity import IDENTITY_KEYS
from damperfit.tested.setting import ADJUSTER, Setting, parse_place, parse_setting
from damperfit.units.quantities import is_unit

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from damperfit.tested.setting import Place

__all__ = [
    "Guess",
    "LogLabel",
    "file_setting",
    "guess_settings",
    "one_of_several",
    "pattern_of_signs",
    "pattern_of_words",
    "place_from_number",
    "preamble_setting",
    "setting_in_words",
    "unclear_names",
]


# What names of logs differ in besides plain numbers: a word, or numbers with signs.
#
# Neither is guessed: a word may be anybody's, and a hyphen parts as often as it is a minus. It is
# shown as an option to copy.

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
_MAY_BE_DEGREES = "c"  # 25c is as well 25 clicks of compression
# What several numbers are called that have no word before them, or the same.
_PLACES = ("a", "b", "c", "d")
_FEWEST = 2  # adjusters
# A hyphen behind a blank or "_" is a minus, as in a label; behind a word it parts.
_NUMBERS = re.compile(r"((?:(?<=[\s_=])-)?\d+(?:\.\d+)?)")
# More than three digits are a serial number or a date; half clicks have the word before them.
_NUMBER = r"-?\d{1,3}"
_CLICK = r"-?\d{1,3}(\.\d)?"


@dataclass(frozen=True, slots=True)
class Guess:
    """What the names of logs tell of their settings.

    Attributes
    ----------
    settings : mapping of str to Setting
        By name; empty where the names leave a choice.
    sentence : str
        What was guessed, and how to say it for certain; empty without a guess.
    advice : str
        What to write where nothing was guessed, as an option to copy.
    adjusters : tuple of str
        Names of several adjusters, where each number that differs has the word of one before it.
    pattern : str
        Finds the place of each of these.
    """

    settings: Mapping[str, Setting] = field(default_factory=dict)
    said: Problem | None = None
    way: Problem | None = None
    adjusters: tuple[str, ...] = ()
    pattern: str = ""

    @property
    def sentence(self) -> str:
        """The guess in the words of the command line."""
        return "" if self.said is None else str(self.said)

    @property
    def advice(self) -> str:
        """What to declare, in the words of the command line."""
        return "" if self.way is None else str(self.way)


@dataclass(frozen=True, slots=True)
class _Field:
    """One number in names that differ in numbers alone."""

    place: int
    before: str
    word: str
    after: str
    values: tuple[str, ...]
    is_joined: bool = False

    @property
    def is_varied(self) -> bool:
        return len(set(self.values)) > 1

    @property
    def is_clicks(self) -> bool:
        return self.word in _CLICKS

    @property
    def may_be(self) -> bool:
        """Whether nothing says that it counts something else than clicks."""
        digits = _CLICK if self.is_clicks else _NUMBER
        is_short = all(re.fullmatch(digits, value) for value in self.values)
        after = self.after.casefold()
        has_unit = _is_unit(self.after) or after in _NO_CLICKS or after == _MAY_BE_DEGREES
        if self.is_joined and len(after) == 1:
            has_unit = False  # R12C08: the letter is of the number behind it
        return is_short and not has_unit and self.word not in _NO_CLICKS


def guess_settings(names: Iterable[str]) -> Guess:
    r"""Return what the names of logs tell of their settings.

    Parameters
    ----------
    names : iterable of str
        Of the files whose setting nobody said.

    Examples
    --------
    >>> guess = guess_settings(["D7_C02.csv", "D7_C08.csv"])
    >>> guess.settings["D7_C08.csv"].cell
    8
    >>> guess.sentence.endswith("--rig 'setting_pattern=C(?P<setting>\\d+)'")
    True
    """
    groups = _kinds(names)
    if not groups:
        return Guess()
    whole = [name for group in groups.values() for name in group]
    told = pattern_of_signs(whole) or (pattern_of_words(whole) if len(groups) > 1 else "")
    if told:
        return Guess(way=_declaring(told))
    texts, alike = max(groups.items(), key=lambda pair: len(pair[1]))
    fields = _fields(texts, alike)
    n_names = sum(map(len, groups.values()))
    is_most = len(groups) == 1 or (len(alike) > 1 and 2 * len(alike) > n_names)
    chosen = _chosen(fields) if is_most else None
    if chosen is None:
        best = _likely(fields)
        called = _called(fields)
        every = _pattern_of_all(called, fields, alike) if called else ""
        names = tuple(called.values())
        way = _declaring(_pattern(best, alike) if best else "", names, every)
        is_said = len(groups) == 1 and names != _PLACES[: len(names)]
        if is_said and all(adjuster_of(one.word) for one in called):
            return Guess(way=way, adjusters=names, pattern=every)
        return Guess(way=way)
    pattern = _pattern(chosen, alike)
    settings = {
        name: Setting.of(parse_place(value))
        for name, value in zip(alike, chosen.values, strict=True)
    }
    why = "what differs between the names" if chosen.is_varied else "the clicks in the name"
    where = f"the number after '{chosen.before}'" if chosen.before else "the first number"
    return Guess(
        settings,
        note(
            "setting-guessed",
            "the setting is guessed from the file names: {why}, {where}; to confirm it: {option}",
            why=why,
            where=where,
            option=_option(pattern),
        ),
        _declaring(pattern),
        pattern=pattern,
    )


def one_of_several(name: str) -> str:
    """Return the number after a bare "s" where others in the name may count clicks too.

    Examples
    --------
    >>> one_of_several("t1_2_24_s5_100psi.csv"), one_of_several("run3_s5_1.5Hz.csv")
    ('5', '')
    """
    fields = _fields(_texts(name), [name])
    chosen = [one for one in fields if one.word == "s" and one.may_be]
    others = any(one.may_be for one in fields if one.word != "s")
    return chosen[-1].values[0] if chosen and others else ""


def unclear_names(names: Iterable[str]) -> frozenset[str]:
    """Return the names in which the number after a bare "s" is no setting for certain.

    Others in them vary too, and may count clicks: then "s" may be the speed of the test. A number
    that is another one in each name counts the logs.

    Parameters
    ----------
    names : iterable of str
        Of all logs of a run.

    Examples
    --------
    >>> clicks = ["t1_2_24_s1.csv", "t1_2_24_s5.csv", "t1_2_12_s1.csv", "t1_2_12_s5.csv"]
    >>> unclear_names(clicks) == set(clicks)
    True
    >>> unclear_names(["001_s5.csv", "002_s5.csv", "003_s6.csv"])
    frozenset()
    """
    found: set[str] = set()
    for texts, alike in _kinds(names).items():
        fields = [one for one in _fields(texts, alike) if one.may_be]
        others = [one for one in fields if one.word != "s" and one.is_varied]
        is_count = len(others) == 1 and len(set(others[0].values)) == len(alike)
        if others and not is_count and any(one.word == "s" for one in fields):
            found.update(alike)
    return frozenset(found)


def _kinds(names: Iterable[str]) -> dict[tuple[str, ...], list[str]]:
    """Return names, each once, by what they have besides numbers."""
    groups: dict[tuple[str, ...], list[str]] = {}
    for name in dict.fromkeys(names):
        groups.setdefault(_texts(name), []).append(name)
    return groups


def _texts(name: str) -> tuple[str, ...]:
    return tuple(part.casefold() for part in _parts(name)[::2])


def _plain(text: str) -> str:
    """Return the text without accents, however a file system wrote them."""
    letters = unicodedata.normalize("NFD", text)
    return "".join(one for one in letters if not unicodedata.combining(one))


def _parts(name: str) -> list[str]:
    """Return text and numbers of a name in turn, text first; the suffixes are left out."""
    path = PurePath(name)
    while re.fullmatch(r"\.[A-Za-z]\w{0,7}", path.suffix):
        path = path.with_suffix("")
    return _NUMBERS.split(path.name)


def _fields(texts: Sequence[str], names: Sequence[str]) -> list[_Field]:
    numbers = [_parts(name)[1::2] for name in names]
    first = _parts(names[0])[::2]
    found = []
    for k in range(len(texts) - 1):
        word = re.search(r"([^\W\d_]+)[ _=.-]*$", _plain(texts[k]))
        # As written: degC and kN are units.
        after = re.match(r" ?(?:[\u00b0\u00ba\u02da] ?)?([^\W\d_]+)", first[k + 1])
        values = tuple(row[k] for row in numbers)
        # What stands at a number is its unit, and no word of the next one: 1.5Hz_3.
        unit = re.fullmatch(r" ?([^\W\d_]+)[ _=.-]+", first[k]) if k else None
        is_word = not (unit and _is_unit(unit[1]))
        found.append(
            _Field(
                k,
                first[k],
                word[1] if word and is_word else "",
                after[1] if after else "",
                values,
                is_joined=after is not None and first[k + 1] == after[1] and k + 2 < len(first),
            )
        )
    return found


def _is_unit(word: str) -> bool:
    return is_unit(word) or is_unit(word.casefold())


def _chosen(fields: Sequence[_Field]) -> _Field | None:
    """Return the number that counts clicks; None where there is none or a choice."""
    clicks = [one for one in fields if one.is_clicks and one.may_be]
    varied = [one for one in fields if one.is_varied and one.may_be]
    for found in (clicks, varied):
        if len(found) == 1:
            return found[0]
        if found:
            return None
    return None


def _likely(fields: Sequence[_Field]) -> _Field | None:
    """Return the number that an option to copy shows."""
    ranked = sorted(
        fields, key=lambda one: (not one.is_clicks, not one.may_be, not one.is_varied, one.place)
    )
    return ranked[0] if ranked else None


def _called(fields: Sequence[_Field]) -> dict[_Field, str]:
    """Return what to call the numbers that differ, where several may be adjusters."""
    varied = [one for one in fields if one.is_varied and one.may_be]
    if len(varied) > len(_PLACES):
        varied = [one for one in varied if one.word != "s"]  # a speed, as likely
    if not _FEWEST <= len(varied) <= len(_PLACES):
        return {}
    called = [adjuster_of(one.word) or one.word.casefold() for one in varied]
    if len(set(called)) < len(called) or not all(one.isascii() and one for one in called):
        called = list(_PLACES[: len(varied)])
    return dict(zip(varied, called, strict=True))


def _declaring(pattern: str, called: Sequence[str] = (), every: str = "") -> Problem | None:
    """Return what to declare; also where several of the numbers that differ are adjusters."""
    if not called:
        return note("setting-in-names", "{option}", option=_option(pattern)) if pattern else None
    declared = ", ".join(f'{one} = ""' for one in called)
    text = (
        "; or, where several adjusters were turned, declare them in a configuration, [adjusters] "
        f"{declared}, and give it with {{config}} and {{every}}"
    )
    values = {"config": Option("config"), "every": _option(every)}
    if pattern:
        text, values = f"{{option}}{text}", {**values, "option": _option(pattern)}
    return note("setting-in-names", text, **values)


def _pattern_of_all(
    called: Mapping[_Field, str], fields: Sequence[_Field], names: Sequence[str]
) -> str:
    """Return an expression that finds each of several numbers under its name."""
    sign = "-?" if any(value.startswith("-") for one in fields for value in one.values) else ""
    number = {one.place: rf"(?P<{name}>{sign}\d+)" for one, name in called.items()}
    varied = list(called)
    ending = re.search(r"[^\W\d_]+[ _=.-]*$", varied[0].before)
    texts = [re.escape(one.before).replace(r"\ ", " ").replace(r"\-", "-") for one in fields]
    short = re.escape(ending[0]).replace(r"\-", "-") if ending else ""
    parts = [number.get(one.place, rf"{sign}\d+") for one in fields]
    first, last = varied[0].place, varied[-1].place
    rest = parts[first] + "".join(texts[k] + parts[k] for k in range(first + 1, last + 1))
    before = "".join(texts[k] + parts[k] for k in range(first)) + texts[first]
    is_enough = bool(short) and all(
        _finds_all(short + rest, name, varied, k) for k, name in enumerate(names)
    )
    return short + rest if is_enough else f"^{before}{rest}"


def _finds_all(pattern: str, name: str, varied: Sequence[_Field], k: int) -> bool:
    match = re.search(pattern, name, re.IGNORECASE)
    return match is not None and match.groups() == tuple(one.values[k] for one in varied)


def _pattern(chosen: _Field, names: Sequence[str]) -> str:
    r"""Return an expression that finds the number, and nothing else, in every name."""
    ending = re.search(r"[^\W\d_]+[ _=.-]*$|[ _=.-]+$", chosen.before)
    short = ending[0] if ending else ""
    sign = "-?" if any(value.startswith("-") for value in chosen.values) else ""
    half = r"(?:\.\d)?" if any("." in value for value in chosen.values) else ""
    number = rf"(?P<setting>{sign}\d+{half})"
    for start in (short, chosen.before):
        pattern = f"{re.escape(start)}{number}".replace(r"\ ", " ").replace(r"\-", "-")
        if start and all(
            _finds(pattern, name, value) for name, value in zip(names, chosen.values, strict=True)
        ):
            return pattern
    return "^" + r"\D*\d+" * chosen.place + (r"\D*?" if sign else r"\D*") + number


def _finds(pattern: str, name: str, value: str) -> bool:
    return [match["setting"] for match in re.finditer(pattern, name, re.IGNORECASE)][-1:] == [value]


def _option(pattern: str) -> Option:
    return Option("rig", pattern, "setting_pattern")


# Where the adjusters stand as a log says it: in its preamble, a column, or its file's name.

# A word that can mean nothing else, where nobody declared a pattern: it goes before a bare "s".
_CLICKS_SETTING_NUMBER = r"(?<![^\W_])clicks?(?:[ _=](?=-\d)|[ _=-]?)(-?\d+)(?![.]?\d)"
_SERIAL = r"(?<![^\W_])(?:sn|serial)[ _=-]?([a-z]?\d\w*?)(?![^\W_])"


@dataclass(frozen=True, slots=True)
class LogLabel:
    """What one source says of a test.

    Attributes
    ----------
    places : mapping of str to Place
        Where adjusters stand, by name; some may be missing.
    others : mapping of str to str
        What else a file name says, as damper or serial number.
    notes : tuple of str
        How it was found.
    """

    places: Mapping[str, Place] = field(default_factory=dict)
    others: Mapping[str, str] = field(default_factory=dict)
    notes: tuple[str, ...] = ()

    def setting(self, adjusters: Sequence[str]) -> Setting | None:
        """Return the setting where every adjuster is known."""
        if any(name not in self.places for name in adjusters):
            return None
        return Setting(tuple((name, self.places[name]) for name in adjusters))

    def over(self, other: LogLabel) -> LogLabel:
        """Return this with what it does not say taken from another source."""
        new = {name for name in other.places if name not in self.places}
        return LogLabel(
            {**other.places, **self.places},
            {**other.others, **self.others},
            (*self.notes, *(other.notes if new else ())),
        )


def setting_in_words(text: str, where: str, adjusters: Sequence[str] = (ADJUSTER,)) -> Setting:
    """Return the setting that a text says.

    Raises
    ------
    LogError
        It says none.

    Examples
    --------
    >>> setting_in_words("10", "log.csv").cell, setting_in_words("soft", "log.csv").cell
    (10, 'soft')
    """
    try:
        return parse_setting(text, adjusters)
    except ValueError as error:
        raise LogError(f"setting {visible(text)}; {error}", subject=where) from error


def preamble_setting(metadata: Mapping[str, str], name: str, adjusters: Sequence[str]) -> LogLabel:
    """Return what a preamble says: a label under ``setting``, or each adjuster by its name.

    Raises
    ------
    LogError
        What stands there is no setting.
    """
    if ADJUSTER in metadata:
        stated = setting_in_words(metadata[ADJUSTER], f"{name}: metadata '{ADJUSTER}'", adjusters)
        return LogLabel(dict(stated.places))
    keys = {re.sub(r"[\W_]+", "_", key.strip()): key for key in metadata}
    named = {one: metadata[keys[one.casefold()]] for one in adjusters if one.casefold() in keys}
    return LogLabel(
        {
            one: setting_in_words(text, f"{name}: metadata '{one}'").places[0][1]
            for one, text in named.items()
        }
    )


def file_setting(name: str, pattern: str, adjusters: Sequence[str] = (ADJUSTER,)) -> LogLabel:
    """Return what a file's name says by a pattern.

    Named groups are adjusters, damper or serial number; a group without a name is the label.

    Raises
    ------
    LogError
        What the pattern finds is no setting.
    """
    tried = (_CLICKS_SETTING_NUMBER, pattern) if pattern == SETTING_PATTERN else (pattern,)
    serial = re.search(_SERIAL, name, re.IGNORECASE)
    named = LogLabel(others={"serial": serial[1]} if serial else {})
    for one in tried:
        if found := list(re.finditer(one, name, re.IGNORECASE)):
            named = _label_in(found, name, adjusters).over(named)
        if named.places:
            break
    if len(adjusters) > 1 and not named.places and pattern == SETTING_PATTERN:
        with suppress(ValueError):
            places = dict(parse_setting(name.rpartition(".")[0] or name, adjusters).places)
            return LogLabel(places, notes=("setting: from the file name",)).over(named)
    return named


def _label_in(found: Sequence[re.Match[str]], name: str, adjusters: Sequence[str]) -> LogLabel:
    where = f"{name}: file name"
    named: dict[str, str] = {}
    for match in found:
        named |= {key: text for key, text in match.groupdict().items() if text is not None}
    places = {
        key: setting_in_words(text, where).places[0][1]
        for key, text in named.items()
        if key in adjusters
    }
    others = {key: text for key, text in named.items() if key in IDENTITY_KEYS}
    indexed = set(found[-1].re.groupindex.values())
    plain = [text for k, text in enumerate(found[-1].groups(), 1) if k not in indexed and text]
    if plain and not places and (len(adjusters) == 1 or _is_label(plain[-1], adjusters)):
        places = dict(setting_in_words(plain[-1], where, adjusters).places)
    notes = ("setting: from the file name",) if places else ()
    return LogLabel(places, others, notes)


def _is_label(text: str, adjusters: Sequence[str]) -> bool:
    """Whether a text names every adjuster; a bare number does not where there are several."""
    try:
        parse_setting(text, adjusters)
    except ValueError:
        return False
    return True


def place_from_number(number: float, where: str) -> Place:
    """Return where a column's number says that an adjuster stands.

    Raises
    ------
    LogError
        It counts no clicks.
    """
    try:
        return parse_place(f"{number:.15g}")
    except ValueError as error:
        raise LogError(f"{number:.6g}; {error}", subject=where) from error
