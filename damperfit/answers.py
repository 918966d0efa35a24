"""What the functions return: it prints itself, gives data frames and JSON, and writes itself."""

from __future__ import annotations

import csv
import math
import os
from collections.abc import Iterable, Sequence
from contextlib import ExitStack
from dataclasses import asdict
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, Self

from damperfit.reporting.answer import Answer
from damperfit.reporting.sheet import Sheet, text_table
from damperfit.store import file_set
from damperfit.tables.files import json_values, time_series_table, write_table

if TYPE_CHECKING:
    import numpy as np
    import pandas as pd
    from numpy.typing import NDArray

    from damperfit.configuration.options import Configuration
    from damperfit.exporting import Export
    from damperfit.exporting.check import SettingCheck
    from damperfit.queries.simulations import ChosenParameters, Variation
    from damperfit.reporting.figures import Plot
    from damperfit.run.logs import LogBatch

    FloatArray = NDArray[np.float64]


class Inspection(Answer):
    """What is in logs: `batch` has what was found of each, `facts` the same as JSON values."""

    def __init__(self, batch: LogBatch) -> None:
        self.batch = batch
        self.facts = [log.facts for log in batch.logs]
        n, n_bad = len(batch.logs), len(batch.failures)
        self.sentence = f"{n} log{'' if n == 1 else 's'}, {n_bad} cannot be used"

    @property
    def failures(self) -> tuple[str, ...]:
        """Logs that cannot be used, a sentence each."""
        return tuple(failure.message for failure in self.batch.failures)

    @property
    def findings(self) -> tuple[str, ...]:
        """What their data show, a sentence each."""
        from damperfit.reporting.inspection import finding_lines

        return tuple(finding_lines(self.facts, has_notes=True))

    remarks = findings

    def document(self) -> dict[str, Any]:
        """Return all of it as JSON values."""
        return self.batch.document()

    def to_frame(self) -> pd.DataFrame:
        """Return one row a log: setting, rate, cycles, frequency, amplitude, verdict ..."""
        import pandas as pd

        rows = []
        for log in self.batch.logs:
            flat = {k: v for k, v in log.facts.items() if isinstance(v, str | int | float | bool)}
            setting = log.facts.get("setting")
            rows.append({"log": log.log} | flat | {"setting": setting and str(setting)})
        return pd.DataFrame(rows)

    def sheets(self) -> tuple[Sheet, ...]:
        """Return a row a log."""
        return self.all_sheets()[:1]

    def all_sheets(self) -> tuple[Sheet, ...]:
        """Return a row a log, a row a segment, and a row a curve without time."""
        from damperfit.reporting.inspection import curve_sheet, inspection_sheet, stretch_sheet

        return tuple(make(self.facts) for make in (inspection_sheet, stretch_sheet, curve_sheet))


