"""What a rig and the seals may have, each part absent, found by the fit, or known.

Mounting. Rod ends, frame and load cell give by 1/k_s in series with the damper (125 to 1900 N/mm
are found on rigs), joints have play (0.3 to 2 mm), and the force channel may be late (a first-order
filter of 8 to 14 ms is found). Without them soft oil, friction and even a blow-off are invented to
take their place. Rubber holds a force beside that spring, whichever way it was bent last, over 0.1
to 2 mm: a hysteresis that does not ask for the speed. At one frequency a lag and an elasticity look
alike; several speeds part them. A load cell at the end that moves also reads what it takes to move
the mass between it and the damper: 8 N a kilogram at 3 Hz and 22 mm, 21 N at 10 Hz and 5.4 mm. At
one frequency that looks like a softer gas spring.

Friction of seals and bearings beyond Coulomb's. While it slides it is
f_f + f_b exp(-(v/v_s)^2) + a_s P_1: Coulomb's, what it has more at rest (Stribeck), and what the
pressure on the rod's seal adds. It turns with the motion at once, within a speed (a film of oil
carries a part of it below), or over a distance (Dahl). The equations stand in
`damperfit.damper.network`. Loops seldom separate them from soft oil and bleeds: a friction that
changes with the clicks is none. Forms that are not excluded count by how much it matters that
they are not known (`with_pressed_seal`, `other_turns`).

Pressed: a lip that is pressed on the rod rubs with a_s P_1. In rebound that looks like a larger
piston, in bump like a smaller one: valves, of which only opening times area is seen, take it up
with no misfit left. So does Coulomb's friction what the gas adds at rest.

Turning: within which speed seals turn, and in what form, is seldom known: at once, in a straight
line up to a speed, or like the hyperbolic tangent of tests on seals. Slow passages separate
them; elsewhere the difference looks like a drag of the seals, of the opposite sign to the
friction's.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Literal

import numpy as np

from damperfit.arrays import FloatArray
from damperfit.compiled_core import compiled_core
from damperfit.damper.model import DAMPER, RIG, Model, Quantity, Values
from damperfit.damper.temperature_law import WithTemperature
from damperfit.errors import ConfigurationError
from damperfit.recording import Trace
from damperfit.simulation import Motion, Response

NONE, FIT = "none", "fit"
_OF_MOUNTING: dict[str, Quantity] = {
    "series_stiffness": Quantity(
        "k_s", "k_s", "series stiffness", "stiffness of rod ends, frame and load cell", "N/m",
        (1e3, 1e10), scope=RIG, power=3, shown_unit="N/mm", believable=(2e4, math.inf),
        belief="rigs have 125 to 1900 N/mm", ideal=0.0,  # the core's rigid one
        idle="above",
    ),
    "rubber": Quantity(
        "rubber", "f_m", "rubber of the mounting", "force that a mounting of rubber holds", "N",
        (1e-2, 1e5), scope=RIG, may_vanish=True, shown_unit="N", believable=(0.0, 2e3),
        belief="rubber of mountings holds up to a tenth of the force", ideal=0.0, idle="below",
    ),
    "rubber_bend": Quantity(
        "rubber_bend", "s_m", "bend of the rubber", "deflection over which it reverses", "m",
        (1e-6, 1e-2), scope=RIG, power=-3, shown_unit="mm", believable=(0.0, 3e-3),
        belief="rubber reverses within 0.1 to 2 mm", idle="above below",
    ),
    "play": Quantity(
        "play", "play", "play", "whole gap of the joints", "m", (1e-6, 1e-2), scope=RIG,
        power=-3, shown_unit="mm", believable=(0.0, 5e-3), belief="joints have 0.3 to 2 mm",
        ideal=0.0, idle="below",
    ),
    "lag": Quantity(
        "lag", "T", "lag of the force", "lag of the force channel, first order", "s",
        (1e-5, 5e-2), scope=RIG, power=-3, shown_unit="ms", believable=(0.0, 0.025),
        belief="force channels have 8 to 14 ms", ideal=0.0, idle="below",
    ),
    "moving_mass": Quantity(
        "moving_mass", "m", "moving mass", "mass of what moves between load cell and damper", "kg",
        (1e-4, 1e3), scope=RIG, shown_unit="kg", believable=(0.0, 30.0),
        belief="rods, bodies and fixtures have 0.1 to 20 kg", ideal=0.0, idle="below",
    ),
}  # fmt: skip
_OF_FRICTION: dict[str, Quantity] = {
    "presliding": Quantity(
        "presliding", "s_f", "presliding", "distance over which friction builds up", "m",
        (1e-7, 1e-2), scope=DAMPER, power=-6, shown_unit="µm", believable=(0.0, 1e-3),
        belief="seals slide after 5 to 500 µm", ideal=0.0, idle="below",
    ),
    "breakaway": Quantity(
        "breakaway", "f_b", "breakaway", "friction at rest above that of sliding", "N",
        (1e-3, 1e4), scope=DAMPER, may_vanish=True, shown_unit="N", believable=(0.0, 200.0),
        belief="seals of car dampers stick with less than 200 N", idle="below",
    ),
    "stribeck_speed": Quantity(
        # Below 5 mm/s a sine passes within a few samples, and any height fits beside a low speed.
        "stribeck_speed", "v_s", "Stribeck speed", "speed at which a third of it is left", "m/s",
        (5e-3, 0.2), scope=DAMPER, power=-3, shown_unit="mm/s", believable=(0.0, 0.2),
        belief="seals slide freely above 5 to 100 mm/s", idle="above below",
    ),
    "seal_area": Quantity(
        "seal_area", "a_s", "pressed friction", "friction by the pressure on the rod's seal", "m2",
        (1e-9, 1e-2), scope=DAMPER, may_vanish=True, power=-6, shown_unit="mm²",
        believable=(0.0, 5e-5),
        belief="rod seals have less than 50 mm²", idle="below",
    ),
    "turning_speed": Quantity(
        "turning_speed", "v_t", "turning speed", "speed within which friction reverses", "m/s",
        (1e-5, 0.1), scope=DAMPER, power=-3, shown_unit="mm/s", believable=(0.0, 0.02),
        belief="seals slide with all their friction from 0.1 to 20 mm/s on", idle="below",
    ),
}  # fmt: skip


class _Parts:
    """Fields that are "none", "fit" or a number; which they may be stands in a table."""

    __slots__ = ()

    known: ClassVar[dict[str, Quantity]]

    def __post_init__(self) -> None:
        """Refuse what is no such number."""
        for name, quantity in self.known.items():
            value = getattr(self, name)
            low, high = quantity.plausible
            if isinstance(value, bool) or not isinstance(value, float | int):
                if value not in (NONE, FIT):
                    raise ConfigurationError(
                        f"{name}: found {value!r}; expected a number, {NONE!r} or {FIT!r}",
                        code="not-a-number",
                    )
            elif not low <= float(value) <= high:
                raise ConfigurationError(
                    f"found {float(value):g}; expected {low:g} to {high:g} {quantity.unit}, "
                    f"{NONE!r} or {FIT!r}",
                    subject=name,
                    code="out-of-range",
                )

    @property
    def quantities(self) -> tuple[Quantity, ...]:
        """What a fit may find of the parts that there are; what was measured is held."""
        there = ((getattr(self, name), quantity) for name, quantity in self.known.items())
        return tuple(
            quantity if part == FIT else replace(quantity, default=float(part))
            for part, quantity in there
            if part != NONE
        )


@dataclass(frozen=True, slots=True)
class Mounting(_Parts):
    """Which of the mounting's parts there are; each is "none", "fit", or known, in SI."""

    series_stiffness: str | float = FIT  # k_s, N/m; "none" is rigid
    play: str | float = NONE  # whole gap of the joints, m; needs an elasticity
    lag: str | float = NONE  # of the force channel, first order, s
    # Of what moves between load cell and damper, the moving part of the damper included, kg.
    moving_mass: str | float = NONE
    rubber: str | float = NONE  # force that rubber holds whichever way it was bent last, N,
    rubber_bend: str | float = NONE  # and the distance over which it turns, m

    known = _OF_MOUNTING

    def __post_init__(self) -> None:
        """Refuse what no mounting is."""
        _Parts.__post_init__(self)
        is_rubber = self.rubber != NONE
        is_held = self.series_stiffness != NONE
        if is_rubber is not (self.rubber_bend != NONE) or (is_rubber and not is_held):
            raise ConfigurationError(
                "rubber and rubber_bend are two numbers of one thing beside a series stiffness: "
                "set both, each to 'fit' or to a value, or neither",
                subject="rubber",
                code="half-a-pair",
            )
        if self.play != NONE and not is_held:
            raise ConfigurationError(
                "play needs a series stiffness that takes the force once the gap is closed: "
                f"set series_stiffness to {FIT!r} or to a value",
                code="half-a-pair",
            )


