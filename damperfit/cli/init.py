"""``damperfit init``: a commented configuration for a damper of your own."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from damperfit.cli.console import print_lines, say
from damperfit.cli.option_values import assignments
from damperfit.cli.options import DebugOption, QuietOption, VersionOption
from damperfit.errors import ConfigurationError

if TYPE_CHECKING:
    from collections.abc import Mapping

__all__ = ["init"]

_STDOUT = "-"


def init(
    logs: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="[LOGS...]", help="Logs of the damper: units, setting and signs are guessed."
        ),
    ] = None,
    model: Annotated[
        str, typer.Option(metavar="NAME", help="purdy, twin_tube, monotube, through_flow ...")
    ] = "purdy",
    set_: Annotated[
        list[str] | None,
        typer.Option(
            "--set",
            metavar="KEY=VALUE",
            help="A key of [damper], as in rod_diameter=12mm; may be given several times.",
        ),
    ] = None,
    out: Annotated[
        Path, typer.Option(metavar="FILE.toml", help="Where to write; - prints it.")
    ] = Path("my_damper.toml"),
    overwrite: Annotated[
        bool, typer.Option("--overwrite", help="Replace the file if it is there.")
    ] = False,
    quiet: QuietOption = False,
    debug: DebugOption = False,
    version: VersionOption = False,
) -> int:
    """Write a commented configuration for a damper of your own, and inspect its logs with it.

    On a terminal it asks for what is not given.

    Example: damperfit init runs/*.csv --model monotube --set rod_diameter=12mm
    """
    from damperfit.atomic import write_text
    from damperfit.queries.first_configuration import (
        Guessed,
        check_damper,
        first_configuration,
        guess_from_logs,
    )
    from damperfit.run.log_paths import expand

    is_printed = str(out) == _STDOUT
    if not is_printed and out.exists() and not overwrite:
        raise ConfigurationError(
            f"{out}: is there already; give --overwrite to replace it, or --out"
        )
    given = assignments(set_ or [], option="--set", example="rod_diameter=12mm")
    check_damper(model, given)
    paths = expand(logs) if logs else ()
    guessed = guess_from_logs(paths) if paths else Guessed({}, {})
    if sys.stdin.isatty() and sys.stderr.isatty() and not quiet:
        given = {**given, **_asked(model, given)}
        check_damper(model, given)
    text = first_configuration(model, given, guessed)
    if is_printed:
        print_lines(text.splitlines())
        return 0
    write_text(out, text)
    if not quiet:
        for sentence in guessed.why:
            say(f"note: {sentence}")
        for sentence in guessed.open:
            say(f"warning: {sentence}")
        say(f"damperfit: {out} written; measure the keys that begin with #, and remove the #")
    return _inspected(logs, out, is_quiet=quiet) if logs else 0


def _asked(model: str, given: Mapping[str, str]) -> dict[str, str]:
    """Ask for what is not given; an empty answer leaves the default."""
    from damperfit.configuration.drawings import DRAWINGS, MEASURED
    from damperfit.queries.first_configuration import damper_keys

    say("Each length and pressure of the damper; Enter keeps the value in brackets.")
    for line in DRAWINGS.get(model, "").splitlines():
        say(line)
    answers = {}
    for key, text in damper_keys(model).items():
        if key not in given:
            said = typer.prompt(
                f"{key} ({MEASURED.get(key, '')})", default="", show_default=False, err=True
            )
            if said.strip():
                answers[key] = said.strip()
            else:
                say(f"  {key}: {text}")
    return answers


def _inspected(logs: list[str], out: Path, *, is_quiet: bool) -> int:
    from damperfit.cli.inspect import inspect

    more = " ..." if logs[3:] else ""
    print_lines([f"$ damperfit inspect {' '.join(logs[:3])}{more} --config {out}"])
    return inspect(logs, config=out, quiet=is_quiet)
