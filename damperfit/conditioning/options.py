"""What a user may say about filters, the rig, the centre and what counts as a steady cycle."""

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

from damperfit.errors import ConfigurationError
from damperfit.problem import Key
from damperfit.sections import ConditioningSection, RigSection

_OF_RIG = RigSection.entries()
_RIG_KEYS = {
    **{f"rig_{name}": _OF_RIG[name] for name in ("filter", "filter_corner", "filter_order")},
    **{name: _OF_RIG[name] for name in ("centre", "skew")},
}


@dataclass(frozen=True, slots=True, kw_only=True)
class NominalTest:
    """What the test was meant to be; findings compare with it, no number depends on it."""

    frequency: float | None = None  # Hz; None: not said
    amplitude: float | None = None  # m
    temperature: float | None = None  # degrees Celsius
    temperature_tolerance: float = math.inf  # degrees either way; infinite: none is asked for
    # The temperature is asked for only of logs with this frequency and amplitude, as that of the
    # paper's test, which is the default.
    is_of_motion: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class OffsetFacts:
    """What a fit makes of a constant force that the rig adds."""

    name: str = ""  # of that quantity; "": the model has none
    beside: tuple[str, ...] = ()  # what is free at each setting besides, for people
    is_known: bool = False  # it is fitted or held: a tared force is then no doubt


class GasFacts(NamedTuple):
    """What is known of the damper's gas: it pushes the rod out and so shows the signs of a log."""

    rod_area: float  # a_r, m2
    pressure: float  # P_0 at mid-stroke, Pa
    volume: float  # V_g0 there, m3
    exponent: float  # gamma
    ambient: float = 0.0  # of the air, which presses against it, Pa; the paper leaves it out

    @property
    def force(self) -> float:
        """Force that pushes the rod out at mid-stroke, a_r (P_0 - P_amb), N."""
        return self.rod_area * (self.pressure - self.ambient)

    @property
    def inside(self) -> float:
        """Force of the gas alone at mid-stroke, a_r P_0, N."""
        return self.rod_area * self.pressure


class ConditionOptions(ConditioningSection):
    """How a recording becomes a trace: [conditioning], and what conditioning asks of the rest.

    What each filter does stands in `damperfit.conditioning.filters`.
    """

    filter_corner: float  # Hz
    auto_corner: bool = False  # it follows the fastest motion of each log
    # What the rig has already done to both channels. "causal": an ordinary filter of the samples,
    # both channels late by its delay. "zero_phase": forward and backward. "analogue": as causal,
    # but before they are taken, or at a far higher rate.
    rig_filter: str = "none"
    rig_filter_corner: float = 30.0  # Hz, of one pass
    rig_filter_order: int = 4
    centre: float | None = None  # x = 0 of the model, as the log counts it, m; None: mid-stroke
    # What the force is late against the displacement, s, beyond what a declared rig filter does to
    # both; corrected. "auto": as estimated, where the log determines it.
    skew: float | str = 0.0
    # With it the gas force shows the signs of the channels, and whether the force was tared.
    gas: GasFacts | None = None
    offset: OffsetFacts = OffsetFacts()  # what a fit knows of a constant force of the rig's
    # l_1 and l_2 of the damper, m: a stroke beyond the chambers is refused.
    chamber_lengths: tuple[float, float] | None = None
    has_free_k_e: bool = True  # whether a fit finds it: noise of the displacement bends it
    nominal: NominalTest = NominalTest()  # what the test was meant to be, for findings

    def __init__(self, **given: Any) -> None:
        super().__init__(**given)
        self.refuse_wrong(**_RIG_KEYS)
        low, high = self.min_amplitude, self.max_amplitude
        if not low < high:
            text = f"found {low:g} m, expected less than max_amplitude, {high:g} m"
            where = Key(("min_amplitude",), ("max_amplitude",))
            raise ConfigurationError(text, where=where, code="out-of-range")

    @property
    def is_ours(self) -> bool:
        """Whether we filter, and the rig has not."""
        return self.rig_filter == "none" and self.filter != "none"

    @property
    def declared_corner(self) -> float:
        """Corner of the rig's filter where there is one, else of ours, Hz."""
        return self.filter_corner if self.rig_filter == "none" else self.rig_filter_corner

    @property
    def passed_corner(self) -> float:
        """Corner of the filter that the channels pass, Hz; infinite where they pass none."""
        is_raw = self.rig_filter == "none" and self.filter == "none"
        return math.inf if is_raw else self.declared_corner
