"""What is told to be open of a damper whose layout, dimensions or gas nobody has declared."""

from dataclasses import replace

import pytest

from damperfit.configuration.loading import load_configuration
from damperfit.damper.purdy.parameters import PURDY_DAMPER
from damperfit.damper.valve_dampers import Monotube, ThroughFlow, TwinTube
from damperfit.laws.law_fit import Candidate, LawSearch
from damperfit.run.auto_model import is_monotube_open
from tests.laws.test_undecided import fit


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
    searched = LawSearch((), Candidate("law", (replace(fit(), model=model),)), 60.0, alike)
    assert is_monotube_open(declared(tmp_path, text), searched, layout) is is_open
