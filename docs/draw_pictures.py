"""Pictures of docs/draw.md: drives of `midair draw` as the virtual array plays them.

``python docs/draw_pictures.py FOLDER`` writes them there.
"""

import os
import subprocess
import sys
import tempfile
from contextlib import chdir
from pathlib import Path

import numpy as np
from PIL import Image

from midair.cli import run
from midair.figures import maps_figure, png_bytes
from midair.files import load_solution
from midair.model import ControlGrid
from midair.physics import PlaybackChain, TransducerDynamics, Transducers, simulate, transfer_matrix

PATTERNS = {
    "circle, 50 times a second": 'shape = { name = "circle", radius_mm = 15 }\ndraw_hz = 50',
    "square, 10 times a second": 'shape = "polygon"\ndraw_hz = 10',
    "Lissajous, 10 times a second": 'shape = "lissajous"\ndraw_hz = 10',
    "two points at once": "centre_mm = [-12, 0]\n[[spot]]\ncentre_mm = [12, 0]",
}
PALM = ControlGrid(rows=61, columns=61, pitch=1e-3)


def felt(text, places):
    """Pressure at places while the drive of a pattern plays on transducers that follow it, 8 times a frame."""
    with tempfile.TemporaryDirectory() as folder, chdir(folder):
        Path("a.toml").write_text(text, encoding="utf-8")
        if run(["draw", "a.toml", "--temperature", "22C", "-q"]):
            raise SystemExit(1)
        drive = load_solution("a.drive.h5").drive
    chain = PlaybackChain(transducers=Transducers.alike(drive.array.count, TransducerDynamics()))
    G = transfer_matrix(places, drive.array, acoustics=drive.acoustics)
    return simulate(drive, G, chain=chain, rate=8 * drive.rate)


def maps():
    shown = []
    for title, spot in PATTERNS.items():
        pressure = felt(f"rate_hz = 2000\nduration_s = 0.15\n[[spot]]\n{spot}", PALM)
        shown.append((title, pressure[len(pressure) // 3 :].max(axis=0)))  # without the rise
    return maps_figure(shown, PALM, quantity="highest pressure (Pa)", simulated=True)


def spectrum():
    from midair.figures.style import STYLE, new_figure, plain_axes

    figure = new_figure(8.4, 2.8, simulated=True)
    axes = figure.subplots(1, 2)
    time_axis = plain_axes(axes[0], x="time (ms)", y="pressure (Pa)")
    line_axis = plain_axes(axes[1], x="frequency (Hz)", y="amplitude (Pa)")
    for depth, colour in ((1.0, STYLE.original), (0.5, STYLE.reproduced)):
        am = f"am = {{ frequency_hz = 150, depth = {depth} }}"
        wave = felt(f"duration_s = 0.22\n[[spot]]\n{am}", np.array([[0, 0, 0.2]]))[:, 0][-6400:]
        time_axis.plot(np.arange(960) / 32, wave[:960], color=colour)
        lines = 2 * np.abs(np.fft.rfft(wave)) / len(wave)
        line_axis.plot(np.arange(1, 101) * 5, lines[1:101], color=colour, label=f"depth {depth:g}")
    line_axis.legend(frameon=False, fontsize=8)
    return figure


def studio(folder):
    """The panel Draw in Chromium, on the way of a designer's first minutes, which is a test."""
    with tempfile.TemporaryDirectory() as steps:
        test = "tests/studio/test_draw_page.py::test_a_designer_draws_two_touches_for_a_study"
        subprocess.run(
            [sys.executable, "-m", "pytest", "-m", "browser", test],
            env={**os.environ, "MIDAIR_PICTURES": steps},
            check=True,
        )
        picture = Image.open(Path(steps) / "draw-2-key-frames.png").convert("RGB").quantize(128)
        picture.save(folder / "draw-studio.png", optimize=True)


def press():
    """The focus of a steady press at its own, turning place, and the pressure of the place in the middle."""
    from midair.figures.style import STYLE, new_figure, plain_axes

    angle = 2 * np.pi * np.arange(21) / 21
    places = np.stack([3e-3 * np.cos(angle), 3e-3 * np.sin(angle), 0 * angle + 0.2], axis=1)
    spot = "pressure_pa = 60\nlm = { frequency_hz = 10, radius_mm = 3, step_mm = 0.9 }\n"
    spot += "receptors = { slow = 0.5, fast = 0.3, pacinian = 0.2 }"
    both = felt(f"duration_s = 0.3\n[[spot]]\n{spot}", np.concatenate([places, [[0, 0, 0.2]]]))[-6400:]
    step = ((0.1 + (np.arange(6400) + 1) / 32e3) * 210 - 1e-9).astype(int) % 21
    figure = new_figure(8.4, 2.8, simulated=True)
    axes = figure.subplots(1, 2)
    time_axis = plain_axes(axes[0], x="time (ms)", y="pressure (Pa)")
    line_axis = plain_axes(axes[1], x="frequency (Hz)", y="amplitude (Pa)")
    shown = (
        ("at the turning focus", both[np.arange(6400), step], STYLE.original),
        ("in the middle", both[:, 21], STYLE.reproduced),
    )
    for label, wave, colour in shown:
        time_axis.plot(np.arange(6400) / 32, wave, color=colour, linewidth=0.8)
        lines = 2 * np.abs(np.fft.rfft(wave)) / len(wave)
        lines[0] /= 2
        line_axis.plot(np.arange(41) * 5, lines[:41], color=colour, label=label)
    line_axis.legend(frameon=False, fontsize=8)
    return figure


if __name__ == "__main__":
    for name, draw in {"draw-maps": maps, "draw-spectrum": spectrum, "draw-press": press}.items():
        (Path(sys.argv[1]) / f"{name}.png").write_bytes(png_bytes(draw()))
    studio(Path(sys.argv[1]))
