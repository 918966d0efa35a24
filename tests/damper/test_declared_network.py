"""Passages one by one: spelled out, a preset is itself; what is no passage is refused."""

import tomllib

import numpy as np
import pytest

from damperfit.configuration.loading import configuration_toml, load_configuration
from damperfit.damper.mounting import Mounting
from damperfit.damper.valve_dampers import (
    DeclaredNetwork,
    DeclaredPassage,
    Monotube,
    ThroughFlow,
    TwinTube,
    declared_passages,
)
from damperfit.errors import ConfigurationError
from damperfit.identification import FitOptions, identify
from damperfit.simulation import SolverOptions, simulate
from tests.damper.test_valve_dampers import HELD, VALVES, log, motion

P = DeclaredPassage
WAYS = {TwinTube: ((1, 2), (2, 3)), ThroughFlow: ((1, 3), (2, 3)), Monotube: ((1, 2), (2, 1))}
LAYOUTS = pytest.mark.parametrize("kind", WAYS)
ALL = Mounting("fit", "fit", "fit", "fit")


def both(kind, mounting=ALL):
    """A preset, and the same spelled out."""
    floats, passages = kind is Monotube, []
    for stroke, (start, end) in zip(("rebound", "compression"), WAYS[kind], strict=True):
        passages.append(P(start, end, stroke, "orifice", is_two_way=not floats))
        passages.append(P(start, end, stroke, "linear"))
        passages += [] if floats else [P(end, start, "return", "check")]
    shared = {"gas_pressure": 2.5e6 if floats else 5e5, "mounting": mounting}
    spelled = DeclaredNetwork(**shared, passages=tuple(passages), floating_piston=floats)
    return kind(**shared), spelled


@LAYOUTS
def test_a_preset_spelled_out_has_its_quantities_its_force_and_its_slopes(kind):
    preset, spelled = both(kind)
    assert spelled.quantities == preset.quantities
    values = preset.values({**VALVES, **HELD})
    wanted = preset.names
    one = simulate(values, preset, motion(), sensitivities=wanted)
    other = simulate(values, spelled, motion(), sensitivities=wanted)
    assert np.array_equal(one.force, other.force)
    for number in wanted:
        assert np.array_equal(one.sensitivities[number], other.sensitivities[number])
    assert spelled.pressed_areas == preset.pressed_areas
    assert spelled.rest_force(0.01) == preset.rest_force(0.01)


def test_a_fit_of_it_starts_and_ends_as_that_of_the_preset():
    preset, spelled = both(TwinTube, Mounting())
    made = log(preset, preset.values({**VALVES, "k_s": 4e5}))
    held = {one.name: one.default for one in preset.quantities if one.default is not None}
    for one, other in zip(spelled.start([made], held), preset.start([made], held), strict=True):
        assert one.numbers == pytest.approx(other.numbers, rel=1e-9)
    (fit,) = identify(
        [made], spelled, FitOptions("plain", solver=SolverOptions(tolerance=1e-2))
    ).fits
    for number, true in VALVES.items():
        assert getattr(fit.parameters, number) == pytest.approx(true, rel=0.03, abs=0.3)


def test_a_damper_that_is_no_preset_is_fitted():
    """A piston valve with two stacks in rebound, a leak about it, and a base valve with a port."""
    passages = (
        P(1, 2, "piston", "orifice", is_two_way=True), P(1, 2, "low", "linear"),
        P(2, 1, "intake", "check"), P(1, 2, "ring", "leak", is_two_way=True),
        P(2, 3, "base", "orifice", is_two_way=True), P(2, 3, "base", "port"),
        P(3, 2, "foot", "check"),
    )  # fmt: skip
    model = DeclaredNetwork(gas_pressure=5e5, passages=passages)
    truth = model.values(
        piston_bleed=9e4, low_opening=4e5, low_slope=6e6, intake_slope=3e5, ring_leak=3e7,
        base_bleed=6e4, base_opening=9e5, base_slope=9e6, base_port=4e4, foot_slope=2e5,
        k_s=4e5, f_f=15.0, f_0=0.0,
    )  # fmt: skip
    made = log(model, truth)
    (start, *_) = model.start([made], {})
    assert np.isfinite(simulate(start, model, motion(cycles=1)).force).all()
    (fit,) = identify([made], model, FitOptions("plain", solver=SolverOptions(tolerance=1e-2))).fits
    assert fit.mse_percent < 0.01
    assert "1 to 2 and back piston (orifice), 1 to 2 low (linear)" in model.sentence
    assert model.valve_characteristics(truth, [made]) == ()


PASSAGES = [
    {"from": 1, "to": 3, "name": "needle", "law": "long", "two_way": True},
    {"from": 3, "to": 1, "name": "foot", "law": "check", "two_way": False},
    {"from": 2, "to": 3, "name": "base", "law": "rounded", "two_way": False},
    {"from": 3, "to": 2, "name": "foot", "law": "check", "two_way": False},
]


def test_toml_declares_it_and_config_prints_it_back(tmp_path):
    own = {"model": "network", "gas_pressure": "5bara", "passages": PASSAGES}
    made = load_configuration(overlay={"damper": own | {"mounting": {"series_stiffness": "none"}}})
    assert made.damper.names[:6] == (
        "needle_leak", "needle_bleed", "foot_slope", "base_opening", "base_slope", "base_width",
    )  # fmt: skip
    assert made.damper.passages[0] == P(1, 3, "needle", "long", is_two_way=True)
    again = tmp_path / "again.toml"
    again.write_text(configuration_toml(made))
    assert load_configuration(again).damper == made.damper
    assert tomllib.loads(again.read_text())["damper"]["passages"] == PASSAGES
    plain = load_configuration(overlay={"damper": {"model": "network"}})
    assert "rebound" not in plain.document["damper"]


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"from": 4}, r"passage 2: from = 4; expected chamber 1 \(rod side\)"),
        ({"to": True}, "passage 2: to = True; expected chamber"),
        ({"to": 1}, "passage 2: leads from chamber 1 to itself"),
        ({"law": "orifise"}, "passage 2: no law 'orifise'; .* Did you mean 'orifice'"),
        ({"name": "Base valve"}, "passage 2: name = 'Base valve'; expected small letters"),
        ({"two_way": 1}, "passage 2: two_way = 1; expected true or false"),
        ({"twoway": True}, "passage 2: no key 'twoway'; .* Did you mean 'two_way'"),
    ],
)
def test_what_is_no_passage_is_refused_with_its_place(changed, said):
    good = {"from": 1, "to": 2, "name": "one", "law": "orifice"}
    with pytest.raises(ConfigurationError, match=said):
        declared_passages([good, good | changed])
    with pytest.raises(ConfigurationError, match="passage 1: lacks to, law"):
        declared_passages([{"from": 1, "name": "one"}])


def test_a_layout_that_cannot_be_is_refused():
    with pytest.raises(ConfigurationError, match="passage 2 joins 2 and 3, which are one behind"):
        DeclaredNetwork(passages=(P(1, 2, "a", "leak"), P(2, 3, "b", "leak")), floating_piston=True)
    with pytest.raises(ConfigurationError, match="none leads to or from chamber 1"):
        DeclaredNetwork(passages=(P(2, 3, "a", "leak"),))
    many = tuple(P(1, 2, "a", "leak") for _ in range(17))
    with pytest.raises(ConfigurationError, match="17 passages"):
        DeclaredNetwork(passages=many)
