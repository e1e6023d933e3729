"""Standalone HTML pages with a common layout."""

import base64
import struct
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True, slots=True, kw_only=True)
class Picture:
    """A figure of a page as PNG, with title and caption."""

    title: str
    caption: str = ""
    data: bytes

    @property
    def source(self) -> str:
        """The picture as a data URL, for an ``img`` element."""
        return "data:image/png;base64," + base64.b64encode(self.data).decode()

    @property
    def size(self) -> tuple[int, int]:
        """Width and height in pixels, from the PNG header (PNG specification, 11.2.2)."""
        width, height = struct.unpack(">II", self.data[16:24])
        return width, height


def render_page(template: str, **values: Any) -> str:
    """Render a template that extends page.html.j2 of this folder; all values that it uses must be given.

    Parameters
    ----------
    template : str
        Path below the package, such as ``rig/correction/report.html.j2``.
    """
    from jinja2 import Environment, PackageLoader, StrictUndefined

    environment = Environment(
        loader=PackageLoader("midair", "."), autoescape=True, undefined=StrictUndefined, trim_blocks=True
    )
    return environment.get_template(template).render(values)
