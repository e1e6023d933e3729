"""Pages of reference that are made and not written: every public name, room by room, and every command's own help."""

import contextlib
import importlib
import inspect
import io
import pkgutil
import typing
from pathlib import Path

import midair

CLOSED = {"__main__", "blas", "cli", "progress", "ram", "temp_frames", "version", "validation"}
"""Rooms that are nobody's but midair's own."""


def rooms():
    """Every module that people may import from, by its name, with its public names; midair itself first."""
    found = {"midair": sorted(name for name in midair.__all__ if not inspect.ismodule(getattr(midair, name)))}
    for each in pkgutil.iter_modules(midair.__path__):
        if each.name not in CLOSED:
            module = importlib.import_module(f"midair.{each.name}")
            found[module.__name__] = sorted(names_of(module), key=lambda name: (not name[:1].isupper(), name.lower()))
    return {name: names for name, names in found.items() if names}


def names_of(module):
    """What a module says is public; of one that says nothing, what it defines itself."""
    if hasattr(module, "__all__"):
        return [name for name in module.__all__ if not inspect.ismodule(getattr(module, name))]
    return [
        name
        for name, value in vars(module).items()
        if not name.startswith("_") and getattr(value, "__module__", None) == module.__name__ and callable(value)
    ]


def directive(full, value):
    """How Sphinx is told to document one name."""
    if is_class(value):
        # A noun stands in its own room; midair's page only shows it.
        again = ["   :no-index:"] if full.count(".") == 1 else []
        return [f".. autoclass:: {full}", "   :members:", *again, ""]
    if inspect.isroutine(value):
        return [f".. autofunction:: {full}", ""]
    said = repr(value) if typing.get_origin(value) else type(value).__name__
    return [f".. py:data:: {full}", "", f"   ``{' '.join(said.split())[:300]}``", ""]


def is_class(value):
    """Whether it is a class, and not the name of a type made of others."""
    return inspect.isclass(value) and not typing.get_origin(value)


def room_page(name, names):
    """A page of one room: a table of its names, and each of them."""
    module = importlib.import_module(name)
    head = (inspect.getdoc(module) or "").splitlines()[0]
    shown = [each for each in names if is_class(getattr(module, each)) or inspect.isroutine(getattr(module, each))]
    lines = [name, "=" * len(name), "", head, "", f".. currentmodule:: {name}", ""]
    lines += [".. autosummary::", "   :nosignatures:", ""]
    lines += [*(f"   {each}" for each in shown), ""]
    for each in names:
        lines += directive(f"{name}.{each}", getattr(module, each))
    return "\n".join(lines)


def commands():
    """Every command as it is typed, and its own help."""
    from midair.cli import app, run

    def walk(at, words):
        for name in at:
            if name.startswith("-"):
                continue
            yield [*words, name]
            below = at[name]
            yield from walk(below, [*words, name])

    for words in walk(app, []):
        said = io.StringIO()
        with contextlib.redirect_stdout(said):
            run([*words, "--help"])
        yield " ".join(["midair", *words]), said.getvalue().rstrip()


def command_page():
    """The page of all commands."""
    parts = ["# Commands", "", "Each as `--help` tells it. Quantities take units: 200mm, 20Hz, 0.5s, 30Pa.", ""]
    for name, said in commands():
        parts += [f"## `{name}`", "", "```text", said, "```", ""]
    return "\n".join(parts)


def write(folder):
    """Write every page into a folder, those alone that changed, so that a second build is quick."""
    folder = Path(folder)
    folder.mkdir(exist_ok=True)
    found = rooms()
    pages = {f"{name}.rst": room_page(name, names) for name, names in found.items()}
    pages["index.rst"] = "\n".join(
        [
            "Python",
            "======",
            "",
            f"{sum(map(len, found.values()))} public names, room by room.",
            "",
            ".. toctree::",
            "   :maxdepth: 1",
            "",
        ]
        + [f"   {name}" for name in found]
        + [""]
    )
    pages["commands.md"] = command_page()
    for stale in folder.iterdir():
        if stale.name not in pages:
            stale.unlink()
    for name, text in pages.items():
        page = folder / name
        if not page.exists() or page.read_text(encoding="utf-8") != text:
            page.write_text(text, encoding="utf-8")
