"""A damper as a network: two oil chambers, a gas chamber and passages between any two of them.

Chamber 1 is the rod side, 2 the full bore, 3 the gas. A passage carries the mass flow w from one to
another by the law of its parts, each of which may be absent::

    D = p_open + R w + (S w)^2        w = 0 for D <= p_open

    S       orifice, 1/(C_d A sqrt(2 rho))   s sqrt(N)/(m kg)
    R       laminar resistance               N s/(m2 kg)
    p_open  preload                          Pa
    width   how gradually a stack of discs lifts: s(D) in place of D - p_open, see core/passages.h
    power   D - p_open = 10 bar (R w/10 bar)^power

A passage with S is an orifice (needle, low-speed adjuster, valve 1); with R a leak or a linear
check (piston ring, return valve, valves 2 and 3); with R and S a long orifice (needle at few
clicks); with p_open and R a blow-off (preloaded disc, shim stack), with S beside them one with a
port (high speed), with width a rounded one (shim stack), with power one of a stack that stiffens or
gives way.

The oil in chambers 1 and 2 is compressible; with free gas (volume share phi at P_0) it follows
1/(1 + e) = 1 - (P - P_0)/K_e + phi (P_0/P - 1), e = m/(rho_0 V) - 1, isothermally, and never
reaches zero pressure. Without, it follows (4), (7), (11), (12) of the paper and is clamped at zero.

The mounting (rod ends, frame, load cell) may be elastic, with play: a spring k_s that pulls when it
is stretched by more than half the play. The piston is then where the forces balance::

    k_s dz(x - y) = P_1 a_p1 - P_2 a_p2 + a_r P_amb + f_f sgn(dy/dt) + drag dy/dt
    dz(u) = u - clip(u, +-play/2)

Rubber beside the spring holds some force whichever way it was bent last: it pulls with
rubber z as well, dz/du = (1 - z sgn(du/dt))/rubber_bend, u = x - y.

and what the load cell reads is the left side. ``k_s`` 0 is a rigid mounting without play.

Friction is Coulomb's unless more is said of it::

    f = z (f_f + breakaway exp(-(v/stribeck_speed)^2) + seal_area P_1)

    z = clip((dy/dt)/turning_speed, +-1)        presliding 0; sgn(dy/dt) for turning_speed 0
    dz/dy = (1 - z sgn(dy/dt))/presliding       Dahl: it builds up over a distance

``breakaway`` falls with the speed v of the rig, not of the piston: a friction that falls with the
speed of a piston without mass would let it jump.

A new number of a valve's law is a line in `PARTS` and a term of `core/passages.h`; a new kind of
valve is a line in `BLEEDS` or `BLOW_OFFS`.
"""

from __future__ import annotations

import math
from array import array
from collections.abc import Callable, Mapping, Sequence
from copy import copy
from dataclasses import dataclass, field
from functools import lru_cache
from typing import TYPE_CHECKING, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from damperfit.arrays import FloatArray
from damperfit.compiled_core import compiled_core
from damperfit.damper.model import RIG, Model, Values
from damperfit.damper.mounting import OF_LOAD_CELL
from damperfit.errors import ConfigurationError, SimulationError, did_you_mean
from damperfit.simulation import Motion, Response, SolverOptions, Work, describe_ending

if TYPE_CHECKING:
    from damperfit.damper.cylinder import Cylinder

# In the order of core/network.h: what every network has, whatever its passages.
BODY_NUMBERS = (
    "k_e", "free_gas", "f_f", "f_0", "gas_pressure", "gas_exponent", "gas_volume", "k_s", "play",
    "drag", "presliding", "breakaway", "stribeck_speed", "seal_area", "turning_speed",
    "rubber", "rubber_bend",
)  # fmt: skip
_NEEDED = ("f_f", "k_e")  # the others are the damper's or nothing

# What the compiled core has room for (core/network.h).
_MOST_PASSAGES, _MOST_NUMBERS = 16, 47

ROOT, LINEAR = "s sqrt(N)/(m kg)", "N s/(m2 kg)"
# Power of ten and unit, as people read it.
SHOWN = {ROOT: (3, "10³ s √N / (m kg)"), LINEAR: (6, "10⁶ N s / (m² kg)"), "Pa": (5, "bar")}


