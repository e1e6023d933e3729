"""Time from each kind of failure of a playing studio to silence, as reported by the emulated units.

The browser is controlled directly by its own protocol, because test tools keep hidden pages visible.
"""

import contextlib
import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import urllib.request
from pathlib import Path

import psutil
from tests.simulators.udp_proxy import UdpProxy
from websockets.sync.client import connect

SWITCH, SILENT_PATTERN = 0x12, 0x16
"""Commands that start a bank, and that silence the unit."""

FAILSAFE, OVER = 0x80, 0x10
"""Bits of a unit's state: the failsafe has acted, and the bank has ended, which also means silence."""

CHROMIUM = shutil.which("chromium") or "chromium"

DEATHS = (
    "STOP pressed",
    "tab hidden behind another",
    "window minimized",
    "tab closed",
    "process of the tab killed",
    "script hangs",
    "server halted, STOP pressed",
    "server halted",
    "browser halted",
    "browser killed",
    "server killed",
    "player killed",
    "player halted",
    "cable to the array cut",
)


class DevTools:
    """Client of the browser's DevTools protocol, one command at a time."""

    def __init__(self, address):
        self._socket = connect(address, max_size=None, legacy=True)
        self._number = 0

    def __call__(self, method, **given):
        self._number += 1
        self._socket.send(json.dumps({"id": self._number, "method": method, "params": given}))
        while (answer := json.loads(self._socket.recv(timeout=20))).get("id") != self._number:
            pass
        if "error" in answer:
            raise RuntimeError(f"{method}: {answer['error']['message']}")
        return answer["result"]

    def tell(self, method, **given):
        """Send a command without waiting for the answer."""
        self._number += 1
        self._socket.send(json.dumps({"id": self._number, "method": method, "params": given}))

    def evaluate(self, script):
        found = self("Runtime.evaluate", expression=script, returnByValue=True, awaitPromise=True)
        if "exceptionDetails" in found:
            raise RuntimeError(str(found["exceptionDetails"].get("exception", {}).get("description")))
        return found["result"].get("value")

    def until(self, script, timeout=60.0):
        end = time.monotonic() + timeout
        while time.monotonic() < end:
            with contextlib.suppress(RuntimeError):
                if found := self.evaluate(script):
                    return found
            time.sleep(0.05)
        raise TimeoutError(f"{script}: {self.evaluate('JSON.stringify(studio.link.state.player)')}")


class Browser:
    """Headless Chromium without a test tool in between."""

    def __init__(self):
        self._profile = tempfile.TemporaryDirectory(ignore_cleanup_errors=True)
        words = [CHROMIUM, "--no-sandbox", "--headless=new", "--remote-debugging-port=0", "--no-first-run"]
        self.process = subprocess.Popen(
            [*words, f"--user-data-dir={self._profile.name}", "about:blank"],
            stderr=subprocess.DEVNULL,
            start_new_session=True,
        )
        told = Path(self._profile.name) / "DevToolsActivePort"
        end = time.monotonic() + 30
        while not told.exists() or len(told.read_text().split()) < 2:
            if time.monotonic() > end:
                raise TimeoutError("the browser did not start within 30 s")
            time.sleep(0.05)
        self._port, path = told.read_text().split()
        self.itself = DevTools(f"ws://127.0.0.1:{self._port}{path}")

    def open(self, address):
        """Open a page; returns its target id and a client for it."""
        number = self.itself("Target.createTarget", url=address)["targetId"]
        return number, DevTools(f"ws://127.0.0.1:{self._port}/devtools/page/{number}")

    def pages(self):
        with urllib.request.urlopen(f"http://127.0.0.1:{self._port}/json") as answer:
            return json.load(answer)

    def kill(self, sort=signal.SIGKILL):
        """Send a signal to the browser and all its processes."""
        with contextlib.suppress(psutil.NoSuchProcess):
            for each in [*psutil.Process(self.process.pid).children(recursive=True), self.process]:
                with contextlib.suppress(ProcessLookupError, psutil.NoSuchProcess):
                    each.send_signal(sort)

    def close(self):
        self.kill(signal.SIGCONT)
        self.kill()
        self.process.wait()
        self._profile.cleanup()


