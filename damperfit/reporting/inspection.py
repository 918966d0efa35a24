"""What is in the logs, for people: one row a log with its verdict, and the findings below.

The facts are those of `damperfit.run.logs.LogFacts`: JSON values, also of logs that were refused.
"""

from __future__ import annotations

from textwrap import wrap
from typing import TYPE_CHECKING, Any

import numpy as np

from damperfit.io import ForceCurve
from damperfit.problem import FEW, Problem, listed_names
from damperfit.reporting.forces import STROKE_WORDS
from damperfit.reporting.sheet import NOTHING, Column, Sheet, laid_out, number

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence

    Facts = Mapping[str, Any]

VERDICT_COLOURS = {"good": 32, "warnings": 33, "curves": 36, "refused": 31}  # ANSI
_VERDICTS = {
    "good": "good",
    "warnings": "usable with warnings",
    "curves": "curves without time, which cannot be fitted",
    "refused": "refused",
}
_NOISE_NOTE = "* read above the filter's band; otherwise from the scatter between cycles"
_WIDTH = 80
_SHOWN_UNITS = {"m": (1e3, "mm"), "s": (1e3, "ms"), "Pa": (1e-5, "bar")}
MANY_ROWS = 60  # of a table; two screens
_ROWS_OF_REFUSED = 5  # where none of many logs can be used
_EACH = 3  # sentences of one kind of finding that are listed one by one
_HEADINGS = {"refusal": "Refused", "warning": "Warnings: usable, but read them"}
_CURVE_SPEEDS = (0.05, 0.1, 0.13, 0.26, 0.52)  # m/s, of the speeds that damper tests name


# Tables


def inspection_sheet(logs: Iterable[Facts]) -> Sheet:
    """Return one row per log: what was found in it, and whether it can be used."""

    def cycles(log: Facts) -> str:
        used = log.get("cycles_used")
        return NOTHING if used is None else f"{used} of {log.get('cycles_found')}"

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
    everything = list(logs)
    if len(everything) <= MANY_ROWS:
        return laid_out(everything, columns)
    usable = [log for log in everything if log.get("verdict") != "refused"]
    shown = usable[:MANY_ROWS] or everything[:_ROWS_OF_REFUSED]
    left_out = f"{len(everything) - len(shown)} of {len(everything)} logs"
    return laid_out(shown, columns, f"{left_out} have no row here; --json lists them all")


def stretch_sheet(logs: Iterable[Facts]) -> Sheet:
    """Return one row per segment of the logs that are no single steady run; no rows without."""

    def noise(row: Facts) -> str:
        is_spectral = row["noise_source"] == "above the filter"
        return number(row["noise_N"], digits=2) + "*" * bool(is_spectral)

    rows = []
    for log in logs:
        segments = log.get("stretches", [])
        if len(segments) == 1 and segments[0]["kind"] == "steady":
            continue
        names = [str(log["name"]), *("" for _ in segments[1:])]
        rows += [{**one, "name": name} for name, one in zip(names, segments, strict=False)]
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
    more = len(rows) - MANY_ROWS
    notes += [f"{more} more segments have no row here; --json lists them all"] if more > 0 else []
    return laid_out(rows[:MANY_ROWS], columns, *notes)


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
            if not len(v):
                continue
            rows.append(
                (
                    *(name, word, str(len(v)), number(float(v.max()), digits=3)),
                    number(float(f[np.argmax(np.abs(f))]), digits=4),
                    *(number(curve.force_at(speed, stroke), digits=4) for speed in speeds),
                    number(curve.hysteresis_at(0.5 * float(v.max()), stroke), digits=3),
                )
            )
            name = ""
    n = 5 + len(speeds) + any(row[-1] != NOTHING for row in rows)  # points have no hysteresis
    more = len(rows) - MANY_ROWS
    headings = ("curve", "stroke", "points", "to", "peak", *map("{:g}".format, speeds), "hyst.")
    return Sheet(
        headings=headings[:n],
        units=("", "", "", "m/s", "N", *("m/s, N" for _ in speeds), "N")[:n],
        rows=tuple(row[:n] for row in rows[:MANY_ROWS]),
        is_number=(False, False, *(True,) * (n - 2)),
        notes=(
            "forces are read between measured points, of loops the mean of both branches",
            *([f"{more} more rows are not shown; --json lists them all"] if more > 0 else []),
        ),
    )


# Findings


