"""Damper.mo: its equations solved as they stand in the file, and by a Modelica compiler."""

from __future__ import annotations

import math
import re
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from damperfit.damper.models import MODELS
from damperfit.exporting import TARGETS, ExportOptions
from damperfit.exporting.tables import force_tables
from damperfit.results import SettingResult
from damperfit.simulation import simulate, sine_motion
from damperfit.tested.setting import Setting
from tests.exporting.units import exported
from tests.test_every_model import truth_of

AMPLITUDE, FREQUENCY = 0.032, 1.5
OMEGA = 2 * math.pi * FREQUENCY


def text_of(handed) -> str:
    return TARGETS["modelica"].export(handed, ExportOptions()).files["damper.mo"].decode()


def narrowed(text: str) -> str:
    """With the narrow friction band of the core, so that reversals agree."""
    return text.replace('friction_band(unit = "m/s") = 0.005', "friction_band = 0.0001")


class Read:
    """Parameters and equations of a model, each an assignment in the order that it needs."""

    def __init__(self, text: str) -> None:
        flat = " ".join(re.sub(r"//[^\n]*|\"[^\"]*\"", "", text).split())
        head, body = flat.rsplit(" equation ", 1)
        self.known = {
            name: self._number(value)
            for name, value in re.findall(
                r"parameter (?:Real|Integer) (\w+)(?:\[[^\]]*\])?(?:\([^)]*\))? = ([^;]+);", head
            )
        }
        self.steps = [
            (re.sub(r"\W", "_", left.strip()), compile(self._python(right), "damper.mo", "eval"))
            for left, right in re.findall(r"([^;=]+) = ([^;]+);", body)
        ]

    @staticmethod
    def _python(expression: str) -> str:
        return re.sub(
            r"(\w+)\[([^\]]+)\]",
            lambda one: one[1] + "".join(f"[{k} - 1]" for k in one[2].split(",")),
            expression.replace("^", "**").strip(),
        )

    @staticmethod
    def _number(value: str):
        if "{" not in value:
            return float(value)
        return eval(value.replace("{", "[").replace("}", "]"), {})  # noqa: S307 - our own

    def at(self, setting: int, s: float, v: float, **states: float) -> dict[str, float]:
        names = {"max": max, "min": min, "s_rel": s, "v_rel": v, **self.known, **states}
        names["setting"] = setting
        for name, code in self.steps:
            names[name] = eval(code, names)  # noqa: S307 - our own
        return names


@pytest.fixture(scope="module")
def motion():
    return sine_motion(AMPLITUDE, FREQUENCY, cycles=2, sample_rate=400 * FREQUENCY)


@pytest.mark.parametrize(("place", "label"), [(1, 1), (3, 20)])
def test_the_equations_of_the_file_give_the_force_of_the_core(handed, motion, place, label) -> None:
    read = Read(narrowed(text_of(handed)))
    one = next(s for s in handed.settings if s.setting == Setting.of(label))

    def drive(t):
        return AMPLITUDE * math.sin(OMEGA * t), AMPLITUDE * OMEGA * math.cos(OMEGA * t)

    def rates(t, masses):
        now = read.at(place, *drive(t), m_1=masses[0], m_2=masses[1])
        return now["der_m_1_"], now["der_m_2_"]

    known = read.known
    start = [known["rho"] * known[f"A_{k}"] * known[f"l_{k}"] for k in (1, 2)]
    time = np.arange(len(motion.displacement)) * motion.interval
    half = time >= time[-1] - 1.0 / FREQUENCY
    solved = solve_ivp(
        rates, (0.0, time[-1]), start, method="Radau", t_eval=time[half], rtol=1e-7, max_step=5e-3
    )
    told = np.array(
        [
            read.at(place, *drive(t), m_1=a, m_2=b)["f"]
            for t, a, b in zip(solved.t, *solved.y, strict=True)
        ]
    )
    force = simulate(one.values, handed.damper, motion).force[half]
    assert float(np.sqrt(np.mean((told - force) ** 2))) < 0.1


def test_the_friction_band_is_wide_unless_it_is_narrowed(handed) -> None:
    read = Read(text_of(handed))
    assert read.known["friction_band"] == 0.005
    masses = {"m_1": 0.0363, "m_2": 0.0653}
    full, half = (read.at(1, 0.0, v, **masses)["f"] for v in (0.005, 0.0025))
    assert full - half == pytest.approx(0.5 * read.known["f_f"][0])


def test_equations_name_their_paper_and_nothing_of_a_table(handed) -> None:
    head = text_of(handed).partition("parameter ")[0]
    assert "law: D. J. Purdy" in head
    assert not re.search("table|beyond|lost", head)


def test_another_model_gives_its_table_and_its_force_at_rest(handed) -> None:
    model = MODELS["monotube"](gas_pressure=2.5e6)
    values = truth_of(model)
    settings = tuple(SettingResult(Setting.of(k), values.replace(f_f=50.0 * k)) for k in (1, 2))
    mine = replace(handed, damper=model, settings=settings)
    read, head = Read(text_of(mine)), text_of(mine).partition("parameter ")[0]
    assert "the table" in head
    assert "Purdy" not in head
    for place, table in enumerate(force_tables(mine, common=True), 1):
        for k in range(0, len(table.speeds), 7):
            now = read.at(place, 0.01, float(table.speeds[k]))
            assert now["damping"] == pytest.approx(float(table.forces[k]), abs=0.01)
        gas = float(model.rest_force(0.01))
        assert now["gas"] == pytest.approx(gas, rel=1e-3)
        assert now["f"] == pytest.approx(now["damping"] + now["gas"])


@pytest.mark.proof
@pytest.mark.parametrize("name", ["paper", "twin_tube"])
def test_a_modelica_compiler_flattens_it(handed, name) -> None:
    import casadi

    for kind in (casadi.MX, casadi.SX, casadi.DM):
        if not hasattr(kind, "__div__"):  # pymoca still asks for the name of Python 2
            kind.__div__ = kind.__truediv__
    from pymoca import parser
    from pymoca.backends.casadi.generator import generate

    flat = generate(parser.parse(text_of(exported(handed, name))), "Damper")
    states = [str(one.symbol.name()) for one in flat.states]
    assert states == (["m_1", "m_2"] if name == "paper" else [])
    assert [str(one.symbol.name()) for one in flat.inputs] == ["s_rel", "v_rel"]
    inner = [one for one in flat.alg_states if str(one.symbol.name()) != "f"]
    assert len(flat.equations) == len(states) + len(inner) + 1
