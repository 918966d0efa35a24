"""Stamps to uniform samples: rounding, jitter, missing samples, gaps."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

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


@given(
    rate=st.floats(80.0, 950.0),
    shift=st.sampled_from([0.0, 12.3456, 1e6]),
    n=st.integers(500, 3000),
)
@settings(deadline=None)
def test_stamps_rounded_to_a_millisecond_keep_the_rate(rate, shift, n):
    t = np.arange(n) / rate
    log = make_uniform(logged(t, np.round(t + shift, 3)))
    # Stamps wrong by half a rounding q, in the worst order: a slope wrong by 1.5 q/n.
    assert log.interval == pytest.approx(1.0 / rate, abs=1.5e-3 / n)
    assert len(log.force) == n
    assert log.start_time == pytest.approx(shift, abs=1e-3)


def test_exact_stamps_are_taken_as_they_are():
    t = np.arange(3000) / 300.0
    source = logged(t, t)
    log = make_uniform(source)
    assert log.displacement is source.displacement
    assert log.interval == pytest.approx(1.0 / 300.0, rel=1e-14)
    assert log.findings == ()


@pytest.mark.parametrize("digits", [None, 3])
def test_a_few_missing_samples_are_put_in_and_counted(digits):
    t = np.delete(np.arange(3000), [500, 1200, 1201]) / 300.0
    log = make_uniform(logged(t, t if digits is None else np.round(t, digits)))
    assert "3 missing samples" in log.findings[0].sentence
    assert len(log.force) == 3000
    assert log.interval == pytest.approx(1.0 / 300.0, rel=1e-6)
    true = channels(np.arange(3000) / 300.0)
    assert np.abs(log.displacement - true[0]).max() < 1e-6 * 0.03
    assert np.abs(log.force - true[1]).max() < 1e-6 * 400.0


@pytest.mark.parametrize("lost", [[1500], [1000, 2000], [100], [700, 701], [1000, 1500, 1600]])
def test_rows_lost_at_the_resolution_of_the_stamps_are_noticed(lost):
    t = np.delete(np.arange(3000), lost) / 1000.0
    log = make_uniform(logged(t, np.round(t, 3)))
    assert f"{len(lost)} missing" in log.findings[0].sentence
    assert log.interval == pytest.approx(1e-3, rel=1e-9)
    assert error(log) < 1e-8  # the spline over two lost samples
