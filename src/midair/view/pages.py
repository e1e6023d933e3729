"""Standalone HTML pages of a view, which load nothing from elsewhere, and its sounds."""

import base64
import hashlib
import io
import json
import re
import wave
from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path

import numpy as np

from midair.array_types import Array
from midair.dsp import resample
from midair.figures import render_page
from midair.view.frame_encoding import metadata, sections
from midair.view.view_data import Channels, ViewData

RATE = 48000.0
"""Sampling rate of the sound in Hz; players refuse the rates of sensors."""

_PEAK = 0.9
"""Loudest sample as a share of full scale."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ChannelSound:
    """A channel as sound."""

    data: bytes
    """A WAV file, mono, 16 bits."""
    full_scale: float
    """Full scale in the unit of the channel."""

    @property
    def source(self) -> str:
        """The file as a data URL, for an ``audio`` element."""
        return "data:audio/wav;base64," + base64.b64encode(self.data).decode()


def channel_sound(
    channels: Channels, channel: int, rate: float, *, sound_rate: float = RATE, full_scale: float | None = None
) -> ChannelSound:
    """Convert a channel to sound, without its mean, with 10 ms fades at both ends and its peak near full scale.

    `full_scale`, in the unit of the channel, makes loudness comparable; larger values are clipped. If it is None, the
    loudest sample is at 0.9 of full scale. Raises InputError if there is no such channel.
    """
    channels.check(channel)
    heard = channels.values[:, channel] - channels.values[:, channel].mean()
    heard = _faded(resample(heard, rate, sound_rate), round(10e-3 * sound_rate))
    if full_scale is None:
        full_scale = float(np.abs(heard).max()) / _PEAK or 1.0
    out = io.BytesIO()
    with wave.open(out, "wb") as file:
        file.setnchannels(1)
        file.setsampwidth(2)
        file.setframerate(round(sound_rate))
        file.writeframes(np.rint(np.clip(heard / full_scale, -1, 1) * 32767).astype("<i2").tobytes())
    return ChannelSound(data=out.getvalue(), full_scale=full_scale)


def comparison_sounds(showing: ViewData) -> tuple[tuple[str, ChannelSound], ...]:
    """Return label and sound of the selected channel, original and re-recorded, at one scale."""
    both = [each for each in (showing.samples, showing.again) if each is not None]
    alone = [channel_sound(each, showing.channel, showing.rate) for each in both]
    scale = max((each.full_scale for each in alone), default=1.0)
    heard = [channel_sound(each, showing.channel, showing.rate, full_scale=scale) for each in both]
    return tuple((each.label, sound) for each, sound in zip(both, heard, strict=True))


def _faded(x: Array, length: int) -> Array:
    length = min(length, len(x) // 2)
    ramp = 0.5 - 0.5 * np.cos(np.pi * (np.arange(length) + 0.5) / max(length, 1))
    window = np.ones(len(x))
    window[:length], window[len(x) - length :] = ramp, ramp[::-1]
    return x * window


WEB = Path(__file__).parent / "web"
"""Folder of the ES modules view.js (canvases), transport.js (time) and page.js (both)."""

Rows = Sequence[Sequence[str]]
Tables = Sequence[tuple[str, Rows]]
"""Title and rows of text of each table."""


def one_module() -> str:
    """Return view.js, transport.js and page.js as one module, for use inside a single page."""
    parts = [(WEB / name).read_text(encoding="utf-8") for name in ("view.js", "transport.js", "page.js")]
    return "\n".join(re.sub(r'^import [^;]* from "\./\w+\.js";$', "", part, flags=re.MULTILINE) for part in parts)


def page_parts(showing: ViewData) -> dict[str, str]:
    """Return the parts of a page: ``style``, ``module`` (script), ``sounds``, and ``blocks`` (the frames).

    The script mounts every element of class ``midair-view`` with the blocks inside it.
    """
    held = {"about": json.dumps(metadata(showing), ensure_ascii=True).replace("<", "\\u003c")}
    held |= {name: base64.b64encode(data).decode() for name, data in sections(showing).items()}
    blocks = "\n".join(
        f'<script type="application/midair" data-name="{name}">{text}</script>' for name, text in held.items()
    )
    style = (WEB / "page.css").read_text(encoding="utf-8")
    begin = 'for (const root of document.querySelectorAll(".midair-view")) root.midair = mountInlined(root);'
    return {"style": style, "module": f"{one_module()}\n{begin}", "sounds": _sounds(showing), "blocks": blocks}


def _sounds(showing: ViewData) -> str:
    """Return audio players of the selected channel; empty if there is none."""
    players = [
        f'<label>{escape(name.capitalize())} <audio controls loop preload="auto" src="{sound.source}"></audio></label>'
        for name, sound in comparison_sounds(showing)
    ]
    return f'<div class="view-heard">{"".join(players)}</div>' if players else ""


def show_page(showing: ViewData, *, verdict: Rows = (), commands: tuple[str, ...] = (), tables: Tables = ()) -> str:
    """Render a view as HTML that loads nothing from elsewhere, enforced by its content security policy.

    The lines of `verdict` stand first; `tables` and `commands`, which produce the same page, are folded below the view.
    """
    page = render_page(
        "view/show.html.j2",
        title=showing.title[:1].upper() + showing.title[1:],
        simulated=showing.simulated,
        lead=f"{showing.frames} frames at {showing.rate:.6g} Hz, {showing.duration:.4g} s",
        facts=showing.facts,
        verdict=verdict,
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
