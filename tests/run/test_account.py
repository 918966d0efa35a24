"""What a run tells of itself: warnings, failures, gates, procedure, how it ended; as JSON."""

import json
import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from damperfit.configuration.loading import load_configuration
from damperfit.damper.model import values_type
from damperfit.damper.valve_dampers import Monotube
from damperfit.errors import ConfigurationError
from damperfit.identification import Outcome, Status
from damperfit.problem import Failure, Problem, warning
from damperfit.reporting.records import gaps_in
from damperfit.run.identify import identified
from damperfit.run.logs import Ending, Log, LogBatch
from damperfit.run.record import (
    MANY,
    FailureLog,
    Judgement,
    ending_of,
    failures_of,
    gates_not_met,
    run_of,
    unconfirmed_tares,
    warnings_of,
    with_choice,
)
from damperfit.tables.files import json_pieces, json_values
from damperfit.tested.setting import Setting, parse_setting
from damperfit.uncertainty import Assessment, Interval, Objection, Uncertainty
from damperfit.uncertainty.covariance import make_interval
from tests.fakes import campaign, fit

PLAIN = load_configuration()
EMPTY = LogBatch()
TARE = warning("tare", "the force has an offset of 120 N")
FAILED = Failure(Problem("log", "broken", subject="a.csv"), "LogError", "a.csv", "a.csv", 1)
LEFT_OUT = Failure(Problem("strict", "clipped"), "QualityError", "b.csv", "b.csv", 2)
SETTING = Failure(Problem("simulation", "rigid"), "SimulationError", setting=3)


def warned(done, batch=EMPTY, judgement=None):
    return [str(one) for one in warnings_of(PLAIN, batch, done, judgement or Judgement())]


# Warnings


def test_what_contradicts_across_settings_and_what_is_doubted_reach_the_record() -> None:
    """Frictions of one damper that are not one; an empty chamber in a model that misses."""
    fits, known = [], []
    for n, friction in ((1, 20.0), (2, 80.0)):
        one = fit(n, outcome=Outcome.CAVITATING, status={"f_f": "fitted"})
        fits.append(replace(one, parameters=one.parameters.replace({"f_f": friction})))
        intervals = {"f_f": make_interval(friction, 0.01)}
        known.append(Uncertainty(n, intervals, ("f_f",), np.array([[1e-4]])))
    doubt = {2: (Objection("cavitation", "", "chamber 2 cavitates"),)}
    judged = Judgement(Assessment(uncertainties=tuple(known), objections=doubt))
    told = "\n".join(warned(campaign(*fits), judgement=judged))
    assert "f_f is 20 N at setting 1 and 80 N at setting 2" in told
    assert "model purdy does not describe setting 2" in told


def tared(severity="warning", *, status="fixed", model=None):
    one = fit(1, status={"f_0": status})
    (log,) = one.logs
    found = replace(log.trace, findings=(replace(TARE, severity=severity),))
    return replace(one, logs=(log._replace(trace=found),), **(model or {}))


_FRICTION = [one for one in fit(1).parameters.quantities if one.name == "f_f"]
_BARE = {"parameters": values_type(tuple(_FRICTION))(50.0), "status": {"f_f": Status.FITTED}}


@pytest.mark.parametrize(
    ("one", "is_structured", "noise", "is_said"),
    [
        (tared(), False, 0.1, True),
        (tared(model=_BARE), False, 0.1, True),  # a model without an offset
        (tared(), True, 0.1, False),
        (tared(), False, math.nan, False),
        (tared("note"), False, 0.1, False),
        (tared(status="fitted"), False, 0.1, False),
    ],
)
def test_a_tare_is_unconfirmed_where_the_fit_meets_the_force_to_its_noise(
    one, is_structured, noise, is_said
) -> None:
    seen = SimpleNamespace(setting=1, is_structured=is_structured, noise_percent=noise)
    said = [*unconfirmed_tares(campaign(one), SimpleNamespace(diagnoses=(seen,)))]
    begin = "setting 1: the warning tare is not confirmed"
    assert [str(each).startswith(begin) for each in said] == [True] * is_said


