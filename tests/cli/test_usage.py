"""Wrong usage: code 2, one line that names what was typed, nothing on stdout, nothing touched."""

import re
import shlex

import pytest
import typer

from damperfit.cli.main import app
from damperfit.errors import DamperfitError

GIVEN = "--set r_m1=1.8e4 --set r_m2=3.527e6 --set r_m3=2.597e6 --set k_e=365MPa --set f_f=50N"
# What is typed -> what the line has, and the code of the problem where scripts may ask for it.
# LOG is a good log, RESULTS what was found of it.
USAGE = """
identify -> Missing argument
identify nope.csv -> nope.csv: no such file #no-such-file
identify 'nope*.csv' -> nope*.csv: the pattern matches no file
identify fol* -> matches only folders
identify folder -> no log in this folder
inspect @none.txt -> none.txt: no such file
inspect @empty.txt -> @empty.txt: the list names no log
inspect @list.txt -> list.txt:2: nowhere.csv: no such file
inspect @nested.txt -> nested.txt:1: a list in a list is not followed
identify '' -> found ''
identify LOG --frree r_m1 -> No such option: --frree
identify LOG --free r_m9 -> --free: no parameter 'r_m9' #unknown-quantity
identify LOG --free k_e --fix k_e=1e9 -> --free: k_e is both free and fixed
identify LOG --fix r_m1 -> --fix r_m1: expected NAME=VALUE
identify LOG --fix k_e=soft -> k_e = soft #not-a-number
identify LOG --fix r_m1=1e99 -> --fix: r_m1 = 1e+99 is fixed, far from
identify LOG --procedure papr -> Did you mean 'paper' #unknown-procedure
identify LOG --share r_m3 -> --share r_m3 has no effect
identify LOG --model auto --free r_m1,r_m2 -> --free has no effect
identify LOG --model bouc_wen --covariate temperature -> --covariate: nothing of the model
identify LOG --bulk-modulus appendix1 -> --bulk-modulus: appendix1
identify LOG --max-mse nan -> --max-mse
identify LOG --check nothing -> --check: no check 'nothing' #unknown-check
identify LOG --jobs 0 -> --jobs 0: expected 1 or more
identify LOG --starts 0 -> --starts: expected 1 or more
identify LOG --profile k_f -> no parameter 'k_f' to profile
identify LOG --profile f_f --fix f_f=50N -> f_f is both fixed and to be profiled
identify LOG --hold-out 'zzz*' -> --hold-out zzz*: matches no log #no-such-file
identify LOG --hold-out '*' -> every log is held out
identify LOG --hold-out 20Hz- -> no log has a segment
identify LOG --hold-out 4Hz-2Hz -> the upper limit lies below
identify LOG --setting '?' -> --setting ?: expected clicks
identify LOG --setting 0 -> --setting 0: setting_01.csv says setting 1 #other-setting
identify LOG --rig-profile lab -> --rig-profile: no profile 'lab'
identify LOG --github-summary -> GITHUB_STEP_SUMMARY is not set
identify LOG --config nope.toml -> --config nope.toml: no such file #unreadable
identify LOG --config bad.toml -> --config bad.toml:2: rig.skew #out-of-range
identify LOG --config unknown.toml -> --config unknown.toml:2: unknown #unknown-key
identify LOG --rig skip_lines=a -> --rig skip_lines #wrong-value
identify LOG --rig max_log_bytes=0 -> --rig max_log_bytes: expected more than 0
identify LOG --rig profiles.lab.encoding=no -> --rig profiles.lab.encoding: 'no' is not #wrong-value
identify LOG --skew=-100 -> 'auto' or -0.1 or more; a bare number is in s #out-of-range
identify LOG --tests nope.csv -> --tests nope.csv: no such file #bad-table-of-tests
identify LOG --out '' -> --out: found ''
identify LOG --out text -> --out text: cannot be written: text is not a folder #not-a-folder
identify LOG --out s3://bucket/x -> s3://bucket/x #no-address
identify LOG --start '' -> expected a file or NAME=VALUE
identify LOG --start k_e=1e9,K_e=2e9 -> --start k_e=2e9: k_e is given twice
identify LOG --start a --start b -> --start b: a is given already
identify LOG --start k_e=1e99 -> far from any damper's #implausible
identify LOG --start f_0=5 -> --start: f_0 is given a start but is not
identify LOG --model twin_tube --free k_e -> --free k_e leaves rebound_bleed
inspect LOG --log-file folder -> --log-file folder: cannot be written
models LOG --start rebound_openning=5bar -> Did you mean 'rebound_opening'?
fleet LOG --out text/x -> --out text/x: cannot be written: text is not a folder
fleet -> expected LOGS, or --collect
fleet x --jobs 2 --scheduler tcp://a:1 -> --jobs cannot be combined with --scheduler
fleet x --part 3/2 -> expected I/N
fleet --collect --out nowhere -> no parts of a fleet there
fleet ftp://host/x -> no such store
simulate -> give --setting N
simulate --set r_m1=1e4 -> no parameters for r_m2
simulate --setting 21 -> setting 21
simulate --setting 1 --set ke=1 -> Did you mean 'k_e'
simulate --setting 1 --set k_e=500barg -> k_e = 500barg: expected a number in Pa
simulate --setting 1 --set f_f=1 --set f_f=2 -> f_f is given twice
simulate --setting 1 --amplitude 200mm -> beyond the damper's travel
simulate --setting 1 --cycles 0.5 -> --cycles: expected 1 or more
simulate --setting 1 --out x.xlsx -> --out x.xlsx
simulate --setting 1 --parameters folder -> parameters.parquet is missing
simulate --setting 1 --displacement LOG --wave sine -> cannot be combined with --displacement
simulate GIVEN --parameters LOG -> nothing is taken from it
sweep --setting 1 -> nothing to vary
samples runs --seed -1 -> --seed -1: expected 0 or more #out-of-range
samples runs --settings 2 --parameters RESULTS --model monotube -> leave --model out
settings RESULTS --force 900N -> Give --velocity too
settings RESULTS --velocity 0.1 --velocity 0.2 -> --velocity 0.2: given already #given-twice
settings RESULTS --velocity 0 -> other than zero
settings RESULTS --velocity 0.2 --stroke jounce -> expected rebound or compression
settings RESULTS --force 900kg --velocity 0.2 -> no unit of force
settings RESULTS --rig units.force=N -> --rig units.force=N has no effect
settings curves.csv --velocity 0.5m/s -> no curve of curves.csv has points on both sides
settings curves.csv RESULTS -> expected one results folder, or files of measured curves alone
compare nope RESULTS -> nope: no such file or folder
compare folder RESULTS -> holds any; expected run.json #no-results
compare RESULTS -> one run alone has nothing to be compared with
compare RESULTS LOG -> to compare logs and files of curves
compare RESULTS RESULTS --amplitude 20mm -> give both or neither
compare RESULTS RESULTS --repeats RESULTS -> give further runs
compare RESULTS RESULTS --junit j.xml -> --junit
compare RESULTS RESULTS --measured --amplitude 9mm --frequency 1 -> combined with --measured
compare later.json RESULTS -> this damperfit knows 1
export RESULTS -> no target: give --to
export RESULTS --to csw -> --to csw: expected one of
export RESULTS --to csv --out front.dpr -> csv writes .csv files
export RESULTS --to adams --units lbf -> --units lbf: adams has units and marks of its own
export RESULTS --to modelica --extend 0.5m/s -> modelica holds no table here
export RESULTS --to carsim --extend 0.1m/s -> expected a speed above the tested
report nope -> nope #no-folder
init --set rod_diamter=12mm -> unknown key 'rod_diamter' in [damper]
init --set gas_pressure=1bar -> is it absolute, or
init --model auto -> let the logs choose
init --out text -> give --overwrite
help glosary -> Did you mean 'glossary'?
config surplus -> unexpected argument surplus #unexpected-argument
sweep --setting 5 --vary x=1 -> --vary x=1 #unknown-name
advise RESULTS -> --for
advise RESULTS --for force@fast -> fast
advise RESULTS --for law -> --model auto
advise RESULTS --for k_e --minutes 0 -> --minutes
advise RESULTS --for k_e --max-stroke -5mm -> --max-stroke
advise RESULTS --for k_e --max-force -1N -> --max-force
valves RESULTS --cd 0 -> --cd
valves RESULTS --cd 7 -> --cd
valves RESULTS --cd-spread 0.8 -> --cd-spread
valves RESULTS --force 400N -> --velocity
watch folder --out folder -> --out
watch nowhere -> no such folder
ride RESULTS --car nowhere.toml -> nowhere.toml
""".strip().splitlines()
FILES = {
    "text": "zzz\n",
    "empty.txt": "# nothing\n",
    "list.txt": "# x\nnowhere.csv\n",
    "nested.txt": "@list.txt\n",
    "bad.toml": "[rig]\nskew = 3\n",
    "unknown.toml": "[rig]\nskeww = 3\n",
    "curves.csv": "speed_m/s,Rebound (N)\n0.1,200\n0.2,300\n0.3,400\n",
    "later.json": '{"damperfit_baseline": 99, "version": "9.9"}',
}


