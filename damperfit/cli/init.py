"""``damperfit init``: a commented configuration for a damper of your own."""

from __future__ import annotations

import os
import shlex
import sys
from glob import glob
from pathlib import Path
from typing import Any

import typer

from damperfit import api
from damperfit.arguments import assignments
from damperfit.cli.command import Shown, command
from damperfit.cli.console import print_lines, say
from damperfit.errors import ConfigurationError
from damperfit.problem import Option

_MODEL = "purdy"
_FILE = Path("my_damper.toml")


@command(
    api.init,
    shown=("quiet", "debug", "version"),
    example="init runs/*.csv --model monotube --set rod_diameter=12mm",
)
def init(how: Shown, logs: list[str] | None, **given: Any) -> int:
    """Write a commented configuration for a damper of your own, and inspect its logs with it.

    On a terminal it asks for what is not given.
    """
    from damperfit.cli.commands import inspect

    out = Path(given["out"] or _FILE)
    path = None if str(out) == "-" else out  # which is stdout
    keys = assignments(given["set"] or [], Option("set"), "rod_diameter=12mm")
    asked = {**given, "out": path, "set": keys}
    is_asking = _is_terminal() and not how.quiet
    if is_asking and not (path is not None and path.exists() and not given["overwrite"]):
        asked["model"] = given["model"] or _asked_model()
        asked["set"] = _asked_keys(asked["model"], asked["set"])
    made = api.init(logs, **asked)
    if path is None:
        print_lines(made.text.splitlines())
        return 0
    for before, sentences in (("note", made.why), ("warning", made.open)):
        for sentence in () if how.quiet else sentences:
            say(f"{before}: {sentence}")
    if not how.quiet:
        say(f"damperfit: {out} written; measure the keys that begin with #, and remove the #")
    code, config = 0, shlex.quote(str(out))
    if logs:
        print_lines([f"$ damperfit inspect {_shown(logs)} --config {config}"])
        code = inspect(logs, config=out, quiet=how.quiet)
    if code == 0 and not how.quiet:
        say(f"next: damperfit identify {_shown(logs or ['LOGS'])} --config {config}")
    return code


def _is_terminal() -> bool:
    return sys.stdin.isatty() and sys.stderr.isatty()


def _asked_model() -> str:
    """Ask which damper it is, until the answer is a model."""
    from damperfit.configuration.drawings import DRAWINGS
    from damperfit.damper.model import MODELS
    from damperfit.queries.first_configuration import check_damper

    say("Which damper is it? See also: damperfit help models")
    for name in DRAWINGS:
        say(f"  {name:<13} {MODELS[name].title}")
    while True:
        model = _answer("model", _MODEL) or _MODEL
        try:
            check_damper(model, {})
        except ConfigurationError as error:
            say(f"  {error.problem.message()}")
        else:
            return model


def _asked_keys(model: str, given: dict[str, str]) -> dict[str, str]:
    """Ask for what is not given, until it is a damper; what Enter leaves is not declared."""
    from damperfit.configuration.drawings import DRAWINGS, MEASURED
    from damperfit.queries.first_configuration import check_damper, damper_keys, fault_of

    defaults = {key: text for key, text in damper_keys(model).items() if key not in given}
    lengths = (
        "Now its lengths and pressures, as in 12mm or 8bara. Enter keeps the value in brackets."
    )
    for line in (*[lengths] * bool(defaults), *DRAWINGS.get(model, "").splitlines()):
        say(line)
    answers = dict(given)
    while True:
        for key, text in defaults.items():
            question = f"{key} ({MEASURED[key]})" if key in MEASURED else key
            while (typed := _answer(question, answers.get(key, text))) and (
                fault := fault_of(model, key, typed)
            ):
                say(f"  {fault}")
            if typed:
                answers[key] = typed
        try:
            check_damper(model, answers)
        except ConfigurationError as error:
            if not defaults:
                raise
            where = error.problem.where
            key = f"{where.key}: " if isinstance(where, Option) and where.key else ""
            say(f"  {key}{error.problem.message()}; once more:")
        else:
            return answers


def _answer(question: str, default: str) -> str:
    # input() would write its prompt to stdout where that is a file, as for `--out -`.
    sys.stderr.write(f"{question} [{default}]: ")
    sys.stderr.flush()
    line = sys.stdin.readline()
    if not line:
        raise typer.Abort
    return line.strip()


def _shown(logs: list[str]) -> str:
    """Return logs as a shell takes them; of several, where it names them alone, their pattern."""
    if len(logs) > 1:
        start = os.path.commonprefix(logs)  # noqa: RUF071 - of a pattern, not of a path
        pattern = f"{start}*{Path(logs[0]).suffix}"
        if set(glob(pattern)) == set(logs):
            return shlex.quote(pattern)
    return " ".join(map(shlex.quote, logs))
