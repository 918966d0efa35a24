"""Three cycles at 5 to 10 Hz give parameters as good as three cycles can.

`python -m tests.uncertainty.few_cycles` measures over 40 seeds what stands here.
"""

from __future__ import annotations

import pytest

from tests.uncertainty.few_cycles import NAMES, deviations, logged

# Scatter of 30 cycles at 10 Hz, %, times the square root of 27 compared cycles over 3.
THEORY = dict(zip(NAMES, (0.14, 0.75, 2.0, 0.45, 2.9), strict=True))


@pytest.mark.one_in(3)
@pytest.mark.parametrize("seed", range(4))
def test_three_cycles_tell_what_they_can(seed):
    trace, off, errors = deviations(logged(10.0, 3.0, seed=seed))
    assert trace.n_cycles == 3
    for name, found, error in zip(NAMES, off, errors, strict=True):
        assert abs(100.0 * found) < 3.0 * THEORY[name], name
        assert THEORY[name] / 3.0 < 100.0 * error < 3.0 * THEORY[name], name


@pytest.mark.parametrize("frequency", [5.0, 10.0])
def test_without_noise_the_truth_is_found(frequency):
    recording = logged(frequency, 3.0, seed=1, force_noise=0.0, displacement_noise=0.0)
    _, off, _ = deviations(recording)
    assert max(map(abs, off)) < 1e-3
