import { mount } from "./page.js";

/* The view as an anywidget: what view/widget.py tells it, and where it stands. */
export default { render({ model, el }) {
  const root = el.ownerDocument.createElement("div"), tracks = model.get("tracks");
  el.append(root);
  const view = mount(root, model.get("about"), tracks), { transport } = view;
  let told = false; // where to stand, by Python: no need to tell it
  if (model.get("frame")) transport.seek(model.get("frame")); else model.set("frame", transport.frame);
  // Python is told where it stands, when it stands.
  transport.addEventListener("change", () => {
    if (told || transport.playing || model.get("frame") === transport.frame) return;
    model.set("frame", transport.frame);
    model.save_changes();
  });
  model.on("change:frame", () => {
    const frame = model.get("frame");
    if (frame === transport.frame) return;
    told = true;
    transport.pause();
    transport.seek(frame);
    told = false;
  });
  return () => view.remove();
} };
