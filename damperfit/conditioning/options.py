"""What a user may say about filters, the rig, the centre and what counts as a steady cycle."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

from damperfit.errors import ConfigurationError, did_you_mean
from damperfit.problem import Key

if TYPE_CHECKING:
    from collections.abc import Iterator

__all__ = ["FILTER_KINDS", "ConditionOptions", "GasFacts", "NominalTest", "OffsetFacts"]

FILTER_KINDS = ("zero_phase", "causal", "none")
SPIKES = ("keep", "bridge")
MAX_SKEW = 0.1  # s; more is no skew between channels but two clocks


@dataclass(frozen=True, slots=True, kw_only=True)
class NominalTest:
    """What the test was meant to be; findings compare with it, no number depends on it.

    Attributes
    ----------
    frequency, amplitude : float or None
        Hz, m. None: not said.
    temperature : float or None
        Degrees Celsius. None: not said.
    temperature_tolerance : float
        Degrees either way; infinite: no temperature is asked for.
    is_of_motion : bool
        The temperature is asked for only of logs with this frequency and amplitude, as that of
        the paper's test, which is the default.
    """

    frequency: float | None = None
    amplitude: float | None = None
    temperature: float | None = None
    temperature_tolerance: float = math.inf
    is_of_motion: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class OffsetFacts:
    """What a fit makes of a constant force that the rig adds.

    Attributes
    ----------
    name : str
        Of that quantity; "": the model has none.
    beside : tuple of str
        What is free at each setting besides, for people.
    is_known : bool
        It is fitted or held: a tared force is then no doubt.
    """

    name: str = ""
    beside: tuple[str, ...] = ()
    is_known: bool = False


class GasFacts(NamedTuple):
    """What is known of the damper's gas: it pushes the rod out and so tells the signs of a log.

    Attributes
    ----------
    rod_area : float
        a_r, m2.
    pressure, volume, exponent : float
        P_0 and V_g0 at mid-stroke, Pa and m3; gamma.
    ambient : float
        Of the air, which presses against it, Pa; the paper's equation leaves it out.
    """

    rod_area: float
    pressure: float
    volume: float
    exponent: float
    ambient: float = 0.0

    @property
    def force(self) -> float:
        """Force that pushes the rod out at mid-stroke, a_r (P_0 - P_amb), N."""
        return self.rod_area * (self.pressure - self.ambient)

    @property
    def inside(self) -> float:
        """Force of the gas alone at mid-stroke, a_r P_0, N."""
        return self.rod_area * self.pressure


@dataclass(frozen=True, slots=True, kw_only=True)
class ConditionOptions:
    """How a recording becomes a trace.

    Attributes
    ----------
    filter : str
        Our own low-pass on displacement and force: "zero_phase", "causal" or "none". See
        `damperfit.conditioning.filters` for what each does. Not used when the rig has filtered.
    filter_corner : float
        Frequency of -3 dB, Hz.
    auto_corner : bool
        The corner follows the fastest motion of each log; `filter_corner` is not used.
    filter_order : int
        Order of one pass.
    rig_filter : str
        What the rig has already done to both channels, same words. "causal": an ordinary filter
        in the rig's hardware or software, both channels late by its delay. "zero_phase": the
        rig's software ran the filter forward and backward.
    rig_filter_corner : float
        Frequency at which one pass of the rig's filter has -3 dB, Hz.
    rig_filter_order : int
        Order of one pass of the rig's filter.
    centre : float or None
        Displacement that is x = 0 of the model, as the log counts it, m. None: mid-stroke.
    skew : float or str
        What the force is late against the displacement, s, beyond what a declared rig filter
        does to both; corrected. "auto": as estimated, where the log can tell.
    gas : GasFacts or None
        With it the gas force tells the signs of the channels, and whether the force was tared.
    offset : OffsetFacts
        Whether and how a fit knows of a constant force of the rig's.
    steadiness : float
        A cycle is steady when amplitude and period are within this fraction of the medians.
    chamber_lengths : tuple of float or None
        l_1 and l_2 of the damper, m. With them a stroke beyond the chambers is refused.
    min_amplitude, max_amplitude, max_force : float
        Outside these, m and N, a unit was misread.
    nominal : NominalTest
        What the test was meant to be, for findings.
    spikes : str
        "keep", or "bridge": replace single samples that stand out by a straight line.
    """

    filter: str = "zero_phase"
    filter_corner: float = 30.0
    auto_corner: bool = False
    filter_order: int = 4
    rig_filter: str = "none"
    rig_filter_corner: float = 30.0
    rig_filter_order: int = 4
    centre: float | None = None
    skew: float | str = 0.0
    gas: GasFacts | None = None
    offset: OffsetFacts = OffsetFacts()
    steadiness: float = 0.05
    chamber_lengths: tuple[float, float] | None = None
    min_amplitude: float = 2e-4
    max_amplitude: float = 1.0
    max_force: float = 1e5
    nominal: NominalTest = NominalTest()
    spikes: str = "keep"

    def __post_init__(self) -> None:
        """Refuse options that mean nothing."""
        for name in ("filter", "rig_filter"):
            found = getattr(self, name)
            if found not in FILTER_KINDS:
                raise ConfigurationError(
                    f"unknown kind {found!r}; expected {', '.join(FILTER_KINDS)}."
                    f"{did_you_mean(str(found), FILTER_KINDS)}",
                    where=Key((name,)),
                    code="unknown-filter",
                )
        for name, is_right, wanted in self._limits():
            if not is_right:
                found = getattr(self, name)
                shown = f"{found:g} Hz" if name.endswith("corner") else f"{found!r}"
                raise ConfigurationError(
                    f"found {shown}, expected {wanted}", where=Key((name,)), code="out-of-range"
                )
        if not 0.0 <= self.min_amplitude < self.max_amplitude:
            raise ConfigurationError(
                f"found {self.min_amplitude:g} m, expected 0 or more and less than "
                f"max_amplitude, {self.max_amplitude:g} m",
                where=Key(("min_amplitude",), ("max_amplitude",)),
                code="out-of-range",
            )

    def _limits(self) -> Iterator[tuple[str, bool, str]]:
        """Yield options, whether they are right, and what is."""
        for name in ("filter_order", "rig_filter_order"):
            yield name, 1 <= getattr(self, name) <= 12, "1 to 12"
        for name in ("filter_corner", "rig_filter_corner"):
            yield name, 0.0 < getattr(self, name) < math.inf, "more than 0"
        yield "spikes", self.spikes in SPIKES, " or ".join(SPIKES)
        yield "steadiness", 0.0 < self.steadiness < 0.5, "more than 0 and less than 0.5"
        for name in ("max_amplitude", "max_force"):
            yield name, getattr(self, name) > 0.0, "above 0"
        is_known = isinstance(self.skew, float | int) and abs(self.skew) <= MAX_SKEW
        is_right = self.skew == "auto" or is_known
        yield "skew", is_right, f"'auto' or at most {MAX_SKEW:g} s either way"
        is_right = self.centre is None or math.isfinite(self.centre)
        yield "centre", is_right, "a finite number, m"
