"""What a model of a damper is: its quantities, their values, and what it can be asked.

A `Model` is one damper as far as it is declared (geometry, oil, gas, layout of its valves): the
second argument, ``damper``, of everything that simulates, fits or judges. What a fit may find are
its `Quantity` list; one set of numbers for them are its `Values`, in the list's order. Nothing
outside a model's own files names a quantity: what is done with one follows from its scope, its
range and whether it is taken by its logarithm.

A new model is a frozen dataclass whose fields are the keys of ``[damper]`` in TOML. It has to say
`quantities`, `simulate` and `start`; what else it cannot say it leaves as it is here, and what
would have asked says "not evaluated".
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, fields, make_dataclass, replace
from functools import lru_cache
from types import MappingProxyType
from typing import TYPE_CHECKING, ClassVar

from damperfit.errors import ConfigurationError, did_you_mean

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from typing import Self

    import numpy as np
    from numpy.typing import ArrayLike, NDArray

    from damperfit.recording import Trace
    from damperfit.simulation import Motion, Response, SolverOptions

    FloatArray = NDArray[np.float64]

__all__ = ["DAMPER", "LOG", "RIG", "SETTING", "Key", "Model", "Quantity", "Values", "values_type"]

# Whose a quantity is. Any other word is the name of an adjuster: one value for each of its clicks.
SETTING = "setting"  # each setting's own
DAMPER = "damper"  # one for all settings
LOG = "log"  # each log's own: tare, skew, gas pressure
RIG = "rig"  # one for all logs of the rig


@dataclass(frozen=True, slots=True)
class Quantity:
    """A number of a model that a fit may find.

    Attributes
    ----------
    name : str
        As in tables, options and `Values`: lower case, ``rebound_opening``.
    symbol : str
        As people write it: ``R_m1``.
    label : str
        In a few words, for a table's row: "valve 1 (adjuster)".
    meaning : str
        In one phrase, for the metadata of tables.
    unit : str
        SI, as in "N s/(m2 kg)".
    plausible : tuple of float
        A fit stays within; a factor of a hundred beyond what dampers have.
    is_logarithmic : bool
        Positive, and fitted by its logarithm; otherwise of either sign, in steps of `size`.
    size : float
        Of a quantity that is not logarithmic: about as much as it is in a damper, in `unit`.
    scope : str
        `SETTING`, `DAMPER`, `LOG`, `RIG`, or an adjuster's name.
    default : float or None
        Where it is held unless it is freed; None: it is free unless it is held.
    fallback : float or None
        What is known of it where no log tells it.
    power, shown_unit : int, str
        People read it in 10^power of the unit, which they write like this.
    """

    name: str
    symbol: str
    label: str
    meaning: str
    unit: str
    plausible: tuple[float, float]
    is_logarithmic: bool = True
    size: float = 1.0
    scope: str = SETTING
    default: float | None = None
    fallback: float | None = None
    power: int = 0
    shown_unit: str = ""

    @property
    def is_shared(self) -> bool:
        """Whether all settings have it in common."""
        return self.scope in {DAMPER, RIG}


@dataclass(frozen=True, slots=True)
class Values:
    """Numbers for the quantities of a model, SI, in its order; an attribute for each.

    The types made by `values_type` are frozen dataclasses: equal where all numbers are, and what
    works on dataclasses works on them.
    """

    if TYPE_CHECKING:

        def __getattr__(self, name: str) -> float: ...

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the quantities, in the model's order."""
        return tuple(one.name for one in fields(self))

    @property
    def numbers(self) -> tuple[float, ...]:
        """The numbers, in the same order."""
        return tuple(getattr(self, one.name) for one in fields(self))

    def replace(self, changes: Mapping[str, float] = MappingProxyType({}), **more: float) -> Self:
        """Return the same with some numbers changed.

        Raises
        ------
        ConfigurationError
            A name is none of the model's.
        """
        changes = {**changes, **more}
        for name in changes:
            if name not in self.names:
                raise ConfigurationError(_no_quantity(name, self.names))
        return replace(self, **changes)

    def __reduce__(self) -> tuple[object, ...]:
        """Types that are made for a model cannot be found by name when they are sent elsewhere."""
        if type(self) is values_type(self.names):
            return _rebuilt, (self.names, self.numbers)
        return type(self), self.numbers


