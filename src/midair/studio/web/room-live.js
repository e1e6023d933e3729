/* Panel Live: sensor signal and sound field side by side, the delay between them, and the last
   minute in slow motion.

   The page keeps all frames of the last 60 s. When frozen, it shows a copy of them with the
   transport of takes, while live touch goes on and new frames are kept in the background. */

import {
  Track,
  SparseTrack,
  FieldPicture,
  CellsPicture,
  TracesPicture,
  PhasesPicture,
  SpectrogramPicture,
  OverviewPicture,
  BarPicture,
  decode,
  KINDS,
} from "/web/view.js";
import { Transport, controls } from "/web/transport.js";
import {
  buttonOf,
  choice,
  field,
  make,
  panel,
  playable,
  rows,
  toast,
  tried,
  whenHeld,
} from "/web/dom.js";
import { colours } from "/web/take.js";

const KEPT = 60; // s
const MAPPINGS = [
  ["half-wave", "half-wave"],
  ["slow-bias", "slow bias, 90 ms more"],
];
const ms = list => list.map(value => [String(value), `${value} ms`]);
const PARTS = {
  filter: "filter",
  "work and sending": "work",
  "waits its turn": "waiting",
  "rise and air": "rise, air",
  "jitter buffer": "jitter buffer",
};

/** The same frames, counted from 0. */
function copied(track, frames) {
  const made = new Track({
    rate: track.rate,
    capacity: frames,
    unit: track.unit,
    name: track.name,
  });
  const { width } = track,
    first = track.last - frames;
  Object.assign(made, {
    width,
    first: 0,
    last: frames,
    version: 1,
    values: new track.values.constructor(frames * width),
    units: new Float32Array(frames),
  });
  for (let f = 0; f < frames; f++) {
    const slot = (first + f) % track.capacity;
    made.values.set(track.values.subarray(slot * width, (slot + 1) * width), f * width);
    made.units[f] = track.units[slot];
  }
  return made;
}

/** A track whose maximum decays slowly: searching 60 s of frames for every picture would take
    too long. */
class Lately extends Track {
  add(section) {
    let most = 0;
    for (const value of section.values) most = Math.max(most, Math.abs(value));
    this._most = Math.max((this._most ?? 0) * 0.9998 ** section.frames, most * section.unit, 1e-9);
    return super.add(section);
  }
  get top() {
    return this._most ?? 1;
  }
}

/** The verdict as text; an exceeded limit may be played only on a simulated array. */
const spoken = verdict =>
  verdict.startsWith("exceeded: ")
    ? `On a real array: ${verdict.slice(10)}. The simulated array emits no sound.`
    : verdict;

