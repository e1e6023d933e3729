import http.client
import json
import os
import subprocess
import sys
import time
import warnings
from pathlib import Path

import pytest

from midair.studio import Studio, StudioPlan

PORT = 8345
ROOT = f"http://127.0.0.1:{PORT}"
SOCKET = f"ws://127.0.0.1:{PORT}/socket"


@pytest.fixture
def folder(tmp_path):
    """The folder of a studio in this process."""
    (made := tmp_path / "folder").mkdir()
    return made


@pytest.fixture
def studio(folder, tmp_path):
    (samples := tmp_path / "samples").mkdir()
    made = Studio(StudioPlan(folder=folder), samples, PORT)
    yield made
    for each in (made.panels["live"], made.playing, made.jobs, made.reading):
        each.close()


@pytest.fixture
def client(studio):
    with warnings.catch_warnings():
        # Starlette recommends another client library, which is not needed otherwise.
        warnings.simplefilter("ignore")
        from starlette.testclient import TestClient
    client = TestClient(studio.application(), base_url=ROOT)
    client.cookies.set(studio.keys.cookie, studio.keys.session)
    return client


class PageClient:
    """A page that can send any message."""

    def __init__(self, socket):
        self.socket, self.number = socket, 0
        self.state = json.loads(socket.receive_text())

    @property
    def page(self):
        return self.state["page"]

    def order(self, room, order, **given):
        self.number += 1
        return self.say({"id": self.number, "room": room, "order": order, "with": given})

    def say(self, said):
        self.socket.send_text(json.dumps(said))
        while True:
            answer = json.loads(self.socket.receive_text())
            if "set" in answer:
                self.state["whole"] |= answer["set"]
            elif answer.get("id") == said.get("id", 0):
                return answer


@pytest.fixture
def talk(client):
    with client.websocket_connect(SOCKET, headers={"origin": ROOT}) as socket:
        yield PageClient(socket)


class LoopStarted:
    """A studio that runs: its process, its folder, and the link that it printed."""

    def __init__(self, folder, state, *words):
        self.folder = folder
        command = [Path(sys.executable).with_name("midair"), "studio", str(folder), "--no-browser", *words]
        began = time.monotonic()
        self.process = subprocess.Popen(
            command, stdout=subprocess.PIPE, text=True, env={**os.environ, "MIDAIR_STATE": str(state)}
        )
        self.link = self.process.stdout.readline().strip()
        self.took = time.monotonic() - began
        self.root = self.link.partition("/enter")[0]
        self.address = f"ws://{self.root.removeprefix('http://')}/socket"

    def ask(self, method, path, body=None, headers=()):
        """Send a request as the studio's own page; returns the answer and its text."""
        line = http.client.HTTPConnection(self.root.removeprefix("http://"))
        line.request(method, path, body, {"Origin": self.root, **dict(headers)})
        answer = line.getresponse()
        text = answer.read()
        line.close()
        return answer, text

    def enter(self):
        """Open the link; returns the cookie."""
        answer, _ = self.ask("GET", self.link.removeprefix(self.root))
        return answer.getheader("set-cookie").partition(";")[0]

    def connect(self, cookie):
        """Open a page."""
        from websockets.sync.client import connect

        return connect(self.address, additional_headers={"Cookie": cookie}, origin=self.root, max_size=None)

    def close(self):
        if self.process.poll() is None:
            self.process.terminate()
            try:
                self.process.wait(15)
            except subprocess.TimeoutExpired:
                self.process.kill()
                self.process.wait()
        self.process.stdout.close()


@pytest.fixture
def studio_at(tmp_path):
    made = []

    def open_studio(*words):
        folder = tmp_path / f"folder-{len(made)}"
        folder.mkdir()
        made.append(LoopStarted(folder, tmp_path / "state", *words))
        assert made[-1].link.startswith("http://127.0.0.1:"), "one line with the link, flushed"
        return made[-1]

    yield open_studio
    for each in made:
        each.close()


