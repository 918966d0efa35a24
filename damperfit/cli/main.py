"""The entry of the command line: registers commands, turns errors into lines and exit codes."""

import errno
import gc
import logging
import os
import sys
import traceback
from collections.abc import Sequence
from copy import copy
from functools import cache
from typing import Any

import typer

from damperfit.cli import commands
from damperfit.cli.command import Commands, PanelledCommand, parameter, with_options
from damperfit.cli.console import LogFile, say, shield_streams, show_trace, unprinted
from damperfit.errors import ConfigurationError, DamperfitError
from damperfit.own_process import CLOSED_STREAMS, begin

_INTERRUPTED = 130
_BUG = 70  # "internal software error" of sysexits.h; none of the documented codes
# Imports make many objects and little garbage: `inspect` of a log some 120 000, among which to look
# for any takes a fifteenth of its time.
_NEW_OBJECTS = 200_000
# These write files, by themselves.
_WRITERS = {"identify", "fleet", "export", "samples", "report", "sweep", "init"}


class _App(typer.Typer):
    """Typer makes every command before it runs one; here only the one that is typed first."""

    def __call__(self, argv: Sequence[str], **options: Any) -> Any:
        typed = argv[0] if argv else ""
        is_alone = typed in _names and typed != "help"  # which lists all
        return typer.Typer.__call__(_alone(self, typed) if is_alone else self, argv, **options)


@cache
def _alone(program: typer.Typer, typed: str) -> typer.Typer:
    alone = copy(program)
    alone.registered_commands = [_names[typed]]
    return alone


app = _App(
    name="damperfit",
    cls=Commands,
    add_completion=True,
    rich_markup_mode=None,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100},
    epilog="Example: damperfit identify sample_runs/*.csv",
)
for _command in (
    *(commands.identify, commands.report, commands.settings, commands.compare),
    *(commands.simulate, commands.sweep, commands.models, commands.fleet, commands.export),
    *(commands.inspect, commands.samples, commands.config),
    *(commands.advise, commands.valves, commands.passport, commands.ride, commands.watch),
    *(commands.init, commands.doctor, commands.show_help),
):
    app.command(cls=PanelledCommand)(_command)
_names = {c.callback.__name__: c for c in app.registered_commands if c.callback}


def _root(**_: Any) -> None:
    """Find the parameters of a damper model from rig logs, at every adjuster setting."""


app.callback()(
    with_options(_root, [parameter("", name) for name in ("version", "debug", "log_file")])
)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit code."""
    argv = list(sys.argv[1:] if arguments is None else arguments) or ["--help"]
    if arguments is None:
        begin()
    shield_streams()
    # Looking for plugins reads the metadata of every package that is installed.
    os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__")
    # Products here are small; another BLAS thread spins for 25 ms as often as it is made.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    os.environ["MPLBACKEND"] = "agg"  # figures are files; a notebook's backend is not for us
    try:
        log_file = LogFile(argv)
    except ConfigurationError as error:
        say(f"damperfit: {error}")
        return error.exit_code
    threshold = gc.get_threshold()
    gc.set_threshold(_NEW_OBJECTS, *threshold[1:])
    try:
        code = _ended_with(argv)
    finally:
        if arguments is None:  # it ends, and Python would look through all that there is twice
            gc.freeze()
        gc.set_threshold(*threshold)
    log_file.close(code)
    return code


def _ended_with(argv: list[str]) -> int:
    """Run the command; an error is one line on stderr and an exit code."""
    try:
        code = int(app(argv, standalone_mode=False, prog_name="damperfit") or 0)
    except KeyboardInterrupt:
        say("damperfit: interrupted", logging.ERROR)
        return _INTERRUPTED
    except (BrokenPipeError, SystemExit) as error:  # so ends typer where its help has no reader
        cause = error if isinstance(error, BrokenPipeError) else error.__context__
        if not isinstance(cause, BrokenPipeError):
            raise
        unprinted(cause)
        return 0
    except Exception as error:  # noqa: BLE001 - the one place that catches everything
        message, exit_code = _explain(error)
        is_debug = "--debug" in argv
        if is_debug or not hasattr(error, "format_message"):  # a mistyped option needs none
            show_trace(traceback.format_exc(), is_debug=is_debug)
        say(f"damperfit: {message}", logging.ERROR)
        unprinted()
        return exit_code
    reason = unprinted()
    printing = {"--json", "--list", "--help", "-h", "--version", "-V"} & {*argv}
    has_files = any(text.partition("=")[0] == "--out" for text in argv) or _WRITERS & {*argv}
    if not reason and "stdout" in CLOSED_STREAMS and (printing or not has_files):
        reason = "it is closed"
    if reason:
        say(f"damperfit: cannot write to stdout: {reason}; any files are written", logging.ERROR)
    return code or int(bool(reason))


def _explain(error: Exception) -> tuple[str, int]:  # noqa: PLR0911 - one a kind of error
    """Return the message for the user, and the exit code."""
    if isinstance(error, DamperfitError):
        return error.problem.sentence(), error.exit_code
    if hasattr(error, "format_message"):  # every usage error of typer, with the misused command
        context = getattr(error, "ctx", None)
        command = "" if context is None else context.command_path.removeprefix("damperfit").strip()
        message = " ".join(error.format_message().split()).rstrip(".")
        place = f"{command}: " if command else ""
        end = "" if message.endswith("?") else ";"
        return f"{place}{message}{end} see damperfit {f'{command} '.lstrip()}--help", 2
    if isinstance(error, typer.Abort):
        return "interrupted", _INTERRUPTED
    if isinstance(error, MemoryError):
        return "out of memory; give fewer or shorter logs at a time", 1
    code = error.errno if isinstance(error, OSError) else None
    if code == errno.ENOSPC:
        return f"cannot write the output: {getattr(error, 'strerror', '')}", 1
    if code == errno.ENAMETOOLONG:
        name = str(getattr(error, "filename", ""))
        return f"{name[:40]}...: a file's name cannot be that long; give a shorter one", 2
    try:
        os.getcwd()  # noqa: PTH109
    except OSError:
        if code == errno.ENOENT:
            return "the folder that this was started in is gone; go to one that is there (cd)", 2
    name = type(error).__name__
    return f"internal error, {name}: {error}; this is a bug, --debug shows where", _BUG