class Part(NamedTuple):
    """One number of a valve's law; as of `damperfit.damper.model.Quantity`, and of more."""

    term: str  # of `Passage`, that it is
    symbol: str
    label: str
    meaning: str
    unit: str
    plausible: tuple[float, float]
    area_power: float
    idle: str
    # What it is in a valve of which only the plain law is known, from its opening and slope, the
    # largest pressure and mass flow.
    guess: Callable[[float, float, float, float], float]
    elsewhere: float  # of a check valve of a car's damper, where no log says anything of it


# Of a plain valve at the largest pressure and flow: a bleed that takes half of the flow up to the
# opening; of what is bent, as much as a fit can start from.
PARTS: dict[str, Part] = {
    "bleed": Part(
        "orifice", "S", "bleed", "orifice of the bleed, 1/(C_d A sqrt(2 rho))", ROOT, (1e2, 1e8),
        1.5, "above", lambda opening, _slope, _top, flow: math.sqrt(opening) / (0.5 * flow), 1e4,
    ),
    "leak": Part(
        "resistance", "L", "leak", "laminar resistance of the bleed", LINEAR, (1e3, 1e11), 2.0,
        "below", lambda _opening, _slope, top, flow: 0.1 * top / flow, 2.5e5,
    ),
    "opening": Part(
        "opening", "p", "opening", "pressure at which the blow-off opens", "Pa", (1e3, 1e8), 1.0,
        "above below", lambda opening, _slope, _top, _flow: opening, 1e4,
    ),
    "slope": Part(
        "resistance", "R", "slope", "resistance of the blow-off beyond its opening", LINEAR,
        (1e3, 1e11), 2.0, "above below", lambda _opening, slope, _top, _flow: slope, 2.5e5,
    ),
    "port": Part(
        "orifice", "S_p", "port", "orifice behind the blow-off", ROOT, (1e1, 1e8), 1.5,
        "below above", lambda _opening, slope, _top, flow: math.sqrt(0.1 * slope / flow), 1e4,
    ),
    "width": Part(
        "width", "d", "rounding", "how gradually the blow-off lifts", "Pa", (1e1, 1e7), 1.0,
        "below", lambda opening, _slope, _top, _flow: 0.1 * opening, 1e3,
    ),
    "power": Part(
        "power", "n", "power", "power of its flow that the pressure beyond the opening goes with",
        "1", (0.5, 2.0), 0.0, "", lambda _opening, _slope, _top, _flow: 1.25, 1.0,
    ),
}  # fmt: skip


class Kind(NamedTuple):
    """A kind of bleed or blow-off."""

    parts: tuple[str, ...]  # which of `PARTS` it has
    words: str = ""  # of a law that has it,
    change: str = ""  # and of a structure that has it in place of another


# The search of laws tries them in this order.
BLEEDS: dict[str, Kind] = {
    "none": Kind((), "", "without a bleed"),
    "orifice": Kind(("bleed",), "bleed", "with an orifice as bleed"),
    "leak": Kind(("leak",), "laminar bleed", "with a laminar bleed"),
    "long": Kind(("leak", "bleed"), "part-laminar bleed", "with bleeds with a laminar part"),
}
_PLAIN = ("opening", "slope")
BLOW_OFFS: dict[str, Kind] = {
    "none": Kind((), "", "without a blow-off"),
    "linear": Kind(_PLAIN, "blow-off", "with a plain blow-off"),
    "rounded": Kind((*_PLAIN, "width"), "rounded blow-off", "with blow-offs that lift gradually"),
    "port": Kind((*_PLAIN, "port"), "port blow-off", "with a port behind the blow-offs"),
    "power": Kind(
        (*_PLAIN, "power"), "blow-off by a power", "with blow-offs by a power of their flow"
    ),
}
# Numbers of blow-offs of any kind: a valve that does not open shows none of them.
BLOW_OFF_PARTS = tuple(dict.fromkeys(part for kind in BLOW_OFFS.values() for part in kind.parts))


