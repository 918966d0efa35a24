"""The help of each command: options in panels, words for what they take, an example."""

from __future__ import annotations

import re

import pytest

from damperfit.cli.main import app, main
from damperfit.damper.model import MODELS
from damperfit.keywords import PANELS

COMMANDS = [command.name or command.callback.__name__ for command in app.registered_commands]
PLAIN = {"--help", "--version", "--debug"}  # options that stand in no panel


def help_of(command: str, capsys) -> str:
    assert main([command, "--help"]) == 0
    return capsys.readouterr().out


def options_of(text: str) -> dict[str, list[str]]:
    """Return the options by the panel that they stand in."""
    found: dict[str, list[str]] = {}
    panel = ""
    for line in text.splitlines():
        if heading := re.fullmatch(r"([A-Z]\w+):", line):
            panel = heading[1]
        elif option := re.match(r"  (?:-\w, )?(--[a-z-]+)", line):
            found.setdefault(panel, []).append(option[1])
    return found


@pytest.mark.parametrize("command", COMMANDS)
def test_every_option_stands_in_its_panel(command, capsys):
    found = options_of(help_of(command, capsys))
    assert PLAIN <= set(found["Options"])
    assert list(found) == [name for name in PANELS if name in found]


def test_completion_is_offered(capsys):
    assert main(["--help"]) == 0
    assert "--install-completion" in capsys.readouterr().out


# Options that mean another thing in another command, or have another default there.


def test_the_procedure_of_other_models_is_theirs(capsys) -> None:
    said = re.search(r"of\s+other\s+models\s+(\w+)\]", help_of("identify", capsys))
    assert said is not None
    others = {one.procedures[0] for name, one in MODELS.items() if name != "purdy"}
    assert others == {said[1]}
