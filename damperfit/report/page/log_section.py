"""What the page says of one log: its verdict, its findings, its figures and its forces."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from damperfit.report.log_in_units import log_in_units
from damperfit.report.page.summary import setting_verdict
from damperfit.report.sheets.in_units import sheet_in_units
from damperfit.report.sheets.log_force_sheet import measured_and_simulated_sheet
from damperfit.report.sheets.parameter_sheet import parameter_line
from damperfit.report.sheets.stretch_sheet import ComparedStretch, compared_stretch_sheet
from damperfit.tables import PAPER_QUANTITIES
from damperfit.units.shown_units import SI, ShownUnits

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from damperfit.damper.quantity import Quantity
    from damperfit.report.evaluated_log import EvaluatedLog
    from damperfit.report.page.plot_data import Figure
    from damperfit.report.sheets.sheet import Sheet
    from damperfit.tested.setting import Setting

__all__ = ["LogSection", "log_section"]


@dataclass(frozen=True, slots=True)
class LogSection:
    """One log on the page; its template is `log.html`.

    Attributes
    ----------
    setting : Setting
        Adjuster setting.
    anchor : str
        Where the page can be entered: ``setting-12``; a second log has ``setting-12-log-2``.
    log : str
        Name of the log.
    verdict : str
        How the fit of the setting went; empty where there is none.
    facts : str
        The test in a sentence.
    findings, notes, reading : tuple of str
        What matters, what is good to know, and how the log was read.
    figures : tuple of Figure
        Where its plots stand.
    forces : Sheet or None
        None when the log has no whole cycle.
    stretches : Sheet or None
        None when the log is one steady run.
    """

    setting: Setting
    anchor: str
    log: str
    verdict: str
    facts: str
    findings: tuple[str, ...]
    notes: tuple[str, ...]
    reading: tuple[str, ...]
    figures: tuple[Figure, ...]
    forces: Sheet | None
    stretches: Sheet | None = None


def log_section(
    log: EvaluatedLog,
    figures: Sequence[Figure],
    row: Mapping[str, Any] | None,
    quantities: Sequence[Quantity] = PAPER_QUANTITIES,
    *,
    anchor: str = "",
    units: ShownUnits = SI,
) -> LogSection:
    """Return the section of a log.

    Parameters
    ----------
    log : EvaluatedLog
        The log.
    figures : sequence of Figure
        Where its plots stand.
    row : mapping or None
        Parameters of its setting, if known.
    quantities : sequence of Quantity
        What the row is of.
    anchor : str
        Where the page can be entered here.
    units : ShownUnits
        Of its tables.
    """
    verdict = ""
    if row:
        verdict = f"Fit of the setting: {setting_verdict(row)}. {parameter_line(row, quantities)}"
    read = log_in_units(log, units)
    return LogSection(
        setting=log.signals.setting,
        anchor=anchor,
        log=log.signals.log,
        verdict=verdict,
        facts=_facts(log, units),
        findings=tuple(f"{f.severity}: {f.sentence}" for f in log.findings if f.severity != "note"),
        notes=tuple(f.sentence for f in log.findings if f.severity == "note"),
        reading=log.notes,
        figures=tuple(figures),
        forces=_forces(read, units),
        stretches=_stretches(read, units),
    )


def _stretches(log: EvaluatedLog, units: ShownUnits) -> Sheet | None:
    if not log.stretches:
        return None
    sheet = compared_stretch_sheet(
        [
            ComparedStretch(one.start, one.n_cycles, one.frequency, one.measured, one.simulated)
            for one in log.stretches
        ]
    )
    return sheet_in_units(sheet, units)


def _facts(log: EvaluatedLog, units: ShownUnits) -> str:
    frequency = f"{log.frequency:.3g} Hz" if math.isfinite(log.frequency) else "frequency unknown"
    amplitude = units.say_lengths(f"amplitude {1e3 * log.amplitude:.3g} mm")
    if log.stretches:
        fastest = max(one.measured.peak_speed_rebound for one in log.stretches)
        n = len(log.stretches)
        frequency = f"{n} stretch{'es' * (n > 1)}, to {units.write(fastest, 'm/s', '.3g')}"
    warmth = log.temperature
    temperature = "temperature not logged" if warmth is None else f"{warmth:.1f} degC"
    samples = f"{len(log.signals.time)} samples evaluated"
    return f"{frequency}, {amplitude}, {temperature}, {samples}."


def _forces(log: EvaluatedLog, units: ShownUnits) -> Sheet | None:
    if log.measured is None or log.simulated is None:
        return None
    warmth = log.temperature
    sheet = measured_and_simulated_sheet(log.measured, log.simulated, temperature=warmth)
    return sheet_in_units(sheet, units)
