"""Parameters of fitted runs of one model, MSE and distance from cavitation, to be compared."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from damperfit.comparison.forces import freedom_of
from damperfit.comparison.reading import Difference, Reading, Sameness, Topic, compared
from damperfit.identification import Status

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from damperfit.damper.quantity import Quantity
    from damperfit.results import Run
    from damperfit.tested.setting import Setting

__all__ = ["comparable_quantities", "figure_lines", "parameter_readings"]

_OBJECTIONS = {
    Status.AT_BOUND.value: "it ended at the edge of its range",
    Status.NOT_IDENTIFIABLE.value: "the logs do not determine it",
    Status.ABSENT.value: "the law is fitted without it there",
}


def comparable_quantities(runs: Sequence[Run]) -> tuple[Quantity, ...]:
    """Return the quantities that all runs have: none where they are of different models."""
    if len({run.damper.name for run in runs}) > 1:
        return ()
    known = [{one.name: one.unit for one in run.quantities} for run in runs[1:]]
    return tuple(
        one for one in runs[0].quantities if all(table.get(one.name) == one.unit for table in known)
    )


def parameter_readings(
    runs: Sequence[Run], settings: Sequence[Setting]
) -> tuple[dict[Topic, Reading], ...]:
    """Return the parameters of each run that was fitted in at least one of them.

    What all settings share is one number, and stands once.

    Parameters
    ----------
    runs : sequence of Run
        To be compared.
    settings : sequence of Setting
        That all have.
    """
    found: tuple[dict[Topic, Reading], ...] = tuple({} for _ in runs)
    for one in comparable_quantities(runs):
        is_shared = all(_is_shared(run, one.name, settings) for run in runs)
        for setting in settings[:1] if is_shared else settings:
            rows = [run.row(setting) for run in runs]
            if all(row.get(f"{one.name}_status") == Status.FIXED.value for row in rows):
                continue
            subject = Topic(
                *("parameter", one.name, one.symbol, one.unit),
                setting=None if is_shared else setting,
                is_logarithmic=one.is_logarithmic,
            )
            for table, run, row in zip(found, runs, rows, strict=True):
                counted = settings if is_shared else (setting,)
                freedom = sum(freedom_of(run, setting) for setting in counted)
                table[subject] = _reading(row, one, freedom)
    return found


def _is_shared(run: Run, name: str, settings: Sequence[Setting]) -> bool:
    rows = [run.row(setting) for setting in settings]
    values = {row.get(name) for row in rows}
    once = {Status.SHARED.value, Status.FIXED.value, Status.NOT_IDENTIFIABLE.value}
    return len(values) == 1 and {row.get(f"{name}_status") for row in rows} <= once


def _reading(row: Mapping[str, Any], quantity: Quantity, freedom: float) -> Reading:
    name = quantity.name
    value, error = row.get(name), row.get(f"{name}_se")
    status = str(row.get(f"{name}_status"))
    if value is None:
        return Reading(math.nan, objection="it has no value")
    if status == Status.FIXED.value:
        error = 0.0
    return Reading(
        float(value),
        math.nan if error is None else float(error),
        freedom,
        misfit=float(row.get(f"{name}_misfit_se") or 0.0),
        scale=math.nan if quantity.is_logarithmic else quantity.size,
        objection=_OBJECTIONS.get(status, ""),
    )


def figure_lines(first: Run, second: Run, settings: Sequence[Setting]) -> Iterator[Difference]:
    """Yield MSE and distance from cavitation by setting: numbers without errors, told in words."""
    for setting in settings:
        rows = (first.row(setting), second.row(setting))
        yield _in_words(
            Topic("figure", "mse", "MSE", "%", setting),
            *(_number(row.get("mse_percent")) for row in rows),
            words=[str(row.get("grade") or "no grade") for row in rows],
        )
        margins = [_number(row.get("r_m3_cavitation_margin"), 100.0) for row in rows]
        if any(map(math.isfinite, margins)) or any(row.get("cavitation_fraction") for row in rows):
            yield _in_words(
                Topic("figure", "cavitation_margin", "R_m3 below cavitation", "%", setting),
                *margins,
                words=["cavitates" if row.get("cavitation_fraction") else "full" for row in rows],
            )


def _number(value: Any, factor: float = 1.0) -> float:
    return math.nan if value is None else factor * float(value)


def _in_words(subject: Topic, a: float, b: float, *, words: Sequence[str]) -> Difference:
    line = compared(subject, Reading(a), Reading(b))
    is_same = words[0] == words[1]
    said = f"both {words[0]}" if is_same else f"{words[0]}, now {words[1]}"
    return Difference(
        subject,
        line.first,
        line.second,
        line.difference,
        verdict=Sameness.SAME if is_same else Sameness.DIFFERENT,
        words=said,
    )
