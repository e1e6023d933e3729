/* Panel Draw: spots, their paths and modulation on a picture of the palm; maps, exposure and level
   of the pattern.

   The document is the pattern as the dicts of its TOML file; a number can be "$NAME", a parameter with a slider. */

import { buttonOf, choice, make, panel, playable, tried } from "/web/dom.js";
import { TimeLine } from "/web/draw-keys.js";
import { askToReplace } from "/web/jobs.js";
import { badges } from "/web/palm-film.js";
import { drawn } from "/web/palm-view.js";
import { askToPlay } from "/web/playing.js";
import { colours } from "/web/take.js";

const HALF = 52,
  MOST = 12; // half the picture in mm; corners of a free-hand path
const SHAPES = {
  points: ["Points", { places_mm: [[0, 0]] }],
  circle: ["Circle", { radius_mm: 15 }],
  line: ["Line", { length_mm: 30 }],
  polygon: [
    "Polygon",
    {
      corners_mm: [
        [-15, -15],
        [15, -15],
        [15, 15],
        [-15, 15],
      ],
    },
  ],
  arc: ["Arc", { radius_mm: 15, from_deg: 0, to_deg: 180 }],
  lissajous: ["Lissajous curve", { width_mm: 30, depth_mm: 30, a: 3, b: 2, phase_deg: 90 }],
  svg: ["SVG path", { path: "M0 0C3-6 9-3 9 2S3 10 0 13C-3 10-9 7-9 2S-3-6 0 0Z", size_mm: 40 }],
};
const CORNERS = { points: "places_mm", polygon: "corners_mm" };
/** path: label, unit, value if it is left out, lowest, highest of a slider, step, help, highest
    if it is more. */
const NUMBERS = {
  "centre_mm.0": ["Centre, x", "mm", 0, -40, 40, 1, "To the right of the palm's centre."],
  "centre_mm.1": ["Centre, y", "mm", 0, -40, 40, 1, "Towards the fingers."],
  turn_deg: ["Turned by", "°", 0, -180, 180, 1, "Rotates the path, counter-clockwise."],
  "shape.radius_mm": ["Radius", "mm", 15, 1, 40, 1, "From the centre to the path."],
  "shape.length_mm": ["Length", "mm", 30, 1, 80, 1, "From end to end; drawn there and back."],
  "shape.from_deg": ["From", "°", 0, -360, 360, 1, "Angle at the beginning."],
  "shape.to_deg": ["To", "°", 180, -360, 360, 1, "Angle at the end; drawn there and back."],
  "shape.width_mm": ["Width", "mm", 30, 0, 80, 1, "From the left to the right end."],
  "shape.depth_mm": ["Height", "mm", 30, 0, 80, 1, "From the lowest to the highest place."],
  "shape.a": ["Waves across", "", 3, 1, 50, 1, "Waves from left to right in one pass."],
  "shape.b": ["Waves up", "", 2, 1, 50, 1, "Waves up and down in one pass."],
  "shape.size_mm": ["Size", "mm", 40, 1, 80, 1, "Longer side of its box; it is centred."],
  "shape.phase_deg": ["Phase", "°", 90, -360, 360, 1, "Changes the form of the curve."],
  pressure_pa: ["Pressure", "Pa", 50, 0, 200, 1, "Highest pressure on the palm."],
  draw_hz: ["Passes", "per s", 50, 0.1, 200, 0.1, "How often the path is drawn in a second.", 2000],
  speed_m_s: ["Speed", "m/s", 1, 0.01, 10, 0.01, "Speed along the path."],
  "am.frequency_hz": ["Vibration", "Hz", 150, 1, 400, 1, "Skin feels 100 to 300 Hz best.", 2000],
  "am.depth": ["Depth", "", 1, 0, 1, 0.05, "1: down to silence; 0: no vibration."],
  "lm.frequency_hz": ["Orbits", "Hz", 5, 0.5, 60, 0.5, "Turns per second of the small orbit.", 100],
  "lm.radius_mm": ["Orbit's radius", "mm", 3, 0.5, 20, 0.5, "Radius of the small orbit."],
  "signal.channel": [
    "Its channel",
    "",
    null,
    0,
    255,
    1,
    "Cell of the take, row by row from 0; empty: the strongest.",
  ],
  "signal.depth": ["Its depth", "", 1, 0, 1, 0.05, "Part of the pressure that follows the signal."],
  start_s: ["Begins at", "s", 0, 0, 2, 0.01, "The spot is silent before."],
  stop_s: [
    "Ends at",
    "s",
    null,
    0.01,
    2,
    0.01,
    "The spot is silent afterwards; empty: at the end.",
  ],
};
const get = (from, path) => path.split(".").reduce((at, name) => at?.[name], from);
function put(into, path, value) {
  const names = path.split("."),
    last = names.pop(),
    at = names.reduce((at, name) => (at[name] ??= {}), into);
  if (value === undefined) delete at[last];
  else at[last] = value;
}
const isName = value => typeof value === "string" && value.startsWith("$");
const copy = value => JSON.parse(JSON.stringify(value));
let kept = null; // the pattern outlives a visit to another panel

/** Places along an SVG path, centred, the longer side of their box 1, y up; the browser finds
    them. */
function outlineOf(d) {
  if (outlineOf.d === d) return outlineOf.found;
  const path = drawn("path", { d }),
    long = path.getTotalLength(),
    all =
      long > 0
        ? Array.from({ length: 401 }, (_, i) => path.getPointAtLength((long * i) / 400))
        : [{ x: 0, y: 0 }];
  const [[left, right], [top, low]] = ["x", "y"].map(axis =>
      [Math.min, Math.max].map(end => end(...all.map(place => place[axis]))),
    ),
    size = Math.max(right - left, low - top) || 1;
  return Object.assign(outlineOf, {
    d,
    found: all.map(({ x, y }) => [(x - (left + right) / 2) / size, ((top + low) / 2 - y) / size]),
  }).found;
}
/** A line through places; it is broken where an outline jumps to its next part. */
function lineOf(places, breaks = false) {
  const step = breaks
    ? 1.5 *
      Math.max(
        ...places.slice(1, 60).map(([x, y], i) => Math.hypot(x - places[i][0], y - places[i][1])),
        0.1,
      )
    : Infinity;
  return places
    .map(
      ([x, y], i) =>
        `${i && Math.hypot(x - places[i - 1][0], y - places[i - 1][1]) < step ? "L" : "M"}${x.toFixed(2)} ${(-y).toFixed(2)}`,
    )
    .join("");
}

