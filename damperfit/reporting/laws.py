"""Which model structure the logs support: a row a candidate, the chosen one at each setting."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from damperfit.laws import UNDETERMINED
from damperfit.reporting.sheet import NOTHING, Column, Sheet, laid_out, number

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping, Sequence

    from damperfit.laws import LawFit, LawSearch, Tried

    Row = Mapping[str, Any]


def tried_laws_sheet(choice: Row, *, is_narrow: bool = False) -> Sheet:
    """Return one row a candidate, in the order in which they were tried.

    Parameters
    ----------
    choice : mapping
        What a choice of structures tells, as in run.json.
    is_narrow : bool
        For a terminal: without what was changed and why it was taken or not.
    """
    notes = ["* chosen; MSE and what was held out in per cent of the variance"]
    samples = _number(choice, "effective_samples")
    if not math.isnan(samples):
        notes.append(
            f"BIC with {samples:.0f} effective samples, against the structure that the row was "
            "compared with: positive where it is for the larger of both"
            + ("; factor: MSE of the smaller of both over that of the larger" * (not is_narrow))
        )
    chosen = Column("", "", lambda one: "*" if one.get("is_chosen") is True else "", False)
    structure, free, bic, errors = _text("structure", "law"), _FREE, _figure("BIC", "bic"), _ERRORS
    columns = [chosen, structure, free, bic, *errors]
    if not is_narrow:
        factor = _figure("factor", "gain")
        columns = [chosen, structure, _text("changed", "change"), factor, bic, free, *errors]
        columns.append(_text("why", "reason"))
    return laid_out(_entries(choice, "laws"), columns, *notes)


def rival_sheet(choice: Row) -> Sheet:
    """Return one row a model of the literature, as in run.json, the best prediction first."""
    caveats: dict[str, list[str]] = {}
    for one in _entries(choice, "rivals"):
        if one.get("caveat"):
            caveats.setdefault(str(one["caveat"]), []).append(str(one.get("title")))
    notes = [f"{', '.join(titles)}: {why}" for why, titles in caveats.items()]
    columns = [_text("model of the literature", "title"), _text("source", "source"), _FREE]
    return laid_out(_entries(choice, "rivals"), [*columns, *_ERRORS], *notes)


def _text(heading: str, key: str) -> Column:
    return Column(heading, "", lambda one: str(one.get(key) or ""), is_number=False)


def _figure(heading: str, key: str) -> Column:
    def cell(one: Row) -> str:
        value = _number(one, key)
        return "" if math.isnan(value) else f"{value:+.0f}" if key == "bic" else f"{value:.3g}"

    return Column(heading, "", cell)


def _n_free(one: Row) -> str:
    free = one.get("free")
    return str(len(free)) if isinstance(free, list) else ""


def _error(key: str) -> Callable[[Row], str]:
    return lambda one: _percent(_number(one, key))


_FREE = Column("free", "", _n_free)
_ERRORS = (
    Column("MSE", "%", _error("mse_percent")),
    Column("held out", "%", _error("held_out_mse_percent")),
)


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
