"""What answers a wrong call: the sentence of the command line, in the words of the call."""

from __future__ import annotations

import os
from contextlib import contextmanager
from contextvars import ContextVar
from functools import wraps
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any, ParamSpec, TypeVar

from damperfit.errors import ConfigurationError, DamperfitError, refuse_wrong_arguments
from damperfit.problem import Words

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    P = ParamSpec("P")
    R = TypeVar("R")

__all__ = [
    "FunctionPackage",
    "answers_wrong_calls",
    "as_typed",
    "is_typed",
    "path_of",
    "spelled",
]

_IS_TYPED: ContextVar[bool] = ContextVar("is_typed", default=False)


class FunctionPackage(ModuleType):
    """A package of the name of a function: called, it is the function of `damperfit.api`."""

    def __call__(self, *arguments: Any, **given: Any) -> Any:
        """Do what the function does."""
        function = getattr(import_module("damperfit.api"), self.__name__.rpartition(".")[2])
        return function(*arguments, **given)


@contextmanager
def as_typed() -> Iterator[None]:
    """While the block runs, what is asked for was typed: options are named, and no keywords."""
    token = _IS_TYPED.set(True)
    try:
        yield
    finally:
        _IS_TYPED.reset(token)


def is_typed() -> bool:
    """Whether what is asked for was typed as options."""
    return _IS_TYPED.get()


def spelled(call: str, keyword: str) -> str:
    """Return what the user has written for a keyword, for messages.

    Examples
    --------
    >>> spelled("damperfit.identify", "hold_out")
    'damperfit.identify(hold_out=...)'
    """
    option = f"--{keyword.replace('_', '-')}"
    return option if is_typed() else f"{call}({keyword}=...)"


def answers_wrong_calls(call: str) -> Callable[[Callable[P, R]], Callable[P, R]]:
    """Return a decorator: what the function refuses is said in the words of its call.

    Parameters
    ----------
    call : str
        What the user wrote, as in ``damperfit.identify``.
    """

    def decorated(function: Callable[P, R]) -> Callable[P, R]:
        checked = refuse_wrong_arguments(call)(function)

        @wraps(function)
        def answering(*args: P.args, **kwargs: P.kwargs) -> R:
            try:
                return checked(*args, **kwargs)
            except DamperfitError as error:
                if not is_typed():
                    error.words = Words(call)
                raise

        return answering

    return decorated


def path_of(value: object, call: str, expected: str) -> Path:
    """Return a path that was given as text or as a path.

    Parameters
    ----------
    value : object
        What was given.
    call : str
        The call with its keyword, as in ``damperfit.identify(out=...)``.
    expected : str
        What the path is of, as in "the path of a folder".

    Raises
    ------
    ConfigurationError
        It is neither, or empty.
    """
    if "\0" in str(value):
        raise ConfigurationError(f"found {value!r}; a NUL cannot stand in a path", subject=call)
    if isinstance(value, str | os.PathLike) and os.fspath(value) != "":
        return Path(os.path.expanduser(os.fspath(value)))  # noqa: PTH111 - of ~nobody it raises
    if isinstance(value, str):  # as a path it would be the folder that one is in
        raise ConfigurationError(
            f"found ''; expected {expected}, '.' for this folder", subject=call
        )
    raise ConfigurationError(f"found {type(value).__name__}; expected {expected}", subject=call)
