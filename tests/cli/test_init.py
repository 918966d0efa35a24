"""``damperfit init`` and ``doctor``, and logs named by folder and list."""

from __future__ import annotations

import io
import json
import re
import tomllib
from pathlib import Path

import pytest

from damperfit.cli.main import main
from damperfit.configuration.loading import load_configuration
from damperfit.damper.model import MODELS
from damperfit.queries.first_configuration import (
    Guessed,
    check_damper,
    damper_keys,
    fault_of,
    first_configuration,
)

SAMPLES = Path(__file__).parents[2] / "sample_runs"


@pytest.fixture(scope="module")
def text():
    """One sample log without its preamble, 4 s of it."""
    lines = (SAMPLES / "setting_10.csv").read_text().splitlines(keepends=True)
    return "".join(line for line in lines if line[0] != "#")[:48_000].rpartition("\n")[0] + "\n"


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


def bare(text: str, factor: float = 1.0, length: float = 1.0) -> str:
    """The log with names that tell no unit, and force and displacement in other ones."""
    rows = [line.split(",") for line in text.splitlines()[1:]]
    told = (f"{t},{float(x) * length!r},{float(f) * factor!r}" for t, x, f, _ in rows)
    return "\n".join(["Time,Position,Load", *told]) + "\n"


@pytest.mark.parametrize("model", ["purdy", "twin_tube", "monotube", "through_flow"])
def test_what_is_written_is_read_with_and_without_its_marks(model, folder):
    written = first_configuration(model, {"rod_diameter": "12mm"}, Guessed({}, {}))
    path = folder / "my_damper.toml"
    path.write_text(written)
    found = load_configuration(path)
    assert found.damper.name == model
    assert found.damper.rod_diameter == pytest.approx(0.012)
    assert f"damper.{'piston_diameter'}" not in found.declared
    # Without the marks everything is declared, with the values that were assumed before.
    keys = "|".join(damper_keys(model))
    path.write_text(re.sub(rf"(?m)^# ({keys}) = ", r"\1 = ", written))
    declared = load_configuration(path)
    assert declared.damper == found.damper
    assert {f"damper.{key}" for key in damper_keys(model)} <= declared.declared


def test_settings_units_and_serials_are_seen_in_logs(folder, text, capsys):
    for click in ("02", "10"):
        head = "# serial: SN7\n# operator: Kim\n"
        (folder / f"D7_C{click}.csv").write_text(head + bare(text))
    assert main(["init", "D7_C02.csv", "D7_C10.csv", "--set", "rod_diameter=19mm"]) == 0
    said = capsys.readouterr()
    found = tomllib.loads((folder / "my_damper.toml").read_text())
    assert found["rig"]["units"] == {"time": "s", "displacement": "mm", "force": "N"}
    assert found["rig"]["setting_pattern"] == r"C(?P<setting>\d+)"
    assert found["test"] == {"serial": "SN7", "operator": "Kim"}
    assert "note: displacement is read in mm: its amplitude is then 32 mm" in said.err
    # The logs are looked at with it.
    assert "$ damperfit inspect 'D7_C*.csv' --config my_damper.toml" in said.out
    assert "D7_C10.csv   10" in said.out
    assert "refused" not in said.out


def test_two_adjusters_are_seen_in_the_names(folder, text, capsys):
    for name in ("c10_r12", "c8_r12", "c10_r4"):
        (folder / f"{name}.csv").write_text(text)
    logs = sorted(path.name for path in folder.glob("*.csv"))
    main(["init", *logs])  # copies of one log are one test only
    said = capsys.readouterr()
    found = tomllib.loads((folder / "my_damper.toml").read_text())
    assert found["adjusters"] == {"compression": "", "rebound": ""}
    assert found["rig"]["setting_pattern"] == r"c(?P<compression>\d+)_r(?P<rebound>\d+)"
    assert "note: the names differ in the places of compression and rebound" in said.err
    declared = load_configuration(folder / "my_damper.toml").reading.adjusters
    assert list(declared) == ["compression", "rebound"]
    assert re.search(r"(?m)^c8_r12.csv +C8 R12 ", said.out)


def test_numbers_that_nothing_names_are_no_adjusters(folder, text, capsys):
    for name in ("x1_y2", "x2_y2", "x1_y3"):
        (folder / f"{name}.csv").write_text(text)
    main(["init", *sorted(path.name for path in folder.glob("*.csv"))])
    assert "adjusters" not in tomllib.loads((folder / "my_damper.toml").read_text())
    assert "warning: the logs do not say their setting" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("factor", "length", "units"),
    [
        (1e-3, 1.0, {"displacement": "mm", "force": "kN"}),
        (1.0, 1e-3, {"displacement": "m", "force": "N"}),
    ],
)
def test_units_are_those_that_make_a_damper_s_test(factor, length, units, folder, text):
    (folder / "setting_10.csv").write_text(bare(text, factor, length))
    assert main(["init", "setting_10.csv", "-q"]) == 0
    found = tomllib.loads((folder / "my_damper.toml").read_text())
    assert found["rig"]["units"] == {"time": "s", **units}


