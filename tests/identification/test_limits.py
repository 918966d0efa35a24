"""Limits of what a fit is said to tell: a case just inside, a case just outside."""

from __future__ import annotations

import sys
from types import SimpleNamespace

import numpy as np
import pytest

from damperfit.damper.purdy import starting
from damperfit.damper.purdy.parameters import PURDY_DAMPER, Parameters
from damperfit.errors import SimulationError
from damperfit.identification import FitOptions, Status, blas_threads, descent, setting
from damperfit.identification.descent import Misfit
from damperfit.identification.failures import SettingFailure
from damperfit.identification.joint_procedure import _common
from damperfit.identification.multistart import _is_level
from damperfit.identification.paper import first_pass
from damperfit.identification.paper.first_pass import (
    _Begun,
    _is_contradicted,
    _other_lowest,
    _tells_r_m3,
)
from damperfit.identification.plausible import points_inside
from damperfit.identification.procedure_input import ProcedureInput
from damperfit.identification.step_solvers import _inverted
from damperfit.simulation import SolverOptions
from damperfit.tested.setting import Setting
from tests import fakes
from tests.identification.rig import trace


def judged(status: str = "fitted", *, k_e: str = "fitted", error: float = 0.01) -> SimpleNamespace:
    parameters = fakes.fit(1).parameters
    solution = SimpleNamespace(parameters=parameters, mse_percent=0.01, n_independent=100.0)
    return SimpleNamespace(
        status={"r_m3": Status(status), "k_e": Status(k_e)}, errors={"r_m3": error},
        solution=solution,
    )  # fmt: skip


@pytest.mark.parametrize(
    ("lowest", "used", "words"),
    [
        (0, 0, None),
        (1, 1, None),
        (2, 2, None),  # a damper may have no setting 1
        (1, 3, "setting 1 could not be fitted with all parameters free: R_m3 is taken from"),
    ],
)
def test_where_r_m3_comes_from_is_said_where_it_is_not_the_lowest_setting(
    lowest, used, words
) -> None:
    said = list(_other_lowest(lowest, used))
    assert len(said) == (words is not None)
    assert all(text.startswith(words) for text in said)


@pytest.mark.parametrize(
    ("status", "k_e", "error", "is_reported"),
    [
        ("fitted", "fitted", 0.99, True),
        ("fitted", "fitted", 1.01, False),
        ("fitted", "at_bound", 0.01, True),
        ("at_bound", "fitted", 0.01, False),
        ("not_identifiable", "fitted", 0.01, False),
    ],
)
def test_r_m3_is_told_by_its_own_status_and_error(status, k_e, error, is_reported) -> None:
    limit = first_pass.NOT_FIT_TO_SHARE
    one = judged(status, k_e=k_e, error=error * limit)
    assert _tells_r_m3(one) is is_reported


@pytest.mark.parametrize(("rise", "is_contradicted"), [(0.0383, False), (0.0386, True)])
def test_a_value_is_contradicted_where_chance_has_its_rise_once_in_twenty(
    monkeypatch, rise, is_contradicted
) -> None:
    """With 100 independent samples noise makes a rise of 3.84 % of the misfit."""
    other = SimpleNamespace(mse_percent=0.01 * (1.0 + rise))
    monkeypatch.setattr(first_pass, "descend", lambda *_: other)
    misfit = Misfit((), PURDY_DAMPER, ("r_m1", "r_m3"), SolverOptions(), 1, lambda: False)
    assert _is_contradicted(misfit, judged(), 2.6e6, None) is is_contradicted


def test_a_value_that_cannot_be_simulated_is_contradicted(monkeypatch) -> None:
    def fails(*_: object) -> None:
        raise SimulationError("no")

    monkeypatch.setattr(first_pass, "descend", fails)
    misfit = Misfit((), PURDY_DAMPER, ("r_m1", "r_m3"), SolverOptions(), 1, lambda: False)
    assert _is_contradicted(misfit, judged(), 2.6e6, None) is True


@pytest.mark.parametrize(("broken", "lowest"), [(2, 5), (5, 2), (9, 2)])
def test_the_next_lowest_takes_the_place_of_one_that_meets_a_bug(broken, lowest) -> None:
    begun = _Begun(2, dict.fromkeys((2, 5, 9), judged()), {})
    failure = SettingFailure(broken, "InternalError", "a bug")
    left = begun.without(failure)
    assert left.lowest == lowest
    assert sorted(left.judged) == [s for s in (2, 5, 9) if s != broken]
    assert left.broken == {broken: failure}


@pytest.mark.parametrize(
    ("name", "status", "expected"),
    [
        ("f_f", {"f_f": "not_identifiable"}, 50.0),
        ("r_m3", {"f_f": "not_identifiable"}, 2.597e6),
        ("r_m3", {"r_m3": "not_identifiable"}, 7e5),
    ],
)
def test_only_an_r_m3_that_is_not_told_starts_from_the_fallback(name, status, expected) -> None:
    task = SimpleNamespace(options=FitOptions(fallbacks={"r_m3": 7e5}), damper=PURDY_DAMPER)
    fits = [fakes.fit(1), fakes.fit(2, status=status)]
    assert _common(name, task, fits) == pytest.approx(expected)


@pytest.mark.parametrize(
    ("at", "slope", "is_inward"),
    [("low", -1.0, True), ("low", 1.0, False), ("high", 1.0, True), ("high", -1.0, False),
     ("inside", 1.0, False), ("inside", -1.0, False)],
)  # fmt: skip
def test_a_misfit_falls_into_a_range_from_its_edges_alone(at, slope, is_inward) -> None:
    low, high = PURDY_DAMPER.quantity("k_e").plausible
    value = {"low": low, "high": high, "inside": 5e8}[at]
    parameters = Parameters(1e4, 1e6, 1e6, value, 50.0)
    assert points_inside(parameters, "k_e", slope) is is_inward


