"""The notebook widget: created in Python, run in a real notebook, and shown from the saved notebook."""

import json
import sys

import pytest
from tests.view.shown import focus, recording

from midair.errors import MissingExtraError
from midair.view import in_notebook, show_recording, unpack
from midair.view.pages import one_module

HOST = """
<!doctype html><meta charset="utf-8"><body><div id="here"></div>
<script type="module">
const kept = JSON.parse(document.getElementById("kept").textContent);
const bytes = (text) => new DataView(Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0)).buffer);
for (const {path, data} of kept.buffers)
  path.slice(0, -1).reduce((at, key) => at[key], kept.state)[path.at(-1)] = bytes(data);
document.head.append(Object.assign(document.createElement("style"), {textContent: kept.state._css}));
const heard = {}, model = {
  get: (name) => kept.state[name],
  on: (name, call) => { heard[name] = call; },
  save_changes() { window.saved = {...kept.state}; },
  set(name, value) { kept.state[name] = value; heard[`change:${name}`]?.(); },
};
const module = await import(URL.createObjectURL(new Blob([kept.state._esm], {type: "text/javascript"})));
window.done = module.default.render({model, el: document.getElementById("here")});
window.model = model;
</script>
"""
"""Minimal notebook page: the interface of anywidget with the state that the notebook saved."""

CELL = """
from midair.view import in_notebook, show_recording
from tests.view.shown import recording
view = in_notebook(show_recording(recording(600)))
view
"""


@pytest.mark.long
def test_widget_has_metadata_frames_and_playhead():
    made = in_notebook(show_recording(recording()))
    assert made.about["frames"] == 60
    assert unpack(made.tracks["samples"])[0].values.shape == (60, 16)
    assert made.frame == 0
    assert set(in_notebook(focus()).tracks) == {"wanted", "played", "phases"}


def test_without_anywidget_one_line_says_what_to_install(monkeypatch):
    from midair.view import pages

    monkeypatch.setitem(sys.modules, "anywidget", None)
    pages._widget_class.cache_clear()
    with pytest.raises(MissingExtraError, match=r"midair\[notebook\]"):
        in_notebook(focus())
    pages._widget_class.cache_clear()


@pytest.fixture(scope="module")
def notebook():
    import nbformat
    from nbclient import NotebookClient

    made = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell(CELL)])
    NotebookClient(made, timeout=60, kernel_name="python3").execute()
    return made


@pytest.mark.browser
def test_a_notebook_keeps_a_widget_that_a_page_shows_offline(notebook, chromium, tmp_path):
    (output,) = notebook.cells[0].outputs
    shown = output["data"]["application/vnd.jupyter.widget-view+json"]["model_id"]
    kept = notebook.metadata["widgets"]["application/vnd.jupyter.widget-state+json"]["state"][shown]
    assert kept["model_module"] == "anywidget"
    assert kept["state"]["_esm"] == one_module("widget.js")
    text = json.dumps(kept).replace("<", "\\u003c")
    path = tmp_path / "kept.html"
    path.write_text(HOST.replace("<script", f'<script type="application/json" id="kept">{text}</script><script', 1))
    context = chromium.new_context(reduced_motion="reduce", offline=True)
    page, wrong = context.new_page(), []
    page.on("pageerror", lambda error: wrong.append(str(error)))
    page.on("console", lambda said: wrong.append(said.text))
    page.on("request", lambda asked: wrong.append(asked.url) if asked.url.startswith("http") else None)
    page.goto(path.as_uri())
    page.get_by_role("img", name="Every channel, V").wait_for()
    page.evaluate("model.set('frame', 123)")
    assert "frame 123" in page.locator(".view-where").text_content()
    page.screenshot(path=str(tmp_path / "notebook.png"), full_page=True)
    page.get_by_role("slider", name="Whole take").focus()
    page.keyboard.press("ArrowRight")
    assert page.evaluate("saved.frame") == 124
    page.evaluate("done()")
    assert page.locator("canvas").count() == 0
    context.close()
    assert wrong == []
