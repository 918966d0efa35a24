"""The valves of each setting, flow against pressure: measured points, the fitted law, openings."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from damperfit.damper.valve_characteristics import ValveCharacteristic
    from damperfit.tested.setting import Setting

__all__ = ["valve_rows"]


def valve_rows(setting: Setting, valves: Iterable[ValveCharacteristic]) -> Iterator[dict[str, Any]]:
    """Yield the rows of a setting: of each valve what was measured, its law, its opening.

    Parameters
    ----------
    setting : Setting
        Which.
    valves : iterable of ValveCharacteristic
        Of the setting.
    """
    for one in valves:
        points = [("measured", one.drop, one.flow), ("law", one.law_drop, one.law_flow)]
        for curve, drop, flow in points:
            for pressure, rate in zip(drop.tolist(), flow.tolist(), strict=True):
                yield _row(setting, one, curve, pressure, rate)
        if one.opening is not None:
            yield _row(setting, one, "opening", one.opening, None)


def _row(
    setting: Setting, valve: ValveCharacteristic, curve: str, pressure: float, flow: float | None
) -> dict[str, Any]:
    return {
        "setting": setting,
        "stroke": valve.stroke,
        "curve": curve,
        "pressure_Pa": pressure,
        "flow_m3_per_s": flow,
        "valve_force_N": pressure * valve.area,
    }
