"""Talking to people and programs: results on stdout, remarks on stderr, nothing unescaped."""

from __future__ import annotations

import json
import logging
import os
import shutil
import sys
from contextlib import suppress
from io import StringIO
from typing import TYPE_CHECKING, Any

from damperfit.cli.log_file import record

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from rich.console import RenderableType

    from damperfit.problem import Failure
    from damperfit.reporting.sheet import Sheet

__all__ = [
    "one_line",
    "print_json",
    "print_lines",
    "print_renderable",
    "print_table",
    "say",
    "say_failures",
    "say_lines",
    "screen_columns",
    "shield_streams",
    "spark_levels",
    "unprinted",
]

_PIPE_WIDTH = 80
_refused: list[OSError] = []  # by stdout; what it should have shown is nowhere


def one_line(text: str) -> str:
    r"""Return text on one line, with control characters shown instead of obeyed.

    Examples
    --------
    >>> print(one_line("a\nb\x1b[31m"))
    a b\x1b[31m
    """
    joined = " ".join(text.splitlines())
    return "".join(c if c.isprintable() else ascii(c)[1:-1] for c in joined)


def say(text: str, level: int = logging.INFO) -> None:
    """Write one line for people to stderr, and into the log file if there is one.

    Parameters
    ----------
    text : str
        The line.
    level : int
        Of the log file's record; a line that begins with "warning:" is a warning.
    """
    record(logging.WARNING if text.startswith("warning: ") else level, one_line(text))
    with suppress(OSError):  # nobody listens; the work goes on
        _write(sys.stderr, one_line(text) + "\n")


def say_failures(failures: Sequence[Failure], *, is_debug: bool) -> None:
    """Write a line for each failure to stderr; where it happened too, if that is asked for."""
    from damperfit.problem import failure_lines

    for line in failure_lines(failures):
        say(f"damperfit: {line}", logging.ERROR)
    for failure in failures:
        if is_debug:
            say_lines(failure.trace)
        else:
            record(logging.DEBUG, failure.trace)


def say_lines(text: str) -> None:
    """Write several lines for people to stderr."""
    for line in text.splitlines():
        say(line, logging.DEBUG)


def print_json(document: Any) -> None:
    """Write one JSON document to stdout."""
    text = json.dumps(document, indent=2, ensure_ascii=False, allow_nan=False)
    record(logging.DEBUG, f"a JSON document of {len(text)} characters on stdout")
    _print(text)


def print_lines(lines: Iterable[str]) -> None:
    """Write plain lines to stdout."""
    text = "\n".join(lines)
    record(logging.INFO, text)
    _print(text)


def print_renderable(renderable: RenderableType) -> None:
    """Write a text of rich to stdout: coloured on a terminal, plain and 80 wide in a pipe."""
    from rich.console import Console

    if not sys.stdout.isatty():
        print_lines(_plain(renderable))
        return
    try:
        Console(file=sys.stdout, highlight=False, markup=False, emoji=False).print(renderable)
    except OSError as error:
        _refused.append(error)
        _to_nowhere(sys.stdout)
    record(logging.INFO, "\n".join(_plain(renderable)))


def print_table(sheet: Sheet, colours: Mapping[str, int] | None = None) -> None:
    """Write a table to stdout: coloured on a terminal that knows colours, plain elsewhere.

    Parameters
    ----------
    sheet : Sheet
        The table.
    colours : mapping of str to int, optional
        ANSI colours of its cells besides those of grades, by the word in them.
    """
    from damperfit.reporting.sheet import text_table

    text = text_table(sheet, screen_columns())
    record(logging.INFO, text)
    knows_colours = os.name != "nt" or "WT_SESSION" in os.environ
    is_plain = "NO_COLOR" in os.environ or os.environ.get("TERM") == "dumb" or not knows_colours
    if sys.stdout.isatty() and not is_plain:
        text = text_table(sheet, screen_columns(), colours=colours or {})
    _print(text)


def _plain(renderable: RenderableType) -> list[str]:
    """Return the lines of a table or a text, plain also where FORCE_COLOR is set."""
    from rich.console import Console

    text = StringIO()
    console = Console(
        file=text, width=_PIPE_WIDTH, highlight=False, markup=False, emoji=False, color_system=None
    )
    console.print(renderable)
    return [line.rstrip() for line in text.getvalue().splitlines()]


def screen_columns() -> int:
    """Return the width of the terminal; 80 in a pipe or a file."""
    return shutil.get_terminal_size().columns if sys.stdout.isatty() else _PIPE_WIDTH


def spark_levels() -> str:
    """Return the characters of a sparkline that whoever reads stdout can show."""
    from damperfit.reporting.tables import ASCII_LEVELS, BLOCK_LEVELS

    # A pipe is given UTF-8 by `shield_streams`, so what was asked for is looked at first.
    asked = os.environ.get("PYTHONIOENCODING", "").partition(":")[0]
    try:
        BLOCK_LEVELS.encode(asked or sys.stdout.encoding or "ascii")
    except (LookupError, UnicodeEncodeError):
        return ASCII_LEVELS
    return BLOCK_LEVELS


def shield_streams() -> None:
    """Let no character fail: files and pipes get UTF-8, as JSON and TOML must be.

    A terminal keeps its own encoding and is shown escapes for what that lacks.
    """
    for stream in (sys.stdout, sys.stderr):
        reconfigure = getattr(stream, "reconfigure", None)
        if reconfigure is not None:
            encoding = None if stream.isatty() else "utf-8"
            reconfigure(encoding=encoding, errors="backslashreplace")


def unprinted(error: OSError | None = None) -> str:
    """Return why stdout did not take what was printed; empty where it did.

    A reader that has gone (``| head``) has seen enough; that is no fault.

    Parameters
    ----------
    error : OSError, optional
        Raised by a library that printed.
    """
    if error is None:
        try:
            sys.stdout.flush()
        except OSError as late:
            error = late
    if error is not None:
        _refused.append(error)
        _to_nowhere(sys.stdout)
    with suppress(OSError):
        _write(sys.stderr, "")
    reasons = [one.strerror or str(one) for one in _refused if not isinstance(one, BrokenPipeError)]
    _refused.clear()
    return reasons[0] if reasons else ""


def _print(text: str) -> None:
    try:
        _write(sys.stdout, text + "\n")
    except OSError as error:
        _refused.append(error)


def _write(stream: Any, text: str) -> None:
    """Write at once; what a stream cannot take it is not asked to take again."""
    try:
        stream.write(text)
        stream.flush()
    except OSError:
        _to_nowhere(stream)
        raise


def _to_nowhere(stream: Any) -> None:
    with suppress(OSError, ValueError):
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, stream.fileno())
        os.close(nowhere)
