"""The configuration as a JSON schema: editors complete and check TOML files with it."""

from __future__ import annotations

from typing import Any

from damperfit.configuration.damper_section import damper_defaults
from damperfit.configuration.drawings import MEASURED
from damperfit.configuration.schema import document_model
from damperfit.configuration.sections import SECTIONS
from damperfit.damper.model import MODELS

__all__ = ["configuration_schema"]

_TYPES = {bool: "boolean", dict: "object", list: "array"}


def configuration_schema() -> dict[str, Any]:
    """Return the JSON schema (draft 2020-12) of a configuration file."""
    schema = document_model().model_json_schema()
    sections = schema["$defs"]
    for section in (schema, *sections.values()):
        section.pop("required", None)  # a file needs only what differs
        for key in section["properties"].values():
            key.pop("title", None)
    schema["properties"]["damper"] = _damper()
    named = {"$schema": "https://json-schema.org/draft/2020-12/schema", "title": "damperfit"}
    return {**schema, **named}


def _damper() -> dict[str, Any]:
    """[damper] has the keys of any model; which of them go together is the model's to say."""
    keys: dict[str, Any] = {}
    for model in MODELS:
        for name, value in damper_defaults(model).items():
            _add(keys, name, value)
    for name, entry in SECTIONS["damper"].entries().items():
        keys[name]["description"] = entry.about
    keys["model"]["enum"] = [*MODELS]
    return {"type": "object", "properties": keys, "additionalProperties": False}


def _add(keys: dict[str, Any], name: str, value: Any) -> None:
    """Add a key with the type of its default; a section inside has its own keys."""
    known = keys.setdefault(name, {"type": _TYPES.get(type(value), ["number", "string"])})
    if name in MEASURED:
        known["description"] = MEASURED[name]
    if isinstance(value, dict):
        inner = known.setdefault("properties", {})
        for key, one in value.items():
            _add(inner, key, one)
