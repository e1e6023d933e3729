"""How the documentation is built; `make docs` treats every warning as an error."""

import os
import sys
from pathlib import Path
from typing import Any

import latex2mathml.converter
from docutils import nodes
from matplotlib.figure import Figure
from sphinx_gallery.scrapers import figure_rst

from midair import __version__
from midair.cli.commands.play import PlayOptions
from midair.datasets import TOUCHES
from midair.files.native.schema import TABLE
from midair.rig import LiveSettings, PlaySettings, RecordSettings

sys.path.insert(0, str(Path(__file__).parent))
import reference

os.environ["COLUMNS"] = "100"
reference.write(Path(__file__).parent / "reference")

(touches := Path(__file__).parent / "touches").mkdir(exist_ok=True)
for name, touch in TOUCHES.items():
    if not (touches / f"{name}.wav").exists():
        touch.view().write(touches)


def figure_scraper(_: Any, block_vars: dict[str, Any], gallery_conf: dict[str, Any]) -> str:
    """Pictures of the Matplotlib figures that an example's block has made and bound to a name."""
    seen = gallery_conf.setdefault("midair_seen", [])
    paths = []
    for value in list(block_vars["example_globals"].values()):
        if isinstance(value, Figure) and not any(value is old for old in seen):
            seen.append(value)
            path = next(block_vars["image_path_iterator"])
            value.savefig(path, dpi=110)
            paths.append(path)
    return figure_rst(paths, gallery_conf["src_dir"])


project = "midair"
author = "The midair maintainers"
copyright = f"2026, {author}"
release = version = __version__

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "numpydoc",
    "sphinx.ext.autosummary",
    "sphinx_copybutton",
    "sphinx_gallery.gen_gallery",
]
exclude_patterns = ["_build", "data", "gallery/*.ipynb", "gallery/*.py", "gallery/*.json", "**/sg_execution_times.rst"]
suppress_warnings = ["config.cache"]  # the gallery's scraper is a function, which cannot be kept between builds

html_theme = "furo"
html_title = "midair"
html_static_path = ["touches"]

myst_enable_extensions = ["dollarmath", "deflist", "colon_fence", "substitution"]
myst_substitutions = {
    "settings_table": reference.choices_table(),
    "record_table": reference.declared_table(RecordSettings),
    "play_table": reference.declared_table(PlaySettings, PlayOptions),
    "live_table": reference.declared_table(LiveSettings),
    "touches_table": reference.touches_table(TOUCHES),
    **{f"{kind}_table": reference.as_markdown(entries) for kind, entries in TABLE.items()},
}
myst_heading_anchors = 3

autodoc_member_order = "bysource"
# Pages alone are in the tree beside each page: with every function it takes half of the time of the documentation.
toc_object_entries = False
autodoc_typehints = "none"
numpydoc_show_class_members = False
numpydoc_class_members_toctree = False

sphinx_gallery_conf = {
    "examples_dirs": "../examples",
    "gallery_dirs": "gallery",
    "filename_pattern": r"/plot_",
    "image_scrapers": (figure_scraper,),
    "reset_modules": (),
    "download_all_examples": False,
    "show_memory": False,
    "show_signature": False,
    "write_computation_times": False,
    "abort_on_example_error": True,
    "min_reported_time": 1e9,
}

autosummary_generate = False
# What is copied is what is typed: no prompt, no output.
copybutton_prompt_text = r"\$ "
copybutton_prompt_is_regexp = True
copybutton_only_copy_prompt_lines = True

html_math_renderer = "mathml"
linkcheck_timeout = 20
linkcheck_retries = 2


def formula(translator: Any, node: Any, display: str) -> None:
    """A formula as MathML, which browsers draw by themselves: nothing is loaded from a network."""
    text = node.astext()
    if display == "block":
        text = text.replace("\\\\", r"\\ ")
    translator.body.append(latex2mathml.converter.convert(text, display=display))
    raise nodes.SkipNode


def setup(app: Any) -> None:
    """Formulas need no network."""
    app.add_html_math_renderer(
        "mathml",
        (lambda translator, node: formula(translator, node, "inline"), None),
        (lambda translator, node: formula(translator, node, "block"), None),
    )
