"""``documentation/index.html`` of an FMU: whose damper, tested how, and how to use it."""

from __future__ import annotations

import math
from functools import cache
from typing import TYPE_CHECKING

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup, escape

from damperfit.damper.quantity import RIG
from damperfit.handover.fmu.exported_damper import FRICTION_BAND
from damperfit.report.sheet import printable

if TYPE_CHECKING:
    from damperfit.handover.fmu.exported_damper import ExportedDamper
    from damperfit.handover.handed_over import HandedOver

__all__ = ["documentation"]


def documentation(handed: HandedOver, damper: ExportedDamper) -> bytes:
    """Return the page."""
    mse = {
        place: one.mse_percent for place, one in zip(damper.settings, handed.settings, strict=True)
    }
    tares = {
        str(one.setting): getattr(one.values, q.name)
        for one in handed.settings
        for q in one.values.quantities
        if q.is_offset and getattr(one.values, q.name) != 0.0
    }
    page = _environment().get_template("index.html")
    text = page.render(
        handed=handed,
        damper=damper,
        tested=_tested(handed),
        mse={place: f"{value:.3g}" for place, value in mse.items() if not math.isnan(value)},
        has_tare=bool(tares),
        has_rig=any(one.scope == RIG for one in handed.damper.quantities),
        band=f"{1e3 * FRICTION_BAND:g}",
    )
    return text.encode("utf-8", "backslashreplace")


def _tested(handed: HandedOver) -> list[str]:
    """The tested range in phrases, as far as it is known."""
    tested, lines = handed.tested, []
    if tested.n_logs:
        lines.append(f"{tested.n_logs} logs")
    if tested.stroke is not None:
        lines.append(f"stroke up to ±{1e3 * tested.stroke:.4g} mm")
    if tested.speed is not None:
        lines.append(f"speed up to {tested.speed:.3g} m/s")
    if tested.frequencies is not None:
        low, high = tested.frequencies
        lines.append(f"{low:.3g} to {high:.3g} Hz")
    if tested.temperatures is not None:
        low, high = tested.temperatures
        lines.append(f"{low:.3g} to {high:.3g} °C")
    return lines


@cache
def _environment() -> Environment:
    return Environment(
        loader=PackageLoader("damperfit.handover.fmu"),
        autoescape=True,
        finalize=_shown,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )


def _shown(text: object) -> Markup:
    return text if isinstance(text, Markup) else escape(printable(str(text)))
