"""What a rig wrote (`Recording`), what is fitted (`Trace`), and what of both is remarkable.

A trace is the whole motion that the model runs through; its `Segment`es are what is compared.
Both hold SI floats and the project's signs: displacement, velocity and force are positive in
rebound (rod out, tension). Readers make recordings, conditioning turns them into traces.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from damperfit.arrays import FloatArray
from damperfit.problem import Problem, finding_record
from damperfit.tested.setting import Setting
from damperfit.tested.setting import natural_order as natural_order  # noqa: PLC0414 - also from here

_SPEEDS = ("peak_speed_rebound", "peak_speed_bump", "hysteresis_speed")
_FIGURES = {name: f"{name}_m_per_s" for name in _SPEEDS}
_FIGURES |= {"energy": "energy_J", "energy_se": "energy_se_J"}
_FIGURES |= {name: f"figures_{name}_s" for name in ("start", "stop")}  # all others are forces


@dataclass(frozen=True, slots=True, eq=False)
class Recording:
    """One test as logged, in SI units, on the log's own time base."""

    name: str  # file name, with a part number when a file holds several tests
    path: str
    sha256: str  # of the file's bytes, hexadecimal
    setting: Setting | None  # None when the log does not say
    time: FloatArray  # shape (n,), s; all channels are finite, time strictly increasing
    displacement: FloatArray  # m
    force: FloatArray  # N
    temperature: FloatArray | None = None  # degrees Celsius
    notes: tuple[str, ...] = ()  # what the reader assumed or noticed, a sentence each
    metadata: Mapping[str, str] = field(default_factory=dict)  # free text of the log's preamble
    findings: tuple[Problem, ...] = ()  # what the reader had to leave out or to take on trust
    velocity: FloatArray | None = None  # m/s, with the log's own sign; only checked, never used
    # Whether the log was declared to count the channel positive in bump, and the channel is
    # reversed here. None: not declared, and it is as logged.
    reverse_displacement: bool | None = None
    reverse_force: bool | None = None


class FilterDesign(NamedTuple):
    """A low-pass filter as second-order sections; no sections means that nothing is filtered."""

    sections: FloatArray  # shape (k, 6), SciPy's ``sos`` layout; k = 0 passes everything
    is_zero_phase: bool  # run forward and backward; False: forward only
    description: str  # one line for reports
    # Samples replaced before the filter by the mean of both neighbours, in any force alike.
    bridged: tuple[int, ...] = ()


@dataclass(frozen=True, slots=True, eq=False)
class Drive:
    """The displacement as the damper answers it: sensor noise taken off, the motion left whole."""

    displacement: FloatArray  # shape (n,), m
    velocity: FloatArray  # m/s
    corner: float  # frequency above which noise was taken off, Hz; infinite where nothing was
    # Where the speed jumps, shape (k, 4), as `damperfit.simulation.Motion` has it; none where the
    # motion is not known so sharply.
    jumps: FloatArray = field(default_factory=lambda: np.empty((0, 4)))

    def part(self, kept: slice, centre: float) -> Drive:
        """Return the drive of some samples, counted from the first of them and from a centre."""
        first, stop, _ = kept.indices(len(self.displacement))
        at = self.jumps[:, 0]
        jumps = self.jumps[(at > first) & (at <= stop - 1)] - [first, centre, 0.0, 0.0]
        x, v = self.displacement[kept] - centre, self.velocity[kept].copy()
        return Drive(x, v, self.corner, jumps)


@dataclass(frozen=True, slots=True)
class SegmentFigures:
    """What is read off a segment: of steady cycles the mean, else the extremes of the motion."""

    peak_force_rebound: float  # largest measured force, N
    peak_force_bump: float  # smallest, N, negative
    peak_speed_rebound: float  # largest speed of each stroke, m/s, positive
    peak_speed_bump: float
    energy: float  # work taken up in a cycle, of a moving segment in all of it, J
    hysteresis_speed: float  # half of the lower peak speed, m/s
    hysteresis_rebound: float  # opening less closing force there, N; NaN where nothing repeats
    hysteresis_bump: float
    # Time stamps between which they were read, s: cycles without another motion in the filter.
    start: float = math.nan
    stop: float = math.nan
    # Standard errors by the scatter of the cycles; NaN of one cycle.
    energy_se: float = math.nan
    hysteresis_rebound_se: float = math.nan
    hysteresis_bump_se: float = math.nan

    def describe(self) -> dict[str, float | None]:
        """Return the figures for run.json."""
        named = {_FIGURES.get(name, f"{name}_N"): getattr(self, name) for name in self.__slots__}
        return {key: value if math.isfinite(value) else None for key, value in named.items()}


