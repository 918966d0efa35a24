"""Every model by its name: the paper's damper, dampers of real valves, models of the literature."""

from __future__ import annotations

from typing import TYPE_CHECKING

from damperfit.damper.declared_network import DeclaredNetwork
from damperfit.damper.purdy.parameters import Damper
from damperfit.damper.rivals import RIVALS
from damperfit.damper.valve_dampers import Monotube, ThroughFlow, TwinTube
from damperfit.errors import ConfigurationError, did_you_mean

if TYPE_CHECKING:
    from damperfit.damper.model import Model

__all__ = ["MODELS", "model_named"]

_ALL: tuple[type[Model], ...] = (Damper, TwinTube, Monotube, ThroughFlow, DeclaredNetwork, *RIVALS)
MODELS: dict[str, type[Model]] = {one.name: one for one in _ALL}


def model_named(name: str) -> type[Model]:
    """Return the model of a name; a damper is an object of it.

    Raises
    ------
    ConfigurationError
        There is none of that name.

    Examples
    --------
    >>> model_named("purdy")().names
    ('r_m1', 'r_m2', 'r_m3', 'k_e', 'f_f', 'f_0')
    """
    if name not in MODELS:
        if name == "auto":
            raise ConfigurationError(
                "model auto: only damperfit identify --model auto and damperfit models let the "
                "logs choose; give the model that they name here"
            )
        there = f" There are {', '.join(MODELS)}."
        near = did_you_mean(name, (*MODELS, "auto"))  # what `identify` takes beside them
        raise ConfigurationError(f"no model {name!r}.{near or there}")
    return MODELS[name]
