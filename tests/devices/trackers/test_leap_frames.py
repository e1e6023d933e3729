"""Frames of the Leap, and the public client that reads the same server."""

import json
import os
import shutil
import subprocess
import threading
from pathlib import Path

import numpy as np
import pytest
from tests.simulators.leap_server import LeapServer, frame

import midair
from midair.devices.trackers.leap import LeapFrames
from midair.model import PalmPath

POSE = (0.01, -0.02, 0.2, 0, 0.6, -0.8, 0, 0.8, 0.6)


def test_a_frame_is_turned_to_metres_with_z_up_and_a_malformed_one_described():
    pose = LeapFrames().read(frame(1, 2.5, POSE, 0.75))
    np.testing.assert_allclose(pose.values, POSE)
    assert (pose.stamp, pose.confidence) == (2.5, 0.75)
    for wrong in ([], {"hands": [{"id": 1}]}, {"hands": 5}, {"hands": [None], "timestamp": 1}):
        assert isinstance(LeapFrames().read(wrong), str)


def test_the_same_hand_is_followed_while_it_is_seen():
    reader, two = LeapFrames(), frame(1, 0, POSE, hand=3)
    other = frame(900, 0, (0.3, *POSE[1:]), hand=4)["hands"][0]
    assert reader.read(two).values[0] == 0.01
    assert reader.read({**two, "hands": [other, *two["hands"]]}).values[0] == 0.01
    assert reader.read({**two, "hands": [other]}).values[0] == 0.3
    assert LeapFrames("left").read(two) is None


def test_a_recording_of_frames_is_replayed(tmp_path):
    frames = [frame(n, 80 + n / 110, (0.001 * n, *POSE[1:])) for n in range(50)]
    (tmp_path / "hand.json").write_text(json.dumps({"frames": frames, "metadata": {}}))
    now = [0.0]
    with midair.open_tracker(f"replay:{tmp_path / 'hand.json'}", clock=lambda: now[0]) as tracker:
        now[0] = 0.1
        assert tracker.newest().centre[0, 0] == pytest.approx(0.011)


@pytest.mark.skipif(
    shutil.which("node") is None or "MIDAIR_NODE_MODULES" not in os.environ,
    reason="needs node, and MIDAIR_NODE_MODULES, the folder of npm that has leapjs",
)
@pytest.mark.long
def test_the_public_client_reads_the_same_poses():
    times = np.arange(60) / 110
    palm = PalmPath.from_rows(np.column_stack([times, 1e-3 * np.arange(60), np.tile([*POSE[1:], 1.0], (60, 1))]))
    server = LeapServer()
    script = f"""
        const Leap = require({str(Path(os.environ["MIDAIR_NODE_MODULES"]) / "leapjs")!r});
        const controller = new Leap.Controller({{port: {server.port}, background: true}});
        let seen = 0;
        console.log = () => {{}};
        controller.on('frame', frame => {{
            for (const hand of frame.hands)
                process.stdout.write(JSON.stringify([frame.timestamp, hand.palmPosition, hand.palmNormal,
                                                     hand.direction, hand.confidence]) + '\\n');
            if (frame.hands.length && ++seen == 40) process.exit(0);
        }});
        controller.connect();
    """
    with subprocess.Popen(["node", "-e", script], stdout=subprocess.PIPE, text=True) as client:
        try:
            assert server.asked.wait(10)
            with midair.open_tracker(f"leap:127.0.0.1:{server.port}") as tracker:
                playing = threading.Thread(target=server.play, args=(palm,))
                playing.start()
                said = [json.loads(line) for line in client.communicate(timeout=20)[0].splitlines()]
                playing.join()
                ours = tracker.poses()
        finally:
            client.kill()
            server.close()
    assert len(said) == 40
    theirs = {round(row[1][0]): row for row in said}
    matched = [(row, theirs[round(row[1] * 1e3)]) for row in ours.rows if round(row[1] * 1e3) in theirs]
    assert len(matched) >= 35
    for mine, (_, (x, y, z), (nx, ny, nz), _, confidence) in matched:
        np.testing.assert_allclose(mine[1:7], [x / 1e3, -z / 1e3, y / 1e3, nx, -nz, ny], atol=1e-6)
        assert confidence == 1