def finding_lines(
    logs: Sequence[Facts], *, has_notes: bool = True, columns: int = _WIDTH
) -> Iterator[str]:
    """Yield the findings of all logs as lines of at most so many columns, the worst first.

    A sentence that is true of several logs is shown once. Notes of several logs are shown as the
    range of their numbers, as each sentence differs; ``has_notes`` False leaves notes out.
    """
    verdicts = [log.get("verdict", "good") for log in logs]
    counts = (f"{verdicts.count(one)} {words}" for one, words in _VERDICTS.items()
              if one in verdicts)  # fmt: skip
    yield f"{len(logs)} log{'s' * (len(logs) != 1)}: {', '.join(counts)}"
    for severity, heading in _HEADINGS.items():
        if by_code := _by_code(logs, severity):
            yield from ("", heading, *_indented(_grouped(by_code), columns))
    if has_notes:
        if notes := _by_code(logs, "note"):
            said = (_note(found, len(logs)) for found in notes.values())
            yield from ("", "Notes", *_indented(said, columns))
        if read := list(_read_as(logs)):
            yield from ("", "Read as", *_indented(read, columns))


def _by_code(logs: Sequence[Facts], severity: str) -> dict[str, list[tuple[str, Facts]]]:
    """Return, by the code of a problem, the logs that have it, with their findings."""
    by_code: dict[str, list[tuple[str, Facts]]] = {}
    for log in logs:
        for one in log.get("findings", ()):
            if one["severity"] == severity:
                # Refusals share a few names: the problem tells their causes apart.
                code = one["name"]
                if severity == "refusal" and log.get("code"):
                    subject = str(log["name"])
                    code = Problem(log["code"], one["sentence"], subject=subject).likeness
                by_code.setdefault(code, []).append((str(log["name"]), one))
    return by_code


def _grouped(by_code: Mapping[str, list[tuple[str, Facts]]]) -> Iterator[str]:
    """Yield a line for each sentence; one for each code where it differs from log to log."""
    for found in list(by_code.values())[:FEW]:
        sentences: dict[str, list[str]] = {}
        for log, one in found:
            sentences.setdefault(f"{one['name']}: {one['sentence']}", []).append(log)
        if len(sentences) <= _EACH:
            for sentence, names in sentences.items():
                n = len(set(names)) - 1
                others = f" and {n} other log{'s' * (n > 1)}" if n else ""
                yield f"{names[0]}{others}: {sentence}"
            continue
        sentence, (first, *_) = next(iter(sentences.items()))
        others = listed_names([log for log in dict.fromkeys(log for log, _ in found)
                               if log != first], few=FEW)  # fmt: skip
        yield f"{first}: {sentence}. With other numbers in {others}"
    if len(by_code) > FEW:
        yield f"and {len(by_code) - FEW} more kinds; --json lists them all"


def _note(found: Sequence[tuple[str, Facts]], n_logs: int) -> str:
    """Return a note of several logs once, with the range of its number."""
    (_, first), values = found[0], [one.get("value") for _, one in found]
    said = f"{first['name']}: {first['sentence']}"
    if n_logs == 1:
        return said
    known = sorted(float(value) for value in values if value is not None)
    factor, unit = _SHOWN_UNITS.get(first.get("unit") or "", (1.0, first.get("unit") or ""))
    low, high = (number(factor * known[end], digits=3) for end in (0, -1)) if known else ("", "")
    spread = f"; {low} to {high} {unit}".rstrip() if low != high else ""
    return f"{said} ({len(found)} of {n_logs} logs{spread})"


def _read_as(logs: Sequence[Facts]) -> Iterator[str]:
    """Yield what was assumed in reading, each assumption once."""
    notes: dict[str, int] = {}
    for log in logs:
        told = {one["sentence"] for one in log.get("findings", ())}
        for note in log.get("notes", ()):
            if note not in told:
                notes[note] = notes.get(note, 0) + 1
    for note, n in list(notes.items())[:FEW]:
        yield f"{note} ({n} of {len(logs)} logs)" if len(logs) > 1 else note
    if len(notes) > FEW:
        yield f"and {len(notes) - FEW} more; --json lists them all"


def _indented(lines: Iterable[str], columns: int) -> Iterator[str]:
    for line in lines:
        yield from wrap(
            " ".join(line.split()), columns, initial_indent="  ", subsequent_indent="    ",
            break_long_words=False, break_on_hyphens=False,
        )  # fmt: skip
