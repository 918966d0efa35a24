"""A damper with oil in two chambers of a cylinder, a rod through one of them, and gas."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from numbers import Real
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from damperfit.damper.model import (
    DAMPER,
    FLAWS_OF_FORCE,
    FLAWS_OF_OIL,
    FRICTION,
    OFFSET,
    PRESSURES,
    RIGID,
    STIFFNESS,
    Model,
    Quantity,
    Signal,
)
from damperfit.errors import ConfigurationError, SimulationError, did_you_mean
from damperfit.problem import Key
from damperfit.simulation import Response, SolverOptions, motion_of, simulate

if TYPE_CHECKING:
    from damperfit.damper.model import Names, Values
    from damperfit.damper.network import Network
    from damperfit.damper.purdy.parameters import Damper
    from damperfit.recording import Trace
    from damperfit.simulation import Motion
    from damperfit.tested.setting import Setting

AMBIENT = 101325.0  # Pa, of the air

# What any damper has, from a model car's to a bridge's, with room to spare, in SI. What lies
# outside was misread: mm as m, bar as Pa. Pressures are absolute, hence never nothing.
RANGES: dict[str, tuple[float, float, str]] = {
    "rod_diameter": (1e-3, 0.5, "m"),
    "piston_diameter": (2e-3, 1.0, "m"),
    "gas_piston_diameter": (2e-3, 1.0, "m"),
    "chamber_1_length": (2e-3, 5.0, "m"),
    "chamber_2_length": (2e-3, 5.0, "m"),
    "gas_length": (1e-3, 5.0, "m"),
    "oil_density": (500.0, 2000.0, "kg/m3"),
    "gas_pressure": (1e4, 1e8, "Pa"),
    "gas_volume": (1e-8, 1.0, "m3"),
    "gas_exponent": (1.0, 1.67, ""),  # slow compression of any gas, fast of one with single atoms
    "ambient_pressure": (0.0, 1e7, "Pa"),
}

K_E = Quantity(
    "k_e", "K_e", "bulk modulus of oil and chamber",
    "effective bulk modulus of oil, air and tube", "Pa", (1e6, 1e11), power=6, shown_unit="MPa",
    # Eq. (28): 2 % of free gas at 4.6 bar leave 31 MPa. No oil is stiffer than twice mineral oil.
    believable=(3e7, 3e9), belief="oil has 1500 MPa, and 30 with 2 % of free gas in it",
    role=STIFFNESS, ideal=RIGID,
)  # fmt: skip
F_F = Quantity(
    "f_f", "f_f", "friction", "Coulomb friction of seals and bearings", "N", (1e-3, 1e4),
    scope=DAMPER, may_vanish=True, shown_unit="N", role=FRICTION,
)  # fmt: skip
# A force offset is about as much as the rod's gas force.
F_0 = Quantity(
    "f_0", "f_0", "force offset", "constant offset added to the force, the rig's tare", "N",
    (-math.inf, math.inf), is_logarithmic=False, size=100.0, shown_unit="N", role=OFFSET,
)  # fmt: skip


class Cylinder(Model):
    """What follows from the diameters and the chambers' lengths at x = 0, all in m.

    Raises
    ------
    ConfigurationError
        A value is outside `ranges`, or the rod is as wide as the piston.
    """

    __slots__ = ()

    signals: ClassVar[tuple[Signal, ...]] = PRESSURES
    flaws: ClassVar[tuple[str, ...]] = (*FLAWS_OF_FORCE, *FLAWS_OF_OIL)
    rounding: ClassVar[float | None] = None  # of its orifices' roots, Pa; None: the solver's

    if TYPE_CHECKING:
        rod_diameter: float
        piston_diameter: float
        chamber_1_length: float
        chamber_2_length: float
        oil_density: float
        gas_pressure: float
        gas_exponent: float
        ambient_pressure: float

        @property
        def gas_volume(self) -> float: ...  # noqa: D102

    def __post_init__(self) -> None:
        """Refuse what is no damper."""
        for name, (low, high, unit) in self.ranges.items():
            value, in_unit = getattr(self, name), f" {unit}" if unit else ""
            if not isinstance(value, Real):
                wanted = f"a number{' in' if unit else ''}{in_unit}, found {value!r}"
            elif not low <= float(value) <= high:
                wanted = f"{low:g} to {high:g}{in_unit}, found {value:g}{in_unit}"
            else:
                continue
            raise ConfigurationError(f"expected {wanted}", where=Key((name,)), code="out-of-range")
        if self.rod_diameter >= self.piston_diameter:
            raise ConfigurationError(
                f"expected less than piston_diameter, "
                f"{self.piston_diameter:g} m, found {self.rod_diameter:g} m",
                where=Key(("rod_diameter",), ("piston_diameter",)),
                code="out-of-range",
            )

    @property
    @abstractmethod
    def network(self) -> Network:
        """Its passages."""

    @property
    def piston_area(self) -> float:
        """a_p2, full bore, m2."""
        return math.pi / 4.0 * self.piston_diameter**2

    @property
    def rod_area(self) -> float:
        """a_r, m2."""
        return math.pi / 4.0 * self.rod_diameter**2

    @property
    def annulus_area(self) -> float:
        """a_p1 = a_p2 - a_r, m2."""
        return self.piston_area - self.rod_area

    @property
    def chamber_1_volume(self) -> float:
        """V_10, rod side at x = 0, m3."""
        return self.chamber_1_length * self.annulus_area

    @property
    def chamber_2_volume(self) -> float:
        """V_20, full-bore side at x = 0, m3."""
        return self.chamber_2_length * self.piston_area

    @property
    def chamber_lengths(self) -> tuple[float, float]:
        """l_1 and l_2, m."""
        return self.chamber_1_length, self.chamber_2_length

    @property
    def travel(self) -> float:
        """Length of the shorter chamber, m."""
        return min(self.chamber_lengths)

    @property
    def gas(self) -> tuple[float, float, float, float, float]:
        """Rod area, gas pressure, gas volume, gas exponent, ambient pressure, SI."""
        gas = self.gas_pressure, self.gas_volume, self.gas_exponent
        return self.rod_area, *gas, self.ambient_pressure

    def simulate(
        self, values: Values, motion: Motion, *, sensitivities: Names, options: SolverOptions
    ) -> Response:
        """Integrate the network and its mounting; the force passes load cell and channel."""
        from damperfit.damper.mounting import OF_LOAD_CELL, as_read
        from damperfit.damper.network import simulate_network

        known = (*values.names, *self.conditions)
        for name in sensitivities:
            if name not in known:
                raise SimulationError(
                    f"no sensitivity by {name!r}; there are {', '.join(known)}."
                    f"{did_you_mean(name, known)}",
                    code="unknown-quantity",
                )
        if self.rounding is not None:
            options = replace(options, rounding=self.rounding)
        # A test's gas pressure over the declared one.
        filled = 1.0 if motion.gas_pressure is None else motion.gas_pressure / self.gas_pressure
        numbers = {"gas_pressure": self.gas_pressure, **dict(values)}
        numbers["gas_pressure"] *= filled
        rig = {name: numbers.pop(name) for name in OF_LOAD_CELL if name in numbers}
        own = [name for name in sensitivities if name not in rig]
        response = simulate_network(
            self.network, numbers, self, motion, sensitivities=own, options=options
        )
        if "gas_pressure" in own:
            response.sensitivities["gas_pressure"] *= filled
        return as_read(response, motion, sensitivities, **rig) if rig else response


# Where and when a chamber is empty, or how far it is from that.
#
# Of the paper's damper: lowest pressure, margin of R_m3, safe gas pressure. Chamber 2 is filled in
# rebound through valve 3, so that with little oil stored in compression::
#
#     P_2 = P_3 - rho_0 R_m3 a_p2 v,     P_3 in proportion to P_0
#
# Its lowest value falls in a straight line with R_m3 and rises in one with P_0: a response that
# does not cavitate shows where both lines meet zero, and two or three short simulations find it.

# By how much the factors may be looked for, and how exactly. The paper's own statement is "about
# 15 %": a tenth of a per cent is plenty.
_WIDEST_FACTOR, _TOLERANCE = 1e3, 1e-3
# s; the slowest of the pressures, at 80 1/s, has settled by then to 1e-8.
_SETTLING = 0.25
# The straight line is this good at the sample runs; a wider bracket follows where it is not.
_FIRST_STEP = 0.01


@dataclass(frozen=True, slots=True)
class Cavitation:
    """How far one setting's logs are from cavitation, with the fitted parameters."""

    fraction: float = math.nan  # share of the compared time with a chamber at zero pressure
    lowest_pressure: float = math.nan  # of any chamber in the compared time, absolute, Pa,
    chamber: int = 0  # where: chamber 1, 2 or 3,
    displacement: float = math.nan  # and when: x, m, and
    velocity: float = math.nan  # v, m/s; of a chamber at zero when it gets there
    # Fraction by which R_m3 may rise before a chamber cavitates on this motion; negative when it
    # must fall, NaN where no factor from 1/1000 to 1000 is at the edge.
    r_m3_margin: float = math.nan
    # Gas pressure P_0 at which a chamber just reaches zero on this motion, all else as it is,
    # absolute, Pa; NaN likewise. A lower one cavitates.
    safe_gas_pressure: float = math.nan

    @property
    def moment(self) -> str:
        """When the pressure is lowest, in words."""
        x, v = f"x = {1e3 * self.displacement:+.0f} mm", f"v = {self.velocity:+.2f} m/s"
        return f"{x}, {v} in {'rebound' if self.velocity > 0.0 else 'compression'}"


