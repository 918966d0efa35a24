"""Tables of the manual that follow from the code, and what the pages hold in their place."""

from __future__ import annotations

import importlib
import re
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import typer

import damperfit
from damperfit.cli.main import app
from damperfit.damper.models import MODELS
from damperfit.damper.purdy.parameters import PURDY_DAMPER
from damperfit.exporting.targets import TARGETS
from damperfit.identification import Outcome
from damperfit.manual import TOPICS, read_page
from damperfit.tables.columns import describe_tables
from damperfit.units.quantities import _TABLE

ROOT = Path(__file__).parents[2]
PAGES = ROOT / "damperfit" / "manual" / "pages"
COMMANDS = typer.main.get_command(app).commands
PLACE = re.compile(r"<!-- table: ([\w -]+) -->\n(.*?)<!-- end -->", flags=re.DOTALL)
_COMMON = ("config", "json", "quiet", "log_file", "debug", "version", "help")


def filled(text: str) -> str:
    """The text of a page with every table as the code has it."""
    return PLACE.sub(lambda m: f"<!-- table: {m[1]} -->\n{table(m[1])}<!-- end -->", text)


def table(name: str) -> str:
    kind, _, of = name.partition(" of ")
    return "\n" + TABLES[kind](*([of] if of else [])) + "\n"


def options_of(command: str) -> set[str]:
    """Every spelling of every option."""
    return {one for option in _options(command) for one in (*option.opts, *option.secondary_opts)}


def _options(command: str) -> list:
    params = COMMANDS[command].get_params(_context(command))
    return [one for one in params if one.param_type_name == "option"]


def _context(command: str) -> typer.Context:
    return typer.Context(COMMANDS[command], help_option_names=["-h", "--help"])


def _grid(heading: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    cells = [heading, ["---"] * len(heading), *rows]
    return "".join("| " + " | ".join(c.replace("|", r"\|") for c in row) + " |\n" for row in cells)


def _option_rows(command: str, *, is_common: bool) -> Iterator[list[str]]:
    for one in _options(command):
        if (one.name in _COMMON) == is_common:
            value = "" if one.is_flag or not one.metavar else f" {one.metavar}"
            spelled = ", ".join(f"`{word}{value}`" for word in sorted(one.opts, key=len))
            _, said = one.get_help_record(_context(command))
            yield [spelled, " ".join(said.split())]


def _first_line(text: str | None) -> str:
    return (text or "").strip().partition("\n")[0]


def _commands() -> str:
    said = [[f"`damperfit {name}`", _first_line(one.help)] for name, one in COMMANDS.items()]
    return _grid(("command", "job"), said)


def _columns(name: str) -> str:
    first, *others = PURDY_DAMPER.names
    shown = []
    for column in describe_tables()[name]:
        title = column["name"]
        is_another = name == "parameters" and title.startswith(tuple(f"{one}_" for one in others))
        if is_another and title.endswith(("_se", "_low", "_high", "_status")):
            continue
        unit, meaning = column["unit"], column["description"]
        if name == "parameters" and title.startswith(f"{first}_"):
            title, meaning = title.replace(first, "NAME"), meaning.replace(first, "NAME")
            unit = "its own" if unit else ""
        shown.append([f"`{title}`", "-" if unit in {"", "1"} else unit, meaning])
    return _grid(("column", "unit", "meaning"), shown)


def _door() -> str:
    said = []
    for name, module in sorted(damperfit._DOOR.items()):
        thing = getattr(importlib.import_module(module), name)
        said.append([f"`{name}`", _first_line(thing.__doc__)])
    return _grid(("name", "what it is"), said)


def _units() -> str:
    return _grid(
        ("quantity", "units"),
        [
            [dimension, ", ".join(f"`{spellings.split()[0]}`" for spellings in units)]
            for dimension, units in _TABLE.items()
        ],
    )


TABLES: dict[str, Callable[..., str]] = {
    "topics": lambda: _grid(
        ("topic", "page"), [[f"`{one}`", f"[{read_page(one).title}]({one}.md)"] for one in TOPICS]
    ),
    "commands": _commands,
    "common options": lambda: _grid(
        ("option", "meaning"), list(_option_rows("identify", is_common=True))
    ),
    "options": lambda name: _grid(("option", "meaning"), list(_option_rows(name, is_common=False))),
    "columns": _columns,
    "door": _door,
    "models": lambda: _grid(
        ("model", "what it is"), [[f"`{name}`", one.title] for name, one in MODELS.items()]
    ),
    "targets": lambda: _grid(
        ("target", "what it is", "file", "units", "sign", "where it goes"),
        [
            [
                *(f"`{one.name}`", one.title, f"`{one.file.format(stem='damper', setting='N')}`"),
                *(one.units, one.sign, one.place),
            ]
            for one in TARGETS.values()
        ],
    ),
    "outcomes": lambda: _grid(
        ("outcome", "what to do"), [[f"`{one.value}`", one.advice] for one in Outcome]
    ),
    "units": _units,
    "defaults": lambda: (
        "```toml\n"
        + (ROOT / "damperfit/configuration/defaults.toml").read_text(encoding="utf-8")
        + "```\n"
    ),
}