export default class Live {
  constructor(studio) {
    this.studio = studio;
    this.link = studio.link;
    this.pictures = [];
    this.state = { frame: 0, from: 0, channel: 10, span: 1 };
    this.drawn = this.undrawn = this.ticks = 0;
    this.given = {
      sensor: "",
      mapping: "half-wave",
      delay_ms: 6,
      hold_ms: 6,
      gain: 1,
      height_mm: 200,
      level: 1,
      follow: "",
      attenuate: false,
      override: "",
    };
    for (const name of ["inferno", "twilight"]) colours(name); // loaded before anything is armed
    this._build();
    this._offs = [
      this.link.on("live", live => this._live(live)),
      this.link.on("live_goes", goes => this._goes(goes)),
      this.link.on("live_about", about => this._about(about)),
      this.link.on("player", () => this.control()),
      this.link.on("air", air => this._air(air)),
    ];
    this.link.frames = bytes => this._frames(bytes);
    this.reopened();
    const tick = () => {
      if (this.left) return;
      this.ticks++;
      if (this.fresh && !this.frozen) this._draw();
      requestAnimationFrame(tick);
    };
    requestAnimationFrame(tick);
  }
  reopened() {
    this.link.order("live", "sight", { shown: true }).catch(() => {});
  }
  leave() {
    this.left = true;
    this.link.frames = () => {};
    for (const off of this._offs) off();
    this.frozen?.transport.stop();
    for (const picture of this.pictures) picture.remove();
    // A hidden panel must not play.
    if (this.link.controls && this.link.state.live?.state !== "idle")
      this.link.order("live", "end").catch(() => {});
    this.link.order("live", "sight", { shown: false }).catch(() => {});
  }
  get transport() {
    return this.frozen?.transport ?? { press: event => this._press(event), pause() {} };
  }
  _press({ key }) {
    if (key === " ") {
      this.freeze();
      return true;
    }
    const by = { ArrowUp: -1, ArrowDown: 1 }[key];
    if (by && this.track) {
      this._choose(Math.max(0, Math.min(this.track.width - 1, this.state.channel + by)));
      return true;
    }
    return false;
  }
  _build() {
    const given = this.given,
      sensor = this.link.state.record?.sensor ?? "virtual:towel";
    given.sensor = sensor;
    const set =
      (name, number = true) =>
      ({ target }) => {
        given[name] = number ? Number(target.value) : target.value;
        this._unchecked();
      };
    const known = [
      ["virtual:towel", "virtual: towel"],
      ["virtual:brush", "virtual: brush"],
      ["virtual:sponge", "virtual: sponge"],
    ];
    this.named = make("input", {
      type: "text",
      value: sensor,
      "aria-label": "Name of the sensor",
      placeholder: "lsl:Skin?unit=V",
      hidden: known.some(([value]) => value === sensor),
      onchange: set("sensor", false),
      title: "lsl:NAME, serial:PORT, audio:NAME, ni:CHANNELS or replay:FILE",
    });
    this.source = choice(
      [...known, ["", "other (enter its name)"]],
      known.some(([value]) => value === sensor) ? sensor : "",
      () => {
        this.named.hidden = this.source.value !== "";
        given.sensor = this.source.value || this.named.value;
        this._unchecked();
      },
    );
    this.calibration = choice([["", "of the sensor"]], "", set("calibration", false));
    this.form = make(
      "div.column",
      {},
      field("Sensor", this.source, "A model that repeats a stroke, or a real sensor by its name"),
      this.named,
      field(
        "Calibration",
        this.calibration,
        "Volts to pascals: that of the sensor, or a file of this folder",
      ),
      field(
        "Mapping",
        choice(MAPPINGS, "half-wave", set("mapping", false)),
        "How signed pressure is made positive: sound can only push",
      ),
      field(
        "Latency",
        choice(
          [
            ["", "13 ms"],
            ["150", "150 ms, better quality"],
            ["200", "200 ms, better quality"],
          ],
          "",
          ({ target }) => {
            if (target.value === "") delete given.total_ms;
            else given.total_ms = Number(target.value);
            this._unchecked();
          },
        ),
        "From touch to sound; longer is more accurate and replaces filter delay, hold and mapping",
      ),
      field(
        "Filter delay",
        choice(ms([2, 4, 6, 8, 10]), "6", set("delay_ms")),
        "Delay of the inverse sensor filter; shorter is less accurate",
      ),
      field(
        "Hold",
        choice(ms([4, 6, 8, 10, 15]), "6", set("hold_ms")),
        "Time for computing and sending a frame; a frame that takes longer is late",
      ),
      field(
        "Gain",
        make("input", {
          type: "number",
          min: 0.05,
          max: 100,
          step: 0.05,
          value: "1",
          onchange: set("gain"),
        }),
        "Factor on the pressure",
      ),
      field(
        "Height, mm",
        make("input", {
          type: "number",
          min: 20,
          max: 1000,
          step: 10,
          value: "200",
          onchange: set("height_mm"),
        }),
        "Height of the palm above the array",
      ),
      field(
        "Level",
        choice(
          [
            ["0.1", "0.1 of full"],
            ["0.3", "0.3 of full"],
            ["0.6", "0.6 of full"],
            ["1", "full"],
          ],
          "1",
          set("level"),
        ),
        "Highest drive level of any transducer; the exposure check assumes it",
      ),
    );
    this.form.append(
      field(
        "Follow the palm of a tracker",
        make("input", {
          type: "text",
          id: "live-follow",
          autocomplete: "off",
          placeholder: "leap:, lsl:NAME, osc:PORT, replay:FILE.csv",
          onchange: set("follow", false),
        }),
        "Steers each frame to the palm; the sound fades when the palm is lost",
      ),
      field(
        "Its latency, ms",
        make("input", {
          type: "number",
          id: "live-latency",
          min: 0,
          max: 1000,
          placeholder: "measured",
          onchange: ({ target }) => {
            if (target.value === "") delete given.latency_ms;
            else given.latency_ms = Number(target.value);
            this._unchecked();
          },
        }),
        "Time from a pose of the palm to its arrival; empty: as measured",
      ),
    );
    this.check = buttonOf(
      "Check exposure",
      "Computes the worst case of these settings at ears, bystander and palm",
      () => this._check(),
      { id: "live-check" },
    );
    this.hold = make(
      "button.main.hold",
      {
        id: "hold",
        disabled: true,
        title: "Hold for 0.6 s, after the check of the exposure",
      },
      "Hold to begin",
    );
    this.verdict = make(
      "p.quiet",
      { role: "status" },
      "Check the exposure first. The check assumes the worst case of the level.",
    );
    this.refused = make("div.column");
    this.heat = make("p.quiet");
    this.loud = make("output", { id: "loud" }, "100 %");
    this.share = make("input", {
      type: "range",
      min: 5,
      max: 100,
      step: 5,
      value: "100",
      "aria-label": "Loudness, per cent of the level",
      oninput: () => {
        this.loud.value = `${this.share.value} %`;
      },
      onchange: () => tried(this.link.order("live", "turn", { share: this.share.value / 100 })),
    });
    this.end = buttonOf(
      "End",
      "Ends live touch in silence",
      () => tried(this.link.order("live", "end")),
      { id: "live-end" },
    );
    const loudness = field("Loudness", this.share, "Share of the level, while it plays");
    loudness.append(this.loud);
    this.running = make(
      "div.column",
      { hidden: true },
      loudness,
      make("div.buttons", {}, this.end),
    );
    this.safety = make("div");
    const box = name => make("div.box", { id: `box-${name}` });
    this.boxes = Object.fromEntries(
      ["touch", "sound", "phase", "bar", "traces", "array", "spectrogram", "overview"].map(name => [
        name,
        box(name),
      ]),
    );
    const { boxes } = this;
    this.panels = {
      touch: panel("Sensor", "", boxes.touch),
      sound: panel("Sound field", "", boxes.sound),
      phase: panel("Phase", "where louder than 5 %", boxes.phase),
      traces: panel("Cells, Pa", "the last second", boxes.traces),
      array: panel("Array", "phases", boxes.array),
      spectrogram: panel("Spectrogram", "", boxes.spectrogram),
    };
    const { panels } = this;
    this.sum = make("strong.sum", {}, "– ms");
    this.parts = make("div.parts", {
      role: "img",
      "aria-label": "From touch to sound: nothing plays yet",
    });
    this.named = make("p.quiet.named");
    this.counted = make("p.quiet.counted", {}, "nothing plays yet");
    this.delay = panel(
      "From touch to sound",
      "constant delay",
      make("div.latency", {}, this.sum, this.parts),
      this.named,
      this.counted,
      make(
        "p.quiet",
        {},
        "Suitable for stroking, not for tapping: people notice a delay of 5.5 ms after a tap, and of 60 ms in a texture.",
      ),
    );
    this.studio.main.append(
      make(
        "div.live",
        {},
        make(
          "div.column.left",
          {},
          panel(
            "Settings",
            null,
            this.form,
            make("div.buttons", {}, this.check, this.hold),
            this.verdict,
            this.heat,
            this.refused,
            this.running,
          ),
          panel("Safety", null, this.safety),
        ),
        make(
          "div.middle",
          {},
          make(
            "div.trio",
            {},
            panels.touch,
            panels.sound,
            panels.phase,
            panel("Pa", null, boxes.bar),
          ),
          this.delay,
          panels.traces,
        ),
        make("div.side", {}, panels.array, panels.spectrogram),
      ),
    );
    whenHeld(this.hold, () => this._begin());
    this._footer();
    this._live(this.link.state.live);
  }
  _footer() {
    const { footer } = this.studio;
    this.freezes = make("button", {
      id: "live-freeze",
      title: "Looks at the last minute while live touch goes on: Space",
      onclick: () => this.freeze(),
    });
    this.keeps = buttonOf(
      ["Keep the last 60 s ", make("kbd", {}, "R")],
      "Stores the last minute as a take: R",
      () => this.record(),
      { id: "live-keep" },
    );
    this.kept = make("span.quiet", { role: "status" });
    this.bar = make("div.row");
    this.now = make("output.view-where");
    footer.replaceChildren(this.boxes.overview, this.bar);
    footer.hidden = false;
    this._bar();
  }
  _bar() {
    this.freezes.replaceChildren(
      this.frozen ? "Live again " : "Freeze ",
      make("kbd", {}, this.frozen ? "Enter" : "Space"),
    );
    this.freezes.setAttribute("aria-pressed", Boolean(this.frozen));
    this.bar.replaceChildren(this.freezes, this.keeps);
    if (this.frozen) controls(this.frozen.transport, this.bar);
    else this.bar.append(this.now);
    this.bar.append(
      this.kept,
      make(
        "span.keys",
        {},
        make("span", {}, make("kbd", {}, "?"), " keys"),
        buttonOf("Show the code", "Commands and Python that do the same", () => this._code()),
      ),
    );
    this.boxes.overview.hidden = !this.frozen;
  }
  control() {
    const { live, player } = this.link.state,
      idle = live?.state === "idle",
      plays = live?.state === "plays",
      controls = this.link.controls;
    this.check.disabled = !controls || !idle || !playable(player);
    this.hold.disabled = this.check.disabled || !this.clearance;
    this.running.hidden = idle;
    for (const part of [this.form, this.check, this.hold]) part.hidden = !idle;
    this.share.disabled = !controls || !plays;
    this.end.disabled = !controls || idle;
    this.keeps.disabled = !controls || !this.link.state.live_about;
    this.freezes.disabled = !this.track;
    this.safety.replaceChildren(
      rows([
        [
          "Array",
          plays
            ? player?.emitting
              ? `${player.simulated ? "simulates" : "emits"} sound`
              : "plays, silent now"
            : live?.state === "opens"
              ? "opening"
              : "silent",
        ],
        ["This page", controls ? "in control" : "may only watch"],
        ["Stops without this page after", "0.5 s"],
        ["Units go silent without data after", "0.05 s"],
      ]),
    );
  }
  _live(live) {
    if (!live || !this.keeps) return;
    const had = this.calibration.value;
    this.calibration.replaceChildren(
      make("option", { value: "" }, "of the sensor"),
      ...live.calibrations.map(name => make("option", { value: name }, name)),
    );
    this.calibration.value = had;
    this.share.value = String(Math.round(100 * live.share));
    if (live.state === "opens") this._say("opening sensor and array …");
    else if (live.state === "plays")
      this._say(live.said || spoken(this.link.state.live_about?.exposure ?? "playing"));
    else if (live.said) this._say(live.said, /ended normally/.test(live.said) ? "" : "bad");
    if (live.take)
      this.kept.replaceChildren(
        `${live.take.name}: ${live.take.duration_s.toFixed(1)} s `,
        make(
          "a",
          { href: `#reproduce/${encodeURI(live.take.name)}`, id: "to-reproduce" },
          "open in Reproduce",
        ),
      );
    this.control();
  }
  /** The checked level holds for the air that was stated. */
  _air({ temperature, humidity }) {
    const before = this.aired;
    this.aired = `${temperature} ${humidity}`;
    if (before !== undefined && before !== this.aired && this.clearance) this._unchecked();
    else if (this.keeps) this.control();
  }
  _say(words, className = "quiet") {
    this.verdict.textContent = words;
    this.verdict.className = className;
  }
  _unchecked() {
    this.clearance = 0;
    this.refused.replaceChildren();
    this._say("settings changed: check the exposure again");
    this.control();
  }
  async _check() {
    this.clearance = 0;
    this._say("checking …");
    const asked = JSON.stringify([this.given, this.aired]);
    const found = await tried(this.link.order("live", "check", this.given));
    if (JSON.stringify([this.given, this.aired]) !== asked) {
      this._unchecked();
      return;
    }
    if (!found) {
      this._say("the exposure could not be checked", "bad");
      return;
    }
    this.clearance = found.number;
    this._say(
      found.refused || spoken(found.verdict),
      found.refused ? "bad" : found.outcome === "exceeded" ? "" : "good",
    );
    this.heat.textContent = `Heat: ${found.heat}. Computed for ${found.measured_in}.`;
    this.refused.replaceChildren();
    if (found.refused) {
      const name = make("input", { type: "text", autocomplete: "off", placeholder: "your name" });
      const again = changes => {
        Object.assign(this.given, changes);
        this._check();
      };
      this.refused.append(
        make(
          "button",
          { onclick: () => again({ attenuate: true, override: "" }) },
          "Attenuate to meet the profile",
        ),
        field("Or play it on your own responsibility", name),
        make(
          "button",
          {
            onclick: () => {
              if (name.value.trim()) again({ attenuate: false, override: name.value });
              else name.focus();
            },
          },
          "Play above the profile on my responsibility",
        ),
      );
    }
    this.control();
  }
  async _begin() {
    const clearance = this.clearance;
    this.clearance = 0;
    this.given.override = "";
    if (this.frozen) this.freeze();
    this.track = null;
    this.hold.blur();
    await tried(this.link.order("live", "begin", { clearance }));
  }
  async _about(about) {
    if (!about || !this.keeps) return;
    const [inferno, twilight] = await Promise.all([colours("inferno"), colours("twilight")]);
    if (this.left) return;
    if (this.frozen) this.freeze();
    for (const picture of this.pictures) picture.remove();
    const { rate_hz: rate } = about,
      capacity = Math.round(KEPT * rate),
      { boxes, panels } = this;
    this.track = new Lately({ rate, capacity, unit: "Pa", name: "felt" });
    this.sound = new Lately({ rate, capacity, unit: "Pa", name: "sound" });
    this.phases = new SparseTrack({ capacity: 15 * KEPT });
    const place = { pitch: about.grid_pitch_mm, x: about.x_mm, y: about.y_mm },
      cells = { rows: about.rows, columns: about.columns, pitch: about.pitch_mm };
    const map = {
      rows: about.grid_rows,
      columns: about.grid_columns,
      place,
      unit: "Pa",
      colours: inferno,
      phaseColours: twilight,
      down: Float32Array.from(about.down),
      across: Float32Array.from(about.across),
      most: 4,
    };
    const choose = channel => this._choose(channel),
      seek = frame => this.frozen?.transport.seek(frame);
    this.touchPicture = new CellsPicture(boxes.touch, {
      rows: about.rows,
      columns: about.columns,
      place: { pitch: about.pitch_mm, x: 0, y: 0 },
      unit: "Pa",
      colours: inferno,
      label: "Touch",
      track: this.track,
    });
    this.soundPicture = new FieldPicture(boxes.sound, {
      ...map,
      label: "Sound, simulated",
      track: this.sound,
      cells,
    });
    this.phasePicture = new FieldPicture(boxes.phase, {
      ...map,
      label: "Phase of the sound",
      track: this.sound,
    });
    this.scale = new BarPicture(boxes.bar, {
      label: "Scale of the sound",
      colours: inferno,
      unit: "Pa",
    });
    this.traces = new TracesPicture(boxes.traces, {
      label: "Cells",
      track: this.track,
      head: false,
      choose,
      seek,
    });
    this.spectrum = new SpectrogramPicture(boxes.spectrogram, {
      label: "Spectrogram",
      track: this.track,
      colours: inferno,
      head: false,
    });
    this.arrayPicture = new PhasesPicture(boxes.array, {
      label: "Phases of the array",
      track: this.phases,
      colours: twilight,
      positions: about.positions_mm,
    });
    this.pictures = [
      this.touchPicture,
      this.soundPicture,
      this.phasePicture,
      this.scale,
      this.traces,
      this.spectrum,
      this.arrayPicture,
    ];
    const side = this.soundPicture.down.length / about.grid_rows;
    panels.touch.aside.textContent = `${about.rows} × ${about.columns} cells, Pa`;
    panels.sound.aside.textContent = `${about.simulated ? "simulated" : "computed"}, ${side} × ${side}`;
    panels.array.aside.textContent =
      "phases of " +
      `${about.transducers}${about.array_calibration ? `, array calibration ${about.array_calibration}` : ""}`;
    panels.traces.querySelector("h2").textContent = `${about.rows * about.columns} cells, Pa`;
    this.studio.shownLive = about.sensor;
    this._choose(Math.min(this.state.channel, about.rows * about.columns - 1));
    this.control();
  }
  _choose(channel) {
    this._chosen(channel);
    this.frozen?.transport.set({ channel });
  }
  _chosen(channel) {
    this.state.channel = channel;
    this.panels.spectrogram.aside.textContent = `channel ${channel}`;
    this.fresh = true;
  }
  _frames(bytes) {
    this.undrawn++;
    if (!this.track) {
      this._credit();
      return;
    }
    for (const section of decode(bytes)) {
      if (section.kind === KINDS.samples) {
        if (section.first < this.track.last) continue;
        this.track.add(section);
      } else if (section.kind === KINDS.field) {
        if (section.first >= this.sound.last) this.sound.add(section);
      } else this.phases.add(section);
    }
    this.arrived ??= performance.now();
    this.fresh = true;
    if (this.frozen) this._credit(); // frames that arrive while frozen are not drawn
  }
  _credit() {
    this.link.drew(this.undrawn);
    this.undrawn = 0;
  }
  _draw() {
    this.fresh = false;
    if (!this.track?.last || !this.sound?.last) {
      this._credit();
      return;
    }
    const { state, track } = this,
      newest = Math.min(track.last, this.sound.last) - 1,
      middle = Math.round(track.last - (state.span * track.rate) / 2);
    state.from = Math.max(Math.min((this.newest ?? newest) + 1, newest), newest - 200);
    state.frame = newest;
    for (const picture of [this.soundPicture, this.phasePicture, this.scale])
      picture.top = this.sound.top;
    this.touchPicture.top = track.top;
    this.touchPicture.draw({ ...state });
    this.soundPicture.draw({ ...state });
    this.phasePicture.draw({ ...state, phase: true });
    const moving = { ...state, from: middle, frame: middle };
    // Pictures that change slowly are drawn less often: phases arrive 15 times per second.
    if (this.drawn % 2 === 0) this.traces.draw(moving);
    if (this.drawn % 4 === 1) this.arrayPicture.draw({ ...state });
    if (this.drawn % 6 === 0) {
      this.spectrum.draw(moving);
      this.scale.draw({ ...state });
    }
    if (this.drawn % 6 === 3)
      this.now.textContent = `${(newest / track.rate).toFixed(2)} s, frame ${newest}`;
    this.drawn++;
    this.studio.drawn = this.drawn;
    this.newest = newest;
    if (this.arrived) {
      this.delays = [...(this.delays ?? []).slice(-499), performance.now() - this.arrived];
      this.arrived = undefined;
    }
    this._credit();
  }
  /** Freeze the last minute and show it like a take, or go back to live. */
  freeze() {
    if (this.frozen) {
      this.frozen.transport.stop();
      this.frozen.overview.remove();
      this.frozen = null;
      this._tracks(this.track, this.sound, this.phases, false);
      this.newest = undefined;
      this._bar();
      this.fresh = true;
      return;
    }
    if (!this.track?.last || !this.sound?.last) return;
    const end = Math.min(this.track.last, this.sound.last),
      first = Math.max(this.track.first, this.sound.first),
      frames = end - first;
    if (frames < 2) return;
    const track = copied(this.track, frames),
      sound = copied(this.sound, frames),
      began = first,
      rows = this.phases.rows.slice();
    const phases = Object.assign(new SparseTrack(), {
      rows: rows.map(row => ({ ...row, frame: row.frame - began })),
    });
    const transport = new Transport({ frames, rate: track.rate, still: true });
    Object.assign(transport, {
      channel: this.state.channel,
      channels: track.width,
      span: Math.min(this.state.span, frames / track.rate),
      speed: 0.1,
    });
    transport.whole = transport.span;
    const enter = transport.press.bind(transport);
    transport.press = event => (event.key === "Enter" ? (this.freeze(), true) : enter(event));
    this.frozen = {
      transport,
      overview: new OverviewPicture(this.boxes.overview, {
        label: "The last minute",
        track,
        seek: frame => transport.seek(frame),
        frames,
      }),
    };
    transport.addEventListener("change", () => {
      if (transport.channel !== this.state.channel) this._chosen(transport.channel);
    });
    this._tracks(track, sound, phases, true);
    this._bar();
    transport.seek(frames - 1);
    transport.run(state => {
      for (const picture of [
        this.touchPicture,
        this.soundPicture,
        this.scale,
        this.traces,
        this.spectrum,
        this.arrayPicture,
        this.frozen?.overview,
      ])
        picture?.draw(state);
      this.phasePicture.draw({ ...state, phase: true });
    });
  }
  _tracks(track, sound, phases, head) {
    for (const picture of [this.touchPicture, this.traces, this.spectrum]) picture.track = track;
    for (const picture of [this.soundPicture, this.phasePicture]) picture.track = sound;
    this.arrayPicture.track = phases;
    this.traces.head = this.spectrum.head = head;
    this.spectrum.columns.clear();
    const top = sound.top;
    for (const picture of [this.soundPicture, this.phasePicture, this.scale]) picture.top = top;
    this.touchPicture.top = track.top;
    this.panels.traces.aside.textContent = head ? "around the playhead" : "the last second";
  }
  /** Key R: save the last minute as a take. */
  async record() {
    if (this.keeps.disabled) return;
    this.keeps.disabled = true;
    const found = await tried(this.link.order("live", "keep"));
    this.keeps.disabled = false;
    if (found)
      toast(`${found.name}: saved ${found.duration_s.toFixed(1)} s of sensor signal and drive`);
  }
  _goes(goes) {
    if (!goes?.parts || !this.parts) return;
    this.sum.textContent = `${goes.latency.toFixed(1)} ms`;
    this.parts.replaceChildren(
      ...goes.parts.map(([name, value], i) =>
        Object.assign(make("span", { title: `${name} ${value} ms` }, value.toFixed(1)), {
          className: `part-${i}`,
        }),
      ),
    );
    this.parts.style.gridTemplateColumns = goes.parts
      .map(([, value]) => `minmax(1.9em, ${Math.max(value, 0.01)}fr)`)
      .join(" ");
    this.parts.setAttribute(
      "aria-label",
      `From touch to sound ${goes.latency.toFixed(1)} ms: ${goes.parts.map(([name, value]) => `${name} ${value.toFixed(1)}`).join(", ")} ms`,
    );
    this.named.textContent =
      goes.parts.map(([name, value]) => `${PARTS[name] ?? name} ${value.toFixed(1)}`).join(" + ") +
      " ms";
    const work = goes.work_ms,
      left = goes.left_ms,
      of = value => (value === null ? "–" : value.toFixed(2));
    this.counted.textContent =
      `${goes.frames} frames, ${goes.played} played; ${goes.late} late (previous frame held); ` +
      `${goes.lost} lost (last good frame repeated); ${goes.hurried} hurried; ${goes.gaps} gaps`;
    this.counted.title =
      "late: ready after its deadline; lost: missing from the sensor; hurried: solved in " +
      "half the time; gap: 20 ms without a frame, followed by a fade-out";
    this.delay.aside.textContent =
      `computation ${of(work.half)} ms per frame, 99.9 % below ${of(work["99.9%"])} ms; 99.9 % ` +
      `sent within ${of(left["99.9%"])} ms`;
    this.counted.className = `counted ${goes.late + goes.lost + goes.gaps ? "" : "quiet"}`;
  }
  _code() {
    const g = this.given,
      device = this.link.state.player?.device ?? "virtual";
    const words = [
      `--sensor "${g.sensor}"`,
      `--device ${device}`,
      `--height ${g.height_mm}mm`,
      `--gain ${g.gain}`,
      `--level ${g.level}`,
      `--hold ${g.hold_ms}ms`,
      `--delay ${g.delay_ms}ms`,
      `--mapping ${g.mapping}`,
      ...(g.total_ms ? [`--latency ${g.total_ms}ms`] : []),
      ...(g.follow
        ? [
            `--follow "${g.follow}"`,
            ...(g.latency_ms === undefined ? [] : [`--tracker-latency ${g.latency_ms}ms`]),
          ]
        : []),
      "--duration 2s",
      "--keep felt.h5",
    ];
    const named = [
      `height=${g.height_mm / 1000}`,
      `gain=${g.gain}`,
      `level=${g.level}`,
      `hold=${g.hold_ms / 1000}`,
      `delay=${g.delay_ms / 1000}`,
      `mapping="${g.mapping}"`,
      ...(g.total_ms ? [`latency=${g.total_ms / 1000}`] : []),
      ...(g.follow
        ? [
            `follow="${g.follow}"`,
            ...(g.latency_ms === undefined ? [] : [`tracker_latency=${g.latency_ms / 1000}`]),
          ]
        : []),
    ];
    this.studio.code(
      "Live touch",
      `midair live ${words.join(" ")}`,
      `import midair\n\nif __name__ == "__main__":\n    how = dict(${named.join(", ")})\n    with midair.live("${g.sensor}", "${device}", duration=2.0, **how) as session:\n        session.wait()\n    print(session.statistics.plain())\n`,
    );
  }
}