def describe_cavitation(
    settings: Mapping[Setting, Cavitation], *, doubted: Collection[Setting] = ()
) -> tuple[str, ...]:
    """Return what there is to say of cavitation, a sentence each: those that do, then the rest.

    Of what the fitted model shows; in settings that are doubted it does not match the logs, where
    its empty chamber is no evidence, and nothing is advised against it.
    """
    sentences = []
    for setting, state in sorted(settings.items()):
        if not state.fraction > 0.0:
            continue
        text = f"setting {setting}: {_share(state.fraction)} of the cycle with chamber "
        text += f"{state.chamber} at zero pressure, from {state.moment}"
        if setting in doubted:
            text += "; the model does not match these logs, so the damper itself may be full"
        elif not math.isnan(state.safe_gas_pressure):
            text += f"; it takes a gas pressure of {state.safe_gas_pressure / 1e5:.2f} bar absolute"
            if not math.isnan(state.r_m3_margin):
                text += f", or R_m3 lower by {_share(-state.r_m3_margin)},"
            text += " to keep it full"
        sentences.append(text)
    full = {setting: state for setting, state in settings.items() if state.fraction == 0.0}
    if full:  # by the one that is nearest to it
        setting, state = min(full.items(), key=lambda item: item[1].lowest_pressure)
        text = (
            f"{'elsewhere none does' if sentences else 'no chamber cavitates'}; lowest pressure "
            f"{state.lowest_pressure / 1e5:.2f} bar absolute, in chamber {state.chamber} of "
            f"setting {setting}, at {state.moment}"
        )
        if not math.isnan(state.r_m3_margin + state.safe_gas_pressure):
            text += (
                f"; there R_m3 may rise by {_share(state.r_m3_margin)}, or the gas pressure "
                f"fall to {state.safe_gas_pressure / 1e5:.2f} bar absolute, until a chamber "
                "cavitates on this motion"
            )
        sentences.append(text)
    return tuple(sentences)


