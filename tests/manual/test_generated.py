"""What the manual says of the code is so."""

from __future__ import annotations

import ast
import re
import tomllib
from dataclasses import fields

import pytest
import yaml

from damperfit import errors
from damperfit.checks import CHECK_LISTS, CHECKS
from damperfit.cli.pages import TABLES, filled
from damperfit.configuration.loading import load_configuration
from damperfit.io.formats import FORMATS
from damperfit.manual import TOPICS, read_page
from damperfit.run.logs import Ending
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


def test_every_command_has_its_options_in_the_manual() -> None:
    told = set(PLACE.findall(text_of("commands")))
    for command in COMMANDS:
        assert f"\n## {command}\n" in text_of("commands"), command
        if command not in {"config", "doctor", "help"}:  # they have no options of their own
            assert f"options of {command}" in told


def test_every_topic_is_a_page_in_the_menu_of_the_site() -> None:
    menu = yaml.safe_load((ROOT / "mkdocs.yml").read_text(encoding="utf-8"))["nav"]
    pages = [page for heading in menu for part in heading.values() for page in part]
    assert pages == ["index.md", *(f"{topic}.md" for topic in TOPICS)]
    assert sorted([*TOPICS, "index"]) == EVERY


def test_every_check_is_told_and_whether_it_is_on_the_list() -> None:
    rows = re.findall(r"^\| `(\w+)` \| .+ \| ?(yes)? ?\|$", text_of("gates"), flags=re.MULTILINE)
    assert [name for name, _ in rows] == list(CHECKS)
    assert tuple(name for name, listed in rows if listed) == CHECK_LISTS["purdy2000"]


def test_every_exit_code_is_explained() -> None:
    codes = {int(code) for code in re.findall(r"^\| (\d+) \|", text_of("gates"), re.MULTILINE)}
    by_error = {
        one.exit_code
        for one in vars(errors).values()
        if isinstance(one, type) and issubclass(one, errors.DamperfitError)
    }
    assert codes == {ending.value for ending in Ending} | by_error | {0, 2, 70}


def test_every_kind_of_failure_is_explained() -> None:
    told = set(re.findall(r"^\| `(\w+Error)` \|", text_of("gates"), flags=re.MULTILINE))
    raised = {
        name
        for name, one in vars(errors).items()
        if isinstance(one, type) and issubclass(one, errors.DamperfitError)
    }
    not_of_logs = {
        "DamperfitError", "ConfigurationError", "InstallationError", "OutputError",
        "FitCancelledError",
    }  # fmt: skip
    assert told >= raised - not_of_logs
    source = "".join(path.read_text(encoding="utf-8") for path in ROOT.glob("damperfit/**/*.py"))
    assert all(f'"{name}"' in source or f"class {name}" in source for name in told)


def _findings() -> set[str]:
    """First arguments of Finding(...) anywhere; names that begin with a channel for both."""
    found: set[str] = set()
    for path in ROOT.glob("damperfit/**/*.py"):
        text = path.read_text(encoding="utf-8")
        for node in ast.walk(ast.parse(text)) if "Finding(" in text else ():
            if isinstance(node, ast.Call) and getattr(node.func, "id", "") == "Finding":
                found |= _names(node)
    return found


def _names(call: ast.Call) -> set[str]:
    first = call.args[0] if call.args else call.keywords[0].value
    if isinstance(first, ast.Constant):
        return {first.value}
    if isinstance(first, ast.JoinedStr):
        ending = first.values[-1].value
        return {f"{channel}{ending}" for channel in ("force", "displacement")}
    return set()


def test_every_finding_is_told() -> None:
    told = set()
    for row in re.findall(r"^\| (`.+?) \| ", text_of("quality"), flags=re.MULTILINE):
        told |= set(re.findall(r"`(\w+)`", row))
    found = _findings()
    assert len(found) > 40
    assert found - told == set()
    source = "".join(path.read_text(encoding="utf-8") for path in ROOT.glob("damperfit/**/*.py"))
    for name in told - found:
        assert f'"{name}"' in source, name


def test_every_format_of_logs_is_told() -> None:
    page = text_of("logs").lower()
    for one in FORMATS:
        assert one.name.lower().split()[0] in page, one.name


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


@pytest.mark.parametrize("page", EVERY)
def test_files_of_the_repository_exist(page) -> None:
    for name in re.findall(r"`((?:configs|sample_runs|tests)/[\w./]*)`", text_of(page)):
        assert (ROOT / name).exists(), name


def test_what_proves_a_figure_can_be_run() -> None:
    page = text_of("proof")
    for module, rest in re.findall(r"`python -m ([\w.]+)([^`]*)`", page):
        path = ROOT / module.replace(".", "/")
        path = path / "__main__.py" if path.is_dir() else path.with_suffix(".py")
        sources = path.read_text(encoding="utf-8")
        for option in re.findall(r"--[a-z-]+", rest):
            assert f'"{option}"' in sources, (module, option)
    for path in re.findall(r"`pytest (tests/\S+?)[` ]", page):
        assert (ROOT / path).exists(), path


def test_the_adjusters_move_valves_of_a_model_that_has_them(tmp_path) -> None:
    config = tmp_path / "adjusters.toml"
    config.write_text(_block("adjusters", "toml", 1), encoding="utf-8")
    follows = load_configuration(config).identification.follows
    assert follows["compression_bleed"] == ("low_speed",)
    assert follows["rebound_slope"] == ("high_speed",)


def test_the_other_model_is_what_its_keys_say(tmp_path) -> None:
    config = tmp_path / "valves.toml"
    config.write_text(_block("models", "toml", 0), encoding="utf-8")
    damper = load_configuration(config).damper
    assert (damper.name, damper.mounting.lag, damper.gas_volume) == ("through_flow", "fit", 2e-5)


def _block(page: str, kind: str, place: int) -> str:
    return re.findall(rf"```{kind}\n(.*?)```", text_of(page), flags=re.DOTALL)[place]


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


def test_titles_and_texts_for_the_terminal() -> None:
    for topic in TOPICS:
        page = read_page(topic)
        assert 0 < len(page.title) < 60
        assert "<!--" not in page.text
        assert ".md)" not in page.text
        assert not re.search(r"^!\[", page.text, flags=re.MULTILINE)
