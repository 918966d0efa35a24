"""What the functions return: it prints itself, gives data frames and JSON, and writes itself."""

from __future__ import annotations

import csv
import math
import os
from contextlib import ExitStack
from dataclasses import asdict
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from damperfit.reporting.answer import Answer
from damperfit.reporting.sheet import text_table
from damperfit.store import file_set
from damperfit.tables.files import json_values, time_series_table, write_table

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence
    from typing import Self

    import numpy as np
    import pandas as pd
    from numpy.typing import NDArray

    from damperfit.comparison import Tolerance
    from damperfit.configuration.options import Configuration
    from damperfit.exporting import Export
    from damperfit.exporting.check import SettingCheck
    from damperfit.fleets.run import Done
    from damperfit.fleets.survey import HeldFleet
    from damperfit.queries.simulations import ChosenParameters, SimulatedTest, Variation
    from damperfit.reporting.figures import Plot
    from damperfit.reporting.sheet import Sheet
    from damperfit.run.logs import LogBatch

    FloatArray = NDArray[np.float64]

__all__ = [
    "Files",
    "FirstConfiguration",
    "FleetDone",
    "Inspection",
    "Simulation",
    "Sweep",
]


class Inspection(Answer):
    """What is in logs: `batch` has what was found of each."""

    def __init__(self, batch: LogBatch) -> None:
        self.batch = batch

    @property
    def failures(self) -> tuple[str, ...]:
        """Logs that cannot be used, a sentence each."""
        return tuple(failure.message for failure in self.batch.failures)

    @property
    def findings(self) -> tuple[str, ...]:
        """What their data show, a sentence each."""
        from damperfit.reporting.inspection import finding_lines

        return tuple(finding_lines([log.facts for log in self.batch.logs], has_notes=True))

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
        from damperfit.reporting.inspection import inspection_sheet

        return (inspection_sheet([log.facts for log in self.batch.logs]),)

    @property
    def sentence(self) -> str:  # type: ignore[override]
        """How many logs there are, and can be used."""
        n, n_bad = len(self.batch.logs), len(self.batch.failures)
        return f"{n} log{'' if n == 1 else 's'}, {n_bad} cannot be used"

    @property
    def remarks(self) -> tuple[str, ...]:  # type: ignore[override]
        """What their data show, a sentence each."""
        return self.findings


class Simulation(Answer):
    """A simulated test: signals in SI, positive in rebound, and the figures of its last cycle.

    `time`, `displacement`, `velocity` and `force` have the shape (n,), in s, m, m/s and N,
    `pressures` (3, n), Pa absolute. `damper` says whose damper it is; the notes what was assumed of
    it and what is in these forces, `warnings` what to know before believing the figures.
    """

    def __init__(
        self,
        test: SimulatedTest,
        damper: str,
        configured_notes: tuple[str, ...] = (),
        notes: tuple[str, ...] = (),
    ) -> None:
        self.test, self.damper = test, damper
        self.configured_notes, self.notes, self.warnings = configured_notes, notes, test.warnings
        response = test.response
        self.time: FloatArray = response.time
        self.displacement: FloatArray = response.displacement
        self.velocity: FloatArray = response.velocity
        self.force: FloatArray = response.force
        self.pressures: FloatArray = response.pressures

    @property
    def title(self) -> str:
        """Setting and motion."""
        setting = self.test.choice.setting
        return ("" if setting is None else f"setting {setting}: ") + self.test.motion

    def document(self) -> dict[str, Any]:
        """Return what was found as JSON values."""
        test = self.test
        document: dict[str, Any] = {
            "setting": test.choice.setting,
            "damper": self.damper,
            "notes": self.notes,
            "warnings": self.warnings,
            "source": test.choice.source,
            "motion": test.motion,
            "frequency_Hz": test.frequency,
            "parameters": asdict(test.choice.parameters),
            "characteristics": asdict(test.characteristics),
        }
        if test.choice.fitted is not None:
            halves = test.half_intervals or (None, None)
            document["grade"] = test.choice.fitted.grade
            document["half_interval_N"] = dict(zip(("rebound", "bump"), halves, strict=True))
        return {key: json_values(value) for key, value in document.items()}

    def write(self, out: Path | None, plot: Path | None, *, spares_others: bool = True) -> None:
        """Write the signals and the loops, each where it is given a file."""
        test = self.test
        with ExitStack() as stack:
            # One set a folder, however it is spelled; in one order, for sets wait for each other.
            folders = {os.path.realpath(path.parent): path.parent for path in (out, plot) if path}
            sets = {
                real: stack.enter_context(file_set(folder, spares_others=spares_others))
                for real, folder in sorted(folders.items())
            }
            if out is not None:
                table = time_series_table(test.response)
                write_table(
                    sets[os.path.realpath(out.parent)].path(out.name), table, suffix=out.suffix
                )
            if plot is not None:
                from damperfit.reporting.drawing import draw_plot
                from damperfit.reporting.simulated import cycle_plot

                path, kind = (
                    sets[os.path.realpath(plot.parent)].path(plot.name),
                    plot.suffix[1:].lower(),
                )
                draw_plot(
                    path, cycle_plot(test.response, test.frequency, title=self.title), kind=kind
                )
            for files in sets.values():  # both before either is exchanged
                files.spare()

    def to_frame(self) -> pd.DataFrame:
        """Return the signals as a data frame, with units in the names of its columns."""
        frame: pd.DataFrame = time_series_table(self.test.response).to_pandas()
        return frame

    def plot(self) -> Any:
        """Draw force against displacement and against velocity; return both matplotlib axes."""
        from damperfit.reporting.drawing import compose, fixed_style
        from damperfit.reporting.simulated import cycle_plot

        with fixed_style():
            return compose(cycle_plot(self.test.response, self.test.frequency)).axes

    @property
    def sentence(self) -> str:  # type: ignore[override]
        """Setting and motion."""
        return self.title

    def sheets(self) -> tuple[Sheet, ...]:
        """Return the figures of the last cycle; pressures of a model that has them."""
        from damperfit.reporting.simulated import cycle_force_sheet, cycle_pressure_sheet

        figures = self.test.characteristics
        has_pressures = not math.isnan(figures.pressure_ranges[0][0])
        more = (cycle_pressure_sheet(figures),) if has_pressures else ()
        return (cycle_force_sheet(figures, self.test.trust), *more)


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
            (one, run_sweep(choice, configuration, variation=one), is_paper)
            for one, is_paper in wanted
        )
        named = [(one.name, members) for one, members, _ in self.sweeps]
        self.records: list[dict[str, Any]] = [row for one in named for row in sweep_records(*one)]
        self.sentences = tuple(sweep_sentence(*one) for one in named)
        speeds = [member.response.velocity for _, members in named for member in members]
        fastest = max(float(max(one.max(), -one.min())) for one in speeds)
        self.warnings = choice.warnings(fastest, getattr(self.model, "temperature", None))

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
            name = variation.name
            number = known[name].number if is_paper else 0
            of_pressures = known[name].of_pressures if is_paper else 0
            file_name = f"figure_{number}_{name}" if number else f"sweep_{name}"
            title = f"Force against velocity, {name} varied"
            plots.append(sweep_plot(name, members, file_name=file_name, title=title))
            worst = max(members, key=lambda member: member.cavitation)
            if worst.cavitation > 0.0 or of_pressures:
                first = f"figure_{of_pressures or 7}" if number else "sweep"
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
        told = zip(self.sheets(), self.sentences, strict=True)
        return "\n\n".join(f"{text_table(sheet, 100)}\n{sentence}" for sheet, sentence in told)