/** Few corners of a drawn path: the fewest within a distance, which grows until there are at
    most 12. */
export function corners(path) {
  const far = ([x, y], [ax, ay], [bx, by]) => {
    const dx = bx - ax,
      dy = by - ay,
      along = Math.max(0, Math.min(1, ((x - ax) * dx + (y - ay) * dy) / (dx * dx + dy * dy || 1)));
    return Math.hypot(x - ax - along * dx, y - ay - along * dy);
  };
  const fewer = (points, most) => {
    let at = 0,
      worst = 0;
    points.forEach((point, i) => {
      const off = far(point, points[0], points.at(-1));
      if (off > worst) {
        worst = off;
        at = i;
      }
    });
    return worst <= most
      ? [points[0], points.at(-1)]
      : [...fewer(points.slice(0, at + 1), most).slice(0, -1), ...fewer(points.slice(at), most)];
  };
  let found = path;
  for (let most = 1; ; most *= 1.4) {
    found = fewer(path, most);
    if (found.length <= MOST + 1) break;
  }
  const ends = Math.hypot(found[0][0] - found.at(-1)[0], found[0][1] - found.at(-1)[1]);
  return found.length > 3 && ends < 6 ? found.slice(0, -1) : found.slice(0, MOST);
}

const mayReplace = (link, files) =>
  askToReplace(
    link,
    `Replace ${files[0]}?`,
    [`${files.join(" and ")} ${files.length > 1 ? "exist" : "exists"} in the folder.`],
    [["yes", "Replace", "Cannot be undone"]],
  );

export default class Draw {
  constructor(studio) {
    this.studio = studio;
    this.link = studio.link;
    Object.assign(
      this,
      kept ?? {
        pattern: {
          name: "circle",
          duration_s: 1,
          spot: [{ shape: { name: "circle", radius_mm: 15 }, pressure_pa: 50, draw_hz: 50 }],
        },
        spot: 0,
        corner: 0,
        past: [],
        future: [],
        snap: true,
        shows: "pressure",
      },
    );
    this.line = new TimeLine(this);
    this._tidy();
    this._build();
    this._offs = [
      this.link.on("draw", draw => this._files(draw)),
      this.link.on("player", () => this.control()),
      this.link.on("air", () => this._soon()),
    ];
    this.reopened();
    if (studio.address.take) this._open(studio.address.take);
  }
  reopened() {
    this.link.order("draw", "files").catch(() => {});
  }
  leave() {
    this.left = true;
    const { pattern, spot, corner, past, future, snap, shows } = this;
    kept = { pattern, spot, corner, past, future, snap, shows };
    clearTimeout(this.timer);
    for (const off of this._offs) off();
  }
  control() {
    const { player } = this.link.state,
      controls = this.link.controls;
    this.play.disabled =
      !controls || (!this.looping && (!playable(player) || Boolean(this.playing)));
    this.play.textContent = this.looping
      ? "Stop the loop"
      : player?.device === "virtual"
        ? "Play on the virtual array"
        : "Play …";
    this.loops.disabled = this.looping;
    if (!this.looping && this.played.textContent.startsWith("playing in a loop"))
      this.played.textContent = "stopped";
    for (const one of [this.save, this.saveDrive]) one.disabled = !controls;
  }
  /** Whether this pattern plays in a loop, in which it can be changed. */
  get looping() {
    const { player } = this.link.state;
    return player?.state === "plays" && player.loop;
  }
  get one() {
    return this.pattern.spot[this.spot];
  }
  /** A number, or the value of its parameter. */
  value(from, path, otherwise = 0) {
    const found = get(from, path) ?? otherwise;
    return isName(found)
      ? (this.pattern.parameters?.[found.slice(1)]?.default ?? otherwise)
      : found;
  }
  set(from, path, value) {
    const found = get(from, path),
      known = isName(found) && this.pattern.parameters?.[found.slice(1)];
    if (known)
      known.default = Math.max(known.min ?? -Infinity, Math.min(known.max ?? Infinity, value));
    else put(from, path, value);
  }
  step(value) {
    const unit = this.snap ? 1 : 0.1;
    return Number((Math.round(value / unit) * unit).toFixed(1));
  }
  _tidy() {
    for (const spot of this.pattern.spot) {
      spot.shape =
        typeof spot.shape === "string" ? { name: spot.shape } : (spot.shape ?? { name: "points" });
      const { name } = spot.shape,
        many = CORNERS[name];
      if (many) spot.shape[many] ??= copy(SHAPES[name][1][many]);
      spot.centre_mm ??= [0, 0];
      for (const key of spot.key ?? []) key.centre_mm ??= [0, 0];
    }
    this.spot = Math.max(0, Math.min(this.spot, this.pattern.spot.length - 1));
    this.corner = Math.max(0, Math.min(this.corner, (this.many?.length ?? 1) - 1));
  }
  /** The corners or places of the chosen spot, if its shape has them. */
  get many() {
    return this.one.shape[CORNERS[this.one.shape.name]];
  }
  /** Change the pattern; changes of one kind that follow each other are undone together. */
  edit(change, kind = "", whole = true) {
    const now = Date.now(),
      before = JSON.stringify([this.pattern, this.spot]);
    if (!kind || kind !== this.last || now - this.when > 900) {
      this.past.push(before);
      this.past.splice(0, this.past.length - 200);
    }
    [this.last, this.when] = [kind, now];
    const had = JSON.stringify(this.pattern.spot);
    change();
    const has = JSON.stringify([this.pattern.spot, this.pattern.duration_s]);
    for (const name of Object.keys(this.pattern.parameters ?? {}))
      if (had.includes(`"$${name}"`) && !has.includes(`"$${name}"`))
        delete this.pattern.parameters[name]; // a slider without effect
    this.future = [];
    this._shown(whole);
  }
  undo(which) {
    const [from, to] = which === "redo" ? [this.future, this.past] : [this.past, this.future];
    if (!from.length) return;
    to.push(JSON.stringify([this.pattern, this.spot]));
    [this.pattern, this.spot] = JSON.parse(from.pop());
    this.last = "";
    this._shown();
  }
  _shown(whole = true) {
    this._tidy();
    if (whole) this._forms();
    this._picture();
    this.line.show(whole);
    this.undoes.disabled = !this.past.length;
    this.redoes.disabled = !this.future.length;
    this._soon();
  }

