/* Playing, pausing, looping and stepping through frames.

   At full speed a picture shows the rms of all frames since the last picture (`from` to `frame`):
   single frames would alias, so that a 60 Hz vibration would seem to stand still. At 1/10 and
   slower a picture shows one frame.

   transport = new Transport({frames, rate, first})   "change" event when another state is shown
   transport.run(draw)          calls draw(state) before the screen's next picture
   transport.press(event)       handles the keys of a player; true if it used the key
   controls(transport, root)    buttons, and what is shown in words */

const LADDER = [-1, -0.1, -0.01, 0.01, 0.1, 1];
const SPEEDS = { "1×": 1, "1/10": 0.1, "1/100": 0.01 };

export class Transport extends EventTarget {
  constructor({
    frames,
    rate,
    first = 0,
    still = matchMedia("(prefers-reduced-motion: reduce)").matches,
  }) {
    super();
    Object.assign(this, { frames, rate, first });
    this.frame = this.from = first;
    this.playing = !still; // paused at the start for users who prefer reduced motion
    this.speed = 1;
    this.span = Math.min(1, frames / rate);
    this.whole = this.span;
    this.channel = 0;
    this.channels = 1;
    this.phase = false;
    this.loop = { from: first, to: first + frames - 1, on: true };
    this.marks = [];
    this.drawn = 0;
    this._at = first; // may lie between two frames
    this._dirty = true;
  }
  get last() {
    return this.first + this.frames - 1;
  }
  get time() {
    return this.frame / this.rate;
  }
  get state() {
    const { frame, from, channel, span, phase, loop, marks } = this;
    return { frame, from, channel, span, phase, loop, marks };
  }
  /** Text that describes what a picture shows. */
  get shows() {
    const count = this.frame - this.from + 1;
    return count > 1 ? `each picture: rms of ${count} frames` : "each picture: one frame";
  }
  set(changes) {
    Object.assign(this, changes);
    this._changed();
  }
  seek(frame) {
    this._at =
      this.frame =
      this.from =
        Math.max(this.first, Math.min(this.last, Math.round(frame)));
    this._changed();
  }
  play() {
    // At one end, restart from the other end.
    if (!this.loop.on && this.frame === (this.speed > 0 ? this.last : this.first))
      this.seek(this.speed > 0 ? this.first : this.last);
    this.playing = true;
    this._before = undefined;
    this._changed();
  }
  pause() {
    this.playing = false;
    this.from = this.frame;
    this._at = this.frame;
    this._changed();
  }
  toggle() {
    if (this.playing) this.pause();
    else this.play();
  }
  step(count) {
    this.pause();
    this.seek(this.frame + count);
  }
  setSpeed(speed) {
    this.speed = speed;
    this._changed();
  }
  /** J and L: one step slower (or backwards), one faster. */
  rung(by) {
    if (!this.playing) {
      this.speed = by * Math.abs(this.speed);
      this.play();
      return;
    }
    this.setSpeed(
      LADDER[Math.max(0, Math.min(LADDER.length - 1, LADDER.indexOf(this.speed) + by))],
    );
  }
  setLoop(changes) {
    const loop = { ...this.loop, ...changes };
    if (loop.from > loop.to) [loop.from, loop.to] = [loop.to, loop.from];
    this.loop = loop;
    this._changed();
  }
  mark() {
    if (!this.marks.includes(this.frame))
      this.marks = [...this.marks, this.frame].sort((a, b) => a - b);
    this._changed();
  }
  nextMark() {
    const next = this.marks.find(mark => mark > this.frame) ?? this.marks[0];
    if (next !== undefined) this.seek(next);
  }
  zoom(factor) {
    this.set({
      span: Math.max(16 / this.rate, Math.min(this.frames / this.rate, this.span * factor)),
    });
  }
  /** Advance to the time `now` (ms); true if a new picture must be drawn. */
  advance(now) {
    const before = this._before ?? now;
    this._before = now;
    if (!this.playing) return this._take();
    // A page that was hidden continues at the frame where it stopped.
    this._at += (Math.min(now - before, 250) / 1000) * this.rate * this.speed;
    const { loop, speed } = this,
      low = loop.on ? loop.from : this.first,
      high = loop.on ? loop.to : this.last;
    let turned = false;
    if (speed > 0 ? this._at >= high + 1 : this._at < low) {
      if (loop.on) {
        this._at = speed > 0 ? low : high;
        turned = true;
      } else {
        this._at = speed > 0 ? high : low;
        this.playing = false;
        this._dirty = true;
        this._tell();
      }
    }
    const frame = Math.max(this.first, Math.min(this.last, Math.floor(this._at)));
    if (frame !== this.frame || turned) {
      this.from =
        Math.abs(speed) < 1 || turned
          ? frame
          : speed > 0
            ? Math.min(this.frame + 1, frame)
            : Math.min(frame, this.frame - 1);
      this.frame = frame;
      if (speed < 0) this.from = frame;
      this._dirty = true;
    }
    return this._take();
  }
  run(draw, { view = globalThis } = {}) {
    const tick = now => {
      if (this._stopped) return;
      if (this.advance(now)) {
        draw(this.state);
        this.drawn++;
        this._tell();
      }
      view.requestAnimationFrame(tick);
    };
    view.requestAnimationFrame(tick);
    return this;
  }
  stop() {
    this._stopped = true;
  }
  /** Handle a key that was pressed outside text fields. */
  press({ key, shiftKey = false, ctrlKey = false, altKey = false, metaKey = false }) {
    if (ctrlKey || altKey || metaKey) return false;
    const far = shiftKey ? 10 : 1;
    const act = {
      " ": () => this.toggle(),
      k: () => this.pause(),
      j: () => this.rung(-1),
      l: () => this.rung(1),
      ",": () => this.step(-far),
      ".": () => this.step(far),
      "<": () => this.step(-10),
      ">": () => this.step(10),
      ";": () => this.step(-far),
      ":": () => this.step(far),
      Home: () => this.seek(this.first),
      End: () => this.seek(this.last),
      1: () => this.setSpeed(1),
      2: () => this.setSpeed(0.1),
      3: () => this.setSpeed(0.01),
      i: () => this.setLoop({ from: this.frame, on: true }),
      o: () => this.setLoop({ to: this.frame, on: true }),
      "\\": () => this.setLoop({ on: !this.loop.on }),
      m: () => (shiftKey ? this.nextMark() : this.mark()),
      f: () => this.set({ phase: false }),
      p: () => this.set({ phase: true }),
      ArrowUp: () => this._choose(-1),
      ArrowDown: () => this._choose(1),
      ArrowLeft: () => this.step(-1),
      ArrowRight: () => this.step(1),
      "+": () => this.zoom(0.5),
      "=": () => this.zoom(0.5),
      "-": () => this.zoom(2),
      0: () => this.set({ span: this.whole }),
    }[key.length === 1 ? key.toLowerCase() : key];
    if (!act) return false;
    act();
    return true;
  }
  _choose(by) {
    this.set({ channel: Math.max(0, Math.min(this.channels - 1, this.channel + by)) });
  }
  _take() {
    const dirty = this._dirty;
    this._dirty = false;
    return dirty;
  }
  _changed() {
    this._dirty = true;
    this._tell();
  }
  _tell() {
    this.dispatchEvent(new Event("change"));
  }
}

