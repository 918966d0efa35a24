"""What is told to be open of a damper whose layout, dimensions or gas nobody has declared."""

from dataclasses import replace

import pytest

from damperfit.configuration.loading import load_configuration
from damperfit.damper.mounting import FIT, NONE, Mounting
from damperfit.damper.purdy.parameters import PURDY_DAMPER
from damperfit.damper.valve_dampers import Monotube, ThroughFlow, TwinTube
from damperfit.laws.law_fit import LawSearch, Tried
from damperfit.run.auto_model import is_monotube_open, open_dimensions, open_layout
from tests.laws.test_undecided import fit

PAPER = replace(fit(), model=PURDY_DAMPER)
ENOUGH = "the paper's model is enough for these logs, but a damper"


def declared(folder, text: str):
    path = folder / "damper.toml"
    path.write_text(f"[damper]\n{text}\n")
    return load_configuration(path, is_law_open=True)


@pytest.mark.parametrize(
    ("text", "model", "alike", "layout", "is_open"),
    [
        *(("", model(), (), None, True) for model in (ThroughFlow, TwinTube)),
        *(("", model, (), None, False) for model in (Monotube(), PURDY_DAMPER)),
        ('gas_pressure = "8bara"', ThroughFlow(), (), None, False),
        ('model = "through_flow"', ThroughFlow(), (), None, False),
        ("", ThroughFlow(), (), "through_flow", False),
        ("", ThroughFlow(), ("monotube",), None, False),
    ],
)
def test_a_monotube_is_open_where_only_an_assumed_gas_excludes_it(
    tmp_path, text, model, alike, layout, is_open
) -> None:
    searched = LawSearch((), Tried("law", (replace(fit(), model=model),)), 60.0, alike)
    assert is_monotube_open(declared(tmp_path, text), searched, layout) is is_open


@pytest.mark.parametrize(
    ("text", "one", "layout", "is_open", "says"),
    [
        ("", replace(fit(), model=ThroughFlow()), None, True,
         "The layout, through flow or monotube: the gas pressure is not declared"),
        ("", replace(fit(), model=ThroughFlow()), None, False, ""),
        # A laminar monotube was told as "the paper's model" without a word on layouts.
        ("", PAPER, None, False, f"The layout: {ENOUGH}"),
        ("", PAPER, "monotube", False, "The valves of the monotube: the paper's model is enough"),
        ('model = "purdy"', PAPER, None, False, ""),
    ],
)  # fmt: skip
def test_a_layout_that_nothing_decides_is_told(tmp_path, text, one, layout, is_open, says) -> None:
    told = open_layout(declared(tmp_path, text), one, layout, is_open=is_open)
    assert [line.startswith(says) for line in told] == [True] * bool(says)


@pytest.mark.parametrize(
    ("text", "open_ones"),
    [
        ("", "the rod, the bore and the gas pressure are"),
        ('rod_diameter = "12mm"\npiston_diameter = "30mm"', "the gas pressure is"),
    ],
)
def test_dimensions_that_are_open_are_listed_as_one_writes_them(tmp_path, text, open_ones) -> None:
    one = replace(fit(), model=TwinTube(mounting=Mounting(FIT, NONE, FIT)))
    (said,) = open_dimensions(declared(tmp_path, text), one)
    assert said.startswith("Whether elasticity and the lag of the force are the rig's: the")
    assert f"{open_ones} not declared" in said
