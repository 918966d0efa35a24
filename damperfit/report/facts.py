"""What a report tells besides the tables; of many sentences alike the first."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from damperfit.problem import Problem

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence

    from damperfit.checks import Check
    from damperfit.tested.setting import Setting
    from damperfit.uncertainty import Prediction

__all__ = [
    "FEW",
    "MANY_KINDS",
    "Failure",
    "ReportFacts",
    "by_words",
    "failure_lines",
    "listed_names",
    "shape_of",
    "short_listing",
    "summarised",
    "with_ranges",
]


# Of many sentences that say the same with other numbers: the first, and how many more.
#
# What is wrong with hundreds of logs is a few lines, one for each kind of cause; run.json keeps
# all.

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


# What a report tells besides the tables.

_MANY = 5  # tests of one file that fail alike and are listed one by one


@dataclass(frozen=True, slots=True)
class Failure:
    """One thing that went wrong while the rest went on.

    Attributes
    ----------
    log : str
        Name of the log; empty when it is a whole setting that failed.
    path : str
        Path of the log; empty likewise.
    setting : Setting or None
        Adjuster setting, when known.
    kind : str
        Name of the error class; the manual lists them (page gates).
    message : str
        One sentence: what, where, found, expected, what to do.
    trace : str
        Of an internal error, where it happened, for whoever mends it.
    problem : Problem or None
        The same as a record.
    """

    log: str
    path: str
    setting: Setting | None
    kind: str
    message: str
    trace: str = ""
    problem: Problem | None = None

    @property
    def code(self) -> str:
        """What kind of problem, finer than `kind`; of a kind that has no finer ones its name."""
        if self.problem is not None:
            return self.problem.code
        return re.sub(r"(?<=[a-z])(?=[A-Z])", "-", self.kind.removesuffix("Error")).lower()

    @property
    def place(self) -> str:
        """The log, else the setting, that has no result."""
        return self.log or (f"setting {self.setting}" if self.setting is not None else "")

    @property
    def is_left_out(self) -> bool:
        """Whether only strict quality refused the log: a gate that was missed, no failure."""
        return self.kind == "QualityError"

    def describe(self) -> dict[str, Any]:
        """Return the failure for run.json."""
        return {
            "log": self.log,
            "path": self.path,
            "setting": self.setting,
            "kind": self.kind,
            "code": self.code,
            "message": self.message,
        }

    @property
    def line(self) -> str:
        """The failure as one line, its place first."""
        place = self.place
        has_place = not place or place in self.message
        return self.message if has_place else f"{place}: {self.message}"


def failure_lines(failures: Sequence[Failure]) -> list[str]:
    """Return a line for each failure; of many alike the first, and how many more.

    A logger that leaves out the setting does so in each of a file's hundreds of tests.
    """
    of_file: dict[tuple[str, str, str], list[Failure]] = {}
    for one in failures:
        shape = shape_of(one.message, one.log)
        of_file.setdefault((one.path or one.place, one.kind, shape), []).append(one)
    sentences = []
    for first, *others in of_file.values():
        if len(others) < _MANY:
            sentences += [(one.place, one.line) for one in (first, *others)]
        else:
            more = f"(and {len(others)} other tests of this file alike)"
            sentences.append((first.place, f"{first.line} {more}"))
    return list(summarised(sentences))


@dataclass(frozen=True, slots=True)
class ReportFacts:
    """What a report tells besides the tables.

    Attributes
    ----------
    version : str
        Version of damperfit.
    tested : str
        Whose test it is; empty where nobody said.
    procedure : tuple of str
        How the parameters were found, one sentence each.
    failures : tuple of Failure
        Logs and settings without a result.
    warnings : tuple of str
        What the reader should know before believing the numbers.
    gaps : tuple of (int, int)
        Runs of settings without a result, first and last, between the lowest and the highest one.
    gates : tuple of str
        Gates that were not met, one sentence each.
    advice : tuple of (str, str)
        Each outcome other than success that occurred, and what to do about it.
    trust : tuple of str
        What the residuals say of noise and lack of fit, one sentence each.
    held_out : tuple of Prediction
        What was not fitted but predicted.
    identifiability : tuple of str
        Parameters that the logs do not tell, and those that are tied, one sentence each.
    undetermined : tuple of str
        Those of them that are not determined, which the command says too.
    taken : tuple of str
        Tables of tests that were used, which the command says too.
    searches : tuple of str
        What fits from many starts found, one sentence each.
    cavitation : tuple of str
        How near the chambers are to zero pressure, one sentence each.
    across : tuple of str
        What shows only across the settings, one sentence each.
    checks : tuple of Check
        Every check, with reason.
    withheld : tuple of str
        Settings whose grade is withheld, and why.
    stretches : tuple of mapping
        What was compared, stretch by stretch, as in run.json.
    law_choice : mapping
        Which laws were tried, as in run.json; empty where the logs did not choose.
    is_interrupted : bool
        The run was stopped before all settings were done.
    """

    version: str
    procedure: tuple[str, ...] = ()
    tested: str = ""
    failures: tuple[Failure, ...] = ()
    warnings: tuple[str, ...] = ()
    gaps: tuple[tuple[int, int], ...] = ()
    gates: tuple[str, ...] = ()
    advice: tuple[tuple[str, str], ...] = ()
    trust: tuple[str, ...] = ()
    held_out: tuple[Prediction, ...] = ()
    identifiability: tuple[str, ...] = ()
    undetermined: tuple[str, ...] = ()
    taken: tuple[str, ...] = ()
    searches: tuple[str, ...] = ()
    cavitation: tuple[str, ...] = ()
    across: tuple[str, ...] = ()
    checks: tuple[Check, ...] = ()
    withheld: tuple[str, ...] = ()
    stretches: tuple[Mapping[str, Any], ...] = ()
    law_choice: Mapping[str, Any] = field(default_factory=dict)
    is_interrupted: bool = False
