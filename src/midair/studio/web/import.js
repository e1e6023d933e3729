/* Import a file of another program: what it does not state, a preview, and the take; the words
    of `midair import`. */

import { choice, field, make, openModal, rows } from "/web/dom.js";

const NONE = [["", "not given"]],
  WORDS = (...words) => words.map(word => [word, word]);
const FIELDS = [
  [
    "unit",
    "Unit",
    "of the samples, where the file does not state it",
    choice([...NONE, ...WORDS("V", "count", "Pa")], ""),
  ],
  ["scale", "Scale", "pressure of the value 1 (full scale), such as 30Pa", "30Pa"],
  ["peak", "Peak", "pressure of the largest change of any channel, such as 30Pa", ""],
  ["sensitivity", "Sensitivity", "of every channel, such as 20mV/Pa", ""],
  ["rate", "Rate", "frames per second, where the file does not state it, such as 1kHz", ""],
  ["channels", "Channels", "to read, by name or number from 0, such as 0 or 3,2,1,0", ""],
  ["layout", "Layout", "rows, columns and pitch of the cells, such as 4x4:11mm", ""],
  [
    "footprint",
    "Footprint",
    "makes a field from one channel: a shape that moves over the sensor",
    choice([["", "none"], ...WORDS("circle", "square", "line")], ""),
  ],
  ["size", "Size", "of the footprint", "20mm"],
  ["speed", "Speed", "of the footprint; negative reverses it, 0mm/s keeps it in place", "50mm/s"],
  [
    "path",
    "Path",
    "direction of the footprint",
    choice(
      [
        ["", "x"],
        ["y", "y"],
        ["diagonal", "diagonal"],
      ],
      "",
    ),
  ],
  [
    "turn",
    "Turn",
    "when the footprint has left the sensor",
    choice(
      [
        ["", "stop"],
        ["back", "back"],
        ["again", "again"],
      ],
      "",
    ),
  ],
  ["resample", "Resample", "to this rate, such as 1kHz", ""],
];

/** Picture of the course of a channel over some seconds. */
export function pictureOf(course, seconds) {
  const high = Math.max(...course.greatest),
    low = Math.min(...course.least),
    n = course.least.length,
    y = value => (high > low ? (90 * (high - value)) / (high - low) + 5 : 50).toFixed(1);
  const line = [
    ...course.greatest.map((value, i) => `${i},${y(value)}`),
    ...course.least.map((value, i) => `${i},${y(value)}`).reverse(),
  ].join(" ");
  const svg = document.createElementNS("http://www.w3.org/2000/svg", "svg"),
    shape = document.createElementNS(svg.namespaceURI, "polygon");
  for (const [name, value] of Object.entries({
    viewBox: `0 0 ${n} 100`,
    preserveAspectRatio: "none",
    role: "img",
    "aria-label": `channel ${course.channel} over ${seconds.toFixed(2)} s`,
  }))
    svg.setAttribute(name, value);
  shape.setAttribute("points", line);
  svg.append(shape);
  return svg;
}

/** Ask what a file does not state, show what comes of it, and import it; resolves to the name of
    the take, or "". */
export function importFile(link, file) {
  const dialog = document.getElementById("import"),
    wave = /\.(wav|rf64|flac|aiff?|ogg|mp3)$/.test(file),
    inputs = {};
  const said = make("div", { role: "status", id: "import-said" }),
    wrong = make("p.bad", { role: "alert", id: "import-wrong" });
  const parts = FIELDS.map(([name, label, about, control]) => {
    const input =
      control instanceof Node
        ? control.cloneNode(true)
        : make("input", { type: "text", autocomplete: "off", spellcheck: false });
    input.value =
      control instanceof Node
        ? name === "footprint" && wave
          ? "circle"
          : ""
        : name === "scale" && !wave
          ? ""
          : control;
    input.addEventListener("change", () => show());
    inputs[name] = input;
    const made = field(label, input, about);
    made.append(make("small.quiet", { "aria-hidden": true }, about));
    return made;
  });
  const take = make(
    "button.main",
    {
      type: "button",
      disabled: true,
      title: "Makes the take that the preview shows",
      onclick: () => bring(true),
    },
    "Import",
  );
  let asked = 0;
  async function bring(save) {
    const given = Object.fromEntries(
        Object.entries(inputs).map(([name, input]) => [name, input.value.trim()]),
      ),
      mine = (asked += 1);
    take.disabled = true;
    try {
      const made = await link.order("reproduce", "import", { file, save, ...given });
      if (mine !== asked) return;
      if (save) {
        dialog.close(made.take);
        return;
      }
      wrong.textContent = "";
      take.disabled = false;
      preview(made);
    } catch (error) {
      if (mine === asked) {
        wrong.textContent = error.message;
        said.replaceChildren();
      }
    }
  }
  function preview({ course, frames, rate_hz: rate, sensor, unit, range, notes, command }) {
    const svg = pictureOf(course, frames / rate);
    said.replaceChildren(
      svg,
      rows([
        ["frames", `${frames} at ${rate} Hz, ${(frames / rate).toFixed(2)} s`],
        [
          "cells",
          `${sensor.rows} × ${sensor.columns}, pitch ${(1e3 * sensor.pitch_m).toFixed(3).replace(/\.?0+$/, "")} mm`,
        ],
        ["range", `${range.map(value => value.toPrecision(3)).join(" to ")} ${unit}`],
      ]),
      ...notes.map(note => make("p.quiet", {}, note)),
      make("pre", { tabIndex: 0 }, command),
    );
  }
  const show = () => bring(false);
  dialog.replaceChildren(
    make("h2", { id: "import-title" }, `Import ${file}`),
    make(
      "div.import",
      {},
      make("div.column", {}, ...parts),
      make("div.column", {}, make("h3", {}, "Preview"), wrong, said),
    ),
    make(
      "div.buttons",
      {},
      take,
      make(
        "button",
        { type: "button", title: "Imports nothing", onclick: () => dialog.close("") },
        "Cancel",
      ),
    ),
  );
  dialog.returnValue = "";
  openModal(dialog, link);
  show();
  return new Promise(resolve =>
    dialog.addEventListener("close", () => resolve(dialog.returnValue), { once: true }),
  );
}
