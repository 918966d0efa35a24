"""A Modelica model without any library: the paper's physics where that is the law, else the table.

Inputs are relative displacement and velocity, the output the force, all positive in rebound: as in
``PartialCompliantWithRelativeStates`` (s_rel, v_rel and f, positive in tension), which a connection
to masses and springs extends. Parameters of all settings stand in arrays; ``setting`` counts them.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import numpy as np

from damperfit.damper.purdy.parameters import Damper
from damperfit.exporting.header import commented, gas_line, header_lines, interval_lines

if TYPE_CHECKING:
    from collections.abc import Sequence

    from damperfit.exporting.source import ExportedRun
    from damperfit.exporting.tables import ForceTable
    from damperfit.exporting.targets import ExportOptions

__all__ = ["modelica"]

_SIGN = "s_rel in m, v_rel in m/s and f in N are positive in rebound (tension)"
_BAND = 0.005  # m/s: a narrower friction band makes a car at rest chatter at steps of 1 ms
_OWN = ("r_m1", "r_m2", "r_m3", "k_e", "f_f")


def modelica(run: ExportedRun, tables: Sequence[ForceTable], options: ExportOptions) -> str:
    """Return one model with all settings."""
    name = _identifier(options.stem)
    if isinstance(run.damper, Damper):
        gas = "in f, of the gas law with P_0, V_g0 and gamma"
        lines = list(header_lines(run, tables, sign=_SIGN, gas=gas, has_table=False))
        lines.append("law: D. J. Purdy, Proc. IMechE D, 2000, with its two state equations")
        body = _physics(run, run.damper)
    else:
        gas = gas_line(tables[0], place="added as gas")
        lines = list(header_lines(run, tables, sign=_SIGN, gas=gas))
        for k, table in enumerate(tables, 1):
            lines += [f"setting {k}", *interval_lines(table)]
        body = _table(tables)
    which = ", ".join(f"{k}: {_plain(str(t.setting))}" for k, t in enumerate(tables, 1))
    return (
        f'model {name} "Damper identified by damperfit"\n{commented(lines, "  //")}'
        f'  parameter Integer setting = 1 "{which}";\n{body}end {name};\n'
    )


def _physics(run: ExportedRun, damper: Damper) -> str:
    values = [one.values for one in run.settings]
    at_rest = [
        damper.oil_density * volume for volume in (damper.chamber_1_volume, damper.chamber_2_volume)
    ]
    arrays = "".join(
        f"  parameter Real {name}[{len(values)}] = {_row([getattr(v, name) for v in values])} "
        f'"{_plain(values[0].quantity(name).meaning)}, {values[0].quantity(name).unit}";\n'
        for name in _OWN
    )
    return (
        arrays
        + f"""\
  parameter Real A_1(unit = "m2") = {damper.annulus_area:.12g} "annulus";
  parameter Real A_2(unit = "m2") = {damper.piston_area:.12g} "full bore";
  parameter Real l_1(unit = "m") = {damper.chamber_1_length:.12g};
  parameter Real l_2(unit = "m") = {damper.chamber_2_length:.12g};
  parameter Real V_g0(unit = "m3") = {damper.gas_volume:.12g} "gas at s_rel = 0";
  parameter Real P_0(unit = "Pa") = {damper.gas_pressure:.12g} "gas pressure at s_rel = 0";
  parameter Real P_amb(unit = "Pa") = {damper.ambient_pressure:.12g} "air, on the rod";
  parameter Real gamma = {damper.gas_exponent:.12g} "gas exponent";
  parameter Real rho(unit = "kg/m3") = {damper.oil_density:.12g} "oil";
  parameter Real friction_band(unit = "m/s") = {_BAND:g} "friction grows to f_f over it";
  input Real s_rel(unit = "m") "displacement, positive in rebound";
  input Real v_rel(unit = "m/s") "its derivative";
  output Real f(unit = "N") "force, positive in rebound";
  Real m_1(unit = "kg", start = {at_rest[0]:.12g});
  Real m_2(unit = "kg", start = {at_rest[1]:.12g});
  Real V_1(unit = "m3");
  Real V_2(unit = "m3");
  Real V_g(unit = "m3");
  Real P_1(unit = "Pa");
  Real P_2(unit = "Pa");
  Real P_3(unit = "Pa");
  Real w_1(unit = "kg/s");
  Real w_2(unit = "kg/s");
  Real w_3(unit = "kg/s");
