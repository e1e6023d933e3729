"""HTML pages that stand alone: one look for all of them."""

import base64
import struct
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True, slots=True, kw_only=True)
class Picture:
    """A figure in a page: what it shows, and its PNG.

    Attributes
    ----------
    title, caption : str
        Above it, and below the title.
    data : bytes
        The PNG file.
    """

    title: str
    caption: str = ""
    data: bytes

    @property
    def source(self) -> str:
        """The picture as a data address, for an ``img`` element."""
        return "data:image/png;base64," + base64.b64encode(self.data).decode()

    @property
    def size(self) -> tuple[int, int]:
        """Width and height in pixels, from the head of the file, where the PNG specification has them (11.2.2)."""
        width, height = struct.unpack(">II", self.data[16:24])
        return width, height


def render_page(template: str, **values: Any) -> str:
    """A page from a template that extends this folder's page.html.j2; every value that it names must be given.

    Parameters
    ----------
    template : str
        Its place below the package, such as ``rig/correction/report.html.j2``.
    """
    from jinja2 import Environment, PackageLoader, StrictUndefined

    environment = Environment(
        loader=PackageLoader("midair", "."), autoescape=True, undefined=StrictUndefined, trim_blocks=True
    )
    return environment.get_template(template).render(values)