class Look:
    """A page with its console errors and waits: the security policy forbids Playwright's own text predicates."""

    def __init__(self, page, root):
        self.page, self.wrong, self.elsewhere = page, [], []
        page.on("console", lambda said: self.wrong.append(said.text) if said.type == "error" else None)
        page.on("pageerror", lambda wrong: self.wrong.append(str(wrong)))
        page.on("request", lambda asked: self._asked(asked.url, root))

    def _asked(self, url, root):
        if not url.startswith((root, "http://127.0.0.1:", "ws://127.0.0.1:", "data:", "blob:")):
            self.elsewhere.append(url)

    def until(self, script, *, timeout=60.0):
        end = time.monotonic() + timeout
        while time.monotonic() < end:
            try:
                if found := self.page.evaluate(script):
                    return found
            except Exception as wrong:
                if "destroyed" not in str(wrong) and "not defined" not in str(wrong):
                    raise
            time.sleep(0.05)
        shown = self.page.evaluate("document.body.innerText.slice(0, 1000)")
        state = self.page.evaluate("JSON.stringify(globalThis.studio?.link.state ?? {}).slice(0, 1000)")
        raise AssertionError(f"{script}: not within {timeout} s; {self.wrong}; {shown}; {state}")

    def serious(self):
        """Serious findings of axe on accessibility, with the elements."""
        from axe_playwright_python.sync_playwright import Axe

        found = Axe().run(self.page).response["violations"]
        return [(one["id"], one["nodes"][0]["html"]) for one in found if one["impact"] in ("serious", "critical")]

    def shown(self, name, folder, *sizes):
        """Show the page in each scheme and width; then keep a picture, and find it accessible and not too wide."""
        from axe_playwright_python.sync_playwright import Axe

        for scheme, width in sizes:
            self.page.emulate_media(color_scheme=scheme)
            self.page.set_viewport_size({"width": width, "height": 800})
            yield scheme
            self.page.screenshot(path=f"{os.environ.get('MIDAIR_PICTURES', folder)}/{name}-{scheme}-{width}.png")
            assert self.page.evaluate("document.documentElement.scrollWidth <= innerWidth")
            assert Axe().run(self.page).response["violations"] == []

    def unhelped(self):
        """Names of the controls without a line of help."""
        return self.page.evaluate(
            """[...document.querySelectorAll('button, input:not([type=file]), select, textarea')]
            .filter((one) => !one.title && !document.getElementById(one.getAttribute('aria-describedby'))?.textContent)
            .map((one) => one.getAttribute('aria-label') ?? (one.labels?.[0] ?? one).innerText)"""
        )

    def towel(self):
        """Solve the sample towel quickly and open it."""
        self.until("studio.link.state.takes?.some((row) => row.name === 'sample:towel')", timeout=240)
        quick = "{take: 'sample:towel', mode: 'paper', method: 'live', level: 'auto'}"
        self.page.evaluate(f"studio.link.order('reproduce', 'solve', {quick})")
        self.go("#reproduce/sample:towel")
        self.until("studio.room?.take?.name === 'sample:towel' && studio.room.take.played.last > 0", timeout=240)

    def go(self, address):
        self.page.evaluate(f"location.hash = {address!r}")

    def hold_to_begin(self):
        """Hold the button that arms live touch."""
        self.hold_to_play()
        self.until("studio.link.state.live.state !== 'idle'")

    def hold_to_play(self):
        """Hold the button that arms."""
        self.until("!document.querySelector('#hold').disabled")
        box = self.page.locator("#hold").bounding_box()
        self.page.mouse.move(box["x"] + 8, box["y"] + 8)
        self.page.mouse.down()
        self.until("!document.querySelector('#hold.held')", timeout=5)
        self.page.mouse.up()


@pytest.fixture
def look(chromium):
    contexts = []

    def open_page(studio, *, link=None, context=None, at="reproduce", **how):
        how = {"viewport": {"width": 1280, "height": 800}} | how
        if context is None:
            context = chromium.new_context(**how)
            contexts.append(context)
        seen = Look(context.new_page(), studio.root)
        seen.page.goto(link or studio.link)
        seen.until("globalThis.studio?.link?.page > 0")
        seen.go(f"#{at}")
        return seen

    yield open_page
    for context in contexts:
        context.close()