class Simulation(Answer):
    """A simulated test: signals in SI, positive in rebound, and the figures of its last cycle.

    `time`, `displacement`, `velocity` and `force` have the shape (n,), in s, m, m/s and N,
    `pressures` (3, n), Pa absolute; `response` has them all, `characteristics` the figures,
    `frequency` is in Hz, `motion` says what drove the damper. `damper` says whose damper it is,
    `choice` whose parameters; the notes what was assumed of it and what is in these forces,
    `warnings` what to know before believing the figures.
    """

    def __init__(
        self,
        choice: ChosenParameters,
        configuration: Configuration,
        log: Path | None = None,
        damper: str = "",
    ) -> None:
        from damperfit.queries.settings import notes_on_simulation
        from damperfit.queries.simulations import simulated

        self.choice, self.damper = choice, damper
        self.temperature: float | None = getattr(configuration.damper, "temperature", None)
        self.motion, self.frequency, self.response, self.characteristics = simulated(
            choice.parameters, configuration, log=log
        )
        self.time: FloatArray = self.response.time
        self.displacement: FloatArray = self.response.displacement
        self.velocity: FloatArray = self.response.velocity
        self.force: FloatArray = self.response.force
        self.pressures: FloatArray = self.response.pressures
        self.configured_notes = configuration.notes
        self.notes = tuple(notes_on_simulation(configuration.damper, choice.parameters))

    @property
    def sentence(self) -> str:  # type: ignore[override]
        """Setting and motion."""
        setting = self.choice.setting
        return ("" if setting is None else f"setting {setting}: ") + self.motion

    title = sentence

    @cached_property
    def half_intervals(self) -> tuple[float, float] | None:
        """Of the damper's own force at the peak speeds, rebound and compression, 95 %, N."""
        from damperfit.adjustment.force_at import force_at
        from damperfit.damper.temperature_law import at_temperature

        fitted, figures = self.choice.fitted, self.characteristics
        if fitted is None or fitted.run is None or fitted.covariance is None or not fitted.names:
            return None
        speeds = figures.peak_speed_rebound, figures.peak_speed_bump
        damper = fitted.run.damper
        if self.temperature is not None:
            damper = at_temperature(damper, self.temperature)
        # Both strokes of each speed; none: it cannot be simulated there.
        forces = force_at([fitted], damper, speeds, measured=fitted.run.speed_forces)
        if not forces:
            return None
        rebound, bump = (max(f.force - f.low, f.high - f.force) for f in (forces[0], forces[-1]))
        return rebound, bump

    @property
    def _tested(self) -> dict[str, float]:
        """What of the motion is held against the range of the tests, SI."""
        amplitude = 0.5 * float(self.displacement.max() - self.displacement.min())
        fastest = float(abs(self.velocity).max())
        return {"amplitude": amplitude, "frequency": self.frequency, "speed": fastest}

    @property
    def trust(self) -> str:
        """Grade, interval, and that the motion was tested; empty where no run tells of it."""
        fitted, figures = self.choice.fitted, self.characteristics
        if fitted is None:
            return ""
        parts = [f"grade of the fit: {fitted.grade}"]
        if self.half_intervals is not None:
            rebound, bump = (f"{float(f'{half:.2g}'):g}" for half in self.half_intervals)
            parts.append(
                f"the damper's own force ±{rebound} N at {figures.peak_speed_rebound:.3g} m/s in "
                f"rebound, ±{bump} N in compression (95 %)"
            )
        if not any(self.choice.tested.outside(**self._tested)):
            parts.append("amplitude, frequency and speed were tested")
        return "; ".join(parts)

    @property
    def warnings(self) -> tuple[str, ...]:
        """What to know before believing the figures, a sentence each."""
        from damperfit.queries.simulations import FEW_SAMPLES

        warned = list(self.choice.warnings(temperature=self.temperature, **self._tested))
        samples_a_cycle = 1.0 / (self.frequency * float(self.time[1] - self.time[0]))
        if samples_a_cycle < FEW_SAMPLES:
            warned.append(
                f"{samples_a_cycle:.3g} samples a cycle: peaks, hysteresis and forces at a "
                f"speed are coarse; {FEW_SAMPLES} or more are wanted (--sample-rate)"
            )
        warned += [
            f"chamber {chamber} is empty for {100.0 * share:.3g} % of the cycle: these are the "
            "forces of a damper that cavitates; a slower motion or more gas keeps it full"
            for chamber, share in enumerate(self.characteristics.cavitation_shares, start=1)
            if share > 0.0
        ]
        return tuple(warned)

    def document(self) -> dict[str, Any]:
        """Return what was found as JSON values."""
        document: dict[str, Any] = {
            "setting": self.choice.setting,
            **{name: getattr(self, name) for name in ("damper", "notes", "warnings")},
            "source": self.choice.source,
            "motion": self.motion,
            "frequency_Hz": self.frequency,
            "parameters": asdict(self.choice.parameters),
            "characteristics": asdict(self.characteristics),
        }
        if self.choice.fitted is not None:
            halves = self.half_intervals or (None, None)
            document["grade"] = self.choice.fitted.grade
            document["half_interval_N"] = dict(zip(("rebound", "bump"), halves, strict=True))
        return {key: json_values(value) for key, value in document.items()}

    def write(self, out: Path | None, plot: Path | None, *, spares_others: bool = True) -> None:
        """Write the signals and the loops, each where it is given a file."""
        # One set a folder, however it is spelled; in one order, for sets wait for each other.
        folders = {os.path.realpath(path.parent): path.parent for path in (out, plot) if path}
        with ExitStack() as stack:
            sets = {
                real: stack.enter_context(file_set(folder, spares_others=spares_others))
                for real, folder in sorted(folders.items())
            }
            for path in filter(None, (out, plot)):
                draft = sets[os.path.realpath(path.parent)].path(path.name)
                if path is out:
                    write_table(draft, time_series_table(self.response), suffix=path.suffix)
                    continue
                from damperfit.reporting.drawing import draw_plot
                from damperfit.reporting.simulated import cycle_plot

                loops = cycle_plot(self.response, self.frequency, title=self.title)
                draw_plot(draft, loops, kind=path.suffix[1:].lower())
            for files in sets.values():  # both before either is exchanged
                files.spare()

    def to_frame(self) -> pd.DataFrame:
        """Return the signals as a data frame, with units in the names of its columns."""
        frame: pd.DataFrame = time_series_table(self.response).to_pandas()
        return frame

    def plot(self) -> Any:
        """Draw force against displacement and against velocity; return both matplotlib axes."""
        from damperfit.reporting.drawing import compose, fixed_style
        from damperfit.reporting.simulated import cycle_plot

        with fixed_style():
            return compose(cycle_plot(self.response, self.frequency)).axes

    def sheets(self) -> tuple[Sheet, ...]:
        """Return the figures of the last cycle; pressures of a model that has them."""
        from damperfit.reporting.simulated import cycle_force_sheet, cycle_pressure_sheet

        figures = self.characteristics
        has_pressures = not math.isnan(figures.pressure_ranges[0][0])
        more = (cycle_pressure_sheet(figures),) if has_pressures else ()
        return (cycle_force_sheet(figures, self.trust), *more)


