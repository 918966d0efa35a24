"""A setting and a log of a run, the range of its tests, as run.json holds them."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from damperfit.adjustment.force_at import Stage, has_lost_errors
from damperfit.damper.model import Values
from damperfit.errors import ConfigurationError
from damperfit.identification.outcome import Status
from damperfit.reporting.records import entries_in, number_in
from damperfit.simulation import Motion
from damperfit.tables.files import LogSignals
from damperfit.tested.setting import Setting

if TYPE_CHECKING:
    import pandas as pd

    from damperfit.damper.network import SteppedDamper
    from damperfit.results import Run

_BEYOND = 1.05  # times what was tested, or less than that part of it
_LONG = 10.0  # s of a log
_LATE = 1e-6  # s; time stamps are rounded alike
_FEWEST = 8  # samples of a cycle


@dataclass(frozen=True, slots=True)
class Tested:
    """The range of the tests that were fitted; None: not known.

    `stroke` is the largest amplitude of a motion that repeats, m, `speed` the highest peak speed,
    m/s; of frequencies, Hz, and temperatures, degC, the lowest and the highest.
    """

    __test__ = False  # no class of tests

    n_logs: int = 0
    stroke: float | None = None
    speed: float | None = None
    frequencies: tuple[float, float] | None = None
    temperatures: tuple[float, float] | None = None

    def outside(
        self,
        *,
        amplitude: float | None = None,
        frequency: float | None = None,
        speed: float | None = None,
    ) -> Iterator[str]:
        """Yield what of a motion, SI, was never tested, as in "15 Hz (tested: 1.5 Hz)"."""
        if amplitude and self.stroke and amplitude > _BEYOND * self.stroke:
            tested = f"{1e3 * self.stroke:.4g} mm"
            yield f"an amplitude of {1e3 * amplitude:.4g} mm (tested: up to {tested})"
        low, high = self.frequencies or (0.0, math.inf)
        if frequency and not low / _BEYOND <= frequency <= high * _BEYOND:
            tested = f"{low:.3g} Hz" if high <= _BEYOND * low else f"{low:.3g} to {high:.3g} Hz"
            yield f"{frequency:.4g} Hz (tested: {tested})"
        if speed and self.speed and speed > _BEYOND * self.speed:
            yield f"{speed:.3g} m/s (tested: up to {self.speed:.3g} m/s)"


@dataclass(frozen=True, slots=True, eq=False)
class SettingResult(Stage):
    """One setting of a run: its values, what is known of their errors, and its grade.

    As of `Stage`: where the adjusters stand, the values in SI, and the covariance of u = ln y
    (plain y for linear quantities) of those with an error, the setting's own ones first. `row` is
    its row of the table of parameters.
    """

    row: Mapping[str, Any] | None = None
    run: Run | None = None

    @property
    def label(self) -> str:
        """Where the adjusters stand."""
        return self.setting.label

    @property
    def values(self) -> Values:
        """The parameters, SI: an attribute and a key for each."""
        return self.parameters

    @property
    def status(self) -> dict[str, str]:
        """How each value was found: fitted, shared, fixed, at_bound, not_identifiable."""
        row = self.row or {}
        return {name: str(row.get(f"{name}_status") or "") for name in self.parameters.names}

    @property
    def intervals(self) -> dict[str, tuple[float | None, float | None]]:
        """95 % intervals, SI; a limit that the logs do not determine is None."""
        row, names = self.row or {}, self.parameters.names
        return {name: (row.get(f"{name}_ci_low"), row.get(f"{name}_ci_high")) for name in names}

    @property
    def unlimited(self) -> tuple[str, ...]:
        """Names of values to which the logs set no upper limit.

        Rigid oil or mounting is none: any stiffness above its limit gives the same force.
        """
        status, intervals = self.status, self.intervals
        return tuple(
            quantity.name
            for quantity in self.parameters.quantities
            if not (quantity.is_open or quantity.is_of_mounting)
            and status[quantity.name] == Status.NOT_IDENTIFIABLE
            and intervals[quantity.name][1] is None
        )

    @property
    def grade(self) -> str:
        """excellent, good, poor or withheld."""
        return str((self.row or {}).get("grade") or "")

    @property
    def mse_percent(self) -> float:
        """Normalised MSE, eq. (22); NaN where it is not known."""
        mse = (self.row or {}).get("mse_percent")
        return math.nan if mse is None else float(mse)

    def simulate(self, wave: str | Motion | None = None, **motion: Any) -> Any:
        """Simulate this setting; keywords as of `damperfit.simulate`.

        Of a `damperfit.Motion`, arrays of displacement and velocity, its response: `time`, `force`,
        `pressures`, all in SI.
        """
        from damperfit.simulation import Motion

        if isinstance(wave, Motion) and not motion:
            assert self.run is not None
            how: dict[str, Any] = {"sensitivities": (), "options": self.run.solver}
            return self.run.damper.simulate(self.parameters, wave, **how)
        if idle := [name for name in ("setting", "parameters") if name in motion]:
            text = (
                f"setting.simulate: found {idle[0]}=...; the parameters are those of setting "
                f"{self.label}; leave it out, or call damperfit.simulate"
            )
            raise ConfigurationError(text, code="wrong-call")
        return api_function("simulate")(self.label, parameters=self.run, wave=wave, **motion)

    def stepped(self, x: float = 0.0, *, with_rig: bool = False) -> SteppedDamper:
        """Return the damper at this setting for a program that steps it: ``step(x, v, dt)``."""
        from damperfit.damper.network import SteppedDamper

        assert self.run is not None
        how: dict[str, Any] = {"options": self.run.solver, "with_rig": with_rig}
        return SteppedDamper(self.run.damper, self.values, x=x, **how)

    def sensitivity(self, motion: Motion) -> pd.DataFrame:
        """Return the force along a motion, N, and what it changes by each value in error, SI.

        Columns are time_s, force_N and the names of the values: dF/dy, unfiltered.
        """
        import pandas as pd

        assert self.run is not None
        how: dict[str, Any] = {"sensitivities": self.names, "options": self.run.solver}
        response = self.run.damper.simulate(self.parameters, motion, **how)
        slopes = {name: response.sensitivities[name] for name in self.names}
        return pd.DataFrame({"time_s": response.time, "force_N": response.force, **slopes})

    def __repr__(self) -> str:
        return f"<setting {self.label}: MSE {self.mse_percent:.3g} %, {self.grade}>"


@dataclass(frozen=True, eq=False)
class LogResult:
    """One log of a run: what it tested, what was read off it, how well it was fitted.

    `role` is "fitted", or "held_out": predicted with what the other logs gave. `mse_percent` is the
    normalised MSE, `noise_floor_percent` what of it the scatter between cycles explains. `facts` is
    its entry in run.json, `rows` are its rows of the characteristics.
    """

    setting: Setting
    name: str
    role: str
    mse_percent: float | None
    noise_floor_percent: float | None
    facts: Mapping[str, Any]
    rows: Sequence[Mapping[str, Any]]
    run: Run

    @cached_property
    def segments(self) -> tuple[Mapping[str, Any], ...]:
        """The peaks of each segment: speeds, forces, energy, measured beside simulated."""
        return tuple(row for row in self.rows if row["point"] == "peak")

    @cached_property
    def steady(self) -> tuple[Mapping[str, Any], ...]:
        """The segments that repeat."""
        return tuple(row for row in self.segments if row["cycles"])

    @property
    def fastest(self) -> Mapping[str, Any] | None:
        """The fastest segment that repeats; None: there is none."""
        return max(self.steady, key=lambda row: row["speed_rebound_m_per_s"] or 0.0, default=None)

    @property
    def is_moving(self) -> bool:
        """Whether nothing of its motion repeats."""
        return bool(self.segments) and not self.steady

    @property
    def has_segments(self) -> bool:
        """Whether it is no single steady run."""
        return len(self.segments) > 1 or self.is_moving

    @cached_property
    def cycles(self) -> tuple[slice, ...]:
        """The last whole cycle of each steady segment, in samples of its signals."""
        time, cycles = self.signals.time if self.signals else np.empty(0), []
        for segment in segments_in(self.facts):
            rate = number_in(segment, "frequency_Hz") or 0.0
            is_steady = segment.get("kind", "steady") == "steady"
            if not (is_steady and rate > 0.0 and len(time) >= _FEWEST):
                continue
            stop = number_in(segment, "figures_stop_s") or number_in(segment, "stop_s") or math.inf
            end = int(np.searchsorted(time, stop - _LATE))
            begin = int(np.searchsorted(time, time[end - 1] - 1.0 / rate - _LATE))
            if end - begin >= _FEWEST:
                cycles.append(slice(begin, end))
        return tuple(cycles)

    @property
    def temperature(self) -> float | None:
        """Mean over the log, degC."""
        return number_in(self.facts, "temperature_degC")

    @property
    def noise(self) -> float | None:
        """Scatter of the filtered force between its cycles, N; None: no cycles."""
        return min(numbers_in(segments_in(self.facts), "noise_N"), default=None)

    @property
    def effective_rate(self) -> float | None:
        """Samples that count as independent of noise behind the filter of the run, 1/s."""
        from damperfit.conditioning.filters import passed_filter
        from damperfit.uncertainty.covariance import independent_samples

        rate = number_in(self.facts, "sample_rate_Hz")
        if rate is None:
            return None
        design = passed_filter(self.run.own_configuration.conditioning, rate)
        return independent_samples(design, round(_LONG * rate)) / _LONG

    @cached_property
    def signals(self) -> LogSignals | None:
        """Measured and simulated signals; None of a log that was held out."""
        own = (self.setting, self.name)
        return next((log for log in self.run.signals if (log.setting, log.log) == own), None)

    def __repr__(self) -> str:
        n = len(self.segments)
        return f"<log {self.name}, setting {self.setting}: {self.role}, {n} segments>"


# What run.json says, whatever else may stand there


def segments_in(log: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Return the segments of a log's entry in run.json; older runs have one, in the entry."""
    return entries_in(log, "stretches") if isinstance(log.get("stretches"), list) else [dict(log)]


