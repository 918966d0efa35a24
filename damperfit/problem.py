"""What is wrong, as a record: its words are made at the end, by whoever tells it.

A problem is raised with what it is about and with its values; nobody reads a sentence to learn
something. The command line names an option (``--hold-out``), a call the keyword (``hold_out=``), a
configuration file the line of a key.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from string import Formatter
from typing import Any

__all__ = ["Key", "Option", "Place", "Problem", "Where", "Words", "as_keyword", "as_option"]


@dataclass(frozen=True, slots=True)
class Option:
    """Something that a user gave or may give to a command or a call.

    Attributes
    ----------
    name : str
        As the keyword of a call, as in "hold_out".
    value : object
        What was given, or stands for what may be; empty: it is named alone.
    key : str
        Of NAME=VALUE: the name.

    Examples
    --------
    >>> as_option(Option("hold_out", "4Hz")), as_keyword(Option("hold_out", "4Hz"))
    ('--hold-out 4Hz', 'hold_out=4Hz')
    >>> as_option(Option("fix", "50N", "f_f")), as_keyword(Option("fix", "50N", "f_f"))
    ('--fix f_f=50N', "fix={'f_f': 50N}")
    """

    name: str
    value: object = ""
    key: str = ""


@dataclass(frozen=True, slots=True)
class Key:
    """A key of the configuration.

    Attributes
    ----------
    path : tuple of str
        Section and key, as in ("rig", "skew"); the section may be left out below it.
    """

    path: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Place:
    """A line of a file that a user gave.

    Attributes
    ----------
    file : str
        Its path as given.
    line : int
        From 1; 0: the file as a whole.
    option : Option or None
        What gave the file.
    """

    file: str
    line: int = 0
    option: Option | None = None


Where = Option | Key | Place
Words = Callable[[Option], str]


def as_option(option: Option) -> str:
    """Name an option as the command line does."""
    name = f"--{option.name.replace('_', '-')}"
    if option.key:
        return f"{name} {option.key}={option.value}"
    return f"{name} {option.value}" if str(option.value) else name


def as_keyword(option: Option) -> str:
    """Name an option as a call in Python does."""
    name, key, value = option.name, option.key, option.value
    if name == "rig" and key:  # units have a keyword of their own, other sections are mappings
        section, _, inner = key.rpartition(".")
        if section == "units":
            return f"units={{{inner!r}: {value!r}}}"
        inside = f"{{{inner!r}: {value}}}"
        return f"rig={{{section!r}: {inside}}}" if section else f"rig={inside}"
    return f"{name}={{{key!r}: {value}}}" if key else f"{name}={value}"


@dataclass(frozen=True, slots=True)
class Problem:
    """One warning, finding, refusal, failure or failed check.

    Attributes
    ----------
    code : str
        What kind of problem, the same in every release, as in "no-such-file".
    text : str
        What was found and expected, and what to do; with ``{name}`` in place of its values.
    severity : str
        "error", "warning" or "note".
    subject : str
        The log, file or setting that it is about.
    where : Option, Key, Place or None
        Where a user asked for it.
    values : mapping
        By name; an `Option` among them is worded by the outlet.

    Examples
    --------
    >>> p = Problem("no-setting", "give {how}", subject="a.csv", values={"how": Option("setting")})
    >>> p.sentence(), p.sentence(as_keyword)
    ('a.csv: give --setting', 'a.csv: give setting=')
    """

    code: str
    text: str
    severity: str = "error"
    subject: str = ""
    where: Where | None = None
    values: Mapping[str, Any] = field(default_factory=dict)

    def sentence(self, words: Words = as_option) -> str:
        """Return the problem as one sentence, its place first."""
        lead, text = self._lead(words), self.message(words)
        return f"{lead}: {text}" if lead and text else lead or text

    def message(self, words: Words = as_option) -> str:
        """Return the sentence without its place."""
        return _Worded(words).vformat(self.text, (), self.values) if self.values else self.text

    def _lead(self, words: Words) -> str:
        where, subject = self.where, self.subject
        if isinstance(where, Option):
            if subject and not str(where.value):
                where, subject = replace(where, value=subject), ""
            return ": ".join(filter(None, (words(where), subject)))
        if isinstance(where, Place):
            file = f"{where.file}:{where.line}" if where.line else where.file
            given = "" if where.option is None else words(replace(where.option, value=file))
            return ": ".join(filter(None, (given or file, subject)))
        if isinstance(where, Key):
            return ": ".join(filter(None, (subject, ".".join(where.path))))
        return subject


class _Worded(Formatter):
    """Formats values; options and problems among them in the words of an outlet."""

    def __init__(self, words: Words) -> None:
        self._words = words

    def convert_field(self, value: Any, conversion: Any) -> Any:
        if isinstance(value, Option):
            value = self._words(value)
        elif isinstance(problem := getattr(value, "problem", None), Problem):
            value = problem.sentence(self._words)
        return super().convert_field(value, conversion)
