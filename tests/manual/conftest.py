"""A run that has most of what run.json can tell."""

import json

import pytest

from damperfit.cli import main
from tests.kept_fits import _fits_are_kept  # noqa: F401


@pytest.fixture(scope="session")
def full_run(tmp_path_factory, sample_results):
    """Records of a plain run, and of one with profiles, starts, hold-out and a failure."""
    folder = tmp_path_factory.mktemp("full")
    bad = folder / "bad_s3.csv"
    bad.write_text("x,y\n1,2\n", encoding="utf-8")
    logs = [str(sample_results / "sample_runs" / f"setting_0{n}.csv") for n in (5, 6)]
    asked = ("--profile", "k_e", "--hold-out-cycles", "0.2", "--fix", "r_m3=2e5", "--starts", "2")
    out = folder / "results"
    assert main(["identify", *logs, str(bad), *asked, "--out", str(out), "--quiet"]) == 1
    where = (sample_results / "results", out)
    return [json.loads((one / "run.json").read_text(encoding="utf-8")) for one in where]