def test_units_that_make_no_test_of_a_damper_are_asked_for(folder, text, capsys):
    (folder / "setting_10.csv").write_text(bare(text, 1e9, 1e9))
    assert main(["init", "setting_10.csv"]) != 0
    assert "no common units give plausible values" in capsys.readouterr().err
    assert (
        "# open: setting_10.csv: columns without units" in (folder / "my_damper.toml").read_text()
    )


@pytest.mark.parametrize(("x_sign", "f_sign"), [(1.0, 1.0), (-1.0, 1.0), (1.0, -1.0), (-1.0, -1.0)])
def test_signs_that_the_loops_show_are_written(folder, text, capsys, x_sign, f_sign):
    rows = [line.split(",") for line in text.splitlines()[1:]]
    turned = "\n".join(f"{t},{x_sign * float(x)!r},{f_sign * float(f)!r}" for t, x, f, _ in rows)
    (folder / "setting_10.csv").write_text(f"time_s,displacement_mm,force_N\n{turned}\n")
    assert main(["init", "setting_10.csv"]) == 0
    written = tomllib.loads((folder / "my_damper.toml").read_text()).get("rig", {})
    said = capsys.readouterr().err
    for channel, sign in (("displacement", x_sign), ("force", f_sign)):
        assert written.get(f"reverse_{channel}", False) is (sign < 0.0)
        assert (f"the {channel} counts positive in bump: the loops show it" in said) is (sign < 0.0)


def test_a_file_that_is_there_stays_unless_forced(folder, capsys):
    (folder / "my_damper.toml").write_text("mine")
    assert main(["init"]) == 2
    assert "is there already; give --overwrite" in capsys.readouterr().err
    assert (folder / "my_damper.toml").read_text() == "mine"
    assert main(["init", "--overwrite", "-q"]) == 0
    assert load_configuration(folder / "my_damper.toml").damper.name == "purdy"


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--set", "rod_diamter=12mm"], "unknown key 'rod_diamter' in [damper]"),
        (["--set", "rod_diameter=12bar"], "--set rod_diameter"),
        (["--model", "monotub"], "monotub"),
        (["--model", "auto"], "let the logs choose"),
        (["nowhere.csv"], "nowhere.csv: no such file"),
    ],
)
def test_wrong_usage_is_told_and_writes_nothing(arguments, said, folder, capsys):
    assert main(["init", *arguments]) == 2
    assert said in capsys.readouterr().err
    assert list(folder.iterdir()) == []


def test_a_dash_prints_it(folder, capsys):
    assert main(["init", "--out", "-", "--model", "twin_tube"]) == 0
    assert tomllib.loads(capsys.readouterr().out)["damper"] == {"model": "twin_tube"}
    assert list(folder.iterdir()) == []


