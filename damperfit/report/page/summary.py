"""The upper part of the page: what was tested, how it went, what to believe."""

from __future__ import annotations

from dataclasses import dataclass
from statistics import median
from typing import TYPE_CHECKING, Any, NamedTuple

from damperfit.adjustment import in_few_words
from damperfit.identification.sharing import of_runs
from damperfit.report.alike import short_listing, summarised
from damperfit.report.failures_and_warnings import failure_lines
from damperfit.report.json_records import (
    checks_in,
    failures_in,
    findings_in,
    gaps_in,
    held_out_in,
    law_in,
    listed_in,
    sentences_in,
    trends_in,
)
from damperfit.report.sheets.check_sheet import CHECK_WORDS
from damperfit.report.sheets.law_sheet import law_sentences
from damperfit.report.sheets.mse_sheet import flags, grade_counts
from damperfit.report.sheets.rounding import number, percent
from damperfit.report.sheets.sheet import Sheet
from damperfit.units.shown_units import SI

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from damperfit.report.evaluated_log import EvaluatedLog
    from damperfit.tables import Results
    from damperfit.units.shown_units import ShownUnits

__all__ = ["Listing", "Summary", "identity_of_test", "setting_verdict", "summary"]

_IDENTITY = ("damper", "serial", "date", "operator", "customer", "rig")

_SYMBOLS = (
    "R_m1: restriction of valve 1, the adjuster, rod side to gas side; acts in bump and rebound",
    "R_m2: restriction of valve 2 in the piston, full bore to rod side; acts in bump",
    "R_m3: restriction of valve 3, gas side to full bore; acts in rebound",
    "K_e: effective bulk modulus, the stiffness of oil, air in it and tube",
    "f_f: friction of seals and guides",
    "f_0: constant force that the rig adds, as by a tare",
    "MSE: mean square of measured less simulated force, in % of the variance of the measured one",
    "noise floor: the MSE that the scatter of the force between cycles gives by itself",
    "hysteresis: force on the opening branch (speed rising) less force on the closing branch",
    "ratio: rebound force over bump force, without signs",
    "interval: 95 % confidence, of noise and of what repeats in the residual",
    "cavitation: a chamber at zero absolute pressure in the simulation",
)


class Listing(NamedTuple):
    """A titled list of sentences; not shown when it is empty."""

    title: str
    items: Sequence[object]


@dataclass(frozen=True, slots=True)
class Summary:
    """The upper part of the page; its template is `summary.html`.

    Attributes
    ----------
    lead : str
        The first sentences.
    facts : Sheet or None
        Damper, rig, test and procedure.
    alarms : tuple of Listing
        What is missing or was not met.
    checks_title : str
        How the checks went, in numbers.
    checks : Sheet or None
        The checks, those that failed first.
    listings, details : tuple of Listing
        Shown openly, and on demand.
    """

    lead: str
    facts: Sheet | None
    alarms: tuple[Listing, ...]
    checks_title: str
    checks: Sheet | None
    listings: tuple[Listing, ...]
    details: tuple[Listing, ...]


def summary(results: Results, logs: Sequence[EvaluatedLog], units: ShownUnits = SI) -> Summary:
    """Return headline, alarms, checks, verdicts, trends, warnings and how it was done."""
    record = results.record
    checks_title, checks = _checks(record)
    trends = in_few_words(trend.sentence for trend in trends_in(record) if trend.sentence)
    return Summary(
        lead=" ".join(_headline(results)),
        facts=_facts(results, logs, units),
        alarms=(
            Listing("These results are incomplete", results.remarks),
            Listing("Not done", list(_not_done(record))),
            Listing("Gates not met", listed_in(record, "gates_missed")),
        ),
        checks_title=checks_title,
        checks=checks,
        listings=(
            Listing("Verdicts", short_listing(_verdicts(results))),
            Listing("Which law the logs support", law_sentences(law_in(record))),
            Listing("Held out: predicted, not fitted", held_out_in(record)),
            Listing("Across the settings", trends),
            Listing("Noise and lack of fit", sentences_in(record, "noise_and_lack_of_fit")),
            Listing("Identifiability", sentences_in(record, "identifiability")),
            Listing("Many starts", sentences_in(record, "many_starts")),
            Listing("Cavitation", sentences_in(record, "cavitation")),
            Listing("Warnings", short_listing(listed_in(record, "warnings"))),
        ),
        details=(
            Listing("Warnings of each log", _log_findings(record)),
            Listing("How it was done", [*listed_in(record, "procedure"), *_rig(record)]),
            Listing("What the words mean", _SYMBOLS),
        ),
    )


def _not_done(record: Mapping[str, Any]) -> Iterator[str]:
    yield from failure_lines(failures_in(record))
    if gaps := gaps_in(record):
        yield f"no result for {of_runs(gaps)}"


def _verdicts(results: Results) -> Iterator[str]:
    """Yield the settings that are less than fine, or that none is."""
    doubtful = [row for row in results.parameters if not _is_fine(row)]
    yield from (f"setting {row['setting']}: {setting_verdict(row)}" for row in doubtful)
    if results.parameters and not doubtful:
        yield "every fit converged, good or better, without a flag"


