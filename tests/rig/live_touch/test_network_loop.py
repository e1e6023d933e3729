"""No frame sounds for long, whatever the network does: speaker, faulty network, receiver and loop on loopback."""

import socket
import threading

import numpy as np
import pytest
from tests.rig.live_touch.test_live_loop import ran
from tests.rig.live_touch.test_receiving import KEY, free_port, speaking
from tests.rig.live_touch.udp_proxy import Proxy

from midair.rig.live_touch.receiving import NetworkSource

pytest.importorskip("numba")


def longest(frames):
    """Longest time in s for which the units emitted the same phases at the same intensity."""
    best, since, before = 0.0, 0, (b"", 0)
    for phases, intensity, instant in frames:
        if (phases.tobytes(), intensity) != before:
            best = max(best, (instant - since) * 1e-9 if before[1] else 0.0)
            since, before = instant, (phases.tobytes(), intensity)
    return best


def touched(disturb=lambda proxy: None, *, seconds=1.5, **way):
    """(longest time that a frame stood, frames played, counts of the receiver) for frames that differ from each other.

    `disturb` is called after two thirds of the time.
    """
    source = NetworkSource(("127.0.0.1", free_port()), KEY, buffer=0.015, patience=10.0)
    source.bind()
    proxy, got = Proxy(source.port, **way), []

    def listen():
        got.extend(ran(source, duration=seconds))

    listener = threading.Thread(target=listen)
    listener.start()
    rounds = np.random.default_rng(2).uniform(5.0, 40.0, (4000, 4))
    try:
        with speaking(proxy.port, rounds=rounds) as speaker:
            disturbed = False

            def going():
                nonlocal disturbed
                if not disturbed and speaker.spoken.frames > 1000 * seconds * 2 / 3:
                    disturbed = True
                    disturb(proxy)
                return listener.is_alive()

            speaker.run(going)
    finally:
        listener.join(10)
        proxy.close()
    _, ring, frames, problem = got
    assert problem is None
    return longest(frames), ring.count("played"), source.counted


def longer_way(proxy):
    proxy.delay = 0.04


def replay(proxy):
    """A stranger repeats all datagrams of this run, each twice."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger:
        for datagram in 2 * proxy.seen:
            stranger.sendto(datagram, proxy.to)


@pytest.mark.long
@pytest.mark.parametrize(
    ("disturb", "way"),
    [(longer_way, {}), (replay, {}), (lambda proxy: None, {"loss": 0.05}), (lambda proxy: None, {"jitter": 0.025})],
    ids=["longer way", "replay", "loss", "jitter"],
)
def test_no_frame_sounds_for_more_than_40_ms(disturb, way):
    # A busy machine may hold this process up for longer: one run of some is in time.
    runs = []
    for _ in range(5):
        runs.append(touched(disturb, **way))
        stood, played, counted = runs[-1]
        assert counted.frames > 500
        if stood < 0.04 and played > 200:
            return
    pytest.fail(f"a frame sounded for too long, or few were played: {runs}")
