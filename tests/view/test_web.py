import numpy as np
import pytest
from tests.view.shown import FOCUS, GRID, finer_points, focus, focus_drive, pressure, recording

from midair.physics import propagate
from midair.view import colour_table, show_comparison, show_page, show_recording

pytestmark = pytest.mark.browser

VIEW = "const {transport, pictures, tracks} = document.querySelector('.midair-view').midair;"
SECOND_TICK = "new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))"


@pytest.fixture
def opened(chromium, tmp_path):
    contexts = []

    def open_page(shown, **how):
        path = tmp_path / "page.html"
        path.write_text(show_page(shown), encoding="utf-8")
        contexts.append(chromium.new_context(viewport={"width": 1280, "height": 900}, **how))
        page = contexts[-1].new_page()
        page.wrong = []
        page.on("console", lambda said: page.wrong.append(said.text))
        page.on("pageerror", lambda wrong: page.wrong.append(str(wrong)))
        page.on("request", lambda asked: page.wrong.append(asked.url) if asked.url != path.as_uri() else None)
        page.goto(path.as_uri())
        page.wait_for_function("document.querySelector('.midair-view').midair?.transport.drawn > 0")
        return page

    yield open_page
    for context in contexts:
        wrong = [each for page in context.pages for each in page.wrong]
        context.close()
        assert wrong == []


def held(page, frame):
    """Stop at a frame, and wait until it is drawn."""
    page.evaluate(f"frame => {{ {VIEW} transport.pause(); transport.seek(frame); return {SECOND_TICK}; }}", frame)


def picture(page, title):
    return page.evaluate(
        f"""title => {{ {VIEW} const p = pictures.find(each => each.label === title);
        return {{shown: Array.from(p.shown), rows: p.shownRows, columns: p.shownColumns, peak: p.peak,
            pixels: Array.from(p.pixels), name: p.summary}}; }}""",
        title,
    )


def test_a_known_focus_has_its_place_phase_words_and_colour_bar(opened):
    shown = focus()
    page = opened(shown, reduced_motion="reduce")
    held(page, 2)
    played, field = picture(page, "Played, simulated"), propagate(focus_drive(), finer_points(GRID))[2]
    x, y = 1e3 * FOCUS[:2]
    assert (played["rows"], played["columns"]) == (64, 64)
    assert abs(played["peak"]["x"] - x) < 0.6
    assert abs(played["peak"]["y"] - y) < 0.6
    assert np.linalg.norm(np.array(played["shown"]) - np.abs(field)) / np.linalg.norm(field) < 0.02
    assert np.argmax(picture(page, "Target")["shown"]) == 9 * 16 + 6

    pixels, loud = np.array(picture(page, "Phase of the field")["pixels"]), np.abs(field) > 0.06 * shown.sound.top
    assert (pixels[np.abs(field) < 0.04 * shown.sound.top] == 0).all()
    turn = np.floor((np.angle(field[loud]) / (2 * np.pi) + 1) * 256).astype(int) & 255
    got = np.stack([pixels[loud] & 255, pixels[loud] >> 8 & 255, pixels[loud] >> 16 & 255], axis=1)
    assert np.abs(got - colour_table("twilight").astype(int)[turn]).max() < 20, "within two of 256 colours or so"

    # Words are renewed once a second.
    image = page.get_by_role("img", name="Played, simulated")
    page.wait_for_function("""document.querySelector('.view-map [aria-label*="peak"][aria-label*="mm"]') !== null""")
    assert "peak" in image.get_attribute("aria-label")
    image.focus()
    page.keyboard.press("ArrowLeft")
    said = page.locator(".view-map .view-said").nth(1)
    assert "Pa at" in said.text_content()
    assert said.get_attribute("aria-live") == "polite"
    assert page.get_by_role("slider", name="Whole take").get_attribute("aria-valuemax") == "7"

    held(page, 7)
    assert set(picture(page, "Phase of the field")["pixels"]) == {0}, "silence has no phase"
    assert picture(page, "Played, simulated")["name"] == "silent"

    page.set_viewport_size({"width": 688, "height": 900})
    page.emulate_media(media="print")
    rows = page.evaluate(
        """() => [...document.querySelectorAll(".view-group")].map(group =>
            [...group.querySelectorAll("figure")].map(one => one.getBoundingClientRect()).map(r => [r.top, r.right]))"""
    )
    assert [len(row) for row in rows if len(row) > 2], "printed, the colour bar is beside its maps"
    for row in rows:
        assert len({top for top, _ in row}) == 1
        assert max(right for _, right in row) <= 688


