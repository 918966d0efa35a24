"""What is wrong, as a record: its sentence is made at the end, where it is shown.

Errors, warnings, findings and failures are `Problem`: raised or yielded with their subject and
values; no code reads a sentence. The command line, run.json and the pages name an option
(``--hold-out``), a call in Python the keyword (``hold_out=``), a configuration file the line of a
key. Lists group them by code (`listing`).
"""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from keyword import iskeyword
from typing import Any, NamedTuple

FEW = 20  # sentences in all that are shown one by one; a damper has some twenty settings
SHOWN = 3  # sentences of one code that are shown one by one where there are many
_LONG = 200  # characters; a page of one paragraph again and again is not read
_NAMES = 5  # names that are listed
_MANY = 5  # tests of one file with the same failure that are listed one by one
SEVERITIES = ("error", "refusal", "warning", "note")
# Codes that only name the class of an error: their problems are grouped by their text too.
_GENERAL = frozenset({
    *("failed", "usage", "installation", "log", "contradiction", "no-time", "unusable", "strict"),
    *("simulation", "cancelled", "output", "said"),
})  # fmt: skip


class Option(NamedTuple):
    """An option that a user gave or may give, by the keyword of a call, as in "hold_out"."""

    name: str
    value: object = ""  # empty: the option is named alone
    key: str = ""  # of NAME=VALUE: the name
    is_aside: bool = False  # within a sentence it stands in brackets, behind what it does


class Key(NamedTuple):
    """A key of the configuration, as ("rig", "skew"); below a section that may be left out."""

    path: tuple[str, ...]
    beside: tuple[str, ...] = ()  # keys that it does not go with: the one given last is blamed


class FilePlace(NamedTuple):
    """A line of a file that a user gave, by the option that gave it; line 0: the whole file."""

    file: str
    line: int = 0
    option: Option | None = None


Where = Option | Key | FilePlace


class Words(NamedTuple):
    """What an outlet calls an option: that of a call in Python by its keyword.

    >>> command, call = Words(), Words("damperfit.identify")
    >>> command.named(Option("hold_out", "4Hz")), call.named(Option("hold_out", "4Hz"))
    ('--hold-out 4Hz', "hold_out='4Hz'")
    >>> command.named(Option("fix", "50N", "f_f")), call.named(Option("fix", "50N", "f_f"))
    ('--fix f_f=50N', "fix={'f_f': '50N'}")
    """

    call: str = ""

    def named(self, option: Option) -> str:
        """Return the name of an option within a sentence."""
        name, key, value = option.name, option.key, str(option.value)
        if not self.call:
            value = "" if option.value is True and not key else value  # a flag
            given = f"{key}={value}" if key and value else key or value
            if {*"()<>`\\"} & {*given}:  # a user may paste it
                given = shlex.quote(given)
            return f"--{name.rstrip('_').replace('_', '-')} {given}".rstrip()
        section, _, inner = key.rpartition(".") if name == "rig" else ("", "", key)
        is_bare = value in {"", "...", "True", "False"} or value[0] in "'\"[{("
        is_word = value.isalpha() and value.isupper()  # such as N, which stands for a number
        if not (is_bare or is_word) or (section == "units" and value not in {"", "..."}):
            try:
                float(value)
            except ValueError:
                value = repr(value)
        if not key:
            return f"{name}={value}"
        inside = f"{{{inner!r}: {value}}}"
        if section == "units":  # which have a keyword of their own
            return f"units={inside}"
        return f"{name}={{{section!r}: {inside}}}" if section else f"{name}={inside}"

    def asked(self, option: Option) -> str:
        """Return the beginning of a sentence about an option."""
        if not self.call:
            return self.named(option)
        return f"{self.call}({self.named(option._replace(value=option.value or '...'))})"


_COMMAND = Words()
_OFFERED = re.compile(r"\{--([a-z-]+)(?: ([^{}]*))?\}")