class Passage(NamedTuple):
    """A way for the oil; each number of its law by name, empty where the term is absent.

    Passages that name the same number share it.
    """

    start: int  # chambers 1 (rod side), 2 (full bore) or 3 (gas)
    end: int
    orifice: str = ""  # name of S
    resistance: str = ""  # of R
    opening: str = ""  # of p_open
    width: str = ""
    power: str = ""
    is_two_way: bool = False  # whether the law holds backwards; otherwise the passage is a check

    @property
    def numbers(self) -> tuple[str, ...]:
        """Names of its numbers, in the order of the compiled core; empty where absent."""
        return (self.opening, self.resistance, self.orifice, self.width, self.power)

    @classmethod
    def of_parts(
        cls, start: int, end: int, name: str, parts: Sequence[str], *, is_two_way: bool = False
    ) -> Passage:
        """Return a passage with some of `PARTS`, whose numbers are called after a name."""
        terms = {PARTS[part].term: f"{name}_{part}" for part in parts}
        return cls(start, end, is_two_way=is_two_way, **terms)


@dataclass(frozen=True, slots=True)
class Network:
    """Passages between the chambers."""

    name: str  # of the layout
    passages: tuple[Passage, ...]  # 1 to 16, with at most 47 numbers, the 17 of the body included
    has_floating_piston: bool = False  # 2 is at the gas pressure: a piston parts oil and gas
    # Of the surroundings on the rod, Pa: f = P_1 a_p1 - P_2 a_p2 + a_r P_amb + ...; the paper
    # leaves it out.
    ambient_pressure: float = 0.0

    def __post_init__(self) -> None:
        n_passages, n_numbers = len(self.passages), len(self.numbers)
        if not 1 <= n_passages <= _MOST_PASSAGES or n_numbers > _MOST_NUMBERS:
            raise ConfigurationError(
                f"{self.name} has {n_passages} passages and {n_numbers} numbers; a network has 1 "
                f"to {_MOST_PASSAGES} passages and at most {_MOST_NUMBERS} numbers, "
                f"{len(BODY_NUMBERS)} of them the body's",
                code="too-large",
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
    """What a valve is made of: a bleed that is always open, and a blow-off beside it."""

    bleed: str = "orifice"  # one of `BLEEDS`: none, orifice, leak or long (laminar and turbulent)
    blow_off: str = "linear"  # one of `BLOW_OFFS`: none, linear, rounded, port or power

    def __post_init__(self) -> None:
        kinds = (self.bleed, BLEEDS, "bleed"), (self.blow_off, BLOW_OFFS, "blow-off")
        for kind, known, what in kinds:
            if kind not in known:
                text = (
                    f"no {what} {kind!r}; there are {', '.join(known)}.{did_you_mean(kind, known)}"
                )
                raise ConfigurationError(text, code="unknown-law")
        if not self.parts:
            text = "a valve needs a bleed or a blow-off; both are 'none'"
            raise ConfigurationError(text, code="no-passage")

    @property
    def parts(self) -> tuple[str, ...]:
        """The numbers that it has, by their names in `PARTS`."""
        return (*BLEEDS[self.bleed].parts, *BLOW_OFFS[self.blow_off].parts)

    def passages(
        self, start: int, end: int, stroke: str, *, is_two_way: bool = True
    ) -> tuple[Passage, ...]:
        """Return its passages; a bleed lets oil back, a blow-off does not."""
        parts = BLEEDS[self.bleed].parts, BLOW_OFFS[self.blow_off].parts
        bleed = Passage.of_parts(start, end, stroke, parts[0], is_two_way=is_two_way)
        blow_off = Passage.of_parts(start, end, stroke, parts[1])
        return tuple(passage for passage in (bleed, blow_off) if any(passage.numbers))


@lru_cache(maxsize=8)  # a fit asks for it at every simulation
def purdy(ambient_pressure: float = 0.0) -> Network:
    """Return the paper's layout: an orifice 1-3, linear checks 2 to 1 and 3 to 2."""
    orifice = Passage(1, 3, orifice="r_m1", is_two_way=True)
    checks = Passage(2, 1, resistance="r_m2"), Passage(3, 2, resistance="r_m3")
    return Network("purdy", (orifice, *checks), ambient_pressure=ambient_pressure)


def law_flow(parts: Mapping[str, float], drop: FloatArray, density: float) -> FloatArray:
    """Return the flow through bleed and blow-off of a valve, m3/s at rest's density.

    Of its parts by their names in `PARTS`, the pressure across it, Pa, not negative, and kg/m3.

    Examples
    --------
    >>> law_flow({"opening": 1e5, "slope": 1e6}, np.array([5e4, 1e5, 3e5]), 850.0) * 850.0
    array([0. , 0. , 0.2])
    """

    def through(pressed: FloatArray, linear: float, root: float) -> FloatArray:
        """The mass flow w of pressed = linear w + (root w)^2."""
        below = linear + np.sqrt(linear**2 + 4.0 * root**2 * pressed)
        return 2.0 * pressed / np.maximum(below, 1e-300)

    total = np.zeros_like(drop)
    if "bleed" in parts or "leak" in parts:
        total += through(drop, parts.get("leak", 0.0), parts.get("bleed", 0.0))
    if "slope" in parts:
        opening, width = parts["opening"], parts.get("width", 0.0)
        beyond = np.maximum(drop - opening, 0.0)
        if width:  # a stack of discs lifts gradually
            lifted = np.logaddexp(0.0, (drop - opening) / width)
            beyond = width * np.maximum(lifted - np.logaddexp(0.0, -opening / width), 0.0)
        beyond = _S_0 * (beyond / _S_0) ** (1.0 / parts.get("power", 1.0))
        total += through(beyond, parts["slope"], parts.get("port", 0.0))
    return np.asarray(total / density)


_S_0 = 1e6  # Pa, where a power changes nothing


_ROOM = 1 << 14  # bytes; of the core's state, which it refuses if it is less than that


@dataclass(frozen=True, slots=True, eq=False)
class Step(Motion):
    """One step of a motion that goes on from `state`, two samples; of one sample its beginning."""

    state: bytearray = field(default_factory=lambda: bytearray(_ROOM))


def simulate_network(
    network: Network,
    values: Mapping[str, float],
    damper: Cylinder,
    motion: Motion,
    *,
    sensitivities: Sequence[str] = (),
    options: SolverOptions = SolverOptions(),
) -> Response:
    """Simulate a damper of any layout that is driven by a displacement.

    The start has one pressure in all chambers and the oil mass of x = 0; the steady cycle is
    reached within one cycle from there. The core integrates by TR-BDF2 with a step that adapts to
    the reversals, and differentiates every converged stage, so that the sensitivities are those of
    the numbers it returns.

    Values, and sensitivities of the force by them, are by the names of ``network.numbers``, in SI.
    Of the body's own only ``k_e`` and ``f_f`` are needed: free gas and offset are 0, the gas is the
    damper's, the mounting rigid. With a floating piston the second mass of the response is that of
    chamber 2 at rest.

    Raises
    ------
    ConfigurationError
        A number is missing or unknown.
    SimulationError
        A state is not finite, a chamber has no volume left, the step limit is met, a number is
        negative or not finite, or a passage has no resistance.

    Examples
    --------
    >>> from damperfit.damper.purdy.parameters import PURDY_DAMPER
    >>> from damperfit.simulation import sine_motion
    >>> y = {"r_m1": 1.8e4, "r_m2": 3.527e6, "r_m3": 2.597e6, "k_e": 3.65e8, "f_f": 50.0}
    >>> motion = sine_motion(0.032, 1.5, cycles=4, sample_rate=1500)
    >>> round(float(simulate_network(purdy(), y, PURDY_DAMPER, motion).force[3100]))
    673
    """
    place, passages = _layout(network)
    numbers = array("d", bytes(8 * len(place)))
    own = {name: getattr(damper, name) for name in ("gas_pressure", "gas_exponent", "gas_volume")}
    try:
        for name, number in (own | dict(values)).items():
            numbers[place[name]] = number
        which = array("i", [place[name] for name in sensitivities])
    except KeyError as unknown:
        (name,) = unknown.args
        raise ConfigurationError(
            f"no number {name!r} in {network.name}; there are {', '.join(place)}."
            f"{did_you_mean(name, place)}",
            code="unknown-quantity",
        ) from None
    missing = [n for n in (*_NEEDED, *network.passage_numbers) if n not in values]
    if missing:
        raise ConfigurationError(
            f"{network.name} needs a value of {', '.join(missing)}", code="missing-value"
        )
    x = np.ascontiguousarray(motion.displacement, dtype=np.float64)
    v = np.ascontiguousarray(motion.velocity, dtype=np.float64)
    jumps = np.ascontiguousarray(motion.jumps, dtype=np.float64)
    n = len(x)
    # One block: of many the C library gives each back to the system, and its pages come anew.
    block = np.empty((6 + len(which), n))
    pressures, masses, force, rows = block[:3], block[3:5], block[5], block[6:]
    body = array(
        "d",
        (
            damper.annulus_area, damper.piston_area, damper.chamber_1_volume,
            damper.chamber_2_volume, damper.oil_density, damper.rod_area * network.ambient_pressure,
        ),
    )  # fmt: skip
    state = (motion.state,) if isinstance(motion, Step) else ()
    code, steps, rejected, newton, sample = compiled_core().simulate_network(
        body, numbers, passages, x, v, jumps, which, pressures, masses, force, rows,
        motion.interval, options.rounding, network.has_floating_piston, options.tolerance,
        options.dead_band, options.max_steps_per_sample, *state,
    )  # fmt: skip
    if code:
        raise SimulationError(describe_ending(code, sample, motion, options), code="not-integrated")
    time = np.arange(n, dtype=np.float64)
    time *= motion.interval
    time += motion.start_time
    slopes = dict(zip(sensitivities, rows, strict=True))
    return Response(time, x, v, force, pressures, masses, slopes, Work(steps, rejected, newton))


@lru_cache(maxsize=64)  # a fit asks for it at every simulation
def _layout(network: Network) -> tuple[dict[str, int], NDArray[np.intc]]:
    """Where each number stands, and the passages as the core reads them."""
    place = {name: k for k, name in enumerate(network.numbers)}
    numbers = ([place.get(name, -1) for name in p.numbers] for p in network.passages)
    rows = zip(network.passages, numbers, strict=True)
    return place, np.array([[p.start, p.end, *own, p.is_two_way] for p, own in rows], dtype=np.intc)


# A damper that another program steps, in the core's own numerics.


def without_rig(values: Values) -> Values:
    """Return the values of the damper alone, as it is in a car: without mounting and tare."""
    rig = [q.name for q in values.quantities if q.scope == RIG or q.is_offset]
    return values.replace(dict.fromkeys({*rig, *OF_LOAD_CELL}.intersection(values.names), 0.0))


class SteppedDamper:
    """One setting, stepped by a program of the user's, as by the solver of a car.

    It begins at rest, all chambers at one pressure. Steps may be of any length: the core divides
    them as its tolerance asks. `copy` keeps a state to go back to, as after a rejected step.

    Parameters
    ----------
    damper, values : Model, Values
        Of the paper's damper or one of valves.
    x : float
        Displacement from mid-stroke at the beginning, m.
    with_rig : bool
        With the mounting and the tare; by default the damper alone. Lag and mass of a load cell
        are never in it.

    Raises
    ------
    ConfigurationError
        The model has no chambers that could be stepped.
    SimulationError
        The core cannot go there: `step`.
    """

    def __init__(
        self,
        damper: Model,
        values: Values,
        *,
        x: float = 0.0,
        options: SolverOptions = SolverOptions(),
        with_rig: bool = False,
    ) -> None:
        if not damper.signals:
            raise ConfigurationError(
                f"the model {damper.name} has no chambers that could be stepped; simulate it",
                code="other-model",
            )
        own = values if with_rig else without_rig(values)
        own = own.replace({name: 0.0 for name in values.names if name in OF_LOAD_CELL})
        self._how = (damper, own, options)
        self._at = (x, 0.0)
        self._state = bytearray(_ROOM)
        self.force, self.pressures = self._run(1.0, [x], [0.0])

    def step(self, x: float, v: float, dt: float) -> float:
        """Go on to x, m, and v, m/s, a time dt, s, later; return the force, N.

        Between them x is the cubic piece through both (x, v). `pressures` are then those there.
        """
        (x_0, v_0) = self._at
        self.force, self.pressures = self._run(dt, [x_0, x], [v_0, v])
        self._at = (x, v)
        return self.force

    def copy(self) -> Self:
        """Return the same damper in the same state, apart from this one."""
        return copy(self)  # a step makes a state of its own

    def _run(self, dt: float, x: list[float], v: list[float]) -> tuple[float, NDArray[np.float64]]:
        damper, values, options = self._how
        motion = Step(dt, np.array(x), np.array(v), state=bytearray(self._state))
        seen = damper.simulate(values, motion, sensitivities=(), options=options)
        self._state = motion.state  # not before: a step that is refused leaves all as it was
        return float(seen.force[-1]), np.array(seen.pressures[:, -1])