@pytest.fixture
def refused(run, logs, results, tmp_path, monkeypatch):
    """Run a command that is refused among files that stay: its line, and the code."""
    caught, call = [], type(app).__call__

    def noted(*arguments, **how):
        try:
            return call(*arguments, **how)
        except DamperfitError as error:
            caught.append(error.problem.code)
            raise

    monkeypatch.setattr(type(app), "__call__", noted)  # the manual keeps the app that it finds
    monkeypatch.delenv("GITHUB_STEP_SUMMARY", raising=False)
    (tmp_path / "folder").mkdir()
    for name, content in FILES.items():
        (tmp_path / name).write_text(content)
    given = {"LOG": str(logs / "setting_01.csv"), "RESULTS": str(results)}

    def ended_with(words: str) -> tuple[str, list[str]]:
        argv = shlex.split(words.replace("GIVEN", GIVEN))
        ended = run(*(given.get(word, word) for word in argv))
        assert (ended.code, ended.out) == (2, ""), ended.err
        (line,) = ended.err.splitlines()
        assert {path.name for path in tmp_path.iterdir()} == {*FILES, "folder"}
        assert (tmp_path / "text").read_text() == FILES["text"]
        return line, caught

    return ended_with


@pytest.mark.one_in(2)
@pytest.mark.parametrize("row", USAGE, ids=lambda row: row.partition(" -> ")[0])
def test_wrong_usage(refused, row) -> None:
    words, says, code = re.fullmatch(r"(.*) -> (.*?)(?: #([\w-]+))?", row).groups()
    line, codes = refused(words)
    assert says in line
    assert code is None or codes == [code]


