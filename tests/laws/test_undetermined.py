"""What the logs of a setting do not determine is marked and left out of the sentences."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from damperfit.damper.purdy.parameters import PURDY_DAMPER
from damperfit.damper.valve_dampers import TwinTube
from damperfit.identification import Status
from damperfit.identification.fit_problem import Block
from damperfit.identification.fit_setting import _statuses
from damperfit.identification.least_squares import DenseSystem, Minimum
from damperfit.identification.logs import FEWEST_SAMPLES
from damperfit.laws.description import physics_seen, seen_again
from damperfit.laws.law_fit import LawFit, _undetermined
from damperfit.reporting.tables import chosen_records, chosen_sheet
from damperfit.simulation import SolverOptions
from damperfit.tested.setting import Setting
from tests import fakes

MODEL = TwinTube()
NAMES = MODEL.names


def point(error: float) -> Minimum[None]:
    """Two quantities, the first of which has this standard error of its logarithm."""
    cost = 1e-4
    length = math.sqrt(cost / (FEWEST_SAMPLES * 3)) / error
    jacobian = np.zeros((100, 2))
    jacobian[0, 0], jacobian[1, 1] = length, 1.0
    residuals = np.full(100, 1e-3)
    return ended(DenseSystem(residuals, jacobian))


def ended(system: DenseSystem) -> Minimum[None]:
    return Minimum(np.ones(2), system, None, 1, 0, 2, np.zeros(2, dtype=bool))


@pytest.mark.parametrize(("factor", "is_undetermined"), [(0.99, False), (1.01, True)])
def test_an_error_beyond_the_limit_is_undetermined(factor: float, *, is_undetermined: bool) -> None:
    names = ("compression_opening", "rebound_bleed")
    found = _undetermined(point(factor * math.log(1.65)), MODEL, names, 3)
    assert found == (names[:1] if is_undetermined else ())


def test_a_column_of_zeros_is_undetermined_and_an_offset_never() -> None:
    flat = ended(DenseSystem(np.full(100, 1e-3), np.zeros((100, 2))))
    assert _undetermined(flat, MODEL, ("rebound_opening", "f_0"), 3) == ("rebound_opening",)


def test_of_quantities_that_do_the_same_none_is_determined_and_another_is() -> None:
    chance = np.random.default_rng(3)
    one = chance.normal(size=200)
    jacobian = np.stack([one, 2.0 * one, one + chance.normal(size=200)], axis=1)
    known = ended(DenseSystem(np.full(200, 1e-3), jacobian))
    names = ("rebound_opening", "rebound_slope", "rebound_bleed")
    assert _undetermined(known, MODEL, names, 3) == names[:2]


def found(setting: int, opening: float, undetermined: tuple[str, ...] = ()) -> LawFit:
    numbers = {one.name: one.default or 1e5 for one in MODEL.quantities}
    values = MODEL.values(numbers | {"rebound_opening": opening})
    own = Setting.of(setting)
    return LawFit(
        own, MODEL, values, NAMES, (), 0.01, (0.01,), math.nan, "", (np.zeros(3),), 9, undetermined
    )


def test_sentences_and_table_leave_out_or_mark_what_is_not_told() -> None:
    name = "rebound_opening"
    fits = [found(1, 5e5), found(2, 2e4, (name,))]
    others = "the logs of the others do not determine it."
    assert physics_seen(fits)[0].endswith(f"N (5 bar) at setting 1; {others}")
    assert physics_seen([fits[0], found(3, 4e5), fits[1]])[0].endswith(
        f"N (4 to 5 bar) at settings 1, 3; {others}"
    )
    assert physics_seen(fits[:1])[0].endswith("N (5 bar).")
    # What ran to an edge of its range is told by no log either.
    assert physics_seen([fits[0], replace(found(3, 1e3), at_bound=(name,))]) == physics_seen(fits)
    assert physics_seen(fits[1:])[0] == (
        "In rebound these logs do not determine where a blow-off opens."
    )
    several = [found(one, 5e5) for one in (1, 2, 3)]
    assert f"at settings 1, 2, 3; {others}" in physics_seen([*several, fits[1]])[0]
    four = [*several, found(4, 5e5), replace(fits[1], setting=Setting.of(5))]
    assert f"at 4 of 5 settings; {others}" in physics_seen(four)[0]
    sheet = chosen_sheet(fits)
    row = next(row for row in sheet.rows if row[0] == "rebound opening")
    assert row[2:] == ("5.000", "0.2000?")
    assert sheet.notes == (
        "? not determined by these logs: 1.65 times as much or little would do as well",
    )
    assert chosen_sheet(fits[:1]).notes == ()
    assert [one["not_told"] for one in chosen_records(fits)] == [[], [name]]


@pytest.mark.parametrize(
    ("times", "same"),
    [
        (1.25, "4 bar, an exponent of 1.04 or a rod 0.946 times as thick"),
        (1.5, "3.33 bar or a rod 0.904 times as thick"),  # no gas has 0.87
        (0.8, "6.25 bar, an exponent of 1.62 or a rod 1.06 times as thick"),
    ],
)
def test_a_gas_volume_that_was_found_says_what_else_would_be_as_soft(times, same: str) -> None:
    one = found(1, 5e5)
    soft = replace(one, values=one.values.replace({"gas_volume": times * MODEL.gas_volume}))
    assert physics_seen([soft])[-1] == (
        f"The gas spring is that of {30 * times:.3g} cm3 at 5 bar; [damper] has 30 cm3; {same} "
        "would do the same: measure with gauge and callipers."
    )
    assert "The gas spring" not in " ".join(physics_seen([one]))


@pytest.mark.parametrize(("flat", "are_told"), [("opening", False), ("bleed", True)])
def test_a_fit_tells_nothing_of_a_blow_off_whose_opening_it_does_not_tell(
    flat: str, *, are_told: bool
) -> None:
    free = tuple(one.name for one in MODEL.quantities if one.default is None)
    values = MODEL.values({one.name: one.default or 1e5 for one in MODEL.quantities})
    errors = dict.fromkeys(free, 1e-3) | {f"compression_{flat}": math.inf}
    problem = Block(MODEL, (fakes.trace(1),), free, SolverOptions())
    found = _statuses(problem, SimpleNamespace(values=values), errors)
    assert found[f"compression_{flat}"] is Status.NOT_IDENTIFIABLE
    assert (found["compression_slope"] is Status.FITTED) is are_told
    assert found["rebound_slope"] is Status.FITTED


def test_sentences_are_in_the_numbers_of_the_fits_that_follow() -> None:
    searched = {"chosen": "a law", "sentences": list(physics_seen([found(1, 5e5)]))}
    assert "(5 bar)" in searched["sentences"][0]

    def fit(setting: int, opening: float, status: Status) -> SimpleNamespace:
        values = found(setting, opening).values
        return SimpleNamespace(
            setting=Setting.of(setting),
            parameters=values,
            status={**dict.fromkeys(values.names, Status.FITTED), "rebound_opening": status},
        )

    fits = (fit(1, 5.4e5, Status.FITTED), fit(2, 7e5, Status.SHARED))
    again = seen_again(searched, SimpleNamespace(fits=fits), MODEL)
    assert "(5.4 to 7 bar)" in again["sentences"][0]
    assert (again["chosen"], "(5 bar)" in searched["sentences"][0]) == ("a law", True)
    for status in (Status.NOT_IDENTIFIABLE, Status.ABSENT, Status.AT_BOUND):
        open_at_one = (fits[0], fit(2, 7e5, status))
        said = seen_again(searched, SimpleNamespace(fits=open_at_one), MODEL)["sentences"][0]
        assert "(5.4 bar) at setting 1; the logs of the others do not determine it" in said
    # What had none, as where another law does as well, gets none; nor does a run without a fit.
    assert seen_again({"sentences": []}, SimpleNamespace(fits=fits), MODEL) == {"sentences": []}
    assert seen_again(searched, SimpleNamespace(fits=()), MODEL) == searched
    assert seen_again(searched, SimpleNamespace(fits=fits), PURDY_DAMPER) == searched