def _option(offered: re.Match[str]) -> Option:
    name = offered[1].replace("-", "_")
    return Option(f"{name}_" if iskeyword(name) else name, offered[2] or "")


@dataclass(frozen=True, slots=True)
class Problem:
    """One warning, finding, refusal, failure or failed check.

    >>> p = Problem("no-setting", "give {--setting}", subject="a.csv")
    >>> p.sentence(), p.sentence(Words("damperfit.identify"))
    ('a.csv: give --setting', 'a.csv: give setting=')
    >>> Problem("question", "give {--for}").sentence(Words("damperfit.advise"))
    'give for_='
    """

    code: str  # the same in every release, as in "no-such-file"
    # With {name} in place of its values, {--option VALUE} for what is offered; {where} at its
    # beginning: named there, not before it.
    text: str
    severity: str = "error"  # one of `SEVERITIES`
    subject: str = ""  # the log, file or setting that it is about
    where: Where | None = None  # where a user asked for it
    values: Mapping[str, Any] = field(default_factory=dict)  # options are worded by the outlet

    def sentence(self, words: Words = _COMMAND) -> str:
        """Return the problem as one sentence, its place first."""
        return ": ".join(filter(None, (*self._lead(words), self.message(words))))

    def __str__(self) -> str:
        return self.sentence()

    def message(self, words: Words = _COMMAND) -> str:
        """Return the sentence without its place."""
        text = self.text
        if text.startswith("{where}") and isinstance(self.where, Option):
            text = text.replace("{where}", words.asked(self.where), 1)
        text = _OFFERED.sub(lambda offered: words.named(_option(offered)), text)
        for name, value in self.values.items():
            text = text.replace(f"{{{name}}}", _worded(value, words))
        return text

    def of(self, place: object) -> Problem:
        """Return the problem with a place, as that of its run, before its own."""
        return replace(
            self, text="{problem}", subject=str(place), where=None, values={"problem": self}
        )

    def _lead(self, words: Words) -> tuple[str, ...]:
        where, subject = self.where, self.subject
        if isinstance(where, Option):
            if self.text.startswith("{where}"):
                return (subject,)
            if subject and not str(where.value):
                where, subject = where._replace(value=subject), ""
            return words.asked(where), subject
        if isinstance(where, FilePlace):
            file = f"{where.file}:{where.line}" if where.line else where.file
            if where.option is not None and words.call:
                return words.asked(where.option), file, subject
            given = None if where.option is None else where.option._replace(value=file)
            return file if given is None else words.asked(given), subject
        return subject, ".".join(where.path) if where else ""

    @property
    def likeness(self) -> str:
        """What problems have in common that are listed together."""
        if self.code not in _GENERAL:
            return self.code
        return f"{self.code}: {self.text.replace(self.subject, '') if self.subject else self.text}"

    @property
    def offered(self) -> tuple[Option, ...]:
        """The options that the sentence offers, also those of the problems that it joins."""
        options = [_option(offered) for offered in _OFFERED.finditer(self.text)]
        for value in self.values.values():
            inner = getattr(value, "problem", None)
            options += [value] if isinstance(value, Option) else getattr(inner, "offered", ())
        return tuple(options)

    def record(self) -> dict[str, Any]:
        """Return the problem as JSON values; `of_record` reads them back."""
        where = self.where
        values = {
            name: [value.name, str(value.value), value.key, value.is_aside]
            if isinstance(value, Option)
            else value
            if isinstance(value, int | float)
            else _worded(value, _COMMAND)
            for name, value in self.values.items()
        }
        return {
            "code": self.code,
            "severity": self.severity,
            "subject": self.subject,
            "where": where and {name: str(text) for name, text in where._asdict().items()},
            "message": self.message(),
            "text": self.text,
            "values": values,
        }

    @classmethod
    def of_record(cls, record: Mapping[str, Any]) -> Problem:
        """Return the problem of a record; of a damaged one what is there."""
        stored = record.get("values")
        values = {
            name: Option(*value) if isinstance(value, list) else value
            for name, value in (stored if isinstance(stored, dict) else {}).items()
        }
        text = str(record.get("text", record.get("message", "")))
        code, subject = str(record.get("code", "said")), str(record.get("subject") or "")
        return cls(code, text, str(record.get("severity", "warning")), subject, values=values)


