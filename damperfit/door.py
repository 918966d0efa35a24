"""The names of a package, looked up in its modules when they are first used."""

from collections.abc import Callable
from importlib import import_module
from typing import Any


def door(package: str, *modules: str) -> Callable[[str], Any]:
    """Return the `__getattr__` of a package: what one of its modules has, the first that does."""

    def looked_up(name: str) -> Any:
        if name not in modules and not name.startswith("_"):
            for module in modules:
                known = vars(import_module(f"{package}.{module}"))
                if name in known:
                    return known[name]
        raise AttributeError(f"module {package!r} has no attribute {name!r}")

    return looked_up