@pytest.mark.parametrize("n", [MANY, MANY + 1])
def test_what_many_settings_or_files_have_in_common_is_one_line(n) -> None:
    every = range(1, n + 1)
    fits = [replace(fit(k), warnings=(warning("trials", f"{k} trials failed."),)) for k in every]
    limited = load_configuration(overlay={"output": {"max_mse_percent": 0.001}})
    expected = load_configuration(overlay={"rig": {"settings": list(every)}})
    unsound = (fit(k, outcome=Outcome.EVALUATION_LIMIT) for k in every)
    skipped = replace(EMPTY, skipped=tuple(f"truth_{k}.csv" for k in range(n)))
    kinds = {
        "setting 1: 1 trials failed.": warned(campaign(*fits)),
        "setting 1: MSE 0.0123 % is above": gates_not_met(limited, EMPTY, campaign(*fits)),
        "setting 1: the fit did not": gates_not_met(PLAIN, EMPTY, campaign(*unsound)),
        "setting": (one.placed.sentence() for one in failures_of(expected, EMPTY, campaign())),
        "truth_0.csv": skipped.skipped_files,
    }
    for begin, lines in kinds.items():
        said = [str(one) for one in lines]
        assert len(said) == (n if n == MANY else 1)
        assert said[0].startswith(begin)
        if n > MANY and begin.startswith("setting 1"):
            assert said[0].endswith(f"(with other numbers at 2-{n})")


def test_intervals_hold_the_numbers_of_a_layout_that_is_alike() -> None:
    damper = Monotube(rod_diameter=0.012, piston_diameter=0.03)
    names = ("rebound_opening", "compression_opening", "compression_slope", "k_s")
    own = dict.fromkeys(names, Interval(1.0, 98.0, 102.0))

    def reaching(*layouts: str) -> dict[str, tuple[float, float]]:
        known = Assessment((Uncertainty(Setting.of(1), own, (), np.zeros((0, 0))),))
        (found,) = with_choice(known, damper, {"layouts_alike": layouts}).uncertainties
        return {name: (one.low, one.high) for name, one in found.intervals.items()}

    found = reaching("through_flow")
    area = damper.annulus_area / damper.piston_area  # 0.84
    assert found["compression_opening"] == pytest.approx((98.0 * area / 1.06, 102.0))
    assert found["compression_slope"] == pytest.approx((98.0 * area**2 / 1.06, 102.0))
    assert found["rebound_opening"] == pytest.approx((98.0 / 1.06, 102.0 * 1.06))  # one annulus
    assert found["k_s"] == (98.0, 102.0)
    assert reaching() == dict.fromkeys(names, (98.0, 102.0))
    low, high = reaching("through_flow", "twin_tube")["compression_opening"]
    assert low == found["compression_opening"][0]
    assert high == pytest.approx(102.0 * 1.06 * damper.annulus_area / damper.rod_area)


def test_adjusters_that_the_model_does_not_have_are_refused_before_a_log_is_read(tmp_path) -> None:
    path = tmp_path / "rig.toml"
    path.write_text('[adjusters]\nlow_speed = ["rebound.bleed"]\n', encoding="utf-8")
    # Only a joint fit uses them.
    for procedure, says in (("joint", r"rebound\.bleed: the model purdy has no"), ("paper", "now")):
        settings = load_configuration(path, overlay={"identification": {"procedure": procedure}})
        with pytest.raises(ConfigurationError, match=says):
            next(identified(settings, ["nowhere.csv"]))


# Gates and endings


@pytest.mark.parametrize(
    ("one", "limit", "said"),
    [
        (fit(3, mse=1.0), 1.0, None),
        (fit(3, mse=1.01), 1.0, "MSE 1.01 % is above 1 %"),
        (fit(3, mse=float("nan")), 1.0, "MSE nan % is above 1 %"),
        (fit(3, mse=1.01), 0.0, None),  # nobody asked
        *(
            (fit(3, outcome=one), 0.0, f"the fit did not converge ({one.value})")
            for one in (Outcome.EVALUATION_LIMIT, Outcome.NO_DESCENT, Outcome.NOT_FINITE)
        ),
        *((fit(3, outcome=one), 0.0, None) for one in (Outcome.CAVITATING, Outcome.AT_BOUND)),
    ],
)
def test_gates_of_the_mse_and_of_a_minimum(one, limit, said) -> None:
    asked = replace(PLAIN, output=PLAIN.output.but(max_mse_percent=limit))
    told = [str(missed) for missed in gates_not_met(asked, EMPTY, campaign(fit(1), one))]
    assert told == ([] if said is None else [f"setting 3: {said}"])


