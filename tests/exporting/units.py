"""Dampers whose FMUs are tested, two settings each, what drives them, and what is expected."""

import sys
from dataclasses import replace

import numpy as np
import pytest

from damperfit.damper.mounting import Friction, Mounting
from damperfit.damper.purdy.parameters import PURDY_DAMPER, reference_parameters
from damperfit.damper.valve_dampers import (
    DeclaredNetwork,
    DeclaredPassage,
    Monotube,
    ThroughFlow,
    TwinTube,
)
from damperfit.settings_and_logs import SettingResult
from damperfit.simulation import Motion, SolverOptions, simulate
from damperfit.tested.setting import Setting

BAND = 0.005
SOFT = {
    "rebound_bleed": 5e4, "rebound_opening": 4.5e5, "rebound_slope": 5e6,
    "compression_bleed": 6e4, "compression_opening": 3e5, "compression_slope": 4e6,
    "f_f": 30.0, "f_0": 7.0, "k_e": 9e8,
}  # fmt: skip
STIFF = SOFT | {"rebound_bleed": 9e4, "rebound_opening": 9e5, "k_e": 1.2e9}
# Friction that remembers, is larger at rest and is pressed: what a seal may do beyond Coulomb's.
SEALS = {
    "presliding": 1e-4, "breakaway": 25.0, "stribeck_speed": 0.02, "seal_area": 8e-6,
    "free_gas": 2e-3,
}  # fmt: skip
RIGID = Mounting("none", "none", "none")
# No preset: a stack that lifts further in rebound, a leak about the piston, a base with a port.
PASSAGES = (
    DeclaredPassage(1, 2, "piston", "orifice", is_two_way=True),
    DeclaredPassage(1, 2, "low", "power"),
    DeclaredPassage(2, 1, "intake", "check"),
    DeclaredPassage(1, 2, "ring", "leak", is_two_way=True),
    DeclaredPassage(2, 3, "base", "orifice", is_two_way=True),
    DeclaredPassage(2, 3, "base", "port"),
    DeclaredPassage(3, 2, "foot", "check"),
)
DECLARED = {
    "piston_bleed": 9e4, "low_opening": 4e5, "low_slope": 6e6, "low_power": 1.3,
    "intake_slope": 3e5,
    "ring_leak": 3e7, "base_bleed": 6e4, "base_opening": 9e5, "base_slope": 9e6, "base_port": 4e4,
    "foot_slope": 2e5, "f_f": 15.0, "f_0": 4.0, "k_e": 9e8,
}  # fmt: skip
FIRM = DECLARED | {"piston_bleed": 1.5e5, "low_opening": 8e5, "base_bleed": 9e4}
GRIP = {"presliding": 1e-4}
# By name: the damper, and its values at settings 1 and 2.
CASES = {
    "paper": (PURDY_DAMPER, *(reference_parameters(n) for n in (1, 20))),
    **{
        name: (damper, *(damper.values(one) for one in known))
        for name, damper, known in (
            ("twin_tube", TwinTube(mounting=RIGID), (SOFT, STIFF)),
            ("monotube", Monotube(gas_pressure=2e6, mounting=RIGID), (SOFT, STIFF)),
            ("through_flow", ThroughFlow(mounting=RIGID), (SOFT, STIFF)),
            (
                "seals",
                TwinTube(mounting=RIGID, friction=Friction("fit", "fit", "fit", "fit")),
                (SOFT | SEALS, STIFF | SEALS),
            ),
            (
                "grip",
                Monotube(gas_pressure=2e6, mounting=RIGID, friction=Friction("fit")),
                (SOFT | GRIP, STIFF | GRIP),
            ),
            (
                "declared",
                DeclaredNetwork(gas_pressure=5e5, mounting=RIGID, passages=PASSAGES),
                (DECLARED, FIRM),
            ),
        )
    },
}
STATES = {
    "paper": ["oil_1", "oil_2", "outside"],
    "twin_tube": ["oil_1", "oil_2", "outside"],
    "monotube": ["oil_1", "outside"],
    "through_flow": ["oil_1", "oil_2", "outside"],
    "seals": ["oil_1", "oil_2", "outside", "grip"],
    "grip": ["oil_1", "outside", "grip"],
    "declared": ["oil_1", "oil_2", "outside"],
}

runs_here = pytest.mark.skipif(
    sys.platform != "linux", reason="the little importer loads the library of Linux"
)


def exported(handed, name):
    """A run of this damper."""
    damper, *both = CASES[name]
    settings = tuple(SettingResult(Setting.of(n), one) for n, one in enumerate(both, 1))
    return replace(handed, damper=damper, settings=settings)


def sine(duration=1.0, interval=1e-3, amplitude=0.032):
    t = np.arange(round(duration / interval) + 1) * interval
    w = 2.0 * np.pi * 1.5
    return amplitude * np.sin(w * t), amplitude * w * np.cos(w * t)


def road(duration=1.0, interval=1e-3):
    """Content from 0.5 to 25 Hz, 0.15 m/s rms."""
    t = np.arange(round(duration / interval) + 1) * interval
    noise = np.random.default_rng(3)
    f = np.linspace(0.5, 25.0, 80)[:, None]
    phase = noise.uniform(0.0, 2.0 * np.pi, f.shape)
    v = (np.cos(2.0 * np.pi * f * t + phase) / f).sum(axis=0)
    x = (np.sin(2.0 * np.pi * f * t + phase) / (2.0 * np.pi * f**2)).sum(axis=0)
    scale = 0.15 / np.sqrt((0.5 / f**2).sum())
    return scale * x, scale * v


def core(name, setting, x, v, interval=1e-4, **changed):
    """The force by the core that fits, without tare."""
    damper, *both = CASES[name]
    values = both[setting - 1].replace({"f_0": 0.0} | changed)
    options = SolverOptions(tolerance=3e-4, dead_band=BAND)
    return simulate(values, damper, Motion(interval, x, v), options=options).force


def rms(error) -> float:
    return float(np.sqrt(np.mean(error[len(error) // 10 :] ** 2)))


def with_friction_error(handed, square):
    """The run whose friction is known up to its root, as a share; nothing else has an error."""
    known = {"own": ("f_f",), "shared": (), "covariance": np.array([[square]])}
    return replace(handed, settings=tuple(replace(one, **known) for one in handed.settings))
