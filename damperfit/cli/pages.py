"""Tables of the manual, made from the code when a page is shown.

`damperfit help`, and the site by `.ci/site.py`, fill the places `<!-- table: NAME -->` of a page by
`filled`.
"""

import json
import re
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import typer

import damperfit
from damperfit.checks import CHECK_LISTS, CHECKS
from damperfit.cli.main import app
from damperfit.configuration.drawings import MEASURED
from damperfit.configuration.loading import configuration_toml, load_configuration
from damperfit.damper.model import MODELS
from damperfit.damper.purdy.parameters import PURDY_DAMPER
from damperfit.exporting.targets import TARGETS, Target
from damperfit.identification.outcome import Outcome
from damperfit.manual import TOPICS, read_page, read_schema
from damperfit.tables.columns import describe_tables
from damperfit.units.quantities import _TABLE, units_of

_PLACE = re.compile(r"<!-- table: ([\w -]+) -->\n")
_COMMON = (
    *("config", "json", "quiet", "verbose", "color", "no_progress", "log_file"),
    *("debug", "version", "help"),
)


def filled(text: str) -> str:
    """Return the text of a page with its tables."""

    def table(place: re.Match[str]) -> str:
        kind, _, subject = place[1].partition(" of ")
        return TABLES[kind](*([subject] if subject else []))

    return _PLACE.sub(table, text)


def _commands_by_name() -> dict[str, Any]:
    return dict(vars(typer.main.get_command(app))["commands"])


def _grid(heading: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    cells = [heading, ["---"] * len(heading), *rows]
    return "".join(
        "| " + " | ".join(cell.replace("|", r"\|") for cell in row) + " |\n" for row in cells
    )


def _option_rows(command: str, *, is_common: bool) -> Iterator[list[str]]:
    context: Any = typer.Context(_commands_by_name()[command], help_option_names=["-h", "--help"])
    for option in context.command.get_params(context):
        if option.param_type_name == "option" and (option.name in _COMMON) == is_common:
            value = "" if option.is_flag or not option.metavar else f" {option.metavar}"
            spellings = ", ".join(f"`{word}{value}`" for word in sorted(option.opts, key=len))
            _, meaning = option.get_help_record(context)
            yield [spellings, " ".join(meaning.split())]


def _first_line(text: str | None) -> str:
    return (text or "").strip().partition("\n")[0]


# Pages on a command that has another name.
_PAGES = {"identify": "files", "inspect": "quality", "settings": "trust", "config": "configuration"}


def _section(name: str) -> str:
    """A heading, what the command does, an example, its page and its own options."""
    page = _PAGES.get(name, name if name in TOPICS else "")
    paragraphs = (_commands_by_name()[name].help or "").strip().split("\n\n")
    lines = [" ".join(paragraph.split()) for paragraph in paragraphs]
    blocks = [re.sub(r"^Example: (.+)", r"Example: `\1`", line) for line in lines]
    if page:
        blocks.append(f"Page: [{page}]({page}.md).")
    if rows := list(_option_rows(name, is_common=False)):
        blocks.append(_grid(("option", "meaning"), rows))
    return "\n\n".join([f"### {name}", *blocks])


def _columns(name: str) -> str:
    first, *others = PURDY_DAMPER.names
    rows = []
    for column in describe_tables()[name]:
        title = column["name"]
        of_others = tuple(f"{other}_" for other in others)
        is_another = name == "parameters" and title.startswith(of_others)
        if is_another and title.endswith(("_se", "_low", "_high", "_status")):
            continue
        unit, meaning = column["unit"], column["description"]
        if name == "parameters" and title.startswith(f"{first}_"):
            title, meaning = title.replace(first, "NAME"), meaning.replace(first, "NAME")
            unit = "its own" if unit else ""
        rows.append([f"`{title}`", "-" if unit in {"", "1"} else unit, meaning])
    return _grid(("column", "unit", "meaning"), rows)


def _objects(path: str, node: dict[str, Any]) -> Iterator[tuple[str, str]]:
    """Yield the path of each object of a schema, and its keys in words."""
    while "items" in node:
        path, node = f"{path}[]", node["items"]
    keys = node.get("properties", {})
    if keys:
        meanings = (
            f"`{key}`: {entry['description']}" if "description" in entry else f"`{key}`"
            for key, entry in keys.items()
        )
        yield path or "run.json", "; ".join(meanings)
    for key, entry in keys.items():
        yield from _objects(f"{path}.{key}" if path else key, entry)
    if isinstance(others := node.get("additionalProperties"), dict):
        yield from _objects(f"{path}.NAME", others)


def _of_check(name: str) -> list[str]:
    on = ("yes" if name in listed else "" for listed in CHECK_LISTS.values())
    return [f"`{name}`", _first_line(CHECKS[name].__doc__).rstrip("."), *on]


def _of_target(target: Target) -> list[str]:
    file = f"`{target.file.format(stem='damper', setting='N')}`"
    return [f"`{target.name}`", target.title, file, target.units, target.sign, target.place]


TABLES: dict[str, Callable[..., str]] = {
    "topics": lambda: _grid(
        ("topic", "page"),
        [[f"`{topic}`", f"[{read_page(topic).title}]({topic}.md)"] for topic in TOPICS],
    ),
    "commands": lambda: _grid(
        ("command", "job"),
        [[f"`damperfit {n}`", _first_line(c.help)] for n, c in _commands_by_name().items()],
    ),
    "common options": lambda: _grid(
        ("option", "meaning"), list(_option_rows("identify", is_common=True))
    ),
    "every command": lambda: "\n".join(map(_section, _commands_by_name())),
    "columns": _columns,
    "run json": lambda: _grid(
        ("object", "keys"),
        [[f"`{path}`", keys] for path, keys in _objects("", json.loads(read_schema()))],
    ),
    "checks": lambda: _grid(
        ("check", "passed when", *(f"`{name}`" for name in CHECK_LISTS)),
        [_of_check(name) for name in CHECKS],
    ),
    "paper quantities": lambda: _grid(
        ("column", "symbol", "meaning", "unit"),
        [[f"`{q.name}`", q.symbol, q.meaning, q.unit] for q in PURDY_DAMPER.quantities],
    ),
    "geometry": lambda: _grid(
        ("key of `[damper]`", "what it is, and how it is measured"),
        [[f"`{key}`", text] for key, text in MEASURED.items()],
    ),
    "door": lambda: _grid(
        ("name", "what it is"),
        [
            [f"`{name}`", _first_line(getattr(damperfit, name).__doc__)]
            for name in sorted(set(dir(damperfit)) - {"__version__"})
        ],
    ),
    "models": lambda: _grid(
        ("model", "what it is"), [[f"`{name}`", model.title] for name, model in MODELS.items()]
    ),
    "targets": lambda: _grid(
        ("target", "what it is", "file", "units", "sign", "where it goes"),
        [_of_target(target) for target in TARGETS.values()],
    ),
    "outcomes": lambda: _grid(
        ("outcome", "what to do"), [[f"`{outcome.value}`", outcome.advice] for outcome in Outcome]
    ),
    "units": lambda: _grid(
        ("quantity", "units"),
        [[kind, ", ".join(f"`{unit}`" for unit in units_of(kind))] for kind in _TABLE],
    ),
    "defaults": lambda: f"```toml\n{configuration_toml(load_configuration())}```\n",
}
