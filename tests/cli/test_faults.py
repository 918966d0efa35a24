"""Bad files among good logs: each has its sentence, and the good ones keep every byte of theirs."""

import gzip
import io
import json
import pickle
import sys
import tarfile
import zipfile

import pytest

from damperfit import compiled_core

LIMIT = 4_000_000  # bytes, so that bombs can be small
TABLES = ("parameters.parquet", "parameters.csv", "mse.parquet", "mse.csv", "responses.parquet")
QUICK = (
    *("--procedure", "plain", "--free", "r_m1,r_m2,k_e", "--fix", "r_m3=2.6e6"),
    *("--fix", "f_f=50N", "--quiet", "--rig", f"max_log_bytes={LIMIT}"),
)


def tar(data: bytes) -> bytes:
    sink = io.BytesIO()
    with tarfile.open(fileobj=sink, mode="w") as archive:
        member = tarfile.TarInfo("../../log.csv")
        member.size = len(data)
        archive.addfile(member, io.BytesIO(data))
    return sink.getvalue()


def zipped(*members: str) -> bytes:
    sink = io.BytesIO()
    with zipfile.ZipFile(sink, "w", zipfile.ZIP_DEFLATED) as archive:
        for name in members:
            archive.writestr(name, b"")
    return sink.getvalue()


def function_handle() -> bytes:
    h5py = pytest.importorskip("h5py")
    sink = io.BytesIO()
    with h5py.File(sink, "w") as file:
        file["handle"] = [[0, 0, 0]]
        file["handle"].attrs["MATLAB_class"] = b"function_handle"
    return sink.getvalue()


def bad_files(good: str) -> dict[str, tuple[bytes, str]]:
    """Each kind once; all that a reader may refuse is in `tests/io`."""
    head, rows = good.split("\n", 1)
    small = "\n".join(
        ",".join((t, f"{float(x) / 1000:.7f}", *rest))
        for t, x, *rest in (row.split(",") for row in rows.splitlines())
    )
    many = [f"xl/workbook{i}" for i in range(20_000)]
    return {
        "empty_s101.csv": (b"", "empty file (0 bytes)"),
        "page_s102.csv": (b"<!DOCTYPE html><html>404</html>", "this is HTML"),
        "bomb_s103.csv.gz": (gzip.compress(b"0,1,2,3\n" * (LIMIT // 8 + 1)), "when unpacked"),
        "pickle_s104.pkl": (pickle.dumps([1.0]), "this is a Python pickle"),
        "noise_s105.tdms": (bytes(range(256)), "is named like TDMS and does not begin like it"),
        "many_s106.xlsx": (zipped(*many), "20000 members"),
        "above_s107.zip": (zipped("../../log.csv"), "this is a ZIP archive; unpack it"),
        "above_s108.tar": (tar(good.encode()), "this is an archive; unpack it"),
        "handle_s109.mat": (function_handle(), "no column for time, displacement and force"),
        "metres_s110.csv": (good.replace("_mm", "_m", 1).encode(), "displacement swings +-"),
        "small_s111.csv": (f"{head}\n{small}\n".encode(), "was m read as mm? Declare the unit"),
        "kilo_s112.csv": (good.replace("force_N", "force_kN", 1).encode(), "was N read as kN?"),
    }


def test_bad_files_have_their_sentences_and_leave_the_results_of_a_good_one(
    run, logs, tmp_path
) -> None:
    log = logs / "setting_01.csv"
    bad = bad_files(log.read_text().partition("time_s")[1] + log.read_text().partition("time_s")[2])
    for name, (content, _) in bad.items():
        (tmp_path / name).write_bytes(content)
    told = run("inspect", log, *bad, "--json", *QUICK[-3:])
    assert told.code == 1
    failures = {one["log"]: one["message"] for one in json.loads(told.out)["failures"]}
    assert failures.keys() == bad.keys()
    for name, (_, says) in bad.items():
        assert name in failures[name]
        assert says in failures[name]
        assert failures[name].isprintable()
    assert run("identify", log, *QUICK, "--out", "alone").code == 0
    assert run("identify", *list(bad)[:6], log, *list(bad)[6:], *QUICK, "--out", "out").code == 1
    alone, among = (
        {name: (tmp_path / out / name).read_bytes() for name in TABLES} for out in ("alone", "out")
    )
    assert among == alone
    assert len(json.loads((tmp_path / "out" / "run.json").read_text())["failures"]) == len(bad)


def test_a_core_that_does_not_load_is_one_sentence(run, logs, monkeypatch) -> None:
    monkeypatch.setitem(sys.modules, "damperfit.damper._core", None)  # its import fails
    monkeypatch.setattr(compiled_core, "_installed_core", lambda: None)
    ended = run("identify", logs / "setting_01.csv")
    assert ended.code == 2
    assert "pip install --force-reinstall damperfit" in ended.err
    assert len(ended.err.strip().splitlines()) == 1
