"""Which law the logs support: a row for each law that was tried, the chosen one at each setting."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from damperfit.laws import UNDETERMINED
from damperfit.report.rounding import number
from damperfit.report.sheet import Sheet

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from damperfit.damper.rivals import Rival
    from damperfit.laws import LawFit, LawSearch, Tried

__all__ = [
    "chosen_records",
    "chosen_sheet",
    "law_sentences",
    "rival_records",
    "rival_sheet",
    "tried_law_records",
    "tried_laws_sheet",
]


def tried_laws_sheet(choice: Mapping[str, Any], *, is_narrow: bool = False) -> Sheet:
    """Return one row a law, in the order in which they were tried.

    Parameters
    ----------
    choice : mapping
        What a choice of laws tells, as in run.json.
    is_narrow : bool
        For a terminal: without what was changed and why it was taken or not.
    """
    wide = ("changed", "factor", "BIC", "why") if not is_narrow else ("BIC",)
    headings = ("", "law", *wide[:-1], "free", "MSE", "held out", *wide[-1:])
    if is_narrow:
        headings = ("", "law", "free", "BIC", "MSE", "held out")
    samples = _number(choice.get("effective_samples"))
    notes = ["* the chosen law; MSE and what was held out in per cent of the variance"]
    if not math.isnan(samples):
        notes.append(
            f"BIC with {samples:.0f} effective samples, against the law that the row was compared "
            "with: positive where it is for the larger of both"
            + ("; factor: MSE of the smaller of both over that of the larger" * (not is_narrow))
        )
    return Sheet(
        headings=headings,
        units=tuple("%" if one in {"MSE", "held out"} else "" for one in headings),
        rows=tuple(
            tuple(_cell(one, heading) for heading in headings) for one in _entries(choice, "laws")
        ),
        is_number=tuple(one in _NUMBERS for one in headings),
        notes=tuple(notes),
    )


_NUMBERS = {"factor", "BIC", "free", "MSE", "held out"}


def _cell(one: Mapping[str, Any], heading: str) -> str:
    """What stands under a heading in the row of a law, or of a model of the literature."""
    if heading == "free":
        free = one.get("free")
        return str(len(free)) if isinstance(free, list) else ""
    if heading in {"MSE", "held out"}:
        key = "mse_percent" if heading == "MSE" else "held_out_mse_percent"
        return _percent(_number(one.get(key)))
    if heading == "factor":
        gain = _number(one.get("gain"))
        return "" if math.isnan(gain) else f"{gain:.3g}"
    if heading == "BIC":
        bic = _number(one.get("bic"))
        return "" if math.isnan(bic) else f"{bic:+.0f}"
    keys = {
        "law": "law", "changed": "change", "why": "reason",
        "model of the literature": "title", "source": "source",
    }  # fmt: skip
    if heading in keys:
        return str(one.get(keys[heading]) or "")
    return "*" if one.get("is_chosen") is True else ""


def _entries(choice: Mapping[str, Any], key: str) -> list[Mapping[str, Any]]:
    """The entries of a list; what somebody else has written there is left out."""
    found = choice.get(key)
    return [one for one in found if isinstance(one, dict)] if isinstance(found, list) else []


def _number(value: object) -> float:
    is_one = isinstance(value, int | float) and not isinstance(value, bool)
    return float(value) if is_one else math.nan  # type: ignore[arg-type]


def tried_law_records(search: LawSearch) -> list[dict[str, Any]]:
    """Return the same as numbers, with the reasons, for JSON."""
    return [
        {
            "law": law.tried.title,
            "model": law.tried.fits[0].model.name,
            "is_chosen": law.is_taken,
            "free": list(law.tried.fits[0].free),
            "at_bound": list(law.tried.at_bound),
            "mse_percent": law.tried.mse_percent,
            "held_out_mse_percent": _finite(law.tried.held_out_percent),
            "change": law.change,
            "gain": _finite(law.gain),
            "bic": _finite(law.bic),
            "reason": law.reason,
        }
        for law in search.laws
    ]


def rival_sheet(choice: Mapping[str, Any]) -> Sheet:
    """Return one row a model of the literature, the best prediction first.

    Parameters
    ----------
    choice : mapping
        What a choice of laws tells, as in run.json.
    """
    headings = ("model of the literature", "source", "free", "MSE", "held out")
    caveats: dict[str, list[str]] = {}
    for one in _entries(choice, "rivals"):
        if one.get("caveat"):
            caveats.setdefault(str(one["caveat"]), []).append(str(one.get("title")))
    return Sheet(
        headings=headings,
        units=("", "", "", "%", "%"),
        rows=tuple(
            tuple(_cell(one, heading) for heading in headings) for one in _entries(choice, "rivals")
        ),
        is_number=(False, False, True, True, True),
        notes=tuple(f"{', '.join(titles)}: {why}" for why, titles in caveats.items()),
    )


def law_sentences(choice: Mapping[str, Any]) -> list[str]:
    """Return which law was taken, the physics that it sees, and what the logs leave open."""
    chosen = choice.get("chosen")
    if not isinstance(chosen, str):
        return []
    said = [f"The logs support {chosen}."]
    for key in ("sentences", "undecided"):
        found = choice.get(key)
        said += [str(one) for one in found] if isinstance(found, list) else []
    return said


def rival_records(rivals: Sequence[Tried]) -> list[dict[str, Any]]:
    """Return the same as numbers, for JSON."""
    return [
        {
            "title": one.title,
            "model": one.fits[0].model.name,
            "source": _source(one),
            "caveat": _caveat(one),
            "free": list(one.fits[0].free),
            "at_bound": list(one.at_bound),
            "mse_percent": one.mse_percent,
            "held_out_mse_percent": _finite(one.held_out_percent),
        }
        for one in rivals
    ]


def _source(one: Tried) -> str:
    rival = _rival(one)
    return "" if rival is None else rival.source


def _caveat(one: Tried) -> str:
    rival = _rival(one)
    return "" if rival is None else rival.caveat


def _rival(one: Tried) -> Rival | None:
    from damperfit.damper.rivals import Rival  # with it come all rivals, which few runs have

    model = one.fits[0].model
    return model if isinstance(model, Rival) else None


def chosen_sheet(fits: Sequence[LawFit]) -> Sheet:
    """Return what the chosen law found: a row a quantity, a column a setting."""
    shown = [one for one in fits[0].model.quantities if one.name in fits[0].free]
    rows = [
        (
            one.label,
            one.shown_unit or one.unit,
            *(
                number(getattr(fit.values, one.name) / 10.0**one.power, digits=4)
                + ("!" if one.name in fit.at_bound else "?" * (one.name in fit.undetermined))
                for fit in fits
            ),
        )
        for one in shown
    ]
    rows.append(("MSE", "%", *(_percent(fit.mse_percent) for fit in fits)))
    rows.append(("MSE held out", "%", *(_percent(fit.held_out_percent) for fit in fits)))
    marks = {
        "! at the edge of its range: not determined by these logs": any(
            fit.at_bound for fit in fits
        ),
        f"? not determined by these logs: {UNDETERMINED:g} times as much or little would do as "
        "well": any(fit.undetermined for fit in fits),
    }
    return Sheet(
        headings=("setting", "", *(str(fit.setting) for fit in fits)),
        units=("",) * (len(fits) + 2),
        rows=tuple(rows),
        is_number=(False, False, *(True for _ in fits)),
        notes=tuple(mark for mark, is_there in marks.items() if is_there),
    )


def chosen_records(fits: Sequence[LawFit]) -> list[dict[str, Any]]:
    """Return the same as numbers in SI, for JSON."""
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


def _percent(value: float) -> str:
    if math.isnan(value):
        return "-"
    return number(value, digits=3) if value >= 1e-4 else "<0.0001"


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None
