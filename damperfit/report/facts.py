"""What has no result, and why; of many problems of one code the first is told.

What is wrong with hundreds of logs is a few lines, one for each code; run.json keeps all.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from damperfit.errors import DamperfitError
from damperfit.problem import Problem

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from damperfit.tested.setting import Setting


FEW = 20  # sentences in all that are shown one by one; a damper has some twenty settings
_SHOWN = 3  # sentences of one kind that are shown one by one where there are many
_LONG = 200  # characters; a page of one paragraph again and again is not read
_NAMES = 5  # names that are listed


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


def grouped(problems: Iterable[tuple[str, str, str]], *, few: int = FEW) -> Iterator[str]:
    """Yield sentences; of many of one kind the first, and how many more.

    A few are all shown, but for long ones of one kind.

    Parameters
    ----------
    problems : iterable of (str, str, str)
        Kind (as of `kind_of`), the log or setting that it is about, and the whole sentence.
    few : int
        Sentences in all that are shown one by one, and kinds.
    """
    everything = list(problems)
    kinds: dict[str, list[tuple[str, str]]] = {}
    for kind, name, sentence in everything:
        kinds.setdefault(kind, []).append((name, sentence))
    for group in list(kinds.values())[:few]:
        is_short = len(everything) <= few and max(len(sentence) for _, sentence in group) < _LONG
        if len(group) <= _SHOWN or is_short:
            yield from dict.fromkeys(sentence for _, sentence in group)
            continue
        (_, first), *others = group
        names = listed_names([name for name in dict.fromkeys(name for name, _ in others) if name])
        yield f"{first} (and {len(others)} alike{': ' * bool(names)}{names})"
    if len(kinds) > few:
        n, more = len(kinds) - few, sum(map(len, list(kinds.values())[few:]))
        yield f"and {more} more of {n} other kinds; run.json and --json list them all"


def kind_of(code: str, text: str) -> str:
    """Return what problems have in common that are told together.

    Parameters
    ----------
    code : str
        Of the problem.
    text : str
        What it says besides its place: a code that only names the class of the error does not
        tell one problem from another.
    """
    return f"{code}: {text}" if code in _GENERAL else code


_GENERAL = frozenset({DamperfitError.code, *(one.code for one in DamperfitError.__subclasses__())})


def short_listing(sentences: Iterable[object]) -> list[str]:
    """Return sentences that say themselves what they are about, each once; of many the first."""
    known = list(dict.fromkeys(map(str, sentences)))
    more = len(known) - FEW
    return known[:FEW] + ([f"and {more} more; run.json and --json list them all"] * (more > 0))


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
    def likeness(self) -> str:
        """What it has in common with those that are told together."""
        if self.problem is None:
            return self.code
        text = self.problem.text
        return kind_of(self.code, text.replace(self.log, "") if self.log else text)

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
    of_file: dict[tuple[str, str], list[Failure]] = {}
    for one in failures:
        of_file.setdefault((one.path or one.place, one.likeness), []).append(one)
    problems = []
    for first, *others in of_file.values():
        if len(others) < _MANY:
            problems += [(one.likeness, one.place, one.line) for one in (first, *others)]
        else:
            more = f"(and {len(others)} other tests of this file alike)"
            problems.append((first.likeness, first.place, f"{first.line} {more}"))
    return list(grouped(problems))
