"""What a run warns of and how it says what was done, word by word."""

from __future__ import annotations

import hashlib
import time
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from damperfit.configuration.loading import load_configuration
from damperfit.damper.model import values_type
from damperfit.identification import Outcome, Sharing, Status
from damperfit.io.files import sha256_of
from damperfit.io.tests_table import TestRow, TestsTable
from damperfit.recording import Finding, Recording, natural_order
from damperfit.run import hold_out, labelling
from damperfit.run.dampers import _nameless
from damperfit.run.identify import _Clock as Clock
from damperfit.run.labelling import Labels
from damperfit.run.logs import LogBatch, LogFacts, _distinct_names
from damperfit.run.mishaps import Mishaps
from damperfit.run.remarks import corrections, gates_not_met, missing_logs, run_warnings
from damperfit.run.run_json import Judgement, _procedure, report_facts
from damperfit.run.trust import _profile, unconfirmed_tares
from damperfit.tables.documents import json_values
from damperfit.tested.identity import Identity
from damperfit.tested.setting import Setting
from damperfit.uncertainty import Assessment, Objection, Uncertainty
from damperfit.uncertainty.intervals import make_interval
from tests.fakes import campaign, failed, fit, trace

PLAIN = load_configuration()
EMPTY = LogBatch((), (), (), (), 0)


def with_findings(setting, *findings):
    one = fit(setting)
    log = one.logs[0]
    return replace(one, logs=(replace(log, trace=replace(log.trace, findings=findings)),))


CLIPPED = Finding("force_clipping", "warning", "the force is clipped")
TURNED = Finding("direction", "note", "force reversed", is_correction=True)


def test_a_warning_of_many_logs_is_one_line_with_the_first_one_s_numbers() -> None:
    note = Finding("skew", "note", "not late")
    one = [with_findings(1, note, CLIPPED)]
    assert list(map(str, run_warnings(EMPTY, campaign(*one)))) == [
        "setting_01.csv: the force is clipped"
    ]
    two = [*one, with_findings(2, CLIPPED)]
    assert list(map(str, run_warnings(EMPTY, campaign(*two)))) == [
        "setting_01.csv and 1 other log: the force is clipped"
    ]
    three = [*two, with_findings(3, CLIPPED, TURNED)]
    assert list(map(str, run_warnings(EMPTY, campaign(*three)))) == [
        "setting_01.csv and 2 other logs: the force is clipped"
    ]
    assert list(map(str, corrections(campaign(*three)))) == ["setting_03.csv: force reversed"]


def test_what_was_skipped_and_what_the_fits_say_is_told() -> None:
    batch = replace(EMPTY, skipped=("truth.csv",))
    done = campaign(replace(fit(4), warnings=("trial points failed",)), warnings=("rough",))
    assert list(map(str, run_warnings(batch, done))) == [
        "truth.csv: written by damperfit, not a log; skipped",
        "rough",
        "setting 4: trial points failed",
    ]


@pytest.mark.parametrize(
    ("high", "certain", "jointly", "said"),
    [
        (73.0, True, (), ""),  # 20 % of the sum: 50 and 75
        (77.0, True, (), "friction goes from 50 to 77 N over the settings"),
        (77.0, True, (), "does not hold; free it (--free r_m1,r_m2,k_e,f_f)"),
        (77.0, True, ("r_m3", "f_f"), "does not hold; free it (--share r_m3)"),
        (77.0, False, (), ""),
    ],
)
def test_friction_varies_from_a_fifth_of_its_middle_on(high, certain, jointly, said) -> None:
    sharing = Sharing(jointly=jointly, spread=(50.0, high), is_spread_certain=certain)
    done = campaign(fit(1), sharing=sharing)
    told = list(map(str, run_warnings(EMPTY, done)))
    assert len(told) == bool(said)
    assert said in "".join(told)
    (line,) = (one for one in _procedure(PLAIN, done) if one.startswith("f_f"))
    word = "it varies" if said else "it hardly varies"
    assert line.endswith(f"; {word}: fitted individually, the settings have 50 to {high:.3g} N.")


