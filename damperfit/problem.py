"""What is wrong, as a record: its words are made at the end, by whoever tells it.

A problem is raised with what it is about and with its values; nobody reads a sentence to learn
something. The command line names an option (``--hold-out``), a call the keyword (``hold_out=``), a
configuration file the line of a key.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Mapping

__all__ = ["FilePlace", "Key", "Option", "Problem", "Where", "Words"]


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
    beside : tuple of str
        Other keys of the section that it does not go with: the one given last is blamed.
    """

    path: tuple[str, ...]
    beside: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class FilePlace:
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


Where = Option | Key | FilePlace


@dataclass(frozen=True, slots=True)
class Words:
    """What an outlet calls an option.

    Attributes
    ----------
    call : str
        Of a call in Python its function; empty: the command line.

    Examples
    --------
    >>> command, call = Words(), Words("damperfit.identify")
    >>> command.named(Option("hold_out", "4Hz")), call.named(Option("hold_out", "4Hz"))
    ('--hold-out 4Hz', 'hold_out=4Hz')
    >>> command.named(Option("fix", "50N", "f_f")), call.named(Option("fix", "50N", "f_f"))
    ('--fix f_f=50N', "fix={'f_f': 50N}")
    >>> call.asked(Option("free"))
    'damperfit.identify(free=...)'
    """

    call: str = ""

    def named(self, option: Option) -> str:
        """Return what is called an option within a sentence."""
        name, key, value = option.name, option.key, str(option.value)
        if self.call:
            return _keyword(name, key, value)
        option_name = f"--{name.replace('_', '-')}"
        given = f"{key}={value}" if key and value else key or value
        return f"{option_name} {given}" if given else option_name

    def asked(self, option: Option) -> str:
        """Return how a sentence begins that is about an option."""
        if not self.call:
            return self.named(option)
        return f"{self.call}({self.named(replace(option, value=option.value or '...'))})"


def _keyword(name: str, key: str, value: str) -> str:
    if name == "rig" and key:  # units have a keyword of their own, other sections are mappings
        section, _, inner = key.rpartition(".")
        if section == "units":
            return f"units={{{inner!r}: {value if value == '...' else repr(value)}}}"
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
    where : Option, Key, FilePlace or None
        Where a user asked for it.
    values : mapping
        By name; an `Option` among them is worded by the outlet.

    Examples
    --------
    >>> p = Problem("no-setting", "give {how}", subject="a.csv", values={"how": Option("setting")})
    >>> p.sentence(), p.sentence(Words("damperfit.identify"))
    ('a.csv: give --setting', 'a.csv: give setting=')
    """

    code: str
    text: str
    severity: str = "error"
    subject: str = ""
    where: Where | None = None
    values: Mapping[str, Any] = field(default_factory=dict)

    def sentence(self, words: Words = Words()) -> str:
        """Return the problem as one sentence, its place first."""
        lead, text = self._lead(words), self.message(words)
        return f"{lead}: {text}" if lead and text else lead or text

    @property
    def offered(self) -> tuple[Option, ...]:
        """The options that the sentence offers, also those of the problems that it joins."""
        found: list[Option] = []
        for value in self.values.values():
            inner = getattr(value, "problem", None)
            found += [value] if isinstance(value, Option) else getattr(inner, "offered", ())
        return tuple(found)

    def message(self, words: Words = Words()) -> str:
        """Return the sentence without its place."""
        text = self.text
        for name, value in self.values.items():
            text = text.replace(f"{{{name}}}", _worded(value, words))
        return text

    def _lead(self, words: Words) -> str:
        where, subject = self.where, self.subject
        if isinstance(where, Option):
            if subject and not str(where.value):
                where, subject = replace(where, value=subject), ""
            return ": ".join(filter(None, (words.asked(where), subject)))
        if isinstance(where, FilePlace):
            file = f"{where.file}:{where.line}" if where.line else where.file
            if where.option is not None:
                given = words.asked(
                    where.option if words.call else replace(where.option, value=file)
                )
                file = f"{given}: {file}" if words.call else given
            return ": ".join(filter(None, (file, subject)))
        if isinstance(where, Key):
            return ": ".join(filter(None, (subject, ".".join(where.path))))
        return subject


def _worded(value: object, words: Words) -> str:
    if isinstance(value, Option):
        return words.named(value)
    problem = getattr(value, "problem", None)
    return problem.sentence(words) if isinstance(problem, Problem) else str(value)
