"""Every fault of the list is survived as its row says: the sentence, the code, the others whole.

`faults.py` holds the faulty files. What the list expects of things that are no files is below, or
proved beside the code it concerns (`ELSEWHERE`).
"""

from __future__ import annotations

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

# Row of the list -> the test that proves it.
ELSEWHERE = {
    "F22 written with checksums": "test_parquet_carries_units_provenance_and_page_checksums",
    "F22 every bit": "test_a_flipped_bit_in_parquet_never_changes_a_number",
    "F29 cut anywhere": "test_a_cut_never_changes_a_number",
    "F31 damaged TDMS": "test_a_flipped_bit_in_tdms_changes_its_own_value_at_most",
    "F36 pipe": "test_a_pipe_is_refused_and_not_waited_for",
    "F36 device": "test_a_device_is_refused",
    "F37 changed while read": "test_a_file_replaced_while_it_is_read",
    "F58 a reader killed": "test_a_log_that_breaks_its_child_costs_itself_alone",
    "F59 Ctrl-C": "test_the_command_ends_with_130_and_no_temporary_file",
    "F59 finished kept": "test_finished_settings_are_written_when_the_user_stops",
    "F61 full disk": "test_a_full_disk_leaves_the_old_results_whole",
    "F61 failed rename": "test_a_rename_that_fails_takes_the_earlier_ones_back",
    "F61 killed": "test_a_run_killed_at_any_call_leaves_one_whole_set",
    "F61 read-only": "test_a_read_only_folder_is_one_line",
    "F62 a link for a file": "test_an_output_that_is_a_link_is_replaced_and_its_target_kept",
    "F62 a link for the folder": "test_a_linked_folder_is_written_to_where_it_points",
    "F63 names as paths": "test_no_name_leads_out_of_the_folder",
    "F64 formulas": "test_cells_that_start_like_a_formula_get_an_apostrophe",
    "F64 negative numbers": "test_a_negative_number_is_never_touched",
    "F65 page": "test_every_text_is_escaped",
    "F65 terminal and Markdown": "test_nothing_that_a_log_says_becomes_markup",
    "F66 unknown key": "test_a_mistake_is_told_with_its_place",
    "F66 no configuration": "test_files_that_are_no_configuration_are_refused",
}


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


def test_the_good_ones_went_on(batch) -> None:
    _, _, document = batch
    failed = {failure["log"] for failure in document["failures"]}
    read = {facts["log"] for facts in document["logs"]} - failed
    assert {"setting_01.csv", "setting_02.csv"} <= read


# What is no faulty file


@pytest.mark.parametrize("command", ["inspect", "identify"])
@pytest.mark.parametrize(
    ("log", "says"),
    [
        ("nowhere.csv", "no such file"),
        (".", "no log in this folder"),
        ("*.nothing", "matches no file"),
    ],
)
def test_f01_a_path_that_is_no_file_is_wrong_usage(run, tmp_path, command, log, says) -> None:
    ended = run(command, log)
    assert ended.code == 2
    assert says in ended.err
    assert log in ended.err
    assert not list(tmp_path.iterdir())


def test_f02_a_file_that_may_not_be_read(run, logs, tmp_path, monkeypatch) -> None:
    for name in ("setting_01.csv", "setting_02.csv"):
        shutil.copy(logs / name, tmp_path)
    opened = os.open

    def refuse(path, *arguments, **how):  # root may read whatever its mode says
        if str(path).endswith("setting_02.csv"):
            raise PermissionError(13, "Permission denied")
        return opened(path, *arguments, **how)

    monkeypatch.setattr(os, "open", refuse)
    ended = run("inspect", "*.csv")
    assert ended.code == 1
    assert "setting_02.csv: file unreadable: Permission denied" in ended.err
    assert "setting_01.csv" in ended.out


def test_f10_bad_rows_are_dropped_on_request_and_counted(run, good, tmp_path) -> None:
    path = tmp_path / "setting_1.csv"
    path.write_bytes(good.with_row("0.020,OVR,2,26"))
    ended = run("inspect", path, "--rig", "bad_rows=drop")
    assert ended.code == 0
    assert "1 row that cannot be read dropped" in ended.out


def test_f29_a_cut_log_is_kept_on_request(run, good, tmp_path) -> None:
    pytest.importorskip("nptdms")
    (path,) = _write(tmp_path, ["F29 TDMS cut"], good)
    assert run("inspect", path).code == 3
    ended = run("inspect", path, "--allow-truncated", "--json")
    assert ended.code == 0
    (facts,) = json.loads(ended.out)["logs"]
    n = len(good.rows)
    assert facts["n_samples_read"] == n - 100
    assert any(f"kept: the first {n - 100} values" in note for note in facts["notes"])
    assert run("inspect", path, "--rig", "allow_truncated=true").code == 0


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


@pytest.mark.parametrize("seed", range(4))
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


def test_a_folder_that_may_not_be_entered_fails_alone(run, tmp_path, good, monkeypatch) -> None:
    (tmp_path / "setting_01.csv").write_bytes(good.text())
    locked = tmp_path / "no"
    locked.mkdir()
    (locked / "setting_03.csv").write_bytes(good.text())
    # Who runs the tests may be root, whom no folder is closed to.
    for owner, name in ((Path, "lstat"), (Path, "is_dir"), (Path, "is_file"), (os, "open")):
        monkeypatch.setattr(owner, name, _closed(getattr(owner, name)))
    ended = run("inspect", "setting_01.csv", "no/setting_03.csv")
    assert ended.code == 1
    assert "setting_03.csv: file unreadable: Permission denied" in ended.out + ended.err
