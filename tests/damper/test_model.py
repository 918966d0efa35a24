"""Quantities and values of a model: order, changes, copies, refusals."""

from __future__ import annotations

import copy
import dataclasses
import pickle

import pytest

from damperfit.damper.model import Values, values_type
from damperfit.damper.purdy.parameters import PURDY_DAMPER, Parameters
from damperfit.damper.purdy.reference import reference_parameters
from damperfit.damper.quantity import Quantity
from damperfit.errors import ConfigurationError

QUANTITIES = (
    Quantity("c", "c", "damping", "viscous damping", "N s/m", (1.0, 1e6)),
    Quantity("f_f", "f_f", "friction", "Coulomb friction", "N", (1e-3, 1e4)),
)
MADE = values_type(QUANTITIES)(1.5e3, 20.0)


@pytest.mark.parametrize("values", [MADE, reference_parameters(3)], ids=["made", "paper"])
def test_values_are_frozen_ordered_and_survive_the_way_to_another_process(values: Values) -> None:
    assert values.numbers == tuple(getattr(values, name) for name in values.names)
    sent = pickle.loads(pickle.dumps(values))  # noqa: S301 - our own bytes
    assert sent == values == copy.deepcopy(values)
    assert type(sent) is type(values)
    with pytest.raises(dataclasses.FrozenInstanceError):
        values.f_f = 3.0  # type: ignore[misc]
    changed = values.replace({"f_f": 3.0})
    assert (changed.f_f, values.f_f != 3.0) == (3.0, True)
    assert changed.replace(f_f=values.f_f) == values
    assert dataclasses.asdict(values) == dict(zip(values.names, values.numbers, strict=True))


def test_a_name_that_is_none_of_the_models_is_refused_with_the_nearest() -> None:
    with pytest.raises(ConfigurationError, match=r"no parameter 'f_g'; there are c, f_f\..*'f_f'"):
        MADE.replace(f_g=1.0)
    with pytest.raises(ConfigurationError, match=r"no parameter 'r_m4'"):
        PURDY_DAMPER.values(r_m4=1.0)


def test_values_of_a_model_take_the_defaults_and_miss_what_has_none() -> None:
    known = dict(zip(["r_m1", "r_m2", "r_m3", "k_e", "f_f"], range(1, 6), strict=True))
    assert PURDY_DAMPER.values(known) == Parameters(1, 2, 3, 4, 5, 0.0)
    del known["k_e"]
    with pytest.raises(ConfigurationError, match="purdy needs a value of k_e"):
        PURDY_DAMPER.values(known)
