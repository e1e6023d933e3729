"""The package in examples/plugin, installed: its sensor is recorded, its format read and written, its panel served."""

import contextlib
import json
import os
import socket
import struct
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).parents[1]


@pytest.fixture(scope="module")
def midair(tmp_path_factory):
    """Runs `midair` in a folder, beside the installed package."""
    pytest.importorskip("hatchling")
    target, folder = tmp_path_factory.mktemp("plugin"), tmp_path_factory.mktemp("work")
    pip = [sys.executable, "-m", "pip", "--disable-pip-version-check", "--quiet", "install", "--no-deps"]
    subprocess.run([*pip, "--no-build-isolation", "--target", target, ROOT / "examples" / "plugin"], check=True)
    paths = os.pathsep.join([str(target), *filter(None, [os.environ.get("PYTHONPATH")])])

    def run(*words):
        command = [sys.executable, "-m", "midair", *words]
        done = subprocess.run(
            command, cwd=folder, env=os.environ | {"PYTHONPATH": paths}, capture_output=True, text=True
        )
        return done.returncode, done.stdout, done.stderr

    run.folder, run.paths = folder, paths
    return run


@pytest.mark.long
def test_its_format_is_read_written_and_refused_in_one_line(midair):
    counts = np.arange(160 * 16).astype("<i2")
    counts.tofile(midair.folder / "raw.int16")
    status, _, err = midair("import", "raw.int16", "take.h5")
    assert (status, err.count("\n")) == (1, 1)
    assert "raw.int16: expected a frame rate" in err
    status, _, err = midair("import", "raw.int16", "take.h5", "--rate", "1kHz", "--json")
    assert (status, err) == (0, "")
    assert midair("export", "take.h5", "again.int16")[0] == 0
    np.testing.assert_array_equal(np.fromfile(midair.folder / "again.int16", "<i2"), counts)
    assert ".int16" in midair("info", "take.unknown")[2]


@pytest.mark.long
def test_its_sensor_is_found_recorded_and_lost_frames_are_counted(midair):
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    ended = threading.Event()

    def send():
        with contextlib.closing(socket.socket(socket.AF_INET, socket.SOCK_DGRAM)) as sender:
            begin, number = time.monotonic(), 0
            while not ended.wait(0.01):
                for each in range(number, round((time.monotonic() - begin) * 100)):
                    if each % 10 != 5:
                        values = struct.pack("<I16f", each, *(channel / 16 for channel in range(16)))
                        sender.sendto(values, ("127.0.0.1", port))
                    number = each + 1

    sending = threading.Thread(target=send)
    sending.start()
    try:
        status, out, err = midair("record", f"udp:{port}?hz=100", "udp.h5", "--duration", "0.5s", "--json")
    finally:
        ended.set()
        sending.join()
    assert status == 0, err
    (take,) = json.loads(out)
    assert "udp:PLACE" in midair("record", "nothing:here")[2]
    assert (take["frames"], take["lost_frames"]) == (50, 5), take


SERVES = """
import json, pathlib, re, tempfile
from midair.studio import Studio, StudioPlan
from starlette.testclient import TestClient

folder = pathlib.Path(tempfile.mkdtemp())
studio = Studio(StudioPlan(folder=folder), folder, 8347)
client = TestClient(studio.application(), base_url="http://127.0.0.1:8347")
client.cookies.set(studio.keys.cookie, studio.keys.session)
page = client.get("/").text
script = client.get(re.search('data-room="cells" data-script="([^"]+)"', page)[1])
studio.store.put(levels={"rms": [0.1, 0.3, 0.2]})
with client.websocket_connect("ws://127.0.0.1:8347/socket", headers={"origin": "http://127.0.0.1:8347"}) as socket:
    socket.send_text(json.dumps({"id": 1, "room": "cells", "order": "loudest"}))
    while (answer := json.loads(socket.receive_text())).get("id") != 1:
        pass
studio.playing.close()
print(json.dumps([re.findall('data-room="(.*?)"', page), script.text, answer["ok"]]))
"""


@pytest.mark.long
def test_its_panel_is_served_and_answers(midair):
    pytest.importorskip("starlette")
    command = [sys.executable, "-W", "ignore", "-c", SERVES]
    done = subprocess.run(command, env=os.environ | {"PYTHONPATH": midair.paths}, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    tabs, script, loudest = json.loads(done.stdout)
    assert tabs == ["record", "calibrate", "reproduce", "compare", "draw", "study", "live", "gallery", "cells"]
    assert "export default class Cells" in script
    assert loudest == 1