initial equation
  m_1 = rho*V_1;
  m_2 = rho*V_2;
equation
  V_1 = A_1*(l_1 - s_rel);
  V_2 = A_2*(l_2 + s_rel);
  V_g = V_g0 - (A_1*l_1 + A_2*l_2 - (m_1 + m_2)/rho);
  P_1 = max(0, k_e[setting]*(m_1/(rho*V_1) - 1) + P_0);
  P_2 = max(0, k_e[setting]*(m_2/(rho*V_2) - 1) + P_0);
  P_3 = P_0*(V_g0/V_g)^gamma;
  w_1 = (P_1 - P_3)/((P_1 - P_3)^2 + 1)^0.25/r_m1[setting];
  w_2 = max(0, P_2 - P_1)/r_m2[setting];
  w_3 = max(0, P_3 - P_2)/r_m3[setting];
  der(m_1) = w_2 - w_1;
  der(m_2) = w_3 - w_2;
  f = P_1*A_1 - P_2*A_2 + P_amb*(A_2 - A_1) + f_f[setting]*max(-1, min(1, v_rel/friction_band));
"""
    )


def _table(tables: Sequence[ForceTable]) -> str:
    """Straight lines between the points, as a sum of bends, which needs no library and no loop."""
    speeds = tables[0].speeds
    n = len(speeds)
    bends, firsts = [], []
    for table in tables:
        slopes = np.diff(table.forces) / np.diff(speeds)
        firsts.append(float(table.forces[0]))
        bends.append([float(slopes[0]), *np.diff(slopes).tolist()])
    terms = " +\n    ".join(f"bend[setting, {k}]*max(0, v_rel - speed[{k}])" for k in range(2, n))
    x, gas = tables[0].gas_displacements, tables[0].gas_forces
    fit = np.polyfit(x, gas, min(3, len(x) - 1))[::-1]
    press = " + ".join(f"({c:.9g})*s_rel^{k}" if k else f"({c:.9g})" for k, c in enumerate(fit))
    return f"""\
  parameter Real speed[{n - 1}](each unit = "m/s") = {_row(speeds[:-1].tolist())};
  parameter Real first[{len(tables)}](each unit = "N") = {_row(firsts)};
  parameter Real bend[{len(tables)}, {n - 1}](each unit = "N.s/m") =
    {{{("," + chr(10) + "     ").join(map(_row, bends))}}};
  input Real s_rel(unit = "m") "displacement, positive in rebound";
  input Real v_rel(unit = "m/s") "its derivative";
  output Real f(unit = "N") "force, positive in rebound";
  Real damping(unit = "N") "table, without gas";
  Real gas(unit = "N") "force at rest";
equation
  damping = first[setting] + bend[setting, 1]*(v_rel - speed[1]) +
    {terms};
  gas = {press};
  f = damping + gas;
"""


def _row(numbers: Sequence[float]) -> str:
    return "{" + ", ".join(f"{float(one):.12g}" for one in numbers) + "}"


def _identifier(stem: str) -> str:
    word = re.sub(r"\W", "_", stem, flags=re.ASCII).strip("_") or "damper"
    word = word if word[0].isalpha() else f"D_{word}"
    return word[0].upper() + word[1:]


def _plain(text: str) -> str:
    """Return text that ends no string."""
    return text.replace("\\", "/").replace('"', "'")