def setting_verdict(row: Mapping[str, Any]) -> str:
    """Return how the fit of one setting went, in words."""
    outcome = str(row["outcome"] or "outcome unknown").replace("_", " ")
    words = [f"{row['grade'] or 'no grade'}, MSE {percent(row['mse_percent'])} %"]
    marks = flags(row)
    if outcome != "cavitating" or "cavitates" not in marks:  # the flag says it, with how long
        words.append(outcome)
    if marks:
        words.append(marks)
    if row.get("grade_reason"):
        words.append(f"withheld because {row['grade_reason']}")
    return "; ".join(words)


def _is_fine(row: Mapping[str, Any]) -> bool:
    is_good = row["grade"] in {"excellent", "good"}
    return is_good and row["outcome"] == "converged" and not flags(row)


def _headline(results: Results) -> Iterator[str]:
    known = {
        row["setting"]: row["mse_percent"]
        for row in results.parameters
        if row["mse_percent"] is not None
    }
    if not known:
        yield "The tables hold no MSE."
        return
    best, worst = min(known, key=known.__getitem__), max(known, key=known.__getitem__)
    yield f"{len(known)} setting{'s' if len(known) > 1 else ''} fitted."
    yield f"MSE: median {percent(median(known.values()))} %,"
    yield f"best {percent(known[best])} % at setting {best},"
    yield f"worst {percent(known[worst])} % at setting {worst}."
    yield grade_counts(results.parameters)


def identity_of_test(record: Mapping[str, Any]) -> tuple[tuple[str, str], ...]:
    """Return whose test it is, as far as the run tells: damper, serial, date, operator first."""
    test = record.get("test")
    known = {
        str(key): str(value) for key, value in (test if isinstance(test, dict) else {}).items()
    }
    order = [*(key for key in _IDENTITY if key in known), *known]
    return tuple((key, known[key]) for key in dict.fromkeys(order) if known[key])


def _facts(results: Results, logs: Sequence[EvaluatedLog], units: ShownUnits) -> Sheet | None:
    """Return damper, rig, test and procedure as a small table."""
    record = results.record
    procedure = next(
        (str(line) for line in listed_in(record, "procedure") if str(line).startswith("Procedure")),
        "",
    )
    rows = [
        ("damper", _damper(record)),
        ("rig", "; ".join(line.removeprefix("Rig: ").rstrip(".") for line in _rig(record))),
        ("test", units.say_lengths(_test(logs))),
        ("procedure", procedure.removeprefix("Procedure: ").rstrip(".")),
        ("made by", f"damperfit {record.get('version')}" if record.get("version") else ""),
    ]
    known = tuple(row for row in rows if row[1])
    return Sheet(("", ""), ("", ""), known, (False, False)) if known else None


def _damper(record: Mapping[str, Any]) -> str:
    sentence = next(
        (str(x) for x in listed_in(record, "procedure") if str(x).startswith("Damper")), ""
    )
    return sentence.removeprefix("Damper: ").rstrip(".")


def _test(logs: Sequence[EvaluatedLog]) -> str:
    if not logs:
        return ""
    rates = [log.frequency for log in logs if log.frequency == log.frequency]
    strokes = [1e3 * log.amplitude for log in logs]
    warmth = [log.temperature for log in logs if log.temperature is not None]
    parts = [f"{len(logs)} log{'s' if len(logs) > 1 else ''}"]
    if rates:
        parts.append(f"{_range(rates)} Hz")
    parts.append(f"amplitude {_range(strokes)} mm")
    parts.append(f"{_range(warmth)} degC" if warmth else "temperature not logged")
    return ", ".join(parts)


def _range(values: Sequence[float]) -> str:
    low, high = number(min(values), digits=3), number(max(values), digits=3)
    return low if low == high else f"{low} to {high}"


def _rig(record: Mapping[str, Any]) -> Iterator[str]:
    configuration = record.get("configuration")
    rig = configuration.get("rig") if isinstance(configuration, dict) else None
    if isinstance(rig, dict):
        turned = [key for key in ("displacement", "force") if rig.get(f"reverse_{key}") is True]
        yield (
            f"Rig: filter in the rig {rig.get('filter', 'unknown')}, "
            f"x = 0 at {rig.get('centre', 'unknown')}, "
            f"signs reversed: {' and '.join(turned) or 'none'}."
        )


def _checks(record: Mapping[str, Any]) -> tuple[str, Sheet | None]:
    """Return the counts in words, and the checks, those that failed first."""
    checks = checks_in(record)
    if not checks:
        return "", None
    failed = sum(check.passed is False for check in checks)
    passed = sum(check.passed is True for check in checks)
    title = (
        f"Checks: {passed} passed, {failed} failed, {len(checks) - passed - failed} not evaluated"
    )
    order = sorted(checks, key=lambda check: check.passed is not False)
    rows = tuple(
        (check.name.replace("_", " "), CHECK_WORDS[check.passed], check.reason) for check in order
    )
    return title, Sheet(("check", "result", "reason"), ("", "", ""), rows, (False, False, False))


def _log_findings(record: Mapping[str, Any]) -> list[str]:
    """Return the findings that matter; mere notes stand with their log."""
    notable = (
        (str(entry.get("log", "log")), f"{entry.get('log', 'log')}: {finding.sentence}")
        for entry in listed_in(record, "inputs")
        if isinstance(entry, dict)
        for finding in findings_in(entry)
        if finding.severity != "note"
    )
    return list(summarised(notable))
