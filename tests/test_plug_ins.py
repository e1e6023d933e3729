"""The sensor and the file format of docs/plug-ins.md, as an installed package."""

import re
import socket
import struct
import threading
from pathlib import Path

import numpy as np
import pytest

from midair.cli import run
from midair.files import formats, open_take
from midair.rig import VirtualRig, sensor_named
from midair.rig.names.sensor_names import SENSORS

PAGE = Path(__file__).parents[1] / "docs" / "plug-ins.md"


@pytest.fixture
def my_lab(tmp_path, monkeypatch):
    """The package of the page, on the path as pip installs it."""
    text = PAGE.read_text(encoding="utf-8")
    (table,) = re.findall(r"```toml\n(.*?)```", text, re.DOTALL)
    blocks = re.findall(r"`my_lab\.(\w+)` .*?```python\n(.*?)```", text, re.DOTALL)
    (tmp_path / "my_lab").mkdir()
    for name, block in blocks:
        (tmp_path / "my_lab" / f"{name}.py").write_text(block, encoding="utf-8")
    folder = tmp_path / "my_lab-1.0.dist-info"
    folder.mkdir()
    (folder / "METADATA").write_text("Metadata-Version: 2.1\nName: my-lab\nVersion: 1.0\n")
    points = re.sub(r'entry-points\."([\w.]+)"', r"\1", table.replace('"."', ".").split("\n\n", 1)[1])
    points = points.replace("project.", "").replace('".int16"', ".int16").replace('"', "")
    (folder / "entry_points.txt").write_text(points)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.chdir(tmp_path)
    for registry in (formats.FORMATS, SENSORS):
        registry.__dict__.pop("_others", None)
    yield
    monkeypatch.undo()
    for registry in (formats.FORMATS, SENSORS):
        registry.__dict__.pop("_others", None)


def test_the_format_of_the_page_is_read_written_and_refused_in_one_line(my_lab, capsys):
    counts = np.arange(160 * 16).astype("<i2")
    counts.tofile("raw.int16")
    assert run(["import", "raw.int16", "take.h5"]) == 1
    assert "raw.int16: expected a frame rate" in capsys.readouterr().err
    assert run(["import", "raw.int16", "take.h5", "--rate", "1kHz"]) == 0
    assert open_take("take.h5").recording.rate == 1000.0
    assert run(["export", "take.h5", "again.int16"]) == 0
    np.testing.assert_array_equal(np.fromfile("again.int16", "<i2"), counts)
    assert ".int16" in formats.FORMATS


def test_the_sensor_of_the_page_is_found_and_lost_frames_are_counted(my_lab):
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    ended = threading.Event()

    def send():
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
            number = 0
            while not ended.wait(0.001):
                if number % 10 != 5:
                    sender.sendto(struct.pack("<I16f", number, *range(16)), ("127.0.0.1", port))
                number += 1

    sending = threading.Thread(target=send)
    sending.start()
    try:
        with sensor_named(f"udp:{port}?hz=1000", VirtualRig()) as sensor:
            sensor.start()
            blocks = [sensor.read(25) for _ in range(4)]
    finally:
        ended.set()
        sending.join()
    there = {block.first + n for block in blocks for n in range(len(block.samples))}
    lost = set(range(max(there))) - there
    assert lost
    assert len({frame % 10 for frame in lost}) == 1, "each tenth frame was not sent"
    assert blocks[0].samples[0].ravel().tolist() == list(range(16))
