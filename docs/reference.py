"""Generate the reference pages: every public name by module, and the help of every command."""

import ast
import contextlib
import dataclasses
import functools
import importlib
import inspect
import io
import pkgutil
import re
import typing
from pathlib import Path

import midair
from midair.evaluate import too_loud
from midair.settings import CHOICES, MODES, Settings, flat_names, format_setting, format_value
from midair.solvers import SolverSettings

ROOT = Path(__file__).parents[1]
CLOSED = {"__main__", "array_types", "blas", "cli", "progress", "ram", "stages", "version", "validation"}
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
    """Names in ``from .x import Y as Y`` statements of a package, and those in its ``__all__``, each once."""
    tree = ast.parse(inspect.getsource(module))
    imported = [alias for each in ast.walk(tree) if isinstance(each, ast.ImportFrom) for alias in each.names]
    names = [each.name for each in imported if each.name == each.asname]
    return list(dict.fromkeys([*names, *getattr(module, "__all__", [])]))


def directive(full, value):
    """Sphinx directive for one name, with the classes that a function takes and returns, and where it is used."""
    if is_class(value) or inspect.isroutine(value):
        links = see_also(full.rpartition(".")[2], value)
        also = [f"   .. seealso:: {', '.join(links)}", ""] if links else []
        if is_class(value):
            return [f".. autoclass:: {full}", "   :members:", "", *also]
        return [f".. autofunction:: {full}", "", *also]
    text = repr(value) if typing.get_origin(value) else type(value).__name__
    return [f".. py:data:: {full}", "", f"   ``{' '.join(text.split())[:300]}``", ""]


def see_also(name, value):
    """Links to the classes in the signature of a function, to examples and to pages that use the name."""
    hints = {}
    if not is_class(value):
        with contextlib.suppress(NameError):  # of types that are imported for checks only
            hints = typing.get_type_hints(inspect.unwrap(value))
    classes = dict.fromkeys(each for hint in hints.values() for each in parts_of(hint))
    homes = {each: home_of(each, each.__name__) for each in classes}
    links = [f":py:class:`~{home}.{each.__name__}`" for each, home in homes.items() if home]
    return [*links, *(f":doc:`{title} </{place}>`" for place, title in users().get(name, {}).items())]


def parts_of(hint):
    """Classes of midair in an annotation."""
    if is_class(hint):
        return [hint] if hint.__module__.startswith("midair.") else []
    return [each for inner in typing.get_args(hint) for each in parts_of(inner)]


@functools.cache
def users():
    """For each name, the examples and pages whose Python uses it: their place and title."""
    found = {}
    examples = {f"gallery/{path.stem}": path for path in sorted((ROOT / "examples").glob("plot_*.py"))}
    for place, path in (examples | {path.stem: path for path in sorted((ROOT / "docs").glob("*.md"))}).items():
        text = path.read_text(encoding="utf-8")
        title = re.search(r"^# (.+)$" if path.suffix == ".md" else r'^"""\n?(.+)$', text, re.MULTILINE)
        code = (
            "\n".join(re.findall(r"^```python\n(.*?)^```", text, re.MULTILINE | re.DOTALL))
            if path.suffix == ".md"
            else text
        )
        for name in names_in(code):
            found.setdefault(name, {})[place] = title[1].strip('". ')
    return found


def names_in(code):
    """Names of midair that Python code imports or reads from the package."""
    try:
        tree = ast.parse(code)
    except SyntaxError:  # fragments of a page
        return set()
    nodes = list(ast.walk(tree))
    imported = {
        alias.name
        for each in nodes
        if isinstance(each, ast.ImportFrom) and (each.module or "").startswith("midair")
        for alias in each.names
    }
    read = {
        each.attr
        for each in nodes
        if isinstance(each, ast.Attribute) and isinstance(each.value, ast.Name) and each.value.id == "midair"
    }
    return imported | read


def is_class(value):
    """True for a class, but not for an alias of a generic type."""
    return inspect.isclass(value) and not typing.get_origin(value)


