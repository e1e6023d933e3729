"""Generate the reference pages: every public name by module, and the help of every command."""

import ast
import contextlib
import dataclasses
import importlib
import inspect
import io
import pkgutil
import typing
from pathlib import Path

import midair
from midair.settings import format_value

CLOSED = {"__main__", "array_types", "blas", "cli", "progress", "ram", "version", "validation"}
"""Internal modules without a reference page."""


def modules():
    """Names of the public modules, midair first, with their public names."""
    found = {"midair": sorted(name for name in midair.__all__ if not inspect.ismodule(getattr(midair, name)))}
    for each in pkgutil.iter_modules(midair.__path__):
        if each.name not in CLOSED:
            module = importlib.import_module(f"midair.{each.name}")
            found[module.__name__] = sorted(names_of(module), key=lambda name: (not name[:1].isupper(), name.lower()))
    return {name: names for name, names in found.items() if names}


def names_of(module):
    """Names that a package exports (``from .x import Y as Y``), or the functions and classes that a module defines."""
    if exported := exports(module):
        return exported
    return [
        name
        for name, value in vars(module).items()
        if not name.startswith("_") and getattr(value, "__module__", None) == module.__name__ and callable(value)
    ]


def exports(module):
    """Names in ``from .x import Y as Y`` statements of a package, and those in its ``__all__``."""
    tree = ast.parse(inspect.getsource(module))
    imported = [alias for each in tree.body if isinstance(each, ast.ImportFrom) for alias in each.names]
    return [each.name for each in imported if each.name == each.asname] + list(getattr(module, "__all__", []))


def directive(full, value):
    """Sphinx directive for one name."""
    if is_class(value):
        # A class is indexed in its own module; the page of midair only shows it.
        again = ["   :no-index:"] if full.count(".") == 1 else []
        return [f".. autoclass:: {full}", "   :members:", *again, ""]
    if inspect.isroutine(value):
        return [f".. autofunction:: {full}", ""]
    text = repr(value) if typing.get_origin(value) else type(value).__name__
    return [f".. py:data:: {full}", "", f"   ``{' '.join(text.split())[:300]}``", ""]


def is_class(value):
    """True for a class, but not for an alias of a generic type."""
    return inspect.isclass(value) and not typing.get_origin(value)


def module_page(name, names):
    """Page of one module: a table of its names, and an entry for each."""
    module = importlib.import_module(name)
    head = (inspect.getdoc(module) or "").splitlines()[0]
    shown = [each for each in names if is_class(getattr(module, each)) or inspect.isroutine(getattr(module, each))]
    lines = [name, "=" * len(name), "", head, "", f".. currentmodule:: {name}", ""]
    lines += [".. autosummary::", "   :nosignatures:", ""]
    lines += [*(f"   {each}" for each in shown), ""]
    for each in names:
        lines += directive(f"{name}.{each}", getattr(module, each))
    return "\n".join(lines)


def declared_table(kind, typed=None):
    """Table of a settings class: keyword, option, default, meaning; `typed` is the class of options, if not of all."""
    names = {one.name for one in dataclasses.fields(typed or kind)}
    rows = ["| keyword | option | default | meaning |", "|---|---|---|---|"]
    for one in dataclasses.fields(kind):
        known = one.metadata
        option = known.get("option", one.name.replace("_", "-"))
        shown = f"`--{option}`" if option and one.name in names else ""
        default = "" if one.default in (None, "", dataclasses.MISSING) else format_value(one.default, known["unit"])
        rows.append(f"| `{one.name}` | {shown} | {default} | {known['help'].replace(chr(10), ' ')} |")
    return "\n".join(rows)


def commands():
    """Every command as typed by the user, and its help."""
    from midair.cli import app, run

    def walk(at, words):
        for name in at:
            if name.startswith("-"):
                continue
            yield [*words, name]
            below = at[name]
            yield from walk(below, [*words, name])

    for words in walk(app, []):
        text = io.StringIO()
        with contextlib.redirect_stdout(text):
            run([*words, "--help"])
        yield " ".join(["midair", *words]), text.getvalue().rstrip()


def command_page():
    """Page of all commands."""
    parts = [
        "# Commands",
        "",
        "Output of `--help` for each command. Quantities take units: 200mm, 20Hz, 0.5s, 30Pa.",
        "",
    ]
    for name, text in commands():
        parts += [f"## `{name}`", "", "```text", text, "```", ""]
    return "\n".join(parts)


def write(folder):
    """Write the pages that have changed into a folder, so that a second build is quick."""
    folder = Path(folder)
    folder.mkdir(exist_ok=True)
    found = modules()
    pages = {f"{name}.rst": module_page(name, names) for name, names in found.items()}
    pages["index.rst"] = "\n".join(
        [
            "Python",
            "======",
            "",
            f"{sum(map(len, found.values()))} public names, by module.",
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
