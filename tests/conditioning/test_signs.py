"""Signs, tare and middle of a log."""

from contextlib import suppress
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from damperfit.conditioning import ConditionOptions, GasFacts, OffsetFacts, condition
from damperfit.conditioning.polarity import force_level
from damperfit.configuration.loading import load_configuration
from damperfit.damper.purdy.parameters import PURDY_DAMPER, Damper, Parameters
from damperfit.errors import ConditioningError
from damperfit.uncertainty.grades import LIMITS, offset_mismatch
from tests.conditioning.logs import RATE, found, logged, moving, recording, sine, sine_log
from tests.fakes import trace as fake_trace
from tests.identification.rig import recording as rig_log

SLIM = Damper(
    rod_diameter=0.012,
    piston_diameter=0.036,
    gas_piston_diameter=0.036,
    chamber_1_length=0.06,
    chamber_2_length=0.06,
    gas_length=0.045,
    oil_density=860.0,
    gas_pressure=12e5,
    gas_exponent=1.4,
)
SLIM_SETTING = Parameters(r_m1=4.8e3, r_m2=2.2e6, r_m3=4.5e5, k_e=6.6e8, f_f=35.0)
MIRRORS = {
    "as it is": (1.0, 1.0),
    "displacement": (-1.0, 1.0),
    "force": (1.0, -1.0),
    "both": (-1.0, -1.0),
}
GAS = 130.4


def gas_of(damper: Damper) -> GasFacts:
    return GasFacts(damper.rod_area, damper.gas_pressure, damper.gas_volume, damper.gas_exponent)


OFFSET = OffsetFacts(name="f_0", beside=("r_m1", "r_m2", "k_e"))
PURDY = ConditionOptions(gas=gas_of(PURDY_DAMPER), offset=OFFSET)


@pytest.fixture(scope="module")
def with_gas():
    """What a run of the paper's damper conditions with."""
    return load_configuration().conditioning


def log_of(setting, parameters=None, *, damper=PURDY_DAMPER, tare=0.0, amplitude=0.032):
    options = {"damper": damper, "noise": 4.0, "rate": 500.0, "duration": 6.0}
    log = rig_log(setting, parameters, amplitude=amplitude, **options)
    return replace(log, force=log.force + tare)


def mirrored(log, signs, *, centre=0.0417):
    x, f = signs
    return replace(log, displacement=centre + x * log.displacement, force=f * log.force)


def put_right(trace):
    """Channels that were reversed."""
    names = (one.code for one in trace.findings if one.values.get("is_correction"))
    return [name.removesuffix("_polarity") for name in names]


@pytest.mark.one_in(3)
@pytest.mark.parametrize("mirror", MIRRORS)
@pytest.mark.parametrize("setting", [1, 5, 10, 15, 18, 19, 20])
def test_every_sign_convention_gives_the_same_trace(setting, mirror) -> None:
    log, (x, f) = log_of(setting), MIRRORS[mirror]
    plain, trace = condition(log, PURDY), condition(mirrored(log, (x, f)), PURDY)
    assert trace.centre == pytest.approx(0.0417 + x * plain.centre, abs=1e-12)
    for name in ("displacement", "velocity", "force"):
        a, b = getattr(plain, name)[plain.compared], getattr(trace, name)[trace.compared]
        assert np.abs(a - b).max() < 1e-9 * np.abs(a).max()
    assert put_right(trace) == ["displacement"] * (x < 0) + ["force"] * (f < 0)


def test_the_level_is_the_gas_force_at_every_setting() -> None:
    for setting in (1, 7, 14, 20):
        level = force_level(condition(log_of(setting)), gas_of(PURDY_DAMPER))
        assert level.force == pytest.approx(-GAS, abs=10.0)
        assert abs(level.force + GAS) < level.uncertainty < 45.0
        assert level.rebound_curvature > level.bump_curvature > 0.0


def test_a_certain_sign_is_not_overruled_by_what_was_declared() -> None:
    log = mirrored(log_of(10), MIRRORS["both"])
    trace = condition(replace(log, reverse_displacement=False, reverse_force=False), PURDY)
    assert not put_right(trace)
    doubt = found(trace)["direction_contradicted"]  # which withholds the grade
    assert doubt.severity == "warning"
    assert "declared signs are kept" in str(doubt)


def test_one_declared_sign_and_the_energy_tell_the_other_even_without_gas() -> None:
    log = mirrored(log_of(10, tare=GAS), MIRRORS["displacement"])
    assert put_right(condition(replace(log, reverse_force=False))) == ["displacement"]
    with pytest.raises(ConditioningError, match="both signs are declared, and one of them wrongly"):
        condition(replace(log, reverse_force=False, reverse_displacement=False))