@pytest.mark.parametrize(
    ("fits", "failures", "gates", "stopped", "ending", "code"),
    [
        (2, (), (), False, "COMPLETE", 0),
        (2, (), ("gate",), False, "GATE_MISSED", 4),
        (2, (FAILED,), (), False, "SOME_FAILED", 1),
        (2, (SETTING,), (), False, "SOME_FAILED", 1),
        (2, (FAILED,), ("gate",), False, "SOME_FAILED", 1),
        (2, (FAILED,), ("gate",), True, "INTERRUPTED", 130),
        (2, (LEFT_OUT,), ("strict",), False, "GATE_MISSED", 4),
        (2, (LEFT_OUT, FAILED), ("strict",), False, "SOME_FAILED", 1),
        (0, (FAILED,), (), False, "ALL_FAILED", 3),
        (0, (LEFT_OUT,), ("strict",), False, "GATE_MISSED", 4),
        (0, (LEFT_OUT, FAILED), ("strict",), False, "ALL_FAILED", 3),
        (0, (), (), False, "ALL_FAILED", 3),
        (0, (), (), True, "INTERRUPTED", 130),
    ],
)
def test_a_failure_counts_before_a_gate_and_an_interruption_before_both(
    fits, failures, gates, stopped, ending, code
) -> None:
    found = ending_of(fits, failures, gates, is_interrupted=stopped)
    assert (found.name, found.value) == (ending, code)
    if not gates and not stopped and failures != (SETTING,):  # reading alone ends alike
        good = [Log(f"{k}.csv") for k in range(fits)]
        alone = LogBatch(good, failures=list(failures)).ending
        assert alone is (found if fits or failures else Ending.COMPLETE)


# The record


def test_a_gap_of_900_000_settings_is_one_range_everywhere() -> None:
    found = campaign(*(fit(k) for k in (1, 2, 3, 4, 6)), replace(fit(20), setting=900_000))
    told = (PLAIN, EMPTY, found, Judgement(), FailureLog(EMPTY))
    run, _ = run_of(*told, characteristics=[], is_interrupted=False)
    assert run.record["gaps"] == [{"first": 5, "last": 5}, {"first": 7, "last": 899_999}]
    assert len(json.dumps(run.record)) < 100_000
    assert len(run.parameters) == 6
    assert gaps_in({"gaps": [{"first": 6, "last": 899_999}]}) == ((6, 899_999),)
    assert gaps_in({"gaps": [4, 7]}) == ((4, 4), (7, 7))  # an earlier version
    assert gaps_in({"gaps": [{"first": 7, "last": 6}, {"first": 1}, "x", None, True]}) == ()


def test_a_document_is_laid_out_a_line_an_entry_and_reads_back() -> None:
    document = {
        "empty": {},
        "none": [],
        "one": [{}],
        "mixed": [1, {"c": {"d": [{}]}}],
        "deep": {"inside": {"rows": [{"a": [1.5, None]}, {"b": '\u00e9, "quoted"\n'}]}},
        "numbers": [1, 2.5e-300, True],
    }
    text = "".join(json_pieces(document))
    assert json.loads(text) == document
    lines = [line.strip().rstrip(",") for line in text.splitlines()]
    assert {'{"a": [1.5, null]}', '"numbers": [1, 2.5e-300, true]'} <= {*lines}
    with pytest.raises(ValueError, match="JSON"):
        list(json_pieces({"not": [{"a": "number", "b": float("nan")}]}))
    two = parse_setting("R12 C8", ["rebound", "compression"])
    told = json_values({"a": [1.5, float("nan"), (float("inf"), Setting.of(2))], 3: two})
    assert told == {"a": [1.5, None, [None, 2]], "3": "R12 C8"}
