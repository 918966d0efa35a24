"""Output: results on stdout, notes on stderr and into the log file.

Nothing reaches a terminal unescaped. The log file (``--log-file``) gets a line, with its time, for
each message and step of a command.
"""

from __future__ import annotations

import json
import logging
import os
import re
import shutil
import signal
import stat
import sys
import threading
import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

from damperfit.errors import ConfigurationError, OutputError
from damperfit.problem import Failure, Option

if TYPE_CHECKING:
    from rich.console import RenderableType

    from damperfit.reporting.sheet import Sheet
    from damperfit.run.identify import Watch

_PIPE_WIDTH = 120
_COLOURS = ("auto", "always", "never")
_colour = {"is": "auto"}
_OF_CHECKS = re.compile(r"^FAILED(?= )|\bnot evaluated\b", re.MULTILINE)
_refused: list[OSError] = []  # errors of stdout


def one_line(text: str) -> str:
    r"""Return text on one line, with control characters shown instead of obeyed.

    >>> print(one_line("a\nb\x1b[31m"))
    a b\x1b[31m
    """
    joined = " ".join(text.splitlines())
    return "".join(c if c.isprintable() else ascii(c)[1:-1] for c in joined)


def say(text: str, level: int = logging.INFO) -> None:
    """Write one line for people to stderr, and into the log file if there is one."""
    level = logging.WARNING if text.startswith("warning: ") else level
    record(level, one_line(text), is_step=False)
    with suppress(OSError):  # without a reader the work goes on
        _write(sys.stderr, one_line(text) + "\n")


def say_failures(failures: Sequence[Failure], *, is_debug: bool) -> None:
    """Write a line for each failure to stderr, with ``--debug`` its traceback too."""
    from damperfit.problem import failure_lines

    for line in failure_lines(failures):
        say(f"damperfit: {line}", logging.ERROR)
    for failure in failures:
        show_trace(failure.trace, is_debug=is_debug)


def show_trace(text: str, *, is_debug: bool) -> None:
    """Write a traceback to stderr with ``--debug``, else into the log file alone."""
    if not is_debug:
        record(logging.DEBUG, text, is_step=False)
        return
    for line in text.splitlines():
        say(line, logging.DEBUG)


def print_json(document: Any) -> None:
    """Write one JSON document to stdout."""
    text = json.dumps(document, indent=2, ensure_ascii=False, allow_nan=False)
    record(logging.DEBUG, f"a JSON document of {len(text)} characters on stdout")
    _print(text)


def print_blocks(
    blocks: Iterable[str | list[str] | Sheet], colours: Mapping[str, int] | None = None
) -> None:
    """Write texts, lines and tables to stdout with an empty line between them; no empty ones."""
    from damperfit.reporting.sheet import text_table

    is_first = True
    for block in blocks:
        if not (block if isinstance(block, str | list) else block.rows):
            continue
        if not is_first:
            print_lines([""])
        is_first = False
        if isinstance(block, str | list):
            print_lines(wrapped(block) if isinstance(block, str) else block)
            continue
        plain = text_table(block, screen_columns())
        record(logging.INFO, plain)
        is_coloured = _is_coloured()
        _print(text_table(block, screen_columns(), colours=colours or {}) if is_coloured else plain)


def print_lines(lines: Iterable[str]) -> None:
    """Write lines to stdout; FAILED of a check is red, where there are colours."""
    text = "\n".join(lines)
    record(logging.INFO, text)
    if _is_coloured():
        from damperfit.reporting.sheet import COLOURS

        text = _OF_CHECKS.sub(lambda hit: f"\x1b[{COLOURS[hit[0]]}m{hit[0]}\x1b[0m", text)
    _print(text)


def wrapped(*texts: str, indent: str = "") -> list[str]:
    """Return texts in lines that the screen takes."""
    from textwrap import wrap

    columns = screen_columns()
    return [line for text in texts for line in wrap(text, columns, subsequent_indent=indent)]