def test_the_procedure_is_told_with_every_value_that_holds_for_all() -> None:
    done = campaign(fit(1, status={"r_m3": "fixed"}), with_findings(2, TURNED))
    assert list(_procedure(PLAIN, done)) == [
        (
            "Damper: rod 19 mm, piston 28.5 mm, gas piston 40 mm, chambers 133 and 133 mm, gas "
            "50 mm at 4.6 bar absolute, exponent 1.4, oil 770 kg/m3 (the paper's: [damper] is not "
            "declared, and resistances, K_e and pressures are right only for these dimensions)."
        ),
        "Filter: no filter",
        "Procedure: paper.",
        "Corrected: setting_02.csv: force reversed.",
        "r_m3 = 2.5970e6 N s/(m2 kg) is fixed.",
        "f_f = 50.000 N is shared by all settings, found from the logs.",
    ]
    assert len(list(_procedure(PLAIN, campaign()))) == 1
    offset = list(_procedure(PLAIN, campaign(fit(1, f_0=-12.5))))[-1]
    assert offset == "f_0 = -12.500 N is fixed."


def test_what_is_left_out_of_free_is_not_told_as_given_nor_as_one_value() -> None:
    """Each setting has its own, from the first pass; the report said "k_e = 502.42e6 is fixed"."""
    asked = replace(
        PLAIN, identification=replace(PLAIN.identification, free=("r_m1",), fixed={"r_m2": 2.2e6})
    )
    done = campaign(fit(1, status={"r_m2": "fixed", "k_e": "fixed"}))
    told = list(_procedure(asked, done))
    assert "r_m2 = 2.2000e6 N s/(m2 kg) is fixed." in told
    (line,) = (one for one in told if one.startswith("k_e"))
    assert line.startswith("k_e of each setting is held at what a first fit of its logs gave")
    assert not [one for one in _procedure(PLAIN, done) if "first fit" in one]


def test_advice_is_given_for_every_ending_but_a_good_one() -> None:
    ends = (Outcome.CONVERGED, Outcome.CAVITATING, Outcome.NO_DESCENT)
    done = campaign(*(fit(n, outcome=one) for n, one in enumerate(ends, start=1)))
    facts = report_facts(PLAIN, EMPTY, done, Judgement(), is_interrupted=False)
    assert facts.advice == tuple(sorted((one.value, one.advice) for one in ends[1:]))
    assert not facts.is_interrupted


def test_what_contradicts_across_settings_and_what_is_doubted_reach_the_report() -> None:
    """Frictions of one damper that are not one; an empty chamber in a model that misses."""
    fits, known = [], []
    for n, friction in ((1, 20.0), (2, 80.0)):
        one = fit(n, outcome=Outcome.CAVITATING, status={"f_f": "fitted"})
        fits.append(replace(one, parameters=one.parameters.replace({"f_f": friction})))
        intervals = {"f_f": make_interval(friction, 0.01)}
        known.append(Uncertainty(n, intervals, ("f_f",), np.array([[1e-4]])))
    doubt = {2: (Objection("cavitation", "", "chamber 2 cavitates"),)}
    judged = Judgement(Assessment(uncertainties=tuple(known), objections=doubt))
    facts = report_facts(PLAIN, EMPTY, campaign(*fits), judged, is_interrupted=False)
    assert any(
        "f_f is 20 N at setting 1 and 80 N at setting 2" in str(one) for one in facts.warnings
    )
    assert ["may be full" in one for one in facts.cavitation] == [False, True]


def test_settings_that_are_expected_and_missing_are_failures_of_their_own() -> None:
    wanted = replace(PLAIN, rig=replace(PLAIN.rig, settings=(1, 2, 5)))
    batch = replace(EMPTY, logs=(LogFacts("a.csv", "a.csv", "", {"setting": 2}),))
    assert [one.setting for one in missing_logs(wanted, batch)] == [1, 5]
    (one, _) = missing_logs(wanted, batch)
    assert one == failed(
        "",
        "",
        1,
        "MissingLogError",
        "setting 1: no log, but the configuration expects one in rig.settings",
        "missing-log",
    )


