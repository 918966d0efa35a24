"""Forces that the rig is in say so: what `export` writes is of the damper alone."""

import pytest

from damperfit.adjustment.force_at import Stage
from damperfit.damper.mounting import FIT, Mounting
from damperfit.damper.purdy.parameters import PURDY_DAMPER
from damperfit.damper.purdy.reference import reference_parameters
from damperfit.damper.rivals import Linear
from damperfit.damper.valve_dampers import ThroughFlow
from damperfit.queries.settings import notes_on_settings, notes_on_simulation
from damperfit.tested.setting import Setting

ALONE = (
    "in these forces; what damperfit settings shows and damperfit export writes is of the damper "
    "alone"
)


def mounted(offset=0.0, **parts):
    damper = ThroughFlow(mounting=Mounting(**parts))
    numbers = {one.name: one.plausible[0] for one in damper.quantities}
    return damper, damper.values(numbers | {"f_0": offset})


@pytest.mark.parametrize(
    ("parts", "offset", "said"),
    [
        ({}, 0.0, None),
        ({"lag": FIT}, 0.0, "the rig's lag of the force is"),
        ({"lag": 0.008}, 0.0, "the rig's lag of the force is"),
        ({"series_stiffness": FIT, "play": FIT}, 0.0, "the rig's series stiffness and play are"),
        ({}, 12.0, "the rig's force offset of 12 N is"),
        (
            {"series_stiffness": FIT, "lag": FIT},
            -3.4,
            "the rig's series stiffness, lag of the force and force offset of -3.4 N are",
        ),
    ],
)
def test_a_simulated_force_names_what_the_rig_adds(parts, offset, said) -> None:
    found = list(notes_on_simulation(*mounted(offset, **({"series_stiffness": "none"} | parts))))
    assert found == ([] if said is None else [f"{said} {ALONE}"])


def test_forces_by_setting_name_the_mounting_and_that_the_tare_is_left_out() -> None:
    damper, values = mounted(12.0, series_stiffness=FIT)
    tare, rig = notes_on_settings(damper, [Stage(Setting.of(1), values)])
    assert tare.startswith("the force offset (12 N) is the rig's tare")
    assert rig == "the rig's series stiffness is in measured forces, not in the model's"


def test_the_papers_damper_has_no_rig_in_it() -> None:
    values = reference_parameters(3)
    assert list(notes_on_simulation(PURDY_DAMPER, values)) == []
    assert list(notes_on_settings(PURDY_DAMPER, [Stage(Setting.of(3), values)])) == []


def test_an_offset_that_holds_the_gas_force_is_not_the_rigs_alone() -> None:
    model = Linear()
    assert list(notes_on_simulation(model, model.values({"c": 1e3, "f_0": -130.0}))) == []
