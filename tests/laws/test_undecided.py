"""What logs leave open is told with the test that decides it, and what they decide is not."""

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from damperfit.damper.mounting import FIT, NONE, Mounting
from damperfit.damper.purdy.parameters import PURDY_DAMPER
from damperfit.damper.valve_dampers import TwinTube
from damperfit.identification import Status
from damperfit.identification.fit_problem import Block
from damperfit.identification.fit_setting import _statuses
from damperfit.identification.least_squares import LinearSystem, Minimum
from damperfit.identification.logs import FEWEST_SAMPLES
from damperfit.identification.sharing import Unknown
from damperfit.laws.description import described_again, physics_in, undecided
from damperfit.laws.law_fit import (
    Candidate,
    ComparedCandidate,
    LawFit,
    LawSearch,
    SettingLogs,
    most_unlike,
    undetermined,
)
from damperfit.recording import Trace
from damperfit.simulation import SolverOptions
from damperfit.tested.setting import Setting
from tests import fakes

MODEL = TwinTube(mounting=Mounting(FIT, NONE, FIT))
FREE = tuple(one.name for one in MODEL.quantities if one.default is None)


def log(*frequencies: float) -> Trace:
    """A log of a stroke of 20 mm to both sides at each frequency."""
    one = fakes.trace(1)
    (segment,) = one.segments
    parts = tuple(
        replace(segment, frequency=f, amplitude=0.02, peak_speed=2 * np.pi * f * 0.02)
        for f in frequencies
    )
    return replace(one, segments=parts)


def fit(place: int = 1, **known: object) -> LawFit:
    numbers = {one.name: one.default or 1e5 for one in MODEL.quantities}
    whole = LawFit(
        Setting.of(place), MODEL, MODEL.values(numbers), FREE, (), 0.01, (0.01,), 0.01, "logs",
        (np.zeros(3),), 9,
    )  # fmt: skip
    return replace(whole, **known)  # type: ignore[arg-type]


def told(
    fits: list[LawFit], *frequencies: float, search: LawSearch | None = None
) -> tuple[str, ...]:
    logs = [SettingLogs(one.setting, (log(*frequencies),)) for one in fits]
    return undecided(search or LawSearch((), Candidate("law", tuple(fits)), 60.0), fits, logs)


def test_logs_that_decide_everything_leave_nothing_open() -> None:
    assert told([fit()], 1.0, 2.0) == ()


@pytest.mark.parametrize(("second", "is_open"), [(1.24, True), (1.26, False)])
def test_lag_and_elasticity_ask_for_a_second_frequency(second: float, *, is_open: bool) -> None:
    said = told([fit()], 1.0, second)
    assert bool(said) is is_open
    if said:
        assert "they look alike. A second speed decides it, at 0.3 or 3.72 Hz" in said[0]


def test_motion_that_does_not_repeat_has_more_than_one_frequency() -> None:
    """A log of three speeds, a cycle and a half of each, was said to have the mean of them."""
    (segment,) = log(1.0).segments
    moving = replace(log(1.0), segments=(replace(segment, kind="moving"),))
    logs = [SettingLogs(fit().setting, (moving,))]
    assert undecided(LawSearch((), Candidate("law", (fit(),)), 60.0), [fit()], logs) == ()


def test_a_moving_mass_and_a_softer_gas_spring_ask_for_a_second_frequency() -> None:
    model = replace(MODEL, mounting=Mounting(NONE, NONE, NONE, FIT))
    free = tuple(one.name for one in model.quantities if one.default is None)
    values = model.values({one.name: one.default or 1e5 for one in model.quantities})
    one = fit(model=model, values=values, free=free)
    (said,) = told([one], 1.0, 1.24)
    assert "the gas spring is softer" in said
    assert said.endswith("decides it, or a second speed, at 0.3 Hz.")
    (said,) = told([one], 1.0, 1.26)
    assert "the displacement is read late" in said


