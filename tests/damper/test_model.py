"""Quantities and values of a model: order, changes, copies, refusals."""

from __future__ import annotations

import copy
import dataclasses
import pickle
import time
from concurrent.futures import ThreadPoolExecutor
from threading import Barrier
from typing import Any

import pytest

from damperfit.damper.model import Values, values_type
from damperfit.damper.network import Network
from damperfit.damper.purdy.parameters import PURDY_DAMPER, Parameters
from damperfit.damper.purdy.reference import reference_parameters
from damperfit.damper.quantity import Quantity
from damperfit.errors import ConfigurationError
from damperfit.simulation import simulate, sine_motion

QUANTITIES = (
    Quantity("c", "c", "damping", "viscous damping", "N s/m", (1.0, 1e6)),
    Quantity("f_f", "f_f", "friction", "Coulomb friction", "N", (1e-3, 1e4)),
)
MADE = values_type(QUANTITIES)(1.5e3, 20.0)


@pytest.mark.parametrize("values", [MADE, reference_parameters(3)], ids=["made", "paper"])
def test_names_are_made_once_for_all_values(values: Values) -> None:
    """A fit asks for them at every step."""
    other = values.replace({"f_f": 3.0})
    assert other.names is values.names
    assert [values.quantity(name) for name in values.names] == list(values.quantities)
    assert other.quantity("f_f") is values.quantity("f_f")


def test_a_simulation_lists_no_names_of_its_network(monkeypatch: pytest.MonkeyPatch) -> None:
    motion = sine_motion(0.032, 1.5, cycles=1, sample_rate=100.0)
    first = simulate(reference_parameters(3), PURDY_DAMPER, motion)  # loads the integrator
    monkeypatch.setattr(Network, "numbers", property(lambda _: pytest.fail("asked again")))
    again = simulate(reference_parameters(3), PURDY_DAMPER, motion)
    assert again.force.tolist() == first.force.tolist()


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


def _quantities(name: str) -> tuple[Quantity, ...]:
    return (Quantity(name, name, "damping", "viscous damping", "N s/m", (1.0, 1e6)),)


def test_values_are_sent_however_many_models_came_after_theirs() -> None:
    first = values_type(_quantities("c_first"))(1.0)
    for k in range(300):  # more than are kept
        values_type(_quantities(f"c_{k}"))
    sent = pickle.loads(pickle.dumps(first))  # noqa: S301 - our own bytes
    assert sent == first == values_type(_quantities("c_first"))(1.0)


def test_values_have_one_type_whichever_thread_asks_for_it_first(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def slowly(*args: Any, **options: Any) -> type:
        time.sleep(0.02)
        return dataclasses.make_dataclass(*args, **options)

    monkeypatch.setattr("damperfit.damper.model.make_dataclass", slowly)
    gate = Barrier(4)

    def made(_: int) -> Values:
        gate.wait()
        return values_type(_quantities("c_of_threads"))(1.0)

    with ThreadPoolExecutor(4) as pool:
        found = list(pool.map(made, range(4)))
    assert len({type(one) for one in found}) == 1
    for one in found:
        assert pickle.loads(pickle.dumps(one)) == found[0]  # noqa: S301 - our own bytes


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