  _build() {
    const button = (words, id, act, help) =>
      buttonOf(words, help, act, { id, "aria-description": help });
    this.palette = make("div.buttons.palette");
    this.spots = make("div.buttons");
    this.fileName = make("input", {
      type: "text",
      id: "draw-name",
      maxLength: 100,
      value: this.pattern.name ?? "",
    });
    this.fileName.onchange = () =>
      this.edit(
        () => {
          this.pattern.name = this.fileName.value;
        },
        "name",
        false,
      );
    this.save = button("Save", "draw-save", () => this._save(false), "Writes NAME.toml");
    this.saveDrive = button(
      "Save with drive",
      "draw-save-drive",
      () => this._save(true),
      "Writes NAME.drive.h5 too, which studies can use",
    );
    this.opens = choice([], "", () => this._open(this.opens.value));
    this.opens.id = "draw-open";
    this.said = make("p.quiet", { id: "draw-said", role: "status" });
    this.undoes = button(
      "Undo",
      "draw-undo",
      () => this.undo("undo"),
      "Takes back the last change: Ctrl Z.",
    );
    this.redoes = button(
      "Redo",
      "draw-redo",
      () => this.undo("redo"),
      "Makes it again: Ctrl Shift Z.",
    );
    this.snaps = make("input", {
      type: "checkbox",
      id: "draw-snap",
      title: "Handles move in steps of 1 mm",
      checked: this.snap,
      onchange: () => {
        this.snap = this.snaps.checked;
      },
    });
    this.map = make("canvas", { role: "img", width: 350, height: 350 });
    this.skin = make("canvas", {
      role: "img",
      width: 175,
      height: 175,
      "aria-label": "Motion of the skin: not computed yet",
    });
    this.map.setAttribute("aria-label", "Pressure on the palm: not computed yet");
    this.view = drawn("svg", {
      viewBox: `${-HALF} ${-HALF} ${2 * HALF} ${2 * HALF}`,
      role: "group",
      "aria-label": "Palm with the paths of the spots; arrow keys move the chosen handle",
    });
    this._pointer();
    this.lines = make("div.lines", { role: "status" });
    this.mapWords = make("span", {}, "pressure, rms");
    this.skinWords = make("p.quiet");
    this.play = make(
      "button.main",
      {
        id: "draw-play",
        title: "Checks the exposure, then plays",
        // Not busy: while a loop plays, another press ends it.
        onclick: () => void this._play(),
      },
      "Play",
    );
    this.loops = make("input", {
      type: "checkbox",
      id: "draw-loop",
      title: "Plays again and again, with each change in the next pass, until Esc",
    });
    this.played = make("p", { id: "draw-played", role: "status" });
    this.form = make("div.column");
    this.more = make("div.column");
    this.sliders = panel("Sliders", null, this.more);
    this.whole = make("div.column");
    this.formPanel = panel("Spot", null, this.form);
    const simulated = () => make("strong.simulated", {}, "SIMULATED");
    this.studio.main.append(
      make(
        "div.draw",
        {},
        make(
          "div.column.left",
          {},
          panel(
            "Start from",
            null,
            this.palette,
            make(
              "p.quiet",
              {},
              "Replaces the pattern; Undo brings it back. Felt: by a model of skin. Ears: without protection.",
            ),
          ),
          this.sliders,
          panel(
            "File",
            null,
            this._row("Name", this.fileName, "Name of the files in the folder."),
            make("div.buttons", {}, this.save, this.saveDrive),
            make(
              "p.quiet",
              {},
              "Save writes NAME.toml; the drive, NAME.drive.h5, can be played and used in a study.",
            ),
            this._row("Open", this.opens, "A pattern of the folder."),
            this.said,
          ),
        ),
        make(
          "div.column",
          {},
          panel(
            "Palm",
            make("span", {}, simulated(), " ", this.mapWords),
            make(
              "div.buttons",
              {},
              this.undoes,
              this.redoes,
              make("label", { htmlFor: "draw-snap" }, this.snaps, " Snap to 1 mm"),
              this.spots,
            ),
            make("div.palm-picture", {}, this.map, this.view),
            make(
              "p.quiet",
              {},
              "Drag on the palm: a new path. Drag a handle, or press arrow keys, with Shift by 5 mm; Delete removes it. All spots press at once.",
            ),
          ),
          this.line.box,
        ),
        make(
          "div.column",
          {},
          panel(
            "Effect on the palm",
            simulated(),
            make("div.gets", {}, make("figure", {}, this.skin, this.skinWords), this.lines),
            make(
              "div.buttons",
              {},
              this.play,
              make("label", { htmlFor: "draw-loop" }, this.loops, " in a loop"),
            ),
            this.played,
            make(
              "p.quiet",
              {},
              "The exposure of the whole drive is checked before it plays. In a loop, each " +
                "change is checked too, and then played in the next pass. Esc is STOP.",
            ),
          ),
          this.formPanel,
          panel("Pattern", null, this.whole),
        ),
      ),
    );
    this._shown();
  }
  /** A control, its label and one line of help. */
  _row(label, control, help, ...more) {
    const id = (control.id ||= `draw-${label.replace(/\W/g, "-")}`);
    control.setAttribute("aria-describedby", `${id}-help`);
    return make(
      "div.field.helped",
      {},
      make("label", { htmlFor: id }, label),
      make("span.buttons", {}, control, ...more),
      make("small.quiet", { id: `${id}-help` }, help),
    );
  }
  _number(from, path, [label, unit, otherwise, low, high, step, help, most], key = "") {
    const found = get(from, path),
      id = `draw-${key}${path.replace(/\./g, "-")}`,
      shown = this.value(from, path, otherwise),
      whole = ["shape.a", "shape.b", "signal.channel"].includes(path);
    const control = make("input", {
      type: "number",
      id,
      step: "any",
      value: shown === null ? "" : String(shown),
      onchange: () => {
        if (control.value === "" && otherwise === null) {
          this.edit(() => put(from, path, undefined));
          return;
        }
        const given = Number(control.value);
        if (control.value === "" || !Number.isFinite(given)) {
          control.value = String(this.value(from, path, otherwise));
          return;
        }
        this.edit(() => this.set(from, path, whole ? Math.round(given) : given), id);
      },
    });
    const slides = isName(found),
      slider = buttonOf(
        slides ? found : "slider",
        "A named parameter with a slider, also of the file",
        () =>
          this.edit(() =>
            this._slider(
              from,
              path,
              shown,
              low,
              Math.max(high, most ?? high, shown) > high && shown > high ? (most ?? shown) : high,
            ),
          ),
        {
          id: `${id}-slider`,
          "aria-pressed": slides ? "true" : "false",
          "aria-label": `${label}: slider`,
        },
      );
    return this._row(
      unit ? `${label}, ${unit}` : label,
      control,
      help,
      ...(whole || shown === null ? [] : [slider]),
    );
  }
  _slider(from, path, value, low, high) {
    const parameters = (this.pattern.parameters ??= {}),
      found = get(from, path);
    if (isName(found)) {
      put(from, path, value);
      return;
    }
    const stem = path
      .replace(/^(shape|am|lm)\./, "")
      .replace(/_(mm|deg|pa|hz|m_s|s)$/, "")
      .replace("centre_mm.0", "x")
      .replace("centre_mm.1", "y");
    let name = stem;
    for (let i = 2; name in parameters; i++) name = `${stem}_${i}`;
    parameters[name] = { default: value, min: Math.min(low, value), max: Math.max(high, value) };
    put(from, path, `$${name}`);
  }
  _forms() {
    const held = document.activeElement?.id,
      { one, pattern } = this,
      number = path => this._number(one, path, NUMBERS[path]);
    const { name } = one.shape,
      many = this.many;
    this.formPanel.querySelector("h2").textContent = `Spot ${this.spot + 1}`;
    this.spots.replaceChildren(
      ...pattern.spot.map((_, i) =>
        buttonOf(
          `Spot ${i + 1}`,
          "Shows the settings of this spot",
          () => {
            this.spot = i;
            this.corner = 0;
            this._shown();
          },
          { "aria-pressed": i === this.spot ? "true" : "false" },
        ),
      ),
      buttonOf(
        "Add",
        "Adds a spot at the centre",
        () =>
          this.edit(() => {
            this.spot =
              pattern.spot.push({
                shape: { name: "points", places_mm: [[0, 0]] },
                centre_mm: [0, 0],
                pressure_pa: 50,
                am: { frequency_hz: 150, depth: 1 },
              }) - 1;
          }),
        { id: "draw-add" },
      ),
      buttonOf(
        "Duplicate",
        "Adds a copy 10 mm to the right",
        () =>
          this.edit(() => {
            const twin = copy(one);
            this.spot = pattern.spot.push(twin) - 1;
            twin.centre_mm[0] = this.value(one, "centre_mm.0") + 10;
          }),
        { id: "draw-copy" },
      ),
      buttonOf("Delete", "Removes the chosen spot", () => this._remove(), {
        id: "draw-delete",
        disabled: pattern.spot.length < 2,
      }),
    );
    const own = name in SHAPES ? [] : [[name, name]];
    const shape = choice(
      [...Object.entries(SHAPES).map(([key, [words]]) => [key, words]), ...own],
      name,
      () =>
        this.edit(() => {
          one.shape = { name: shape.value, ...copy(SHAPES[shape.value]?.[1] ?? {}) };
          this.corner = 0;
        }),
    );
    shape.id = "draw-shape";
    const moves = choice(
      [
        ["", "none"],
        ["draw_hz", "passes"],
        ["speed_m_s", "speed"],
      ],
      "draw_hz" in one && one.draw_hz !== 0 ? "draw_hz" : one.speed_m_s ? "speed_m_s" : "",
      () =>
        this.edit(() => {
          for (const key of ["draw_hz", "speed_m_s"]) delete one[key];
          if (moves.value) one[moves.value] = NUMBERS[moves.value][2];
        }),
    );
    moves.id = "draw-moves";
    const ticked = (key, label, help, start) => {
      const box = make("input", {
        type: "checkbox",
        id: `draw-${key}`,
        checked: Boolean(one[key]),
        onchange: () =>
          this.edit(() => {
            if (box.checked) one[key] = start;
            else delete one[key];
          }),
      });
      return this._row(label, box, help);
    };
    const takes = (this.link.state.takes ?? []).map(take => take.name),
      files = new Set(["", one.signal?.file ?? "", ...takes]);
    const signal = choice(
      [...files].map(file => [
        file,
        file.replace(/^sample:(.*)/, "a copy of the sample $1") || "none",
      ]),
      one.signal?.file ?? "",
      async () => {
        const sample = signal.value.startsWith("sample:"),
          file = sample
            ? await tried(this.link.order("reproduce", "duplicate", { take: signal.value }))
            : signal.value;
        this.edit(() => {
          if (file) one.signal = { ...one.signal, file };
          else delete one.signal;
        });
      },
    );
    signal.id = "draw-signal";
    const outline = make("textarea", {
      id: "draw-svg",
      rows: 3,
      maxLength: 20000,
      spellcheck: false,
      value: one.shape.path ?? "",
      onchange: () =>
        this.edit(() => {
          one.shape.path = outline.value;
        }),
    });
    const cornerRows = !many
      ? []
      : [
          make(
            "div.buttons",
            {},
            buttonOf(
              name === "points" ? "Add a place" : "Add a corner",
              "Adds a corner after the chosen one",
              () => this._addCorner(),
              { id: "draw-corner-add" },
            ),
            buttonOf(
              name === "points" ? "Delete the place" : "Delete the corner",
              "Removes the chosen corner",
              () => this._removeCorner(),
              { id: "draw-corner-delete", disabled: many.length <= (name === "points" ? 1 : 3) },
            ),
          ),
          ...[0, 1].map(axis =>
            this._number(
              one,
              `shape.${CORNERS[name]}.${this.corner}.${axis}`,
              [
                `${name === "points" ? "Place" : "Corner"} ${this.corner + 1}, ${"xy"[axis]}`,
                "mm",
                0,
                -40,
                40,
                1,
                "From the centre of the spot.",
              ],
              "corner-",
            ),
          ),
        ];
    this.form.replaceChildren(
      this._row("Shape", shape, "The path that the focus moves along."),
      ...Object.keys(SHAPES[name]?.[1] ?? {})
        .filter(key => `shape.${key}` in NUMBERS)
        .map(key => number(`shape.${key}`)),
      ...cornerRows,
      ...(name === "svg"
        ? [this._row("Path", outline, "The d of a path in an SVG file, M0 0L10 5 say.")]
        : []),
      number("centre_mm.0"),
      number("centre_mm.1"),
      number("turn_deg"),
      number("pressure_pa"),
      this._row("Motion (STM)", moves, "Spatiotemporal modulation, along the path."),
      ...(moves.value ? [number(moves.value)] : []),
      ticked("am", "Vibration (AM)", "Amplitude modulation: the pressure rises and falls.", {
        frequency_hz: 150,
        depth: 1,
      }),
      ...(one.am ? [number("am.frequency_hz"), number("am.depth")] : []),
      ticked("lm", "Small orbit (LM)", "Lateral modulation: the focus circles around its place.", {
        frequency_hz: 5,
        radius_mm: 3,
      }),
      ...(one.lm ? [number("lm.frequency_hz"), number("lm.radius_mm")] : []),
      this._row("Recorded signal", signal, "The pressure follows a take of the folder, too."),
      ...(one.signal ? [number("signal.channel"), number("signal.depth")] : []),
      number("start_s"),
      number("stop_s"),
    );
    this.whole.replaceChildren(
      this._number(
        pattern,
        "duration_s",
        ["Length", "s", null, 0.1, 2, 0.1, "Length of one pass; empty: a loop, drawn for 2 s."],
        "whole-",
      ),
      this._number(
        pattern,
        "height_mm",
        ["Height", "mm", 200, 100, 400, 1, "Palm above the array."],
        "whole-",
      ),
    );
    // the length of a file is a number
    for (const button of this.whole.querySelectorAll("[aria-pressed]")) button.remove();
    const sliders = Object.entries(pattern.parameters ?? {});
    this.sliders.hidden = !sliders.length;
    this.more.replaceChildren(
      ...sliders.map(([key, known]) => {
        const low = known.min ?? Math.min(0, known.default),
          high = known.max ?? Math.max(1, 2 * known.default),
          told = make("output", {}, String(known.default));
        const control = make("input", {
          type: "range",
          id: `draw-slider-${key}`,
          min: low,
          max: high,
          step: "any",
          onchange: () => this._forms(),
          oninput: () => {
            const coarse = (high - low) / 200,
              value = Number((Math.round(Number(control.value) / coarse) * coarse).toPrecision(3));
            told.value = String(value);
            this.edit(
              () => {
                known.default = Math.max(low, Math.min(high, value));
              },
              `slider ${key}`,
              false,
            );
          },
        });
        control.step = String((high - low) / 200);
        control.value = String(known.default);
        return this._row(key, control, `From ${low} to ${high}; $${key} in the file.`, told);
      }),
    );
    if (document.activeElement !== this.fileName) this.fileName.value = pattern.name ?? "";
    if (held && document.activeElement?.id !== held) document.getElementById(held)?.focus();
  }
  _remove() {
    if (this.pattern.spot.length > 1)
      this.edit(() => {
        this.pattern.spot.splice(this.spot, 1);
        this.corner = 0;
      });
  }
  _addCorner() {
    const { many, corner } = this,
      [x, y] = [0, 1].map(axis => this.value(many, `${corner}.${axis}`)),
      next = (corner + 1) % many.length,
      [nx, ny] = [0, 1].map(axis => this.value(many, `${next}.${axis}`));
    this.edit(() => {
      many.splice(
        corner + 1,
        0,
        many.length < 2 ? [x + 10, y] : [this.step((x + nx) / 2), this.step((y + ny) / 2)],
      );
      this.corner = corner + 1;
    });
  }
  _removeCorner() {
    const { many, corner, one } = this;
    if (many.length > (one.shape.name === "points" ? 1 : 3))
      this.edit(() => {
        many.splice(corner, 1);
      });
  }