def module_page(name, names):
    """Page of one module: a table of its names, and an entry for each."""
    module = importlib.import_module(name)
    head = (inspect.getdoc(module) or "").splitlines()[0]
    shown = [each for each in names if is_class(getattr(module, each)) or inspect.isroutine(getattr(module, each))]
    lines = [name, "=" * len(name), "", head, "", f".. currentmodule:: {name}", ""]
    # The package itself only links its classes, each of which is described in the module that defines it.
    linked = {each: home for each in shown if name == "midair" and (home := home_of(getattr(module, each), each))}
    for each, home in linked.items():
        first = (inspect.getdoc(getattr(module, each)) or "").splitlines()[0]
        lines.append(f"- :py:class:`~{home}.{each}`: {first}")
    lines += ["", ".. autosummary::", "   :nosignatures:", ""]
    lines += [*(f"   {each}" for each in shown if each not in linked), ""]
    for each in (each for each in names if each not in linked):
        lines += directive(f"{name}.{each}", getattr(module, each))
    return "\n".join(lines)


def home_of(value, name):
    """Public module below midair that documents a class; empty for another value."""
    if not is_class(value):
        return ""
    parts = value.__module__.split(".")
    homes = (".".join(parts[:count]) for count in range(2, len(parts) + 1) if parts[1] not in CLOSED)
    return next((home for home in homes if getattr(importlib.import_module(home), name, None) is value), "")


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


def choices_table():
    """Return the Markdown table of all settings: place in `Settings`, option, help, value in each mode.

    A cell is empty where best equals the paper's value, and where another mode equals best.
    """
    lines = ["| in `Settings`, option | what | paper | best | quick | finest | quiet |", "| --- " * 7 + "|"]
    made = {mode: MODES[mode]() for mode in MODES}
    for choice in CHOICES:
        shown = [format_value(choice.of(settings), choice.unit) for settings in made.values()]
        lines.append(_table_row(f"`{choice.path}`<br>`--{choice.name}`", choice.help, shown))
    plain = {mode: flat_names(settings.plain()) for mode, settings in made.items()}
    helps = {f"solver.{one.name}": one.metadata["help"] for one in dataclasses.fields(SolverSettings)}
    paths = dict.fromkeys(path for path in (*leaves(Settings()), *plain["best"]))
    known = ("solver.method", "solver.quiet_ears", "acoustics.medium", *(choice.path for choice in CHOICES))
    for path in paths:
        if not path.startswith(known):
            shown = [format_setting(path, values.get(path)) for values in plain.values()]
            lines.append(_table_row(f"`{path}`", helps.get(path, ""), shown))
    return "\n".join(lines)


def leaves(value, before=""):
    """Places of all settings below a dataclass."""
    for one in dataclasses.fields(value):
        got = getattr(value, one.name)
        yield from leaves(got, f"{before}{one.name}.") if dataclasses.is_dataclass(got) else [f"{before}{one.name}"]


def _table_row(name, what, shown):
    paper, best, *others = shown
    cells = [paper, best if best != paper else "", *(each if each != best else "" for each in others)]
    return f"| {name} | {what} | {' | '.join(cells)} |"


def as_markdown(entries):
    """Table of entries in Markdown, for the docs."""
    lines = ["| name | stored as | dimensions | type | unit | meaning |", "| --- | --- | --- | --- | --- | --- |"]
    for entry in entries:
        stored = "attribute" if entry.dimensions is None else "dataset"
        name = f"`{entry.name}`" if entry.required else f"`{entry.name}` (optional)"
        axes = ", ".join(entry.dimensions or ())
        kind = f"{entry.dtype} or f4" if entry.single else entry.dtype
        lines.append(f"| {name} | {stored} | {axes} | {kind} | {entry.unit} | {entry.what} |")
    return "\n".join(lines)


def touches_table(touches):
    """Table of the touches of the gallery: film, words, picture and sound."""
    rows = ["| film | touch | picture | sound |", "|---|---|---|---|"]
    for name, one in touches.items():
        given = f'style="width: 9em" src="_static/{name}.wav" aria-label="sound of {name}"'
        sound = f'<audio controls preload="none" {given}></audio>'
        film, picture = (
            f"![{what} of {name}](touches/{name}.{kind})" for what, kind in (("film", "gif"), ("picture", "png"))
        )
        said = f"Felt by {one.felt} of 10; ears: {too_loud(one.ears)}."
        rows.append(f"| {film} | **{name}** {one.says} {said} Licence: {one.licence}. | {picture} | {sound} |")
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
        ]
        + [
            f":doc:`{name}`\n   {(inspect.getdoc(importlib.import_module(name)) or '').splitlines()[0]}"
            for name in found
        ]
        + ["", ".. toctree::", "   :hidden:", ""]
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
