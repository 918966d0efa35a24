"""What is wrong, as a record: its words are made at the end, by whoever tells it.

Errors, warnings, findings and failures are `Problem`: raised or yielded with what they are about
and with their values; nobody reads a sentence to learn something. The command line, run.json and
the pages name an option (``--hold-out``), a call in Python the keyword (``hold_out=``), a
configuration file the line of a key. Lists group them by code (`listing`).
"""

from __future__ import annotations

import shlex
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, NamedTuple

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

__all__ = [
    "FEW",
    "Failure",
    "FilePlace",
    "Key",
    "Option",
    "Problem",
    "Where",
    "Words",
    "failure_lines",
    "listed_names",
    "listing",
    "note",
    "short_listing",
    "warning",
]

FEW = 20  # sentences in all that are shown one by one; a damper has some twenty settings
_SHOWN = 3  # sentences of one code that are shown one by one where there are many
_LONG = 200  # characters; a page of one paragraph again and again is not read
_NAMES = 5  # names that are listed
_MANY = 5  # tests of one file that fail alike and are listed one by one
_OF_SHELLS = frozenset("()<>`\\")  # what is advised is to be pasted
SEVERITIES = ("error", "refusal", "warning", "note")
# Codes that only name the class of an error: problems of such a code are alike in their text too.
_GENERAL = frozenset({
    *("failed", "usage", "installation", "log", "contradiction", "no-time", "unusable", "strict"),
    *("simulation", "cancelled", "output", "said"),
})  # fmt: skip


class Option(NamedTuple):
    """Something that a user gave or may give to a command or a call.

    Attributes
    ----------
    name : str
        As the keyword of a call, as in "hold_out".
    value : object
        What was given, or stands for what may be; empty: it is named alone.
    key : str
        Of NAME=VALUE: the name.
    is_aside : bool
        Within a sentence it stands in brackets, behind what it does.
    """

    name: str
    value: object = ""
    key: str = ""
    is_aside: bool = False


class Key(NamedTuple):
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


class FilePlace(NamedTuple):
    """A line of a file that a user gave, by the option that gave it; line 0: the whole file."""

    file: str
    line: int = 0
    option: Option | None = None


Where = Option | Key | FilePlace


class Words(NamedTuple):
    """What an outlet calls an option: that of a call in Python by its keyword.

    Examples
    --------
    >>> command, call = Words(), Words("damperfit.identify")
    >>> command.named(Option("hold_out", "4Hz")), call.named(Option("hold_out", "4Hz"))
    ('--hold-out 4Hz', "hold_out='4Hz'")
    >>> command.named(Option("fix", "50N", "f_f")), call.named(Option("fix", "50N", "f_f"))
    ('--fix f_f=50N', "fix={'f_f': '50N'}")
    >>> call.asked(Option("free"))
    'damperfit.identify(free=...)'
    """

    call: str = ""

    def named(self, option: Option) -> str:
        """Return what is called an option within a sentence."""
        name, key, value = option.name, option.key, str(option.value)
        if self.call:
            return _keyword(name, key, value)
        option_name = f"--{name.rstrip('_').replace('_', '-')}"
        given = f"{key}={value}" if key and value else key or value
        given = shlex.quote(given) if _OF_SHELLS & set(given) else given
        return f"{option_name} {given}" if given else option_name

    def asked(self, option: Option) -> str:
        """Return how a sentence begins that is about an option."""
        if not self.call:
            return self.named(option)
        return f"{self.call}({self.named(option._replace(value=option.value or '...'))})"


_COMMAND = Words()


def _keyword(name: str, key: str, value: str) -> str:
    if name == "rig" and key.startswith("units.") and value not in ("", "..."):
        value = repr(value)
    value = _in_python(value)
    if name == "rig" and key:  # units have a keyword of their own, other sections are mappings
        section, _, inner = key.rpartition(".")
        if section == "units":
            return f"units={{{inner!r}: {value}}}"
        inside = f"{{{inner!r}: {value}}}"
        return f"rig={{{section!r}: {inside}}}" if section else f"rig={inside}"
    return f"{name}={{{key!r}: {value}}}" if key else f"{name}={value}"


