"""What a user may say about filters, the rig, the centre and what counts as a steady cycle."""

import math
from dataclasses import dataclass
from typing import NamedTuple

from damperfit.errors import ConfigurationError, did_you_mean
from damperfit.problem import Key

FILTER_KINDS = ("zero_phase", "causal", "none")
_SPIKES = ("keep", "bridge")
_MAX_SKEW = 0.1  # s; more is no skew between channels but two clocks


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
    """What is known of the damper's gas: it pushes the rod out and so tells the signs of a log."""

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


@dataclass(frozen=True, slots=True, kw_only=True)
class ConditionOptions:
    """How a recording becomes a trace."""

    # Our own low-pass on displacement and force: "zero_phase", "causal" or "none"; what each does
    # stands in `damperfit.conditioning.filters`. Not used when the rig has filtered.
    filter: str = "zero_phase"
    filter_corner: float = 30.0  # frequency of -3 dB, Hz
    auto_corner: bool = False  # it follows the fastest motion of each log
    filter_order: int = 4  # of one pass
    # What the rig has already done to both channels, same words. "causal": an ordinary filter in
    # its hardware or software, both channels late by its delay. "zero_phase": forward and backward.
    rig_filter: str = "none"
    rig_filter_corner: float = 30.0  # of one pass
    rig_filter_order: int = 4
    centre: float | None = None  # x = 0 of the model, as the log counts it, m; None: mid-stroke
    # What the force is late against the displacement, s, beyond what a declared rig filter does to
    # both; corrected. "auto": as estimated, where the log can tell.
    skew: float | str = 0.0
    # With it the gas force tells the signs of the channels, and whether the force was tared.
    gas: GasFacts | None = None
    offset: OffsetFacts = OffsetFacts()  # what a fit knows of a constant force of the rig's
    steadiness: float = 0.05  # of the medians: amplitude and period of steady cycles
    # l_1 and l_2 of the damper, m: a stroke beyond the chambers is refused.
    chamber_lengths: tuple[float, float] | None = None
    min_amplitude: float = 2e-4  # outside these, m and N, a unit was misread
    max_amplitude: float = 1.0
    max_force: float = 1e5
    nominal: NominalTest = NominalTest()  # what the test was meant to be, for findings
    spikes: str = "keep"  # or "bridge": single samples that stand out become a straight line

    def __post_init__(self) -> None:
        """Refuse options that mean nothing."""
        for name in ("filter", "rig_filter"):
            kind = getattr(self, name)
            if kind not in FILTER_KINDS:
                raise ConfigurationError(
                    f"unknown kind {kind!r}; expected {', '.join(FILTER_KINDS)}."
                    f"{did_you_mean(str(kind), FILTER_KINDS)}",
                    where=Key((name,)),
                    code="unknown-filter",
                )
        is_skew = self.skew == "auto" or (
            isinstance(self.skew, float | int) and abs(self.skew) <= _MAX_SKEW
        )
        is_centre = self.centre is None or math.isfinite(self.centre)
        for name, is_right, wanted in (
            ("filter_order", 1 <= self.filter_order <= 12, "1 to 12"),
            ("rig_filter_order", 1 <= self.rig_filter_order <= 12, "1 to 12"),
            ("filter_corner", 0.0 < self.filter_corner < math.inf, "more than 0"),
            ("rig_filter_corner", 0.0 < self.rig_filter_corner < math.inf, "more than 0"),
            ("spikes", self.spikes in _SPIKES, " or ".join(_SPIKES)),
            ("steadiness", 0.0 < self.steadiness < 0.5, "more than 0 and less than 0.5"),
            ("max_amplitude", self.max_amplitude > 0.0, "above 0"),
            ("max_force", self.max_force > 0.0, "above 0"),
            ("skew", is_skew, f"'auto' or at most {_MAX_SKEW:g} s either way"),
            ("centre", is_centre, "a finite number, m"),
        ):
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
