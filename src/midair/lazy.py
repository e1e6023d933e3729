"""Packages whose public names are imported on first use, so that a command loads only what it needs."""

import re
import sys
from collections.abc import Callable
from difflib import get_close_matches
from functools import cache
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any


def lazy_names(package: str) -> tuple[Callable[[str], Any], Callable[[], list[str]]]:
    """Return `__getattr__` and `__dir__` of a package, which import each of its public names on first use.

    The names are those that its `__init__` imports for the type checker, each as ``from .module import Name as Name``.
    """

    @cache
    def modules() -> dict[str, str]:
        text = Path(str(sys.modules[package].__file__)).read_text(encoding="utf-8")
        found = re.findall(r"^    from (\S+) import (\w+) as \2$", text, re.MULTILINE)
        return {name: f"{package}.{name}" if module == package else module for module, name in found}

    def get(name: str) -> Any:
        if name == "__all__":
            return sorted(modules())
        if name not in modules():
            near = (f"; did you mean {each}?" for each in get_close_matches(name, modules(), n=1))
            raise AttributeError(f"module {package!r} has no attribute {name!r}{''.join(near)}", name=name)
        module = import_module(modules()[name], package)
        value = module if module.__name__ == f"{package}.{name}" else getattr(module, name)
        setattr(sys.modules[package], name, value)
        return value

    return get, lambda: sorted(modules())


class _OnUse(ModuleType):
    """Stands for a module until one of its names is read."""

    def __getattr__(self, name: str) -> Any:
        return getattr(import_module(self.__name__), name)


def defer_numpy_tools() -> None:
    """Keep SciPy from loading the Fortran and test tools of a loaded NumPy, a third of SciPy's import, before use."""
    if (numpy := sys.modules.get("numpy")) is not None:
        for name in {"f2py", "testing"} - vars(numpy).keys():
            setattr(numpy, name, _OnUse(f"numpy.{name}"))
