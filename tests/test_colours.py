"""The colours as readers with and without all cones see them, computed."""

import numpy as np
import pytest

from damperfit.reporting.figures import (
    CHAMBER_COLOURS,
    CHAMBER_STYLES,
    SPEED_COLOURS,
    setting_colours,
)
from damperfit.reporting.page import asset

SIGHTS = {
    "all cones": np.eye(3),
    "protanopia": [
        [0.152286, 1.052583, -0.204868],
        [0.114503, 0.786281, 0.099216],
        [-0.003882, -0.048116, 1.051998],
    ],
    "deuteranopia": [
        [0.367322, 0.860646, -0.227968],
        [0.280085, 0.672501, 0.047413],
        [-0.011820, 0.042940, 0.968881],
    ],
    "tritanopia": [
        [1.255528, -0.076749, -0.178779],
        [-0.078411, 0.930809, 0.147602],
        [0.004733, 0.691367, 0.303900],
    ],
}
TO_XYZ = np.array(
    [
        [0.4124564, 0.3575761, 0.1804375],
        [0.2126729, 0.7151522, 0.0721750],
        [0.0193339, 0.1191920, 0.9503041],
    ]
)
WHITE, DARK = "#ffffff", "#14181f"
INKS = {WHITE: "#1c2330", DARK: "#e6e9ef"}
RAMP = list(setting_colours(range(1, 21)).values())


def linear(colours):
    codes = np.array([[int(c[i : i + 2], 16) for i in (1, 3, 5)] for c in colours]) / 255.0
    return np.where(codes <= 0.04045, codes / 12.92, ((codes + 0.055) / 1.055) ** 2.4)


def lab(colours, sight="all cones"):
    seen = np.clip(linear(colours) @ np.array(SIGHTS[sight]).T, 0.0, 1.0)
    xyz = seen @ TO_XYZ.T / TO_XYZ.sum(axis=1)
    f = np.where(xyz > 216 / 24389, np.cbrt(xyz), (24389 / 27 * xyz + 16) / 116)
    return np.stack(
        [116 * f[:, 1] - 16, 500 * (f[:, 0] - f[:, 1]), 200 * (f[:, 1] - f[:, 2])], axis=1
    )


def distances(colours, sight):
    seen = lab(colours, sight)
    return np.linalg.norm(seen[:, None] - seen[None], axis=2)


def contrast(colour, paper):
    light = sorted(float(v) for v in linear([colour, paper]) @ TO_XYZ[1])
    return (light[1] + 0.05) / (light[0] + 0.05)


def test_the_measure_is_right():
    assert lab([WHITE])[0] == pytest.approx([100.0, 0.0, 0.0], abs=1e-3)
    assert lab(["#ff0000"])[0] == pytest.approx([53.24, 80.09, 67.20], abs=0.05)  # as in tables
    assert contrast(WHITE, "#000000") == pytest.approx(21.0)
    # Red and green of one lightness: far apart, but near for a reader without green cones.
    assert distances(["#c33b2b", "#5f7a1c"], "all cones")[0, 1] > 70.0
    assert distances(["#c33b2b", "#5f7a1c"], "deuteranopia")[0, 1] < 30.0


@pytest.mark.parametrize("sight", SIGHTS)
def test_twenty_settings_are_told_apart_and_in_order(sight):
    apart = distances(RAMP, sight)
    assert np.diag(apart, 1).min() > 4.5
    assert (np.diff(apart[0]) > 0.0).all()  # the further from the first, the more unlike it
    assert (np.diff(apart[-1]) < 0.0).all()


def test_the_ramp_darkens_all_the_way_and_stands_out_on_both_papers():
    assert (np.diff(lab(RAMP)[:, 0]) < 0.0).all()
    assert min(contrast(colour, paper) for colour in RAMP for paper in INKS) > 3.0


@pytest.mark.parametrize("sight", SIGHTS)
@pytest.mark.parametrize("paper", INKS)
def test_measured_and_simulated_are_told_apart(sight, paper):
    ink = INKS[paper]
    assert ink in asset("page.js")  # it is the colour that the page draws
    assert distances([ink, *RAMP], sight)[0, 1:].min() > 30.0


@pytest.mark.parametrize("sight", SIGHTS)
def test_chambers_are_told_apart_by_colour_or_dash(sight):
    apart = distances(CHAMBER_COLOURS, sight)
    for i, k in ((0, 1), (0, 2), (1, 2)):
        assert apart[i, k] > (30.0 if CHAMBER_STYLES[i] == CHAMBER_STYLES[k] else 15.0)


@pytest.mark.parametrize("sight", SIGHTS)
def test_speeds_are_told_apart(sight):
    for ink in INKS.values():
        known = [ink if colour == "ink" else colour for colour in SPEED_COLOURS]
        apart = distances(known, sight) + 1e3 * np.eye(len(known))
        assert apart.min() > 14.0
