"""A simulated test and a sweep, as they are returned: figures, tables, plots, lines."""

from __future__ import annotations

import csv
import math
import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from dataclasses import asdict
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from damperfit.adjustment.force_at import STROKE_WORDS, force_at
from damperfit.arrays import FloatArray
from damperfit.configuration.options import Configuration
from damperfit.damper.purdy.parameters import FAMILIES
from damperfit.damper.temperature_law import at_temperature
from damperfit.problem import Problem, in_a_row, warning
from damperfit.queries.settings import notes_on_simulation
from damperfit.queries.simulations import (
    FEW_SAMPLES,
    ChosenParameters,
    SweepMember,
    Variation,
    run_sweep,
    simulated,
    swept_units,
)
from damperfit.reporting.answer import Answer
from damperfit.reporting.plots import Line, Panel, Plot, loop, pressure_panel, setting_colours
from damperfit.reporting.sheet import Column, Sheet, laid_out, number, text_table
from damperfit.reporting.tables import BLOCK_LEVELS, sparkline
from damperfit.store import file_set
from damperfit.tables.files import json_values, time_series_table, write_table

if TYPE_CHECKING:
    import pandas as pd

_BRANCHES = "force at a speed: mean of both branches; hysteresis: opening less closing branch"
_BAR = 1e5  # Pa
_CELLS, _FEWEST = 44, 16  # characters of one cycle; where the terminal is narrow
_BESIDE = 36  # name and range of a line
_BLUE = "#0072b2"


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
        self.choice, self.damper = choice, damper
        self.temperature: float | None = getattr(configuration.damper, "temperature", None)
        self.motion, self.frequency, self.response, self._steady, self.characteristics = simulated(
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
        choice, figures = self.choice, self.characteristics
        neighbours = choice.between.neighbours if choice.between else ()
        stages = neighbours if choice.fitted is None else (choice.fitted,)
        run = choice.run if all(s.covariance is not None and s.names for s in stages) else None
        if run is None or not stages:
            return None
        damper = run.damper
        if self.temperature is not None:
            damper = at_temperature(damper, self.temperature)
        halves = []
        for k, speed in enumerate((figures.peak_speed_rebound, figures.peak_speed_bump)):
            # Both strokes of each setting; none: it cannot be simulated there.
            forces = force_at(stages, damper, [speed], measured=run.speed_forces)[k::2]
            if not forces:
                return None
            half = max(max(f.force - f.low, f.high - f.force) for f in forces)
            spread = choice.between.spread(damper, -speed if k else speed) if choice.between else 0
            halves.append(math.hypot(half, spread))
        return halves[0], halves[1]

    @property
    def _tested(self) -> dict[str, float]:
        """The motion's amplitude, frequency and top speed, to compare with the tests, SI."""
        amplitude = 0.5 * float(self.displacement.max() - self.displacement.min())
        fastest = float(abs(self.velocity).max())
        return {"amplitude": amplitude, "frequency": self.frequency, "speed": fastest}

    @property
    def trust(self) -> str:
        """Grade, interval, and that the motion was tested; empty where no run has it."""
        choice, figures = self.choice, self.characteristics
        if choice.fitted is None and choice.between is None:
            return ""
        phrases = [f"grade of the fit: {choice.fitted.grade}"] if choice.fitted else []
        if self.half_intervals is not None:
            rebound, bump = (f"{float(f'{half:.2g}'):g}" for half in self.half_intervals)
            phrases.append(
                f"95 % interval of the damper's force at {figures.peak_speed_rebound:.3g} m/s: "
                f"±{rebound} N in rebound, ±{bump} N in compression"
            )
            if choice.between is not None:
                neighbours = in_a_row([str(stage.setting) for stage in choice.between.neighbours])
                phrases[-1] += f" (from {neighbours}, and other curves between tested settings)"
        if choice.fitted and not any(choice.tested.outside(**self._tested)):
            phrases.append("amplitude, frequency and speed were tested")
        return "; ".join(phrases)

    @property
    def warnings(self) -> tuple[Problem, ...]:  # type: ignore[override]
        """What to know before believing the figures."""
        warned = list(self.choice.warnings(temperature=self.temperature, **self._tested))
        samples_a_cycle = 1.0 / (self.frequency * float(self.time[1] - self.time[0]))
        if samples_a_cycle < FEW_SAMPLES:
            text = (
                "peaks, hysteresis and forces at a speed are coarse; "
                f"{FEW_SAMPLES} or more are wanted ({{--sample-rate}})"
            )
            warned.append(warning("few-samples", text, f"{samples_a_cycle:.3g} samples a cycle"))
        text = (
            "chamber {chamber} is empty for {share} % of the cycle: these are the forces of a "
            "damper that cavitates; a slower motion or more gas keeps it full"
        )
        warned += [
            warning("cavitation", text, chamber=chamber, share=f"{100.0 * share:.3g}")
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
            document["grade"] = self.choice.fitted.grade
        if self.trust:
            halves = self.half_intervals or (None, None)
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

                draw_plot(draft, self._loops(self.title), kind=path.suffix[1:].lower())
            for files in sets.values():  # both before either is exchanged
                files.spare()

    def to_frame(self) -> pd.DataFrame:
        """Return the signals as a data frame, with units in the names of its columns."""
        frame: pd.DataFrame = time_series_table(self.response).to_pandas()
        return frame

    def plot(self) -> Any:
        """Draw force against displacement and against velocity; return both matplotlib axes."""
        from damperfit.reporting.drawing import compose, fixed_style

        with fixed_style():
            return compose(self._loops()).axes

    def _loops(self, title: str = "") -> Plot:
        """Return force against displacement and velocity over the last cycle."""
        steady = self._steady
        last = steady.time >= steady.time[-1] - (1.0 + 1e-9) / self.frequency
        panels = tuple(
            Panel(f"{word} (positive: rebound)", unit, "force", "N",
                  (Line(signal[last], steady.force[last], "force", _BLUE),))
            for word, unit, signal in (
                ("displacement", "mm", 1e3 * steady.displacement),
                ("velocity", "m/s", steady.velocity),
            )
        )  # fmt: skip
        return Plot("cycle", title, panels)

    def sheets(self) -> tuple[Sheet, ...]:
        """Return the figures of the last cycle; pressures of a model that has them."""
        figures = self.characteristics
        pairs = [
            ("peak force", "N", figures.peak_force_rebound, figures.peak_force_bump),
            ("peak speed", "m/s", figures.peak_speed_rebound, figures.peak_speed_bump),
            *((f"force at {f.speed:g} m/s", "N", f.rebound, f.bump) for f in figures.speed_forces),
            (
                *(f"hysteresis at {figures.hysteresis_speed:.3g} m/s", "N"),
                *(figures.hysteresis_rebound, figures.hysteresis_bump),
            ),
        ]
        rows = [(name, unit, *(number(f, digits=4) for f in pair)) for name, unit, *pair in pairs]
        rows.append(("energy per cycle", "J", number(figures.energy, digits=4), ""))
        headings, notes = (
            ("", "", *STROKE_WORDS.values()),
            (_BRANCHES, *[self.trust] * bool(self.trust)),
        )
        forces = Sheet(headings, ("",) * 4, tuple(rows), (False, False, True, True), notes)
        if math.isnan(figures.pressure_ranges[0][0]):
            return (forces,)
        low, high = (
            [number(p[end] / _BAR, digits=4) for p in figures.pressure_ranges] for end in (0, 1)
        )
        shares = (f"{100.0 * share:.1f}" for share in figures.cavitation_shares)
        lines = (
            ("lowest pressure", "bar", *low),
            ("highest pressure", "bar", *high),
            ("cavitation", "% of cycle", *shares),
        )
        headings = ("", "", "chamber 1", "chamber 2", "chamber 3")
        return forces, Sheet(headings, ("",) * 5, lines, (False, False, True, True, True))

    def last_cycle(self, columns: int = 80, levels: str = BLOCK_LEVELS) -> Iterator[str]:
        """Yield the last cycle as lines: displacement, force, pressures."""
        cells = max(_FEWEST, min(_CELLS, columns - _BESIDE))
        time, steady = self._steady.time, self._steady
        at = time[-1] - (1.0 - np.arange(cells) / (cells - 1.0)) / self.frequency
        is_inside = time >= at[0]
        signals = {
            ("displacement", "mm"): 1e3 * steady.displacement,
            ("force", "N"): steady.force,
            **{(f"pressure {i}", "bar"): p / _BAR for i, p in enumerate(steady.pressures, start=1)},
        }
        for (name, unit), signal in signals.items():
            if np.isfinite(signal).all():
                drawn = sparkline(np.interp(at, time, signal).tolist(), levels=levels)
                inside = signal[is_inside]
                low, high = (number(float(end), digits=4) for end in (inside.min(), inside.max()))
                yield f"{name:<12} {drawn} {low} to {high} {unit}"


# Heading, unit and key of each figure of a member, what it is in `Characteristics` and in words.
_SWEPT = (
    ("peak", "rebound N", "peak_force_rebound_N", "peak_force_rebound", "peak rebound"),
    ("peak", "compr. N", "peak_force_bump_N", "peak_force_bump", "peak compression"),
    ("", "", "hysteresis_speed_m_per_s", "hysteresis_speed", ""),
    ("hyst.", "rebound N", "hysteresis_rebound_N", "hysteresis_rebound", "hysteresis in rebound"),
    ("hyst.", "compr. N", "hysteresis_bump_N", "hysteresis_bump", "in compression"),
    ("energy", "J", "energy_J", "energy", ""),
)


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
        variations: Sequence[tuple[Variation, bool]],
    ) -> None:
        self.damper, self.source, self.notes = damper, choice.source, configuration.notes
        self.model = configuration.damper
        self.sweeps = tuple(
            (variation, run_sweep(choice.parameters, configuration, variation=variation), is_paper)
            for variation, is_paper in variations
        )
        cases = [(varied.name, member) for varied, members, _ in self.sweeps for member in members]
        self.records: list[dict[str, Any]] = [
            {
                "quantity": name,
                "factor": member.factor,
                "value": member.value,
                **{key: getattr(member.figures, figure) for _, _, key, figure, _ in _SWEPT},
                **{
                    f"cavitation_fraction_{i}": share
                    for i, share in enumerate(member.figures.cavitation_shares, start=1)
                },
            }
            for name, member in cases
        ]
        self.symbols = {varied.name: varied.name for varied, _, _ in self.sweeps} | {
            quantity.name: quantity.symbol for quantity in self.model.quantities
        }
        self.sentences = tuple(
            _in_words(self.symbols[varied.name], members) for varied, members, _ in self.sweeps
        )
        top_speed = max(float(abs(member.response.velocity).max()) for _, member in cases)
        self.warnings = choice.warnings(top_speed, getattr(self.model, "temperature", None))

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
        """Its figures: force-velocity loops (black at factor 1), pressures that cavitate."""
        plots = []
        families = {family.name: family for family in FAMILIES}
        for (variation, members, is_paper), words in zip(self.sweeps, self.sentences, strict=True):
            name, family = variation.name, families[variation.name] if is_paper else None
            symbol, lines = self.symbols[name], []
            colours = setting_colours(range(len(members))).values()
            for member, colour in zip(members, colours, strict=True):
                signals = (member.response.velocity, member.response.force)
                ink = "ink" if member.factor == 1.0 else colour
                label = f"{member.factor:g} × {symbol}"
                lines.append(Line(*loop(*signals, member.last_cycle), label, ink))
            file_name = f"figure_{family.number}_{name}" if family else f"sweep_{name}"
            title = f"Force against velocity, {symbol} varied"
            panel = Panel("velocity", "m/s", "force", "N", tuple(lines))
            plots.append(Plot(file_name, title, (panel,), words))
            worst = max(members, key=lambda member: member.cavitation)
            of_pressures = family.of_pressures if family else 0
            if worst.cavitation > 0.0 or of_pressures:
                prefix = f"figure_{of_pressures or 7}" if family else "sweep"
                title = f"Chamber pressures, {worst.factor:g} × {symbol}"
                response = worst.response
                panel = pressure_panel(response.time, response.pressures, worst.last_cycle)
                caption = "Shaded: cavitation." if panel.bands else ""
                plots.append(Plot(f"{prefix}_{name}_pressures", title, (panel,), caption))
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
        """Return a table a variation, a row a member."""

        def cell(figure: str) -> Callable[[SweepMember], str]:
            return lambda member: number(getattr(member.figures, figure), digits=4)

        figures = [Column(heading, unit, cell(of)) for heading, unit, _, of, _ in _SWEPT if heading]
        units = swept_units(self.model)
        cavitation = "cavitation", "% of cycle", lambda member: f"{100.0 * member.cavitation:.1f}"
        return tuple(
            laid_out(members, [
                Column("factor", "", lambda member: f"{member.factor:g}"),
                Column(self.symbols[name], units[name], lambda member: number(member.value)),
                *figures,
                Column(*cavitation),
            ])
            for (name, _), members, _ in self.sweeps
        )  # fmt: skip

    def __repr__(self) -> str:
        pairs = zip(self.sheets(), self.sentences, strict=True)
        texts = [f"{text_table(sheet, 100)}\n{sentence}" for sheet, sentence in pairs]
        return "\n\n".join(filter(None, (*texts, "\n".join(self._to_know))))


def _in_words(name: str, members: Sequence[SweepMember]) -> str:
    """Return what changes from the lowest to the highest factor, in one sentence."""
    ranked = sorted(members, key=lambda member: member.factor)
    first, last = ranked[0], ranked[-1]
    dry = [
        f"chamber {i} for {100.0 * share:.1f} % of the cycle at {member.factor:g} × {name}"
        for member in ranked
        for i, share in enumerate(member.figures.cavitation_shares, start=1)
        if share > 0.0
    ]
    cavitation = f"cavitation: {', '.join(dry)}" if dry else "no chamber cavitates"
    if len(ranked) == 1:
        return f"{first.factor:g} × {name}: {cavitation}."
    changes = []
    for *_, figure, words in _SWEPT:
        if words:
            before, after = (abs(getattr(member.figures, figure)) for member in (first, last))
            gain = round(100.0 * (after / before - 1.0), 1) + 0.0 if before > 0.0 else None
            share_of = "" if gain is None else f" ({gain:+.1f} %)"
            forces = f"{number(before, digits=4)} to {number(after, digits=4)} N"
            changes.append(f"{words} {forces}{share_of}")
    return f"{first.factor:g} to {last.factor:g} × {name}: {', '.join(changes)}; {cavitation}."
