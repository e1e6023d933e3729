/* Import a file of another program: questions on what it does not state, as `midair import` asks
    them, a preview, and the take. */

import { buttonOf, choice, field, make, openModal, rows, toast } from "/web/dom.js";
import { PalmFilm, playerOf } from "/web/palm-film.js";

const pick = (none, ...words) => choice([["", none], ...words.map(word => [word, word])], "");
const FELT = choice(
    [
      ["", "as stated"],
      ["soft", "soft: felt by 5 of 10"],
      ["medium", "medium: felt by 8 of 10"],
      ["strong", "strong: felt by 9 of 10"],
    ],
    "",
  ),
  MOVES = choice(
    [
      ["stays", "stays in place"],
      ["", "strokes across the palm"],
      ["y", "strokes along the hand"],
      ["diagonal", "strokes diagonally"],
      ["circle", "circles on the palm"],
    ],
    "",
  ),
  TURNS = choice(
    [
      ["", "it ends"],
      ["back", "it comes back"],
      ["again", "it starts again"],
    ],
    "",
  ),
  UNITS = pick("not given", "V", "count", "Pa"),
  SHAPES = pick("none", "circle", "square", "line");
const FIELDS = [
  ["felt", "How strong?", "by a model of skin, not tried on people", FELT],
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
  ["size", "How large?", "diameter of the spot on the palm, in mm", "20"],
  ["path", "How does it move?", "the spot on the palm, which starts at its edge", MOVES],
  ["speed", "How fast?", "in mm/s; a hand strokes at 50 to 200; negative: the other way", "50"],
  ["turn", "At the edge?", "when the spot has left the palm", TURNS],
  ["resample", "Resample", "to this rate, such as 1kHz", ""],
];

/** Questions on a sound, with proposed answers; on a file of effects, which stay in place. */
const SOUND = { felt: "medium", size: "20", path: "", speed: "50", turn: "back" },
  UNIT = { size: "mm", speed: "mm/s" };

/** Take a file of this computer into the folder, ask what it does not state, with proposed answers
    and what comes of them, and open the take. */
export async function bringFile(studio, chosen) {
  if (!chosen) return;
  const { link } = studio,
    dialog = document.getElementById("import"),
    ended = new AbortController(),
    title = make("h2", { id: "import-title" }, `Import ${chosen.name}`),
    cancel = buttonOf("Cancel", "Imports nothing", () => dialog.close(""));
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
  const effect = /\.(ahap|haptic)$/.test(file),
    wave = effect || /\.(wav|rf64|flac|aiff?|ogg|mp3)$/.test(file),
    proposed = wave ? { footprint: "circle", ...SOUND, ...(effect ? { path: "stays" } : {}) } : {},
    inputs = {},
    parts = {};
  const said = make("div", { role: "status", id: "import-said" }),
    wrong = make("p.bad", { role: "alert", id: "import-wrong" }),
    questions = make("div"),
    more = make("details", {}, make("summary", {}, "More options")),
    told = make("p.quiet", {}, ""),
    ended = new AbortController(),
    film = new PalmFilm(file.split("/").at(-1), ended.signal),
    seen = make("div.column", { hidden: true }, playerOf(film), said),
    bar = make("progress", { "aria-label": "reading the file" });
  dialog.addEventListener("close", () => (ended.abort(), film.still()), { once: true });
  for (const [name, label, about, control] of FIELDS) {
    const input =
      control instanceof Node
        ? control.cloneNode(true)
        : make("input", { type: "text", autocomplete: "off", spellcheck: false });
    input.value = proposed[name] ?? (control instanceof Node ? "" : control);
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
  /** Options of the command; only what moves has a speed, and only what leaves the palm a turn. */
  function given() {
    const found = Object.fromEntries(
        Object.entries(inputs).map(([name, { value }]) => [
          name,
          // A plain number is in the unit of its question.
          value.trim().replace(/^-?[\d.]+$/, number => number + (UNIT[name] ?? "")),
        ]),
      ),
      shape = Boolean(found.footprint),
      moves = shape && found.path !== "stays",
      leaves = moves && found.path !== "circle";
    for (const name of ["size", "path"]) parts[name].hidden = !shape;
    parts.speed.hidden = !moves;
    parts.turn.hidden = !leaves;
    const { size, ...options } = found;
    if (shape) options.footprint += `:${size}`;
    else Object.assign(options, { speed: "", path: "" });
    if (shape && !moves) Object.assign(options, { speed: "0mm/s", path: "" });
    return { ...options, turn: leaves ? options.turn : "" };
  }
  const take = buttonOf("Import", "Makes the take that the preview shows", () => bring(true), {
    class: "main",
    disabled: true,
  });
  /** Names of options in a message of the command, as the names of their questions. */
  const named = message =>
    message.replace(/(midair import )?--(\w+)/g, (option, _, name) =>
      name in parts ? `“${parts[name].querySelector("label").textContent}”` : option,
    );
  let orders = 0;
  async function bring(save) {
    const mine = (orders += 1),
      asked = given();
    take.disabled = true;
    bar.hidden = false;
    seen.classList.add("old");
    try {
      const made = await link.order("reproduce", "import", { file, save, options: asked });
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
      await preview(made);
      take.disabled = false;
    } catch (error) {
      if (mine === orders) {
        bar.hidden = seen.hidden = true;
        wrong.textContent = named(error.message);
      }
    }
  }
  /** Show the questions, each with its proposed answer, and what comes of these. */
  function question({ asked, said: message }) {
    const news = Object.entries(asked).filter(([name]) => !questions.contains(parts[name]));
    for (const [name, answer] of news) {
      questions.append(parts[name]);
      inputs[name].value ||= answer;
    }
    if (news.length) show();
    else wrong.textContent = named(message);
  }
  async function preview({ course, frames, rate_hz: rate, sensor, unit, range, notes, command }) {
    const seconds = course.seconds.toFixed(2),
      pitch = Number((1e3 * sensor.pitch_m).toFixed(3));
    told.textContent = questions.childElementCount
      ? "The file gives all other values."
      : "The file gives all values that are needed.";
    said.replaceChildren(
      rows([
        ["frames", `${frames} at ${rate} Hz, ${seconds} s`],
        ["cells", `${sensor.rows} × ${sensor.columns}, pitch ${pitch} mm`],
        ["range", `${range.map(value => value.toPrecision(3)).join(" to ")} ${unit}`],
      ]),
      ...notes.map(note => make("p.quiet", {}, named(note))),
      make("pre", { tabIndex: 0 }, command),
    );
    seen.hidden = false;
    seen.classList.remove("old");
    await film.fill(course.film, course, `waveform of ${file.split("/").at(-1)} over ${seconds} s`);
  }
  const show = () => bring(false);
  dialog
    .querySelector("progress")
    .replaceWith(
      film.course,
      make(
        "div.import",
        {},
        make("div.column", {}, questions, told, more),
        make("div.column", {}, bar, wrong, seen),
      ),
      make("div.buttons", {}, take, dialog.querySelector("progress + button")),
    );
  show();
}
