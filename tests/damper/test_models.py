"""Models by their names: each is found where it is said to be, and none is loaded in vain."""

from __future__ import annotations

import subprocess
import sys

import pytest

from damperfit.damper.model import MODELS
from damperfit.damper.rivals import RIVALS


@pytest.mark.parametrize("name", MODELS)
def test_a_model_is_called_as_it_says(name: str) -> None:
    assert MODELS[name].name == name


def test_every_rival_is_among_the_models() -> None:
    assert len(MODELS) == len(set(MODELS))
    assert tuple(MODELS.values())[-len(RIVALS) :] == RIVALS


def test_there_is_no_model_of_another_name() -> None:
    assert "auto" not in MODELS
    assert 3 not in MODELS
    assert MODELS.get("auto") is None
    with pytest.raises(KeyError, match="auto"):
        MODELS["auto"]


def test_one_model_loads_no_other() -> None:
    script = (
        "import sys; from damperfit.damper.model import MODELS; MODELS['purdy']; "
        "print(len(MODELS), *sys.modules)"
    )
    done = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=True
    )
    n_models, *loaded = done.stdout.split()
    assert int(n_models) == len(MODELS)
    assert "damperfit.damper.purdy.parameters" in loaded
    others = {"damperfit.damper.rivals", "damperfit.damper.valve_dampers"}
    assert others.isdisjoint(loaded)
