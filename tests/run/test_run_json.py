"""What run.json holds of settings: whole clicks as numbers, labels as text."""

from __future__ import annotations

from damperfit.tables.documents import json_values
from damperfit.tested.setting import Setting, parse_setting


def test_settings_are_numbers_or_labels() -> None:
    label = parse_setting("R12 C08", ("rebound", "compression"))
    told = json_values({"a": Setting.of(10), "b": [Setting.of("soft")], "c": label})
    assert told == {"a": 10, "b": ["soft"], "c": "R12 C8"}
    assert type(told["a"]) is int
