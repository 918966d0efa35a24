"""Logs for people: one row a log with its verdict, and the findings below.

The facts are those of `damperfit.run.logs.LogFacts`: JSON values, also of logs that were refused.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import chain
from textwrap import wrap
from typing import TYPE_CHECKING, Any

import numpy as np

from damperfit.adjustment.force_at import STROKE_WORDS
from damperfit.io.force_curves import ForceCurve
from damperfit.problem import FEW, Problem, counted, findings_in, listing
from damperfit.reporting.answer import Answer
from damperfit.reporting.sheet import NOTHING, Column, Sheet, first_of, laid_out, number

if TYPE_CHECKING:
    import pandas as pd

    from damperfit.run.logs import LogBatch

    Facts = Mapping[str, Any]

_VERDICTS = {
    "good": "good",
    "warnings": "usable with warnings",
    "curves": "curves without time, which cannot be fitted",
    "refused": "refused",
}
_NOISE_NOTE = "* read above the filter's band; otherwise from the scatter between cycles"
_WIDTH, _WHOLE = 80, 100_000
_SHOWN_UNITS = {"m": (1e3, "mm"), "s": (1e3, "ms"), "Pa": (1e-5, "bar")}
MANY_ROWS = 60  # of a table; two screens
_ROWS_OF_REFUSED = 5  # where none of many logs can be used
_HEADINGS = {"refusal": "Refused", "warning": "Warnings: usable, but read them"}
_CURVE_SPEEDS = (0.05, 0.1, 0.13, 0.26, 0.52)  # m/s, of the speeds that damper tests name
_LISTED = "have no row here; --json lists them all"


class Inspection(Answer):
    """What is in logs: `batch` has what was found of each, `facts` the same as JSON values."""

    def __init__(self, batch: LogBatch) -> None:
        self.batch = batch
        self.facts = [log.facts for log in batch.logs]
        n_bad = len(batch.failures)
        self.sentence = f"{counted(len(batch.logs), 'log')}, {n_bad} cannot be used"

    @property
    def failures(self) -> tuple[str, ...]:
        """Logs that cannot be used, a sentence each."""
        return tuple(failure.message for failure in self.batch.failures)

    @property
    def findings(self) -> tuple[Facts, ...]:
        """What their data show, a record each: log, name, severity, sentence, value, unit ..."""
        return tuple(
            {"log": log["name"]} | finding
            for log in self.facts
            for finding in log.get("findings", ())
        )

    @property
    def remarks(self) -> tuple[str, ...]:  # type: ignore[override]
        """The same as sentences under headings, the worst first."""
        return tuple(line.strip() for line in finding_lines(self.facts, columns=_WHOLE) if line)

    @property
    def _to_know(self) -> list[str]:  # its lines say themselves how much they matter
        return [*self.remarks]

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
        return tuple(make(self.facts) for make in (inspection_sheet, segments_sheet, curve_sheet))


# Tables


def inspection_sheet(logs: Iterable[Facts]) -> Sheet:
    """Return one row per log: its figures, and whether it can be used."""

    def cycles(log: Facts) -> str:
        n_used = log.get("cycles_used")
        return NOTHING if n_used is None else f"{n_used} of {log.get('cycles_found')}"

    columns = [
        Column.text("log", "name", missing=NOTHING),
        Column.text("set", "setting", is_number=True, missing=NOTHING),
        Column.text("samples", "n_samples_read", is_number=True, missing=NOTHING),
        Column.of("rate", "Hz", "sample_rate_Hz"),
        Column("cycles", "used", cycles),
        Column.of("freq.", "Hz", "frequency_Hz"),
        Column.of("ampl.", "mm", "amplitude_m", factor=1e3),
        Column.of("temp.", "degC", "temperature_degC", digits=3),
        Column.text("verdict", "verdict", missing=NOTHING),
    ]
    rows = list(logs)
    if len(rows) <= MANY_ROWS:
        return laid_out(rows, columns)
    usable = [log for log in rows if log.get("verdict") != "refused"]
    listed = usable[:MANY_ROWS] or rows[:_ROWS_OF_REFUSED]
    unlisted = f"{len(rows) - len(listed)} of {len(rows)} logs"
    return laid_out(listed, columns, f"{unlisted} {_LISTED}")


def segments_sheet(logs: Iterable[Facts]) -> Sheet:
    """Return one row per segment of the logs that are no single steady run; no rows without."""

    def noise(row: Facts) -> str:
        is_spectral = row["noise_source"] == "above the filter"
        return number(row["noise_N"], digits=2) + "*" * bool(is_spectral)

    rows = []
    for log in logs:
        segments = log.get("stretches", [])
        if [segment["kind"] for segment in segments] != ["steady"]:
            names = [str(log["name"]), *("" for _ in segments[1:])]
            pairs = zip(names, segments, strict=False)
            rows += [{**segment, "name": name} for name, segment in pairs]
    columns = [
        Column.text("segments", "name"),
        Column.of("from", "s", "start_s"),
        Column("cycles", "", lambda row: str(row["cycles"]) if row["cycles"] else "moving"),
        Column.of("freq.", "Hz", "frequency_Hz", digits=3),
        Column.of("ampl.", "mm", "amplitude_m", digits=3, factor=1e3),
        Column.of("speed", "m/s", "peak_speed_m_per_s", digits=3),
        Column.of("rebound", "N", "peak_force_rebound_N"),
        Column.of("compression", "N", "peak_force_bump_N"),
        Column.of("energy", "J", "energy_J", digits=3),
        Column("noise", "N", noise),
    ]
    notes = [_NOISE_NOTE] if any("*" in noise(row) for row in rows) else []
    listed, others = first_of(rows, MANY_ROWS, f"segments {_LISTED}")
    return laid_out(listed, columns, *notes, *others)


def curve_sheet(logs: Iterable[Facts]) -> Sheet:
    """Return one row per curve and stroke of the files without time; no rows without."""
    files = [log for log in logs if log.get("curves")]
    curves = []
    for log in files:
        for facts in log["curves"]:
            velocity, force = (np.array(facts[name]) for name in ("velocity_m_per_s", "force_N"))
            file, label = str(log["name"]), str(facts["label"])
            label = f"{file}: {label}" if len(files) > 1 and label != file else label
            curves.append(ForceCurve("", "", "", label, velocity, force))
    return curve_forces_sheet(curves, _CURVE_SPEEDS)


def curve_forces_sheet(curves: Sequence[ForceCurve], speeds: Sequence[float]) -> Sheet:
    """Return one row per curve and stroke: points, peaks and forces at some speeds, m/s."""
    rows = []
    for curve in curves:
        name = curve.label
        for stroke, word in STROKE_WORDS.items():
            v, f = curve.points(stroke)
            if len(v):
                fastest, peak = float(v.max()), float(f[np.argmax(np.abs(f))])
                forces = (peak, *(curve.force_at(speed, stroke) for speed in speeds))
                width = number(curve.hysteresis_at(0.5 * fastest, stroke), digits=3)
                texts = (number(force, digits=4) for force in forces)
                rows.append((name, word, str(len(v)), number(fastest, digits=3), *texts, width))
                name = ""
    n = 5 + len(speeds) + any(row[-1] != NOTHING for row in rows)  # points have no hysteresis
    listed, others = first_of(rows, MANY_ROWS, "rows are not shown; --json lists them all")
    headings = ("curve", "stroke", "points", "to", "peak", *map("{:g}".format, speeds), "hyst.")
    units = ("", "", "", "m/s", "N", *("m/s, N" for _ in speeds), "N")
    note = "forces are read between measured points, of loops the mean of both branches"
    is_number = (False, False, *(True,) * (n - 2))
    cells = tuple(row[:n] for row in listed)
    return Sheet(headings[:n], units[:n], cells, is_number, (note, *others))


# Findings


def finding_lines(
    logs: Sequence[Facts], *, has_notes: bool = True, columns: int = _WIDTH
) -> Iterator[str]:
    """Yield the findings of all logs as lines of at most so many columns, the worst first.

    A sentence that is true of several logs is shown once. Notes of several logs are shown as the
    range of their numbers, as each sentence differs; ``has_notes`` False leaves notes out.
    """
    verdicts = Counter(log.get("verdict", "good") for log in logs)
    counts = (f"{verdicts[key]} {words}" for key, words in _VERDICTS.items() if verdicts[key])
    yield f"{counted(len(logs), 'log')}: {', '.join(counts)}"
    groups = {heading: _grouped(logs, severity) for severity, heading in _HEADINGS.items()}
    if has_notes:
        notes: dict[str, list[Problem]] = {}
        for finding in chain.from_iterable(map(findings_in, logs)):
            if finding.severity == "note":
                notes.setdefault(finding.code, []).append(finding)
        groups["Notes"] = [_note(group, len(logs)) for group in notes.values()]
        read_as: Counter[str] = Counter()  # what was assumed in reading, each assumption once
        for log in logs:
            sentences = {finding.message() for finding in findings_in(log)}
            read_as.update(note for note in log.get("notes", ()) if note not in sentences)
        groups["Read as"] = [
            f"{note} ({n} of {len(logs)} logs)" if len(logs) > 1 else note
            for note, n in list(read_as.items())[:FEW]
        ]
        if len(read_as) > FEW:
            groups["Read as"].append(f"and {len(read_as) - FEW} more; --json lists them all")
    for heading, lines in groups.items():
        if lines:
            yield from ("", heading)
        for line in lines:
            yield from wrap(
                " ".join(line.split()), columns, initial_indent="  ", subsequent_indent="    ",
                break_long_words=False, break_on_hyphens=False,
            )  # fmt: skip


def _grouped(logs: Sequence[Facts], severity: str) -> list[str]:
    """Return a line for each sentence; of many of one code the first, and the number of logs."""
    findings: dict[str, tuple[Problem, dict[str, None]]] = {}
    for log in logs:
        for finding in findings_in(log):
            if finding.severity == severity:
                # Refusals share a few names: the problem's code separates their causes.
                code = str((severity == "refusal" and log.get("code")) or finding.code)
                keyed = replace(finding, code=code, text=f"{finding.code}: {finding.text}")
                names = findings.setdefault(keyed.message(), (keyed, {}))[1]
                names[str(log["name"])] = None
    problems = []
    for finding, (first, *others) in findings.values():
        subject = first + f" and {counted(len(others), 'other log')}" * bool(others)
        problems.append(replace(finding, subject=subject))
    return listing(problems, where="--json lists", few=FEW)


def _note(findings: Sequence[Problem], n_logs: int) -> str:
    """Return a note of several logs once, with the range of its number."""
    first, values = findings[0], [finding.values["value"] for finding in findings]
    note = f"{first.code}: {first.message()}"
    if n_logs == 1:
        return note
    numbers = sorted(value for value in values if value is not None) or [np.nan]
    factor, unit = _SHOWN_UNITS.get(first.values["unit"], (1.0, first.values["unit"]))
    low, high = (number(factor * numbers[end], digits=3) for end in (0, -1))
    spread = f"; {low} to {high} {unit}".rstrip() if low != high else ""
    return f"{note} ({len(findings)} of {n_logs} logs{spread})"
