"""Which model structure the logs support: a row a candidate, the chosen one at each setting."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from damperfit.reporting.records import listed_in, number_in
from damperfit.reporting.sheet import Column, Sheet, laid_out, number, percent
from damperfit.tables.files import finite

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from damperfit.laws.law_fit import LawFit, LawSearch, Tried

    Row = Mapping[str, Any]


# Tables and sentences, of what run.json tells


_FREE = Column("free", "", lambda one: str(len(listed_in(one, "free")) or ""))
_ERRORS = (
    Column("MSE", "%", lambda one: percent(number_in(one, "mse_percent"))),
    Column("held out", "%", lambda one: percent(number_in(one, "held_out_mse_percent"))),
)


def _entries(choice: Row, key: str) -> list[Row]:
    """The entries of a list; what somebody else has written there is left out."""
    return [one for one in listed_in(choice, key) if isinstance(one, dict)]


def tried_laws_sheet(choice: Row, *, is_narrow: bool = False) -> Sheet:
    """Return one row a candidate, in the order in which they were tried, of a ``law_choice``.

    ``is_narrow`` is for a terminal: without what was changed and why it was taken or not.
    """
    notes = ["* chosen; MSE and what was held out in per cent of the variance"]
    if (samples := number_in(choice, "effective_samples")) is not None:
        notes.append(
            f"BIC with {samples:.0f} effective samples, against the structure that the row was "
            "compared with: positive where it is for the larger of both"
            + ("; factor: MSE of the smaller of both over that of the larger" * (not is_narrow))
        )
    chosen = Column("", "", lambda one: "*" if one.get("is_chosen") is True else "", False)

    def figure(heading: str, key: str, pattern: str) -> Column:
        def cell(one: Row) -> str:
            value = number_in(one, key)
            return "" if value is None else pattern.format(value)

        return Column(heading, "", cell)

    structure, bic = Column.text("structure", "law"), figure("BIC", "bic", "{:+.0f}")
    columns = [chosen, structure, _FREE, bic, *_ERRORS]
    if not is_narrow:
        changed, why = Column.text("changed", "change"), Column.text("why", "reason")
        factor = figure("factor", "gain", "{:.3g}")
        columns = [chosen, structure, changed, factor, bic, _FREE, *_ERRORS, why]
    return laid_out(_entries(choice, "laws"), columns, *notes)


def rival_sheet(choice: Row) -> Sheet:
    """Return one row a model of the literature, as in run.json, the best prediction first."""
    caveats: dict[str, list[str]] = {}
    for one in _entries(choice, "rivals"):
        if one.get("caveat"):
            caveats.setdefault(str(one["caveat"]), []).append(str(one.get("title")))
    notes = (f"{', '.join(titles)}: {why}" for why, titles in caveats.items())
    title = Column.text("model of the literature", "title")
    columns = [title, Column.text("source", "source"), _FREE, *_ERRORS]
    return laid_out(_entries(choice, "rivals"), columns, *notes)


def law_sentences(choice: Row, *, with_undecided: bool = True) -> list[str]:
    """Return which structure was taken, the physics that it sees, and what the logs leave open."""
    if not isinstance(choice.get("chosen"), str):
        return []
    keys = ("sentences", "undecided") if with_undecided else ("sentences",)
    told = (str(one) for key in keys for one in listed_in(choice, key))
    return [f"The logs support {choice['chosen']}.", *told]


def chosen_sheet(fits: Sequence[LawFit]) -> Sheet:
    """Return what the chosen structure found: a row a quantity, a column a setting."""

    def value(fit: LawFit, quantity: Any) -> str:
        name = quantity.name
        mark = "!" if name in fit.at_bound else "?" * (name in fit.undetermined)
        return number(getattr(fit.values, name) / 10.0**quantity.power, digits=4) + mark

    shown = [one for one in fits[0].model.quantities if one.name in fits[0].free]
    rows = [(q.label, q.shown_unit or q.unit, *(value(fit, q) for fit in fits)) for q in shown]
    rows.append(("MSE", "%", *(percent(fit.mse_percent) for fit in fits)))
    rows.append(("MSE held out", "%", *(percent(fit.held_out_percent) for fit in fits)))
    from damperfit.laws.law_fit import UNDETERMINED

    bound = "! at a bound: not determined by these logs"
    open_ = f"? not determined by these logs: {UNDETERMINED:g} times as much or little would do as "
    return Sheet(
        headings=("setting", "", *(str(fit.setting) for fit in fits)),
        units=("",) * (len(fits) + 2),
        rows=tuple(rows),
        is_number=(False, False, *(True for _ in fits)),
        notes=(
            *([bound] if any(fit.at_bound for fit in fits) else []),
            *([f"{open_}well"] if any(fit.undetermined for fit in fits) else []),
        ),
    )


# Numbers, for JSON


def tried_law_records(search: LawSearch) -> list[dict[str, Any]]:
    """Return the candidates as numbers, with the reasons."""
    return [
        {
            "law": law.tried.title,
            "model": law.tried.fits[0].model.name,
            "is_chosen": law.is_taken,
            **_fitted(law.tried),
            "change": law.change,
            "gain": finite(law.gain),
            "bic": finite(law.bic),
            "reason": law.reason,
        }
        for law in search.laws
    ]


def rival_records(rivals: Sequence[Tried]) -> list[dict[str, Any]]:
    """Return the models of the literature as numbers."""
    return [
        {
            "title": one.title,
            "model": one.fits[0].model.name,
            "source": getattr(one.fits[0].model, "source", ""),
            "caveat": getattr(one.fits[0].model, "caveat", ""),
            **_fitted(one),
        }
        for one in rivals
    ]


def _fitted(one: Tried) -> dict[str, Any]:
    return {
        "free": list(one.fits[0].free),
        "at_bound": list(one.at_bound),
        "mse_percent": one.mse_percent,
        "held_out_mse_percent": finite(one.held_out_percent),
    }


def chosen_records(fits: Sequence[LawFit]) -> list[dict[str, Any]]:
    """Return what the chosen structure found as numbers in SI."""
    return [
        {
            "setting": fit.setting.cell,
            "values": dict(zip(fit.values.names, fit.values.numbers, strict=True)),
            "free": list(fit.free),
            "at_bound": list(fit.at_bound),
            "not_told": list(fit.undetermined),
            "mse_percent": fit.mse_percent,
            "stretch_mse_percent": list(fit.stretches),
            "held_out_mse_percent": finite(fit.held_out_percent),
            "held_out": fit.held_out or None,
            "evaluations": fit.evaluations,
        }
        for fit in fits
    ]
