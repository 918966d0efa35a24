"""What a model of a damper is: its quantities, their values, and what it can be asked.

A `Model` is one damper as far as it is declared (geometry, oil, gas, layout of its valves): the
second argument, ``damper``, of everything that simulates, fits or judges. What a fit may find are
its `Quantity` list; one set of numbers for them are its `Values`, in the list's order. Nothing
outside a model's own files names a quantity: what is done with one follows from its scope, its
range and whether it is taken by its logarithm.

A new model is a frozen dataclass whose fields are the keys of ``[damper]`` in TOML, with a line in
`_WHERE`. It has to say `quantities`, `simulate` and `start`; what else it cannot say it leaves as
it is here, and what would have asked says "not evaluated".
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, make_dataclass, replace
from functools import lru_cache
from importlib import import_module
from threading import Lock
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple, Self, cast
from weakref import WeakValueDictionary

from damperfit.errors import ConfigurationError, did_you_mean

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from damperfit.arrays import FloatArray
    from damperfit.damper.cylinder import Cavitation
    from damperfit.damper.valve_dampers import ValveCharacteristic
    from damperfit.recording import Trace
    from damperfit.simulation import Motion, Response, SolverOptions

    Names = Sequence[str]
    Ranges = Mapping[str, tuple[float, float, str]]

# Whose a quantity is. Any other word is the name of an adjuster: one value for each of its clicks.
SETTING = "setting"  # each setting's own
DAMPER = "damper"  # one for all settings
LOG = "log"  # each log's own: tare, skew, gas pressure
RIG = "rig"  # one for all logs of the rig

# The part that a quantity plays, where somebody must know it.
OFFSET = "offset"  # a force of either sign that is added: a tare
FRICTION = "friction"  # a force that turns with the sign of the velocity
STIFFNESS = "stiffness"  # of the oil with its chambers
GAS_AMOUNT = "gas"  # how much gas there is
VISCOUS = "viscous"  # a resistance or damping that goes with the oil's viscosity

# Pa or N/m: what oil or spring still give is less than the integrator's tolerance.
RIGID = 1e13


@dataclass(frozen=True, slots=True)
class Quantity:
    """A number of a model that a fit may find; values in SI."""

    name: str  # as in tables, options and `Values`: lower case, "rebound_opening"
    symbol: str  # as people write it: R_m1
    label: str  # in a few words, for a table's row: "valve 1 (adjuster)"
    meaning: str  # in one phrase, for the metadata of tables
    unit: str  # SI, as in "N s/(m2 kg)"
    plausible: tuple[float, float]  # a fit stays within; a factor of 100 beyond what dampers have
    # Positive, and fitted by its logarithm; otherwise of either sign, in steps of `size`, which is
    # about as much as it is in a damper.
    is_logarithmic: bool = True
    size: float = 1.0
    scope: str = SETTING  # or DAMPER, LOG, RIG, or an adjuster's name
    default: float | None = None  # where it is held unless freed; None: it is free unless held
    fallback: float | None = None  # what is known of it where no log determines it
    power: int = 0  # people read it in 10^power of the unit,
    shown_unit: str = ""  # which they write like this
    is_open: bool = False  # beyond the upper edge all is alike: rigid, and no fault of the logs
    has_own_edges: bool = False  # at an edge the law is a simpler one: no bound that a fit strains
    may_vanish: bool = False  # of a logarithmic one: it may be held at nothing
    trend_degree: int | None = None  # of its polynomial over the settings, if agreed beforehand
    # What dampers and rigs have: a fit beyond it is not believed. And why not, in a phrase.
    believable: tuple[float, float] = (float("-inf"), float("inf"))
    belief: str = ""
    # Standard error of an unmeasured default: of its logarithm, or in `unit` of what
    # may vanish.
    ignorance: float = 0.0
    is_absolute: bool = False  # a pressure from vacuum: people say bara or barg, psia or psig
    # In a damper that neither yields nor lags (`damperfit.damper.quasi_static`): rigid oil and
    # mounting, no play, no moving mass. None: as it is.
    ideal: float | None = None
    role: str = ""  # OFFSET, FRICTION, STIFFNESS, GAS_AMOUNT or VISCOUS; "": none of these
    stroke: str = ""  # of a valve: whose it is, "rebound", "compression" or "return",
    part: str = ""  # which number of its law, a key of `damperfit.damper.network.PARTS`,
    group: str = ""  # of "bleed" or "blow_off",
    area_power: float = 0.0  # and power of the pressed area by which it goes at the same force
    # Edges at which its part does nothing, as in "above below"; at the first lies a structure
    # without the part. Empty: as its role has it.
    idle: str = ""

    @property
    def idle_edges(self) -> tuple[str, ...]:
        """Edges at which its part does nothing: as declared, or as its role has it."""
        if self.has_own_edges:
            return ("below", "above")
        by_role = {FRICTION: "below", STIFFNESS: "above", GAS_AMOUNT: "above"}
        return tuple((self.idle or by_role.get(self.role, "")).split())

    @property
    def vanishes_at(self) -> float:
        """The edge of its range at which a structure has it that does without its part."""
        return self.plausible[0 if self.idle_edges[:1] == ("below",) else 1]

    def edge_at(self, value: float) -> str:
        """Return the edge that a value has reached: "below", "above", or "" within the range."""
        low, high = self.plausible
        return "below" if value <= low else "above" if value >= high else ""

    def away_from_default(self, value: float) -> float:
        """Return how many times its `ignorance` a value is away from the default."""
        assert self.default is not None
        known = value - self.default if self.may_vanish else math.log(value / self.default)
        return known / self.ignorance

    def beside(self, part: str) -> str:
        """Return the name of another number of the same valve."""
        return f"{self.stroke}_{part}"

    @property
    def unit_after(self) -> str:
        """Its SI unit behind a number, with the space between; a pure number has none."""
        return "" if self.unit == "1" else f" {self.unit}"

    @property
    def shown(self) -> tuple[float, str]:
        """Factor and unit of its numbers in sentences: those of tables, if the unit has a name."""
        if self.shown_unit and not self.shown_unit[0].isdigit():
            return 10.0**-self.power, f" {self.shown_unit}"
        return 1.0, self.unit_after

    @property
    def is_offset(self) -> bool:
        """Whether it is a force of either sign that is added: a tare."""
        return self.role == OFFSET

    @property
    def is_friction(self) -> bool:
        """Whether it is a force that turns with the sign of the velocity."""
        return self.role == FRICTION

    @property
    def is_of_mounting(self) -> bool:
        """Whether it is the stiffness of the rig, which a stiff rig has without an upper limit."""
        return self.scope == RIG and self.idle_edges == ("above",)

    @property
    def is_shared(self) -> bool:
        """Whether all settings have it in common."""
        return self.scope in {DAMPER, RIG}


# Signatures of `damperfit.uncertainty.residuals`: of any force, and of what holds oil and gas.
FLAWS_OF_FORCE = (
    "delay", "offset", "load_cell", "friction_with_speed", "friction_with_position",
    "valve_law_rebound", "valve_law_bump",
)  # fmt: skip
FLAWS_OF_OIL = ("gas_volume", "compressibility", "friction_with_pressure")


class Signal(NamedTuple):
    """One inner signal: what a model's response has besides its force."""

    name: str  # as in tables and FMUs, without its unit
    label: str  # in a figure's legend
    where: str  # of what it is, for descriptions
    unit: str  # SI


