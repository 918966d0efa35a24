"""The table of what was held out: what moves beside steady cycles has no frequency of its own."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from damperfit.report.tables import held_out_sheet
from tests import fakes


@pytest.mark.parametrize(("frequency", "shown"), [(1.5, "1.50"), (0.0, "varies")])
def test_a_run_up_is_not_of_no_hertz(frequency: float, shown: str) -> None:
    trace = fakes.trace(1)
    trace = SimpleNamespace(name=trace.name, amplitude=0.02, frequency=frequency)
    one = SimpleNamespace(
        setting=1, trace=trace, cycles="transients", mse_percent=0.2, fitted_mse_percent=0.1,
        verdict="predicted as well as fitted",
    )  # fmt: skip
    sheet = held_out_sheet([one])
    assert sheet.rows[0][sheet.headings.index("freq.")] == shown
    assert "freq." not in held_out_sheet([one], is_narrow=True).headings
