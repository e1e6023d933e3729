"""The view in a notebook: a widget whose canvases are the studio's, and a page for where no widget can run."""

from functools import cache
from html import escape
from typing import Any

from midair.errors import MissingExtraError
from midair.view.page_payload import metadata, sections
from midair.view.pages import one_module, show_page, style
from midair.view.view_data import ViewData


def in_notebook(showing: ViewData) -> Any:
    """A widget of what is shown, for the last line of a cell; its `frame` is the playhead, to be read and set.

    Raises
    ------
    MissingExtraError
        If anywidget is not installed.
    """
    return _kind()(about=metadata(showing), tracks=sections(showing))


def framed_page(showing: ViewData, *, height: int = 900) -> str:
    """The view's page in a frame of its own: it works where there is no widget, such as in an exported notebook."""
    page = escape(show_page(showing), quote=True)
    return f'<iframe srcdoc="{page}" sandbox="allow-scripts" width="100%" height="{height}" style="border: 0"></iframe>'


@cache
def _kind() -> Any:
    """The class, made where somebody asks for it: midair does without notebooks."""
    try:
        import anywidget
        import traitlets
    except ImportError as wrong:
        raise MissingExtraError("a widget needs anywidget: pip install 'midair[notebook]'") from wrong

    class ViewWidget(anywidget.AnyWidget):
        _esm = one_module("widget.js")
        _css = style()
        about = traitlets.Dict().tag(sync=True)
        tracks = traitlets.Dict().tag(sync=True)
        frame = traitlets.Int(0).tag(sync=True)

    return ViewWidget