def _worded(value: object, words: Words) -> str:
    if isinstance(value, Option):
        named = words.named(value)
        return f" ({named})" if value.is_aside else named
    problem = value if isinstance(value, Problem) else getattr(value, "problem", None)
    return problem.sentence(words) if isinstance(problem, Problem) else str(value)


def warning(code: str, text: str, subject: object = "", **values: Any) -> Problem:
    """Return a warning: a reader should know it before believing the figures."""
    return Problem(code, text, "warning", str(subject), values=values)


def note(code: str, text: str, subject: object = "", **values: Any) -> Problem:
    """Return a note: good to know, with nothing to correct."""
    return Problem(code, text, "note", str(subject), values=values)


# What the data of a log show is a `Problem` whose text does not name the log. A "note" is good to
# know, or put right with certainty; a "warning" makes the parameters doubtful; a "refusal" says why
# the log cannot be used (only in what `inspect` reports). Among its values, for scripts: the number
# behind it, its unit (empty for counts and shares), and whether the data were changed for it.
_OF_FINDING = {"value": None, "unit": "", "is_correction": False}
_LARGEST = 1e300  # of a number in a damaged file


def finding_record(finding: Problem) -> dict[str, Any]:
    """Return what a log shows for run.json; `findings_in` reads it back."""
    record = {"name": finding.code, "severity": finding.severity, "sentence": finding.message()}
    record |= {key: finding.values.get(key, unknown) for key, unknown in _OF_FINDING.items()}
    worded = {key: value for key, value in finding.values.items() if key not in _OF_FINDING}
    if worded:  # by whoever shows it
        known = replace(finding, values=worded).record()
        record |= {key: known[key] for key in ("text", "values")}
    return record


def findings_in(log: Mapping[str, Any]) -> list[Problem]:
    """Return what a log shows by its entry in run.json, whatever stands there, gravest first."""
    findings, entries = [], log.get("findings")
    for entry in entries if isinstance(entries, list | tuple) else ():
        if isinstance(entry, dict) and entry.get("name") and entry.get("severity") in SEVERITIES:
            own = {"code": entry["name"], "text": entry.get("sentence") or "", **entry}
            finding, value = Problem.of_record(own), entry.get("value")
            is_number = isinstance(value, int | float) and abs(value) < _LARGEST
            known = {"value": value if is_number else None, "unit": str(entry.get("unit") or "")}
            findings.append(replace(finding, values={**finding.values, **known}))
    return sorted(findings, key=lambda finding: SEVERITIES.index(finding.severity))


@dataclass(frozen=True, slots=True)
class Failure:
    """What ended the work on one log, one setting or one step, while the rest went on."""

    problem: Problem
    kind: str  # name of the error class; the manual lists them (page gates)
    log: str = ""  # name and path; empty when it is a whole setting that failed
    path: str = ""
    setting: Any = None  # a Setting, when known
    trace: str = ""  # of an internal error, where it happened

    @property
    def code(self) -> str:
        """What kind of problem, finer than `kind`."""
        return self.problem.code

    @property
    def message(self) -> str:
        """One sentence in the words of the command line: what, where, what to do."""
        return self.problem.sentence()

    @property
    def is_internal(self) -> bool:
        """Whether the fault is damperfit's own and not the logs'."""
        return self.kind == "InternalError"

    @property
    def is_left_out(self) -> bool:
        """Whether only strict quality refused the log: a gate that was missed, no failure."""
        return self.kind == "QualityError"

    @property
    def place(self) -> str:
        """The log, else the setting, that has no result."""
        return self.log or (f"setting {self.setting}" if self.setting is not None else "")

    @property
    def placed(self) -> Problem:
        """The problem with the log or setting that it is about as its subject."""
        problem, place = self.problem, self.place
        if not place or problem.subject or place in problem.text:
            return problem
        return replace(problem, subject=place)

    def describe(self) -> dict[str, Any]:
        """Return the failure for run.json."""
        facts = {"log": self.log, "path": self.path, "setting": self.setting, "kind": self.kind}
        return {**self.problem.record(), **facts, "message": self.message}


