"""Comparisons as rows and documents: what --json prints, and tables hold."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import pyarrow as pa

from damperfit.comparison import verdict_of

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from damperfit.comparison import Difference, Point, Run, RunComparison
    from damperfit.tested.setting import Setting

__all__ = [
    "comparison_record",
    "comparison_rows",
    "comparison_table",
    "tolerance_rows",
    "tolerance_table",
]

_TEXT, _FLOAT, _TRUTH = pa.string(), pa.float64(), pa.bool_()
# Name, kind and meaning of each column; what is compared tells its unit.
_COLUMNS: tuple[tuple[str, pa.DataType, str], ...] = (
    ("first", _TEXT, "the reference"),
    ("second", _TEXT, "the run beside it"),
    ("kind", _TEXT, "force, parameter or figure"),
    ("name", _TEXT, "what is compared"),
    ("setting", _TEXT, "adjuster setting; empty: of all settings"),
    ("speed_m_per_s", _FLOAT, "of a force, positive"),
    ("stroke", _TEXT, "rebound or bump"),
    ("unit", _TEXT, "of the values and their difference"),
    ("first_value", _FLOAT, "of the reference"),
    ("second_value", _FLOAT, "of the run beside it"),
    ("difference", _FLOAT, "second less first"),
    ("difference_ci_low", _FLOAT, "95 % interval of the difference"),
    ("difference_ci_high", _FLOAT, "95 % interval of the difference"),
    ("percent", _FLOAT, "difference in % of the first; of its damping, or half the force's range"),
    ("percent_ci_low", _FLOAT, "95 % interval of percent"),
    ("percent_ci_high", _FLOAT, "95 % interval of percent"),
    ("chance", _FLOAT, "how often chance alone makes as large a difference, 0 to 1"),
    ("verdict", _TEXT, "same, different or untold"),
    ("is_sure", _TRUTH, "different even when the number of lines is allowed for"),
    ("told_from", _TEXT, "model or measured"),
    ("words", _TEXT, "the verdict in words"),
)


_POINT_COLUMNS: tuple[tuple[str, pa.DataType, str], ...] = (
    ("run", _TEXT, "whose force it is"),
    ("setting", _TEXT, "adjuster setting"),
    ("speed_m_per_s", _FLOAT, "positive; empty where a whole setting is missing"),
    ("stroke", _TEXT, "rebound or bump"),
    ("force_N", _FLOAT, "positive in rebound"),
    ("low_N", _FLOAT, "lower edge of the band"),
    ("high_N", _FLOAT, "upper edge of the band"),
    ("margin_N", _FLOAT, "how far inside the band; negative: outside"),
    (
        "half_interval_N",
        _FLOAT,
        "half the 95 % interval of the force that is checked against the band",
    ),
    ("told_from", _TEXT, "model or measured"),
    ("is_met", _TRUTH, "whether it is inside; false where it could not be evaluated"),
    ("words", _TEXT, "the result in words"),
)


def comparison_rows(comparison: RunComparison) -> list[dict[str, Any]]:
    """Return the lines of a comparison as rows; what is not known is None."""
    return [_row(comparison, line) for line in comparison.lines]


def _row(comparison: RunComparison, line: Difference) -> dict[str, Any]:
    subject = line.subject
    values = (
        comparison.first.name,
        comparison.second.name,
        subject.kind,
        subject.name,
        None if subject.setting is None else str(subject.setting),
        subject.speed,
        subject.stroke or None,
        subject.unit,
        *map(_finite, (line.first.value, line.second.value)),
        *map(_finite, (line.difference, line.low, line.high)),
        *map(_finite, (line.percent, line.percent_low, line.percent_high, line.chance)),
        line.verdict.value,
        line.is_sure,
        "measured" if line.is_measured else "model",
        verdict_of(line),
    )
    return dict(zip((name for name, *_ in _COLUMNS), values, strict=True))


def _finite(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None


def comparison_table(rows: Sequence[Mapping[str, Any]]) -> pa.Table:
    """Return rows of one or more comparisons as a table."""
    return _table(rows, _COLUMNS)


def tolerance_rows(points: Sequence[Point]) -> list[dict[str, Any]]:
    """Return forces held against bands as rows; what is not known is None."""
    names = [name for name, *_ in _POINT_COLUMNS]
    return [dict(zip(names, _values(point), strict=True)) for point in points]


def _values(point: Point) -> tuple[Any, ...]:
    return (
        point.run,
        str(point.setting),
        _finite(point.speed),
        point.stroke or None,
        *map(_finite, (point.force, point.low, point.high, point.margin, point.reach)),
        "measured" if point.is_measured else "model",
        point.is_met,
        point.words,
    )


def tolerance_table(rows: Sequence[Mapping[str, Any]]) -> pa.Table:
    """Return rows of forces held against bands as a table."""
    return _table(rows, _POINT_COLUMNS)


def _table(
    rows: Sequence[Mapping[str, Any]], columns: Sequence[tuple[str, pa.DataType, str]]
) -> pa.Table:
    fields = [pa.field(name, kind, metadata={"description": said}) for name, kind, said in columns]
    return pa.Table.from_pylist([dict(row) for row in rows], schema=pa.schema(fields))


def comparison_record(comparison: RunComparison) -> dict[str, Any]:
    """Return a comparison as JSON values."""
    return {
        "first": _run(comparison.first),
        "second": _run(comparison.second),
        "repeats": [_run(run) for run in comparison.repeats],
        "motion": comparison.motion,
        "settings": [_setting(setting) for setting in comparison.settings],
        "sentences": list(comparison.sentences),
        "circumstances": [
            {"kind": one.kind, "first": one.first, "second": one.second, "sentence": one.sentence}
            for one in comparison.circumstances
        ],
        "notes": list(comparison.notes),
        "remarks": list(comparison.remarks),
        "lines": comparison_rows(comparison),
    }


def _run(run: Run) -> dict[str, str]:
    return {"name": run.name, "place": run.place}


def _setting(setting: Setting) -> int | str:
    return setting.cell