def test_settings_are_compared_at_the_weakest_and_the_strongest_force_and_evenly_between() -> None:
    one = log(1.0)
    logs = [
        SettingLogs(Setting.of(place), (replace(one, force=size * one.force),))
        for place, size in enumerate((3.0, 1.0, 5.0, 2.0, 4.0), start=1)
    ]
    assert most_unlike(logs) == [2, 3]
    assert most_unlike(logs, 3) == [1, 2, 3]
    assert most_unlike(logs[:2], 3) == [1, 2]


def felt(share: float) -> Trace:
    """A log in which a kilogram takes that share of the force's deviation at its 8 Hz."""
    one = log(1.0, 8.0)
    most = (2.0 * np.pi * 8.0) ** 2 * 0.02
    return replace(one, force=one.force * most / share / np.std(one.force[one.compared]))


def test_what_moves_with_the_load_cell_is_asked_for_where_a_kilogram_is_felt() -> None:
    def asked(share: float, model: TwinTube = MODEL) -> tuple[str, ...]:
        one = fit(model=model)
        logs = [SettingLogs(one.setting, (felt(share),))]
        search = LawSearch((), Candidate("law", (one,)), 60.0)
        return undecided(search, [one], logs, has_parts_alone=True)

    assert asked(0.0199) == ()
    (said,) = asked(0.0201)
    assert said == (
        "Which mass moves between load cell and damper: at 8 Hz a kilogram takes 51 N at the ends "
        "of the stroke, and may pass for a lag, friction or a blow-off. Weighing it decides it "
        "(damper.mounting.moving_mass); a load cell at the fixed end reads none of it."
    )
    still = replace(felt(0.5), force=np.zeros_like(felt(0.5).force))  # a channel that was not on
    logs = [SettingLogs(fit().setting, (still,))]
    search = LawSearch((), Candidate("law", (fit(),)), 60.0)
    assert undecided(search, [fit()], logs, has_parts_alone=True) == ()
    weighed = replace(MODEL, mounting=Mounting(FIT, NONE, FIT, 1.2))
    assert asked(0.5, weighed) == ()


@pytest.mark.parametrize("name", [n for n in FREE if n != "f_0"] + ["gas_volume", "k_e", "drag"])
def test_whatever_is_not_told_has_a_test_that_decides_it(name: str) -> None:
    (said,) = told([fit(at_bound=(name,))], 1.0, 2.0)
    assert said.endswith("would decide it.")
    assert " at setting" not in said  # there is one


@pytest.mark.parametrize(("bic", "gain", "is_open"), [
    (-0.1, 1.6, True), (0.1, 1.6, False), (-0.1, 1.4, False),
])  # fmt: skip
def test_a_part_that_costs_more_than_the_logs_pay_is_left_open(
    bic: float, gain: float, *, is_open: bool
) -> None:
    tried = Candidate("law", (fit(),))
    judged = ComparedCandidate(tried, False, "", bic, "with gas volume", gain)
    said = told([fit()], 1.0, 2.0, search=LawSearch((judged,), tried, 60.0))
    assert bool(said) is is_open
    assert all(one.startswith("Whether the damper has gas volume: ") for one in said)


# What the logs of a setting do not determine is marked and left out of the sentences.

PLAIN = TwinTube()
NAMES = PLAIN.names


def point(error: float) -> Minimum[None]:
    """Two quantities, the first of which has this standard error of its logarithm."""
    cost = 1e-4
    length = math.sqrt(cost / (FEWEST_SAMPLES * 3)) / error
    jacobian = np.zeros((100, 2))
    jacobian[0, 0], jacobian[1, 1] = length, 1.0
    residuals = np.full(100, 1e-3)
    return ended(LinearSystem(residuals, jacobian))


def ended(system: LinearSystem) -> Minimum[None]:
    return Minimum(np.ones(2), system, None, 1, 0, 2, np.zeros(2, dtype=bool))


def loose(known: Minimum[None], *names: str) -> list[str]:
    """Which of some names a fit of three segments does not determine."""
    block = SimpleNamespace(model=PLAIN, traces=[SimpleNamespace(segments=range(3))])
    return [unknown.name for unknown in undetermined(known, [block], [*map(Unknown, names)])]