@pytest.mark.parametrize("mirror", ["force", "displacement"])
def test_a_tared_log_of_negative_energy_is_refused_with_the_question(mirror) -> None:
    log = mirrored(log_of(10, tare=GAS), MIRRORS[mirror])
    with pytest.raises(ConditioningError, match=r"delivers 7?.* J per cycle .*rig\.reverse_force"):
        condition(log, PURDY)


@pytest.mark.parametrize("setting", [1, 10, 20])
def test_a_tare_is_told_with_what_to_do(setting) -> None:
    log = log_of(setting, tare=130.4232)
    told = found(log, PURDY)
    tare = told["tare"]
    assert (tare.severity, tare.values["unit"]) == ("warning", "N")
    assert tare.values["value"] == pytest.approx(GAS, abs=12.0)
    assert "--free r_m1,r_m2,k_e,f_0" in str(tare)
    assert "--fix f_0=130N" in str(tare)
    assert told["direction"].severity == "warning"  # no gas to tell by, and it says so
    known = PURDY.but(offset=replace(OFFSET, is_known=True))
    assert found(log, known)["tare"].severity == "note"
    # Twice the gas: the level is +130 N, but rebound curves more than bump, so rebound it is.
    trace = condition(log_of(setting, tare=2.0 * GAS), PURDY)
    assert not put_right(trace)
    assert found(trace)["direction"].severity == "warning"
    assert found(trace)["tare"].values["value"] == pytest.approx(2.0 * GAS, abs=15.0)


@pytest.mark.parametrize("level", [GAS, 100.0, -GAS])
def test_a_damper_without_such_valves_is_never_reversed(level) -> None:
    """A magneto-rheological one: yield, little viscosity, a slow rise."""
    log = sine_log(rate=500.0)
    v = np.gradient(log.displacement, log.time)
    log = replace(log, force=600.0 * np.tanh(v / 0.06) + 800.0 * v + level)
    trace = condition(log, PURDY)
    assert not put_right(trace)
    assert ("direction" in found(trace)) == (level > 0.0)
    with pytest.raises(ConditioningError, match="does not show which of the two"):
        condition(replace(log, force=-log.force), PURDY)


def placed(drive, offset=0.0):
    """A log of 12 s of a motion at 500 Hz, the log's 0 so far off."""
    x = np.array([drive.displacement(at) for at in (np.arange(6000) / 500.0).tolist()])
    return moving(x + offset, rate=500.0)


STRANGE = {
    "a force that dies": lambda f: np.where(np.arange(len(f)) < 5, -1.0, -130.4),
    "a single spike": lambda f: np.where(np.arange(len(f)) == 2000, 1e4, 0.0),
    "next to nothing": lambda f: 1e-300 * f,
    "a square": np.sign,
    "far too much": lambda f: 1e300 * f,
}


@pytest.mark.parametrize("force", STRANGE)
@pytest.mark.parametrize("scale", [1.0, 1e6, 1e200])
def test_strange_forces_are_told_or_refused_and_nothing_else(force, scale) -> None:
    log = sine_log(rate=500.0)
    strange = STRANGE[force](log.force)
    velocity = 1e150 * np.clip(strange, -1.0, 1.0)
    log = replace(log, force=strange, velocity=velocity, displacement=scale * log.displacement)
    for skew in (0.0, "auto"):
        values = [0.0]
        with suppress(ConditioningError):  # one line of ours; any other exception fails
            trace = condition(log, PURDY.but(skew=skew))
            values = [one.values.get("value") or 0.0 for one in trace.findings]
        assert np.isfinite(values).all()


def test_the_level_is_known_where_samples_fall_right_on_the_reversals() -> None:
    # A product of neighbouring velocities is not negative where one is zero: no reversal was seen.
    velocity = np.tile(np.concatenate([np.arange(10, -11, -1), np.arange(-9, 10)]) / 10.0, 6)
    displacement = np.cumsum(velocity) / 500.0
    n = len(velocity)
    known = fake_trace(1)
    segment = replace(known.fastest, first=0, stop=n, cycle_starts=np.array([0.0, n - 1.0]))
    seen = replace(
        known,
        displacement=displacement - displacement.mean(),
        velocity=velocity,
        force=-130.0 + 50.0 * np.sign(velocity) + 200.0 * velocity,
        segments=(segment,),
    )
    assert force_level(seen, gas_of(PURDY_DAMPER)).reversals == pytest.approx(-130.0, abs=20.0)


# The force at rest, and the other logs of a rig, tell how channels are counted.


