"""Stamps to uniform samples: rounding, jitter, missing samples, gaps."""

import numpy as np
import pytest

from damperfit.conditioning.timebase import make_uniform
from tests.conditioning.logs import recording


def channels(t):
    return 0.03 * np.sin(9.0 * t + 1.0), 400.0 * np.cos(9.0 * t + 1.0)


def logged(true_time, stamps):
    return recording(stamps, *channels(true_time))


def error(log):
    """Largest relative error of the uniform channels against the truth at their own times."""
    t = log.start_time + log.interval * np.arange(len(log.force))
    x, f = channels(t)
    return max(np.abs(log.displacement - x).max() / 0.03, np.abs(log.force - f).max() / 400.0)


def test_exact_stamps_are_taken_as_they_are():
    t = np.arange(3000) / 300.0
    source = logged(t, t)
    log = make_uniform(source)
    assert log.displacement is source.displacement
    assert log.interval == pytest.approx(1.0 / 300.0, rel=1e-14)
    assert log.findings == ()


@pytest.mark.parametrize("lost", [[1500], [1000, 2000], [100], [700, 701], [1000, 1500, 1600]])
def test_rows_lost_at_the_resolution_of_the_stamps_are_noticed(lost):
    t = np.delete(np.arange(3000), lost) / 1000.0
    log = make_uniform(logged(t, np.round(t, 3)))
    assert f"{len(lost)} missing" in str(log.findings[0])
    assert log.interval == pytest.approx(1e-3, rel=1e-9)
    assert error(log) < 1e-8  # the spline over two lost samples
