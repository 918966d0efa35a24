"""A folder of refused logs: a few lines on the terminal, in report.md and on the page."""

from __future__ import annotations

import json
import shutil

from tests.cli.test_faults import QUICK

KINDS = {
    "empty": b"",
    "header": b"time_s,displacement_mm,force_N\n",
    "text": b"time_s,displacement_mm,force_N\n0.0,1,2\n0.1,2,OVR\n0.2,1,3\n0.3,1,2\n",
    "column": b"time_s,displacement_mm,load_cell\n0.0,1,2\n0.1,2,3\n0.2,1,3\n0.3,1,2\n",
    "short": b"time_s,displacement_mm,force_N\n0.0,1,2\n0.1,2,3\n0.2,1,3\n0.3,1,2\n",
    "page": b"<!DOCTYPE html><html><body>404</body></html>",
    "cut": b'{"time_s": [0.0, 0.1',
}


def test_seven_kinds_of_refusals_in_a_folder(run, logs, tmp_path) -> None:
    for kind, content in KINDS.items():
        for k in range(15):
            (tmp_path / f"{kind}_{k}_setting_{100 + k}.csv").write_bytes(content)
    shutil.copy(logs / "setting_01.csv", tmp_path)
    seen = run("inspect", "*.csv")
    assert seen.code == 1
    lines = seen.err.strip().splitlines()
    assert len(lines) == 7
    assert all(" alike: " in line for line in lines)
    assert len(seen.out.splitlines()) < 80
    ended = run("identify", "*.csv", *QUICK, "--out", "out", "--report")
    assert ended.code == 1
    assert len([line for line in ended.err.splitlines() if " alike: " in line]) == 7
    report = (tmp_path / "out" / "report.md").read_text()
    missing = report.split("## Not done")[1].split("##")[0]
    assert missing.count("\n- ") == 7
    page = (tmp_path / "out" / "report.html").read_text()
    assert page.split("<h3>Not done</h3>")[1].split("</ul>")[0].count("<li>") == 7
    record = json.loads((tmp_path / "out" / "run.json").read_text())
    assert len(record["failures"]) == 105
