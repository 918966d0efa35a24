"""Where the adjusters stand as a log says it: in its preamble, a column, or its file's name."""

from __future__ import annotations

import re
from contextlib import suppress
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from damperfit.errors import LogError
from damperfit.readers.channels import visible
from damperfit.readers.options import SETTING_PATTERN
from damperfit.tested.identity import IDENTITY_KEYS
from damperfit.tested.setting import ADJUSTER, Setting, parse_place, parse_setting

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from damperfit.tested.setting import Place

__all__ = ["LogLabel", "file_setting", "place_from_number", "preamble_setting", "setting_in_words"]

# A word that can mean nothing else, where nobody declared a pattern: it goes before a bare "s".
_CLICKS = r"(?<![^\W_])clicks?(?:[ _=](?=-\d)|[ _=-]?)(-?\d+)(?![.]?\d)"
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
        raise LogError(f"{where}: setting {visible(text)}; {error}") from error


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
    tried = (_CLICKS, pattern) if pattern == SETTING_PATTERN else (pattern,)
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
        raise LogError(f"{where}: {number:.6g}; {error}") from error
