"""Every model by its name: the paper's damper, dampers of real valves, models of the literature."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from importlib import import_module
from typing import TYPE_CHECKING

from damperfit.errors import ConfigurationError, did_you_mean
from damperfit.problem import Option

if TYPE_CHECKING:
    from damperfit.damper.model import Model

__all__ = ["MODELS", "model_named"]

# Most commands need one of them: a model is loaded when it is asked for.
_WHERE = {
    "purdy": ("purdy.parameters", "Damper"),
    "twin_tube": ("valve_dampers", "TwinTube"),
    "monotube": ("valve_dampers", "Monotube"),
    "through_flow": ("valve_dampers", "ThroughFlow"),
    "network": ("declared_network", "DeclaredNetwork"),
    "linear": ("rivals.linear", "Linear"),
    "bilinear": ("rivals.linear", "Bilinear"),
    "polynomial_v": ("rivals.polynomials", "PolynomialInSpeed"),
    "polynomial_xv": ("rivals.polynomials", "PolynomialInStrokeAndSpeed"),
    "restoring_force_surface": ("rivals.polynomials", "RestoringForceSurface"),
    "degressive": ("rivals.curves", "Degressive"),
    "four_slopes": ("rivals.curves", "FourSlopes"),
    "karadayi_masada": ("rivals.elastic_dashpot", "KaradayiMasada"),
    "hagedorn_wallaschek": ("rivals.elastic_dashpot", "HagedornWallaschek"),
    "surace_worden_tomlinson": ("rivals.elastic_dashpot", "SuraceWordenTomlinson"),
    "besinger_cebon_cole": ("rivals.elastic_dashpot", "BesingerCebonCole"),
    "bouc_wen": ("rivals.bouc_wen", "BoucWen"),
    "biviscous": ("rivals.biviscous", "Biviscous"),
    "kwok": ("rivals.kwok", "Kwok"),
}


class _Models(Mapping[str, "type[Model]"]):
    def __getitem__(self, name: str) -> type[Model]:
        module, kind = _WHERE[name]
        found: type[Model] = getattr(import_module(f"damperfit.damper.{module}"), kind)
        return found

    def __contains__(self, name: object) -> bool:
        return name in _WHERE

    def __iter__(self) -> Iterator[str]:
        return iter(_WHERE)

    def __len__(self) -> int:
        return len(_WHERE)


MODELS: Mapping[str, type[Model]] = _Models()


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
                "model auto: only {choosing} of damperfit identify, and damperfit models, let the "
                "logs choose; give the model that they name here",
                choosing=Option("model", "auto"),
            )
        there = f" There are {', '.join(MODELS)}."
        near = did_you_mean(name, (*MODELS, "auto"))  # what `identify` takes beside them
        raise ConfigurationError(f"no model {name!r}.{near or there}")
    return MODELS[name]
