"""What run.json tells besides numbers: checks, trends, findings; each may be absent or strange.

Folders of other versions and damaged ones come here too, so nothing is taken on trust: an entry
that is not as described is left out.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Mapping

__all__ = [
    "ToldCheck",
    "ToldClick",
    "ToldFinding",
    "ToldTrend",
    "told_checks",
    "told_clicks",
    "told_findings",
    "told_held_out",
    "told_sentences",
    "told_trends",
]


@dataclass(frozen=True, slots=True)
class ToldCheck:
    """One named check.

    Attributes
    ----------
    name : str
        What was looked at.
    passed : bool or None
        None when it was not looked at.
    reason : str
        One sentence.
    """

    name: str
    passed: bool | None
    reason: str

    @property
    def verdict(self) -> str:
        """The result in words."""
        return {True: "passed", False: "FAILED", None: "not looked at"}[self.passed]


@dataclass(frozen=True, slots=True)
class ToldTrend:
    """How one parameter goes over the settings.

    Attributes
    ----------
    parameter : str
        Name of the parameter.
    points : tuple of (float, float, float, float)
        Setting, value of the trend and its 95 % interval (low, high), SI; NaN where not known.
    outliers : tuple of float
        Settings off the trend.
    sentence : str
        The trend in words.
    """

    parameter: str
    points: tuple[tuple[float, float, float, float], ...]
    outliers: tuple[float, ...]
    sentence: str


@dataclass(frozen=True, slots=True)
class ToldFinding:
    """One thing that the data of a log show.

    Attributes
    ----------
    severity : str
        "note", "warning" or "refusal".
    sentence : str
        What was found.
    """

    severity: str
    sentence: str


@dataclass(frozen=True, slots=True)
class ToldClick:
    """Change of force from one setting to the next.

    Attributes
    ----------
    first, second : int
        The settings.
    speed : float
        m/s.
    stroke : str
        "rebound" or "bump".
    change, low, high : float
        N, with its 95 % interval.
    """

    first: int
    second: int
    speed: float
    stroke: str
    change: float
    low: float
    high: float


def told_checks(record: Mapping[str, Any]) -> tuple[ToldCheck, ...]:
    """Return the checks in the order of the record."""
    return tuple(
        ToldCheck(
            str(entry["name"]),
            entry["passed"] if isinstance(entry.get("passed"), bool) else None,
            _text(entry.get("reason")),
        )
        for entry in _entries(record, "checks")
        if entry.get("name")
    )


def told_trends(record: Mapping[str, Any]) -> tuple[ToldTrend, ...]:
    """Return the trends by parameter."""
    found = []
    for entry in _entries(record, "trends"):
        points = [_point(point) for point in _entries(entry, "points")]
        whole = sorted(p for p in points if math.isfinite(p[0]) and math.isfinite(p[1]))
        found.append(
            ToldTrend(
                str(entry.get("parameter", "")),
                tuple(whole),
                tuple(_number(one.get("setting")) for one in _entries(entry, "outliers")),
                _text(entry.get("sentence")),
            )
        )
    return tuple(found)


def told_findings(log: Mapping[str, Any]) -> tuple[ToldFinding, ...]:
    """Return the findings of one entry of ``inputs``, the gravest first."""
    order = {"refusal": 0, "warning": 1, "note": 2}
    found = [
        ToldFinding(str(entry.get("severity", "note")), _text(entry["sentence"]))
        for entry in _entries(log, "findings")
        if entry.get("sentence")
    ]
    return tuple(sorted(found, key=lambda finding: order.get(finding.severity, 2)))


def told_clicks(record: Mapping[str, Any]) -> tuple[ToldClick, ...]:
    """Return the changes of force by click."""
    keys = ("speed_m_per_s", "change_N", "low_N", "high_N")
    found = []
    for entry in _entries(record, "clicks"):
        first, second = entry.get("from"), entry.get("to")
        numbers = [_number(entry.get(key)) for key in keys]
        if isinstance(first, int) and isinstance(second, int) and math.isfinite(numbers[0]):
            speed, change, low, high = numbers
            stroke = str(entry.get("stroke"))
            found.append(ToldClick(first, second, speed, stroke, change, low, high))
    return tuple(found)


def told_sentences(record: Mapping[str, Any], about: str) -> list[str]:
    """Return what the run said of a subject, such as "identifiability"; older runs said nothing."""
    told = record.get("sentences")
    said = told.get(about) if isinstance(told, dict) else None
    return [str(one) for one in said] if isinstance(said, list) else []


def told_held_out(record: Mapping[str, Any]) -> list[str]:
    """Return one sentence for each log that was predicted and not fitted."""
    return [
        f"setting {entry.get('setting')}, {_text(entry.get('log'))}, "
        f"{_text(entry.get('cycles'))} cycles: MSE {_number(entry.get('mse_percent')):.3g} % "
        f"({_number(entry.get('expected_mse_percent')):.3g} % to expect), "
        f"{_text(entry.get('verdict'))}"
        for entry in _entries(record, "held_out")
    ]


def _entries(record: Mapping[str, Any], key: str) -> list[dict[str, Any]]:
    value = record.get(key)
    return [item for item in value if isinstance(item, dict)] if isinstance(value, list) else []


def _point(entry: Mapping[str, Any]) -> tuple[float, float, float, float]:
    setting, value, low, high = (
        _number(entry.get(key)) for key in ("setting", "value", "low", "high")
    )
    return setting, value, low, high


def _number(value: Any) -> float:
    is_number = isinstance(value, int | float) and not isinstance(value, bool)
    return float(value) if is_number else math.nan


def _text(value: Any) -> str:
    return value if isinstance(value, str) else "" if value is None else str(value)
