"""Common style of figures and pages: one palette, a mark SIMULATED on simulated data, one layout of HTML."""

from __future__ import annotations

import base64
import io
import re
import struct
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


@dataclass(frozen=True, slots=True, kw_only=True)
class Style:
    """Colours that all figures share.

    Line colours suit colour-blind people (palette of Okabe and Ito). The colour maps are perceptually uniform; that of
    phases is cyclic.
    """

    original: str = "#1b1f24"
    reproduced: str = "#d55e00"
    before: str = "#56b4e9"
    quantity: str = "viridis"
    phase: str = "twilight"
    ink: str = "#1b1f24"
    faint: str = "#d0d7de"
    band: str = "#e7f3ec"
    pair: tuple[str, ...] = ("#1b1f24", "#d55e00", "#56b4e9")
    """Original, and what is compared with it."""
    lines: tuple[str, ...] = ("#d55e00", "#56b4e9", "#1b1f24", "#009e73", "#cc79a7", "#e69f00", "#0072b2")
    """Further curves of one figure."""
    touch: tuple[str, ...] = ("#fff3d6", "#fdc462", "#f06e3e", "#b8225c", "#4a0e60")
    """Pressure on a drawn hand."""


STYLE = Style()


def new_figure(width: float, height: float, *, simulated: bool) -> Figure:
    """Create an empty figure of `width` by `height` inches, with a mark if its data is simulated."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), layout="constrained", facecolor="white")
    if simulated:
        # A free strip at the top, so that the mark covers nothing.
        figure.get_layout_engine().set(rect=(0, 0, 1, 1 - 0.24 / height))  # pyright: ignore[reportOptionalMemberAccess, reportCallIssue]
        figure.text(
            0.995, 1 - 0.05 / height, "SIMULATED", ha="right", va="top", fontsize=8, fontweight="bold", color="#a40e26"
        )
    return figure


def plain_axes(axes: Axes, *, title: str = "", x: str = "", y: str = "") -> Axes:
    """Apply the common axes style: no box, a faint grid behind the data, and the texts of `label_axes`."""
    axes.spines[["top", "right"]].set_visible(False)
    axes.spines[["left", "bottom"]].set_color(STYLE.faint)
    axes.grid(visible=True, color=STYLE.faint, linewidth=0.5, alpha=0.6)
    axes.set_axisbelow(True)
    return label_axes(axes, title=title, x=x, y=y)


def label_axes(axes: Axes, *, title: str = "", x: str = "", y: str = "", size: float = 8) -> Axes:
    """Set ticks and title of this font size, and labels that are 1 point larger."""
    axes.tick_params(labelsize=size, color=STYLE.faint, labelcolor=STYLE.ink)
    axes.set_title(title, fontsize=size, loc="left", color=STYLE.ink)
    axes.set_xlabel(x, fontsize=size + 1)
    axes.set_ylabel(y, fontsize=size + 1)
    return axes


def legend_above(figure: Figure, axes: Axes) -> None:
    """Add a legend of the curves of some axes above the figure."""
    handles, labels = axes.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper left", ncols=len(handles), fontsize=8, frameon=False)


def colour_bar(figure: Figure, axes: Sequence[Axes], label: str) -> None:
    """Add the colour bar of images that share one scale."""
    bar = figure.colorbar(axes[0].images[0], ax=axes, shrink=0.85, pad=0.02)
    bar.set_label(label, fontsize=9)
    bar.ax.tick_params(labelsize=8)


def png_bytes(figure: Figure, *, dpi: int = 130) -> bytes:
    """Return the figure as PNG."""
    out = io.BytesIO()
    figure.savefig(out, format="png", dpi=dpi)
    return out.getvalue()


def data_url(png: bytes) -> str:
    """A PNG as the source of an image in a page that loads nothing."""
    return "data:image/png;base64," + base64.b64encode(png).decode()


@dataclass(frozen=True, slots=True, kw_only=True)
class Picture:
    """A figure of a page as PNG, with title and caption."""

    title: str
    caption: str = ""
    data: bytes
    lines: bool = False
    """Curves on white, which a dark page shows on black; colour maps stay as they are."""

    @property
    def source(self) -> str:
        """The picture as a data URL, for an ``img`` element."""
        return data_url(self.data)

    @property
    def size(self) -> tuple[int, int]:
        """Width and height in pixels, from the PNG header (PNG specification, 11.2.2)."""
        width, height = struct.unpack(">II", self.data[16:24])
        return width, height


def render_page(template: str, **values: Any) -> str:
    """Render a template, whose values are escaped in HTML; all values that it uses must be given.

    `template` is a path below the package, such as ``rig/correction/report.html.j2``; pages extend page.html.j2 of this
    folder.
    """
    from jinja2 import Environment, PackageLoader, StrictUndefined

    html = template.endswith(".html.j2")
    environment = Environment(
        loader=PackageLoader("midair", "."), autoescape=html, undefined=StrictUndefined, trim_blocks=True
    )
    # A line of a verdict: its answer, a mark, and the rest.
    known = {"parts": re.compile(r"(: |; | (?=\())").split}
    return environment.get_template(template, globals=known).render(values)
