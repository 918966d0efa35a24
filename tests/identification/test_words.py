"""What is said of searches, cavitation and options, word by word, and the limits behind it."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from damperfit.damper.cavitation import Cavitation, describe_cavitation
from damperfit.damper.purdy.parameters import PURDY_DAMPER
from damperfit.errors import ConfigurationError
from damperfit.identification import (
    FitOptions,
    Sharing,
    describe_searches,
)
from damperfit.identification.joint_procedure import _judged_law
from damperfit.identification.multistart import Search, Valley
from damperfit.identification.options import check_options
from damperfit.identification.sharing import listed_settings
from tests import fakes


def minimum(mse, n=3, **values) -> Valley:
    return Valley(replace(fakes.fit(1).parameters, **values), mse, "converged", n)


def search(setting, *minima, failed=0, improved=False, ambiguous=False) -> Search:
    n = sum(one.n_starts for one in minima) + failed
    return Search(setting, ("r_m1", "k_e"), minima, n, failed, improved, ambiguous)


def test_searches_that_end_alike_are_one_sentence() -> None:
    one = minimum(0.0123)
    assert describe_searches([search(1, one)]) == (
        "setting 1, r_m1, k_e free, 3 starts: all end in one minimum",
    )
    told = describe_searches([search(1, one), search(2, one), search(4, one, failed=2)])
    assert told == (
        "settings 1, 2, r_m1, k_e free, 3 starts: all end in one minimum",
        (
            "setting 4, r_m1, k_e free, 5 starts of which 2 could not be simulated: all end in one "
            "minimum"
        ),
    )


@pytest.mark.parametrize(("n", "more"), [(4, ""), (5, " and 1 more")])
def test_four_minima_are_shown(n, more) -> None:
    (said,) = describe_searches([search(1, *(minimum(0.5 + k, n=1) for k in range(n)))])
    shown = ", ".join(f"{0.5 + k:.3g} % (1, converged)" for k in range(4))
    assert said.endswith(f": {n} minima, with MSE {shown}{more}")


def test_a_search_warns_of_two_minima_alike_and_of_a_better_one() -> None:
    one, other = minimum(0.5, k_e=5e8), minimum(0.5, k_e=5.2e8)
    assert search(1, one, other).warning == ""
    assert search(1, one, other, improved=True).warning == (
        "a better minimum than from the procedure's own start was found, and is used"
    )
    assert search(1, one, other, improved=True, ambiguous=True).warning == (
        "different minima fit equally well: k_e 5e+08 or 5.2e+08"
    )


FULL = Cavitation(0.0, 1.25e5, 2, -0.012, 0.3, 0.176, 3.9e5)
EMPTY = Cavitation(0.054, 0.0, 2, 0.012, -0.28, -0.21, 5.8e5)


def test_a_fit_tells_what_its_cavitation_is() -> None:
    one = replace(fakes.fit(1), cavitation=FULL)
    assert (one.cavitation_fraction, one.cavitation_margin) == (0.0, FULL.margin)


def test_how_near_a_chamber_is_to_cavitation_is_told_for_the_nearest_setting() -> None:
    far = replace(FULL, lowest_pressure=3e5, r_m3_margin=0.9)
    assert describe_cavitation({1: far, 7: FULL}) == (
        (
            "no chamber cavitates; lowest pressure 1.25 bar absolute, in chamber 2 of setting 7, "
            "at x = -12 mm, v = +0.30 m/s of the rebound; there R_m3 may rise by 18 %, or the gas "
            "pressure fall to 3.90 bar absolute, until a chamber cavitates on this motion"
        ),
    )


@pytest.mark.parametrize("unknown", ["r_m3_margin", "safe_gas_pressure"])
def test_a_margin_that_is_not_known_is_not_told(unknown) -> None:
    (said,) = describe_cavitation({7: replace(FULL, **{unknown: math.nan})})
    assert said.endswith("at x = -12 mm, v = +0.30 m/s of the rebound")


def test_a_setting_that_cavitates_is_told_with_what_it_takes() -> None:
    first, rest = describe_cavitation({3: EMPTY, 7: FULL})
    assert first == (
        "setting 3: 5.4 % of the cycle with chamber 2 at zero pressure, from x = +12 mm, v = "
        "-0.28 m/s of the bump; it takes a gas pressure of 5.80 bar absolute, or R_m3 lower by "
        "21 %, to keep it full"
    )
    assert rest.startswith("elsewhere none does; lowest pressure 1.25 bar absolute")
    (doubted,) = describe_cavitation({3: EMPTY}, doubted={3})
    assert doubted.endswith(
        "-0.28 m/s of the bump; the model does not match these logs, so the damper itself may be "
        "full"
    )
    (alone,) = describe_cavitation({3: replace(EMPTY, safe_gas_pressure=math.nan)})
    assert alone.endswith("m/s of the bump")
    (by_gas,) = describe_cavitation({3: replace(EMPTY, r_m3_margin=math.nan)})
    assert by_gas.endswith("it takes a gas pressure of 5.80 bar absolute to keep it full")


REFUSED = [
    (FitOptions("papers"), "no procedure 'papers'; there are paper, joint, plain. Did you mean"),
    (FitOptions(free=("r_m9",)), "no parameter 'r_m9'"),
    (FitOptions(fixed={"r_m9": 1.0}), "no parameter 'r_m9'"),
    (FitOptions(share=("r_m9",)), "no parameter 'r_m9'"),
    (FitOptions(free=("r_m1",), fixed={"r_m1": 1.0}), "r_m1 is both free and fixed; choose one."),
    (FitOptions("joint", free=("r_m3",), share=("r_m3",)), "r_m3 is shared and also free or fixed"),
    (FitOptions("joint", fixed={"r_m3": 1.0}, share=("r_m3",)), "shared and also free or fixed"),
    (FitOptions(fixed={"r_m1": 0.0}), "r_m1 = 0 is fixed, far from any damper's; expected 10 to"),
    (FitOptions(fixed={"r_m1": 1e99}), "expected 10 to 1e+07 s sqrt(N)/(m kg)."),
    (FitOptions(fixed={"r_m1": 1.01e7}), "r_m1 = 1.01e+07 is fixed"),
    (FitOptions(fixed={"r_m1": 9.9}), "r_m1 = 9.9 is fixed"),
    (FitOptions(fixed={"r_m3": 2.597}), "r_m3 = 2.597 is fixed, far from any damper's"),
    (
        FitOptions(fixed={"k_e": -1.0}),
        "k_e = -1 is fixed, far from any damper's; expected 1e+06 to",
    ),
    (FitOptions(fixed={"k_e": 9.9e5}), "expected 1e+06 to 1e+11 Pa."),
    (
        FitOptions(fixed={"f_f": -1.0}),
        "f_f = -1 is fixed, far from any damper's; expected 0.001 to",
    ),
    (FitOptions("joint", bulk_modulus="appendix"), "no bulk modulus 'appendix'; there are"),
    (FitOptions("paper", bulk_modulus="appendix1"), "expected procedure joint, found paper."),
    (FitOptions("joint", bulk_modulus="appendix1", fixed={"k_e": 1e9}), "cannot be free, fixed or"),
    (FitOptions("joint", bulk_modulus="appendix1", free=("k_e",)), "cannot be free, fixed or"),
    (FitOptions("joint", bulk_modulus="appendix1", share=("k_e",)), "cannot be free, fixed or"),
]


@pytest.mark.parametrize(("options", "says"), REFUSED, ids=range(len(REFUSED)))
def test_options_that_cannot_be_are_refused(options, says) -> None:
    with pytest.raises(ConfigurationError) as caught:
        check_options(options, PURDY_DAMPER)
    assert says in str(caught.value)


@pytest.mark.parametrize(
    "options",
    [
        FitOptions(),
        FitOptions(fixed={"f_f": 0.0}),
        FitOptions(fixed={"r_m1": 1e7, "k_e": 1e6}),
        FitOptions(fixed={"r_m1": 1e1, "k_e": 1e11}),
        FitOptions(fixed={"f_0": -118.0}),
        FitOptions("plain", free=("r_m1", "k_e"), fixed={"r_m3": 1e3}),
        FitOptions("plain", free=("r_m3",), share=("r_m3",)),  # shares nothing
        FitOptions("joint", fixed={"r_m3": 2e6}, share=("f_f",)),
        FitOptions("joint", bulk_modulus="appendix1"),
    ],
)
def test_options_that_can_be_are_let_through(options) -> None:
    check_options(options, PURDY_DAMPER)


@pytest.mark.parametrize(
    ("rises", "said"),
    [
        ({1: 0.1, 2: 0.1}, "drawn through two settings: only a third can tell whether it holds."),
        ({1: 5.0, 2: 5.0, 3: 0.7}, ""),  # chi-squared of one degree of freedom: 10.83
        ({1: 5.0, 2: 5.0, 3: 1.0}, "better than noise explains at 0 of 3 settings, most at"),
        ({1: 1.0, 2: 12.0, 3: 14.0}, "noise explains at 2 of 3 settings, most at setting 3; take"),
        ({1: 5.0, 2: 5.0, 3: 3.7, 4: 0.0}, ""),  # of two: 13.82
        ({1: 5.0, 2: 5.0, 3: 3.9, 4: 0.0}, "at 0 of 4 settings"),
    ],
)
def test_a_gas_content_is_doubted_where_chance_is_below_a_thousandth(rises, said) -> None:
    told = _judged_law(rises)
    assert len(told) == bool(said)
    assert said in "".join(told)


def test_friction_varies_only_where_a_range_is_known_and_sure() -> None:
    assert not Sharing().friction_varies
    assert Sharing(spread=(40.0, 61.0)).friction_varies
    assert not Sharing(spread=(40.0, 59.0)).friction_varies
    assert not Sharing(spread=(40.0, 90.0), is_spread_certain=False).friction_varies


@pytest.mark.parametrize(
    ("sharing", "found", "variables"),
    [
        (Sharing(), (), ()),
        (Sharing(taken={"r_m3": 1}), ("r_m3",), ("r_m3",)),
        (Sharing(means={"f_f": (1, 2)}), ("f_f",), ("f_f",)),
        (Sharing(jointly=("r_m3",), means={"f_f": (1,)}), ("r_m3",), ("r_m3",)),
    ],
)
def test_what_the_logs_gave_once_for_all(sharing, found, variables) -> None:
    assert sharing.found == found
    assert sharing.variables == variables


def test_runs_of_three_settings_are_drawn_together() -> None:
    assert listed_settings([3, 1, 2]) == "1-3"
    assert listed_settings([1, 2]) == "1, 2"
    assert listed_settings([1, 2, 4, 6, 7, 8, 9]) == "1, 2, 4, 6-9"


def test_plausible_is_a_hundredfold_beyond_the_paper_s_damper() -> None:
    found = {q.name: q.plausible for q in PURDY_DAMPER.quantities if q.is_logarithmic}
    assert found == {
        "r_m1": (10.0, 1e7),
        "r_m2": (1e3, 1e10),
        "r_m3": (1e3, 1e10),
        "k_e": (1e6, 1e11),
        "f_f": (1e-3, 1e4),
    }