@dataclass(frozen=True, slots=True)
class Friction(_Parts):
    """Which parts there are beside Coulomb's; each is "none", "fit", or known, in SI."""

    presliding: str | float = NONE  # distance over which it builds up, m
    breakaway: str | float = NONE  # what it has more at rest, N; needs a Stribeck speed
    stribeck_speed: str | float = NONE  # m/s
    seal_area: str | float = NONE  # what the pressure above the piston adds, m2
    # Speed up to which it grows from nothing, m/s; not beside presliding.
    turning_speed: str | float = NONE

    known = _OF_FRICTION

    def __post_init__(self) -> None:
        """Refuse what is no friction."""
        _Parts.__post_init__(self)
        if NONE not in {self.presliding, self.turning_speed}:
            raise ConfigurationError(
                "turning_speed: found beside presliding; friction turns over a distance or within "
                "a speed: set one of the two and leave the other at 'none'",
                code="not-together",
            )
        if (self.breakaway == NONE) is not (self.stribeck_speed == NONE):
            missing = "stribeck_speed" if self.stribeck_speed == NONE else "breakaway"
            raise ConfigurationError(
                "found 'none'; breakaway and stribeck_speed are two numbers of one "
                "thing: set both, each to 'fit' or to a value, or neither",
                subject=missing,
                code="half-a-pair",
            )


