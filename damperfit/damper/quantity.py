"""One number of a model: what it is called, what it may be, whose it is and what part it plays.

What is done with a quantity follows from its scope, its range, whether it is taken by its
logarithm, and its role; its name says nothing to anyone but its model.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

__all__ = [
    "DAMPER",
    "FRICTION",
    "GAS_AMOUNT",
    "LOG",
    "OFFSET",
    "RIG",
    "RIGID",
    "SETTING",
    "STIFFNESS",
    "VISCOUS",
    "Quantity",
]

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
    is_open : bool
        What lies beyond the upper edge looks like the edge: rigid. It is then no fault of the logs.
    has_own_edges : bool
        At an edge of its range the law is a simpler one, and no bound that a fit strains against.
    may_vanish : bool
        Of a logarithmic one: it may be held at nothing.
    trend_degree : int or None
        Degree of the polynomial that it follows over the settings, where that is agreed beforehand.
    believable : tuple of float
        What dampers and rigs have: a fit may go beyond it, but is then not believed.
    belief : str
        Why not, in a phrase.
    ignorance : float
        Standard error of a default that nobody has measured: of its logarithm, or in `unit` of what
        may vanish.
    is_absolute : bool
        A pressure that counts from vacuum, so that people say bara or barg, psia or psig.
    ideal : float or None
        Its value in a damper that neither yields nor lags: rigid oil and mounting, no play, no
        moving mass; None: as it is. `damperfit.damper.quasi_static` puts it there.
    role : str
        `OFFSET`, `FRICTION`, `STIFFNESS`, `GAS_AMOUNT` or `VISCOUS`; "": none of these.
    stroke, part : str
        Of a valve: whose it is ("rebound", "compression", "return") and which number of its law, a
        key of `damperfit.damper.network.PARTS`.
    group : str
        Of a valve: "bleed" or "blow_off", of which it is a number.
    area_power : float
        Of a valve: with which power of the area that presses on it its value goes, for the same
        force in another layout.
    idle : str
        Edges of its range at which its part does nothing, as in "above below"; the first is where a
        structure without the part lies. Empty: as its role has it.
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
    is_open: bool = False
    has_own_edges: bool = False
    may_vanish: bool = False
    trend_degree: int | None = None
    believable: tuple[float, float] = (float("-inf"), float("inf"))
    belief: str = ""
    ignorance: float = 0.0
    is_absolute: bool = False
    ideal: float | None = None
    role: str = ""
    stroke: str = ""
    part: str = ""
    group: str = ""
    area_power: float = 0.0
    idle: str = ""

    @property
    def idle_edges(self) -> tuple[str, ...]:
        """Edges at which its part does nothing: as declared, or as its role has it."""
        if self.has_own_edges:
            return ("below", "above")
        if self.idle:
            return tuple(self.idle.split())
        by_role = {FRICTION: ("below",), STIFFNESS: ("above",), GAS_AMOUNT: ("above",)}
        return by_role.get(self.role, ())

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
    def is_offset(self) -> bool:
        """Whether it is a force of either sign that is added: a tare."""
        return self.role == OFFSET

    @property
    def is_friction(self) -> bool:
        """Whether it is a force that turns with the sign of the velocity."""
        return self.role == FRICTION

    @property
    def is_shared(self) -> bool:
        """Whether all settings have it in common."""
        return self.scope in {DAMPER, RIG}