class Files(tuple[Path, ...]):  # noqa: SLOT001 - it has attributes
    """The paths that were written, and what to know of them.

    `remarks` tell what was missing or damaged in the results, `notes` what was assumed or left out;
    `made` is what was exported, `checked` how it was held against the logs.
    """

    remarks: tuple[str, ...]
    notes: tuple[str, ...]
    made: Export | None
    checked: tuple[SettingCheck, ...]

    def __new__(  # noqa: D102 - a tuple
        cls,
        paths: Iterable[Path],
        *,
        remarks: Iterable[str] = (),
        notes: Iterable[str] = (),
        made: Export | None = None,
        checked: tuple[SettingCheck, ...] = (),
    ) -> Self:
        self = super().__new__(cls, paths)
        self.remarks, self.notes = tuple(remarks), tuple(notes)
        self.made, self.checked = made, checked
        return self


class FirstConfiguration(NamedTuple):
    """A commented configuration: TOML, what the logs have told, and what is left to measure."""

    text: str
    why: tuple[str, ...]
    open: tuple[str, ...]


class Sweep(Answer):
    """What parameters do to the force.

    `damper` and `source` say whose parameters, `notes` and `warnings` what to know before believing
    it, `sentences` what each variation does. `sweeps` are each variation with its members, and
    whether it is a figure of the paper; `records` have a row a member.
    """

    def __init__(
        self,
        choice: ChosenParameters,
        configuration: Configuration,
        damper: str,
        wanted: Sequence[tuple[Variation, bool]],
    ) -> None:
        from damperfit.queries.simulations import run_sweep
        from damperfit.reporting.simulated import sweep_records, sweep_sentence

        self.damper, self.source, self.notes = damper, choice.source, configuration.notes
        self.model = configuration.damper
        self.sweeps = tuple(
            (one, run_sweep(choice.parameters, configuration, variation=one), is_paper)
            for one, is_paper in wanted
        )
        named = [(one.name, members) for one, members, _ in self.sweeps]
        self.records: list[dict[str, Any]] = [row for one in named for row in sweep_records(*one)]
        self.sentences = tuple(sweep_sentence(*one) for one in named)
        speeds = [member.response.velocity for _, members in named for member in members]
        fastest = max(float(max(one.max(), -one.min())) for one in speeds)
        self.warnings = choice.warnings(fastest, getattr(self.model, "temperature", None))

    def document(self) -> dict[str, Any]:
        """Return all of it as JSON values."""
        facts = {"damper": self.damper, "source": self.source}
        return facts | {"rows": self.records, "sentences": list(self.sentences)}

    def to_frame(self) -> pd.DataFrame:
        """Return a row a factor."""
        import pandas as pd

        return pd.DataFrame(self.records)

    @cached_property
    def plots(self) -> tuple[Plot, ...]:
        """Its figures."""
        from damperfit.damper.purdy.reference import FAMILIES
        from damperfit.reporting.simulated import sweep_plot, sweep_pressure_plot

        plots = []
        known = {one.name: one for one in FAMILIES}
        for variation, members, is_paper in self.sweeps:
            name, family = variation.name, known[variation.name] if is_paper else None
            file_name = f"figure_{family.number}_{name}" if family else f"sweep_{name}"
            title = f"Force against velocity, {name} varied"
            plots.append(sweep_plot(name, members, file_name=file_name, title=title))
            worst = max(members, key=lambda member: member.cavitation)
            of_pressures = family.of_pressures if family else 0
            if worst.cavitation > 0.0 or of_pressures:
                first = f"figure_{of_pressures or 7}" if family else "sweep"
                file_name = f"{first}_{name}_pressures"
                title = f"Chamber pressures, {name} x{worst.factor:g}"
                plots.append(sweep_pressure_plot(worst, file_name=file_name, title=title))
        return tuple(plots)

    def write(self, folder: Path, *, kind: str = "png", spares_others: bool = True) -> None:
        """Write sweep.csv and the figures into a folder."""
        from damperfit.reporting.drawing import draw_plot

        with file_set(folder, spares_others=spares_others) as files:
            for plot in self.plots:
                draw_plot(files.path(f"{plot.name}.{kind}"), plot, kind=kind)
            with files.path("sweep.csv").open("w", encoding="utf-8", newline="") as file:
                writer = csv.DictWriter(file, list(self.records[0]), lineterminator="\n")
                writer.writeheader()
                writer.writerows(self.records)

    def sheets(self) -> tuple[Sheet, ...]:
        """Return a table a variation."""
        from damperfit.queries.simulations import swept_units
        from damperfit.reporting.simulated import sweep_sheet

        units = swept_units(self.model)
        return tuple(sweep_sheet(one.name, units[one.name], mine) for one, mine, _ in self.sweeps)

    def __repr__(self) -> str:
        pairs = zip(self.sheets(), self.sentences, strict=True)
        return "\n\n".join(f"{text_table(sheet, 100)}\n{sentence}" for sheet, sentence in pairs)
