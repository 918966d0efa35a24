"""What is in the logs, for people: one row a log with its verdict, and the findings below.

The facts are those of `damperfit.run.logs.LogFacts`: JSON values, also of logs that were refused.
"""

from __future__ import annotations

from textwrap import wrap
from typing import TYPE_CHECKING, Any

from damperfit.problem import FEW, Problem, listed_names
from damperfit.reporting.sheet import NOTHING, Column, Sheet, laid_out, number

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence

VERDICT_COLOURS = {"good": 32, "warnings": 33, "curves": 36, "refused": 31}  # ANSI
_NOISE_NOTE = "* read above the filter's band; otherwise from the scatter between cycles"
_WIDTH = 80
_SHOWN_UNITS = {"m": (1e3, "mm"), "s": (1e3, "ms"), "Pa": (1e-5, "bar")}
MANY_ROWS = 60  # of a table; two screens
_ROWS_OF_REFUSED = 5  # where none of many logs can be used
_EACH = 3  # sentences of one kind of finding that are listed one by one
_HEADINGS = {"refusal": "Refused", "warning": "Warnings: usable, but read them"}


def inspection_sheet(logs: Iterable[Mapping[str, Any]]) -> Sheet:
    """Return one row per log: what was found in it, and whether it can be used."""

    def cell(name: str) -> Callable[[Mapping[str, Any]], str]:
        return lambda log: NOTHING if log.get(name) is None else str(log[name])

    def cycles(log: Mapping[str, Any]) -> str:
        used = log.get("cycles_used")
        return NOTHING if used is None else f"{used} of {log.get('cycles_found')}"

    columns = [
        Column("log", "", cell("name"), is_number=False),
        Column("set", "", cell("setting")),
        Column("samples", "", cell("n_samples_read")),
        Column.of("rate", "Hz", "sample_rate_Hz"),
        Column("cycles", "used", cycles),
        Column.of("freq.", "Hz", "frequency_Hz"),
        Column.of("ampl.", "mm", "amplitude_m", factor=1e3),
        Column.of("temp.", "degC", "temperature_degC", digits=3),
        Column("verdict", "", cell("verdict"), is_number=False),
    ]
    shown, notes = _shown(list(logs))
    return laid_out(shown, columns, *notes)


def _shown(logs: Sequence[Mapping[str, Any]]) -> tuple[list[Mapping[str, Any]], tuple[str, ...]]:
    """Return the logs that have a row: all, or of many the first that can be used."""
    if len(logs) <= MANY_ROWS:
        return list(logs), ()
    usable = [log for log in logs if log.get("verdict") != "refused"]
    shown = usable[:MANY_ROWS] or logs[:_ROWS_OF_REFUSED]
    left_out = len(logs) - len(shown)
    return list(shown), (f"{left_out} of {len(logs)} logs have no row here; --json lists them all",)


def stretch_sheet(logs: Iterable[Mapping[str, Any]]) -> Sheet:
    """Return one row per segment of the logs that are no single steady run; no rows without."""

    def noise(row: Mapping[str, Any]) -> str:
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
        Column("segments", "", lambda row: str(row["name"]), is_number=False),
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
    if len(rows) > MANY_ROWS:
        notes.append(
            f"{len(rows) - MANY_ROWS} more segments have no row here; --json lists them all"
        )
    return laid_out(rows[:MANY_ROWS], columns, *notes)


def finding_lines(
    logs: Sequence[Mapping[str, Any]], *, has_notes: bool = True, columns: int = _WIDTH
) -> Iterator[str]:
    """Yield the findings of all logs as lines of at most so many columns, the worst first.

    A sentence that is true of several logs is shown once. Notes of several logs are shown as the
    range of their numbers, as each sentence differs; ``has_notes`` False leaves notes out.
    """
    for line in _finding_lines(logs, has_notes=has_notes):
        yield from _wrapped(line, columns)


def _finding_lines(logs: Sequence[Mapping[str, Any]], *, has_notes: bool) -> Iterator[str]:
    yield _verdicts(logs)
    for severity, heading in _HEADINGS.items():
        by_code = _by_code(logs, severity)
        if by_code:
            yield from ("", heading)
        yield from map(_indented, _grouped(by_code))
    if has_notes:
        notes = _by_code(logs, "note")
        if notes:
            yield from ("", "Notes")
        yield from (_indented(_note(found, len(logs))) for found in notes.values())
        yield from _reading_lines(logs)


def _verdicts(logs: Sequence[Mapping[str, Any]]) -> str:
    counts = dict.fromkeys(VERDICT_COLOURS, 0)
    for log in logs:
        counts[log.get("verdict", "good")] += 1
    words = {
        "good": "good",
        "warnings": "usable with warnings",
        "curves": "curves without time, which cannot be fitted",
        "refused": "refused",
    }
    parts = [f"{count} {words[verdict]}" for verdict, count in counts.items() if count]
    return f"{len(logs)} log{'s' * (len(logs) != 1)}: {', '.join(parts)}"


def _by_code(
    logs: Sequence[Mapping[str, Any]], severity: str
) -> dict[str, list[tuple[str, Mapping[str, Any]]]]:
    """Return, by the code of a problem, the logs that have it, with their findings."""
    by_code: dict[str, list[tuple[str, Mapping[str, Any]]]] = {}
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


def _grouped(by_code: Mapping[str, list[tuple[str, Mapping[str, Any]]]]) -> Iterator[str]:
    """Yield a line for each sentence; one for each code where it differs from log to log."""
    for found in list(by_code.values())[:FEW]:
        sentences: dict[str, list[str]] = {}
        for log, one in found:
            sentences.setdefault(f"{one['name']}: {one['sentence']}", []).append(log)
        if len(sentences) <= _EACH:
            yield from (f"{_named(names)}: {sentence}" for sentence, names in sentences.items())
            continue
        sentence, (first, *_) = next(iter(sentences.items()))
        others = [log for log in dict.fromkeys(log for log, _ in found) if log != first]
        listed = listed_names(others, few=FEW)
        yield f"{first}: {sentence}. With other numbers in {listed}"
    if len(by_code) > FEW:
        yield f"and {len(by_code) - FEW} more kinds; --json lists them all"


def _note(found: Sequence[tuple[str, Mapping[str, Any]]], n_logs: int) -> str:
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


def _reading_lines(logs: Sequence[Mapping[str, Any]]) -> Iterator[str]:
    """Yield what was assumed in reading, each assumption once."""
    notes: dict[str, int] = {}
    for log in logs:
        told = {one["sentence"] for one in log.get("findings", ())}
        for note in log.get("notes", ()):
            if note not in told:
                notes[note] = notes.get(note, 0) + 1
    if notes:
        yield from ("", "Read as")
    for note, n in list(notes.items())[:FEW]:
        yield _indented(f"{note} ({n} of {len(logs)} logs)" if len(logs) > 1 else note)
    if len(notes) > FEW:
        yield _indented(f"and {len(notes) - FEW} more; --json lists them all")


def _named(names: Sequence[str]) -> str:
    others = len(set(names)) - 1
    return f"{names[0]} and {others} other log{'s' * (others > 1)}" if others else names[0]


def _indented(text: str) -> str:
    return "  " + " ".join(text.split())


def _wrapped(line: str, columns: int) -> list[str]:
    """Wrap what is indented; headings are short."""
    if not line.startswith("  "):
        return [line]
    return wrap(
        line.strip(),
        columns,
        initial_indent="  ",
        subsequent_indent="    ",
        break_long_words=False,
        break_on_hyphens=False,
    )
