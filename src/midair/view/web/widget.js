import { mount } from "./page.js";

/* The view as an anywidget: data from view/pages.py, and the frame at the playhead. */
export default {
  render({ model, el }) {
    const root = el.ownerDocument.createElement("div"),
      tracks = model.get("tracks");
    el.append(root);
    const view = mount(root, model.get("about"), tracks),
      { transport } = view;
    let received = false; // true while Python sets the frame: no need to send it back
    if (model.get("frame")) transport.seek(model.get("frame"));
    else model.set("frame", transport.frame);
    // Send the frame to Python, but not while playing.
    transport.addEventListener("change", () => {
      if (received || transport.playing || model.get("frame") === transport.frame) return;
      model.set("frame", transport.frame);
      model.save_changes();
    });
    model.on("change:frame", () => {
      const frame = model.get("frame");
      if (frame === transport.frame) return;
      received = true;
      transport.pause();
      transport.seek(frame);
      received = false;
    });
    return () => view.remove();
  },
};
