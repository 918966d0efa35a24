"""Every failure that damperfit raises on purpose, each with its exit code.

A message is one line: what is wrong, where, what was found and expected, what to do.
The library raises; only ``damperfit.cli`` catches and exits.
"""

from __future__ import annotations

import copyreg
import traceback
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from copy import copy
from dataclasses import replace
from difflib import get_close_matches
from functools import wraps
from inspect import signature
from pathlib import Path
from types import EllipsisType
from typing import TYPE_CHECKING, Any, ParamSpec, Self, TypeVar

from damperfit.problem import Failure, Problem, Where, Words

if TYPE_CHECKING:
    from damperfit.tested.setting import Setting

    OnError = Callable[[Setting, Exception], None]
    P = ParamSpec("P")
    R = TypeVar("R")

# Codes of problems with a place to write to.
UNWRITTEN = frozenset(
    {"no-address", "no-working-folder", "not-a-folder", "write-protected", "cannot-write"}
)


class DamperfitError(Exception):
    """Parent of every error that damperfit raises on purpose; its arguments are its problem's."""

    exit_code = 1
    code = "failed"
    failures: tuple[Failure, ...] = ()
    """What it joins, where all of several logs or settings failed."""

    def __init__(
        self,
        text: object = "",
        *,
        code: str = "",
        subject: object = "",
        where: Where | None = None,
        **values: Any,
    ) -> None:
        super().__init__(text)
        self.words = Words()
        self.problem = Problem(
            code or self.code, str(text), subject=str(subject), where=where, values=values
        )

    def __str__(self) -> str:
        problem, call = self.problem, self.words.call
        is_placed = problem.subject or problem.where or not isinstance(self, ConfigurationError)
        sentence = problem.sentence(self.words)
        return sentence if is_placed or not call else f"{call}: {sentence}"

    def __reduce__(self) -> tuple[Any, ...]:
        state = {**self.__dict__, "words": Words()}
        return copyreg.__newobj__, (type(self), self.problem.text), state  # type: ignore[attr-defined]

    def at(self, where: Where | EllipsisType | None = ..., *, subject: object = ...) -> Self:
        """Return the same error with where it was asked for (None: nowhere), or its subject."""
        places: dict[str, Any] = {} if where is ... else {"where": where}
        return self._but(**places | ({} if subject is ... else {"subject": str(subject)}))

    def adding(self, text: str, **values: Any) -> Self:
        """Return the same error with more in its sentence."""
        return self._but(
            text=f"{self.problem.text}{text}", values={**self.problem.values, **values}
        )

    def _but(self, **fields: Any) -> Self:
        error = copy(self)
        error.problem = replace(self.problem, **fields)
        return error


class ConfigurationError(DamperfitError):
    """Wrong usage, option or configuration; nothing was touched."""

    exit_code = 2
    code = "usage"


class InstallationError(DamperfitError):
    """The compiled core or an optional library is missing or does not load."""

    exit_code = 2
    code = "installation"


class LogError(DamperfitError):
    """One log cannot be read as force and displacement over time."""

    code = "log"
    says_setting = True  # False: the log does not say its adjuster setting either


class ContradictionError(LogError):
    """Logs of one setting contradict each other, or one test is given under two settings."""

    code = "contradiction"


class TimelessError(LogError):
    """A file holds speed and force without time: no log that can be fitted, but curves."""

    code = "no-time"


class ConditioningError(LogError):
    """One log was read, but its signals cannot be evaluated."""

    code = "unusable"


class QualityError(LogError):
    """One log can be evaluated, but has a warning, and strict quality was asked for."""

    exit_code = 4
    code = "strict"


class SimulationError(DamperfitError):
    """The model cannot be integrated for these parameters and this displacement."""

    code = "simulation"


class FitCancelledError(DamperfitError):
    """The caller asked to stop while a fit was running."""

    exit_code = 130
    code = "cancelled"


class OutputError(DamperfitError):
    """Results cannot be written."""

    code = "output"


class InternalError(DamperfitError):
    """A bug of damperfit's that one log or one setting has met; the others go on."""

    code = "bug"


def failure_of(error: Exception, task: str) -> Failure:
    """Return the failure of a task by an error that must not cost the others their results.

    >>> failure_of(LogError("empty file", code="empty"), "reading the log").code
    'empty'
    """
    if isinstance(error, DamperfitError):
        return Failure(error.problem, type(error).__name__)
    reason = " ".join(str(error).split())
    if isinstance(error, MemoryError):
        text = (
            f"not enough memory for {task}{f' ({reason})' * bool(reason)}; give fewer or shorter "
            "logs at a time, or a lower {--jobs}"
        )
        return Failure(Problem("memory", text), "MemoryError")
    package, where = Path(__file__).parent, ""
    for frame in traceback.extract_tb(error.__traceback__):  # the innermost of ours
        if package in (path := Path(frame.filename)).parents:
            where = f" (damperfit/{path.relative_to(package).as_posix()}, line {frame.lineno})"
    text = (
        "internal error while {task}, {error}: {reason}{where}; this is a bug in damperfit: please "
        "report this line, with the log if it may be shown"
    )
    facts = {"task": task, "error": type(error).__name__, "where": where}
    problem = Problem("bug", text, values=facts | {"reason": reason or "no message"})
    trace = "".join(traceback.format_exception(error))
    return Failure(problem, "InternalError", trace=trace)


@contextmanager
def sparing(setting: Setting, on_error: OnError | None) -> Iterator[None]:
    """Pass an error of one setting to ``on_error``; without that it is raised."""
    try:
        yield
    except Exception as error:
        if on_error is None:
            raise
        on_error(setting, error)


@contextmanager
def blamed_on(where: Where) -> Iterator[None]:
    """Add to an error of configuration that is raised inside where the value was asked for."""
    try:
        yield
    except ConfigurationError as error:
        raise error.at(where) from error


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """Return " Did you mean 'X'?" for the nearest known name, or an empty string.

    >>> did_you_mean("forse_N", ["force_N", "time_s"]), did_you_mean("nothing", ["force_N"])
    (" Did you mean 'force_N'?", '')
    """
    near = get_close_matches(name, list(known), n=1, cutoff=0.65)
    return f" Did you mean {near[0]!r}?" if near else ""


def refuse_wrong_arguments(call: str) -> Callable[[Callable[P, R]], Callable[P, R]]:
    """Return a decorator: arguments that a function does not take are answered in a sentence."""

    def decorated(function: Callable[P, R]) -> Callable[P, R]:
        @wraps(function)
        def checked(*args: P.args, **kwargs: P.kwargs) -> R:
            try:
                return function(*args, **kwargs)
            except TypeError as error:
                own = signature(function)
                try:
                    own.bind(*args, **kwargs)
                except TypeError as unbound:
                    wrong = _wrong_call(unbound, kwargs, [n for n in own.parameters if n != "self"])
                    text = f"{call}: {wrong}; help({call}) shows how"
                    raise ConfigurationError(text, code="wrong-call") from error
                raise

        return checked

    return decorated


def _wrong_call(error: TypeError, given: Iterable[str], names: list[str]) -> str:
    listed = ", ".join(names)
    if unknown := [name for name in given if name not in names]:
        near = did_you_mean(unknown[0], names)
        return f"no keyword {unknown[0]!r}; there are {listed}.{near}".rstrip(".")
    if "too many" in str(error):
        return f"too many arguments; give those after the first by name: {listed}"
    return str(error)  # "missing a required argument: 'logs'", "multiple values for ..."
