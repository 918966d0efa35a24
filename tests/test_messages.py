"""Every option, key and command that a message names is one that exists."""

import ast
import re
from dataclasses import fields
from pathlib import Path

import typer

import damperfit
from damperfit.cli.main import app
from damperfit.configuration.loading import default_document
from damperfit.damper.model import MODELS
from damperfit.sections import ProfileSection

SOURCE = Path(damperfit.__file__).parent
DEFAULTS = default_document()
COMMANDS = typer.main.get_command(app).commands
OPTIONS = {name for command in COMMANDS.values() for p in command.params for name in p.opts}
OTHERS = {"--help", "--force-reinstall"}  # typer's and pip's
# Beside the paper's damper: every model has keys of its own under [damper].
for _model in MODELS.values():
    DEFAULTS["damper"] |= {one.name: None for one in fields(_model)}
# Names of fields of our own dataclasses that read like keys and are none.
NO_KEYS = {"max_bytes"}

OPTION = re.compile(r"(?<![\w-])--[a-z][a-z-]*[a-z]")
KEY = re.compile(
    rf"(?<![\w./])({'|'.join(DEFAULTS)})\.([a-z_][a-z_0-9]*)(?![\w\0])(?:\.([a-z_0-9]+))?"
)
IN_SECTION = re.compile(rf"\[({'|'.join(DEFAULTS)})\] ([a-z]+_[a-z_]+)")
COMMAND = re.compile(r"(?:run|as|of|see|by|Example:|\() ?damperfit ([a-z]+)\b")


def _texts(path: Path) -> list[tuple[int, str]]:
    """Every string of a module that is no docstring, with the parts of an f-string put together."""
    silent: set[int] = set()
    found = []
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):  # parents first
        if isinstance(body := getattr(node, "body", None), list):  # docstrings, also of fields
            silent |= {id(one.value) for one in body if isinstance(one, ast.Expr)}
        if isinstance(node, ast.JoinedStr):
            silent |= {id(part) for part in node.values}
            parts = (p.value if isinstance(p, ast.Constant) else "\0" for p in node.values)
            found.append((node.lineno, "".join(parts)))
        elif isinstance(node, ast.Constant) and id(node) not in silent:
            value = node.value.decode("latin-1") if isinstance(node.value, bytes) else node.value
            found += [(node.lineno, value)] * isinstance(value, str)
    return found


def unknown_names(text: str) -> list[str]:
    """Return what a text names that does not exist."""
    bad = [option for option in OPTION.findall(text) if option not in OPTIONS | OTHERS]
    profile = {*ProfileSection.entries()}
    for section, key, inner in KEY.findall(text):
        if key not in DEFAULTS[section]:
            bad.append(f"{section}.{key}")
        elif key in {"columns", "units", "scales", "offsets"} and inner not in {
            "", "time", "displacement", "force", "velocity", "temperature", "setting"
        }:  # fmt: skip
            bad.append(f"{section}.{key}.{inner}")
    bad += [f"[{s}] {key}" for s, key in IN_SECTION.findall(text) if key not in DEFAULTS[s]]
    bad += [f"damperfit {name}" for name in COMMAND.findall(text) if name not in COMMANDS]
    in_brackets = re.findall(r"\(([a-z]+_[a-z_]+)\)", text)
    known = {key for keys in DEFAULTS.values() for key in keys} | profile
    bad += [name for name in in_brackets if name in NO_KEYS or name not in known]
    return bad


def test_messages_name_what_exists() -> None:
    wrong = {
        f"{path.relative_to(SOURCE)}:{line}": names
        for path in sorted(SOURCE.rglob("*.py"))
        if path.name != "build_backend.py"
        if unknown_names(path.read_text(encoding="utf-8"))  # docstrings may name what they like
        for line, text in _texts(path)
        if (names := unknown_names(text))
    }
    assert wrong == {}