def solved_take(folder):
    """A towel stroke with its drive, so that the studio need not solve it."""
    from midair.rig import record
    from midair.studio.work import SolveRequest, solve_take

    record("virtual:towel", 0.5, path=folder / "towel.h5", seed=1)
    choices = (("method", "live"), ("level", "auto"))
    solve_take(
        SolveRequest(take=str(folder / "towel.h5"), drive=str(folder / "towel.drive.h5"), choices=choices), _ignored
    )


def _ignored(*_):
    """Ignore the progress."""


class PlayingStudio:
    """A studio whose units emit sound because a visible page has armed them."""

    def __init__(self, folder, units=4):
        self.tap, self.browser, self.server, self.process = UdpProxy(units), None, None, 0
        words = [sys.executable, "-m", "midair", "studio", str(folder), "--no-browser"]
        self.server = subprocess.Popen(
            [*words, "--device", f"autd3:{self.tap.address}"], stdout=subprocess.PIPE, text=True
        )
        self.browser = Browser()
        link = self.server.stdout.readline().strip()
        self.root = f"{link.partition('/enter')[0]}/#calibrate"
        self.number, self.page = self.browser.open(link)
        self.page.until("globalThis.studio?.link?.page > 0")
        # This panel draws no frames, which are not needed here.
        self.page.evaluate("location.hash = '#calibrate'")
        self.page.until("studio.link.state.player.state === 'ready'", timeout=90)
        self.process = self.player.pid

    @property
    def player(self):
        """The process that controls the array; it listens on the stop port."""
        port = self.page.evaluate("studio.link.state.studio.stop_port")
        return next(
            each
            for each in psutil.Process(self.server.pid).children(recursive=True)
            if any(one.laddr.port == port and one.status == "LISTEN" for one in each.net_connections("inet"))
        )

    def begin(self, attempts=4):
        """Start playback; repeated if emulated units on a busy machine stop answering."""
        for _ in range(attempts):
            check = "{take: 'towel.h5', repeats: 100, attenuate: true}"
            self.page.evaluate(
                f"""{{ const now = studio.now = {{ ended: '' }}; studio.link.order('play', 'check', {check})
                .then((found) => studio.link.order('play', 'play', {{clearance: found.number}}))
                .then(() => {{ now.ended = 'played'; }}, (wrong) => {{ now.ended = wrong.message; }}); }} 0"""
            )
            self.page.until(
                "studio.now.ended || (studio.link.state.player.emitting && studio.link.state.player.done > 0)"
            )
            time.sleep(0.3)
            if not self.page.evaluate("studio.now.ended"):
                return
            self.page.until("studio.link.state.player.state === 'ready'")
        raise RuntimeError(self.page.evaluate("studio.now.ended"))

    def close(self):
        if self.browser is not None:
            self.browser.close()
        if self.process:
            with contextlib.suppress(ProcessLookupError):
                os.kill(self.process, signal.SIGCONT)
        if self.server is not None:
            self.server.send_signal(signal.SIGCONT)
            self.server.terminate()
            with contextlib.suppress(subprocess.TimeoutExpired):
                self.server.wait(15)
            self.server.kill()
            self.server.wait()
            self.server.stdout.close()
        self.tap.close()