def resting(*, mirror=1.0, rest=0.6, tare=0.0, seed=1, preload=1.0):
    """A damper whose valves open at once, so that its loop hides the gas force."""
    t = np.arange(4000) / 500.0
    x = 0.02 * np.sin(2.0 * np.pi * 1.5 * np.clip(t - rest, 0.0, None))
    v = np.gradient(x, 1.0 / 500.0)
    opening = preload * np.where(v > 0.0, 400.0, 160.0) * np.tanh(v / 0.005)
    random = np.random.default_rng(seed)
    force = opening + 900.0 * v + 12.0 * np.tanh(v / 1e-3) - GAS + tare
    x = x + 3e-6 * random.standard_normal(len(x))
    return recording(t, mirror * x, mirror * (force + random.standard_normal(len(x))))


@pytest.mark.parametrize("mirror", MIRRORS)
def test_a_rest_shows_the_signs_of_both_channels(with_gas, mirror):
    x, f = MIRRORS[mirror]
    trace = condition(mirrored(resting(), (x, f), centre=0.0), with_gas)
    assert put_right(trace) == ["displacement"] * (x < 0) + ["force"] * (f < 0)
    assert trace.shows_signs


def test_preloads_do_not_contradict_a_rest_beside_the_gas_force(with_gas):
    names = {finding.code for finding in condition(resting(preload=2.5), with_gas).findings}
    assert not names & {"direction", "direction_contradicted"}


# A force that one stroke holds down to low speed is no level of the force, nor a direction.


def preloaded(rebound, bump, knee=2e-3, slope=300.0):
    """Valves that open at next to no speed, and 130 N of gas; no offset of the cell."""

    def law(_, v):
        return np.where(v > 0.0, rebound, bump) * np.tanh(v / knee) + slope * v - GAS

    return law


def test_preloads_that_are_unlike_are_no_offset(with_gas) -> None:
    trace = condition(logged(sine(2.5, 0.02, 20), preloaded(900.0, 150.0)), with_gas)
    level = force_level(trace, with_gas.gas)
    seen = level.force - level.expected
    assert seen > 200.0  # where 0 is true
    fit = SimpleNamespace(parameters=SimpleNamespace(f_0=0.0), logs=[SimpleNamespace(trace=trace)])
    times, told = offset_mismatch(fit, "f_0", with_gas.gas)
    assert told == pytest.approx(seen)
    assert times < LIMITS.offset
    # An offset that no preload explains is told still.
    fit.parameters.f_0 = 1000.0
    assert offset_mismatch(fit, "f_0", with_gas.gas)[0] > LIMITS.offset
    # Beside a log without preloads this one says nothing.
    plain = condition(logged(sine(2.5, 0.02, 20), lambda _, v: 3000.0 * v - GAS), with_gas)
    fit.parameters.f_0, fit.logs = 0.0, [*fit.logs, SimpleNamespace(trace=plain)]
    assert offset_mismatch(fit, "f_0", with_gas.gas)[1] == pytest.approx(0.0, abs=20.0)


@pytest.mark.parametrize(("rebound", "bump"), [(700.0, 100.0), (700.0, 30.0)])
def test_a_right_log_of_unlike_preloads_is_not_turned_round(rebound, bump, with_gas) -> None:
    """Their level is that of a gas force counted positive in bump, and was certain."""
    x = sine(0.5, 0.04, 8)
    trace = condition(logged(x, preloaded(rebound, bump, 1e-3), noise=(4e-6, 3.0)), with_gas)
    assert not put_right(trace)
    level = force_level(trace, with_gas.gas)
    assert -1.7 < level.ratio < -0.5
    assert 2.0 * level.uncertainty < level.force < 2.0 * level.held


def early(_, v):
    """Valves that open below a tenth of the highest speed, and 130 N of gas."""
    knee, slope, friction = np.where(v > 0.0, 330.0, 37.0), np.where(v > 0.0, 1100.0, 90.0), 25.0
    opened = knee * np.tanh((v / 0.06) ** 2) * np.sign(v) + slope * v
    return opened + friction * np.tanh(v / 2e-3) - GAS


def test_the_slowest_of_several_speeds_tells_the_level(with_gas) -> None:
    """The fast ones of valves that open early showed another offset, and another direction."""
    rates = [speed / (2.0 * np.pi * 0.04) for speed in (0.05, 0.13, 0.3, 0.6, 1.0)]
    rate = np.concatenate([np.full(round(5 / f * RATE), f) for f in rates])
    x = 0.04 * np.sin(2.0 * np.pi * np.cumsum(rate) / RATE)
    trace = condition(logged(x, early), with_gas)
    assert len(trace.segments) == len(rates)
    level = force_level(trace, with_gas.gas)
    assert level.force == pytest.approx(level.expected, abs=20.0)
    alone = (replace(trace, segments=(one,)) for one in trace.segments)
    levels = [force_level(one, with_gas.gas) for one in alone]
    assert level.doubt == min(one.doubt for one in levels)
    assert levels[-1].force - level.expected > 60.0
    assert "direction" not in found(trace)
