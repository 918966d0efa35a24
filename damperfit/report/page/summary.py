"""The upper part of the page: what was tested, how it went, what to believe; the tables below."""

from __future__ import annotations

from statistics import median
from typing import TYPE_CHECKING, Any

from damperfit.identification.sharing import listed_settings
from damperfit.report.page_tables import details_html, page_text, table_html, words_html
from damperfit.report.rows import Sheet, flags, grade_counts, number, percent
from damperfit.report.run_record import (
    told_checks,
    told_findings,
    told_held_out,
    told_sentences,
    told_trends,
)

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from damperfit.report.views import LogView
    from damperfit.tables import Results

__all__ = ["setting_verdict", "summary_html"]

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
    "interval: 95 % confidence, as far as noise goes; it says nothing of a wrong model",
    "cavitation: a chamber at zero absolute pressure in the simulation",
)


def summary_html(results: Results, views: Sequence[LogView]) -> str:
    """Return headline, alarms, checks, verdicts, trends, warnings and how it was done."""
    record = results.record
    failures = [f for f in _listed(record, "failures") if isinstance(f, dict)]
    gaps = [one for one in _listed(record, "gaps") if isinstance(one, int)]
    missing = [f"no result for setting {listed_settings(gaps)}"] if gaps else []
    verdicts = [
        f"setting {row['setting']}: {words}"
        for row in results.parameters
        if (words := setting_verdict(row)) and not _is_fine(row)
    ]
    if results.parameters and not verdicts:
        verdicts = ["every fit converged, good or better, without a flag"]
    trends = [trend.sentence for trend in told_trends(record) if trend.sentence]
    return "".join(
        (
            f'<p class="lead">{page_text(" ".join(_headline(results)))}</p>',
            _facts(results, views),
            words_html("These results are not whole", results.remarks, kind="alarm"),
            words_html(
                "Not done",
                [*(str(f.get("message", "")) for f in failures), *missing],
                kind="alarm",
            ),
            words_html("Gates not met", _listed(record, "gates_missed"), kind="alarm"),
            _checks(record),
            words_html("Verdicts", verdicts),
            words_html("Held out: predicted, not fitted", told_held_out(record)),
            words_html("Across the settings", trends),
            *(
                words_html(title, told_sentences(record, about))
                for title, about in (
                    ("Noise and lack of fit", "noise_and_lack_of_fit"),
                    ("Identifiability", "identifiability"),
                    ("Many starts", "many_starts"),
                    ("Cavitation", "cavitation"),
                )
            ),
            words_html("Warnings", _listed(record, "warnings")),
            details_html("Warnings of each log", _log_findings(record)),
            details_html("How it was done", [*_listed(record, "procedure"), *_rig(record)]),
            details_html("What the words mean", _SYMBOLS),
        )
    )


def setting_verdict(row: Mapping[str, Any]) -> str:
    """Return how the fit of one setting went, in words."""
    outcome = str(row["outcome"] or "outcome unknown").replace("_", " ")
    words = [f"{row['grade'] or 'no grade'}, MSE {percent(row['mse_percent'])} %"]
    told = flags(row)
    if outcome != "cavitating" or "cavitates" not in told:  # the flag says it, with how long
        words.append(outcome)
    if told:
        words.append(told)
    return "; ".join(words)


def _is_fine(row: Mapping[str, Any]) -> bool:
    is_good = row["grade"] in {"excellent", "good"}
    return is_good and row["outcome"] == "converged" and not flags(row)


def _listed(record: Mapping[str, Any], key: str) -> list[Any]:
    value = record.get(key)
    return value if isinstance(value, list) else []


def _headline(results: Results) -> Iterator[str]:
    known = {
        row["setting"]: row["mse_percent"]
        for row in results.parameters
        if row["mse_percent"] is not None
    }
    if not known:
        yield "No MSE stands in the tables."
        return
    best, worst = min(known, key=known.__getitem__), max(known, key=known.__getitem__)
    yield f"{len(known)} setting{'s' if len(known) > 1 else ''} fitted."
    yield f"MSE: median {percent(median(known.values()))} %,"
    yield f"best {percent(known[best])} % at setting {best},"
    yield f"worst {percent(known[worst])} % at setting {worst}."
    yield grade_counts(results.parameters)


def _facts(results: Results, views: Sequence[LogView]) -> str:
    """Return damper, rig, test and procedure as a small table."""
    record = results.record
    procedure = next(
        (str(line) for line in _listed(record, "procedure") if str(line).startswith("Procedure")),
        "",
    )
    rows = [
        ("damper", _damper(record)),
        ("rig", "; ".join(line.removeprefix("Rig: ").rstrip(".") for line in _rig(record))),
        ("test", _test(views)),
        ("procedure", procedure.removeprefix("Procedure: ").rstrip(".")),
        ("made by", f"damperfit {record.get('version')}" if record.get("version") else ""),
    ]
    known = tuple(row for row in rows if row[1])
    sheet = Sheet(("", ""), ("", ""), known, (False, False))
    return table_html(sheet, kind="facts") if known else ""


def _damper(record: Mapping[str, Any]) -> str:
    told = next((str(x) for x in _listed(record, "procedure") if str(x).startswith("Damper")), "")
    return told.removeprefix("Damper: ").rstrip(".")


def _test(views: Sequence[LogView]) -> str:
    if not views:
        return ""
    rates = [view.frequency for view in views if view.frequency == view.frequency]
    strokes = [1e3 * view.amplitude for view in views]
    warmth = [view.temperature for view in views if view.temperature is not None]
    parts = [f"{len(views)} log{'s' if len(views) > 1 else ''}"]
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
            f"signs turned: {' and '.join(turned) or 'none'}."
        )


def _checks(record: Mapping[str, Any]) -> str:
    checks = told_checks(record)
    if not checks:
        return ""
    failed = sum(check.passed is False for check in checks)
    passed = sum(check.passed is True for check in checks)
    title = (
        f"Checks: {passed} passed, {failed} failed, {len(checks) - passed - failed} not looked at"
    )
    order = sorted(checks, key=lambda check: check.passed is not False)
    sheet = Sheet(
        ("check", "result", "reason"),
        ("", "", ""),
        tuple((check.name.replace("_", " "), check.verdict, check.reason) for check in order),
        (False, False, False),
    )
    return f"<h3>{page_text(title)}</h3>{table_html(sheet, kind='checks')}"


def _log_findings(record: Mapping[str, Any]) -> list[str]:
    """Return the findings that matter; mere notes stand with their log."""
    return [
        f"{entry.get('log', 'log')}: {finding.sentence}"
        for entry in _listed(record, "inputs")
        if isinstance(entry, dict)
        for finding in told_findings(entry)
        if finding.severity != "note"
    ]
