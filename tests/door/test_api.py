"""Every option of a command is a keyword of the function of the same name, and vice versa."""

from inspect import signature, unwrap

import pytest
import typer

import damperfit
from damperfit import api, keywords
from damperfit.cli.main import app
from damperfit.configuration.loading import load_configuration
from damperfit.keywords import PRESENTATION, keyword_of

COMMANDS = typer.main.get_command(app).commands
OF_MACHINE = {"config", "doctor", "help"}  # nothing of them is asked from Python
BOTH = sorted(set(COMMANDS) - OF_MACHINE)


@pytest.mark.parametrize("name", BOTH)
def test_options_are_keywords_and_keywords_are_options(name) -> None:
    options = {param.name for param in COMMANDS[name].params} - {*PRESENTATION}
    taken = set(signature(unwrap(getattr(damperfit, name))).parameters)
    taken = {one for one in taken if keyword_of(name, one) is not None}
    assert options == taken


def test_functions_without_a_command_read() -> None:
    assert set(api.__all__) - set(COMMANDS) == {"identify_each", "load", "read"}


def test_what_sets_a_key_sets_one_that_is_there() -> None:
    document = load_configuration().document
    for name, one in keywords._keywords().items():
        if one.key:
            section, _, key = one.key.partition(".")
            assert key in document[section], name


@pytest.mark.parametrize("name", BOTH)
def test_an_option_shows_what_its_keyword_is(name) -> None:
    for param in COMMANDS[name].params:
        if param.param_type_name == "option" and param.name != "help":
            assert param.help == keyword_of(name, param.name).help
