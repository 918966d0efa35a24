"""``damperfit init`` and ``doctor``, and logs named by folder and list."""

import io
import json
import re
import tomllib
from pathlib import Path

import pytest

from damperfit.cli.main import main
from damperfit.configuration.loading import load_configuration
from damperfit.queries.first_configuration import (
    Guessed,
    damper_keys,
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


@pytest.mark.parametrize("model", ["purdy", "monotube"])
def test_what_is_written_is_read_with_and_without_its_marks(model, folder):
    written = first_configuration(model, {"rod_diameter": "12mm"}, Guessed({}, {}))
    path = folder / "my_damper.toml"
    path.write_text(written)
    found = load_configuration(path)
    assert (found.damper.name, found.damper.rod_diameter) == (model, pytest.approx(0.012))
    assert "damper.piston_diameter" not in found.declared
    assert main(["init"]) == 2  # it is there already
    # Without the marks everything is declared, with the values that were assumed before.
    keys = "|".join(damper_keys(model))
    path.write_text(re.sub(rf"(?m)^# ({keys}) = ", r"\1 = ", written))
    declared = load_configuration(path)
    assert declared.damper == found.damper
    assert {f"damper.{key}" for key in damper_keys(model)} <= declared.declared


def test_a_model_that_nobody_named_is_left_open(folder, capsys):
    assert main(["init"]) == 0
    assert "warning: the model is not named" in capsys.readouterr().err
    assert '# model = "purdy"' in Path("my_damper.toml").read_text()
    assert main(["init", "--model", "purdy", "--overwrite"]) == 0
    assert "warning" not in capsys.readouterr().err


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


@pytest.mark.parametrize(
    ("x_sign", "f_sign", "x_unit", "f_unit"),
    [(1.0, 1.0, "mm", "kN"), (-1.0, 1.0, "m", "N"), (1.0, -1.0, "mm", "N"), (-1.0, -1.0, "m", "N")],
)
def test_units_and_signs_that_the_loops_show_are_written(
    folder, text, capsys, x_sign, f_sign, x_unit, f_unit
):
    length, size = {"mm": 1.0, "m": 1e-3}[x_unit], {"N": 1.0, "kN": 1e-3}[f_unit]
    (folder / "setting_10.csv").write_text(bare(text, f_sign * size, x_sign * length))
    assert main(["init", "setting_10.csv"]) == 0
    written = tomllib.loads((folder / "my_damper.toml").read_text())["rig"]
    assert written["units"] == {"time": "s", "displacement": x_unit, "force": f_unit}
    said = capsys.readouterr().err
    for channel, sign in (("displacement", x_sign), ("force", f_sign)):
        assert written.get(f"reverse_{channel}", False) is (sign < 0.0)
        shown = f"{channel} is positive in compression: the loops show it (judged by the gas"
        assert (shown in said) is (sign < 0.0)


def test_doctor_fits_and_names_what_is_there(capsys):
    assert main(["doctor", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["checks"]["fit"]["works"]
    assert found["extras"]["tdms"]


def test_a_list_names_logs_with_remarks_and_patterns_each_once(folder, capsys):
    for name in ("setting_01.csv", "setting_10.csv"):
        (folder / name).symlink_to(SAMPLES / name)
    (folder / "list.txt").write_text("# of May\n\nsetting_1*.csv\nsetting_01.csv\nsetting_10.csv\n")
    assert main(["inspect", "--json", "@list.txt"]) == 0
    names = [Path(one["path"]).name for one in json.loads(capsys.readouterr().out)["logs"]]
    assert names == ["setting_01.csv", "setting_10.csv"]


@pytest.fixture
def answered(monkeypatch, folder):
    """Run `init` on a terminal whose user types these lines."""

    def run(*lines: str, arguments=()) -> int:
        monkeypatch.setattr("damperfit.cli.commands._is_terminal", lambda: True)
        monkeypatch.setattr("sys.stdin", io.StringIO("\n".join([*lines, ""])))
        return main(["init", *arguments])

    return run


def test_the_dialogue_shows_defaults_and_asks_again_after_a_wrong_answer(answered, folder, capsys):
    lines = ["monotub", "monotube", "32mm", "45 bananas", "45mm", "", "", "8bara", "", "1.4", ""]
    assert answered(*lines, arguments=["--set", "oil_density=860"]) == 0
    damper = tomllib.loads((folder / "my_damper.toml").read_text())["damper"]
    assert damper == {"model": "monotube", "rod_diameter": "32mm", "piston_diameter": "45mm"} | {
        "oil_density": 860.0, "gas_pressure": "8bara", "gas_exponent": 1.4,
    }  # fmt: skip
    said = capsys.readouterr().err
    for shown in (
        "model [purdy]: ", "no model 'monotub'. Did you mean 'monotube'?", "rod_diameter (d_r; ",
        "  piston_diameter: no unit of length 'bananas'",
    ):  # fmt: skip
        assert shown in said
    assert "oil_density" not in said  # it was given
