"""A damper as a network: two oil chambers, a gas chamber and passages between any two of them.

Chamber 1 is the rod side, 2 the full bore, 3 the gas. A passage carries the mass flow w from one to
another by the law of its parts, each of which may be absent::

    D = p_open + R w + (S w)^2        w = 0 for D <= p_open

    S       orifice, 1/(C_d A sqrt(2 rho))   s sqrt(N)/(m kg)
    R       laminar resistance               N s/(m2 kg)
    p_open  preload                          Pa
    width   how gradually a stack of discs lifts: s(D) in place of D - p_open, see core/passages.h
    lift    how much further it lifts the harder it is pressed: s (1 + lift s)   1/Pa

======================  ==============================  =========================================
a passage with          is a                            examples
======================  ==============================  =========================================
S                       orifice, bleed                  needle, low-speed adjuster, valve 1
R                       leak, linear check              piston ring, return valve, valves 2 and 3
R and S                 long orifice                    needle at few clicks
p_open and R            blow-off                        preloaded disc, shim stack
p_open, R and S         blow-off with port              high speed
p_open, R and width     rounded blow-off                shim stack
p_open, R and lift      lifting blow-off                shim stack, poppet on a soft spring
======================  ==============================  =========================================

The oil in chambers 1 and 2 is compressible; with free gas (volume share phi at P_0) it follows
1/(1 + e) = 1 - (P - P_0)/K_e + phi (P_0/P - 1), e = m/(rho_0 V) - 1, isothermally, and never
reaches zero pressure. Without, it follows (4), (7), (11), (12) of the paper and is clamped at zero.

The mounting (rod ends, frame, load cell) may be elastic, with play: a spring k_s that pulls when it
is stretched by more than half the play. The piston is then where the forces balance::

    k_s dz(x - y) = P_1 a_p1 - P_2 a_p2 + a_r P_amb + f_f sgn(dy/dt) + drag dy/dt
    dz(u) = u - clip(u, +-play/2)

and what the load cell reads is the left side. ``series_stiffness`` 0 is a rigid mounting without
play.

Friction is Coulomb's unless more is said of it::

    f = z (f_f + breakaway exp(-(v/stribeck_speed)^2) + seal_area P_1)

    z = clip((dy/dt)/turning_speed, +-1)        presliding 0; sgn(dy/dt) for turning_speed 0
    dz/dy = (1 - z sgn(dy/dt))/presliding       Dahl: it builds up over a distance

``breakaway`` falls with the speed v of the rig, not of the piston: a friction that falls with the
speed of a piston without mass would let it jump.
"""

from __future__ import annotations

from dataclasses import dataclass

from damperfit.errors import ConfigurationError, did_you_mean

__all__ = [
    "BLEEDS",
    "BLOW_OFFS",
    "BODY_NUMBERS",
    "MOST_NUMBERS",
    "MOST_PASSAGES",
    "Network",
    "Passage",
    "Valve",
    "monotube",
    "purdy",
    "purdy_blow_off",
    "through_flow",
    "twin_tube",
]

# In the order of core/network.h: what every network has, whatever its passages.
BODY_NUMBERS = (
    "k_e",
    "free_gas",
    "f_f",
    "f_0",
    "gas_pressure",
    "gas_exponent",
    "gas_volume",
    "series_stiffness",
    "play",
    "drag",
    "presliding",
    "breakaway",
    "stribeck_speed",
    "seal_area",
    "turning_speed",
)

# What the compiled core has room for (core/network.h).
MOST_PASSAGES = 16
MOST_NUMBERS = 45

# Parts of a valve: which of the law's numbers each kind has.
BLEEDS = {
    "none": (),
    "orifice": ("bleed",),
    "long": ("leak", "bleed"),
    "leak": ("leak",),
}
BLOW_OFFS = {
    "none": (),
    "linear": ("opening", "slope"),
    "port": ("opening", "slope", "port"),
    "rounded": ("opening", "slope", "width"),
    "lifting": ("opening", "slope", "lift"),
}


@dataclass(frozen=True, slots=True)
class Passage:
    """A way for the oil; each number of its law by name, empty where the term is absent.

    Attributes
    ----------
    start, end : int
        Chambers 1 (rod side), 2 (full bore) or 3 (gas).
    orifice, resistance, opening, width, lift : str
        Names of S, R, p_open, width and lift. Passages that name the same number share it.
    is_two_way : bool
        Whether the same law holds backwards; otherwise the passage is a check.
    """

    start: int
    end: int
    orifice: str = ""
    resistance: str = ""
    opening: str = ""
    width: str = ""
    lift: str = ""
    is_two_way: bool = False

    @property
    def numbers(self) -> tuple[str, ...]:
        """Names of its numbers, in the order p_open, R, S, width, lift; empty where absent."""
        return (self.opening, self.resistance, self.orifice, self.width, self.lift)


