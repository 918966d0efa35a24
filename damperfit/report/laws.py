"""Which model structure the logs support: a row a candidate, the chosen one at each setting."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from damperfit.laws import UNDETERMINED
from damperfit.report.rounding import NOTHING, number
from damperfit.report.sheet import Sheet

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from damperfit.laws import LawFit, LawSearch, Tried

    Row = Mapping[str, Any]

__all__ = [
    "chosen_records",
    "chosen_sheet",
    "law_sentences",
    "rival_records",
    "rival_sheet",
    "tried_law_records",
    "tried_laws_sheet",
]

# Headings of what stands in a record as text, and its key there.
_TEXTS = {
    "structure": "law",
    "changed": "change",
    "why": "reason",
    "model of the literature": "title",
    "source": "source",
}
_NUMBERS = {
    "factor": "gain",
    "BIC": "bic",
    "MSE": "mse_percent",
    "held out": "held_out_mse_percent",
}


def tried_laws_sheet(choice: Row, *, is_narrow: bool = False) -> Sheet:
    """Return one row a candidate, in the order in which they were tried.

    Parameters
    ----------
    choice : mapping
        What a choice of structures tells, as in run.json.
    is_narrow : bool
        For a terminal: without what was changed and why it was taken or not.
    """
    headings: tuple[str, ...] = (
        "",
        "structure",
        "changed",
        "factor",
        "BIC",
        "free",
        "MSE",
        "held out",
        "why",
    )
    if is_narrow:
        headings = ("", "structure", "free", "BIC", "MSE", "held out")
    notes = ["* chosen; MSE and what was held out in per cent of the variance"]
    samples = _number(choice, "effective_samples")
    if not math.isnan(samples):
        notes.append(
            f"BIC with {samples:.0f} effective samples, against the structure that the row was "
            "compared with: positive where it is for the larger of both"
            + ("; factor: MSE of the smaller of both over that of the larger" * (not is_narrow))
        )
    return _sheet(headings, _entries(choice, "laws"), notes)


def rival_sheet(choice: Row) -> Sheet:
    """Return one row a model of the literature, the best prediction first.

    Parameters
    ----------
    choice : mapping
        What a choice of structures tells, as in run.json.
    """
    caveats: dict[str, list[str]] = {}
    for one in _entries(choice, "rivals"):
        if one.get("caveat"):
            caveats.setdefault(str(one["caveat"]), []).append(str(one.get("title")))
    notes = [f"{', '.join(titles)}: {why}" for why, titles in caveats.items()]
    headings = ("model of the literature", "source", "free", "MSE", "held out")
    return _sheet(headings, _entries(choice, "rivals"), notes)


def _sheet(headings: Sequence[str], entries: Sequence[Row], notes: Sequence[str]) -> Sheet:
    return Sheet(
        headings=tuple(headings),
        units=tuple("%" if one in {"MSE", "held out"} else "" for one in headings),
        rows=tuple(tuple(_cell(one, heading) for heading in headings) for one in entries),
        is_number=tuple(one in _NUMBERS or one == "free" for one in headings),
        notes=tuple(notes),
    )


def _cell(one: Row, heading: str) -> str:
    """What stands under a heading in the row of a candidate."""
    if heading in _TEXTS:
        return str(one.get(_TEXTS[heading]) or "")
    if heading in _NUMBERS:
        value = _number(one, _NUMBERS[heading])
        if heading in {"MSE", "held out"}:
            return _percent(value)
        return "" if math.isnan(value) else f"{value:+.0f}" if heading == "BIC" else f"{value:.3g}"
    if heading == "free":
        free = one.get("free")
        return str(len(free)) if isinstance(free, list) else ""
    return "*" if one.get("is_chosen") is True else ""


def _entries(choice: Row, key: str) -> list[Row]:
    """The entries of a list; what somebody else has written there is left out."""
    listed = choice.get(key)
    return [one for one in listed if isinstance(one, dict)] if isinstance(listed, list) else []


def _number(record: Row, key: str) -> float:
    value = record.get(key)
    is_one = isinstance(value, int | float) and not isinstance(value, bool)
    return float(value) if is_one else math.nan  # type: ignore[arg-type]


def law_sentences(choice: Row) -> list[str]:
    """Return which structure was taken, the physics that it sees, and what the logs leave open."""
    chosen = choice.get("chosen")
    if not isinstance(chosen, str):
        return []
    said = [f"The logs support {chosen}."]
    for key in ("sentences", "undecided"):
        listed = choice.get(key)
        said += [str(one) for one in listed] if isinstance(listed, list) else []
    return said


def chosen_sheet(fits: Sequence[LawFit]) -> Sheet:
    """Return what the chosen structure found: a row a quantity, a column a setting."""
    shown = [one for one in fits[0].model.quantities if one.name in fits[0].free]

    def mark(fit: LawFit, name: str) -> str:
        return "!" if name in fit.at_bound else "?" * (name in fit.undetermined)

    rows = [
        (
            *(one.label, one.shown_unit or one.unit),
            *(
                number(getattr(fit.values, one.name) / 10.0**one.power, digits=4)
                + mark(fit, one.name)
                for fit in fits
            ),
        )
        for one in shown
    ]
    rows.append(("MSE", "%", *(_percent(fit.mse_percent) for fit in fits)))
    rows.append(("MSE held out", "%", *(_percent(fit.held_out_percent) for fit in fits)))
    notes = []
    if any(fit.at_bound for fit in fits):
        notes.append("! at a bound: not determined by these logs")
    if any(fit.undetermined for fit in fits):
        notes.append(
            f"? not determined by these logs: {UNDETERMINED:g} times as much or little would do as "
            "well"
        )
    return Sheet(
        headings=("setting", "", *(str(fit.setting) for fit in fits)),
        units=("",) * (len(fits) + 2),
        rows=tuple(rows),
        is_number=(False, False, *(True for _ in fits)),
        notes=tuple(notes),
    )


def _percent(value: float) -> str:
    if math.isnan(value):
        return NOTHING
    return number(value, digits=3) if value >= 1e-4 else "<0.0001"


def tried_law_records(search: LawSearch) -> list[dict[str, Any]]:
    """Return the candidates as numbers, with the reasons, for JSON."""
    return [
        {
            "law": law.tried.title,
            "model": law.tried.fits[0].model.name,
            "is_chosen": law.is_taken,
            **dict(_fitted(law.tried)),
            "change": law.change,
            "gain": _finite(law.gain),
            "bic": _finite(law.bic),
            "reason": law.reason,
        }
        for law in search.laws
    ]


def rival_records(rivals: Sequence[Tried]) -> list[dict[str, Any]]:
    """Return the models of the literature as numbers, for JSON."""
    from damperfit.damper.rivals import Rival  # with it come all rivals, which few runs have

    records = []
    for one in rivals:
        model = one.fits[0].model
        rival = model if isinstance(model, Rival) else None
        records.append(
            {
                "title": one.title,
                "model": model.name,
                "source": rival.source if rival else "",
                "caveat": rival.caveat if rival else "",
                **dict(_fitted(one)),
            }
        )
    return records


def _fitted(one: Tried) -> Iterator[tuple[str, Any]]:
    yield "free", list(one.fits[0].free)
    yield "at_bound", list(one.at_bound)
    yield "mse_percent", one.mse_percent
    yield "held_out_mse_percent", _finite(one.held_out_percent)


def chosen_records(fits: Sequence[LawFit]) -> list[dict[str, Any]]:
    """Return what the chosen structure found as numbers in SI, for JSON."""
    return [
        {
            "setting": fit.setting.cell,
            "values": dict(zip(fit.values.names, fit.values.numbers, strict=True)),
            "free": list(fit.free),
            "at_bound": list(fit.at_bound),
            "not_told": list(fit.undetermined),
            "mse_percent": fit.mse_percent,
            "stretch_mse_percent": list(fit.stretches),
            "held_out_mse_percent": _finite(fit.held_out_percent),
            "held_out": fit.held_out or None,
            "evaluations": fit.evaluations,
        }
        for fit in fits
    ]


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None
