"""Damper.mo: what it says, its table for other models, and a Modelica compiler."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from damperfit.damper.model import MODELS
from damperfit.exporting import TARGETS
from damperfit.exporting.check import check_export
from damperfit.exporting.tables import force_tables
from damperfit.results import Run, SettingResult
from damperfit.simulation import simulate, sine_motion
from damperfit.tables.reading import LogSignals
from damperfit.tested.setting import Setting
from tests.exporting.units import exported
from tests.test_every_model import truth_of


def text_of(handed) -> str:
    return TARGETS["modelica"].export(handed).files["damper.mo"].decode()


def logged(handed, force_of):
    """The run with a log of each setting, whose force is given."""
    motion = sine_motion(0.03, 1.5, cycles=3, sample_rate=1000.0)
    time = np.arange(len(motion.displacement)) * motion.interval
    signals = [
        LogSignals(
            one.setting, "log", time, motion.displacement, motion.velocity, force, force,
            np.zeros((3, len(time))),
        )
        for one in handed.settings
        for force in [force_of(one, motion)]
    ]  # fmt: skip
    rows = {"parameters": handed.run.rows("parameters")}
    run = Run(handed.run.record, rows, signals=signals, quantities=handed.run.quantities)
    return replace(handed, run=run)


def test_the_equations_of_the_file_give_the_force_of_the_core(handed) -> None:
    source = logged(handed, lambda one, motion: simulate(one.values, handed.damper, motion).force)
    for check in check_export(source, TARGETS["modelica"].export(source)):
        assert check.mse_percent < 0.05, check  # what the filter of the check takes off a jump


def test_another_model_gives_its_table_and_its_force_at_rest(handed) -> None:
    model = MODELS["monotube"](gas_pressure=2.5e6)
    values = truth_of(model)
    settings = tuple(SettingResult(Setting.of(k), values.replace(f_f=50.0 * k)) for k in (1, 2))
    source = replace(handed, damper=model, settings=settings)
    head = text_of(source).partition("parameter ")[0]
    assert "the table" in head
    assert "Purdy" not in head
    tables = {table.setting: table for table in force_tables(source, common=True)}

    def looked_up(one, motion):
        table = tables[one.setting]
        force = np.interp(motion.velocity, table.speeds, table.forces) + table.tare
        return force + model.rest_force(motion.displacement)

    source = logged(source, looked_up)
    for check in check_export(source, TARGETS["modelica"].export(source)):
        assert check.mse_percent < 0.05, check
        assert check.n_samples > 1000


def test_friction_has_a_wide_band_and_the_paper_is_named_without_a_table(handed) -> None:
    head, _, rest = text_of(handed).partition("parameter ")
    assert "law: D. J. Purdy" in head
    assert not re.search("table|beyond|lost", head)
    assert 'friction_band(unit = "m/s") = 0.005' in rest


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
