"""The synthetic reference set: the formulas of its docstring, in numbers worked out by hand."""

from __future__ import annotations

import numpy as np
import pytest

from damperfit.damper.purdy.reference import reference_parameters
from damperfit.errors import ConfigurationError

E = [
    *(0, 0.08, -0.12, 0.05, -0.06, 0.14, -0.10, 0.02, -0.04, 0.09),
    *(-0.13, 0.11, -0.02, -0.08, 0.15, -0.09, 0.04, 0.12, -0.11, 0.06),
]


def test_all_twenty_settings_follow_the_formulas():
    for setting in range(1, 21):
        k = setting - 1
        y = reference_parameters(setting)
        assert y.r_m1 == (49000 if setting == 20 else pytest.approx(14000 + 700 * k + 45 * k * k))
        assert y.r_m2 == (17e6 if setting == 20 else pytest.approx(2e6 * np.exp(k / 10)))
        assert (y.r_m3, y.f_f, y.f_0) == (2.597e6, 50.0, 0.0)
        assert y.k_e == pytest.approx((5e8 + 1.2e7 * k + 8e5 * k * k) * (1 + E[k]))


@pytest.mark.parametrize("setting", [0, 21, -1, 2.5])
def test_other_settings_are_refused(setting):
    with pytest.raises(ConfigurationError, match="1 to 20"):
        reference_parameters(setting)