def _share(fraction: float) -> str:
    return f"{100.0 * fraction:.2g} %"


def cavitation_in(
    seen: Sequence[tuple[Trace, Response]],
) -> tuple[Cavitation, Trace, Response, int]:
    """Return what the pressures of a setting's logs show, the log of the lowest, and its sample."""
    trace, response = min(seen, key=lambda log: float(log[1].pressures[:, log[0].compared].min()))
    part = trace.compared
    pressures = response.pressures[:, part]
    row, at = np.unravel_index(int(np.argmin(pressures)), pressures.shape)
    lowest, fraction = float(pressures[row, at]), 0.0
    if lowest <= 0.0:
        empty = [(r.pressures[:, t.compared] <= 0.0).any(axis=0) for t, r in seen]
        fraction = float(np.mean(np.concatenate(empty)))
        # The chamber that is longest at zero, and when it gets there.
        row = np.argmax(np.count_nonzero(pressures <= 0.0, axis=1))
        begins = np.flatnonzero(np.diff((pressures[row] <= 0.0).astype(np.int8)) > 0)
        at = begins[0] + 1 if len(begins) else np.intp(0)
    moment = int(part.start + at if isinstance(part, slice) else part[at])
    x, v = float(trace.displacement[moment]), float(trace.velocity[moment])
    return Cavitation(fraction, lowest, int(row) + 1, x, v), trace, response, moment