def test_a_part_has_the_time_of_the_whole(opened):
    page = opened(show_recording(recording(600), part=(0.2, 0.1)), reduced_motion="reduce")
    page.keyboard.press("Home")
    assert "0.2000 s, frame 200" in page.locator(".view-where").text_content()
    page.keyboard.press("End")
    assert "0.2990 s, frame 299" in page.locator(".view-where").text_content()
    held(page, 223)
    assert picture(page, "recorded")["shown"][6] == pytest.approx(abs(np.sin(2 * np.pi * 22.3)), abs=1e-3)
    assert page.get_by_role("slider", name="Whole take").get_attribute("aria-valuemin") == "200"


def test_every_key_of_the_transport(opened):
    page = opened(show_recording(recording(3000)), reduced_motion="reduce")

    def state(name):
        return page.evaluate(f"document.querySelector('.midair-view').midair.transport.{name}")

    page.keyboard.press("End")
    assert state("frame") == 2999
    page.keyboard.press("Home")
    for key, frame in ((".", 1), (">", 11), (",", 10), ("<", 0)):
        page.keyboard.press(key)
        assert state("frame") == frame
    page.keyboard.press("m")
    page.keyboard.press("Shift+.")
    page.keyboard.press("Shift+M")
    assert (state("marks"), state("frame")) == ([0], 0)
    for key, speed in (("2", 0.1), ("3", 0.01), ("1", 1)):
        page.keyboard.press(key)
        assert state("speed") == speed
    page.keyboard.press("i")
    for _ in range(3):
        page.keyboard.press("Shift+.")
    page.keyboard.press("o")
    assert state("loop") == {"from": 0, "to": 30, "on": True}
    page.keyboard.press("\\")
    assert state("loop.on") is False
    page.keyboard.press("p")
    assert state("phase") is True
    page.keyboard.press("f")
    channel = state("channel")
    page.keyboard.press("ArrowDown")
    assert state("channel") == channel + 1
    span = state("span")
    page.keyboard.press("+")
    assert state("span") == span / 2
    page.keyboard.press("0")
    assert state("span") == span
    page.keyboard.press("End")
    page.keyboard.press("j")
    assert (state("playing"), state("speed")) == (True, -1)
    page.keyboard.press("k")
    assert state("playing") is False
    page.keyboard.press("Space")
    assert state("playing") is True
    page.keyboard.press("Home")
    page.evaluate("document.querySelector('.midair-view').midair.transport.toggle()")
    page.keyboard.press("Space")
    assert state("frame") > 300, "backwards from the start is from the other end"


def test_scripts_of_a_paused_page(opened):
    """Transport, rms, gaps, the limit of a live track, the spectrogram and colours, each by itself."""
    page = opened(show_recording(recording(600)), reduced_motion="reduce")
    assert page.get_by_role("button", name="play (Space)").count() == 1, "reduced motion begins paused"
    assert not page.evaluate("document.querySelector('.midair-view').midair.transport.playing")
    passed = page.evaluate(
        f"""() => {{ {VIEW} const Transport = transport.constructor, told = [];
        const t = new Transport({{frames: 600, rate: 1000, still: false}});
        for (const [speed, at] of [[1, 0], [1, 17], [1, 33], [.1, 50], [.1, 67], [.01, 84], [.01, 184]]) {{
            t.setSpeed(speed); t.advance(at); told.push([t.from, t.frame]);
        }}
        return told; }}"""
    )
    # At full speed a picture is the rms of its frames, in slow motion one of them.
    assert passed == [[0, 0], [1, 17], [18, 33], [34, 34], [36, 36], [36, 36], [37, 37]]
    rms = page.evaluate(
        f"""() => {{ {VIEW} const p = pictures[0];
        p.draw({{...p.state, from: 100, frame: 109}}); return p.shown[6]; }}"""
    )
    assert rms == pytest.approx(np.sqrt(0.5), rel=1e-3)
    gaps = page.evaluate(
        f"""() => {{ {VIEW} const t = new tracks.samples.constructor({{rate: 1000, capacity: 100}});
        const two = (first, v) => ({{first, frames: 2, width: 1, unit: .5, values: new Int16Array([v, v])}});
        t.add(two(0, 4)).add(two(5, 0));
        return [[0, 1, 2, 4, 5, 7].map(f => String(t.value(f, 0))), t.lost, t.last]; }}"""
    )
    assert gaps == [["2", "2", "NaN", "NaN", "0", "NaN"], 3, 7], "a lost frame is a gap, and silence is not"
    kept = page.evaluate(
        f"""() => {{ {VIEW} const t = new tracks.samples.constructor({{rate: 1000, capacity: 10}});
        for (let f = 0; f < 25; f++) t.add({{first: f, frames: 1, width: 1, unit: 1, values: new Int16Array([f])}});
        return [t.first, t.last, t.value(15, 0), t.value(24, 0), String(t.value(14, 0))]; }}"""
    )
    assert kept == [15, 25, 15, 24, "NaN"]
    given, real, imaginary = page.evaluate(
        f"""() => {{ {VIEW} const p = pictures.find(p => p.label === 'Spectrogram');
        const real = Float32Array.from({{length: 128}}, (_, i) => Math.sin(i * .7) + i / 100);
        const given = Array.from(real), imaginary = new Float32Array(128);
        p._transform(real, imaginary); return [given, Array.from(real), Array.from(imaginary)]; }}"""
    )
    assert np.abs(np.fft.fft(given) - (np.array(real) + 1j * np.array(imaginary))).max() < 1e-3
    held(page, 2)
    assert picture(page, "recorded")["shown"][6] > 0.9
    for pressed, table in ((True, "cividis"), (False, "inferno")):
        page.get_by_role("button", name="Cividis").click()
        assert page.get_by_role("button", name="Cividis").get_attribute("aria-pressed") == str(pressed).lower()
        pixel = picture(page, "recorded")["pixels"][6]
        assert [pixel & 255, pixel >> 8 & 255, pixel >> 16 & 255] == colour_table(table)[255].astype(int).tolist()