def test_json_has_no_number_that_is_none() -> None:
    told = json_values({"a": [1.5, float("nan"), (float("inf"), 2)], 3: True, "b": "x"})
    assert told == {"a": [1.5, None, [None, 2]], "3": True, "b": "x"}


def test_equal_names_are_told_apart_by_their_folders_and_others_stay_short() -> None:
    assert _distinct_names([Path("x/a.csv"), Path("y/b.csv")]) == ["a.csv", "b.csv"]
    names = _distinct_names([Path("x/a.csv"), Path("y/a.csv"), Path("y/b.csv")])
    assert names == ["x/a.csv", "y/a.csv", "b.csv"]


def test_numbers_in_names_are_sorted_as_numbers() -> None:
    names = ["run_10.csv", "run_9.csv", "run_b.csv", "Run_1.csv", "run_9b.csv"]
    assert sorted(names, key=natural_order) == [
        "Run_1.csv", "run_9.csv", "run_9b.csv", "run_10.csv", "run_b.csv",
    ]  # fmt: skip


def test_a_file_is_known_by_its_hash(tmp_path) -> None:
    (tmp_path / "a").write_bytes(b"abc")
    assert sha256_of(tmp_path / "a") == hashlib.sha256(b"abc").hexdigest()


def test_the_time_of_a_part_is_summed_to_tenths_of_milliseconds(monkeypatch) -> None:
    ticks = iter([10.0, 10.00044, 20.0, 21.0, 30.0, 30.00016])
    monkeypatch.setattr(time, "perf_counter", lambda: next(ticks))
    clock = Clock()
    for name in ("read_s", "fit_s", "read_s"):
        with clock.lap(name):
            pass
    assert clock.laps == {"read_s": 0.0006, "fit_s": 1.0}


@pytest.mark.parametrize(
    ("n", "others"), [(1, ""), (2, " and 1 other log"), (3, " and 2 other logs")]
)
def test_logs_that_strict_quality_left_out_are_counted(n, others) -> None:
    refused = [failed(f"{k}.csv", "", k, "QualityError", "spikes") for k in range(n)]
    other = failed("x.csv", "", 9, "LogError", "empty file")
    batch = replace(EMPTY, failures=(other, *refused))
    said = [f"strict quality: 0.csv{others} left out for warnings"]
    assert list(map(str, gates_not_met(PLAIN, batch, campaign(fit(1))))) == said
    assert (
        list(map(str, gates_not_met(PLAIN, replace(batch, failures=(other,)), campaign(fit(1)))))
        == []
    )


def test_mishaps_are_told_by_setting_and_those_of_the_whole_run_last() -> None:
    mishaps = Mishaps(EMPTY)
    mishaps.spared("comparing", lambda: 1 / 0, None)
    for setting in (12, 3, 7):
        mishaps.at_setting("judging")(setting, ValueError("x"))
    mishaps.at_setting("profiling")(3, ValueError("x"))
    told = [(one.setting, one.message.split(":")[0]) for one in mishaps.failures]
    assert [setting for setting, _ in told] == [3, 3, 7, 12, None]
    assert told[0] < told[1]


TARE = Finding("tare", "warning", "the force has an offset of 120 N")


@pytest.mark.parametrize(
    ("is_structured", "noise", "is_said"), [(False, 0.1, True), (True, 0.1, False)]
)
def test_a_tare_is_unconfirmed_where_the_fit_meets_the_force_to_its_noise(
    is_structured, noise, is_said
) -> None:
    one = with_findings(1, TARE)
    found = SimpleNamespace(setting=1, is_structured=is_structured, noise_percent=noise)
    said = list(unconfirmed_tares(campaign(one), SimpleNamespace(diagnoses=(found,))))
    expected = (
        "setting 1: the warning tare is not confirmed: the fit matches the force to within its "
        "noise without an offset"
    )
    assert said == [expected] * is_said


