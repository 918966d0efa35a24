"""What a rig wrote (`Recording`), what is remarkable in it (`Finding`), what is fitted (`Trace`).

A trace is the whole motion that the model runs through; its `Stretch`es are what is compared.
Both hold SI floats and the project's signs: displacement, velocity and force are positive in
rebound (rod out, tension). Readers make recordings, conditioning turns them into traces.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from damperfit.problem import Problem

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from damperfit.tested.setting import Setting

    FloatArray = NDArray[np.float64]


SEVERITIES = ("note", "warning", "refusal")
_SPEEDS = ("peak_speed_rebound", "peak_speed_bump", "hysteresis_speed")
_FIGURES = {one: f"{one}_m_per_s" for one in _SPEEDS}
_FIGURES |= {"energy": "energy_J", "energy_se": "energy_se_J"}
_FIGURES |= {one: f"figures_{one}_s" for one in ("start", "stop")}  # all others are forces


def natural_order(name: str) -> tuple[tuple[int, int, str], ...]:
    """Return the sort key of a log's name that puts run_2 before run_10."""
    parts = re.split(r"([0-9]+)", name)  # every second part is digits
    return tuple((1, int(p), "") if i % 2 else (0, 0, p) for i, p in enumerate(parts))


@dataclass(frozen=True, slots=True)
class Finding:
    """One thing that the data of a log show, good to know or bad.

    Attributes
    ----------
    name : str
        What was looked at, a fixed word for scripts, such as ``clipping`` or ``force_polarity``.
    severity : str
        "note": good to know, or put right with certainty. "warning": the parameters are doubtful.
        "refusal": the log cannot be used (only in what `inspect` tells; a trace has none).
    text : str
        One plain sentence with what was found, where, and what to do; without the log's name, and
        with ``{name}`` in place of its values.
    value, unit : float or None, str
        The number behind it, for scripts, or None; its unit, empty for counts and shares.
    is_correction : bool
        The data were changed for it.
    values : mapping
        Those of the text: an `Option` among them is worded by the outlet.
    """

    name: str
    severity: str
    text: str
    value: float | None = None
    unit: str = ""
    is_correction: bool = False
    values: Mapping[str, Any] = field(default_factory=dict, compare=False)

    @property
    def problem(self) -> Problem:
        """The same as a problem, worded by whoever shows it."""
        return Problem(self.name, self.text, self.severity, values=self.values)

    @property
    def sentence(self) -> str:
        """The text in the words of the command line."""
        return self.problem.message()

    def describe(self) -> dict[str, Any]:
        """Return the finding for run.json."""
        names = ("name", "severity", "sentence", "value", "unit", "is_correction")
        record = {name: getattr(self, name) for name in names}
        problem = self.problem.record() if self.values else {}
        return record | {name: problem[name] for name in ("text", "values") if problem}


@dataclass(frozen=True, slots=True, eq=False)
class Recording:
    """One test as logged, in SI units, on the log's own time base.

    Attributes
    ----------
    name : str
        File name for messages and tables (with a part number when a file holds several tests).
    path, sha256 : str
        Path the log was read from, and the hash of the file's bytes, hexadecimal.
    setting : Setting or None
        Adjuster setting, or None when the log does not say.
    time, displacement, force : numpy.ndarray
        Shape (n,); s, m, N. All finite; time strictly increasing.
    temperature : numpy.ndarray or None
        Shape (n,), degrees Celsius.
    notes : tuple of str
        What the reader assumed or noticed, one plain sentence each.
    metadata : mapping of str to str
        Free text found in the log's preamble.
    findings : tuple of Finding
        What the reader had to leave out or to take on trust.
    velocity : numpy.ndarray or None
        Shape (n,), m/s, with the log's own sign; only checked, never used.
    reverse_displacement, reverse_force : bool or None
        Whether the log was declared to count the channel positive in bump, and the channel is
        reversed here. None: nobody said, and it is as logged.
    """

    name: str
    path: str
    sha256: str
    setting: Setting | None
    time: FloatArray
    displacement: FloatArray
    force: FloatArray
    temperature: FloatArray | None = None
    notes: tuple[str, ...] = ()
    metadata: Mapping[str, str] = field(default_factory=dict)
    findings: tuple[Finding, ...] = ()
    velocity: FloatArray | None = None
    reverse_displacement: bool | None = None
    reverse_force: bool | None = None


