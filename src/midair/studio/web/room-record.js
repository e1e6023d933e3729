/* Panel Record: current signal of the sensor, a record button, and the problems of the last
    take. */

import { Track, TracesPicture, SpectrogramPicture, decode } from "/web/view.js";
import { buttonOf, choice, field, make, panel, rows, tried } from "/web/dom.js";
import { colours } from "/web/take.js";

const SOURCES = [
  ["virtual:towel", "virtual: towel"],
  ["virtual:brush", "virtual: brush"],
  ["virtual:sponge", "virtual: sponge"],
  ["virtual:towel+groove", "virtual: towel, grooved"],
  ["virtual:am-i", "virtual: modulated focus"],
  ["", "other (enter its name)"],
];
const NOTES = {
  object: "Names the file and is stored with the take",
  surface: "Names the file and is stored with the take",
  speed: "Speed of the stroke, such as 50mm/s",
  operator: "Who moved the object",
};
const KEPT = 60; // seconds

export default class Record {
  constructor(studio) {
    this.studio = studio;
    this.link = studio.link;
    this.state = { frame: 0, from: 0, channel: 10, span: 2 };
    this.pictures = [];
    this.drawn = 0;
    this._build();
    this._offs = [
      this.link.on("record", record => this._record(record)),
      this.link.on("levels", levels => levels && this._levels(levels)),
    ];
    this.link.frames = bytes => this._frames(bytes);
    this.reopened();
    const tick = () => {
      if (this.left) return;
      if (this.fresh) this._draw();
      requestAnimationFrame(tick);
    };
    requestAnimationFrame(tick);
  }
  reopened() {
    this.link.order("record", "sight", { shown: true }).catch(() => {});
  }
  leave() {
    this.left = true;
    this.link.frames = () => {};
    for (const off of this._offs) off();
    for (const picture of this.pictures) picture.remove();
    this.link.order("record", "sight", { shown: false }).catch(() => {});
  }
  _build() {
    const sensor = this.link.state.record?.sensor ?? "virtual:towel",
      known = SOURCES.some(([value]) => value === sensor);
    this.named = make("input", {
      type: "text",
      value: known ? "" : sensor,
      "aria-label": "Name of the sensor",
      title: "lsl:NAME, serial:PORT, audio:NAME, ni:CHANNELS or replay:FILE",
      placeholder: "lsl:Skin, serial:COM3 …",
      hidden: known,
      onchange: () => this._listen(this.named.value),
    });
    this.source = choice(SOURCES, known ? sensor : "", () => {
      this.named.hidden = this.source.value !== "";
      if (this.source.value) this._listen(this.source.value);
      else this.named.focus();
    });
    const subject = this.link.state.record?.subject ?? {};
    this.notes = Object.fromEntries(
      Object.keys(NOTES).map(name => [
        name,
        make("input", {
          type: "text",
          value: subject[name] ?? "",
          maxLength: 100,
          autocomplete: "off",
        }),
      ]),
    );
    this.duration = make("input", { type: "number", min: 0.1, max: 3600, step: 0.1, value: "1.6" });
    this.begins = choice(
      [
        ["at once", "at once"],
        ["touch", "on touch"],
      ],
      "at once",
      () => this._fields(),
    );
    this.level = make("input", { type: "number", min: 0, step: "any", value: "0.02" });
    this.pre = make("input", { type: "number", min: 0, max: 60, step: 0.1, value: "0.2" });
    this.repeats = make("input", { type: "number", min: 1, max: 100, value: "1" });
    this.big = buttonOf(
      ["Record ", make("kbd", {}, "R")],
      "Starts a recording, or ends it and keeps the take: R",
      () => this.record(),
      { class: "main big", id: "record" },
    );
    this.touched = make(
      "div.column",
      {},
      field(
        "Level",
        this.level,
        "A recording starts when a channel differs from rest by this much, in the unit of the sensor",
      ),
      field("Pre-roll, s", this.pre, "Time that is kept before the touch, 0 to 60 s"),
    );
    this.done = make("div", { role: "status", id: "kept" });
    this.lost = make("div.column", { role: "alert", id: "sensor-lost", hidden: true });
    this.again = buttonOf("Open the sensor again", "After the cable or the stream is back", () =>
      this._listen(this.link.state.record.sensor),
    );
    this.events = make("ol.events", { "aria-live": "polite" });
    this.about = make("div");
    this.meters = make("div.meters", { role: "img", "aria-label": "Meters" });
    this.traces = make("div.box");
    this.spectrum = make("div.box");
    this.tracesPanel = panel("Cells", "the last 2 s", this.traces);
    this.studio.main.append(
      make(
        "div.record",
        {},
        make(
          "div.column.left",
          {},
          panel(
            "Sensor",
            null,
            field("Source", this.source, "A model of the sensor, or a real one by its name"),
            this.named,
            this.lost,
            this.about,
          ),
          panel(
            "Notes",
            null,
            ...Object.entries(this.notes).map(([name, input]) =>
              field(name[0].toUpperCase() + name.slice(1), input, NOTES[name]),
            ),
          ),
          panel(
            "Recording",
            null,
            field("Start", this.begins, "At once, or when something touches the sensor"),
            this.touched,
            field("Duration, s", this.duration, "Length of a take; empty: until you stop it"),
            field("Takes", this.repeats, "Number of takes, one after the other"),
            this.big,
            this.done,
          ),
        ),
        make(
          "div.middle",
          {},
          this.tracesPanel,
          panel("Spectrogram", "selected channel", this.spectrum),
        ),
        make(
          "div.column",
          {},
          (this.metersPanel = panel("Level of each cell", "rms, and clipping", this.meters)),
          panel("Events", "lost frames, clipping, dead channels", this.events),
        ),
      ),
    );
    this._fields();
  }
  control() {
    this._record(this.link.state.record);
  }
  _fields() {
    this.touched.hidden = this.begins.value !== "touch";
  }
  _listen(sensor) {
    return tried(this.link.order("record", "listen", { sensor }));
  }
  record() {
    const { state } = this.link.state.record ?? {};
    if (!this.link.controls) return null;
    if (state === "recording" || state === "waiting")
      return tried(this.link.order("record", "toggle"));
    const notes = Object.fromEntries(
      Object.entries(this.notes).map(([name, input]) => [name, input.value.trim()]),
    );
    const touch =
      this.begins.value === "touch"
        ? { start: "touch", level: Number(this.level.value), pre_roll_s: Number(this.pre.value) }
        : {};
    return tried(
      this.link.order("record", "take", {
        ...notes,
        duration_s: Number(this.duration.value) || null,
        repeats: Number(this.repeats.value) || 1,
        ...touch,
      }),
    );
  }
  async _record(record) {
    if (!record || !this.big) return;
    const { state, about, take } = record,
      runs = state === "recording" || state === "waiting";
    this.big.disabled = !this.link.controls || !(runs || state === "listening");
    this.big.classList.toggle("on", runs);
    this.big.replaceChildren(
      state === "recording"
        ? `Stop: ${record.name} `
        : state === "waiting"
          ? "Waiting for a touch; start now "
          : state === "opens"
            ? "Opening the sensor … "
            : "Record ",
      make("kbd", {}, "R"),
    );
    this.source.disabled = this.named.disabled = runs || !this.link.controls;
    this.events.replaceChildren(
      ...(record.events ?? []).map(event =>
        make("li", { className: event.event === "trigger" ? "" : "bad" }, event.said),
      ),
    );
    if (!record.events?.length) this.events.replaceChildren(make("li.quiet", {}, "no events"));
    this.lost.hidden = state !== "lost";
    this.again.disabled = !this.link.controls;
    this.lost.replaceChildren(
      ...(state === "lost" ? [make("p.bad", {}, record.error), this.again] : []),
    );
    this.done.replaceChildren(
      ...(record.error && state !== "lost" ? [make("p.bad", {}, record.error)] : []),
      ...(take && !runs ? this._take(take) : []),
    );
    if (about && this._aboutOf !== about.sensor + about.rate_hz) {
      this._aboutOf = about.sensor + about.rate_hz;
      await this._pictures(about);
    }
  }
  _take(take) {
    const broken = take.end === "failure";
    return [
      make(
        `p${broken ? ".bad" : ""}`,
        {},
        `${broken ? "The take ended early; the frames recorded until then are kept. " : ""}${take.name}: ` +
          `${take.duration_s.toFixed(2)} s, ${take.frames} frames, ${take.lost} lost`,
      ),
      rows(take.problems),
      make(
        "a",
        { href: `#reproduce/${encodeURI(take.name)}`, id: "to-reproduce" },
        "Open in Reproduce",
      ),
    ];
  }
  async _pictures(about) {
    const inferno = await colours("inferno");
    if (this.left) return;
    for (const picture of this.pictures) picture.remove();
    this.about.replaceChildren(
      rows([
        ["Cells", `${about.rows} × ${about.columns}`],
        ["Rate", `${about.rate_hz} Hz`],
        ["Calibrated", about.calibrated ? "yes" : "no"],
        ["Clips at", about.full_scale ? `${about.full_scale} ${about.unit}` : "not known"],
      ]),
    );
    this._fresh(about);
    this.pictures = [
      new TracesPicture(this.traces, {
        label: "Cells",
        track: this.track,
        head: false,
        choose: channel => {
          this.state.channel = channel;
          this.fresh = true;
        },
      }),
      new SpectrogramPicture(this.spectrum, {
        label: "Spectrogram",
        track: this.track,
        colours: inferno,
        head: false,
      }),
    ];
    this.tracesPanel.querySelector("h2").textContent =
      `${about.rows * about.columns} cells, ${about.unit}`;
    this.metersPanel.aside.textContent = `rms in ${about.unit}, and clipping`;
    this.meters.style.gridTemplateColumns = `repeat(${about.columns}, minmax(0, 1fr))`;
    this.meters.replaceChildren(
      ...Array.from({ length: about.rows * about.columns }, (_, i) =>
        make("div.meter", {}, make("i"), make("span", {}, String(i))),
      ),
    );
    if (this.link.state.levels) this._levels(this.link.state.levels);
  }
  _fresh({ rate_hz: rate, unit }) {
    this.track = new Track({ rate, capacity: Math.round(KEPT * rate), unit, name: "samples" });
    // The scale decays slowly: searching 60 s of frames for every picture would take too long.
    Object.defineProperty(this.track, "top", { get: () => this.scale || 1 });
    for (const picture of this.pictures) picture.track = this.track;
    this.scale = 0;
    this.state.channel = Math.min(this.state.channel, 10);
  }
  _frames(bytes) {
    if (!this.track) {
      this.link.drew(1);
      return;
    }
    for (const section of decode(bytes)) {
      if (section.first < this.track.last)
        // the sensor was restarted
        this._fresh({ rate_hz: this.track.rate, unit: this.track.unit });
      this.track.add(section);
      let most = 0;
      for (const value of section.values) most = Math.max(most, Math.abs(value));
      this.scale = Math.max(this.scale * 0.9995 ** section.frames, most * section.unit, 1e-9);
    }
    this.arrived ??= performance.now();
    this.undrawn = (this.undrawn ?? 0) + 1;
    this.fresh = true;
  }
  _draw() {
    this.fresh = false;
    if (!this.track?.last) return;
    const { state, track } = this;
    // The newest frame is at the right edge.
    state.from = state.frame = Math.round(track.last - (state.span * track.rate) / 2);
    for (const picture of this.pictures) picture.draw(state);
    this.drawn++;
    this.newest = track.last - 1;
    if (this.arrived) {
      this.delays = [...(this.delays ?? []).slice(-999), performance.now() - this.arrived];
      this.arrived = undefined;
    }
    this.link.drew(this.undrawn);
    this.undrawn = 0;
  }
  _levels(levels) {
    const most = Math.max(...levels.highest, 1e-9),
      { unit = "" } = this.link.state.record?.about ?? {};
    [...this.meters.children].forEach((meter, i) => {
      if (i >= levels.rms.length) return;
      meter.firstChild.style.height = `${Math.min(100, (100 * levels.peak[i]) / most)}%`;
      const wrong = levels.dead[i]
        ? "dead"
        : levels.stuck[i]
          ? "stuck"
          : levels.clipped[i]
            ? "clipped"
            : "";
      meter.className = `meter ${wrong === "stuck" ? "dead" : wrong}`;
      meter.lastChild.textContent = wrong
        ? `${i}: ${wrong}`
        : `${i}: ${levels.rms[i].toPrecision(2)}`;
    });
    const wrong = levels.dead.filter(Boolean).length + levels.stuck.filter(Boolean).length,
      clipped = levels.clipped.filter(Boolean).length;
    this.meters.setAttribute(
      "aria-label",
      `Meters in ${unit}: ${wrong} cells dead or stuck, ${clipped} clipped, ${levels.lost} frames lost`,
    );
    this.tracesPanel.aside.textContent = `${levels.state}${levels.wanted ? `: ${levels.frames} of ${levels.wanted} frames` : levels.state === "recording" ? `: ${levels.frames} frames` : ""}; ${levels.lost} lost${levels.drift_ppm === null ? "" : `; drift ${levels.drift_ppm} ppm`}`;
  }
}
