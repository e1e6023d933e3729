/* Key frames of a spot on a time line: when its centre is where, and which part of its pressure
    it has. */

import { buttonOf, choice, make, panel } from "/web/dom.js";
import { drawn } from "/web/palm-view.js";

const WIDE = 400,
  HIGH = 84,
  LEFT = 26,
  RIGHT = 390,
  TOP = 12,
  FLOOR = 62; // of the picture
const EASES = [
  ["linear", "straight"],
  ["smooth", "smooth"],
  ["step", "jump at the end"],
];

export class TimeLine {
  /** `room`: the panel Draw, whose chosen spot is shown. */
  constructor(room) {
    this.room = room;
    this.key = 0;
    const button = (words, id, act, title) => buttonOf(words, title, act, { id });
    this.adds = button(
      "Add a key",
      "draw-key-add",
      () => this.add(),
      "Halfway from the chosen key to the next; the first click adds two",
    );
    this.removes = button(
      "Delete the key",
      "draw-key-delete",
      () => this.remove(),
      "Removes the chosen key",
    );
    this.view = drawn("svg", { class: "times", viewBox: `0 0 ${WIDE} ${HIGH}`, role: "group" });
    this.row = make("div.buttons.key");
    this.help = make("p.quiet");
    this.box = panel(
      "Key frames",
      make("span.buttons", {}, this.adds, this.removes),
      this.view,
      this.row,
      this.help,
    );
    this._pointer();
  }
  get keys() {
    return this.room.one.key ?? [];
  }
  /** A number of a key, or of its parameter. */
  value(key, name) {
    return this.room.value(key, name, name === "part" ? 1 : 0);
  }
  /** Where a key is, from the centre of its spot in mm. */
  place(key) {
    return [this.value(key, "centre_mm.0"), this.value(key, "centre_mm.1")];
  }
  /** Seconds that the time line shows. */
  get span() {
    const { room } = this;
    return (
      this.held ||
      Math.max(
        (room.value(room.pattern, "duration_s") || 2) - room.value(room.one, "start_s"),
        ...this.keys.map(key => this.value(key, "at_s")),
        0.1,
      )
    );
  }
  x(time) {
    return LEFT + ((RIGHT - LEFT) * time) / this.span;
  }
  y(part) {
    return FLOOR - (FLOOR - TOP) * part;
  }
  /** The key that applies at a time, and the share of the way to the next one that has passed. */
  _at(time) {
    const { keys } = this,
      before = Math.max(
        0,
        keys.findLastIndex(key => this.value(key, "at_s") <= time),
      ),
      after = keys[before + 1],
      from = this.value(keys[before], "at_s");
    const share = after && time > from ? (time - from) / (this.value(after, "at_s") - from) : 0,
      { ease } = keys[before];
    return [
      before,
      ease === "step" ? 0 : ease === "smooth" ? share * share * (3 - 2 * share) : share,
    ];
  }
  _between(time, name) {
    const [before, share] = this._at(time),
      value = this.value(this.keys[before], name);
    return share ? value + share * (this.value(this.keys[before + 1], name) - value) : value;
  }

  /** Add a key at a time, with what holds there; the first one brings one at the start and one
      at the end. */
  add(time) {
    const { room, keys } = this,
      { one } = room,
      end = Number(this.span.toFixed(2));
    if (!keys.length) {
      room.edit(() => {
        one.key = [0, end].map(at_s => ({ at_s, centre_mm: [0, 0] }));
        this.key = 1;
      });
      return;
    }
    const near = at => this.value(keys[at], "at_s"),
      from = Math.max(0, this.key === keys.length - 1 ? this.key - 1 : this.key);
    const at_s = Number(
      (time ?? (keys.length > 1 ? (near(from) + near(from + 1)) / 2 : (near(0) + end) / 2)).toFixed(
        3,
      ),
    );
    if (keys.some(key => this.value(key, "at_s") === at_s)) return;
    const round = name => Number(this._between(at_s, name).toFixed(2)),
      made = {
        at_s,
        centre_mm: [round("centre_mm.0"), round("centre_mm.1")],
        part: round("part"),
        ease: keys[this._at(at_s)[0]].ease ?? "linear",
      };
    room.edit(() => {
      keys.push(made);
      keys.sort((a, b) => this.value(a, "at_s") - this.value(b, "at_s"));
      this.key = keys.indexOf(made);
    });
  }
  remove() {
    const { room, keys } = this,
      { one } = room;
    room.edit(() => {
      keys.splice(this.key, 1);
      if (!keys.length) for (const name of ["key", "loop_keys"]) delete one[name];
      else if (keys.length < 2) delete one.loop_keys;
    });
  }
  /** Move the key `at` to a time, between its neighbours, and to a part of the pressure. */
  move(at, time, part, kind, whole = true) {
    const { room, keys } = this,
      near = (other, otherwise) => (keys[other] ? this.value(keys[other], "at_s") : otherwise),
      clear = (value, unit) => Number((Math.round(value / unit) * unit).toFixed(3));
    const most = near(at + 1, Infinity) - 0.01,
      least = at ? near(at - 1, 0) + 0.01 : 0;
    room.edit(
      () => {
        room.set(keys[at], "at_s", clear(Math.max(least, Math.min(most, time)), 0.001));
        room.set(keys[at], "part", clear(Math.max(0, Math.min(1, part)), 0.01));
      },
      `${kind} key ${at}`,
      whole,
    );
  }
  choose(at) {
    if (at !== this.key) {
      this.key = at;
      this.show();
      this.room._picture();
    }
  }