  /** Places of a path in mm, and whether they are joined. */
  _path(spot) {
    const { shape } = spot,
      v = key => this.value(shape, key, SHAPES[shape.name]?.[1][key]),
      many = shape[CORNERS[shape.name]];
    const turn = (this.value(spot, "turn_deg") * Math.PI) / 180,
      [cx, cy] = [this.value(spot, "centre_mm.0"), this.value(spot, "centre_mm.1")],
      circle = (from, to) =>
        Array.from({ length: 73 }, (_, i) => {
          const a = ((from + ((to - from) * i) / 72) * Math.PI) / 180;
          return [v("radius_mm") * Math.cos(a), v("radius_mm") * Math.sin(a)];
        });
    const own = many
      ? many.map((_, i) => [this.value(many, `${i}.0`), this.value(many, `${i}.1`)])
      : shape.name === "svg"
        ? outlineOf(shape.path).map(place => place.map(value => v("size_mm") * value))
        : shape.name === "circle"
          ? circle(0, 360)
          : shape.name === "arc"
            ? circle(v("from_deg"), v("to_deg"))
            : shape.name === "line"
              ? [
                  [-v("length_mm") / 2, 0],
                  [v("length_mm") / 2, 0],
                ]
              : shape.name === "lissajous"
                ? Array.from({ length: 361 }, (_, i) => [
                    (v("width_mm") / 2) *
                      Math.sin((2 * Math.PI * v("a") * i) / 360 + (v("phase_deg") * Math.PI) / 180),
                    (v("depth_mm") / 2) * Math.sin((2 * Math.PI * v("b") * i) / 360),
                  ])
                : [[0, 0]];
    return own.map(([x, y]) => [
      cx + x * Math.cos(turn) - y * Math.sin(turn),
      cy + x * Math.sin(turn) + y * Math.cos(turn),
    ]);
  }
  _picture() {
    const held = document.activeElement?.dataset?.handle;
    const parts = [
      drawn("path", {
        class: "hand",
        d: "M-32 52C-42 36-47 12-46-18C-46-30-45-40-46-52M46-52C45-40 45-30 46-20C49-16 51-12 52-8M46 14C43 32 38 42 32 52M-22-52V-46M0-52V-47M22-52V-46",
      }),
      drawn("path", { class: "scale", d: "M-48 47H-38M-48 46V48M-38 46V48" }),
    ];
    const scale = drawn("text", { x: -36, y: 48.5 });
    scale.textContent = "10 mm";
    parts.push(scale);
    this.pattern.spot.forEach((spot, i) => {
      const path = this._path(spot),
        { name } = spot.shape,
        chosen = i === this.spot;
      if (name !== "points")
        for (const kind of ["edge", "path"])
          parts.push(
            drawn("path", {
              class: `${kind}${chosen ? " chosen" : ""}`,
              d: `${lineOf(path, name === "svg")}${name === "polygon" ? "Z" : ""}`,
            }),
          );
      const centre = [this.value(spot, "centre_mm.0"), this.value(spot, "centre_mm.1")];
      if (chosen && spot.key) {
        const places = spot.key.map(key =>
          this.line.place(key).map((value, axis) => value + centre[axis]),
        );
        parts.push(
          drawn("path", { class: "way", d: lineOf(places) }),
          ...places.map((place, j) =>
            this._handle(
              `${i}.k${j}`,
              place,
              `Spot ${i + 1}, key ${j + 1}`,
              j === this.line.key,
              2.6,
            ),
          ),
        );
      }
      parts.push(
        this._handle(
          `${i}`,
          centre,
          `Spot ${i + 1}, ${SHAPES[name]?.[0] ?? name}, centre`,
          chosen,
          2.4,
          String(i + 1),
        ),
      );
      if (chosen && CORNERS[name] && (name !== "points" || path.length > 1))
        path.forEach((place, j) =>
          parts.push(
            this._handle(
              `${i}.${j}`,
              place,
              `Spot ${i + 1}, ${name === "points" ? "place" : "corner"} ${j + 1}`,
              j === this.corner,
              1.7,
            ),
          ),
        );
      else if (name === "points" && path.length > 1)
        for (const [x, y] of path)
          parts.push(drawn("circle", { class: "path", cx: x, cy: -y, r: 1.2 }));
    });
    if (this.stroke) parts.push(drawn("path", { class: "path chosen", d: lineOf(this.stroke) }));
    this.view.replaceChildren(...parts);
    if (held) this.view.querySelector(`[data-handle="${held}"]`)?.focus({ preventScroll: true });
  }
  _handle(key, [x, y], label, chosen, r, words = "") {
    const made = drawn("g", {
      "data-handle": key,
      tabindex: 0,
      role: "button",
      "aria-pressed": chosen,
      "aria-label": `${label} at ${Number(x.toFixed(1))}, ${Number(y.toFixed(1))} mm`,
    });
    made.append(
      drawn("circle", { class: "reach", cx: x, cy: -y, r: 4 }),
      key.includes("k")
        ? drawn("path", {
            class: `handle${chosen ? " chosen" : ""}`,
            d: `M${x - r} ${-y}l${r} ${-r} ${r} ${r} ${-r} ${r}z`,
          })
        : drawn("circle", { class: `handle${chosen ? " chosen" : ""}`, cx: x, cy: -y, r }),
    );
    if (words) {
      const text = drawn("text", { class: "number", x, y: -y + 1.1, "aria-hidden": "true" });
      text.textContent = words;
      made.append(text);
    }
    return made;
  }
  /** Spot of a handle, and its corner or its key frame. */
  _parts(key) {
    const [, i, , k, j] = /^(\d+)(\.(k?)(\d+))?$/.exec(key);
    return { i: Number(i), j: j && !k ? Number(j) : undefined, k: k ? Number(j) : undefined };
  }
  /** Move a handle to a place in mm: the centre of a spot, or a corner, or a key frame. */
  _move(key, place, kind) {
    const { i, j, k } = this._parts(key),
      spot = this.pattern.spot[i],
      [x, y] = place.map(value => Math.max(-60, Math.min(60, this.step(value))));
    this.edit(
      () => {
        const moved =
          k === undefined
            ? [spot, 0, 0]
            : [spot.key[k], this.value(spot, "centre_mm.0"), this.value(spot, "centre_mm.1")];
        if (j === undefined) {
          this.set(moved[0], "centre_mm.0", this.step(x - moved[1]));
          this.set(moved[0], "centre_mm.1", this.step(y - moved[2]));
          return;
        }
        const turn = (-this.value(spot, "turn_deg") * Math.PI) / 180,
          dx = x - this.value(spot, "centre_mm.0"),
          dy = y - this.value(spot, "centre_mm.1"),
          many = spot.shape[CORNERS[spot.shape.name]];
        const round = value => Number(value.toFixed(1));
        this.set(many, `${j}.0`, round(dx * Math.cos(turn) - dy * Math.sin(turn)));
        this.set(many, `${j}.1`, round(dx * Math.sin(turn) + dy * Math.cos(turn)));
      },
      `${kind} ${key}`,
      kind !== "drag",
    );
  }
  _choose(key) {
    const { i, j, k } = this._parts(key);
    if (
      i === this.spot &&
      (j ?? this.corner) === this.corner &&
      (k ?? this.line.key) === this.line.key
    )
      return;
    if (i !== this.spot) this.corner = 0;
    this.spot = i;
    this.corner = j ?? this.corner;
    this.line.key = k ?? this.line.key;
    this._tidy();
    this._forms();
    this._picture();
    this.line.show();
  }
  _place(key) {
    const { i, j, k } = this._parts(key),
      spot = this.pattern.spot[i],
      centre = [this.value(spot, "centre_mm.0"), this.value(spot, "centre_mm.1")];
    return j !== undefined
      ? this._path(spot)[j]
      : k === undefined
        ? centre
        : this.line.place(spot.key[k]).map((value, axis) => value + centre[axis]);
  }
  _pointer() {
    const { view } = this,
      at = ({ clientX, clientY }) => {
        const box = view.getBoundingClientRect();
        return [
          ((clientX - box.left) / box.width - 0.5) * 2 * HALF,
          (0.5 - (clientY - box.top) / box.height) * 2 * HALF,
        ];
      };
    let dragged = "";
    view.addEventListener("pointerdown", event => {
      if (event.button) return;
      event.preventDefault();
      view.setPointerCapture(event.pointerId);
      dragged = event.target.closest?.("[data-handle]")?.dataset.handle ?? "";
      if (dragged) {
        this._choose(dragged);
        this.last = "";
        view.querySelector(`[data-handle="${dragged}"]`)?.focus({ preventScroll: true });
      } else this.stroke = [at(event)];
    });
    view.addEventListener("pointermove", event => {
      if (dragged) this._move(dragged, at(event), "drag");
      else if (this.stroke) {
        for (const each of event.getCoalescedEvents?.() ?? [event]) this.stroke.push(at(each));
        this._picture();
      }
    });
    const end = () => {
      const path = this.stroke;
      this.stroke = null;
      if (dragged) this._forms();
      else if (path) this._drew(path);
      dragged = "";
    };
    view.addEventListener("pointerup", end);
    view.addEventListener("pointercancel", () => {
      this.stroke = null;
      dragged = "";
      this._shown();
    });
    view.addEventListener("focusin", ({ target }) => {
      const key = target.dataset?.handle;
      if (key) this._choose(key);
    });
    view.addEventListener("keydown", event => {
      const key = event.target.dataset?.handle,
        by = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] }[
          event.key
        ];
      if (!key) return;
      if (by) {
        event.preventDefault();
        const size = event.shiftKey ? 5 : 1,
          [x, y] = this._place(key);
        this._move(key, [x + size * by[0], y + size * by[1]], "key");
      } else if (event.key === "Delete" || event.key === "Backspace") {
        event.preventDefault();
        if (key.includes("k")) this.line.remove();
        else if (key.includes(".")) this._removeCorner();
        else this._remove();
      }
    });
  }
  /** A drawn path becomes the shape of the chosen spot: a polygon, or a line if it is straight. */
  _drew(path) {
    const found = corners(path),
      span = Math.max(
        ...[0, 1].map(
          axis => Math.max(...path.map(one => one[axis])) - Math.min(...path.map(one => one[axis])),
        ),
      );
    if (span < 4) {
      this._picture();
      return;
    }
    this.edit(() => {
      const { one } = this,
        centre = [0, 1].map(axis =>
          this.step(found.reduce((sum, place) => sum + place[axis], 0) / found.length),
        );
      this.set(one, "centre_mm.0", centre[0]);
      this.set(one, "centre_mm.1", centre[1]);
      const [x, y] = [this.value(one, "centre_mm.0"), this.value(one, "centre_mm.1")];
      if (found.length < 3) {
        const [[ax, ay], [bx, by]] = [found[0], found.at(-1)];
        one.shape = {
          name: "line",
          length_mm: Math.max(this.step(Math.hypot(bx - ax, by - ay)), 1),
        };
        one.turn_deg = Math.round((Math.atan2(by - ay, bx - ax) * 180) / Math.PI);
      } else {
        one.shape = {
          name: "polygon",
          corners_mm: found.map(place => [this.step(place[0] - x), this.step(place[1] - y)]),
        };
        delete one.turn_deg;
      }
      if (!one.draw_hz && !one.speed_m_s) one.draw_hz = 20;
      this.corner = 0;
    });
  }

  _soon() {
    this.lines.classList.add("old");
    clearTimeout(this.timer);
    this.timer = setTimeout(() => this._preview(), 250);
  }
  async _preview() {
    if (this.left || this.busy) {
      this.again = true;
      return;
    }
    this.busy = true;
    const asked = JSON.stringify(this.pattern);
    let found, wrong;
    const changed =
      this.looping && this.link.controls && asked !== this.sent
        ? this.link.order("draw", "change", { pattern: this.pattern }).then(
            () => "playing in a loop, with this change",
            error => `not played: ${error.message}`,
          )
        : null;
    this.sent = asked;
    try {
      found = await this.link.order("draw", "preview", { pattern: this.pattern });
    } catch (error) {
      wrong = error.message;
    }
    if (changed) {
      this.played.textContent = "checking the exposure of this change …";
      this.played.textContent = await changed;
    }
    this.busy = false;
    if (this.left) return;
    if (this.again) {
      this.again = false;
      this._preview();
      return;
    }
    this.found = found;
    this.lines.classList.remove("old");
    if (wrong) {
      this.lines.replaceChildren(make("p.bad", {}, wrong));
      return;
    }
    this.seen = asked;
    const { pressure, motion, exposure, felt } = found;
    const [place, skin] = [pressure, motion].map(({ at_mm: [x, y] }) => `at ${x}, ${y} mm`);
    this.lines.replaceChildren(
      make(
        "p",
        {},
        `Pressure: ${pressure.top} Pa rms ${place}, ${found.highest_pa} Pa at most, ` +
          `${(100 * found.reach).toFixed(0)} % of what the array can do.`,
      ),
      make("p", {}, `Skin: moves by ${motion.top} µm rms ${skin}, 20 to 470 Hz.`),
      make(
        exposure?.loud ? "p.bad" : "p.good",
        { id: "draw-exposure" },
        exposure
          ? `Ears: ${exposure.text}; about ${exposure.peak_db} dB at the ${exposure.place}, limit ${exposure.limit_db} dB.`
          : "Ears: the pattern is silent.",
      ),
      make(felt.of_ten >= 9 ? "p.good" : "p.bad", { id: "draw-felt" }, `Felt ${felt.text}.`),
    );
    const part = this.pattern.duration_s > 1 || !this.pattern.duration_s ? ", first second" : "";
    this.mapWords.textContent = `pressure, 0 to ${pressure.top} Pa rms${part}`;
    this.skinWords.textContent = `motion, 0 to ${motion.top} µm rms`;
    this._paint(
      this.map,
      pressure,
      found,
      `Pressure on the palm, rms: ${pressure.top} Pa ${place}`,
    );
    this._paint(this.skin, motion, found, `Motion of the skin, rms: ${motion.top} µm ${skin}`);
  }
  async _paint(canvas, { steps }, { rows }, label) {
    const table = await colours("inferno"),
      small = document.createElement("canvas"),
      pen = canvas.getContext("2d");
    small.width = small.height = rows;
    const image = new ImageData(rows, rows),
      pixels = new Uint32Array(image.data.buffer);
    steps.forEach((step, i) => {
      pixels[(rows - 1 - Math.floor(i / rows)) * rows + (i % rows)] =
        table.pixels[Math.max(step, 0)];
    });
    small.getContext("2d").putImageData(image, 0, 0);
    pen.clearRect(0, 0, canvas.width, canvas.height);
    pen.drawImage(small, 0, 0, canvas.width, canvas.height);
    canvas.setAttribute("aria-label", label);
  }

  _files({ palette, files }) {
    if (!this.palette.children.length)
      this.palette.append(
        ...Object.values(palette).map(([one, felt, ears, loud]) =>
          buttonOf(
            [one.name, badges(felt, ears, loud.replace(" without protection", ""))],
            "Replaces the pattern",
            () =>
              this.edit(() => {
                this.pattern = copy(one);
                this.spot = this.corner = 0;
              }),
            { "aria-label": one.name, "aria-description": `felt by ${felt} of 10; ears: ${loud}` },
          ),
        ),
      );
    this.opens.replaceChildren(
      make("option", { value: "" }, files.length ? "choose …" : "none yet"),
      ...files.map(name => make("option", { value: name }, name)),
    );
  }
  async _open(file) {
    this.opens.value = "";
    const found = file && (await tried(this.link.order("draw", "open", { take: file })));
    if (!found || this.left) return;
    this.edit(() => {
      this.pattern = { ...found, name: found.name || file.replace(/\.toml$/, "") };
      this.spot = this.corner = 0;
    });
    this.said.textContent = `opened ${file}`;
  }
  async _save(drive) {
    const given = {
      name: this.fileName.value.trim(),
      pattern: { ...this.pattern, name: this.fileName.value.trim() },
      drive,
    };
    if (!given.name) {
      this.fileName.focus();
      this.said.textContent = "Give it a name first.";
      return;
    }
    this.said.textContent = drive ? "drawing …" : "saving …";
    let answer = await tried(this.link.order("draw", "save", given));
    while (answer?.asks)
      answer = (await mayReplace(this.link, answer.asks.files))
        ? await tried(this.link.order("draw", "save", { ...given, replaces: answer.asks.replaces }))
        : null;
    this.said.textContent = answer ? `saved ${answer.saved.join(" and ")}` : "not saved";
  }
  async _play() {
    const { link } = this,
      loop = this.loops.checked;
    if (this.looping) {
      tried(link.stop());
      return;
    }
    this.playing = true;
    this.control();
    const say = words => {
      this.played.textContent = words;
    };
    try {
      say("drawing …");
      this.sent = JSON.stringify(this.pattern);
      const take = await link.order("draw", "draft", { pattern: this.pattern });
      if (link.state.player.device !== "virtual") {
        say("");
        askToPlay(this.studio, take);
        document.getElementById("loop").checked = loop;
        return;
      }
      say("checking the exposure …");
      const found = await link.order("play", "check", { take });
      if (this.left || !found.number) {
        say(found.refused || "");
        return;
      }
      say(
        loop
          ? "SIMULATED: playing in a loop; change the pattern meanwhile, Esc ends it"
          : "playing …",
      );
      const report = await link.order("play", "play", { clearance: found.number, loop });
      say(
        `SIMULATED: played ${report.frames ?? "all"} frames on the virtual array. ${found.outcome === "exceeded" ? `On a real array: ${found.verdict.replace(/^exceeded: /, "")}` : found.verdict}`,
      );
    } catch (wrong) {
      say(loop && /stopped on request/.test(wrong.message) ? "stopped" : wrong.message);
    } finally {
      this.playing = false;
      if (!this.left) this.control();
    }
  }
}