@dataclass(frozen=True, slots=True, eq=False)
class Segment:
    """A part of a trace in which model and measurement are compared."""

    kind: str  # "steady": whole cycles of one motion that repeats; "moving": one that does not
    first: int  # samples ``first:stop`` of the trace
    stop: int
    # Shape (n_cycles + 1,), fractional sample positions of the cycle boundaries, so that cycles
    # can be laid over each other. Empty where nothing repeats.
    cycle_starts: FloatArray
    frequency: float  # cycles per second, Hz; of a moving segment half its turns per second
    amplitude: float  # half the stroke, m; of a moving segment half of the whole range
    peak_speed: float  # m/s
    # Samples at its beginning and at its end in which the filter still holds the other motion
    # beside it. The model's force holds it alike, but cycles differ there.
    smeared: tuple[int, int] = (0, 0)
    noise: float = math.nan  # standard deviation of the compared force's noise, N, where known
    noise_source: str = ""  # "scatter between cycles", or "above the filter" where few repeat
    figures: SegmentFigures | None = None  # as measured

    @property
    def n_cycles(self) -> int:
        """Number of whole cycles that repeat."""
        return max(len(self.cycle_starts) - 1, 0)

    @property
    def n_samples(self) -> int:
        """Number of samples that are compared."""
        return self.stop - self.first

    @property
    def window(self) -> slice:
        """Its samples of the trace, as a slice."""
        return slice(self.first, self.stop)

    def describe(self, trace: Trace) -> dict[str, Any]:
        """Return the facts of the segment, for tables and run.json."""
        ends = [trace.start_time + k * trace.interval for k in (self.first, self.stop)]
        return {
            "kind": self.kind,
            "start_s": ends[0],
            "stop_s": ends[1],
            "n_samples": self.n_samples,
            "cycles": self.n_cycles,
            "frequency_Hz": self.frequency,
            "amplitude_m": self.amplitude,
            "peak_speed_m_per_s": self.peak_speed,
            "noise_N": self.noise if math.isfinite(self.noise) else None,
            "noise_source": self.noise_source or None,
            **(self.figures.describe() if self.figures else {}),
        }


@dataclass(frozen=True, slots=True, eq=False)
class Trace:
    """A uniform, filtered log with the segments that are compared marked.

    The model runs through all of it, run-up and changes of speed included; what is compared are
    the segments alone. Displacement is the model's x: its centre is removed.
    """

    name: str
    setting: Setting | None
    start_time: float  # stamp of the first sample, s
    interval: float  # from each to the next, s
    displacement: FloatArray  # shape (n,), m; all channels are filtered alike
    velocity: FloatArray  # m/s
    force: FloatArray  # N, as compared with the model
    drive: Drive  # displacement and velocity that drive the model
    segments: tuple[Segment, ...]  # one at least, in order of time, without overlap
    centre: float  # displacement that is x = 0 of the model, as the log counts it, m
    n_cycles_found: int  # whole cycles in the log, run-in included
    model_filter: FilterDesign  # what a simulated force must pass before it is compared
    temperature: float | None = None  # mean over the segments, degrees Celsius
    notes: tuple[str, ...] = ()  # what conditioning assumed
    findings: tuple[Problem, ...] = ()  # on the log's quality, and what was corrected
    # What the damper was filled to for this test, Pa absolute; None: as it is declared.
    gas_pressure: float | None = None
    whole: Trace | None = None  # with all that was logged, where a run-up or coast-down is cut off
    shows_signs: bool = False  # the gas force shows which way the channels are counted
    # The rig's own offset of this log beside the mean one of its setting, N, found and taken off.
    tare: float = 0.0
    logged_interval: float | None = None  # s; None: no samples were put in between

    @property
    def sample_rate(self) -> float:
        """Samples a second that were logged, Hz."""
        return 1.0 / (self.logged_interval or self.interval)

    @property
    def warnings(self) -> tuple[str, ...]:
        """What makes the log's parameters doubtful, one plain sentence each."""
        return tuple(
            finding.message() for finding in self.findings if finding.severity == "warning"
        )

    @property
    def fastest(self) -> Segment:
        """The segment with the largest speed, which stands for the log where one must."""
        return max(self.segments, key=lambda segment: segment.peak_speed)

    @property
    def frequency(self) -> float:
        """Cycles per second of the fastest segment, Hz."""
        return self.fastest.frequency

    @property
    def amplitude(self) -> float:
        """Half the stroke of the fastest segment, m."""
        return self.fastest.amplitude

    @property
    def n_cycles(self) -> int:
        """Number of steady whole cycles that are evaluated."""
        return sum(segment.n_cycles for segment in self.segments)

    @property
    def n_samples(self) -> int:
        """Number of samples that are compared."""
        return sum(segment.n_samples for segment in self.segments)

    @property
    def compared(self) -> slice | NDArray[np.int64]:
        """Index of the compared samples in the trace, in order of time."""
        if len(self.segments) == 1:
            return self.segments[0].window
        return np.concatenate([np.arange(x.first, x.stop) for x in self.segments])

    @property
    def places(self) -> tuple[slice, ...]:
        """Where each segment lies among the compared samples."""
        ends = np.cumsum([segment.n_samples for segment in self.segments]).tolist()
        return tuple(map(slice, [0, *ends[:-1]], ends))

    def describe(self) -> dict[str, Any]:
        """Return the scalar facts of the trace, for tables and run.json."""
        return {
            "name": self.name,
            "setting": self.setting,
            "sample_rate_Hz": self.sample_rate,
            "frequency_Hz": self.frequency,
            "amplitude_m": self.amplitude,
            "centre_m": self.centre,
            "cycles_found": self.n_cycles_found,
            "cycles_used": self.n_cycles,
            "stretches": [segment.describe(self) for segment in self.segments],
            "temperature_degC": self.temperature,
            "notes": list(self.notes),
            "warnings": list(self.warnings),
            "findings": [finding_record(finding) for finding in self.findings],
        }