def test_a_tare_is_not_doubted_without_noise_warning_or_a_fixed_offset() -> None:
    sound = SimpleNamespace(setting=1, is_structured=False, noise_percent=0.1)
    unknown = SimpleNamespace(setting=1, is_structured=False, noise_percent=float("nan"))
    warned = with_findings(1, TARE)
    noted = with_findings(1, replace(TARE, severity="note"))
    free = replace(warned, status={**warned.status, "f_0": Status.FITTED})
    for one, diagnoses in (
        (warned, (unknown,)),
        (warned, ()),
        (noted, (sound,)),
        (with_findings(1, CLIPPED), (sound,)),
        (free, (sound,)),
    ):
        assert not list(unconfirmed_tares(campaign(one), SimpleNamespace(diagnoses=diagnoses)))
    both = campaign(warned, with_findings(2, TARE))
    (said,) = unconfirmed_tares(
        both,
        SimpleNamespace(
            diagnoses=(sound, SimpleNamespace(setting=2, is_structured=False, noise_percent=0.1))
        ),
    )
    assert said.startswith("settings 1, 2: ")


@pytest.mark.parametrize("is_partial", [False, True])
def test_a_profile_stands_beside_the_interval_of_errors_unless_others_were_held(is_partial) -> None:
    profile = SimpleNamespace(
        setting=3, name="k_e", shape="closed", low=1.0, high=4.0, points=(0, 0), evaluations=9,
        is_shared=False, is_partial=is_partial,
    )  # fmt: skip
    others = SimpleNamespace(setting=2, intervals={"k_e": SimpleNamespace(low=7.0, high=8.0)})
    own = SimpleNamespace(setting=3, intervals={"k_e": SimpleNamespace(low=1.5, high=3.5)})
    told = _profile(profile, SimpleNamespace(uncertainties=(others, own)))
    sandwich = (None, None) if is_partial else (1.5, 3.5)
    assert (told["sandwich_ci_low"], told["sandwich_ci_high"]) == sandwich
    assert (told["ci_low"], told["ci_high"], told["points"]) == (1.0, 4.0, 2)


def test_a_log_whose_cycles_cannot_be_parted_hides_none_behind_it(monkeypatch) -> None:
    def split(one, _):
        if one.setting == 1:
            raise ValueError("x")
        return one, replace(one, name=f"last of {one.name}")

    monkeypatch.setattr(hold_out, "split_cycles", split)
    traces = tuple(trace(setting) for setting in (1, 2, 3))
    options = replace(PLAIN.hold_out, patterns=(), cycles=1)
    parted = hold_out.part(replace(EMPTY, traces=traces), options, {})
    assert [one.setting for one in parted.batch.traces] == [2, 3]
    assert [one.setting for one in parted.held_out] == [2, 3]
    assert [one.setting for one in parted.batch.failures] == [1]


def test_transients_that_nobody_asked_for_are_of_logs_that_are_fitted_and_no_failure(
    monkeypatch,
) -> None:
    monkeypatch.setattr(hold_out, "transients", lambda one: replace(one, start_time=9.0))
    left = hold_out.Parted(replace(EMPTY, traces=(trace(1), trace(2))))
    parted = hold_out.with_transients(left, PLAIN.hold_out)
    assert [one.setting for one in parted.held_out] == [1, 2]
    assert not parted.is_asked
    cycles = replace(PLAIN.hold_out, patterns=(), cycles=1)
    assert hold_out.with_transients(left, cycles) is left
    # Setting 1 has no fit: that is said elsewhere. Setting 2 cannot be simulated beside its cycles.
    batch = hold_out.note_unpredicted(parted, campaign(fit(2)), ())
    assert batch.failures == ()
    (said,) = batch.remarks
    assert "beside its steady cycles cannot be simulated" in said
    asked = hold_out.with_transients(left, replace(PLAIN.hold_out, patterns=("transients",)))
    assert len(hold_out.note_unpredicted(asked, campaign(fit(2)), ()).failures) == 2