PRESSURES = (
    Signal("pressure_1", "chamber 1 (rod side)", "in chamber 1, which rebound presses", "Pa"),
    Signal("pressure_2", "chamber 2 (full bore)", "in chamber 2, which compression presses", "Pa"),
    Signal("pressure_3", "chamber 3 (gas side)", "of the gas", "Pa"),
)


class FurtherStart(NamedTuple):
    """Another way to a minimum, for a fit that has ended in a wrong local one."""

    start: Values
    # Quantities that rough minimisations hold, one after the other, before all are free.
    held: tuple[frozenset[str], ...]
    # Taken only where what came before is neither sound nor explained; it must then be clearly
    # better. Otherwise it is always taken, and a sound end is preferred.
    is_last_resort: bool = False


@dataclass(frozen=True, slots=True)
class Values:
    """Numbers for the quantities of a model, SI, in its order; an attribute for each.

    The types made by `values_type` are frozen dataclasses: equal where all numbers are, and what
    works on dataclasses works on them.
    """

    quantities: ClassVar[tuple[Quantity, ...]] = ()
    names: ClassVar[tuple[str, ...]] = ()  # of the quantities, in the model's order

    if TYPE_CHECKING:

        def __getattr__(self, name: str) -> float: ...

    def __init_subclass__(cls) -> None:
        """Name its quantities once: a fit asks for them at every step."""
        cls.names = tuple([quantity.name for quantity in cls.quantities])

    def __getitem__(self, name: str) -> float:
        """Return one of the numbers, by name."""
        if name not in self.names:
            raise KeyError(name)
        return cast("float", getattr(self, name))

    def keys(self) -> tuple[str, ...]:
        """Return the names, so that ``dict(values)`` gives the numbers by name."""
        return self.names

    def quantity(self, name: str) -> Quantity:
        """Return one of its quantities; a `ConfigurationError` where there is none of the name."""
        return _named(name, self.quantities)

    @property
    def numbers(self) -> tuple[float, ...]:
        """The numbers, in the same order."""
        return tuple([getattr(self, name) for name in self.names])

    def replace(self, changes: Mapping[str, float] = MappingProxyType({}), **more: float) -> Self:
        """Return the same with some numbers changed; refuses names that are none of the model's."""
        changes, names = {**changes, **more}, self.names
        for name in changes:
            if name not in names:
                self.quantity(name)
        return type(self)(*[changes.get(name, getattr(self, name)) for name in names])


