"""What is told to be open of a damper whose layout, dimensions or gas nobody has declared."""

from dataclasses import replace
from pathlib import Path

import pytest

from damperfit.configuration.loading import load_configuration
from damperfit.configuration.options import Configuration
from damperfit.damper.model import Model
from damperfit.damper.mounting import FIT, NONE, Mounting
from damperfit.damper.purdy.parameters import PURDY_DAMPER
from damperfit.damper.valve_dampers import Monotube, ThroughFlow, TwinTube
from damperfit.laws.law_fit import LawSearch, Tried
from damperfit.run.auto_model import is_monotube_open, open_dimensions, open_layout
from tests.laws.test_undecided import fit

ELASTIC = Mounting(FIT, NONE, FIT)


@pytest.fixture
def declared(tmp_path: Path):
    def load(*lines: str) -> Configuration:
        path = tmp_path / "damper.toml"
        path.write_text("\n".join(["[damper]", *lines]))
        return load_configuration(path, is_law_open=True)

    return load


def searched(model: Model, *alike: str) -> LawSearch:
    return LawSearch((), Tried("law", (replace(fit(), model=model),)), 60.0, alike)


GAS = 'gas_pressure = "8bara"'
MODEL = 'model = "through_flow"'


@pytest.mark.parametrize(
    ("lines", "model", "alike", "layout", "is_open"),
    [
        ((), ThroughFlow(), (), None, True),
        ((), TwinTube(), (), None, True),
        ((GAS,), ThroughFlow(), (), None, False),
        ((MODEL,), ThroughFlow(), (), None, False),
        ((), ThroughFlow(), (), "through_flow", False),
        ((), ThroughFlow(), ("monotube",), None, False),
        ((), Monotube(), (), None, False),
        ((), PURDY_DAMPER, (), None, False),
    ],
)
def test_a_monotube_is_open_where_only_an_assumed_gas_excludes_it(
    declared, lines, model, alike, layout, is_open
) -> None:
    assert is_monotube_open(declared(*lines), searched(model, *alike), layout) is is_open


def test_a_layout_that_an_assumed_gas_decides_is_told() -> None:
    one = replace(fit(), model=ThroughFlow())
    (said,) = open_layout(load_configuration(), one, None, is_open=True)
    assert said.startswith("The layout, through flow or monotube: the gas pressure is not declared")
    assert "a monotube with more than the 5 bar that were taken may fit as well" in said
    assert open_layout(load_configuration(), one, None, is_open=False) == ()


def test_the_papers_model_says_nothing_of_the_layout(declared) -> None:
    """A laminar monotube was told as "the paper's model" without a word on layouts."""
    one = replace(fit(), model=PURDY_DAMPER)
    (said,) = open_layout(load_configuration(), one, None, is_open=False)
    assert said.startswith("The layout: the paper's model is enough for these logs, but a damper")
    (said,) = open_layout(load_configuration(), one, "monotube", is_open=False)
    assert said.startswith("The valves of the monotube: the paper's model is enough")
    assert 'damper.model = "monotube" keeps them.' in said
    assert open_layout(declared('model = "purdy"'), one, None, is_open=False) == ()


def test_several_dimensions_are_listed_as_one_writes_them(declared) -> None:
    model = TwinTube(mounting=ELASTIC)
    one = replace(fit(), model=model)
    (said,) = open_dimensions(declared(), one)
    assert said.startswith(
        "Whether elasticity and the lag of the force are the rig's: the rod, the"
    )
    assert "the rod, the bore and the gas pressure are not declared" in said
    (said,) = open_dimensions(declared('rod_diameter = "12mm"', 'piston_diameter = "30mm"'), one)
    assert "the gas pressure is not declared" in said