def test_a_tare_is_judged_of_a_model_without_an_offset_too() -> None:
    warned = with_findings(1, TARE)
    (friction,) = (one for one in warned.parameters.quantities if one.name == "f_f")
    bare = replace(warned, parameters=values_type((friction,))(50.0), status={"f_f": Status.FITTED})
    sound = SimpleNamespace(setting=1, is_structured=False, noise_percent=0.1)
    (said,) = unconfirmed_tares(campaign(bare), SimpleNamespace(diagnoses=(sound,)))
    assert said.startswith("setting 1: the warning tare is not confirmed")


def test_failures_of_logs_without_a_serial_number_are_told_apart() -> None:
    failures = [SimpleNamespace(log=name) for name in ("a.csv", "b.csv")]
    batch = SimpleNamespace(failures=failures)
    assert [one.log for one in _nameless(batch, ["b.csv"])] == ["b.csv"]


@pytest.mark.parametrize(
    ("has_pattern", "adjusters", "says"),
    [
        (False, ("adjuster",), True),
        (True, ("adjuster",), False),
        (False, ("rebound", "bump"), False),
    ],
)
def test_a_number_of_several_is_named_where_it_was_guessed(
    has_pattern, adjusters, says, monkeypatch
) -> None:
    monkeypatch.setattr(labelling, "one_of_several", lambda _: "3 of 3 and 4")
    labels = SimpleNamespace(has_pattern=has_pattern, adjusters=adjusters)
    said = Labels.one_of_several(labels, "s3_4.csv")
    assert (said is not None and str(said).startswith("s3_4.csv: of the numbers ")) is says


def test_a_table_of_tests_elsewhere_hides_none_beside_the_log(tmp_path) -> None:
    """Where tables speak for the logs beside them only; the one that names most of a path wins."""
    log = tmp_path / "here" / "day1" / "a.csv"
    tables = [
        SimpleNamespace(path=tmp_path / place / "tests.csv", rows=rows)
        for place, rows in (
            ("there", {"a.csv": "elsewhere"}),
            ("here", {"day1/a.csv": "most", "a.csv": "less", "b.csv": "another"}),
        )
    ]
    for is_beside, only, row in (
        (True, tables, "most"),
        (True, tables[:1], None),
        (False, tables[:1], "elsewhere"),
    ):
        assert Labels.row(SimpleNamespace(is_beside=is_beside, tables=only), log) == row


def test_of_tables_that_name_a_log_alike_the_nearest_speaks_in_any_order(tmp_path) -> None:
    """Folders within each other may hold logs of one name: the setting would be another test's."""
    log = tmp_path / "day1" / "repeated" / "a.csv"
    outer, inner = (
        SimpleNamespace(path=folder / "tests.csv", rows={"a.csv": folder.name})
        for folder in (log.parents[1], log.parent)
    )
    for tables in ((outer, inner), (inner, outer)):
        labels = SimpleNamespace(is_beside=True, tables=tables)
        assert Labels.row(labels, log) == "repeated"
        assert Labels.row(labels, log.parents[1] / "a.csv") == "day1"


@pytest.mark.parametrize(("adjusters", "setting"), [(("low", "high"), None), (("low",), "low 6")])
def test_a_setting_of_the_log_does_not_stand_for_half_a_row_of_the_table(
    adjusters, setting, tmp_path
) -> None:
    """The table says where one adjuster stands: the log's own number is no answer for both."""
    row = TestRow(2, {"low": 6}, Identity(), {})
    labels = Labels(adjusters, tables=(TestsTable(tmp_path / "tests.csv", {"a.csv": row}),))
    log = Recording("a.csv", "", "", Setting.of(3), np.arange(3.0), np.zeros(3), np.zeros(3))
    labelled, _ = labels.labelled(log, tmp_path / "a.csv")
    assert labelled.setting == (None if setting is None else Setting((("low", 6),)))
