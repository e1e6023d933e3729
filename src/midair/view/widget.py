"""The view as a notebook widget, and as a page for notebooks without widgets."""

from functools import cache
from html import escape
from typing import Any

from midair.errors import MissingExtraError
from midair.view.page_payload import metadata, sections
from midair.view.pages import one_module, show_page, style
from midair.view.view_data import ViewData


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