def print_renderable(renderable: RenderableType) -> None:
    """Write a text of rich to stdout: coloured where `print_lines` would be, else plain."""
    from io import StringIO

    from rich.console import Console

    def rendered(**options: Any) -> str:
        options |= {"width": screen_columns(), "highlight": False, "markup": False, "emoji": False}
        Console(file=(text := StringIO()), **options).print(renderable)
        return "\n".join(line.rstrip() for line in text.getvalue().splitlines())

    plain = rendered(color_system=None)  # also where FORCE_COLOR is set
    record(logging.INFO, plain)
    _print(rendered(force_terminal=True) if _is_coloured() else plain)


def set_colour(when: str | None) -> None:
    """Say when stdout is coloured: auto (None), always or never."""
    if when is not None and when not in _COLOURS:
        text = f"expected one of {', '.join(_COLOURS)}"
        raise ConfigurationError(text, where=Option("color", when), code="unknown-colour")
    _colour["is"] = when or "auto"


def _is_coloured() -> bool:
    if _colour["is"] != "auto":
        return _colour["is"] == "always"
    knows_colours = os.name != "nt" or "WT_SESSION" in os.environ
    is_plain = "NO_COLOR" in os.environ or os.environ.get("TERM") == "dumb" or not knows_colours
    return sys.stdout.isatty() and not is_plain


def screen_columns() -> int:
    """Return $COLUMNS, else the width of the terminal; 120 in a pipe or a file."""
    is_known = sys.stdout.isatty() or os.environ.get("COLUMNS", "").isdecimal()
    return shutil.get_terminal_size().columns if is_known else _PIPE_WIDTH