def test_a_bulk_modulus_that_is_held_is_not_looked_for() -> None:
    misfit = Misfit((trace(6),), PURDY_DAMPER, ("k_e",), SolverOptions(tolerance=1e-2), 1, bool)
    given = ProcedureInput(
        {Setting.of(6): misfit.traces}, PURDY_DAMPER, FitOptions(), 1, print, bool
    )
    assert given.start(Setting.of(6), misfit, {"k_e": 3e8}).k_e == 3e8
    assert given.start(Setting.of(6), misfit, {}).k_e == pytest.approx(5.6e8, rel=0.5)


@pytest.mark.parametrize(
    ("free", "stages"),
    [
        (("r_m1", "r_m3", "f_f"), [("r_m1",)]),
        (("r_m1", "r_m3", "f_f", "f_0"), [("r_m1",), ("r_m1", "r_m3", "f_f")]),
    ],
)
def test_beyond_the_onset_an_offset_waits_longest(monkeypatch, free, stages) -> None:
    seen = []

    def approach(misfit: Misfit, start: object) -> SimpleNamespace:
        seen.append(misfit.free)
        return SimpleNamespace(parameters=start, evaluations=1)

    def attempt(*_: object) -> None:
        raise SimulationError("far enough")

    monkeypatch.setattr(setting, "approach", approach)
    monkeypatch.setattr(setting, "attempt", attempt)
    misfit = Misfit((), PURDY_DAMPER, free, SolverOptions(), 1, lambda: False)
    best = judged()
    monkeypatch.setattr(starting, "cavitation_limit", lambda *_: 1e6)
    start = fakes.fit(1).parameters
    _, beyond, farther = PURDY_DAMPER.detours(start, (), free)
    assert (beyond.start.r_m3, farther.start.r_m3) == (1.9e6, 6e6)
    assert beyond.is_last_resort
    assert setting._over(beyond, misfit, best) is best
    assert seen == stages
    assert PURDY_DAMPER.detours(start, (), ("r_m1", "f_0")) == ()


def test_columns_are_inverted_whatever_their_lengths() -> None:
    triangles = np.array([[[2e6, 1.0], [0.0, 4e-6]], [[3.0, 0.5], [0.0, 5.0]]])
    lengths = np.linalg.norm(triangles, axis=1)
    inverse, is_whole = _inverted(triangles, lengths)
    assert is_whole
    assert inverse[1] @ triangles[1] == pytest.approx(np.eye(2), abs=1e-12)
    triangles[1, :, 1] = 0.0  # nothing is seen of the second
    inverse, is_whole = _inverted(triangles, np.linalg.norm(triangles, axis=1))
    assert not is_whole
    assert np.isfinite(inverse).all()
    assert inverse[1] == pytest.approx(np.array([[1.0 / 3.0, 0.0], [0.0, 0.0]]))


def test_a_library_loaded_behind_one_that_is_lowered_is_lowered_too(monkeypatch) -> None:
    class Library:
        def __init__(self, name: str, threads: int) -> None:
            self.filepath, self.threads = name, threads

        def get_num_threads(self) -> int:
            return self.threads

        def set_num_threads(self, threads: int) -> None:
            self.threads = threads

    first, second = Library("first", 4), Library("second", 6)
    loaded = [first]

    class Controller:
        def select(self, **_: str) -> SimpleNamespace:
            return SimpleNamespace(lib_controllers=list(loaded))

    monkeypatch.setattr("threadpoolctl.ThreadpoolController", Controller)
    monkeypatch.setattr(blas_threads, "_found", {})
    with blas_threads.one_blas_thread():
        loaded.append(second)
        monkeypatch.setitem(sys.modules, "what_loaded_it", sys)
        with blas_threads.one_blas_thread():
            assert (first.threads, second.threads) == (1, 1)
    assert (first.threads, second.threads) == (4, 6)


def test_an_edge_beyond_which_the_others_cannot_go_on_ends_a_fit(monkeypatch) -> None:
    """What was found stands; the same descent is not tried twice."""
    at = fakes.fit(1).parameters
    first = SimpleNamespace(
        solution=SimpleNamespace(status=1, parameters=at), moving=("r_m1", "k_e")
    )
    tried: list[tuple[str, ...]] = []

    def descended(misfit: Misfit, moving: tuple[str, ...], *_: object) -> SimpleNamespace:
        tried.append(moving)
        if len(tried) == 1:
            return first
        assert len(tried) == 2, "the descent that failed is tried again"
        raise SimulationError("no")

    monkeypatch.setattr(descent, "_descended", descended)
    monkeypatch.setattr(
        descent, "stopped_at", lambda _: ("k_e", PURDY_DAMPER.quantity("k_e").plausible[1])
    )
    misfit = Misfit((), PURDY_DAMPER, ("r_m1", "k_e"), SolverOptions(), 1, lambda: False)
    assert descent._minimise(misfit, at) is first.solution
    assert tried == [("r_m1", "k_e"), ("r_m1",)]


@pytest.mark.parametrize(("rise", "is_level"), [(0.0383, True), (0.0386, False)])
def test_two_minima_are_level_where_noise_alone_may_part_them(rise, is_level) -> None:
    other = SimpleNamespace(solution=SimpleNamespace(mse_percent=0.01 * (1.0 + rise)))
    assert _is_level(judged(), other) is is_level