def happens(name, at):
    """Cause one failure."""
    match name:
        case "STOP pressed" | "server halted, STOP pressed":
            at.page.tell("Runtime.evaluate", expression="document.querySelector('#stop').click()")
        case "tab closed":
            at.browser.itself.tell("Target.closeTarget", targetId=at.number)
        case "tab hidden behind another":
            at.browser.itself.tell("Target.createTarget", url="about:blank")
        case "window minimized":
            window = at.browser.itself("Browser.getWindowForTarget", targetId=at.number)["windowId"]
            at.browser.itself.tell("Browser.setWindowBounds", windowId=window, bounds={"windowState": "minimized"})
        case "process of the tab killed":
            at.page.tell("Page.crash")
        case "browser killed":
            at.browser.kill()
        case "browser halted":
            at.browser.kill(signal.SIGSTOP)
        case "script hangs":
            script = "{ const end = performance.now() + 3000; while (performance.now() < end); }"
            at.page.tell("Runtime.evaluate", expression=script)
        case "server killed":
            at.server.kill()
        case "server halted":
            at.server.send_signal(signal.SIGSTOP)
        case "player killed":
            os.kill(at.process, signal.SIGKILL)
        case "player halted":
            os.kill(at.process, signal.SIGSTOP)
        case "cable to the array cut":
            at.tap.passes = False
        case _:
            raise ValueError(name)


def seconds_to_silence(tap, since, patience=4.0):
    """Time from an event to silence, and its source: the last command of every unit is silence, or the units report it.

    A query counts as traffic for the units and delays their failsafe, so they are queried only after 60 ms without
    traffic. They report whether their failsafe has acted. A bank that has ended also means silence, at most half a
    second after the last switch.
    """
    until, asked = since + patience, since
    while time.monotonic() < until:
        time.sleep(0.005)
        orders = [(at, port, kind) for at, port, kind, _ in tap.frames()[-4000:] if kind in (SWITCH, SILENT_PATTERN)]
        last = {port: (at, kind) for at, port, kind in orders}
        if tap.passes and all(kind == SILENT_PATTERN and at > since for at, kind in last.values()):
            return max(at for at, _ in last.values()) - since, "an order to be silent"
        reached = tap.sent[-1][0] if tap.passes else since
        if time.monotonic() - max(reached, asked) > 0.06:
            states = tap.states()
            asked = time.monotonic()
            if states and all(state & FAILSAFE for state in states):
                return asked - since, "the units' failsafe"
            if states and all(state & OVER for state in states):
                return asked - since, "the units: played out"
    return float("inf"), "none"


def mends(name, at):
    """Restart the failed part; return whether the same studio can continue."""
    match name:
        case "STOP pressed" | "script hangs":
            pass
        case "tab hidden behind another":
            at.browser.itself("Target.activateTarget", targetId=at.number)
        case "window minimized":
            window = at.browser.itself("Browser.getWindowForTarget", targetId=at.number)["windowId"]
            at.browser.itself("Browser.setWindowBounds", windowId=window, bounds={"windowState": "normal"})
        case "tab closed" | "process of the tab killed":
            at.number, at.page = at.browser.open(at.root)
        case "server halted" | "server halted, STOP pressed":
            at.server.send_signal(signal.SIGCONT)
        case _:
            return False
    at.page.until("globalThis.studio?.link?.controls && document.visibilityState === 'visible'")
    at.page.until("studio.link.state.player.state === 'ready'")
    return True


def death(name, at):
    """Cause one failure and measure the time to silence."""
    at.begin()
    if name.startswith("server halted,"):
        at.server.send_signal(signal.SIGSTOP)
        time.sleep(0.1)
    since = time.monotonic()
    happens(name, at)
    return seconds_to_silence(at.tap, since)


def deaths(names=DEATHS, say=print):
    """Cause each failure in turn and return times in s and sources; a studio that survives is used again."""
    say(f"deaths: ms from the event to silence; load {os.getloadavg()[0]:.1f}")
    found, at = {}, None
    with tempfile.TemporaryDirectory() as folder, contextlib.ExitStack() as held:
        solved_take(Path(folder))
        for name in names:
            if at is None:
                at = held.enter_context(contextlib.closing(PlayingStudio(Path(folder))))
            took, by = found[name] = death(name, at)
            say(f"  {name:30}{1e3 * took:6.0f} ms   by {by}")
            if not mends(name, at):
                held.close()
                at = None
    return found
