"""What the manual says of the code is so."""

import json
import re
from dataclasses import fields

import pytest
import yaml

from damperfit.cli.pages import TABLES, filled
from damperfit.configuration.loading import default_document
from damperfit.manual import TOPICS, read_schema
from damperfit.uncertainty.covariance import GasContent
from damperfit.uncertainty.grades import Objection
from tests.manual.generated import COMMANDS, PAGES, PLACE, ROOT, options_of

EVERY = sorted(path.stem for path in PAGES.glob("*.md"))


def text_of(page: str) -> str:
    return (PAGES / f"{page}.md").read_text(encoding="utf-8")


def test_every_table_of_the_pages_is_made_and_every_one_stands_in_a_page() -> None:
    names = [name for page in EVERY for name in PLACE.findall(text_of(page))]
    assert {name.partition(" of ")[0] for name in names} == set(TABLES)
    for page in EVERY:
        assert "<!-- table" not in filled(text_of(page))


def test_every_topic_is_a_page_in_the_menu_of_the_site() -> None:
    menu = yaml.safe_load((ROOT / "mkdocs.yml").read_text(encoding="utf-8"))["nav"]
    pages = [page for heading in menu for part in heading.values() for page in part]
    pages.remove("api.md")  # of docstrings, on the site alone
    assert pages == ["index.md", *(f"{topic}.md" for topic in TOPICS)]
    assert sorted([*TOPICS, "index"]) == EVERY


@pytest.mark.parametrize("page", EVERY)
def test_keys_of_the_configuration_exist(page) -> None:
    known = default_document()
    text = PLACE.sub("", text_of(page))
    sections = "|".join(known)
    for section, key in re.findall(rf"`({sections})\.(\w+)(?: = [^`]+)?`", text):
        assert key in known[section], (section, key)


@pytest.mark.parametrize("page", EVERY)
def test_commands_and_options_in_the_text_exist(page) -> None:
    text = PLACE.sub("", text_of(page))
    for command, rest in re.findall(r"`damperfit ([a-z]+)\b([^`]*)`", text):
        assert command in COMMANDS, command
        for option in re.findall(r"(?<![\w-])--[a-z][a-z-]*", rest):
            assert option in options_of(command), (command, option)
    every = set().union(*map(options_of, COMMANDS))
    for option in re.findall(r"`(--[a-z][a-z-]*)", text):
        assert option in every | {"--strict", "--help"}, option


def _missing(value, schema: dict, path: str = "run.json"):
    """Keys of a document that its schema does not know."""
    if isinstance(value, list):
        for item in value:
            yield from _missing(item, schema.get("items", {}), f"{path}[]")
    elif isinstance(value, dict) and schema:
        known, others = schema.get("properties", {}), schema.get("additionalProperties", False)
        for key, item in value.items():
            if key in known or others is True:
                yield from _missing(item, known.get(key, {}), f"{path}.{key}")
            elif others:
                yield from _missing(item, others, f"{path}.{key}")
            else:
                yield f"{path}.{key}"


def test_every_key_of_run_json_is_told(full_run) -> None:
    schema = json.loads(read_schema())
    assert {key for record in full_run for key in _missing(record, schema)} == set()
    inner = schema["properties"]
    gas, reasons = inner["gas_content"], inner["grades_withheld"]["items"]["properties"]["reasons"]
    for known, kind in ((gas, GasContent), (reasons["items"], Objection)):
        assert {field.name for field in fields(kind)} <= set(known["properties"])