@dataclass(frozen=True, slots=True, eq=False)
class FilterDesign:
    """A low-pass filter as second-order sections; no sections means that nothing is filtered.

    Attributes
    ----------
    sections : numpy.ndarray
        Shape (k, 6), SciPy's ``sos`` layout; k = 0 passes everything.
    is_zero_phase : bool
        True: run forward and backward. False: run forward only.
    description : str
        One line for reports.
    bridged : tuple of int
        Samples replaced before the filter by the mean of both neighbours, in any force alike.
    """

    sections: FloatArray
    is_zero_phase: bool
    description: str
    bridged: tuple[int, ...] = ()


@dataclass(frozen=True, slots=True, eq=False)
class Drive:
    """The displacement as the damper answers it: sensor noise taken off, the motion left whole.

    Attributes
    ----------
    displacement, velocity : numpy.ndarray
        Shape (n,); m, m/s.
    corner : float
        Frequency above which noise was taken off, Hz; infinite where nothing was.
    jumps : numpy.ndarray
        Where the speed jumps, shape (k, 4), as `damperfit.simulation.Motion` has it; none where
        the motion is not known so sharply.
    """

    displacement: FloatArray
    velocity: FloatArray
    corner: float
    jumps: FloatArray = field(default_factory=lambda: np.empty((0, 4)))

    def part(self, kept: slice, centre: float) -> Drive:
        """Return the drive of some samples, counted from the first of them and from a centre."""
        first, stop, _ = kept.indices(len(self.displacement))
        at = self.jumps[:, 0]
        jumps = self.jumps[(at > first) & (at <= stop - 1)] - [first, centre, 0.0, 0.0]
        x, v = self.displacement[kept] - centre, self.velocity[kept].copy()
        return Drive(x, v, self.corner, jumps)


@dataclass(frozen=True, slots=True)
class StretchFigures:
    """What is read off a stretch: of steady cycles the mean, else the extremes of the motion.

    Attributes
    ----------
    peak_force_rebound, peak_force_bump : float
        Largest and smallest measured force, N (bump is negative).
    peak_speed_rebound, peak_speed_bump : float
        Largest speed of each stroke, m/s, positive.
    energy : float
        Work taken up in a cycle, of a moving stretch in all of it, J.
    hysteresis_speed, hysteresis_rebound, hysteresis_bump : float
        Half of the lower peak speed, m/s; opening minus closing force there, N, NaN where nothing
        repeats.
    start, stop : float
        Time stamps between which they were read, s: cycles without another motion in the filter.
    energy_se, hysteresis_rebound_se, hysteresis_bump_se : float
        Standard errors by the scatter of the cycles; NaN of one cycle.
    """

    peak_force_rebound: float
    peak_force_bump: float
    peak_speed_rebound: float
    peak_speed_bump: float
    energy: float
    hysteresis_speed: float
    hysteresis_rebound: float
    hysteresis_bump: float
    start: float = math.nan
    stop: float = math.nan
    energy_se: float = math.nan
    hysteresis_rebound_se: float = math.nan
    hysteresis_bump_se: float = math.nan

    def describe(self) -> dict[str, float | None]:
        """Return the figures for run.json."""
        told = ((_FIGURES.get(one, f"{one}_N"), getattr(self, one)) for one in self.__slots__)
        return {key: value if math.isfinite(value) else None for key, value in told}


