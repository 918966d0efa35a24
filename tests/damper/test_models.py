"""Models by their names: each is found where it is said to be, and none is loaded in vain."""

from __future__ import annotations

import subprocess
import sys

import pytest

from damperfit.damper.model import MODELS


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
