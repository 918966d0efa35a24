"""The help of each command: options in panels, words for what they take, an example."""

from __future__ import annotations

import re

import pytest
import typer

from damperfit.cli.main import app, main
from damperfit.damper.models import MODELS
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


@pytest.mark.parametrize("command", COMMANDS)
def test_defaults_have_one_form_and_ranges_are_words(command, capsys):
    text = " ".join(help_of(command, capsys).partition("Options:\n")[0].split())
    in_brackets = {one.partition(":")[0] for one in re.findall(r"(?<=[.)] )\[([^]]*)\]", text)}
    assert in_brackets <= {"default", "required"}
    assert "default" not in re.sub(r"\[default: [^]]*\]", "", text).lower()
    assert ">=" not in text


@pytest.mark.parametrize("command", COMMANDS)
def test_usage_and_arguments_are_words(command, capsys):
    text = help_of(command, capsys)
    assert text.startswith(f"Usage: damperfit {command} [OPTIONS]")
    assert not re.search(r"[{}<>]", text.split("Example:")[0])
    assert "list[" not in text
    assert f"Example: damperfit {command}" in text


def test_what_may_be_left_out_stands_in_brackets(capsys):
    assert "identify [OPTIONS] LOGS...\n" in help_of("identify", capsys)
    assert "fleet [OPTIONS] [LOGS...]\n" in help_of("fleet", capsys)
    assert "export [OPTIONS] [RESULTS]\n" in help_of("export", capsys)


def test_completion_is_offered(capsys):
    assert main(["--help"]) == 0
    assert "--install-completion" in capsys.readouterr().out


# Options that mean another thing in another command, or have another default there.
OF_THEIR_OWN = {
    "--check": "identify takes names of checks; export has one",
    "--out": "each command writes something else",
    "--report": "of a run, or of a fleet",
    "--setting": "of logs that are read, or whose parameters are used",
    "--parameters": "samples takes them for the truth",
    "--set": "init sets keys of [damper]",
    "--model": "init cannot take auto",
    "--velocity": "compare takes several",
    "--cycles": "simulated, or in each log that samples writes",
    "--sample-rate": "likewise",
    "--overwrite": "init has one file to replace",
}


def test_an_option_has_one_spelling_and_one_help_in_all_commands():
    seen = {}
    for name, command in typer.main.get_command(app).commands.items():
        for one in command.params:
            for word in one.opts if one.param_type_name == "option" else ():
                seen.setdefault(word, {})[name] = (one.metavar, one.help, tuple(one.opts))
    differing = {word for word, uses in seen.items() if len(set(uses.values())) > 1}
    assert differing == set(OF_THEIR_OWN)


@pytest.mark.parametrize("columns", [60, 80, 200])
def test_no_command_s_sentence_is_cut(capsys, monkeypatch, columns) -> None:
    monkeypatch.setenv("COLUMNS", str(columns))
    assert main(["--help"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert max(map(len, lines)) <= columns
    said = " ".join(" ".join(lines[lines.index("Commands:") :]).split())
    assert "..." not in said
    assert (
        "fleet Fit many dampers, one part each; finished ones are not fitted again. export" in said
    )


def test_the_procedure_of_other_models_is_theirs(capsys) -> None:
    said = re.search(r"of\s+other\s+models\s+(\w+)\]", help_of("identify", capsys))
    assert said is not None
    others = {one.procedures[0] for name, one in MODELS.items() if name != "purdy"}
    assert others == {said[1]}
