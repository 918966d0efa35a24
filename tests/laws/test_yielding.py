"""What yields before it slides is told as that, and no valve, mounting or delay in its place."""

import json
import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from damperfit.cli import main
from damperfit.conditioning import condition
from damperfit.damper.mounting import FIT, Friction
from damperfit.damper.purdy.parameters import PURDY_DAMPER
from damperfit.damper.rivals import Biviscous, BoucWen, Kwok
from damperfit.damper.valve_dampers import ThroughFlow
from damperfit.laws.law_fit import Candidate, SettingLogs, held_against, is_open_to
from damperfit.laws.search import search_laws
from damperfit.recording import Recording
from damperfit.run import auto_model as law_choice
from damperfit.simulation import simulate
from damperfit.tested.setting import Setting
from tests.laws.valve_logs import DAMPER_TOML, VALUES, damper, moved
from tests.rig_like.dampers import magneto_rheological, text_of
from tests.rig_like.rig import Logged

OF_VALVES = ("blow-off", "bleed", "elasticity", "play at", " late", "mounting,", "orifice")
CURRENT = 0.5


def rival_log(model, numbers) -> Logged:
    """Three speeds of a model that yields, with 4 N and 8 um of noise."""
    motion = moved((0.05, 0.13, 0.26), rate=1000.0)
    force = simulate(model.values(numbers), model, motion).force
    noise, n = np.random.default_rng(3), len(force)
    x = motion.displacement + noise.normal(0.0, 8e-6, n)
    time = motion.interval * np.arange(n)
    return Logged(time, x, force + noise.normal(0.0, 4.0, n), np.zeros((3, 0)))


LOGS = {
    "Bouc-Wen": lambda: magneto_rheological(CURRENT, 1.0, 1),
    "hysteretic bi-viscous": lambda: rival_log(
        Biviscous(),
        {"c_pr": 2e4, "v_0": 0.015, "c_r": 900.0, "c_b": 850.0, "f_r": 420.0, "f_b": 400.0,
         "f_0": 8.0},
    ),
    "Kwok's hyperbolic tangent": lambda: rival_log(
        Kwok(),
        {"c": 900.0, "k": 800.0, "alpha": 450.0, "beta": 60.0, "delta": 0.6, "f_0": 8.0},
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", [
    "Bouc-Wen",
    pytest.param("hysteretic bi-viscous", marks=pytest.mark.slow),
    pytest.param("Kwok's hyperbolic tangent", marks=pytest.mark.slow),
])  # fmt: skip
def test_a_damper_that_yields_is_told_as_what_it_is(name, tmp_path, capsys) -> None:
    log, toml, out = tmp_path / "mr.csv", tmp_path / "damper.toml", tmp_path / "results"
    log.write_text(text_of(LOGS[name](), "1"))
    toml.write_text(DAMPER_TOML)
    code = main(["identify", str(log), "--model", "auto", "--config", str(toml), "--out", str(out)])
    streams = capsys.readouterr()
    said = " ".join(
        line for line in streams.err.splitlines() if not line.startswith("damperfit: tried")
    )
    assert code == 0
    assert f"the logs support {name}." in said
    assert "it yields before it slides" in " ".join(streams.out.split())
    told = said.replace("no valve, mounting or delay is named", "")
    assert not [word for word in OF_VALVES if word in told]
    record = json.loads((out / "run.json").read_text())
    assert record["law_choice"]["model"] in {"bouc_wen", "biviscous", "kwok"}
    (setting,) = record["law_choice"]["settings"]
    assert setting["held_out_mse_percent"] < 0.1
    assert setting["mse_percent"] < 0.01


def tried(model, mse: float, held: float = math.nan) -> Candidate:
    fit = SimpleNamespace(
        model=model, mse_percent=mse, held_out_percent=held, free=(), at_bound=(), undetermined=()
    )
    return Candidate("law", (fit,))


@pytest.mark.parametrize(("of_valves", "is_taken", "is_open"), [
    (1.51, True, True), (1.49, False, True), (1 / 3.9, False, True), (1 / 4.1, False, False),
])  # fmt: skip
def test_valves_are_told_where_they_are_clearly_better(of_valves, is_taken, is_open) -> None:
    valves, other = tried(ThroughFlow(), of_valves), tried(BoucWen(), 1.0)
    taken, why = held_against(valves, other, 0.6)
    assert taken is is_taken
    assert is_open_to(valves, other) is is_open
    assert why.startswith("the logs hold 60 % of their force down to a tenth of the speed; ")
    assert ("as well as" in why) is (is_open and not is_taken)


@pytest.mark.parametrize(("shares", "expected"), [
    ((0.7, 0.41), 0.41), ((0.7, 0.39), math.nan), ((0.7, math.nan), 0.7), ((), math.nan),
])  # fmt: skip
def test_a_damper_yields_where_all_its_logs_do(monkeypatch, shares, expected) -> None:
    monkeypatch.setattr(law_choice, "held_share", lambda log: log)
    evidence = [SimpleNamespace(fitted=shares)]
    assert law_choice._held_share(evidence) == pytest.approx(expected, nan_ok=True)