  show(whole = true) {
    const { room, keys } = this,
      { one } = room,
      count = keys.length,
      held = document.activeElement?.dataset?.key;
    this.key = Math.max(0, Math.min(this.key, count - 1));
    this.box.querySelector("h2").textContent = `Key frames of spot ${room.spot + 1}`;
    this.removes.disabled = !count;
    this.view.setAttribute(
      "aria-label",
      `Time line, ${count} key frames; arrow keys move the chosen one`,
    );
    const unit =
        [0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10, 30, 60].find(each => this.span / each <= 8) ?? 600,
      parts = [],
      text = (x, y, words, anchor) => {
        const made = drawn("text", { x, y, "text-anchor": anchor });
        made.textContent = words;
        return made;
      };
    for (let at = 0; at <= this.span + 1e-9; at += unit)
      parts.push(
        drawn("path", { class: "tick", d: `M${this.x(at)} ${FLOOR}V${FLOOR + 4}` }),
        text(
          this.x(at),
          FLOOR + 15,
          `${Number(at.toFixed(2))} s`,
          at ? (this.x(at) > RIGHT - 8 ? "end" : "middle") : "start",
        ),
      );
    parts.push(
      drawn("path", { class: "axis", d: `M${LEFT} ${FLOOR}H${RIGHT}M${LEFT} ${TOP}H${RIGHT}` }),
      text(LEFT - 9, TOP + 4, "1", "end"),
      text(LEFT - 9, FLOOR + 4, "0", "end"),
    );
    if (count) {
      const times = [
        ...Array.from({ length: 201 }, (_, i) => (this.span * i) / 200),
        ...keys.flatMap(key => {
          const at = this.value(key, "at_s");
          return [at - 1e-6, at];
        }),
      ].sort((a, b) => a - b);
      parts.push(
        drawn("path", {
          class: "level",
          d: `M${times.map(time => `${this.x(Math.max(0, time)).toFixed(2)} ${this.y(this._between(time, "part")).toFixed(2)}`).join("L")}`,
        }),
      );
    }
    keys.forEach((key, i) => {
      const [x, y] = [this.x(this.value(key, "at_s")), this.y(this.value(key, "part"))],
        [dx, dy] = this.place(key);
      const made = drawn("g", {
        "data-key": i,
        tabindex: 0,
        role: "button",
        "aria-pressed": i === this.key,
        "aria-label": `Key ${i + 1} at ${this.value(key, "at_s")} s: ${dx}, ${dy} mm from the centre, ${this.value(key, "part")} of the pressure`,
      });
      made.append(
        drawn("circle", { class: "reach", cx: x, cy: y, r: 13 }),
        drawn("path", {
          class: `handle${i === this.key ? " chosen" : ""}`,
          d: `M${x - 7} ${y}l7 -7 7 7 -7 7z`,
        }),
      );
      parts.push(made);
    });
    this.view.replaceChildren(...(count ? parts : []));
    this.view.style.display = count ? "" : "none";
    if (held) this.view.querySelector(`[data-key="${held}"]`)?.focus({ preventScroll: true });
    this.help.textContent = count
      ? "Upwards: part of the pressure. Drag a key, here in time and level, on the palm in " +
        "place (diamonds). Arrow keys do the same, Delete removes it, a double click adds one."
      : "With key frames the spot moves, and its pressure changes, over time.";
    if (!whole) return;
    const field = (words, name, title, change) => {
      const input = make("input", {
        type: "number",
        step: "any",
        id: `draw-key-${words[0]}`,
        title,
        value: String(this.value(keys[this.key], name)),
        onchange: () => {
          const given = Number(input.value);
          if (input.value !== "" && Number.isFinite(given)) change(given);
          else this.show();
        },
      });
      return make("label", {}, `${words} `, input);
    };
    const chosen = keys[this.key],
      set = name => given =>
        room.edit(() => {
          chosen.centre_mm ??= [0, 0];
          room.set(chosen, name, given);
        }, `key ${name}`);
    const ease =
        chosen &&
        choice(EASES, chosen.ease ?? "linear", () =>
          room.edit(() => {
            chosen.ease = ease.value;
          }),
        ),
      loops = make("input", {
        type: "checkbox",
        id: "draw-key-loop",
        title: "After the last key they begin again",
        checked: Boolean(one.loop_keys),
        disabled: count < 2,
        onchange: () =>
          room.edit(() => {
            if (loops.checked) one.loop_keys = true;
            else delete one.loop_keys;
          }),
      });
    if (ease)
      Object.assign(ease, {
        id: "draw-key-ease",
        title: "How place and level change until the next key",
      });
    this.row.replaceChildren(
      ...(chosen
        ? [
            make("strong", {}, `Key ${this.key + 1}`),
            field("time, s", "at_s", "Time after the start of the spot", given =>
              this.move(this.key, given, this.value(chosen, "part"), "typed"),
            ),
            field(
              "x, mm",
              "centre_mm.0",
              "To the right of the centre of the spot",
              set("centre_mm.0"),
            ),
            field(
              "y, mm",
              "centre_mm.1",
              "From the centre of the spot towards the fingers",
              set("centre_mm.1"),
            ),
            field("part", "part", "Part of the pressure, 0 to 1", given =>
              this.move(this.key, this.value(chosen, "at_s"), given, "typed"),
            ),
            make("label", {}, "way to the next ", ease),
            make("label", {}, loops, " repeat the keys"),
          ]
        : []),
    );
  }

