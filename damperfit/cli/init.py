"""``damperfit init``: a commented configuration for a damper of your own."""

from __future__ import annotations

import os
import shlex
import sys
from glob import glob
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from damperfit.cli.console import print_lines, say
from damperfit.cli.option_values import assignments, check_places
from damperfit.cli.options import DebugOption, QuietOption, VersionOption
from damperfit.errors import ConfigurationError

if TYPE_CHECKING:
    from collections.abc import Mapping

__all__ = ["init"]

_STDOUT = "-"
_MODEL = "purdy"


def init(
    logs: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="[LOGS...]", help="Logs of the damper: units, setting and signs are guessed."
        ),
    ] = None,
    model: Annotated[
        str | None,
        typer.Option(
            metavar="NAME", help="purdy, twin_tube, monotube, through_flow ...  [default: purdy]"
        ),
    ] = None,
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
    from damperfit.queries.first_configuration import (
        Guessed,
        check_damper,
        first_configuration,
        guess_from_logs,
    )
    from damperfit.run.log_paths import expand
    from damperfit.store import write_text

    is_printed = str(out) == _STDOUT
    if not is_printed:
        check_places(out.parent)
    if not is_printed and out.exists() and not overwrite:
        raise ConfigurationError(
            "is there already; give --overwrite to replace it, or --out", subject=out
        )
    given = assignments(set_ or [], option="--set", example="rod_diameter=12mm")
    is_asked = _is_terminal() and not quiet
    model = model or (_asked_model() if is_asked else _MODEL)
    check_damper(model, given)
    paths = expand(logs) if logs else ()
    guessed = guess_from_logs(paths, model, given) if paths else Guessed({}, {})
    if is_asked:
        given = _asked(model, given)
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
    code = _inspected(logs, out, is_quiet=quiet) if logs else 0
    if code == 0 and not quiet:
        say(f"next: damperfit identify {_shown(logs or ['LOGS'])} --config {shlex.quote(str(out))}")
    return code


def _is_terminal() -> bool:
    return sys.stdin.isatty() and sys.stderr.isatty()


def _asked_model() -> str:
    """Ask which damper it is, until the answer is a model."""
    from damperfit.configuration.drawings import DRAWINGS
    from damperfit.damper.models import MODELS
    from damperfit.queries.first_configuration import check_damper

    say("Which damper is it? See also: damperfit help models")
    for name in DRAWINGS:
        say(f"  {name:<13} {MODELS[name].title}")
    while True:
        model = _answer("model", _MODEL) or _MODEL
        try:
            check_damper(model, {})
        except ConfigurationError as error:
            say(f"  {str(error).removeprefix('--model: ')}")
        else:
            return model


def _asked(model: str, given: Mapping[str, str]) -> dict[str, str]:
    """Ask for what is not given, until it is a damper; what Enter leaves is not declared."""
    from damperfit.configuration.drawings import DRAWINGS
    from damperfit.queries.first_configuration import check_damper, damper_keys

    defaults = {key: text for key, text in damper_keys(model).items() if key not in given}
    if defaults:
        say(
            "Now its lengths and pressures, as in 12mm or 8bara. Enter keeps the value in brackets."
        )
    for line in DRAWINGS.get(model, "").splitlines():
        say(line)
    answers = dict(given)
    while True:
        for key, text in defaults.items():
            if said := _asked_key(model, key, answers.get(key, text)):
                answers[key] = said
        try:
            check_damper(model, answers)
        except ConfigurationError as error:
            if not defaults:
                raise
            say(f"  {str(error).removeprefix('--set ')}; once more:")
        else:
            return answers


def _asked_key(model: str, key: str, default: str) -> str:
    """Return what was typed, a value of the key; nothing where Enter alone left the default."""
    from damperfit.configuration.drawings import MEASURED
    from damperfit.queries.first_configuration import fault_of

    how = MEASURED.get(key, "")
    while True:
        said = _answer(f"{key} ({how})" if how else key, default)
        fault = fault_of(model, key, said) if said else ""
        if not fault:
            return said
        say(f"  {fault}")


def _answer(question: str, default: str) -> str:
    # input() would write its prompt to stdout where that is a file, as for `--out -`.
    sys.stderr.write(f"{question} [{default}]: ")
    sys.stderr.flush()
    line = sys.stdin.readline()
    if not line:
        raise typer.Abort
    return line.strip()


def _inspected(logs: list[str], out: Path, *, is_quiet: bool) -> int:
    from damperfit.cli.inspect import inspect

    print_lines([f"$ damperfit inspect {_shown(logs)} --config {shlex.quote(str(out))}"])
    return inspect(logs, config=out, quiet=is_quiet)


def _shown(logs: list[str]) -> str:
    """Return logs as a shell takes them; of several, where it names them alone, their pattern."""
    if len(logs) > 1:
        start = os.path.commonprefix(logs)  # noqa: RUF071 - of a pattern, not of a path
        pattern = f"{start}*{Path(logs[0]).suffix}"
        if set(glob(pattern)) == set(logs):
            return shlex.quote(pattern)
    return " ".join(map(shlex.quote, logs))