def _in_python(value: str) -> str:
    """Return a value as Python has it; numbers, and words such as N that stand for one, bare."""
    is_bare = value in {"", "...", "True", "False"} or value[0] in "'\"[{("
    if is_bare or (value.isalpha() and value.isupper()):
        return value
    try:
        float(value)
    except ValueError:
        return repr(value)
    return value


@dataclass(frozen=True, slots=True)
class Problem:
    """One warning, finding, refusal, failure or failed check.

    Attributes
    ----------
    code : str
        What kind of problem, the same in every release, as in "no-such-file".
    text : str
        What was found and expected, and what to do; with ``{name}`` in place of its values. Where
        it begins with ``{where}``, the option is named there and not before it.
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

    def sentence(self, words: Words = _COMMAND) -> str:
        """Return the problem as one sentence, its place first."""
        lead, text = self._lead(words), self.message(words)
        return f"{lead}: {text}" if lead and text else lead or text

    def __str__(self) -> str:
        return self.sentence()

    @property
    def likeness(self) -> str:
        """What problems have in common that are listed together."""
        if self.code not in _GENERAL:
            return self.code
        return f"{self.code}: {self.text.replace(self.subject, '') if self.subject else self.text}"

    def record(self) -> dict[str, Any]:
        """Return the problem as JSON values; `of_record` reads them back."""
        where = self.where
        values = {
            name: [value.name, str(value.value), value.key, value.is_aside]
            if isinstance(value, Option)
            else _worded(value, Words())
            for name, value in self.values.items()
        }
        return {
            "code": self.code,
            "severity": self.severity,
            "subject": self.subject,
            "where": where and {name: str(one) for name, one in where._asdict().items()},
            "message": self.message(),
            "text": self.text,
            "values": values,
        }

    @classmethod
    def of_record(cls, record: Mapping[str, Any]) -> Problem:
        """Return the problem that a record tells; of a damaged one what is there."""
        known = record.get("values")
        values = {
            name: Option(*value) if isinstance(value, list) else value
            for name, value in (known if isinstance(known, dict) else {}).items()
        }
        text = record.get("text", record.get("message", ""))
        return cls(
            str(record.get("code", "said")),
            str(text),
            str(record.get("severity", "warning")),
            str(record.get("subject") or ""),
            values=values,
        )

    @property
    def offered(self) -> tuple[Option, ...]:
        """The options that the sentence offers, also those of the problems that it joins."""
        found: list[Option] = []
        for value in self.values.values():
            inner = getattr(value, "problem", None)
            found += [value] if isinstance(value, Option) else getattr(inner, "offered", ())
        return tuple(found)

    def message(self, words: Words = _COMMAND) -> str:
        """Return the sentence without its place."""
        text = self.text
        if text.startswith("{where}") and isinstance(self.where, Option):
            text = text.replace("{where}", words.asked(self.where), 1)
        for name, value in self.values.items():
            text = text.replace(f"{{{name}}}", _worded(value, words))
        return text

    def _lead(self, words: Words) -> str:
        where, subject = self.where, self.subject
        if isinstance(where, Option):
            if self.text.startswith("{where}"):
                return subject
            if subject and not str(where.value):
                where, subject = where._replace(value=subject), ""
            return ": ".join(filter(None, (words.asked(where), subject)))
        if isinstance(where, FilePlace):
            file = f"{where.file}:{where.line}" if where.line else where.file
            if where.option is not None:
                given = words.asked(
                    where.option if words.call else where.option._replace(value=file)
                )
                file = f"{given}: {file}" if words.call else given
            return ": ".join(filter(None, (file, subject)))
        if isinstance(where, Key):
            return ": ".join(filter(None, (subject, ".".join(where.path))))
        return subject


def _worded(value: object, words: Words) -> str:
    if isinstance(value, Option):
        named = words.named(value)
        return f" ({named})" if value.is_aside else named
    problem = value if isinstance(value, Problem) else getattr(value, "problem", None)
    return problem.sentence(words) if isinstance(problem, Problem) else str(value)


def warning(code: str, text: str, subject: object = "", **values: Any) -> Problem:
    """Return what a reader should know before believing the figures."""
    return Problem(code, text, "warning", str(subject), values=values)


def note(code: str, text: str, subject: object = "", **values: Any) -> Problem:
    """Return what is good to know, and nothing to mend."""
    return Problem(code, text, "note", str(subject), values=values)


@dataclass(frozen=True, slots=True)
class Failure:
    """What ended the work on one log, one setting or one step, while the rest went on.

    Attributes
    ----------
    problem : Problem
        What is wrong.
    kind : str
        Name of the error class; the manual lists them (page gates).
    log, path : str
        Name and path of the log; empty when it is a whole setting that failed.
    setting : Setting or None
        Adjuster setting, when known.
    trace : str
        Of an internal error, where it happened, for whoever mends it.
    """

    problem: Problem
    kind: str
    log: str = ""
    path: str = ""
    setting: Any = None  # a Setting
    trace: str = ""

    @property
    def code(self) -> str:
        """What kind of problem, finer than `kind`."""
        return self.problem.code

    @property
    def message(self) -> str:
        """One sentence in the words of the command line: what, where, what to do."""
        return self.problem.sentence()

    @property
    def place(self) -> str:
        """The log, else the setting, that has no result."""
        return self.log or (f"setting {self.setting}" if self.setting is not None else "")

    @property
    def is_internal(self) -> bool:
        """Whether the fault is damperfit's own and not the logs'."""
        return self.kind == "InternalError"

    @property
    def is_left_out(self) -> bool:
        """Whether only strict quality refused the log: a gate that was missed, no failure."""
        return self.kind == "QualityError"

    @property
    def placed(self) -> Problem:
        """The problem with the log or setting that it is about as its subject."""
        problem, place = self.problem, self.place
        if not place or problem.subject or place in problem.text:
            return problem
        return replace(problem, subject=place)

    @property
    def line(self) -> str:
        """The failure as one line, its place first."""
        return self.placed.sentence()

    def describe(self) -> dict[str, Any]:
        """Return the failure for run.json."""
        known = {"log": self.log, "path": self.path, "setting": self.setting, "kind": self.kind}
        return {**self.problem.record(), **known, "message": self.message}


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


def failure_lines(failures: Iterable[Failure], words: Words = _COMMAND) -> list[str]:
    """Return a line for each failure; of many alike the first, and how many more.

    A logger that leaves out the setting does so in each of a file's hundreds of tests.
    """
    alike: dict[tuple[str, str], list[Problem]] = {}
    for failure in failures:
        key = (failure.path or failure.place, failure.problem.likeness)
        alike.setdefault(key, []).append(failure.placed)
    problems: list[Problem] = []
    for group in alike.values():
        if len(group) > _MANY:
            text = f"{group[0].text} (and {len(group) - 1} other tests of this file alike)"
            group[:] = [replace(group[0], text=text)]
        problems += group
    return listing(problems, words)


def short_listing(sentences: Iterable[object]) -> list[str]:
    """Return sentences that say themselves what they are about, each once; of many the first."""
    known = list(dict.fromkeys(map(str, sentences)))
    more = len(known) - FEW
    return known[:FEW] + ([f"and {more} more; run.json and --json list them all"] * (more > 0))


def listing(problems: Iterable[Problem], words: Words = _COMMAND, *, few: int = FEW) -> list[str]:
    """Return sentences, the gravest first; of many of one code the first, and how many more.

    A few are all shown, but for long ones of one code. Within a severity the order stays: what is
    wrong with a log is found before what it does to a setting.
    """
    everything = sorted(problems, key=lambda one: SEVERITIES.index(one.severity))
    groups: dict[str, list[Problem]] = {}
    for problem in everything:
        groups.setdefault(problem.likeness, []).append(problem)
    lines: list[str] = []
    for group in list(groups.values())[:few]:
        sentences = list(dict.fromkeys(problem.sentence(words) for problem in group))
        is_short = len(everything) <= few and max(map(len, sentences)) < _LONG
        if len(group) <= _SHOWN or is_short:
            lines += sentences
            continue
        names = listed_names(list(dict.fromkeys(one.subject for one in group[1:] if one.subject)))
        lines.append(f"{sentences[0]} (and {len(group) - 1} alike{': ' * bool(names)}{names})")
    if len(groups) > few:
        n, more = len(groups) - few, sum(map(len, list(groups.values())[few:]))
        lines.append(f"and {more} more of {n} other kinds; run.json and --json list them all")
    return lines
