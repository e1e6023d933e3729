"""Standalone HTML pages of a view, which load nothing from elsewhere, and the view as a notebook widget."""

import base64
import hashlib
import json
import re
from collections.abc import Sequence
from functools import cache
from html import escape
from pathlib import Path
from typing import Any

from midair.errors import MissingExtraError
from midair.figures import render_page
from midair.view.audio import comparison_sounds
from midair.view.page_payload import metadata, sections
from midair.view.view_data import ViewData

WEB = Path(__file__).parent / "web"
"""Folder of the ES modules view.js (canvases), transport.js (time), page.js (both) and widget.js (notebooks)."""


Tables = Sequence[tuple[str, Sequence[Sequence[str]]]]
"""Title and rows of text of each table."""


def one_module(*more: str) -> str:
    """Return view.js, transport.js, page.js and further files as one module, for use inside a single page."""
    names = ("view.js", "transport.js", "page.js", *more)
    parts = [(WEB / name).read_text(encoding="utf-8") for name in names]
    return "\n".join(re.sub(r'^import .* from "\./\w+\.js";$', "", part, flags=re.MULTILINE) for part in parts)


def style() -> str:
    """Return the style sheet of the view."""
    return (WEB / "page.css").read_text(encoding="utf-8")


def page_parts(showing: ViewData) -> dict[str, str]:
    """Return the parts of a page: ``style``, ``module`` (script), ``sounds``, and ``blocks`` (the frames).

    The script mounts every element of class ``midair-view`` with the blocks inside it.
    """
    held = {"about": json.dumps(metadata(showing), ensure_ascii=True).replace("<", "\\u003c")}
    held |= {name: base64.b64encode(data).decode() for name, data in sections(showing).items()}
    blocks = "\n".join(
        f'<script type="application/midair" data-name="{name}">{text}</script>' for name, text in held.items()
    )
    begin = 'for (const root of document.querySelectorAll(".midair-view")) root.midair = mountInlined(root);'
    return {"style": style(), "module": f"{one_module()}\n{begin}", "sounds": _sounds(showing), "blocks": blocks}


def _sounds(showing: ViewData) -> str:
    """Return audio players of the selected channel; empty if there is none."""
    players = [
        f'<label>{escape(name.capitalize())} <audio controls loop preload="auto" src="{sound.source}"></audio></label>'
        for name, sound in comparison_sounds(showing)
    ]
    return f'<div class="view-heard">{"".join(players)}</div>' if players else ""


def show_page(showing: ViewData, *, commands: tuple[str, ...] = (), tables: Tables = ()) -> str:
    """Render a view as HTML that loads nothing from elsewhere, enforced by its content security policy.

    `commands` are those that produce the same page; `tables` stand below the view.
    """
    page = render_page(
        "view/show.html.j2",
        title=showing.title[:1].upper() + showing.title[1:],
        simulated=showing.simulated,
        lead=f"{showing.frames} frames at {showing.rate:.6g} Hz, {showing.duration:.4g} s",
        facts=showing.facts,
        commands=commands,
        tables=tables,
        **page_parts(showing),
    )
    return with_content_policy(page)


def with_content_policy(page: str) -> str:
    """Add a content security policy to a page: it allows only its own scripts and styles (by hash) and data URLs."""

    def sums(element: str, given: str) -> str:
        # Elements that a browser does not run, such as the frames, need no hash.
        found = re.findall(rf"<{element}{given}>(.*?)</{element}>", page, re.DOTALL)
        return " ".join(
            f"'sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}'" for text in found
        )

    # A hash allows style elements, never style attributes; neither can load anything.
    styles = "'unsafe-inline'" if ' style="' in page else sums("style", "")
    policy = f"default-src 'none'; img-src data:; media-src data:; style-src {styles}"
    scripts = sums("script", ' type="module"')
    policy += f"; script-src {scripts}" if scripts else ""
    head = '<meta charset="utf-8">'
    return page.replace(head, f'{head}\n<meta http-equiv="Content-Security-Policy" content="{policy}">', 1)


def in_notebook(showing: ViewData) -> Any:
    """Return a widget for the last line of a cell; its attribute `frame` is the playhead, readable and writable.

    Raises MissingExtraError if anywidget is not installed.
    """
    return _widget_class()(about=metadata(showing), tracks=sections(showing))


def iframe_page(showing: ViewData, *, height: int = 900) -> str:
    """Return the page of a view in an iframe, for notebooks without widgets, such as exported ones."""
    page = escape(show_page(showing), quote=True)
    return f'<iframe srcdoc="{page}" sandbox="allow-scripts" width="100%" height="{height}" style="border: 0"></iframe>'


@cache
def _widget_class() -> Any:
    """Create the widget class on demand, since anywidget is optional."""
    try:
        import anywidget
        import traitlets
    except ImportError as wrong:
        raise MissingExtraError("a widget needs the package anywidget: pip install 'midair[notebook]'") from wrong

    class ViewWidget(anywidget.AnyWidget):
        _esm = one_module("widget.js")
        _css = style()
        about = traitlets.Dict().tag(sync=True)
        tracks = traitlets.Dict().tag(sync=True)
        frame = traitlets.Int(0).tag(sync=True)

    return ViewWidget