def distinct(problems: Iterable[Problem]) -> tuple[Problem, ...]:
    """Return problems, each sentence once."""
    return tuple({problem.sentence(): problem for problem in problems}.values())


def counted(number: int, noun: str) -> str:
    """Return a count in words, such as "1 log" or "2 logs"."""
    return f"{number} {noun}{'' if number == 1 else 's'}"


def listed_names(names: Sequence[str], *, few: int = _NAMES + 1, mark: str = ", ") -> str:
    """Return names in a row; of more than a few the first five, and how many more.

    >>> listed_names(["a", "b"]), listed_names(list("abcdefg"))
    ('a, b', 'a, b, c, d, e and 2 more')
    """
    if len(names) <= few:
        return mark.join(names)
    return f"{mark.join(names[:_NAMES])} and {len(names) - _NAMES} more"


def in_a_row(words: Sequence[str]) -> str:
    """Return words as "a, b and c"."""
    *first, last = words
    return f"{', '.join(first)} and {last}" if first else last


def as_subject(words: Sequence[str]) -> str:
    """Return words with their verb, as in "a and b are"."""
    return f"{in_a_row(words)} {'are' if len(words) > 1 else 'is'}"


def failure_lines(failures: Iterable[Failure]) -> list[str]:
    """Return a line for each failure; of many of one kind in a file the first, and a count."""
    groups: dict[tuple[str, str], list[Problem]] = {}
    for failure in failures:
        key = (failure.path or failure.place, failure.problem.likeness)
        groups.setdefault(key, []).append(failure.placed)
    problems: list[Problem] = []
    for group in groups.values():
        if len(group) > _MANY:
            text = f"{group[0].text} (and {len(group) - 1} other tests of this file alike)"
            group[:] = [replace(group[0], text=text)]
        problems += group
    return listing(problems)


def short_listing(sentences: Iterable[object]) -> list[str]:
    """Return sentences, each once; of many the first, and how many more."""
    distinct = list(dict.fromkeys(map(str, sentences)))
    more = len(distinct) - FEW
    return distinct[:FEW] + ([f"and {more} more; run.json and --json list them all"] * (more > 0))


def listing(
    problems: Iterable[Problem], where: str = "run.json and --json list", *, few: int = _NAMES + 1
) -> list[str]:
    """Return sentences, the gravest first; of many of one code the first, and how many more.

    A few are all shown, but for long ones of one code. Within a severity the order stays: problems
    of a log come before those of a setting.
    """
    everything = sorted(problems, key=lambda problem: SEVERITIES.index(problem.severity))
    groups: dict[str, list[Problem]] = {}
    for problem in everything:
        groups.setdefault(problem.likeness, []).append(problem)
    lines: list[str] = []
    for group in list(groups.values())[:FEW]:
        sentences = list(dict.fromkeys(problem.sentence() for problem in group))
        is_short = len(everything) <= FEW and max(map(len, sentences)) < _LONG
        if len(group) <= SHOWN or is_short:
            lines += sentences
            continue
        subjects = dict.fromkeys(p.subject for p in group[1:] if p.subject)
        names = listed_names(list(subjects), few=few)
        lines.append(f"{sentences[0]} (and {len(group) - 1} alike{': ' * bool(names)}{names})")
    if len(groups) > FEW:
        n, more = len(groups) - FEW, sum(map(len, list(groups.values())[FEW:]))
        lines.append(f"and {more} more of {n} other kinds; {where} them all")
    return lines