@dataclass(frozen=True, slots=True)
class Network:
    """Passages between the chambers.

    Attributes
    ----------
    name : str
        Name of the layout.
    passages : tuple of Passage
        At most `MOST_PASSAGES`, with `MOST_NUMBERS` numbers, the body's included.
    has_floating_piston : bool
        Chamber 2 is at the gas pressure: a monotube, whose piston parts oil and gas.
    ambient_pressure : float
        Of the surroundings on the rod, Pa: f = P_1 a_p1 - P_2 a_p2 + a_r P_amb + ...; the paper
        leaves it out.
    """

    name: str
    passages: tuple[Passage, ...]
    has_floating_piston: bool = False
    ambient_pressure: float = 0.0

    def __post_init__(self) -> None:
        found = f"{len(self.passages)} passages and {len(self.numbers)} numbers"
        if not 1 <= len(self.passages) <= MOST_PASSAGES or len(self.numbers) > MOST_NUMBERS:
            raise ConfigurationError(
                f"{self.name} has {found}; a network has 1 to {MOST_PASSAGES} passages and at most "
                f"{MOST_NUMBERS} numbers, {len(BODY_NUMBERS)} of them the body's"
            )

    @property
    def passage_numbers(self) -> tuple[str, ...]:
        """Names of the passages' numbers, each once, in their order."""
        named = (name for passage in self.passages for name in passage.numbers if name)
        return tuple(dict.fromkeys(named))

    @property
    def numbers(self) -> tuple[str, ...]:
        """Names of all numbers, in the order of the compiled core."""
        return (*BODY_NUMBERS, *self.passage_numbers)


@dataclass(frozen=True, slots=True)
class Valve:
    """What a valve is made of: a bleed that is always open, and a blow-off beside it.

    Attributes
    ----------
    bleed : str
        One of `BLEEDS`: none, orifice, long (laminar and turbulent) or leak.
    blow_off : str
        One of `BLOW_OFFS`: none, linear, port, rounded or lifting.
    """

    bleed: str = "orifice"
    blow_off: str = "linear"

    def __post_init__(self) -> None:
        for kind, known, what in (
            (self.bleed, BLEEDS, "bleed"),
            (self.blow_off, BLOW_OFFS, "blow-off"),
        ):
            if kind not in known:
                raise ConfigurationError(
                    f"no {what} {kind!r}; there are {', '.join(known)}.{did_you_mean(kind, known)}"
                )
        if self.bleed == self.blow_off == "none":
            raise ConfigurationError("a valve needs a bleed or a blow-off; both are 'none'")


def purdy() -> Network:
    """Return the paper's layout: an orifice 1-3, linear checks 2 to 1 and 3 to 2."""
    return Network(
        "purdy",
        (
            Passage(1, 3, orifice="r_m1", is_two_way=True),
            Passage(2, 1, resistance="r_m2"),
            Passage(3, 2, resistance="r_m3"),
        ),
    )


def purdy_blow_off() -> Network:
    """Return the paper's layout with a blow-off beside valve 1 and a preload on valve 2."""
    bleed, _, foot = purdy().passages
    return Network(
        "purdy_blow_off",
        (
            bleed,
            Passage(1, 3, opening="rebound_opening", resistance="rebound_slope"),
            Passage(2, 1, opening="compression_opening", resistance="r_m2"),
            foot,
        ),
    )


def through_flow(rebound: Valve = Valve(), compression: Valve = Valve()) -> Network:
    """Return a solid piston whose sides each press through a valve to the reservoir.

    The rebound valve joins chamber 1 with the gas side, the compression valve chamber 2; each has a
    return check beside it. Dampers with a piggyback or a remote reservoir and up to four adjusters.
    """
    return Network(
        "through_flow",
        (
            *_valve(1, 3, "rebound", rebound),
            Passage(3, 1, resistance="return_slope"),
            *_valve(2, 3, "compression", compression),
            Passage(3, 2, resistance="return_slope"),
        ),
    )


def twin_tube(rebound: Valve = Valve(), compression: Valve = Valve()) -> Network:
    """Return a piston valve between 1 and 2 and a base valve between 2 and 3, with returns."""
    return Network(
        "twin_tube",
        (
            *_valve(1, 2, "rebound", rebound),
            Passage(2, 1, resistance="return_slope"),
            *_valve(2, 3, "compression", compression),
            Passage(3, 2, resistance="return_slope"),
        ),
    )


def monotube(rebound: Valve = Valve(), compression: Valve = Valve()) -> Network:
    """Return a piston with a valve for each stroke; a floating piston holds 2 at gas pressure."""
    return Network(
        "monotube",
        (
            *_valve(1, 2, "rebound", rebound, is_two_way=False),
            *_valve(2, 1, "compression", compression, is_two_way=False),
        ),
        has_floating_piston=True,
    )


def _valve(
    start: int, end: int, stroke: str, valve: Valve, *, is_two_way: bool = True
) -> tuple[Passage, ...]:
    """Return the passages of a valve; a bleed lets oil back, a blow-off does not."""
    bleed = {part: f"{stroke}_{part}" for part in BLEEDS[valve.bleed]}
    blow_off = {part: f"{stroke}_{part}" for part in BLOW_OFFS[valve.blow_off]}
    passages = []
    if bleed:
        passages.append(
            Passage(
                start,
                end,
                orifice=bleed.get("bleed", ""),
                resistance=bleed.get("leak", ""),
                is_two_way=is_two_way,
            )
        )
    if blow_off:
        passages.append(
            Passage(
                start,
                end,
                orifice=blow_off.get("port", ""),
                resistance=blow_off["slope"],
                opening=blow_off["opening"],
                width=blow_off.get("width", ""),
                lift=blow_off.get("lift", ""),
            )
        )
    return tuple(passages)