def examine_cavitation(
    parameters: Values,
    seen: Sequence[tuple[Trace, Response]],
    damper: Damper,
    *,
    solver: SolverOptions = SolverOptions(),
) -> Cavitation:
    """Return how far the logs of a setting are from cavitation, by what was simulated for each.

    The one with the lowest pressure is looked at closely.
    """
    from damperfit.damper.purdy.parameters import gas_pressure

    shown, trace, response, moment = cavitation_in(seen)
    # Largest (P_3 - P_2)/P_3 of the cycle: 1 at the onset of cavitation, small far from it.
    p_2, p_3 = response.pressures[1:, trace.compared]
    if float(p_2.min()) > 0.0:
        nearness = 1.0 - p_2 / p_3
    else:
        # While the clamp holds, the drop over valve 3 is not seen: that of incompressible oil.
        x, v = trace.displacement[trace.compared], trace.velocity[trace.compared]
        drop = damper.oil_density * parameters.r_m3 * damper.piston_area * v
        nearness = drop / gas_pressure(damper, x)
    line = max(float(np.max(nearness)), 1e-300)
    # The motion that leads there: of steady cycles the last, and as much before as it takes to
    # forget the start.
    segment = next(segment for segment in trace.segments if segment.first <= moment < segment.stop)
    first, n = 0, segment.n_samples
    if segment.n_cycles:
        n = round(n / segment.n_cycles)
        first = max(0, segment.stop - n - min(n, math.ceil(_SETTLING / trace.interval)))
    motion = motion_of(trace).until(first, segment.stop)

    def lowest(r_m3: float, gas: float) -> float:
        trial = parameters.replace(r_m3=r_m3 * parameters.r_m3)
        at = damper if gas == 1.0 else replace(damper, gas_pressure=gas * damper.gas_pressure)
        filled = simulate(trial, at, motion, options=solver).pressures[:2, -n:]
        # The pressure is clamped at zero; the share of time spent there gives the root a slope.
        least, empty = float(filled.min()), (filled <= 0.0).any(axis=0)
        return least if least > 0.0 else -at.gas_pressure * float(np.mean(empty))

    known = float(response.pressures[:2, trace.compared].min())
    margin = _root(lambda factor: lowest(factor, 1.0), 1.0 / line, known)
    safe = _root(lambda factor: lowest(1.0, factor), line, known)
    return replace(shown, r_m3_margin=margin - 1.0, safe_gas_pressure=safe * damper.gas_pressure)


def _root(lowest: Callable[[float], float], guess: float, known: float = math.nan) -> float:
    """Return the factor at which the lowest pressure is zero, near a guess; NaN when out of range.

    Where one simulation just before the guess shows that the line from factor 1, where the pressure
    is known, goes on to within a step of it, the line is followed. Else the bracket opens from the
    guess until the sign changes; then the false position (Illinois).
    """
    if not 1.0 / _WIDEST_FACTOR <= guess <= _WIDEST_FACTOR:
        return math.nan
    at = cache(lowest)
    try:
        near = guess / (1.0 + math.copysign(_FIRST_STEP, guess - 1.0))
        low, high = sorted((near, guess * guess / near))
        # A lever shorter than five steps would turn the line by more than the tolerance.
        if abs(near - 1.0) > 0.05 and 0.0 < at(near) < known:
            end = near + at(near) * (near - 1.0) / (known - at(near))
            if low <= end <= high:
                return end
        for step in (_FIRST_STEP, 0.05, 0.3, 1.0, 3.0, 7.0):
            low, high = guess / (1.0 + step), guess * (1.0 + step)
            if at(low) * at(high) <= 0.0:
                return _root_between(at, low, high, _TOLERANCE * guess)
    except (SimulationError, ConfigurationError):  # no such motion, or no such damper
        pass
    return math.nan


def _root_between(
    function: Callable[[float], float], low: float, high: float, tolerance: float
) -> float:
    """Return where a function changes its sign, by chords whose idle end counts half."""
    at_low, at_high = function(low), function(high)
    end, moved = math.nan, 0
    while at_low != at_high:
        last, end = end, (low * at_high - high * at_low) / (at_high - at_low)
        if abs(end - last) <= 0.1 * tolerance:
            break
        at_end = function(end)
        if at_end * at_high > 0.0:
            high, at_high = end, at_end
            at_low, moved = (0.5 * at_low if moved > 0 else at_low), 1
        else:
            low, at_low = end, at_end
            at_high, moved = (0.5 * at_high if moved < 0 else at_high), -1
    return end
