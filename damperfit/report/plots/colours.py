"""Colours of settings, chambers and speeds.

Every adjuster setting has one colour everywhere, on a ramp from blue (lowest) over purple to red
(highest). The ramp was laid by equal steps of the smallest difference that readers with full sight
and the three kinds of dichromats see, gets darker all the way, and stands out 3 to 1 on white and
on the dark page; `tests/test_colours.py` computes this. "ink" and "muted" stand for the text colour
and a grey of the theme.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from damperfit.tested.setting import Setting

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from damperfit.tested.setting import Place


__all__ = ["CHAMBER_COLOURS", "CHAMBER_STYLES", "SPEED_COLOURS", "setting_colours"]

CHAMBER_COLOURS = ("#0072b2", "#d55e00", "#009e73")  # Okabe and Ito (2008)
# Blue and green come close for a reader without blue cones: the gas chamber is dashed as well.
CHAMBER_STYLES = ("solid", "solid", "dashed")
_RAMP = (
    (104, 113, 251),
    (119, 110, 218),
    (132, 108, 189),
    (145, 105, 161),
    (157, 97, 132),
    (169, 89, 104),
    (180, 80, 77),
    (188, 67, 48),
    (199, 51, 14),
)
# Okabe and Ito (2008), readable on white and on black.
SPEED_COLOURS = ("#56b4e9", "#0072b2", "#009e73", "#e69f00", "#d55e00", "#cc79a7", "ink")


def setting_colours(settings: Iterable[Setting | Place]) -> Mapping[Setting, str]:
    """Return a colour for each setting, along the ramp in the order of the settings.

    Examples
    --------
    >>> list(setting_colours([1, 20]).values())
    ['#6871fb', '#c7330e']
    """
    known = sorted(set(map(Setting.of, settings)))
    ramp = np.array(_RAMP, dtype=float)
    places = np.linspace(0.0, len(ramp) - 1.0, len(known))
    channels = [np.interp(places, np.arange(len(ramp)), ramp[:, i]) for i in range(3)]
    return {
        setting: "#" + "".join(f"{round(float(channel[k])):02x}" for channel in channels)
        for k, setting in enumerate(known)
    }
