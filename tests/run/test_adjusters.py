"""`identify --procedure joint` with adjusters that are declared for another model."""

from pathlib import Path

import pytest

from damperfit.configuration.loading import load_configuration
from damperfit.errors import ConfigurationError
from damperfit.run.identify import identified


def test_what_the_model_does_not_have_is_refused_before_a_log_is_read(tmp_path: Path) -> None:
    path = tmp_path / "rig.toml"
    path.write_text('[adjusters]\nlow_speed = ["rebound.bleed"]\n', encoding="utf-8")
    joint = {"identification": {"procedure": "joint"}}
    with pytest.raises(ConfigurationError, match=r"rebound\.bleed: the model purdy has no such"):
        next(identified(load_configuration(path, overlay=joint), ["nowhere.csv"]))
    with pytest.raises(ConfigurationError, match=r"nowhere\.csv"):  # only a joint fit uses it
        next(identified(load_configuration(path), ["nowhere.csv"]))
