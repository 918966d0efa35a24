"""What stands where export, simulate and sweep write is replaced only where it is their own."""

from __future__ import annotations

import pytest

from damperfit.exporting import TARGETS
from damperfit.store import _is_own_file as is_own_file
from tests.report_folder import make_results

SIMULATE = ("simulate", "--setting", "10", "--cycles", "1", "-q")
SWEEP = ("sweep", "--setting", "10", "--vary", "f_f=1,2", "-q")


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    return make_results(tmp_path_factory.mktemp("over") / "results")


@pytest.mark.parametrize("target", sorted(TARGETS))
def test_an_earlier_export_is_replaced_and_another_file_is_not(
    run, results, tmp_path, target
) -> None:
    export = ("export", results, "--to", target, "--out", "there", "-q")
    assert run(*export).code in (0, 1)
    assert run(*export).code in (0, 1)
    for path in (tmp_path / "there").iterdir():
        path.write_text("kept by hand\n")
        ended = run(*export)
        assert ended.code == 2
        assert f"{path.name}: is there already" in ended.err
        assert path.read_text() == "kept by hand\n"
        assert run(*export, "--overwrite").code in (0, 1)
        assert path.read_bytes() != b"kept by hand\n"


@pytest.mark.parametrize(
    ("option", "name"),
    [("--out", "a.csv"), ("--out", "a.parquet"), ("--plot", "a.png"), ("--plot", "a.svg"),
     ("--plot", "a.pdf")],
)  # fmt: skip
def test_a_simulation_is_replaced_and_another_file_is_not(run, tmp_path, option, name) -> None:
    assert run(*SIMULATE, option, name).code == 0
    assert run(*SIMULATE, option, name).code == 0
    (tmp_path / name).write_text("time_s,displacement_mm,force_N\n0,0,0\n")
    ended = run(*SIMULATE, option, name)
    assert ended.code == 2
    assert "--overwrite" in ended.err
    assert (tmp_path / name).read_text().startswith("time_s,displacement_mm")
    assert run(*SIMULATE, option, name, "--overwrite").code == 0


def test_a_sweep_is_replaced_and_another_file_is_not(run, tmp_path) -> None:
    assert run(*SWEEP).code == 0
    assert run(*SWEEP).code == 0
    (tmp_path / "sweep" / "sweep.csv").write_text("a,b,c\n")
    ended = run(*SWEEP)
    assert ended.code == 2
    assert "sweep.csv: is there already" in ended.err
    assert run(*SWEEP, "--overwrite").code == 0


def test_a_log_in_damperfits_own_dialect_is_nobodys_export(run, tmp_path) -> None:
    (tmp_path / "log.csv").write_text("# damperfit rig log\ntime_s,displacement_mm,force_N\n")
    assert run(*SIMULATE, "--out", "log.csv").code == 2


def test_results_are_not_replaced_by_a_simulation(run, results) -> None:
    ended = run(*SIMULATE, "--out", results / "responses.parquet")
    assert ended.code == 2
    assert "is there already" in ended.err


OURS = "setting,speed_m_per_s,force_N,range"


@pytest.mark.parametrize(
    ("old", "is_own"),
    [
        (OURS, True),
        ("setting;speed_in_per_s;force_lbf;range", True),  # other units and marks
        ("setting;speed [mm/s];force [kN];range", True),
        (OURS.replace("setting", '"setting"'), False),
        (OURS.removesuffix(",range"), False),
        (OURS.replace("force", "load"), False),
    ],
)
def test_a_table_is_known_by_its_columns_whatever_their_units(tmp_path, old, is_own) -> None:
    (tmp_path / "old.csv").write_text(old + "\n")
    (tmp_path / "new.csv").write_text(OURS + "\n1,0,0,tested\n")
    assert is_own_file(tmp_path / "old.csv", tmp_path / "new.csv") is is_own


@pytest.mark.parametrize("folder", [".", "elsewhere"])
def test_a_table_stays_where_the_plot_beside_it_is_refused(run, tmp_path, folder) -> None:
    (tmp_path / folder).mkdir(exist_ok=True)
    plot = tmp_path / folder / "b.png"
    plot.write_text("kept by hand")
    ended = run(*SIMULATE, "--out", "a.csv", "--plot", plot)
    assert ended.code == 2
    assert "b.png: is there already" in ended.err
    assert not (tmp_path / "a.csv").exists()
    assert plot.read_text() == "kept by hand"
    (tmp_path / "a.csv").write_text("kept by hand")
    assert run(*SIMULATE, "--out", "a.csv", "--plot", plot, "--overwrite").code == 0
    assert plot.read_bytes().startswith(b"\x89PNG")