const ICONS = {
  start: "M3 2h2v12H3zM14 2v12L6 8z",
  play: "M3 2l11 6-11 6z",
  pause: "M3 2h4v12H3zM9 2h4v12H9z",
};

/** Add buttons, time, frame number and a description of the picture to `root`. */
export function controls(transport, root) {
  const page = root.ownerDocument,
    bar = page.createElement("div");
  bar.className = "view-controls";
  bar.setAttribute("role", "toolbar");
  bar.setAttribute("aria-label", "Transport");
  const button = (label, act, help, icon) => {
    const made = page.createElement("button");
    made.type = "button";
    made.title = help;
    if (icon) {
      made.setAttribute("aria-label", label);
      made.append(drawing(page, icon));
    } else made.textContent = label;
    made.addEventListener("click", act);
    bar.append(made);
    return made;
  };
  button(
    "to the start (Home)",
    () => transport.seek(transport.first),
    "to the start (Home)",
    ICONS.start,
  );
  const play = button("play (Space)", () => transport.toggle(), "play (Space)", ICONS.play);
  const loop = button(
    "Loop",
    () => transport.setLoop({ on: !transport.loop.on }),
    "repeats the part from I to O (L)",
  );
  const speeds = Object.entries(SPEEDS).map(([label, speed]) => [
    button(label, () => transport.setSpeed(speed), `moves at ${label} of the speed`),
    speed,
  ]);
  const where = page.createElement("output"),
    shows = page.createElement("span");
  where.className = "view-where";
  shows.className = "view-shows";
  bar.append(where, shows);
  root.append(bar);
  let playing = null;
  const show = () => {
    if (playing !== transport.playing) {
      playing = transport.playing;
      const label = playing ? "pause (Space)" : "play (Space)";
      play.setAttribute("aria-label", label);
      play.title = label;
      play.replaceChildren(drawing(page, playing ? ICONS.pause : ICONS.play));
    }
    loop.setAttribute("aria-pressed", transport.loop.on);
    for (const [made, speed] of speeds)
      made.setAttribute("aria-pressed", Math.abs(transport.speed) === speed);
    where.textContent = `${transport.time.toFixed(4)} s, frame ${transport.frame}`;
    shows.textContent = `${transport.shows}${transport.speed < 0 ? ", backwards" : ""}`;
  };
  // Screen readers read an output at every change, so it is updated only while paused.
  transport.addEventListener("change", () => {
    where.setAttribute("aria-live", transport.playing ? "off" : "polite");
    show();
  });
  show();
  return bar;
}

function drawing(page, path) {
  // fixed text; the template parser creates the svg element
  const made = page.createElement("template");
  made.innerHTML = `<svg viewBox="0 0 16 16" width="14" height="14" aria-hidden="true"><path d="${path}" fill="currentColor"/></svg>`;
  return made.content.firstChild;
}
