"""Every fault of the list is survived as its row says: the sentence, the code, the others whole."""

import importlib.util
import io
import json
import os
import random
import shutil
import sys
from contextlib import redirect_stdout
from pathlib import Path

import numpy as np
import pytest

from damperfit import compiled_core
from damperfit.cli import main
from damperfit.io import ReadOptions, read_log
from tests.cli.faults import FAULTS, LIMIT, NAMES, Good, file_name

TESTS = Path(__file__).parents[1]
TABLES = ("parameters.parquet", "parameters.csv", "mse.parquet", "mse.csv", "responses.parquet")
QUICK = (
    *("--procedure", "plain", "--free", "r_m1,r_m2,k_e"),
    *("--fix", "r_m3=2.6e6", "--fix", "f_f=50N", "--quiet"),
)
LIMITED = ("--rig", f"max_log_bytes={LIMIT}")


@pytest.fixture(scope="module")
def good(logs) -> Good:
    lines = (logs / "setting_01.csv").read_text().splitlines()
    return Good(tuple(line for line in lines if line[0].isdigit()))


def _write(folder: Path, names, good: Good) -> list[Path]:
    paths = []
    for name in names:
        if all(importlib.util.find_spec(module) for module in FAULTS[name].needs):
            paths.append(folder / file_name(name))
            paths[-1].write_bytes(FAULTS[name].content(good))
    return paths


@pytest.fixture(scope="module")
def batch(good, logs, tmp_path_factory):
    """Inspect two good logs among all the faulty files: code, folder, facts by name."""
    folder = tmp_path_factory.mktemp("faults")
    paths = _write(folder, FAULTS, good)
    for setting in ("01", "02"):
        shutil.copy(logs / f"setting_{setting}.csv", folder)
        paths.append(folder / f"setting_{setting}.csv")
    with redirect_stdout(io.StringIO()) as told:
        code = main(["inspect", "--json", "--quiet", *LIMITED, *map(str, paths)])
    return code, folder, json.loads(told.getvalue())


@pytest.mark.parametrize("name", FAULTS)
def test_a_faulty_file_has_its_sentence(batch, good, name) -> None:
    fault = FAULTS[name]
    for module in fault.needs:
        pytest.importorskip(module)
    code, folder, document = batch
    assert code == 1  # the others went on
    failures = {failure["log"]: failure["message"] for failure in document["failures"]}
    log = file_name(name)
    if not fault.is_good:
        assert fault.says in failures[log]
        assert log in failures[log]
        assert failures[log].isprintable()
        return
    assert log not in failures
    (facts,) = [facts for facts in document["logs"] if facts["log"] == log]
    assert any(fault.says in note for note in facts["notes"])
    read = read_log(folder / log, ReadOptions(max_bytes=LIMIT))
    expected = dict(zip(NAMES, good.columns(), strict=True))
    np.testing.assert_allclose(read.time, expected["time_s"], rtol=1e-12)
    np.testing.assert_allclose(1e3 * read.displacement, expected["displacement_mm"], rtol=1e-12)
    np.testing.assert_allclose(read.force, expected["force_N"], rtol=1e-12)


# What is no faulty file


def test_f60_a_core_that_does_not_load_is_one_sentence(run, logs, monkeypatch) -> None:
    monkeypatch.setitem(sys.modules, "damperfit.damper._core", None)  # its import fails
    monkeypatch.setattr(compiled_core, "_installed_core", lambda: None)
    ended = run("identify", logs / "setting_01.csv")
    assert ended.code == 2
    assert "pip install --force-reinstall damperfit" in ended.err
    assert len(ended.err.strip().splitlines()) == 1


# Overall: whatever lies beside good logs changes no byte of their results


@pytest.fixture(scope="module")
def alone(logs, tmp_path_factory) -> dict[str, bytes]:
    folder = tmp_path_factory.mktemp("alone")
    code = main(["identify", str(logs / "setting_01.csv"), *LIMITED, *QUICK, "--out", str(folder)])
    assert code == 0
    return {name: (folder / name).read_bytes() for name in TABLES}


QUICK = (
    "--procedure",
    "plain",
    "--free",
    "r_m1,r_m2,k_e",
    "--fix",
    "r_m3=2.6e6",
    "--fix",
    "f_f=50N",
    "--quiet",
)


@pytest.mark.parametrize("seed", range(2))
def test_any_bad_files_leave_the_results_of_the_good_ones(
    run, good, logs, alone, tmp_path, seed
) -> None:
    dice = random.Random(seed)  # noqa: S311  # the same files each time
    bad = [name for name, fault in FAULTS.items() if not fault.is_good]
    chosen = bad if seed == 0 else dice.sample(bad, dice.randrange(1, len(bad)))
    paths = [str(path) for path in _write(tmp_path, chosen, good)]
    paths.insert(dice.randrange(len(paths) + 1), str(logs / "setting_01.csv"))
    ended = run("identify", *paths, *LIMITED, *QUICK, "--out", "out")
    assert ended.code == 1
    assert {name: (tmp_path / "out" / name).read_bytes() for name in TABLES} == alone
    assert (
        len(json.loads((tmp_path / "out" / "run.json").read_text())["failures"]) == len(paths) - 1
    )


def _closed(real):
    def refuse(path, *rest, **how):
        if "no/setting_03" in os.fspath(path):
            raise PermissionError(13, "Permission denied")
        return real(path, *rest, **how)

    return refuse
