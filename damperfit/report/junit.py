"""Forces held against their bands as a JUnit file, which build servers read."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING
from xml.etree.ElementTree import Element, SubElement, indent, tostring

from damperfit.report.text import printable

if TYPE_CHECKING:
    from collections.abc import Sequence

    from damperfit.comparison import Point

__all__ = ["junit_report"]


def junit_report(points: Sequence[Point], *, source: str) -> bytes:
    """Return a test case for each point, by run; what could not be looked at has failed.

    Parameters
    ----------
    points : sequence of Point
        Forces held against bands.
    source : str
        The bands, as they were given.
    """
    root = Element("testsuites", _counts(points) | {"name": "damperfit compare"})
    for run in dict.fromkeys(point.run for point in points):
        mine = [point for point in points if point.run == run]
        name = printable(f"{run}, tolerance {source}")
        suite = SubElement(root, "testsuite", {"name": name} | _counts(mine))
        for point in mine:
            case = SubElement(
                suite, "testcase", {"classname": printable(run), "name": printable(_name(point))}
            )
            if not point.is_met:
                kind = "not evaluated" if math.isnan(point.margin) else "out of tolerance"
                said = printable(point.words)
                failure = SubElement(case, "failure", {"type": kind, "message": said})
                force, low, high = (
                    point.units.show(value, "N") for value in (point.force, point.low, point.high)
                )
                unit = point.units.of("N")
                failure.text = f"force {force:.5g} {unit}, expected {low:.5g} to {high:.5g} {unit}"
    indent(root)
    text: bytes = tostring(root, encoding="utf-8", xml_declaration=True)
    return text + b"\n"


def _counts(points: Sequence[Point]) -> dict[str, str]:
    failures = sum(not point.is_met for point in points)
    return {"tests": str(len(points)), "failures": str(failures), "errors": "0"}


def _name(point: Point) -> str:
    where = f"setting {point.setting}"
    if math.isnan(point.speed):
        return where
    return f"{where}, {point.stroke}, {point.units.write_speed(point.speed)}"
