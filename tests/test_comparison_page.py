"""The page of a comparison: loops and differences as they are, names that are no markup."""

import base64
import json
import re

import numpy as np
import pytest

from damperfit.comparison.comparing import ComparisonOptions, compare_runs
from damperfit.comparison.tolerance import parse_tolerance, tolerated
from damperfit.queries.compared import Comparison
from damperfit.reporting.compared import loop_plots
from damperfit.reporting.page import comparison_page
from damperfit.tested.setting import Setting
from tests.comparison.runs import DAMPING, measured, run

pytest.importorskip("plotly")
EVIL = "</script><img src=x onerror=alert(1)>"
MEASURED = ComparisonOptions(is_measured=True)


@pytest.fixture(scope="module")
def comparison():
    first = run(measured(1), measured(2), measured(3), name="before")
    second = run(measured(1, factor=1.1, seed=9), measured(2), name=EVIL)
    return compare_runs(first, second, MEASURED)


def test_the_difference_below_is_the_second_less_the_first(comparison) -> None:
    runs = (comparison.first, comparison.second)
    by_velocity, by_displacement = loop_plots(runs, Setting.of(1), name="setting_1")
    upper, lower = by_velocity.panels
    assert [line.label for line in upper.lines] == [EVIL, "before"]
    (apart,) = lower.lines
    # Ten per cent of c v more, at the velocity of the first.
    np.testing.assert_allclose(apart.y, 0.1 * DAMPING * apart.x, atol=0.5)
    assert apart.x.max() == pytest.approx(0.3, abs=0.005)
    np.testing.assert_allclose(by_displacement.panels[1].lines[0].y, apart.y)
    assert by_displacement.panels[0].x_unit == "mm"


def test_the_page_shows_names_and_obeys_none(comparison) -> None:
    points = tolerated(comparison, parse_tolerance("5%"))
    done = Comparison((comparison,), alone=(EVIL,), points=points, tolerance="5%")
    page = comparison_page(done)
    assert EVIL not in page
    assert page.count("&lt;/script&gt;") >= 3
    assert "FAILS" in page
    assert "setting 3 only in before: not compared" in page
    found = re.search(r'<script type="application/json" id="data">(.*?)</script>', page, re.DOTALL)
    data = json.loads(found[1])
    names = [plot["name"] for plot in data["plots"]]
    assert "setting_01_force_velocity" in names or "setting_1_force_velocity" in names
    assert len(names) == len(set(names))
    assert np.isfinite(np.frombuffer(base64.b64decode(data["arrays"][0]), "<f4")).all()
