"""Every way in which a studio that plays can end: from the event to silence, by the word of the emulated units.

The browser is ours, spoken to by its own protocol: a tool for tests keeps pages in sight that are not.
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
from websockets.sync.client import connect

from midair.testing.udp_tap import UdpTap

SWITCH, SILENT_PATTERN = 0x12, 0x16
"""Commands that make a bank sound, and that silence."""

FAILSAFE, OVER = 0x80, 0x10
"""Bits of a unit's state: its failsafe has acted, and its bank is played out, which ends in silence."""

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


class Told:
    """A place that takes orders of the browser's protocol, one after the other."""

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
        """An order whose answer nobody waits for."""
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
    """Chromium without a screen, and with nobody in between."""

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
                raise TimeoutError("the browser does not come")
            time.sleep(0.05)
        self._port, path = told.read_text().split()
        self.itself = Told(f"ws://127.0.0.1:{self._port}{path}")

    def open(self, address):
        """A page: its number among the browser's, and where it takes orders."""
        number = self.itself("Target.createTarget", url=address)["targetId"]
        return number, Told(f"ws://127.0.0.1:{self._port}/devtools/page/{number}")

    def pages(self):
        with urllib.request.urlopen(f"http://127.0.0.1:{self._port}/json") as answer:
            return json.load(answer)

    def kill(self, sort=signal.SIGKILL):
        """To the browser and all its processes."""
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
    """A towel stroke and its drive, so that no studio has to solve first."""
    from midair.rig import record
    from midair.studio.work import SolveRequest, solve_take

    record("virtual:towel", 0.5, path=folder / "towel.h5", seed=1)
    choices = (("method", "live"), ("level", "auto"))
    solve_take(
        SolveRequest(take=str(folder / "towel.h5"), drive=str(folder / "towel.drive.h5"), choices=choices), _untold
    )


def _untold(*_):
    """Nobody looks on."""


class ArrayInfo:
    """A studio whose units sound because a page in sight armed them."""

    def __init__(self, folder, units=4):
        self.tap, self.browser, self.server, self.process = UdpTap(units), None, None, 0
        words = [sys.executable, "-m", "midair", "studio", str(folder), "--no-browser"]
        self.server = subprocess.Popen(
            [*words, "--device", f"autd3:{self.tap.address}"], stdout=subprocess.PIPE, text=True
        )
        self.browser = Browser()
        link = self.server.stdout.readline().strip()
        self.root = f"{link.partition('/enter')[0]}/#calibrate"
        self.number, self.page = self.browser.open(link)
        self.page.until("globalThis.studio?.link?.page > 0")
        # Nothing is drawn: a picture of frames is no part of this.
        self.page.evaluate("location.hash = '#calibrate'")
        self.page.until("studio.link.state.player.state === 'ready'", timeout=90)
        self.process = self.player.pid

    @property
    def player(self):
        """The process that has the array: it listens where STOP goes."""
        port = self.page.evaluate("studio.link.state.studio.stop_port")
        return next(
            each
            for each in psutil.Process(self.server.pid).children(recursive=True)
            if any(one.laddr.port == port and one.status == "LISTEN" for one in each.net_connections("inet"))
        )

    def begin(self, attempts=4):
        """Let it sound; on a busy machine emulated units may stop answering, then once more."""
        for _ in range(attempts):
            check = "{take: 'towel.h5', repeats: 100, attenuate: true}"
            self.page.evaluate(
                f"""{{ const now = studio.now = {{ ended: '' }}; studio.link.order('play', 'check', {check})
                .then((found) => studio.link.order('play', 'play', {{admission: found.number}}))
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
    """Let something end."""
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
    """From an event to silence, and by whose word: the last order of every unit is silence, or the units say so.

    A question is a word to the units and holds their failsafe off: they are asked when nothing has reached them for
    60 ms. They say whether their failsafe has acted; a bank that was played out ends in silence, too, half a second
    after the last switch at most.
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
    return float("inf"), "nobody"


def mends(name, at):
    """What has ended begins again; whether the same studio can go on."""
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
    """One way to end."""
    at.begin()
    if name.startswith("server halted,"):
        at.server.send_signal(signal.SIGSTOP)
        time.sleep(0.1)
    since = time.monotonic()
    happens(name, at)
    return seconds_to_silence(at.tap, since)


def deaths(names=DEATHS, say=print):
    """Each in turn, what they took, in s, and by whose word; a studio that survives one serves for the next, too."""
    say(f"deaths: ms from the event to silence; load {os.getloadavg()[0]:.1f}")
    found, at = {}, None
    with tempfile.TemporaryDirectory() as folder, contextlib.ExitStack() as held:
        solved_take(Path(folder))
        for name in names:
            if at is None:
                at = held.enter_context(contextlib.closing(ArrayInfo(Path(folder))))
            took, by = found[name] = death(name, at)
            say(f"  {name:30}{1e3 * took:6.0f} ms   by {by}")
            if not mends(name, at):
                held.close()
                at = None
    return found
