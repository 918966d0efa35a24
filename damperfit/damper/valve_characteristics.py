"""A valve's characteristic, flow against pressure: as the loops show it, and as a law has it.

What the loops show needs no law of the valve (`damperfit.damper.valve_curves`): friction, offset,
moving mass, the lag of the force channel and the drag of the seals are the fit's, the compliance
that takes up oil while the pressure changes is read. Where the two part, the law is wrong.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from damperfit.damper.load_cell import OF_LOAD_CELL, before_load_cell
from damperfit.damper.network import BLEEDS, BLOW_OFFS
from damperfit.damper.valve_curves import Side, loop_of, read_valves
from damperfit.damper.valve_starts import sides

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from damperfit.damper.model import Values
    from damperfit.damper.network import Valve
    from damperfit.damper.valve_curves import ValveCurve
    from damperfit.damper.valve_dampers import ValveDamper
    from damperfit.recording import Trace

    FloatArray = NDArray[np.float64]

__all__ = ["ValveCharacteristic", "law_flow", "valve_characteristics"]

_POINTS = 120  # of a law's curve


@dataclass(frozen=True, slots=True, eq=False)
class ValveCharacteristic:
    """One valve of a setting.

    Attributes
    ----------
    stroke : str
        "rebound" or "bump".
    area : float
        What presses oil through it, m2: a pressure times this is its force.
    drop, flow : numpy.ndarray
        Shape (n,), as measured; Pa and m3/s.
    law_drop, law_flow : numpy.ndarray
        Shape (k,), the fitted law from nothing to the largest pressure measured.
    opening : float or None
        p_open of its blow-off, Pa; None without one.
    """

    stroke: str
    area: float
    drop: FloatArray
    flow: FloatArray
    law_drop: FloatArray
    law_flow: FloatArray
    opening: float | None


def valve_characteristics(
    damper: ValveDamper, values: Values, traces: Sequence[Trace]
) -> tuple[ValveCharacteristic, ...]:
    """Return the valves of a setting; one that the logs hardly press is left out.

    Parameters
    ----------
    damper : ValveDamper
        The damper.
    values : Values
        Of the setting.
    traces : sequence of Trace
        Its logs.
    """
    numbers = dict(zip(values.names, values.numbers, strict=True))
    of_cell = {name: numbers[name] for name in OF_LOAD_CELL if name in numbers}
    loops = [
        loop_of(before_load_cell(trace, **of_cell), damper.rest_force(trace.displacement))
        for trace in traces
    ]
    both = [Side(one.area, one.drag + numbers["drag"]) for one in sides(damper, numbers)]
    reading = read_valves(loops, *both, offset=numbers["f_0"], friction=numbers["f_f"])
    found = (
        ("rebound", damper.rebound, reading.rebound, both[0].area),
        ("compression", damper.compression, reading.compression, both[1].area),
    )
    return tuple(
        _characteristic(stroke, valve, curve, area, numbers, damper.oil_density)
        for stroke, valve, curve, area in found
        if curve.highest > 0.0
    )


def _characteristic(
    stroke: str,
    valve: Valve,
    curve: ValveCurve,
    area: float,
    numbers: Mapping[str, float],
    density: float,
) -> ValveCharacteristic:
    own = {
        part: numbers[f"{stroke}_{part}"]
        for part in (*BLEEDS[valve.bleed], *BLOW_OFFS[valve.blow_off])
    }
    # A bleed rises steeply from nothing: most points stand there.
    drop = curve.highest * np.linspace(0.0, 1.0, _POINTS) ** 2
    opening = own.get("opening")
    if opening is not None and opening < curve.highest:
        drop = np.sort(np.append(drop, opening))
    return ValveCharacteristic(
        stroke="bump" if stroke == "compression" else stroke,
        area=area,
        drop=curve.drop,
        flow=curve.flow,
        law_drop=drop,
        law_flow=law_flow(own, drop, density),
        opening=opening,
    )


def law_flow(parts: Mapping[str, float], drop: FloatArray, density: float) -> FloatArray:
    """Return the flow through bleed and blow-off, m3/s at rest's density.

    Parameters
    ----------
    parts : mapping of str to float
        Numbers of what the valve has, by the names of `damperfit.damper.network.BLEEDS` and
        `BLOW_OFFS`.
    drop : numpy.ndarray
        Pressure across it, Pa, not negative.
    density : float
        kg/m3.

    Examples
    --------
    >>> law_flow({"opening": 1e5, "slope": 1e6}, np.array([5e4, 1e5, 3e5]), 850.0) * 850.0
    array([0. , 0. , 0.2])
    """
    total = np.zeros_like(drop)
    if "bleed" in parts or "leak" in parts:
        total += _through(drop, parts.get("leak", 0.0), parts.get("bleed", 0.0))
    if "slope" in parts:
        beyond = _beyond(drop, parts["opening"], parts.get("width", 0.0))
        beyond = beyond * (1.0 + parts.get("lift", 0.0) * beyond)
        total += _through(beyond, parts["slope"], parts.get("port", 0.0))
    return np.asarray(total / density)


def _beyond(drop: FloatArray, opening: float, width: float) -> FloatArray:
    """What presses beyond an opening; a stack of discs lifts gradually over a width."""
    if width == 0.0:
        return np.maximum(drop - opening, 0.0)
    lifted = np.logaddexp(0.0, (drop - opening) / width) - np.logaddexp(0.0, -opening / width)
    return np.asarray(width * np.maximum(lifted, 0.0))


def _through(pressed: FloatArray, linear: float, root: float) -> FloatArray:
    """The mass flow w of pressed = linear w + (root w)^2."""
    below = linear + np.sqrt(linear**2 + 4.0 * root**2 * pressed)
    return 2.0 * pressed / np.maximum(below, 1e-300)