  _pointer() {
    const { view } = this;
    const at = ({ clientX, clientY }) => {
      const box = view.getBoundingClientRect(),
        x = ((clientX - box.left) / box.width) * WIDE,
        y = ((clientY - box.top) / box.height) * HIGH;
      return [
        Math.max(0, Math.min(1, (x - LEFT) / (RIGHT - LEFT))) * this.span,
        (FLOOR - y) / (FLOOR - TOP),
      ];
    };
    let dragged = -1;
    view.addEventListener("pointerdown", event => {
      const key = event.target.closest?.("[data-key]")?.dataset.key;
      if (event.button || key === undefined) return;
      event.preventDefault();
      view.setPointerCapture(event.pointerId);
      dragged = Number(key);
      this.held = this.span; // the scale must not change under the pointer
      this.room.last = "";
      this.choose(dragged);
      view.querySelector(`[data-key="${key}"]`)?.focus({ preventScroll: true });
    });
    view.addEventListener("pointermove", event => {
      if (dragged < 0) return;
      const [time, part] = at(event),
        unit = this.room.snap ? 0.05 : 0.01;
      this.move(
        dragged,
        Math.round(time / unit) * unit,
        Math.round(part / 0.05) * 0.05,
        "drag",
        false,
      );
    });
    for (const name of ["pointerup", "pointercancel"])
      view.addEventListener(name, () => {
        this.held = 0;
        if (dragged >= 0) this.show();
        dragged = -1;
      });
    view.addEventListener("dblclick", event => {
      if (!event.target.closest?.("[data-key]")) this.add(Math.round(100 * at(event)[0]) / 100);
    });
    view.addEventListener("focusin", ({ target }) => {
      if (target.dataset?.key) this.choose(Number(target.dataset.key));
    });
    view.addEventListener("keydown", event => {
      const key = event.target.dataset?.key,
        by = {
          ArrowLeft: [-0.01, 0],
          ArrowRight: [0.01, 0],
          ArrowUp: [0, 0.05],
          ArrowDown: [0, -0.05],
        }[event.key];
      if (key === undefined) return;
      if (by) {
        event.preventDefault();
        const chosen = this.keys[key],
          size = event.shiftKey ? 10 : 1;
        this.move(
          Number(key),
          this.value(chosen, "at_s") + size * by[0],
          this.value(chosen, "part") + by[1],
          "arrow",
        );
      } else if (event.key === "Delete" || event.key === "Backspace") {
        event.preventDefault();
        this.remove();
      }
    });
  }
}
