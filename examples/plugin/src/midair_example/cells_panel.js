import { make, panel, tried } from "/web/dom.js";

export default class Cells {
  constructor(studio) {
    const found = make("p", { role: "status" }, "not read yet");
    const read = async () => { found.textContent = `cell ${(await tried(studio.link.order("cells", "loudest"))) ?? "–"}`; };
    studio.main.append(panel("Loudest cell", null, found, make("button", { type: "button", onclick: read }, "Read")));
  }
}
