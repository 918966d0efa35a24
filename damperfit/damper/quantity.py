"""One number of a model: what it is called, what it may be, whose it is and what part it plays.

What is done with a quantity follows from its scope, its range, whether it is taken by its
logarithm, and its role; its name says nothing to anyone but its model.
"""

import math
from dataclasses import dataclass

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