def motions_in(log: Mapping[str, Any]) -> Iterator[tuple[float, float, float]]:
    """Yield amplitude, frequency and peak speed of each segment of a log."""
    for segment in segments_in(log):
        keys = ("amplitude_m", "frequency_Hz", "peak_speed_m_per_s")
        size, rate, speed = (number_in(segment, key) or 0.0 for key in keys)
        if size > 0.0 and rate > 0.0:
            yield size, rate, speed if speed > 0.0 else 2.0 * math.pi * size * rate


def errors_of(
    values: Values, row: Mapping[str, Any], entry: Mapping[str, Any]
) -> tuple[tuple[str, ...], tuple[str, ...], Any]:
    """Return the setting's own names with an error, the shared ones, and the covariance of ln y."""
    try:
        names = [str(name) for name in entry["parameters"]]
        status = {name: row[f"{name}_status"] for name in values.names}
        if has_lost_errors(names, status):
            return (), (), None
        # Older runs left it to the status, and had errors of the values alone.
        tied = entry.get("shared", [name for name in names if status[name] == Status.SHARED])
        scales = {n: values[n] if values.quantity(n).is_logarithmic else 1.0 for n in names}
        errors = entry.get("errors") or [float(row[f"{n}_se"]) / scales[n] for n in names]
        correlation = np.array(entry["correlation"], dtype=np.float64)
        covariance = correlation.reshape(len(names), len(names)) * np.outer(errors, errors)
    except (KeyError, TypeError, ValueError):
        return (), (), None
    if not np.all(np.isfinite(covariance)):
        return (), (), None
    own = tuple(name for name in names if name not in tied)
    shared = tuple(name for name in names if name in tied)
    order = [names.index(name) for name in (*own, *shared)]
    return own, shared, covariance[np.ix_(order, order)]


def numbers_in(rows: Sequence[Mapping[str, Any]], key: str) -> list[float]:
    """Return the numbers of a column, of the rows that have one."""
    return [number for row in rows if (number := number_in(row, key)) is not None]


def api_function(name: str) -> Any:
    """Return a function of damperfit's, which takes runs itself."""
    import damperfit

    return getattr(damperfit, name)
