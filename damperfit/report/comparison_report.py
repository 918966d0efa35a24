"""Comparisons as Markdown; everything that came from a log or a folder's name is escaped."""

from __future__ import annotations

from typing import TYPE_CHECKING

from damperfit.report.mse_report import escape, markdown_table
from damperfit.report.sheets.comparison_sheet import (
    comparison_figure_sheet,
    comparison_force_sheet,
    comparison_parameter_sheet,
    tolerance_sheet,
)

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from damperfit.comparison import Point, RunComparison

__all__ = ["comparison_markdown", "tolerance_outcome"]


def comparison_markdown(
    comparisons: Sequence[RunComparison],
    points: Sequence[Point] = (),
    *,
    source: str = "",
    alone: Sequence[str] = (),
) -> str:
    """Return comparisons, and forces held against bands, as one document.

    Parameters
    ----------
    comparisons : sequence of RunComparison
        One a pair.
    points : sequence of Point
        Forces held against bands.
    source : str
        The bands, as they were given.
    alone : sequence of str
        What has no partner.
    """
    parts: list[str] = ["# Comparison", "", *_list(alone)]
    if points:
        parts += ["", f"## Tolerance {escape(source)}", "", escape(tolerance_outcome(points)), ""]
        parts += markdown_table(tolerance_sheet(points))
    for one in comparisons:
        parts += _comparison(one)
    return "\n".join(parts) + "\n"


def tolerance_outcome(points: Sequence[Point]) -> str:
    """Say how many points keep their bands."""
    units = points[0].units
    met = sum(one.is_met for one in points)
    unseen = sum(bool(one.margin != one.margin) for one in points)
    said = f"{met} of {len(points)} points within the tolerance"
    outside = [-one.margin for one in points if one.margin < 0.0]
    if outside:
        said += f", {len(outside)} outside, by up to {units.write(max(outside), 'N', '.3g')}"
    if unseen:
        said += f", {unseen} not evaluated"
    measured = sum(one.is_measured for one in points)
    if measured:
        said += f"; {measured} compared as measured, without a model"
    if met == len(points):
        nearest = min(points, key=lambda one: one.margin)
        return f"{said}; the nearest edge is {units.write(nearest.margin, 'N', '.3g')} away"
    return said


def _comparison(one: RunComparison) -> Iterator[str]:
    yield from ("", f"## {escape(one.second.name)} beside {escape(one.first.name)}", "")
    yield from _list(f"differs besides: {sentence}" for sentence in one.differing)
    yield from ("", *_list((*one.sentences, *one.to_know, *one.remarks)))
    for title, sheet in (
        (one.forces_title[0].upper() + one.forces_title[1:], comparison_force_sheet(one)),
        ("Parameters", comparison_parameter_sheet(one)),
        ("Energy, hysteresis, MSE, cavitation", comparison_figure_sheet(one)),
    ):
        if sheet.rows:
            yield from ("", f"### {escape(title)}", "", *markdown_table(sheet))


def _list(items: Iterable[str]) -> list[str]:
    return [f"- {escape(item)}" for item in items]