def test_a_whole_comparison_is_accessible_and_fits_its_page(opened):
    """Nothing serious for axe in two schemes of colours; every part is reached by Tab; nothing is too wide."""
    axe = pytest.importorskip("axe_playwright_python.sync_playwright").Axe()
    page = opened(show_comparison(pressure(), pressure(), sound=focus().sound), reduced_motion="reduce")
    page.wait_for_timeout(1100)
    seen = set()
    for _ in range(40):
        page.keyboard.press("Tab")
        seen.add(page.evaluate("document.activeElement.ariaLabel || document.activeElement.textContent"))
    names = {each.split(":")[0] for each in seen if each}
    fields = {"Target", "Played, simulated", "Phase of the field", "Array"}
    felt = {"original", "re-recorded", "Every channel, Pa", "Spectrogram", "Whole take"}
    assert fields | felt | {"play (Space)", "Loop", "1×", "1/10", "1/100"} <= names
    for scheme in ("light", "dark"):
        page.emulate_media(color_scheme=scheme)
        told = axe.run(page).response
        serious = [each for each in told["violations"] if each["impact"] in ("serious", "critical")]
        assert [(each["id"], each["nodes"][0]["html"]) for each in serious] == []
        assert {"color-contrast", "button-name", "aria-required-attr"} <= {each["id"] for each in told["passes"]}
    for width in (390, 1280):
        page.set_viewport_size({"width": width, "height": 800})
        page.wait_for_timeout(100)
        assert page.evaluate("document.documentElement.scrollWidth") <= width
        sizes = page.evaluate("[...document.querySelectorAll('canvas')].map(c => [c.width, c.height, c.clientWidth])")
        assert all(wide > 20 and high > 20 and abs(wide - css) <= 1 for wide, high, css in sizes)


RUNNING = """frames => { const {transport, pictures} = document.querySelector('.midair-view').midair;
    transport.pause();
    const p = pictures.find(each => each.label.startsWith('Every channel')), {width, height} = p.canvas;
    const pixels = () => Array.from(new Uint32Array(p.context.getImageData(0, 0, width, height).data.buffer));
    const state = frame => ({frame, span: 0.1, channel: 2});
    p.head = false;
    pixels(); // from here on the canvas paints words as it does after it was read
    p.draw(state(frames[0]));
    p.context.fillStyle = '#f0f';
    p.context.fillRect(p.lanes.left + 200, 30, 1, 1);
    const marked = pixels().indexOf(0xffff00ff) % width;
    for (const frame of frames) p.draw(state(frame));
    const ran = pixels(), mark = ran.indexOf(0xffff00ff);
    p._how = null;
    p.draw(state(frames.at(-1)));
    const anew = pixels(), step = p.lanes.w / p.lanes.span, edge = frame => Math.ceil((frame - 50) * step);
    const bytes = [ran, anew].map(each => new Uint8Array(Uint32Array.from(each).buffer));
    let most = 0;
    bytes[0].forEach((each, i) => { if (i >> 2 !== mark) most = Math.max(most, Math.abs(each - bytes[1][i])); });
    return {moved: marked - mark % width, should: edge(frames.at(-1)) - edge(frames[0]),
        most, colours: new Set(anew).size}; }"""


def test_shifted_traces_equal_newly_drawn_ones(opened):
    page = opened(show_recording(recording(400)), reduced_motion="reduce")
    for frames in ([100, 103, 104, 104, 111], [100, 117, 134]):  # few at once, and 17
        found = page.evaluate(RUNNING, frames)
        assert found["moved"] == found["should"] > 0
        assert found["colours"] > 20
        assert found["most"] <= 4, "of 255: edges of lines are rounded anew"
    page.wrong = [said for said in page.wrong if "willReadFrequently" not in said]
