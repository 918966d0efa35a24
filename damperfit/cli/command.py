"""A command of a function: its options are the function's keywords, and it prints what comes back.

The command has no option of its own but those that say how it talks (`PRESENTATION`).
"""

from __future__ import annotations

from contextlib import contextmanager
from functools import wraps
from inspect import Parameter, Signature, signature, unwrap
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

import typer

from damperfit import __version__
from damperfit.keywords import PYTHON_ONLY, Keyword, keyword_of, option_of

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from damperfit.run.identify import Watch

__all__ = ["Shown", "command", "looking_on", "of_presentation", "with_options"]


class Shown(NamedTuple):
    """How a command talks: one JSON document, without remarks, with tracebacks, to whom."""

    json: bool = False
    quiet: bool = False
    debug: bool = False
    github_summary: bool = False
    list: bool = False


# What may be given several times; all else is one text, for `damperfit.arguments` to read.
_SEVERAL = {"texts", "names", "quantities", "values", "pairs", "paths", "arguments"}
_COMMON = ("json", "quiet", "debug", "version")


def _print_version(is_wanted: bool) -> None:
    if is_wanted:
        typer.echo(f"damperfit {__version__}")
        raise typer.Exit


def command(
    function: Callable[..., Any] | None,
    *,
    name: str = "",
    shown: Sequence[str] = _COMMON,
    takes_context: bool = False,
) -> Callable[[Callable[..., int]], Callable[..., int]]:
    """Return a decorator that makes a command of what prints the results of a function.

    Parameters
    ----------
    function : callable or None
        Whose keywords become options; None: none.
    name : str
        Of the command, where it is not that of the function.
    shown : sequence of str
        Options that say how it talks.
    takes_context : bool
        Whether it is told of the other commands.
    """
    called = name or (function.__name__ if function is not None else "")
    keywords = [] if function is None else list(signature(unwrap(function)).parameters.values())

    def decorated(run: Callable[..., int]) -> Callable[..., int]:
        @wraps(run)
        def typed(*arguments: Any, **given: Any) -> int:
            given.update(zip((one.name for one in keywords), arguments, strict=False))
            given.pop("version", None)
            how = Shown(**{one: given.pop(one) for one in Shown._fields if one in given})
            return run(how, **given)

        parameters = [
            _parameter(called, one)
            for one in keywords
            if not {one.name, f"{called}.{one.name}"} & {*PYTHON_ONLY}
        ] + [of_presentation(one) for one in shown]
        if takes_context:
            one = Parameter("context", Parameter.KEYWORD_ONLY, annotation=typer.Context)
            parameters.insert(0, one)
        return with_options(typed, parameters)

    return decorated


def _parameter(command: str, one: Parameter) -> Parameter:
    """The option, or argument, of a keyword; its default is the keyword's."""
    known = keyword_of(command, one.name)
    assert known is not None, one.name
    default = None if one.default in (Parameter.empty, ()) else one.default
    if known.kind in {"argument", "arguments"}:
        return _argument(one, known)
    several: Any = list[str] if known.kind in _SEVERAL else str
    kind: Any = bool if known.kind == "flag" else several
    info = typer.Option(
        option_of(one.name), *known.names, metavar=known.metavar or None, help=known.help,
        rich_help_panel=known.panel,
    )  # fmt: skip
    if kind is str and default is not None:
        default = str(default)
    annotation = kind if known.kind == "flag" or default is not None else kind | None
    return Parameter(
        one.name, Parameter.KEYWORD_ONLY, default=default, annotation=Annotated[annotation, info]
    )


def _argument(one: Parameter, known: Keyword) -> Parameter:
    kind: Any = list[str] if known.kind in _SEVERAL else str
    is_needed = one.default is Parameter.empty
    default: Any = Parameter.empty if is_needed else one.default
    if not is_needed and (known.kind == "arguments" or default is None):
        kind, default = kind | None, None
    info = typer.Argument(metavar=known.metavar, help=known.help)
    return Parameter(
        one.name, Parameter.KEYWORD_ONLY, default=default, annotation=Annotated[kind, info]
    )


def with_options(run: Callable[..., Any], parameters: Sequence[Parameter]) -> Callable[..., Any]:
    """Return a function that typer sees with these options and arguments."""
    run.__signature__ = Signature(parameters, return_annotation=int)  # type: ignore[attr-defined]
    run.__annotations__ = {one.name: one.annotation for one in parameters}
    return run


def of_presentation(name: str) -> Parameter:
    """Return an option that says how a command talks."""
    known = keyword_of("", name)
    assert known is not None, name
    eager: dict[str, Any] = (
        {"callback": _print_version, "is_eager": True} if name == "version" else {}
    )
    info = typer.Option(
        option_of(name), *known.names, metavar=known.metavar or None, help=known.help,
        rich_help_panel=known.panel, **eager,
    )  # fmt: skip
    kind: Any = bool if known.kind == "flag" else str | None
    default = False if known.kind == "flag" else None
    return Parameter(
        name, Parameter.KEYWORD_ONLY, default=default, annotation=Annotated[kind, info]
    )


def looking_on(*, is_quiet: bool, **more: Any) -> Watch:
    """Return who looks on while a command works: a bar, and a signal that ends it.

    Parameters
    ----------
    is_quiet : bool
        Whether there is no bar.
    **more : callable
        Further fields of `Watch`.
    """
    from damperfit.cli.interrupt import stop_on_signal
    from damperfit.cli.progress import Bar, progress
    from damperfit.run.identify import Watch

    here: dict[str, Any] = {"bar": Bar(), "cancelled": lambda: False}

    @contextmanager
    def working() -> Iterator[None]:
        with stop_on_signal() as cancelled, progress(is_wanted=not is_quiet) as bar:
            here.update(bar=bar, cancelled=cancelled)
            yield

    return Watch(
        on_start=lambda number: here["bar"].start(number),  # noqa: PLW0108 - the bar of then
        on_fit=lambda done: here["bar"].advance(done),  # noqa: PLW0108
        cancelled=lambda: bool(here["cancelled"]()),
        during_work=working,
        **more,
    )
