"""What a log was tested at: its preamble < [rig] < its profile < tests.csv < the command line."""

import itertools
import json
from dataclasses import replace
from pathlib import Path

import pytest

from damperfit.arguments import configured
from damperfit.errors import ConfigurationError
from damperfit.io import TestRow
from damperfit.run.logs import facts_of, read_batch
from tests.identification import rig

LEVELS = ("preamble", "rig", "profile", "row", "typed")
KEYS = ("gas_pressure", "temperature", "tare", "skew")
# What each level says: in the unit that it would be written in, and SI.
SAID = {
    "gas_pressure": [
        ("5bara", 5e5),
        ("6bara", 6e5),
        ("7bara", 7e5),
        ("8bara", 8e5),
        ("9bara", 9e5),
    ],
    "temperature": [(f"{20 + k}", 20.0 + k) for k in range(5)],
    "tare": [(f"{k}N", float(k)) for k in range(1, 6)],
    "skew": [(f"{k}ms", 1e-3 * k) for k in range(1, 6)],
}


def configuration(folder, *, rig_=None, profile=None, typed=None, skew=None):
    lines = ["[rig]", *_table(rig_), "[rig.profiles.bench]", 'files = "bench*"', *_table(profile)]
    path = folder / "rig.toml"
    path.write_text("\n".join(lines), encoding="utf-8")
    texts = [f"tested_at.{key}={json.dumps(value)}" for key, value in (typed or {}).items()]
    return configured("inspect", {"config": path, "rig": texts, "skew": skew})


def _table(facts):
    return [f"tested_at.{key} = {json.dumps(value)}" for key, value in (facts or {}).items()]


@pytest.mark.parametrize("key", KEYS)
def test_the_nearest_word_counts_whichever_say_anything(tmp_path, key) -> None:
    said = dict(zip(LEVELS, SAID[key], strict=True))
    plain = rig.recording(5, duration=1.5, rate=200.0)
    declared = {}
    for who in itertools.product((False, True), repeat=5):
        speaking = {level for level, speaks in zip(LEVELS, who, strict=True) if speaks}
        text = {level: {key: said[level][0]} for level in speaking}
        levels = tuple(sorted(speaking & {"rig", "profile", "typed"}))
        if levels not in declared:
            declared[levels] = configuration(
                tmp_path,
                rig_=text.get("rig"),
                profile=text.get("profile"),
                typed=text.get("typed"),
            )
        found = declared[levels]
        row = TestRow(2, facts={key: said["row"][1]}) if "row" in speaking else None
        log = replace(plain, metadata=text.get("preamble", {}))
        told, _ = facts_of(log, Path("bench_1.csv"), found, row)
        # A tare that a log names may have been taken off already; so may a skew.
        heard = [x for x in LEVELS if x in speaking and (x, key) not in _NOT_TAKEN]
        assert told.get(key) == (pytest.approx(said[heard[-1]][1]) if heard else None), speaking


_NOT_TAKEN = {("preamble", "tare"), ("preamble", "skew")}


def test_a_log_with_a_thermometer_needs_no_word_of_its_own(tmp_path) -> None:
    log = replace(rig.recording(5, duration=1.5, rate=200.0), metadata={"temperature": "40"})
    warm = replace(log, temperature=0.0 * log.time + 26.0)
    path, found = Path("x.csv"), configuration(tmp_path)
    assert facts_of(log, path, found, None)[0] == {"temperature": 40.0}
    assert facts_of(warm, path, found, None)[0] == {}


@pytest.mark.parametrize(
    ("facts", "says"),
    [
        ({"tear": "3N"}, r"tested_at: no 'tear'; there are gas_pressure.*Did you mean 'tare'"),
        ({"gas_pressure": "8bar"}, r"tested_at.gas_pressure: found '8bar', expected a unit that"),
        ({"tare": "8mm"}, r"tested_at.tare: found '8mm'"),
    ],
)
@pytest.mark.parametrize("where", ["rig_", "profile"])
def test_what_is_no_fact_of_a_test_is_refused(tmp_path, facts, says, where) -> None:
    with pytest.raises(ConfigurationError, match=says):
        configuration(tmp_path, **{where: facts})


def test_the_batch_holds_what_its_profile_tells(tmp_path) -> None:
    log = rig.recording(5, duration=5.0)
    lines = ["# setting: 5", "time_s,displacement_mm,force_N"]
    rows = zip(log.time, 1e3 * log.displacement, log.force, strict=True)
    lines += [f"{t:.6f},{x:.6f},{f:.4f}" for t, x, f in rows]
    path = tmp_path / "bench_1.csv"
    path.write_text("\n".join(lines), encoding="utf-8")
    found = configuration(tmp_path, profile={"gas_pressure": "4.2bara", "temperature": 31})
    (facts,) = read_batch([path], found, jobs=1).logs
    assert facts.facts["tested_at"] == {"gas_pressure": 4.2e5, "temperature": 31.0}
    (trace,) = read_batch([path], found, jobs=1).traces
    assert (trace.gas_pressure, trace.temperature) == (4.2e5, pytest.approx(31.0))
