/* Import a file of another program: questions on what it does not state, as `midair import` asks
    them, a preview, and the take. */

import { choice, field, make, openModal, rows, toast } from "/web/dom.js";

const pick = (none, ...words) => choice([["", none], ...words.map(word => [word, word])], "");
const FELT = pick("as stated", "soft", "medium", "strong"),
  UNITS = pick("not given", "V", "count", "Pa"),
  SHAPES = pick("none", "circle", "square", "line");
const FIELDS = [
  ["felt", "How strong?", "felt by about 5, 8 or 9 of 10 people, by a model of skin", FELT],
  ["unit", "Unit", "of the samples, where the file does not state it", UNITS],
  ["scale", "Scale", "pressure of the value 1 (full scale), such as 30Pa", ""],
  ["peak", "Peak", "pressure of the largest change of any channel, such as 30Pa", ""],
  ["sensitivity", "Sensitivity", "of every channel, such as 20mV/Pa", ""],
  ["rate", "Rate", "frames per second, where the file does not state it, such as 1kHz", ""],
  ["time", "Time", "column of time stamps, by name or number; none to ignore them", ""],
  ["field", "Field", "which of several to read: a stream, a group, an array such as S.data", ""],
  ["decimal", "Decimal", "sign of decimals in a text", pick("as found", "point", "comma")],
  ["mend", "Mend", "fills gaps up to this length, such as 20ms", ""],
  ["channels", "Channels", "to read, by name or number from 0, such as 0 or 3,2,1,0", ""],
  ["layout", "Layout", "rows, columns and pitch of the cells, such as 4x4:11mm", ""],
  ["footprint", "Footprint", "shape on the palm, which makes a field from one channel", SHAPES],
  ["size", "How large?", "of the spot on the palm", "20mm"],
  ["speed", "How fast does it move?", "negative: to the other side; 0mm/s: it stays", "50mm/s"],
  ["path", "Path", "direction of the footprint", pick("x", "y", "diagonal")],
  ["turn", "Turn", "when the footprint has left the sensor", pick("stop", "back", "again")],
  ["resample", "Resample", "to this rate, such as 1kHz", ""],
];

/** Picture of a course: its greatest and least values in equal parts of its time. */
export function pictureOf(course, label) {
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
    "aria-label": label,
  }))
    svg.setAttribute(name, value);
  shape.setAttribute("points", line);
  svg.append(shape);
  return svg;
}

/** Questions on a sound, with proposed answers. */
const SOUND = { felt: "medium", size: "20mm", speed: "50mm/s" };

/** Take a file of this computer into the folder, ask what it does not state, with proposed answers
    and what comes of them, and open the take. */
export async function bringFile(studio, chosen) {
  if (!chosen) return;
  const { link } = studio,
    dialog = document.getElementById("import"),
    ended = new AbortController(),
    title = make("h2", { id: "import-title" }, `Import ${chosen.name}`),
    cancel = make(
      "button",
      { title: "Imports nothing", onclick: () => dialog.close("") },
      "Cancel",
    );
  dialog.returnValue = "";
  dialog.replaceChildren(title, make("progress", { "aria-label": "copying" }), cancel);
  openModal(dialog, link);
  dialog.addEventListener(
    "close",
    () => {
      ended.abort();
      if (dialog.returnValue) studio.go("reproduce", dialog.returnValue);
    },
    { once: true },
  );
  try {
    const answer = await fetch("/upload", {
      method: "POST",
      body: chosen,
      headers: { "x-name": encodeURIComponent(chosen.name), "x-page": String(link.page) },
      signal: ended.signal,
    });
    const { error, imports, ok } = await answer.json();
    if (error) throw new Error(error);
    if (imports) ask(link, dialog, ok);
    else dialog.close(ok);
  } catch (wrong) {
    if (wrong.name !== "AbortError") toast(wrong.message);
    dialog.close("");
  }
}

/** The questions of an import in its dialog, which ends with the name of the take. */
function ask(link, dialog, file) {
  const wave = /\.(wav|rf64|flac|aiff?|ogg|mp3)$/.test(file),
    inputs = {};
  const said = make("div", { role: "status", id: "import-said" }),
    wrong = make("p.bad", { role: "alert", id: "import-wrong" });
  const parts = {},
    questions = make("div"),
    more = make("details", {}, make("summary", {}, "More options")),
    told = make("p.quiet", {}, "");
  for (const [name, label, about, control] of FIELDS) {
    const input =
      control instanceof Node
        ? control.cloneNode(true)
        : make("input", { type: "text", autocomplete: "off", spellcheck: false });
    input.value = control instanceof Node ? "" : control;
    if (wave) input.value = { footprint: "circle", ...SOUND }[name] ?? input.value;
    input.addEventListener("change", () => {
      // A stated level replaces a felt one.
      if (["scale", "unit", "peak", "sensitivity"].includes(name)) inputs.felt.value = "";
      show();
    });
    inputs[name] = input;
    parts[name] = field(label, input, about);
    parts[name].append(make("small.quiet", { "aria-hidden": true }, about));
    (wave && name in SOUND ? questions : more).append(parts[name]);
  }
  const take = make(
    "button.main",
    {
      disabled: true,
      title: "Makes the take that the preview shows",
      onclick: () => bring(true),
    },
    "Import",
  );
  const bar = make("progress", { "aria-label": "reading the file" });
  let orders = 0;
  async function bring(save) {
    const given = Object.fromEntries(
        Object.entries(inputs).map(([name, input]) => [name, input.value.trim()]),
      ),
      mine = (orders += 1);
    take.disabled = true;
    bar.hidden = false;
    try {
      const made = await link.order("reproduce", "import", { file, save, ...given });
      if (mine !== orders) return;
      bar.hidden = true;
      if (made.asked) {
        question(made);
        return;
      }
      if (save) {
        dialog.close(made.take);
        return;
      }
      wrong.textContent = "";
      take.disabled = false;
      preview(made);
    } catch (error) {
      if (mine === orders) {
        bar.hidden = true;
        wrong.textContent = error.message;
        said.replaceChildren();
      }
    }
  }
  /** Show the questions, each with its proposed answer, and what comes of these. */
  function question({ asked, said: message }) {
    const news = Object.entries(asked).filter(([name]) => !questions.contains(parts[name]));
    for (const [name, proposed] of news) {
      questions.append(parts[name]);
      inputs[name].value ||= proposed;
    }
    if (news.length) show();
    else wrong.textContent = message;
  }
  function preview({ course, frames, rate_hz: rate, sensor, unit, range, notes, command }) {
    const seconds = (frames / rate).toFixed(2),
      svg = pictureOf(course, `channel ${course.channel} over ${seconds} s`);
    told.textContent = questions.childElementCount
      ? "The file states the rest."
      : "The file states all that is needed.";
    said.replaceChildren(
      svg,
      make("small.axis.quiet", {}, make("span", {}, "0 s"), make("span", {}, `${seconds} s`)),
      rows([
        ["frames", `${frames} at ${rate} Hz, ${seconds} s`],
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
  dialog
    .querySelector("progress")
    .replaceWith(
      make(
        "div.import",
        {},
        make("div.column", {}, questions, told, more),
        make("div.column", {}, make("h3", {}, "Preview"), bar, wrong, said),
      ),
      make("div.buttons", {}, take, dialog.querySelector("progress + button")),
    );
  show();
}
