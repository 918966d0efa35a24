"""What the colours part is parted for readers with and without all cones, computed."""

import numpy as np
import pytest

from damperfit.reporting.figures import (
    CHAMBER_COLOURS,
    CHAMBER_STYLES,
    SPEED_COLOURS,
    setting_colours,
)
from damperfit.reporting.page import asset

# How linear red, green and blue are seen, by rows.
SIGHTS = {
    "all cones": "1 0 0 0 1 0 0 0 1",
    "protanopia": ".152286 1.052583 -.204868 .114503 .786281 .099216 -.003882 -.048116 1.051998",
    "deuteranopia": ".367322 .860646 -.227968 .280085 .672501 .047413 -.01182 .04294 .968881",
    "tritanopia": "1.255528 -.076749 -.178779 -.078411 .930809 .147602 .004733 .691367 .3039",
}
TO_XYZ = ".4124564 .3575761 .1804375 .2126729 .7151522 .072175 .0193339 .119192 .9503041"
INKS = {"#ffffff": "#1c2330", "#14181f": "#e6e9ef"}  # by paper
RAMP = list(setting_colours(range(1, 21)).values())


def matrix(numbers):
    return np.array(numbers.split(), float).reshape(3, 3)


def linear(colours):
    codes = np.array([[int(c[i : i + 2], 16) for i in (1, 3, 5)] for c in colours]) / 255.0
    return np.where(codes <= 0.04045, codes / 12.92, ((codes + 0.055) / 1.055) ** 2.4)


def lab(colours, sight="all cones"):
    seen = np.clip(linear(colours) @ matrix(SIGHTS[sight]).T, 0.0, 1.0)
    xyz = seen @ matrix(TO_XYZ).T / matrix(TO_XYZ).sum(axis=1)
    x, y, z = np.where(xyz > 216 / 24389, np.cbrt(xyz), (24389 / 27 * xyz + 16) / 116).T
    return np.stack([116 * y - 16, 500 * (x - y), 200 * (y - z)], axis=1)


def distances(colours, sight):
    seen = lab(colours, sight)
    return np.linalg.norm(seen[:, None] - seen[None], axis=2)


def contrast(colour, paper):
    dark, light = sorted(float(v) for v in linear([colour, paper]) @ matrix(TO_XYZ)[1])
    return (light + 0.05) / (dark + 0.05)


def test_the_measure_is_right_and_the_ramp_darkens_on_both_papers():
    assert lab(["#ff0000"])[0] == pytest.approx([53.24, 80.09, 67.20], abs=0.05)  # as in tables
    assert contrast("#ffffff", "#000000") == pytest.approx(21.0)
    # Red and green of one lightness are near for a reader without green cones alone.
    near, far = (distances(["#c33b2b", "#5f7a1c"], s)[0, 1] for s in ("deuteranopia", "all cones"))
    assert (near < 30.0, far > 70.0) == (True, True)
    assert (np.diff(lab(RAMP)[:, 0]) < 0.0).all()
    assert min(contrast(colour, paper) for colour in RAMP for paper in INKS) > 3.0


@pytest.mark.parametrize("sight", SIGHTS)
def test_settings_chambers_speeds_and_what_was_measured_are_told_apart(sight):
    apart = distances(RAMP, sight)
    assert np.diag(apart, 1).min() > 4.5
    assert (np.diff(apart[0]) > 0.0).all()  # the further from the first, the more unlike it
    assert (np.diff(apart[-1]) < 0.0).all()
    chambers = distances(CHAMBER_COLOURS, sight)
    for i, k in ((0, 1), (0, 2), (1, 2)):  # by colour or dash
        assert chambers[i, k] > (30.0 if CHAMBER_STYLES[i] == CHAMBER_STYLES[k] else 15.0)
    for ink in INKS.values():
        assert ink in asset("page.js")  # it is the colour that the page draws
        assert distances([ink, *RAMP], sight)[0, 1:].min() > 30.0
        speeds = [ink if colour == "ink" else colour for colour in SPEED_COLOURS]
        assert (distances(speeds, sight) + 1e3 * np.eye(len(speeds))).min() > 14.0