@pytest.mark.parametrize(("factor", "is_undetermined"), [(0.99, False), (1.01, True)])
def test_an_error_beyond_the_limit_is_undetermined(factor: float, *, is_undetermined: bool) -> None:
    names = ("compression_opening", "rebound_bleed")
    found = loose(point(factor * math.log(1.65)), *names)
    assert found == ([names[0]] if is_undetermined else [])


def test_a_column_of_zeros_is_undetermined_and_an_offset_never() -> None:
    flat = ended(LinearSystem(np.full(100, 1e-3), np.zeros((100, 2))))
    assert loose(flat, "rebound_opening", "f_0") == ["rebound_opening"]


def test_of_quantities_that_do_the_same_none_is_determined_and_another_is() -> None:
    chance = np.random.default_rng(3)
    one = chance.normal(size=200)
    jacobian = np.stack([one, 2.0 * one, one + chance.normal(size=200)], axis=1)
    known = ended(LinearSystem(np.full(200, 1e-3), jacobian))
    names = ["rebound_opening", "rebound_slope", "rebound_bleed"]
    assert loose(known, *names) == names[:2]


def found(setting: int, opening: float, undetermined: tuple[str, ...] = ()) -> LawFit:
    numbers = {one.name: one.default or 1e5 for one in PLAIN.quantities}
    values = PLAIN.values(numbers | {"rebound_opening": opening})
    own = Setting.of(setting)
    return LawFit(
        own, PLAIN, values, NAMES, (), 0.01, (0.01,), math.nan, "", (np.zeros(3),), 9, undetermined
    )


@pytest.mark.parametrize(("flat", "are_told"), [("opening", False), ("bleed", True)])
def test_a_fit_tells_nothing_of_a_blow_off_whose_opening_it_does_not_tell(
    flat: str, *, are_told: bool
) -> None:
    free = tuple(one.name for one in PLAIN.quantities if one.default is None)
    values = PLAIN.values({one.name: one.default or 1e5 for one in PLAIN.quantities})
    errors = dict.fromkeys(free, 1e-3) | {f"compression_{flat}": math.inf}
    problem = Block(PLAIN, (fakes.trace(1),), free, SolverOptions())
    found = _statuses(problem, SimpleNamespace(values=values), errors)
    assert found[f"compression_{flat}"] is Status.NOT_IDENTIFIABLE
    assert (found["compression_slope"] is Status.FITTED) is are_told
    assert found["rebound_slope"] is Status.FITTED


def test_sentences_are_in_the_numbers_of_the_fits_that_follow() -> None:
    searched = {"chosen": "a law", "sentences": list(physics_in([found(1, 5e5)]))}
    assert "(5 bar)" in searched["sentences"][0]

    def fit(setting: int, opening: float, status: Status) -> SimpleNamespace:
        values = found(setting, opening).values
        return SimpleNamespace(
            setting=Setting.of(setting),
            parameters=values,
            status={**dict.fromkeys(values.names, Status.FITTED), "rebound_opening": status},
        )

    fits = (fit(1, 5.4e5, Status.FITTED), fit(2, 7e5, Status.SHARED))
    again = described_again(searched, SimpleNamespace(fits=fits), PLAIN)
    assert "(5.4 to 7 bar)" in again["sentences"][0]
    assert (again["chosen"], "(5 bar)" in searched["sentences"][0]) == ("a law", True)
    for status in (Status.NOT_IDENTIFIABLE, Status.ABSENT, Status.AT_BOUND):
        open_at_one = (fits[0], fit(2, 7e5, status))
        said = described_again(searched, SimpleNamespace(fits=open_at_one), PLAIN)["sentences"][0]
        assert "(5.4 bar) at setting 1; the logs of the others do not determine it" in said
    # What had none, as where another law does as well, gets none; nor does a run without a fit.
    assert described_again({"sentences": []}, SimpleNamespace(fits=fits), PLAIN) == {
        "sentences": []
    }
    assert described_again(searched, SimpleNamespace(fits=()), PLAIN) == searched
    assert described_again(searched, SimpleNamespace(fits=fits), PURDY_DAMPER) == searched