def _named(name: str, quantities: tuple[Quantity, ...]) -> Quantity:
    for quantity in quantities:
        if quantity.name == name:
            return quantity
    known = [quantity.name for quantity in quantities]
    raise ConfigurationError(
        f"no parameter {name!r}; there are {', '.join(known)}.{did_you_mean(name, known)}",
        code="unknown-quantity",
    )


# One type for the same quantities, whoever asks: values of two types differ by their types alone.
_MADE: WeakValueDictionary[tuple[Quantity, ...], type[Values]] = WeakValueDictionary()
_MAKING = Lock()


@lru_cache(maxsize=256)
def values_type(quantities: tuple[Quantity, ...]) -> type[Values]:
    """Return the type of `Values` that has these quantities in this order.

    Examples
    --------
    >>> from damperfit.damper.model import Quantity
    >>> c = Quantity("c", "c", "damping", "viscous damping", "N s/m", (1.0, 1e6))
    >>> values_type((c,))(1.5e3)
    Values(c=1500.0)
    """
    with _MAKING:
        made = _MADE.get(quantities)
        if made is None:
            made = _MADE[quantities] = make_dataclass(
                "Values",
                [(quantity.name, float) for quantity in quantities],
                bases=(Values,),
                frozen=True,
                slots=True,
                # It cannot be found by name where it is pickled to.
                namespace={
                    "__reduce__": lambda own: (_rebuilt, (own.quantities, own.numbers)),
                    "quantities": quantities,
                },
            )
    return made


def _rebuilt(quantities: tuple[Quantity, ...], numbers: tuple[float, ...]) -> Values:
    return values_type(quantities)(*numbers)