class FleetDone:
    """What became of the dampers of a fleet.

    `folder` is that of the parts, `done` the dampers that were looked at of `n_tasks`; `held` the
    fleet against bands with the `capability` of its forces, `shifts` sentences and rows of run
    rules over the dates, `n_rows` the rows of the table of all parts, `page` the page, where they
    were asked for.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.done: list[Done] = []
        self.n_tasks, self.is_stopped = 0, False
        self.held: HeldFleet | None = None
        self.capability: list[dict[str, Any]] = []
        self.shifts: tuple[list[str], list[dict[str, Any]]] = ([], [])
        self.n_rows: int | None = None
        self.page: Path | None = None

    @property
    def counts(self) -> dict[str, int]:
        """How many dampers ended in which way."""
        from damperfit.fleets.run import State

        return {state.value: sum(one.state is state for one in self.done) for state in State}

    @property
    def code(self) -> int:
        """Exit code; failures of parts that were there count like those of new ones."""
        if self.is_stopped:
            return 130
        if any(one.n_failures for one in self.done):
            return 1 if any(one.n_settings for one in self.done) else 3
        is_missed = self.held is not None and bool(self.held.missed)
        return 4 if is_missed or any(one.n_gates for one in self.done) else 0

    def document(self) -> dict[str, Any]:
        """Return all of it as JSON values."""
        from damperfit.reporting.compared import tolerance_rows

        held = self.held
        failures, gates = (
            [
                {"damper": one.owner, "message": line}
                for one in self.done
                for line in getattr(one, name)
            ]
            for name in ("failures", "gates")
        )
        return {
            "dampers": self.n_tasks,
            **self.counts,
            "logs": sum(one.n_logs for one in self.done),
            "settings": sum(one.n_settings for one in self.done),
            "interrupted": self.is_stopped,
            "failures": failures,
            "gates_missed": gates,
            "tolerance": None if held is None else held.source,
            "dampers_out_of_tolerance": [] if held is None else [one.run for one in held.worst],
            "points": [] if held is None else tolerance_rows(held.missed),
            "capability": self.capability,
            "shifts": self.shifts[0],
            "run_rules": self.shifts[1],
        }

    def collect(self, bands: Tolerance | None, *, is_reported: bool) -> None:
        """Make the one table of all parts, its page, and hold its forces against bands."""
        from damperfit.fleets.parts import SUMMARY
        from damperfit.fleets.parts import collect as collected

        table = collected(self.folder)
        self.n_rows = table.num_rows
        if bands is None and not is_reported:
            return
        from damperfit.fleets.capability import capability, run_rules
        from damperfit.fleets.survey import fleet_against_bands, survey

        found = survey(table)
        self.shifts = run_rules(found)
        if bands is not None:
            self.held = fleet_against_bands(found, bands)
            self.capability = capability(found, self.held)
        if is_reported:
            from damperfit.fleets.page import write_page

            write_page(self.folder / SUMMARY, found, self.held, self.capability, self.shifts)
            self.page = self.folder / SUMMARY / "fleet.html"

    def __repr__(self) -> str:
        return f"<FleetDone: {self.n_tasks} dampers, {self.counts}>"