def test_doctor_fits_and_names_what_is_there(capsys):
    assert main(["doctor", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["checks"]["fit"]["works"]
    assert found["extras"]["tdms"]
    assert main(["doctor"]) == 0
    assert "fit        works: R_m1 of a synthetic log within" in capsys.readouterr().out


def test_doctor_says_what_mends_a_broken_core(monkeypatch, capsys):
    def broken() -> str:
        raise ImportError("undefined symbol")

    monkeypatch.setattr("damperfit.cli.commands._core", broken)
    monkeypatch.setattr("damperfit.cli.commands._version", lambda _: "")
    assert main(["doctor"]) == 1
    said = capsys.readouterr().out
    assert "core       FAILS: ImportError: undefined symbol; to mend it: pip install" in said
    assert "not there: pip install 'damperfit[tdms]'" in said


class TestLogsByFolderAndList:
    """A folder stands for its logs, @list.txt for what it names."""

    @pytest.fixture(autouse=True)
    def logs(self, folder):
        (folder / "runs").mkdir()
        for number in ("01", "10"):
            name = f"setting_{number}.csv"
            (folder / "runs" / name).symlink_to(SAMPLES / name)
        (folder / "runs" / "README.md").write_text("no log")
        (folder / "runs" / "deeper").mkdir()
        return folder / "runs"

    def names(self, capsys, *arguments: str) -> list[str]:
        assert main(["inspect", "--json", *arguments]) == 0
        return [Path(one["path"]).name for one in json.loads(capsys.readouterr().out)["logs"]]

    def test_a_folder(self, logs, capsys):
        assert self.names(capsys, str(logs)) == ["setting_01.csv", "setting_10.csv"]

    def test_a_list_with_remarks_and_patterns(self, folder, capsys):
        (folder / "list.txt").write_text("# of May\n\nruns/setting_1*.csv\nruns/setting_01.csv\n")
        assert self.names(capsys, "@list.txt") == ["setting_01.csv", "setting_10.csv"]

    @pytest.mark.parametrize(
        ("text", "said"),
        [
            ("# nothing\n", "@list.txt: the list names no log"),
            ("# x\nnowhere.csv\n", "list.txt:2: nowhere.csv: no such file"),
            ("@list.txt\n", "list.txt:1: a list in a list is not followed"),
        ],
    )
    def test_a_list_that_is_wrong(self, text, said, folder, capsys):
        (folder / "list.txt").write_text(text)
        assert main(["inspect", "@list.txt"]) == 2
        assert said in capsys.readouterr().err

    def test_a_list_that_is_not_there(self, capsys):
        assert main(["inspect", "@list.txt"]) == 2
        assert "the list list.txt cannot be read" in capsys.readouterr().err

    def test_results_among_logs_are_skipped_and_alone_refused(self, logs, folder, capsys):
        results = folder / "results"
        assert main(["identify", str(logs), "--out", str(results), "-q"]) == 0
        alone = (results / "parameters.csv").read_bytes()
        capsys.readouterr()
        assert main(["inspect", str(results)]) == 2
        assert "contains only files that damperfit wrote" in capsys.readouterr().err
        # Results in the folder of the logs: the same command finds the same logs again.
        for _ in range(2):
            assert main(["identify", str(logs), "--out", str(logs), "-q"]) == 0
        assert (logs / "parameters.csv").read_bytes() == alone
        capsys.readouterr()
        assert self.names(capsys, str(logs)) == ["setting_01.csv", "setting_10.csv"]


@pytest.fixture
def answered(monkeypatch, folder):
    """Run `init` on a terminal whose user types these lines."""

    def run(*lines: str, arguments=()) -> int:
        monkeypatch.setattr("damperfit.cli.init._is_terminal", lambda: True)
        monkeypatch.setattr("sys.stdin", io.StringIO("\n".join([*lines, ""])))
        return main(["init", *arguments])

    return run


def test_the_dialogue_shows_defaults_and_asks_again_after_a_wrong_answer(answered, folder, capsys):
    lines = ["monotub", "monotube", "32mm", "45 bananas", "45mm", "", "", "8bara", "", "1.4", ""]
    assert answered(*lines, arguments=["--set", "oil_density=860"]) == 0
    damper = tomllib.loads((folder / "my_damper.toml").read_text())["damper"]
    assert damper == {
        "model": "monotube",
        "rod_diameter": "32mm",
        "piston_diameter": "45mm",
        "oil_density": 860.0,
        "gas_pressure": "8bara",
        "gas_exponent": 1.4,
    }
    said = capsys.readouterr().err
    assert "model [purdy]: " in said
    assert "no model 'monotub'. Did you mean 'monotube'?" in said
    assert "rod_diameter (d_r; callipers on the rod) [12mm]: " in said
    assert "  piston_diameter: no unit of length 'bananas'" in said
    assert "oil_density" not in said  # it was given
    assert load_configuration(folder / "my_damper.toml").damper.rod_diameter == 0.032


def test_a_rod_wider_than_the_piston_is_asked_for_once_more(answered, folder, capsys):
    keys = len(damper_keys("purdy"))
    first, second = ["32mm", *[""] * (keys - 1)], ["", "45mm", *[""] * (keys - 2)]
    assert answered(*first, *second, arguments=["--model", "purdy"]) == 0
    said = capsys.readouterr().err
    assert "  rod_diameter: expected less than piston_diameter, 0.0285 m, found 0.032 m" in said
    assert "rod_diameter (d_r; callipers on the rod) [32mm]: " in said
    damper = tomllib.loads((folder / "my_damper.toml").read_text())["damper"]
    assert damper == {"model": "purdy", "rod_diameter": "32mm", "piston_diameter": "45mm"}


def test_a_dialogue_that_ends_early_writes_nothing(answered, folder, capsys):
    assert answered("purdy", "32mm") == 130
    assert "interrupted" in capsys.readouterr().err
    assert list(folder.iterdir()) == []


def test_every_key_of_every_model_may_be_given_as_it_stands(folder):
    for model in MODELS:
        keys = damper_keys(model)
        check_damper(model, keys)
        found = tomllib.loads(first_configuration(model, keys, Guessed({}, {})))["damper"]
        assert found.keys() == {"model", *keys}
        assert not {"True", "False"} & set(map(str, found.values())) - {
            str(one) for one in found.values() if isinstance(one, bool)
        }
        assert [key for key in keys if fault_of(model, key, keys[key])] == []