def spark_levels() -> str:
    """Return the characters of a sparkline that the reader of stdout can show."""
    from damperfit.reporting.tables import ASCII_LEVELS, BLOCK_LEVELS

    # A pipe is given UTF-8 by `shield_streams`, so what was asked for is looked at first.
    encoding = os.environ.get("PYTHONIOENCODING", "").partition(":")[0]
    with suppress(LookupError, UnicodeEncodeError):
        BLOCK_LEVELS.encode(encoding or sys.stdout.encoding or "ascii")
        return BLOCK_LEVELS
    return ASCII_LEVELS


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
    """Return why stdout refused the output; empty where it did not.

    A reader that has gone (``| head``) is no fault.
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
    reasons = [e.strerror or str(e) for e in _refused if not isinstance(e, BrokenPipeError)]
    _refused.clear()
    return reasons[0] if reasons else ""


def _print(text: str) -> None:
    try:
        _write(sys.stdout, text + "\n")
    except OSError as error:
        _refused.append(error)


def _write(stream: Any, text: str) -> None:
    """Write at once; a stream that fails is replaced by the null device."""
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


# The log file

_LOGGER = logging.getLogger("damperfit")
# Without it a record of the library would reach stderr where no log file is asked for.
_LOGGER.addHandler(logging.NullHandler())
_kept: list[logging.Handler] = []
# Streams that this process was given; the shell's >(gzip) is one of them.
_STREAM = re.compile(r"/dev/(stdout|stderr|fd/\d+)")
_FORMAT = "%(asctime)s %(levelname)-7s damperfit[%(process)d] %(message)s"


def record(level: int, text: str, *, is_step: bool = True) -> None:
    """Keep a text in the log file if there is one, line by line; `show_steps` shows a step."""
    for line in text.splitlines() if _kept else ():
        if line.strip():
            _LOGGER.log(level, "%s", line, extra={"is_step": is_step})


class LogFile:
    """The log file that a command line names, even where the rest of it is wrong; or none."""

    def __init__(self, arguments: Sequence[str]) -> None:
        import shlex

        from damperfit import __version__

        self._begin = time.perf_counter()
        name = None
        options = arguments[: arguments.index("--")] if "--" in arguments else arguments
        for argument, following in zip(options, (*options[1:], None), strict=True):
            option, equals, value = argument.partition("=")
            if option == "--log-file":
                name = value if equals else following
        if name is None:
            return
        place = Option("log_file", name)
        try:
            _refuse_others(name, place)
            handler = _Appended(name, encoding="utf-8", errors="backslashreplace")
        except (OSError, ValueError) as error:
            text = f"cannot be written: {getattr(error, 'strerror', None) or error}"
            raise ConfigurationError(text, where=place, code="cannot-write") from error
        handler.setFormatter(_Line(_FORMAT))
        _keep(handler)
        folder = "a folder that is gone"
        with suppress(OSError):
            folder = str(Path.cwd())
        record(logging.INFO, f"$ damperfit {shlex.join(arguments)}")
        python = f"Python {sys.version.split()[0]} on {sys.platform}"
        record(logging.DEBUG, f"damperfit {__version__}, {python}, in {folder}")

    def close(self, exit_code: int) -> None:
        """Keep how the command ended, and close the file."""
        seconds = time.perf_counter() - self._begin
        record(logging.INFO, f"ended with code {exit_code} after {seconds:.2f} s")
        while _kept:
            handler = _kept.pop()
            _LOGGER.removeHandler(handler)
            handler.close()
            _LOGGER.setLevel(logging.NOTSET)
            _LOGGER.propagate = True


def show_steps() -> None:
    """Show each step on stderr until the log file is closed."""
    _keep(_Steps())


def _keep(handler: logging.Handler) -> None:
    _LOGGER.addHandler(handler)
    _LOGGER.setLevel(logging.DEBUG)
    _LOGGER.propagate = False
    _kept.append(handler)


class _Appended(logging.FileHandler):
    """Appends each record at once; a full disk ends no fit."""

    def handleError(self, record: logging.LogRecord) -> None:  # noqa: N802 - of logging
        """Go on."""

    def close(self) -> None:
        """Close the file."""
        with suppress(OSError):
            super().close()


class _Steps(logging.Handler):
    """Shows on stderr what is otherwise for the log file alone: logs read, fits, times, files."""

    def emit(self, record: logging.LogRecord) -> None:
        """Write a step; lines for people and tracebacks are no steps."""
        if record.levelno == logging.DEBUG and getattr(record, "is_step", True):
            with suppress(OSError):
                _write(sys.stderr, one_line(record.getMessage()) + "\n")


class _Line(logging.Formatter):
    """A record on one line, its time with the zone."""

    def format(self, record: logging.LogRecord) -> str:
        return one_line(super().format(record))

    def formatTime(self, record: logging.LogRecord, datefmt: Any = None) -> str:  # noqa: ARG002, N802
        at = datetime.fromtimestamp(record.created).astimezone()
        return at.isoformat(timespec="milliseconds")


def _refuse_others(name: str, place: Option) -> None:
    """Refuse a file that is no log file of damperfit, and what may block a writer for ever."""
    if _STREAM.fullmatch(name):
        return
    try:
        status = Path(name).stat() if name else None
    except FileNotFoundError:
        return  # it is made, or making it says what is wrong
    if status is None or stat.S_ISDIR(status.st_mode):
        raise IsADirectoryError(None, "expected the name of a file")
    if stat.S_ISCHR(status.st_mode):
        return
    if not stat.S_ISREG(status.st_mode):
        raise OSError(None, "expected a regular file, found a pipe, a socket or a disk")
    if status.st_size:
        from damperfit.run.log_files import is_own_log_file

        if not is_own_log_file(Path(name)):
            text = (
                "is there already and does not begin as a log file of damperfit; nothing was "
                "written to it, name another file"
            )
            raise ConfigurationError(text, where=place, code="not-a-log-file")


# The summary page of a job on GitHub Actions

_MOST_BYTES = 1_000_000  # Actions refuses a step's summary above 1 MiB as a whole


def summary_file() -> Path:
    """Return where GitHub Actions collects the summary of a job."""
    if name := os.environ.get("GITHUB_STEP_SUMMARY", ""):
        return Path(name)
    text = "GITHUB_STEP_SUMMARY is not set; it is only inside GitHub Actions"
    raise ConfigurationError(text, where=Option("github_summary"), code="no-job")


def append_summary(path: Path, report: str, *, instead: str) -> None:
    """Add Markdown to the summary of a job, or `instead` where it is too long."""
    text = report.encode("utf-8", "backslashreplace")
    try:
        with path.open("ab") as file:
            file.write(text if len(text) < _MOST_BYTES else f"{instead}\n".encode())
    except OSError as error:
        reason, place = f"cannot write {path}: {error.strerror}", Option("github_summary")
        raise OutputError(reason, where=place, code="cannot-write") from error


# Progress on a terminal, and the signals Ctrl-C, SIGTERM and SIGHUP: the first lets the run finish
# its current work, the second ends it.

_APART = 0.1  # s; a fit of a fast model takes less than to draw a line


@contextmanager
def stop_on_signal(promise: str, stop: threading.Event) -> Iterator[None]:
    """Set the event at the first signal; the promise says what becomes of the work done so far."""
    if threading.current_thread() is not threading.main_thread():
        yield  # Python delivers signals to the main thread only
        return

    def handle(number: int, frame: Any) -> None:
        if stop.is_set():
            raise KeyboardInterrupt
        stop.set()
        say(f"damperfit: stopping; {promise} (again to end at once)")

    watched = [signal.SIGINT, signal.SIGTERM]
    hung_up = getattr(signal, "SIGHUP", None)  # not on Windows
    if hung_up is not None and signal.getsignal(hung_up) is not signal.SIG_IGN:  # as by nohup
        watched.append(hung_up)
    before = {number: signal.signal(number, handle) for number in watched}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def looking_on(*, is_quiet: bool, of_fleet: bool = False, **fields: Any) -> Watch:
    """Return a `Watch` that draws progress and stops on signals; for a fleet it counts dampers.

    Further fields of `Watch` may be given.
    """
    from damperfit.run.identify import Watch

    start, title, promise = (
        ("dampers", "dampers", "dampers that are done are kept")
        if of_fleet
        else ("reading logs", "fitting settings", "finished settings will be written")
    )
    stop = threading.Event()
    bars: list[Any] = []
    drawn = 0.0

    @contextmanager
    def working() -> Iterator[None]:
        with stop_on_signal(promise, stop), ExitStack() as stack:
            if not is_quiet and sys.stderr.isatty():
                bars.append(stack.enter_context(_bar(of_fleet=of_fleet)))
                bars[0].add_task(start, total=None)
            yield

    def draw(method: str, **changes: Any) -> None:
        nonlocal drawn
        for bar in bars:
            getattr(bar, method)(bar.task_ids[0], **changes)
            if time.monotonic() >= drawn:
                bar.refresh()
                drawn = time.monotonic() + _APART

    def on_fit(done: Any) -> None:
        draw("advance")
        if of_fleet:  # of a fit the library itself records more
            record(logging.DEBUG, f"{done.owner}: {done.state.value}, {done.n_settings} settings")

    return Watch(
        on_start=lambda number: draw("update", total=number, description=title),
        on_fit=on_fit,
        cancelled=stop.is_set,
        during_work=working,
        **fields,
    )


def _bar(*, of_fleet: bool) -> Any:
    from rich import progress
    from rich.console import Console
    from rich.text import Text

    class Rate(progress.ProgressColumn):
        """Dampers a minute."""

        def render(self, task: Any) -> Text:
            speed = task.finished_speed or task.speed
            return Text("" if speed is None else f"{60.0 * speed:.0f} a minute")

    columns: list[Any] = [progress.TextColumn("{task.description}"), progress.BarColumn()]
    columns += [progress.MofNCompleteColumn()]
    columns += [Rate(), progress.TimeRemainingColumn()] if of_fleet else []
    # Drawn by the counting thread: with a second thread no copy of this process can be made.
    console = Console(stderr=True)
    return progress.Progress(*columns, console=console, transient=True, auto_refresh=of_fleet)