@lru_cache(maxsize=256)
def values_type(names: tuple[str, ...]) -> type[Values]:
    """Return the type of `Values` that has these names in this order.

    Examples
    --------
    >>> one = values_type(("c", "f_f"))(1.5e3, 20.0)
    >>> one, one.replace(f_f=30.0).f_f
    (Values(c=1500.0, f_f=20.0), 30.0)
    """
    made: type[Values] = make_dataclass(
        "Values",
        [(name, float) for name in names],
        bases=(Values,),
        frozen=True,
        slots=True,
        namespace={"__reduce__": Values.__reduce__},
    )
    return made


def _rebuilt(names: tuple[str, ...], numbers: tuple[float, ...]) -> Values:
    return values_type(names)(*numbers)


@dataclass(frozen=True, slots=True)
class Key:
    """What a key of ``[damper]`` may be; stands under "key" in the metadata of a model's field.

    Attributes
    ----------
    dimension : str
        As `damperfit.quantities` has it; empty: a bare number or a word.
    plausible : tuple of float
        What lies outside was misread: mm as m, bar as Pa.
    unit : str
        SI, for messages.
    words : tuple of str
        What it may be, where it is no number.
    """

    dimension: str = ""
    plausible: tuple[float, float] = (float("-inf"), float("inf"))
    unit: str = ""
    words: tuple[str, ...] = ()

    @property
    def metadata(self) -> dict[str, Key]:
        """For `dataclasses.field`."""
        return {"key": self}


class Model(ABC):
    """One damper, as far as it is declared, and the law that it is taken to follow."""

    __slots__ = ()

    name: ClassVar[str]
    """As in `MODELS`, TOML and `--model`."""
    title: ClassVar[str]
    """In a few words, for people."""
    procedures: ClassVar[tuple[str, ...]] = ("plain", "joint")
    """Names of the procedures of a fit that it can be fitted by; the first is its own."""
    conditions: ClassVar[tuple[str, ...]] = ()
    """What is declared, not fitted, and the force can be differentiated by all the same."""

    @property
    @abstractmethod
    def quantities(self) -> tuple[Quantity, ...]:
        """What a fit may find, in the order of tables and of `Values`."""

    @abstractmethod
    def simulate(
        self,
        values: Values,
        motion: Motion,
        *,
        sensitivities: Sequence[str],
        options: SolverOptions,
    ) -> Response:
        """Return force, pressures and sensitivities at the samples of a motion.

        Parameters
        ----------
        values : Values
            Of this model.
        motion : Motion
            Uniform samples of displacement and velocity.
        sensitivities : sequence of str
            Quantities and conditions to differentiate the force by.
        options : SolverOptions
            How exactly to integrate.

        Raises
        ------
        SimulationError
            It cannot be integrated, or the force not differentiated by what was asked.
        """

    @abstractmethod
    def start(self, traces: Sequence[Trace], fixed: Mapping[str, float]) -> tuple[Values, ...]:
        """Return where a fit of one setting's logs may start, at least one point.

        Of several the one whose simulation fits the first log best is taken. What is fixed has its
        value in all of them.
        """

    @property
    def travel(self) -> float:
        """Displacement from rest that the damper does not reach, m."""
        return float("inf")

    def rest_force(self, displacement: ArrayLike) -> FloatArray | None:  # noqa: ARG002
        """Return the force at no speed without friction and offset, N; None: it does not say."""
        return None

    def values(self, known: Mapping[str, float] = MappingProxyType({}), **more: float) -> Values:
        """Return values of all quantities; what is not named has its default.

        Raises
        ------
        ConfigurationError
            A name is unknown, or one without a default is missing.
        """
        known = {**known, **more}
        for name in known:
            self.quantity(name)
        complete = {one.name: known.get(one.name, one.default) for one in self.quantities}
        missing = [name for name, value in complete.items() if value is None]
        if missing:
            raise ConfigurationError(f"{self.name} needs a value of {', '.join(missing)}")
        return self.values_type(**complete)

    @property
    def values_type(self) -> type[Values]:
        """The type of its values."""
        return values_type(self.names)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the quantities, in their order."""
        return tuple(one.name for one in self.quantities)

    def quantity(self, name: str) -> Quantity:
        """Return a quantity by its name.

        Raises
        ------
        ConfigurationError
            There is none of that name.
        """
        for one in self.quantities:
            if one.name == name:
                return one
        raise ConfigurationError(_no_quantity(name, self.names))


def _no_quantity(name: str, known: Sequence[str]) -> str:
    return f"no parameter {name!r}; there are {', '.join(known)}.{did_you_mean(name, known)}"
