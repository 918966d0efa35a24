"""Which parameters of a setting get a short profile by themselves, and on which scale."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from damperfit.damper.purdy.parameters import PURDY_DAMPER
from damperfit.identification import Sharing, Status
from damperfit.uncertainty import profiles as profile_walk
from damperfit.uncertainty.covariance import _shared_rows
from damperfit.uncertainty.profiles import Bench, doubtful_profiles, is_doubtful, profile_lines
from tests import fakes
from tests.uncertainty.test_limits import linearised
from tests.uncertainty.test_words import known, profile


@pytest.mark.parametrize(
    ("error", "status", "is_in_doubt"),
    [
        (0.095, "fitted", False),
        (0.105, "fitted", True),
        (0.01, "at_bound", True),
        (0.01, "not_identifiable", True),
    ],
)
def test_an_interval_is_doubtful_from_a_tenth_on(error, status, *, is_in_doubt) -> None:
    fit = fakes.fit(1, status={"k_e": status})
    assert is_doubtful("k_e", fit, known(error=error)) is is_in_doubt
    assert not is_doubtful("f_f", fit, known(error=1.0))  # has no interval


def profiled(monkeypatch, *, status, errors, sharing, budget=100, cost=1):
    """Names of the parameters that are followed, in turn."""
    seen = linearised(np.ones(333))
    fit = replace(
        seen.fit,
        status=seen.fit.status | {n: Status(word) for n, word in status.items()},
        evaluations=budget,
    )
    uncertainty = known(names=tuple(errors))
    uncertainty = replace(uncertainty, covariance=np.diag(np.square(list(errors.values()))))
    monkeypatch.setattr(profile_walk, "profile_lines", lambda name, *_: [name])
    monkeypatch.setattr(
        profile_walk,
        "trace_profile",
        lambda name, _: replace(profile(1.0, 2.0, name=name), evaluations=cost),
    )
    bench = Bench(PURDY_DAMPER)
    return doubtful_profiles(replace(seen, fit=fit), uncertainty, sharing, bench)


def test_what_is_in_doubt_is_followed_and_what_has_failed_first(monkeypatch) -> None:
    found = profiled(
        monkeypatch,
        status={"k_e": "not_identifiable", "f_f": "at_bound"},
        errors={"r_m1": 0.01, "r_m2": 0.2, "r_m3": 0.3},
        sharing=Sharing(taken={"r_m3": 1}),
    )
    assert [one.name for one in found] == ["k_e", "f_f", "r_m2", "r_m3"]
    assert [one.is_shared for one in found] == [False, False, False, True]
    assert all(one.is_doubtful for one in found)


def test_a_mean_friction_has_no_profile_in_one_setting(monkeypatch) -> None:
    found = profiled(
        monkeypatch,
        status={"f_f": "not_identifiable", "k_e": "not_identifiable"},
        errors={"r_m1": 0.2},
        sharing=Sharing(means={"f_f": (1, 2)}),
    )
    assert [one.name for one in found] == ["k_e", "r_m1"]


def test_profiles_end_with_their_budget(monkeypatch) -> None:
    found = profiled(
        monkeypatch, status={}, errors=dict.fromkeys(PURDY_DAMPER.names[:4], 0.5),
        sharing=Sharing(), budget=100, cost=60,
    )  # fmt: skip
    assert [one.name for one in found] == ["r_m1", "r_m2"]  # 70, then 10: no more than a look


def line(
    name, *, sharing=None, free=("r_m1", "r_m2", "k_e"), error=0.02, misfit=None, f_f_is=50.0,
    **status,
):  # fmt: skip
    seen = linearised(np.ones(333))
    status = {n: Status(word) for n, word in status.items()}
    values = seen.fit.parameters.replace({"f_f": f_f_is})
    fit = replace(seen.fit, status=seen.fit.status | status, parameters=values)
    bent = None if misfit is None else misfit * np.eye(6)
    seen = replace(seen, fit=fit, information=4.0 * np.eye(6), scores=16.0 * np.eye(6), misfit=bent)
    its = known(names=(*free, *(() if name in free else (name,))), error=error)
    bench = Bench(PURDY_DAMPER)
    return list(profile_lines(name, {1: seen}, {1: its}, sharing or Sharing(), bench))


def test_the_scale_of_a_line_is_its_curvature_over_its_variance() -> None:
    (own,) = line("r_m2")
    assert own.error == pytest.approx(0.02)
    assert own.scale == pytest.approx(0.25 / 0.02**2)
    assert own.misfit.free == ("r_m1", "r_m2", "k_e")
    (offset,) = line("f_0", free=("r_m1", "f_0"), f_0="fitted")
    assert offset.error == pytest.approx(0.0002)  # counted in units of 100 N
    # At its bound a parameter has no error: the sandwich of what is free stands in, 16/16.
    (bound,) = line("f_f", free=("r_m1", "r_m2", "k_e"), f_f="at_bound")
    assert bound.error == pytest.approx(1.0)
    assert bound.misfit.free == ("r_m1", "r_m2", "k_e", "f_f")
    assert line("r_m3", r_m3="fixed") == []


def test_what_repeats_widens_a_profile_as_it_widens_an_error() -> None:
    """A friction was said to be below 0.0001 N at 95 %, by the noise alone, where it was 20 N."""
    (noise,), (both,) = line("r_m2", error=2.0), line("r_m2", error=2.0, misfit=64.0)
    assert noise.error == pytest.approx(2.0)
    assert both.error == pytest.approx(math.hypot(2.0, 8.0 / 4.0))
    assert both.scale == pytest.approx(0.25 / 8.0)
    (bound,) = line("f_f", f_f="at_bound", misfit=48.0)
    assert bound.error == pytest.approx(math.sqrt((16.0 + 48.0) / 16.0))


def test_a_friction_that_was_left_out_for_none_has_an_upper_limit() -> None:
    least = PURDY_DAMPER.quantity("f_f").plausible[0]
    (one,) = line("f_f", f_f="absent", f_f_is=least)
    assert one.misfit.free == ("r_m1", "r_m2", "k_e", "f_f")
    assert line("f_f", f_f="absent", f_f_is=1e3 * least) == []  # left out for another reason
    assert line("r_m3", r_m3="absent") == []


def test_a_shared_parameter_is_followed_where_it_comes_from() -> None:
    free = ("r_m1", "r_m2", "k_e", "r_m3", "f_f")
    here = Sharing(free=free, taken={"r_m3": 1}, means={"f_f": (1, 2)}, held=("f_f",))
    (r_m3,) = line("r_m3", sharing=here)
    assert r_m3.misfit.free == ("r_m1", "r_m2", "r_m3", "k_e")
    assert r_m3.error == pytest.approx(0.02)
    (f_f,) = line("f_f", sharing=here)
    assert f_f.misfit.free == ("r_m1", "r_m2", "r_m3", "k_e", "f_f")
    assert f_f.error == pytest.approx(1.0)
    elsewhere = replace(here, taken={"r_m3": 2}, means={"f_f": (2,)})
    assert line("r_m3", sharing=elsewhere) == line("f_f", sharing=elsewhere) == []
    jointly = Sharing(free=free, jointly=("r_m3", "f_f"), settings=(1,))
    assert line("r_m3", sharing=jointly) == line("f_f", sharing=jointly) == []


@pytest.mark.parametrize(("settings", "share"), [((1,), 1.0), ((1, 7), 1.0), ((1, 2), 0.5)])
def test_a_mean_friction_has_the_weight_of_the_settings_that_were_judged(settings, share) -> None:
    """Setting 7 gave a friction and was left out later: the mean is told by the others."""
    one = replace(linearised(np.ones(333)), information=4.0 * np.eye(6))
    both = [one, replace(one, fit=replace(one.fit, setting=2))]
    sharing = Sharing(free=("r_m1", "f_f"), means={"f_f": settings})
    first, second = _shared_rows(both, sharing)
    expected = np.zeros((1, 6))
    expected[0, PURDY_DAMPER.names.index("f_f")] = share / 4.0
    assert first == pytest.approx(expected)
    assert second == pytest.approx(expected if 2 in settings else np.zeros((1, 6)))
