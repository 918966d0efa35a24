"""The JSON schema of the configuration takes what the program takes, and refuses unknown keys."""

import json
import re
import tomllib
from pathlib import Path

import pytest

from damperfit.cli import main
from damperfit.configuration.loading import configuration_toml, load_configuration
from damperfit.configuration.options import configuration_schema

pytestmark = pytest.mark.extras
ROOT = Path(__file__).parents[2]
PAGES = sorted((ROOT / "damperfit" / "manual" / "pages").glob("*.md"))
SHOWN = [
    block
    for page in PAGES
    for block in re.findall(
        r"^```toml\n(.*?)^```$", page.read_text("utf-8"), re.DOTALL | re.MULTILINE
    )
    if "[car]" not in block
]
FILES = [path.read_text("utf-8") for path in sorted((ROOT / "configs").glob("*.toml"))]


@pytest.fixture(scope="module")
def validator():
    jsonschema = pytest.importorskip("jsonschema")
    jsonschema.Draft202012Validator.check_schema(configuration_schema())
    return jsonschema.Draft202012Validator(configuration_schema())


@pytest.mark.parametrize("text", [*SHOWN, *FILES])
def test_files_are_valid(validator, text) -> None:
    assert [error.message for error in validator.iter_errors(tomllib.loads(text))] == []


@pytest.mark.parametrize("model", ["purdy", "twin_tube", "network", "bouc_wen"])
def test_what_config_prints_is_valid(validator, tmp_path, model) -> None:
    path = tmp_path / "own.toml"
    path.write_text(f'[damper]\nmodel = "{model}"\n', encoding="utf-8")
    document = tomllib.loads(configuration_toml(load_configuration(path)))
    assert [error.message for error in validator.iter_errors(document)] == []


@pytest.mark.parametrize(
    "text",
    [
        "[damper]\nrod = 1",
        "[riig]",
        "[simulation]\nwave = 'square'",
        "[identification]\nstarts = 0",
        "[damper]\nmodel = 'purdi'",
    ],
)
def test_mistakes_are_not(validator, text) -> None:
    assert list(validator.iter_errors(tomllib.loads(text)))


def test_the_command_prints_it(capsys) -> None:
    assert main(["config", "--schema"]) == 0
    assert json.loads(capsys.readouterr().out) == configuration_schema()
