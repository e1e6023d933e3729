"""A UDP proxy that loses, delays, repeats and reorders datagrams, as a network does."""

import heapq
import select
import socket
import threading
import time

import numpy as np


class Proxy:
    """Passes datagrams on to the port `to` of this computer, and answers back.

    `loss`, `reordering` and `repeating` are shares: those that never come, those that are held for 3 ms more so
    that others overtake, and those that come twice. Each takes `delay` and up to `jitter` more, in s; order is kept
    otherwise.
    """

    def __init__(self, to, *, loss=0.0, delay=0.0, jitter=0.0, reordering=0.0, repeating=0.0, seed=1):
        self.to, self._rng = ("127.0.0.1", to), np.random.default_rng(seed)
        self._loss, self.delay, self._jitter = loss, delay, jitter
        self._reordering, self._repeating = reordering, repeating
        self._front, self._back = (socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(2))
        self._front.bind(("127.0.0.1", 0))
        self._back.bind(("127.0.0.1", 0))
        self.port = self._front.getsockname()[1]
        self.seen, self.lost = [], 0
        self._speaker = None
        self._ends = False
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def close(self):
        self._ends = True
        self._thread.join()
        self._front.close()
        self._back.close()

    def again(self, datagrams):
        for each in datagrams:
            self._back.sendto(each, self.to)

    def _run(self):
        waiting, count, latest = [], 0, 0.0
        while not self._ends:
            wait = 0.02 if not waiting else max(0.0, min(0.02, waiting[0][0] - time.monotonic()))
            for ready in select.select([self._front, self._back], [], [], wait)[0]:
                datagram, sender = ready.recvfrom(4096)
                if ready is self._back:
                    self._front.sendto(datagram, self._speaker)
                    continue
                self._speaker = sender
                self.seen.append(datagram)
                if self._rng.random() < self._loss:
                    self.lost += 1
                    continue
                due = time.monotonic() + self.delay + self._jitter * self._rng.random()
                overtaken = self._rng.random() < self._reordering
                due = due + 3e-3 if overtaken else max(due, latest)
                latest = latest if overtaken else due
                for _ in range(1 + (self._rng.random() < self._repeating)):
                    heapq.heappush(waiting, (due, count, datagram))
                    count += 1
            while waiting and waiting[0][0] <= time.monotonic():
                self._back.sendto(heapq.heappop(waiting)[2], self.to)
