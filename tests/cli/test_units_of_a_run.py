"""`identify --units`: the terminal, the page and files for people; `report` repeats it."""

import csv
import json

import pyarrow.parquet as pq
import pytest

from damperfit.run.log_files import is_own_table
from damperfit.units.quantities import find_unit

POUND = find_unit("lbf", "force").factor


@pytest.fixture(scope="module")
def both(logs, tmp_path_factory):
    """The same run in SI and in pounds and inches."""
    from damperfit.cli import main

    place = tmp_path_factory.mktemp("units")
    log = str(logs / "setting_02.csv")
    for name, more in (("si", []), ("us", ["--units", "lbf,in/s", "--report"])):
        code = main(["identify", log, "--out", str(place / name), "-q", *more])
        assert code in (0, 4)
    return place


def cells(path) -> dict[str, str]:
    return next(csv.DictReader(path.read_text(encoding="utf-8").splitlines()))


def test_files_for_people_are_converted_with_their_headings(both) -> None:
    si, us = (cells(both / name / "characteristics.csv") for name in ("si", "us"))
    force = next(name for name in si if name.endswith("_N") and si[name])
    assert float(us[f"{force[:-2]}_lbf"]) == pytest.approx(float(si[force]) / POUND)
    speed = next(name for name in si if name.endswith("_m_per_s") and si[name])
    assert float(us[speed.replace("_m_per_s", "_in_per_s")]) == pytest.approx(
        float(si[speed]) / 0.0254
    )
    assert not [name for name in us if name.endswith(("_N", "_m_per_s"))]
    assert all(is_own_table(path) for path in (both / "us").glob("*.csv"))


def test_files_for_programs_stay_as_they_are(both) -> None:
    for path in (both / "si").glob("*.parquet"):
        names = pq.read_schema(path).names
        assert pq.read_schema(both / "us" / path.name).names == names
    assert cells(both / "si" / "parameters.csv") == cells(both / "us" / "parameters.csv")


def test_the_page_shows_them_and_report_repeats_them_unless_others_are_given(both, run) -> None:
    page = both / "us" / "report.html"
    first = page.read_text(encoding="utf-8")
    assert "in/s" in first
    assert run("report", both / "us", "-q").code in (0, 1)
    assert page.read_text(encoding="utf-8") == first
    assert run("report", both / "us", "--units", "N,m/s", "-q").code in (0, 1)
    assert "in/s" not in page.read_text(encoding="utf-8")
    record = json.loads((both / "us" / "run.json").read_text(encoding="utf-8"))
    assert record["configuration"]["output"]["units"] == "lbf,in/s"