class Model(ABC):
    """One damper, as far as it is declared, and the law that it is taken to follow."""

    __slots__ = ()

    name: ClassVar[str]  # as in `MODELS`, TOML and `--model`
    title: ClassVar[str]  # in a few words, for people
    procedures: ClassVar[tuple[str, ...]] = ("plain", "joint")  # of a fit; the first is its own
    # What is declared, not fitted, and the force can be differentiated by all the same.
    conditions: ClassVar[tuple[str, ...]] = ()
    # Share of the sum of squares that a step must promise to be tried: what the misfit of a law
    # with kinks jumps by, as a sample falls to one side of one or the other.
    kinks: ClassVar[float] = 0.0
    # Signals of its responses besides the force; what it does not compute is NaN there.
    signals: ClassVar[tuple[Signal, ...]] = ()
    # Flaws of log or model that its residuals may be said to show.
    flaws: ClassVar[tuple[str, ...]] = FLAWS_OF_FORCE
    # Range of each declared number in SI, and its unit; what lies outside was misread.
    ranges: ClassVar[Ranges] = MappingProxyType({})
    unfelt: ClassVar[tuple[str, ...]] = ()  # keys of [damper] that move no force
    # How the bulk modulus of the settings may be found.
    bulk_moduli: ClassVar[tuple[str, ...]] = ("free",)

    @property
    @abstractmethod
    def quantities(self) -> tuple[Quantity, ...]:
        """What a fit may find, in the order of tables and of `Values`."""

    @abstractmethod
    def simulate(
        self, values: Values, motion: Motion, *, sensitivities: Names, options: SolverOptions
    ) -> Response:
        """Return force, pressures and sensitivities at the samples of a motion.

        The force is differentiated by those quantities and conditions that are asked for. A
        `SimulationError`: it cannot be integrated, or not differentiated by what was asked.
        """

    @abstractmethod
    def start(self, traces: Sequence[Trace], fixed: Mapping[str, float]) -> tuple[Values, ...]:
        """Return where a fit of one setting's logs may start, at least one point.

        Of several the one whose simulation fits the first log best is taken. What is fixed has its
        value in all of them.
        """

    def further_starts(
        self, start: Values, traces: Sequence[Trace], free: Names
    ) -> tuple[FurtherStart, ...]:
        """Return other ways to try when a fit from a start has ended in a wrong local minimum."""
        del start, traces, free
        return ()

    def examine(
        self, values: Values, seen: Sequence[tuple[Trace, Response]], *, solver: SolverOptions
    ) -> Cavitation:
        """Return whether a chamber was empty in a setting's logs, and how far from it they are."""
        from damperfit.damper.cylinder import Cavitation, cavitation_in

        del values, solver
        return cavitation_in(seen)[0] if self.signals else Cavitation()

    def valve_characteristics(
        self, values: Values, traces: Sequence[Trace]
    ) -> tuple[ValveCharacteristic, ...]:
        """Return the valves of a setting, flow against pressure, where the logs show them."""
        del values, traces
        return ()

    @property
    def gas(self) -> tuple[float, float, float, float, float] | None:
        """Rod area, gas pressure, volume and exponent, ambient pressure, SI; None: no gas."""
        return None

    @property
    def parts(self) -> Mapping[str, tuple[str, ...]]:
        """Words for several quantities at once, as in ``[adjusters]``: "rebound.bleed"."""
        return {}

    @property
    def chamber_lengths(self) -> tuple[float, float] | None:
        """l_1 and l_2, m; None: it has no chambers."""
        return None

    @property
    def travel(self) -> float:
        """Displacement from rest that the damper does not reach, m."""
        return float("inf")

    @property
    def plain(self) -> Model:
        """The damper without what temperature does to it."""
        return self

    @property
    def sentence(self) -> str:
        """The damper's main figures, for people, without a full stop."""
        return self.title

    @property
    def condition(self) -> str:
        """What its quantities hold for, to follow its main figures in a sentence."""
        return ""

    def filled_to(self, gas_pressure: float | None) -> Self:
        """Return the same damper filled to another pressure, Pa; None: as it is declared."""
        if gas_pressure is None or not hasattr(self, "gas_pressure"):
            return self
        return cast("Self", replace(cast("Any", self), gas_pressure=gas_pressure))

    def rest_force(self, displacement: ArrayLike) -> FloatArray | None:
        """Return the force at no speed without friction and offset, N; None: it does not say."""
        del displacement
        return None

    def values(self, known: Mapping[str, float] = MappingProxyType({}), **more: float) -> Values:
        """Return values of all quantities; what is not named has its default.

        A `ConfigurationError`: a name is unknown, or one without a default is missing.
        """
        known = {**known, **more}
        for name in known:
            self.quantity(name)
        complete = {q.name: known.get(q.name, q.default) for q in self.quantities}
        missing = [name for name, value in complete.items() if value is None]
        if missing:
            raise ConfigurationError(
                f"{self.name} needs a value of {', '.join(missing)}", code="missing-value"
            )
        return self.values_type(**complete)

    @property
    def values_type(self) -> type[Values]:
        """The type of its values."""
        return values_type(self.quantities)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the quantities, in their order."""
        return tuple([quantity.name for quantity in self.quantities])

    def quantity(self, name: str) -> Quantity:
        """Return a quantity by its name; a `ConfigurationError` where there is none."""
        return _named(name, self.quantities)


# Most commands need one of them: a model is loaded when it is asked for.
_WHERE = {
    "purdy": "purdy.parameters.Damper",
    "twin_tube": "valve_dampers.TwinTube",
    "monotube": "valve_dampers.Monotube",
    "through_flow": "valve_dampers.ThroughFlow",
    "network": "valve_dampers.DeclaredNetwork",
    "linear": "rivals.Linear",
    "bilinear": "rivals.Bilinear",
    "polynomial_v": "rivals.PolynomialInSpeed",
    "polynomial_xv": "rivals.PolynomialInStrokeAndSpeed",
    "restoring_force_surface": "rivals.RestoringForceSurface",
    "degressive": "rivals.Degressive",
    "four_slopes": "rivals.FourSlopes",
    "karadayi_masada": "rivals.KaradayiMasada",
    "hagedorn_wallaschek": "rivals.HagedornWallaschek",
    "surace_worden_tomlinson": "rivals.SuraceWordenTomlinson",
    "besinger_cebon_cole": "rivals.BesingerCebonCole",
    "bouc_wen": "rivals.BoucWen",
    "biviscous": "rivals.Biviscous",
    "kwok": "rivals.Kwok",
}


class _Models(Mapping[str, type[Model]]):
    def __getitem__(self, name: str) -> type[Model]:
        module, _, kind = _WHERE[name].rpartition(".")
        return cast("type[Model]", getattr(import_module(f"damperfit.damper.{module}"), kind))

    def __iter__(self) -> Iterator[str]:
        return iter(_WHERE)

    def __len__(self) -> int:
        return len(_WHERE)

    def __contains__(self, name: object) -> bool:
        return name in _WHERE  # without loading it


MODELS: Mapping[str, type[Model]] = _Models()
"""Every model by its name: the paper's damper, dampers of real valves, models of the literature."""


def model_named(name: str) -> type[Model]:
    """Return the model of a name; a damper is an object of it. Refuses a name of none.

    Examples
    --------
    >>> model_named("purdy")().names
    ('r_m1', 'r_m2', 'r_m3', 'k_e', 'f_f', 'f_0')
    """
    if name not in MODELS:
        if name == "auto":
            raise ConfigurationError(
                "model auto: only {--model auto} of damperfit identify, and damperfit models, let "
                "the logs choose; give the model that they name here",
                code="model-auto",
            )
        there = f" There are {', '.join(MODELS)}."
        near = did_you_mean(name, (*MODELS, "auto"))  # what `identify` takes beside them
        raise ConfigurationError(f"no model {name!r}.{near or there}", code="unknown-model")
    return MODELS[name]