# A value that no option takes is refused by the option that was typed, with what was found.

BAD = "§"
COMMANDS = typer.main.get_command(app).commands  # built anew at each call
# What each command needs besides; no log is read and nothing is fitted before its options are.
BESIDE = {
    **dict.fromkeys(("identify", "inspect", "models"), "LOG"),
    **dict.fromkeys(("valves", "passport", "ride", "report"), "RESULTS"),
    **dict.fromkeys(("samples", "watch"), "runs"),
    "fleet": "LOG --out fleet",
    "simulate": "--setting 10",
    "sweep": "--setting 10 --vary r_m1=1,2",
    "advise": "RESULTS --for k_e",
    "export": "RESULTS --to csv",
    "compare": "RESULTS RESULTS",
    "settings": "RESULTS --velocity 0.1m/s",
}
# Two of them make a motion together.
TOGETHER = {"compare --amplitude": "--frequency 1Hz", "compare --frequency": "--amplitude 9mm"}
# Any text is a file's name there, or a word that names something.
WORDS = {"--out", "--log-file", "--plot", "--save", "--junit", "--config", "--tests", "--help"}
WORDS |= {"--parameters", "--displacement", "--repeats", "--hold-out"}


@pytest.mark.one_in(2)
@pytest.mark.parametrize(
    "typed",
    [
        # Dask is not everywhere.
        pytest.param(f"{name} {word}", marks=[pytest.mark.extras] * (word == "--scheduler"))
        for name, command in COMMANDS.items()
        for one in command.params
        for word in [text for text in one.opts if text.startswith("--")][:1]
        if one.param_type_name == "option" and not one.is_flag and word not in WORDS
    ],
)
def test_a_value_that_cannot_be_is_refused_by_its_option(refused, typed) -> None:
    command, option = typed.split()
    line, _ = refused(
        f"{command} {BESIDE.get(command, '')} {TOGETHER.get(typed, '')} {option}={BAD}"
    )
    assert option in line
    assert BAD in line
