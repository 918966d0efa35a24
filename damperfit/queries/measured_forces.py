"""Curves that were measured without time, asked for forces: by curve, and which gives a force."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from damperfit.adjustment.force_at import STROKES
from damperfit.errors import ConfigurationError
from damperfit.io import ForceCurve, read_curves
from damperfit.simulation import NAMED_SPEEDS

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from damperfit.io import ReadOptions
    from damperfit.queries.force_by_setting import Question

__all__ = ["MeasuredForces", "measured_forces"]


@dataclass(frozen=True, slots=True, eq=False)
class MeasuredForces:
    """Forces of measured curves at some speeds, and the answer where a force was asked for.

    Attributes
    ----------
    curves : tuple of ForceCurve
        As the file has them.
    speeds : tuple of float
        m/s, positive.
    sentence : str
        Which curve gives the wanted force; empty where none was asked for.
    """

    curves: tuple[ForceCurve, ...]
    speeds: tuple[float, ...]
    sentence: str

    def rows(self) -> list[dict[str, Any]]:
        """Return the forces by curve, stroke and speed that were reached, as JSON values."""
        return [
            {"curve": curve.label, "stroke": stroke, "speed_m_per_s": speed, "force_N": force}
            for curve in self.curves
            for stroke in STROKES
            for speed in self.speeds
            if math.isfinite(force := curve.force_at(speed, stroke))
        ]


def measured_forces(
    paths: Sequence[Path], question: Question, *, reading: ReadOptions
) -> MeasuredForces:
    """Return what the curves of some files say of a question.

    Parameters
    ----------
    paths : sequence of pathlib.Path
        Points or loops of force over speed, without time.
    question : Question
        Speed, force and stroke asked for.
    reading : ReadOptions
        Units and signs.

    Raises
    ------
    LogError
        A file holds no such curves.
    ConfigurationError
        No curve reaches the speed.
    """
    curves = _file_before_label([curve for path in paths for curve in read_curves(path, reading)])
    strokes = (question.stroke,) if question.stroke else STROKES
    tops = [float(v.max()) for c in curves for s in strokes if len(v := c.points(s)[0])]
    speeds = tuple(speed for speed in NAMED_SPEEDS if speed <= max(tops, default=0.0))
    if question.speed is not None:
        speeds = (question.speed,)
    forces = [
        (force, curve.label)
        for curve in curves
        for stroke in strokes
        for speed in speeds
        if math.isfinite(force := curve.force_at(speed, stroke))
    ]
    if not forces:
        at = f"{question.speed:g} m/s" if question.speed else "the named test speeds"
        side = f" in {question.stroke}" if question.stroke else ""
        names = ", ".join(path.name for path in paths)
        raise ConfigurationError(
            f"no curve of {names} has points on both sides of it{side}; the highest "
            f"measured speed is {max(tops, default=0.0):.3g} m/s",
            subject=at,
        )
    sentence = "" if question.force is None else _answer(question, forces)
    return MeasuredForces(curves, speeds, sentence)


def _file_before_label(curves: Sequence[ForceCurve]) -> tuple[ForceCurve, ...]:
    """Put the file's name before labels that several files use."""
    files: dict[str, set[str]] = {}
    for one in curves:
        files.setdefault(one.label, set()).add(one.path)
    return tuple(
        replace(one, label=f"{one.name} {one.label}") if len(files[one.label]) > 1 else one
        for one in curves
    )


def _answer(question: Question, forces: Sequence[tuple[float, str]]) -> str:
    """Say between which curves a force lies; labels need no order for that."""
    wanted = question.force or 0.0
    asked = f"{wanted:.5g} N in {question.stroke} at {question.speed:g} m/s"
    below = max((one for one in forces if one[0] <= wanted), default=None)
    above = min((one for one in forces if one[0] >= wanted), default=None)
    if below is None or above is None:
        force, label = above or below or (math.nan, "")
        return f"{asked}: no curve gives it; the nearest is {label} with {force:.5g} N"
    if below[0] == above[0]:
        return f"{asked}: {below[1]} gives it"
    force, label = min(below, above, key=lambda one: abs(one[0] - wanted))
    return (
        f"{asked}: between {below[1]} with {below[0]:.5g} N and {above[1]} with {above[0]:.5g} N; "
        f"nearest is {label} ({force - wanted:+.3g} N)"
    )
