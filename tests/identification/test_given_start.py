"""Fits start where somebody says."""

from __future__ import annotations

from functools import cache

from damperfit.damper.purdy.parameters import PURDY_DAMPER
from damperfit.identification import (
    FitOptions,
    GivenStart,
    check_options,
)
from damperfit.identification.campaign import ProcedureInput
from damperfit.identification.starts import own_start
from damperfit.tested.setting import Setting
from tests.identification.rig import trace

KNOWN = {"r_m3": 2.597e6, "f_f": 50.0}
OWN = {"r_m1": 1e4, "r_m2": 2e6, "k_e": 5e8}


@cache
def log(setting: int):
    return trace(setting, noise=4.0, duration=4.0)


def given(start: GivenStart, settings=(5,)) -> ProcedureInput:
    options = FitOptions("plain", fixed={**KNOWN, "f_0": 0.0}, start=start)
    traces = {Setting.of(k): (log(k),) for k in settings}
    return ProcedureInput(traces, PURDY_DAMPER, options, 1, lambda _: None, lambda: False)


def started(start: GivenStart):
    one = given(start)
    block = one.block(Setting.of(5), ("r_m1", "r_m2", "k_e"))
    return own_start(one, Setting.of(5), block, one.options.fixed)


def test_what_is_told_is_where_a_fit_starts_and_the_rest_is_the_models_start() -> None:
    own = started(GivenStart())
    there = started(GivenStart({"k_e": 7e8}))
    assert there == own.replace(k_e=7e8) != own


def test_a_name_goes_before_the_table_what_is_fixed_before_both_and_the_range_before_all() -> None:
    table = {Setting.of(5): {**OWN, "r_m3": 1.0, "k_e": 1e30, "other": 3.0}}
    there = started(GivenStart({"r_m1": 2e4}, table))
    assert (there.r_m1, there.r_m2, there.r_m3) == (2e4, 2e6, KNOWN["r_m3"])
    assert there.k_e == PURDY_DAMPER.quantity("k_e").plausible[1]


def test_what_is_freed_may_be_given_a_start() -> None:
    free = (*OWN, "f_0")
    check_options(FitOptions("plain", free=free, start=GivenStart({"f_0": 5.0})), PURDY_DAMPER)
