"""Laws next to a law, and their names."""

from __future__ import annotations

import pytest

from damperfit.damper.network import Valve
from damperfit.damper.valve_dampers import TwinTube
from damperfit.laws import in_words
from damperfit.laws.variants import BLEED, BOTH, ONE_STROKE, of_kind


@pytest.mark.parametrize(("change", "names", "words"), [
    ("the blow-off in rebound", {"rebound_opening", "rebound_slope"},
     "bleed in rebound, bleed and blow-off in bump"),
    ("the blow-off in bump", {"compression_opening", "compression_slope"},
     "bleed and blow-off in rebound, bleed in bump"),
    ("the bleed in rebound", {"rebound_bleed"}, "blow-off in rebound, bleed and blow-off in bump"),
    ("the bleed in bump", {"compression_bleed"}, "bleed and blow-off in rebound, blow-off in bump"),
])  # fmt: skip
def test_one_part_of_one_stroke_is_taken_out(change: str, names: set[str], words: str) -> None:
    asked, smaller = ONE_STROKE[change]
    damper = TwinTube(rebound=BOTH, compression=BOTH)
    less = smaller(damper)
    assert less is not None
    assert set(asked) & {*damper.names} == names == set(damper.names) - set(less.names)
    assert in_words(less) == f"twin tube: {words}; elastic mounting"
    assert smaller(less) is None  # a valve keeps a way for the oil


@pytest.mark.parametrize("stroke", ["rebound", "bump"])
def test_a_laminar_bleed_that_no_log_tells_is_asked_for(stroke: str) -> None:
    damper = TwinTube(rebound=Valve("leak", "rounded"), compression=Valve("leak", "rounded"))
    asked, smaller = ONE_STROKE[f"the bleed in {stroke}"]
    less = smaller(damper)
    assert less is not None
    assert {*damper.names} - {*less.names} == {*asked} & {*damper.names}


def test_a_kind_takes_the_place_of_the_usual_one_alone() -> None:
    damper = TwinTube(rebound=BOTH, compression=BLEED)
    assert of_kind(damper, "blow_off", "linear", "port").rebound == Valve("orifice", "port")
    assert of_kind(damper, "blow_off", "linear", "port").compression == BLEED
    assert of_kind(damper, "bleed", "leak", "long") == damper