# m2, one standard error: a lip of 0.5 mm on a rod of 12 mm is 19 mm2, of which oil leaves a tenth
# or two to friction.
_AREA = 3e-6
# m/s, for a friction that is taken to turn at once: seals turn within 0.5 to 5 mm/s.
_WITHIN = 1.5e-3
# A mean of straight lines up to speeds spread like this is v/v_t to tanh(v/v_0), v_t = 1.386 v_0:
# two lines at mean and spread of the density -a d/da sech^2(a/v_0)/v_0 of their ends.
_SPREAD = 0.53


def with_pressed_seal(damper: Model, values: Values) -> tuple[Model, Values] | None:
    """Return the damper with a seal that is pressed, by a `seal_area` of one standard error.

    None where the law has such a seal, or no valves.
    """
    friction = _friction_of(damper)
    if friction is None or friction.seal_area != NONE:
        return None
    return _with(damper, values, seal_area=_AREA)


def other_turns(damper: Model, values: Values) -> tuple[tuple[float, Model, Values], ...]:
    """Return the damper with a friction that turns in another form, as (weight, damper, values).

    The force of that form is the sum of these, each times its weight. Empty where there is no
    friction, or it builds up over a distance.
    """
    friction = _friction_of(damper)
    if friction is None or not values.f_f or friction.presliding != NONE:
        return ()
    if friction.turning_speed != NONE:
        ends = (values.turning_speed * (1.0 + away) for away in (-_SPREAD, _SPREAD))
        return tuple((0.5, damper, values.replace(turning_speed=end)) for end in ends)
    return ((1.0, *_with(damper, values, turning_speed=_WITHIN)),)


def _friction_of(damper: Model) -> Friction | None:
    """That of a damper of valves; their module is not loaded to learn that it is none."""
    friction = getattr(damper.plain, "friction", None)
    return friction if isinstance(friction, Friction) else None


def _with(damper: Model, values: Values, **part: float) -> tuple[Model, Values]:
    """The damper with a part of friction that is known."""
    own: Any = damper.plain
    changed: Model = replace(own, friction=replace(own.friction, **part))
    if isinstance(damper, WithTemperature):
        changed = replace(damper, damper=changed)
    return changed, changed.values({**dict(values), **part})


