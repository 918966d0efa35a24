"""What the manual says of the code is so."""

from __future__ import annotations

import re
import tomllib
from dataclasses import fields

import pytest
import yaml

from damperfit.checks import CHECK_LISTS, CHECKS
from damperfit.cli.pages import TABLES, filled
from damperfit.manual import TOPICS
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
    assert pages == ["index.md", *(f"{topic}.md" for topic in TOPICS)]
    assert sorted([*TOPICS, "index"]) == EVERY


def test_every_check_is_told_and_whether_it_is_on_the_list() -> None:
    rows = re.findall(r"^\| `(\w+)` \| .+ \| ?(yes)? ?\|$", text_of("gates"), flags=re.MULTILINE)
    assert [name for name, _ in rows] == list(CHECKS)
    assert tuple(name for name, listed in rows if listed) == CHECK_LISTS["purdy2000"]


@pytest.mark.parametrize("page", EVERY)
def test_keys_of_the_configuration_exist(page) -> None:
    known = tomllib.loads(
        (ROOT / "damperfit" / "configuration" / "defaults.toml").read_text(encoding="utf-8")
    )
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


def _told_keys() -> set[str]:
    """Every key of run.json that the page has, as a path; `.key` goes on from the row's first."""
    table = text_of("files").partition("## run.json")[2]
    told: set[str] = set()
    for cell, meaning in re.findall(r"^\| (`.+?) \| (.*) \|$", table, flags=re.MULTILINE):
        paths = re.findall(r"`([^`]+)`", cell)
        stem = paths[0].rpartition(".")[0]
        whole = [stem + path if path.startswith(".") else path for path in paths]
        told |= set(whole)
        told |= {
            f"{path}.{key}"
            for path in whole
            for key in re.findall(r"`(\w+(?:\.<name>)?)`", meaning)
        }
    return told


def _paths(value, path=""):
    if isinstance(value, dict):
        for key, item in value.items():
            yield from _paths(item, f"{path}.{key}" if path else key)
            yield f"{path}.{key}" if path else key
    elif isinstance(value, list):
        for item in value:
            yield from _paths(item, f"{path}[]")


def _matches(path: str, told: set[str]) -> bool:
    """Whether a path is told: as it is, as a list, or with a name in place of what depends."""
    plain = path.replace("inputs[].stretches[]", "stretches[]")
    if plain in told or f"{plain}[]" in told or plain.startswith(("configuration.", "files.")):
        return True
    if any(one.startswith(f"{plain}.") for one in told):
        return True
    stem = plain.rpartition(".")[0]
    return f"{stem}.<name>" in told or f"{plain}.<name>" in told


def test_every_key_of_run_json_is_told(full_run) -> None:
    told = _told_keys()
    missing = {
        path
        for record in full_run
        for path in _paths(record)
        if not path.startswith("schema.") and not _matches(path, told)
    }
    assert missing == set()
    for stem, kind in (("gas_content", GasContent), ("grades_withheld[].reasons[]", Objection)):
        assert {f"{stem}.{one.name}" for one in fields(kind)} <= told