@dataclass(frozen=True, slots=True, eq=False)
class Stretch:
    """A part of a trace in which model and measurement are compared.

    Attributes
    ----------
    kind : str
        "steady": whole cycles of one motion that repeats. "moving": motion that does not.
    first, stop : int
        Samples ``first:stop`` of the trace.
    cycle_starts : numpy.ndarray
        Shape (n_cycles + 1,), fractional sample positions of the cycle boundaries, so that cycles
        can be laid over each other. Empty where nothing repeats.
    frequency : float
        Cycles per second, Hz; of a moving stretch half its turns per second.
    amplitude, peak_speed : float
        Half the stroke, m, of a moving stretch half of the whole range; largest speed, m/s.
    smeared : tuple of int
        Samples at its beginning and at its end in which the filter still holds the other motion
        beside it. The model's force holds it alike, but cycles differ there.
    noise, noise_source : float, str
        Standard deviation of the compared force's noise, N, NaN where it is not known; what tells
        it: "scatter between cycles", or "above the filter" where too few repeat.
    figures : StretchFigures or None
        Peak forces and speeds, energy and hysteresis as measured.
    """

    kind: str
    first: int
    stop: int
    cycle_starts: FloatArray
    frequency: float
    amplitude: float
    peak_speed: float
    smeared: tuple[int, int] = (0, 0)
    noise: float = math.nan
    noise_source: str = ""
    figures: StretchFigures | None = None

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
        """Return the facts of the stretch, for tables and run.json."""
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
    """A uniform, filtered log with the stretches that are compared marked.

    The model runs through all of it, run-up and changes of speed included; what is compared are
    the stretches alone.

    Attributes
    ----------
    name, setting : str, Setting or None
        Of the recording.
    start_time, interval : float
        Time stamp of the first sample and from each to the next, s.
    displacement, velocity, force : numpy.ndarray
        Shape (n,); m, m/s, N. Filtered alike; displacement is the model's x (centre removed);
        force is as compared with the model.
    drive : Drive
        Displacement (centre removed) and velocity that drive the model.
    stretches : tuple of Stretch
        What is evaluated, in order of time, without overlap; one at least.
    centre : float
        Displacement that is x = 0 of the model, as the log counts it, m.
    n_cycles_found : int
        Whole cycles in the log, run-in included.
    model_filter : FilterDesign
        What a simulated force (and its sensitivities) must pass before it is compared.
    notes, findings : tuple of str, tuple of Finding
        What conditioning assumed; what the data show of the log's quality, and what was corrected.
    temperature, gas_pressure : float or None
        Mean over the stretches, degrees Celsius; what the damper was filled to for this test, Pa
        absolute, None: as it is declared.
    whole : Trace or None
        The same with all that was logged, where a run-up or coast-down is cut off.
    is_filtered_by_rig : bool
        Nothing was filtered since: the force has what came behind the rig's filter, such as steps.
    shows_signs : bool
        The gas force in the log shows which way its channels are counted.
    """

    name: str
    setting: Setting | None
    start_time: float
    interval: float
    displacement: FloatArray
    velocity: FloatArray
    force: FloatArray
    drive: Drive
    stretches: tuple[Stretch, ...]
    centre: float
    n_cycles_found: int
    model_filter: FilterDesign
    temperature: float | None = None
    notes: tuple[str, ...] = ()
    findings: tuple[Finding, ...] = ()
    gas_pressure: float | None = None
    whole: Trace | None = None
    is_filtered_by_rig: bool = False
    shows_signs: bool = False

    @property
    def warnings(self) -> tuple[str, ...]:
        """What makes the log's parameters doubtful, one plain sentence each."""
        return tuple(one.sentence for one in self.findings if one.severity == "warning")

    @property
    def fastest(self) -> Stretch:
        """The stretch with the largest speed, which stands for the log where one must."""
        return max(self.stretches, key=lambda stretch: stretch.peak_speed)

    @property
    def frequency(self) -> float:
        """Cycles per second of the fastest stretch, Hz."""
        return self.fastest.frequency

    @property
    def amplitude(self) -> float:
        """Half the stroke of the fastest stretch, m."""
        return self.fastest.amplitude

    @property
    def n_cycles(self) -> int:
        """Number of steady whole cycles that are evaluated."""
        return sum(stretch.n_cycles for stretch in self.stretches)

    @property
    def n_samples(self) -> int:
        """Number of samples that are compared."""
        return sum(stretch.n_samples for stretch in self.stretches)

    @property
    def compared(self) -> slice | NDArray[np.int64]:
        """What picks the compared samples out of the trace's, in order of time."""
        if len(self.stretches) == 1:
            return self.stretches[0].window
        return np.concatenate([np.arange(one.first, one.stop) for one in self.stretches])

    @property
    def places(self) -> tuple[slice, ...]:
        """Where each stretch lies among the compared samples."""
        ends = np.cumsum([stretch.n_samples for stretch in self.stretches]).tolist()
        return tuple(map(slice, [0, *ends[:-1]], ends))

    def describe(self) -> dict[str, Any]:
        """Return the scalar facts of the trace, for tables and run.json."""
        return {
            "name": self.name,
            "setting": self.setting,
            "sample_rate_Hz": 1.0 / self.interval,
            "frequency_Hz": self.frequency,
            "amplitude_m": self.amplitude,
            "centre_m": self.centre,
            "cycles_found": self.n_cycles_found,
            "cycles_used": self.n_cycles,
            "stretches": [stretch.describe(self) for stretch in self.stretches],
            "temperature_degC": self.temperature,
            "notes": list(self.notes),
            "warnings": list(self.warnings),
            "findings": [one.describe() for one in self.findings],
        }