# What a load cell and its channel make of a damper's force: moving mass, then the lag.
#
# Neither is a state of the compiled core: both stand behind the damper and its mounting. What moves
# between load cell and damper takes its mass times the acceleration, f_cell = f + m a, positive in
# rebound as f is. The mounting's give is left out of a: 3 % at a sixth of the frequency at which
# the mass rings on it. The channel behind the cell, an amplifier's filter, is late by
# T df_read/dt + f_read = f, and so is each derivative of the force. Between the samples the force
# is taken as a straight line, for which the step below is exact whatever the lag is against the
# interval::
#
#     g_k = a g_k-1 + b f_k + c f_k-1     q = h/T,  a = e^-q,  m = (1 - a)/q,  b = 1 - m,  c = m - a

OF_LOAD_CELL = ("moving_mass", "lag")

# A lag of less than this share of the interval changes no sample by its last digit.
_NO_LAG = 1e-3


def behind_lag(rows: FloatArray, interval: float, lag: float) -> FloatArray:
    """Return signals, a row of (k, n) each, behind a first-order lag, at rest before the first.

    Interval and lag are in s; a lag of 0 passes everything.

    Examples
    --------
    >>> step = np.array([[0.0, 1.0, 1.0, 1.0]])
    >>> behind_lag(step, 1.0, 1.0).round(3)
    array([[0.   , 0.368, 0.767, 0.914]])
    """
    if lag <= _NO_LAG * interval:
        return rows
    rows = np.ascontiguousarray(rows, dtype=np.float64)
    late = np.empty_like(rows)
    q = interval / lag
    a, mean = math.exp(-q), -math.expm1(-q) / q
    compiled_core().behind_lag(rows, late, len(rows), a, 1.0 - mean, mean - a)
    return late


def lag_slope(force: FloatArray, read: FloatArray, interval: float, lag: float) -> FloatArray:
    """Return the derivative of a signal, as read behind a lag, by the lag, per second; all (n,)."""
    lag = max(lag, _NO_LAG * interval)
    q = interval / lag
    a = math.exp(-q)
    by_a = a * q / lag
    by_mean = (1.0 - a) / interval - by_a / q
    driven, slope = np.zeros((2, 1, len(force)))
    driven[0, 1:] = by_a * (read[:-1] - force[:-1]) - by_mean * np.diff(force)
    compiled_core().behind_lag(driven, slope, 1, a, 1.0, 0.0)
    return np.asarray(slope[0])


def acceleration(velocity: FloatArray, interval: float) -> FloatArray:
    """Return the acceleration at uniform samples of a velocity, m/s2; 0 of a single sample.

    The difference of the speeds beside a sample, so that a jump of the speed keeps its momentum.

    Examples
    --------
    >>> acceleration(np.array([0.0, 0.1, 0.4, 0.9]), 0.1).round(12)
    array([0., 2., 4., 6.])
    """
    if len(velocity) == 1:
        return np.zeros(1)
    at_ends: Literal[1, 2] = 1 if len(velocity) == 2 else 2
    return np.asarray(np.gradient(np.asarray(velocity), interval, edge_order=at_ends))


def as_read(
    response: Response,
    motion: Motion,
    sensitivities: Sequence[str],
    *,
    moving_mass: float | None = None,
    lag: float | None = None,
) -> Response:
    """Return a response with the force, and the wanted derivatives in their order, as logged.

    The response is that of the damper on its mounting, with the sensitivities that the core has;
    kg and s; None: the model has none.
    """
    force, slopes = response.force, dict(response.sensitivities)
    if moving_mass is not None:
        slopes["moving_mass"] = acceleration(motion.velocity, motion.interval)
        force = force + moving_mass * slopes["moving_mass"]
    slopes = {name: slopes[name] for name in sensitivities if name in slopes}
    if lag is not None:
        before, rows = force, np.stack([force, *slopes.values()])
        late = behind_lag(rows, motion.interval, lag)
        force, slopes = late[0], dict(zip(slopes, late[1:], strict=True))
        if "lag" in sensitivities:
            slopes["lag"] = lag_slope(before, force, motion.interval, lag)
    ordered = {name: slopes[name] for name in sensitivities}
    return replace(response, force=force, sensitivities=ordered)


def before_load_cell(trace: Trace, *, moving_mass: float = 0.0, lag: float = 0.0) -> Trace:
    """Return a log with the force that the damper had, of that which was logged; kg and s."""
    force = trace.force
    if lag:
        force = force + lag * np.gradient(force, trace.interval)
    if moving_mass:
        force = force - moving_mass * acceleration(trace.velocity, trace.interval)
    return trace if force is trace.force else replace(trace, force=force)