def bent(k_e: float, *, undetermined=(), of_valves=1.0 / 3.9) -> Candidate:
    """Valves with oil of a bulk modulus, which fit and predict so many times worse than 1."""
    values = SimpleNamespace(k_e=k_e)
    fit = SimpleNamespace(
        model=ThroughFlow(), mse_percent=of_valves, held_out_percent=math.nan, free=("k_e",),
        at_bound=(), undetermined=undetermined, values=values, setting=Setting.of(4),
    )  # fmt: skip
    return Candidate("law", (fit,))


@pytest.mark.parametrize(("k_e", "is_taken"), [
    (2.99e7, True), (3.01e7, False), (2.99e9, False), (3.01e9, True),
])  # fmt: skip
def test_valves_that_no_damper_has_are_not_told_beside_what_fits_as_well(k_e, is_taken) -> None:
    """A law of valves fits a magneto-rheological log with oil as stiff as steel."""
    other = tried(BoucWen(), 1.0)
    taken, why = held_against(bent(k_e), other, 0.6)
    assert taken is is_taken
    if is_taken:
        shown = f"{1e-6 * k_e:.3g} MPa"
        assert why.endswith(
            f"as a model with valves whose K_e is beyond any damper's, {shown} at setting 4"
        )
    # What the logs do not tell is no reason, nor are valves that are clearly better.
    assert not held_against(bent(k_e, undetermined=("k_e",)), other, 0.6)[0]
    assert not held_against(bent(k_e, of_valves=1.0 / 4.1), other, 0.6)[0]


@pytest.mark.parametrize(("shares", "expected"), [
    (((0.7, 0.39), (0.5, 0.6)), 0.5), (((0.7, 0.45), (0.1,)), 0.45), (((0.3,), ()), math.nan),
])  # fmt: skip
def test_a_setting_yields_where_all_its_logs_do(monkeypatch, shares, expected) -> None:
    monkeypatch.setattr(law_choice, "held_share", lambda log: log)
    evidence = [SimpleNamespace(fitted=one) for one in shares]
    assert law_choice._held_by_some(evidence) == pytest.approx(expected, nan_ok=True)


def evidence_of(model, numbers, motion) -> list[SettingLogs]:
    """A log of valves with hardly any noise."""
    known = {k: v for k, v in (VALUES | numbers).items() if k in model.names}
    force = simulate(model.values(known), model, motion).force
    noise, n = np.random.default_rng(1), len(force)
    x = motion.displacement + noise.normal(0.0, 8e-6, n)
    time, force = motion.interval * np.arange(n), force + noise.normal(0.0, 4.0, n)
    trace = condition(Recording("one.csv", "", "", Setting.of(1), time, x, force))
    return [SettingLogs(Setting.of(1), (trace,))]


def preloaded() -> tuple[ThroughFlow, list[SettingLogs]]:
    """A damper with hardly a bleed, and a log of it."""
    model = damper(has_play_and_lag=False)
    numbers = {"rebound_bleed": 5e5, "compression_bleed": 5e5}
    return model, evidence_of(model, numbers, moved((0.06, 0.24), rate=500.0, cycles=3))


@pytest.mark.slow
def test_friction_that_builds_up_over_a_distance_stays_beside_valves() -> None:
    """Without it no part of valves comes near what yields; it comes with a move."""
    plain = damper(has_play_and_lag=False)
    numbers = {
        "rebound_bleed": 5e4, "rebound_opening": 1e5, "rebound_slope": 1.5e6,
        "compression_bleed": 4.5e4, "compression_opening": 8e4, "compression_slope": 1.2e6,
        "f_f": 150.0, "presliding": 1e-3,
    }  # fmt: skip
    motion = moved((0.05, 0.13, 0.26), amplitude=0.01, rate=1000.0)
    evidence = evidence_of(replace(plain, friction=Friction(presliding=FIT)), numbers, motion)
    share = law_choice._held_share(evidence)
    assert share > 0.7
    found = search_laws(PURDY_DAMPER, [plain], evidence, held_share=share)
    assert found.chosen.fits[0].values.presliding == pytest.approx(1e-3, rel=0.05)


@pytest.mark.slow
def test_preloaded_valves_stay_valves_though_their_force_is_held() -> None:
    """They are asked whether they yield, and the true valves are far better."""
    model, evidence = preloaded()
    share = law_choice._held_share(evidence)
    found = search_laws(PURDY_DAMPER, [model], evidence, held_share=share)
    assert found.chosen.fits[0].model.name == "through_flow"
    assert found.also == ""
    assert {*LOGS} <= {one.candidate.title for one in found.laws}
