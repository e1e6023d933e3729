/* Reproduce: wanted beside played, in Pa, frame by frame; how it is made; playing it. */

import { FieldPicture, TracesPicture, PhasesPicture, SpectrogramPicture, OverviewPicture, BarPicture } from "/web/view.js";
import { Transport, controls } from "/web/transport.js";
import { choice, field, make, panel, rows, tried } from "/web/dom.js";
import { TakeView, colours } from "/web/take.js";
import { askToPlay } from "/web/playing.js";

const MAPPINGS = [["", "of the mode"], ["half-wave", "half-wave"], ["constant-offset", "constant offset"], ["slow-bias", "slow bias"]];
const METHODS = [["live", "live, quick"], ["fast", "fast"], ["glide", "glide, best"], ["exact", "exact, slow"], ["lm", "lm, paper's"]];
const MODES = [["paper", "paper"], ["quick", "quick"], ["best", "best"], ["finest", "finest"]];
const HEIGHTS = [["", "of the mode"], ["150", "150 mm"], ["180", "180 mm"], ["200", "200 mm"], ["230", "230 mm"]];
const LEVELS = [["auto", "auto"], ["0.3", "0.3 of full"], ["0.6", "0.6 of full"], ["1", "full"]];

export class Reproduce {
  constructor(studio) {
    this.studio = studio;
    this.link = studio.link;
    this.take = null;
    this.made = { mode: "paper", method: "live", level: "auto" };
    this._build();
    this._offs = [this.link.on("takes", (takes) => this._takes(takes)), this.link.on("player", () => this.control()), this.link.on("jobs", () => this.control())];
    this._clock = setInterval(() => this._address(), 500);
  }
  leave() {
    for (const off of this._offs) off();
    clearInterval(this._clock);
    this._close();
    this.left = true;
  }
  get transport() { return this.take?.transport ?? null; }
  moved({ take, time }) {
    if (take && take !== this.take?.name) this._open(take, time);
    else if (Number.isFinite(time) && this.transport) this.transport.seek(time * this.transport.rate);
  }
  _build() {
    this.list = make("ul.takes");
    const file = make("input", { type: "file", accept: ".h5,.csv,.wav,.mat,.npz,.npy", hidden: true, "aria-label": "a recording from this computer", onchange: () => this._upload(file.files[0]) });
    this.add = make("button", { type: "button", onclick: () => file.click() }, "Add a file");
    this.solve = make("button.main", { type: "button", onclick: () => this._solve() }, "Solve");
    this.play = make("button", { type: "button", onclick: () => askToPlay(this.studio, this.take.name) }, "Play on array");
    this.form = make("div.column");
    this.frame = make("div");
    this.about = make("div.quiet");
    const set = (name, number = false) => ({ target }) => { this.made[name] = target.value === "" ? undefined : number && target.value !== "auto" ? Number(target.value) : target.value; this._again(); };
    this.form.append(
      field("Mode", choice(MODES, "paper", set("mode"))), field("Mapping", choice(MAPPINGS, "", set("mapping"))),
      field("Solver", choice(METHODS, "live", set("method"))), field("Level", choice(LEVELS, "auto", set("level", true))),
      field("Gain", make("input", { type: "number", min: 0.05, max: 100, step: 0.05, value: "1", onchange: set("gain", true) })),
      field("Height", choice(HEIGHTS, "", set("height_mm", true))));
    this.gain = this.form.querySelector("input");
    const left = make("div.column.left", {},
      Object.assign(panel("Takes", this.add, this.list, file), { className: "panel grow" }),
      panel("How it is made", null, this.form, make("div.buttons", {}, this.solve, this.play)), panel("This frame", null, this.frame, this.about));
    const box = (name) => make("div.box", { id: `box-${name}` });
    this.boxes = Object.fromEntries(["wanted", "played", "bar", "traces", "phase", "array", "spectrogram", "overview"].map((name) => [name, box(name)]));
    const { boxes } = this;
    this.panels = { wanted: panel("Wanted", "", boxes.wanted), played: panel("Played", "", boxes.played), traces: panel("Cells", "", boxes.traces), phase: panel("Phase", "where louder than 5 %", boxes.phase), array: panel("Array", "", boxes.array), spectrogram: panel("Spectrogram", "", boxes.spectrogram) };
    const { panels } = this;
    this.studio.main.append(make("div.reproduce", {}, left,
      make("div.middle", {}, make("div.pair", {}, panels.wanted, panels.played, panel("Pa", null, boxes.bar)), panels.traces),
      make("div.side", {}, panels.phase, panels.array, panels.spectrogram)));
    this.control();
  }
  control() {
    const controls = this.link.controls, player = this.link.state.player, row = this._row(this.take?.name);
    const comes = this.take?.stamp === "first";
    this.solve.disabled = !controls || !this.take || comes;
    this.play.disabled = !controls || !row?.solved || player?.state !== "ready";
    this.play.title = !row?.solved ? "solve it first" : player?.state !== "ready" ? "the array is not ready" : "";
    this.add.disabled = !controls;
    const solving = (this.link.state.jobs ?? []).find((job) => job.room === "reproduce" && ["runs", "waits"].includes(job.state) && this.take && job.title.endsWith(this.take.name));
    if (this.nothing) this.nothing.textContent = solving ? `being solved${solving.total ? `: ${Math.round((100 * solving.done) / solving.total)} %` : " …"}` : comes ? "comes in a moment" : "not solved yet: press Solve";
  }
  _row(name) { return this.link.state.takes?.find((row) => row.name === name); }
  _takes(takes) {
    this.list.replaceChildren(...takes.map((row) => make("li", {}, make("a", { href: `#reproduce/${encodeURI(row.name)}`, "aria-current": row.name === this.take?.name ? "true" : null },
      make("span", {}, row.name.replace(/^sample:/, "").replace(/\.h5$/, "")), make("small", {}, row.sample ? "sample" : row.compared ? "compared" : row.played ? "played" : row.solved ? "solved" : "")))));
    const asked = this.studio.address.take, name = this.take?.name ?? (takes.some((row) => row.name === asked) ? asked : takes.find((row) => row.sample)?.name ?? takes[0]?.name);
    const row = takes.find((each) => each.name === name);
    if (row && (!this.take || this.take.stamp !== row.stamp)) this._open(name, this.transport ? this.transport.time : this.studio.address.time);
    if (!takes.length) this.about.textContent = "samples are being made …";
    this.control();
  }
  async _open(name, time) {
    if (this._opening === `${name} ${this._row(name)?.stamp}`) return;
    this._opening = `${name} ${this._row(name)?.stamp}`;
    const opening = this._opening;
    const facts = await tried(this.link.order("reproduce", "open", { take: name }));
    if (!facts || opening !== this._opening || this.left) return;
    const [inferno, twilight] = await Promise.all([colours("inferno"), colours("twilight")]);
    if (this.left) return;
    const before = this.transport, same = before && this.take.name === name;
    this._close();
    const view = new TakeView(name, facts, () => this._came());
    const transport = new Transport({ frames: facts.frames, rate: facts.rate_hz });
    if (same) Object.assign(transport, { playing: before.playing, speed: before.speed, loop: before.loop, marks: before.marks, channel: before.channel, span: before.span });
    else transport.channel = facts.rows > 2 ? 10 : 0;
    transport.channels = facts.rows * facts.columns;
    this.take = Object.assign(view, { stamp: facts.stamp, transport, pictures: [] });
    if (Number.isFinite(time)) { const plays = transport.playing; transport.seek(time * transport.rate); if (!same) transport.playing = plays && !this.studio.address.time; }
    this._pictures(inferno, twilight);
    this._about();
    transport.addEventListener("change", () => { if (!transport.playing) this._address(); this._frame(); });
    transport.run((state) => this._draw(state));
    this._takes(this.link.state.takes ?? []);
  }
  _pictures(inferno, twilight) {
    const { take, boxes, panels } = this, { facts, transport } = take, drive = facts.drive;
    const seek = (frame) => transport.seek(frame), choose = (channel) => transport.set({ channel });
    const cells = { rows: facts.rows, columns: facts.columns, pitch: facts.pitch_mm };
    const side = drive?.rows ?? 16, place = { pitch: drive?.pitch_mm ?? 11 / 3, x: drive?.x_mm ?? 0, y: drive?.y_mm ?? 0 };
    const map = { rows: side, columns: drive?.columns ?? side, place, unit: "Pa", colours: inferno, phaseColours: twilight };
    const fine = drive ? { down: Float32Array.from(drive.down), across: Float32Array.from(drive.across) } : {};
    this.wanted = new FieldPicture(boxes.wanted, { ...map, label: "Wanted sound", track: take.wanted, cells });
    this.bar = new BarPicture(boxes.bar, { label: "Scale", colours: inferno, phaseColours: twilight, unit: "Pa" });
    take.pictures = [this.wanted, this.bar,
      new TracesPicture(boxes.traces, { label: "Cells", track: take.samples, choose, seek }),
      new SpectrogramPicture(boxes.spectrogram, { label: "Spectrogram", track: take.samples, colours: inferno }),
      new OverviewPicture(this._footer(transport), { label: "The whole take", track: take.samples, seek, frames: facts.frames })];
    this.nothing = null;
    if (drive) {
      this.played = new FieldPicture(boxes.played, { ...map, ...fine, label: "Played sound, simulated", track: take.played, cells });
      this.phase = new FieldPicture(boxes.phase, { ...map, ...fine, label: "Phase of the field", track: take.played });
      take.pictures.push(this.played, new PhasesPicture(boxes.array, { label: "Phases of the array", track: take.phaseRows, colours: twilight, positions: drive.positions_mm }));
    } else {
      this.played = this.phase = null;
      this.nothing = make("div.nothing", { role: "status" }, "");
      boxes.played.append(this.nothing);
      for (const name of ["phase", "array"]) boxes[name].append(make("div.nothing", {}, "comes with the drive"));
    }
    panels.wanted.aside.textContent = `${map.rows} × ${map.columns}, ${facts.rows} × ${facts.columns} cells`;
    panels.played.aside.textContent = drive ? `simulated, ${fine.down.length / map.rows} × ${fine.across.length / map.columns}` : "";
    panels.array.aside.textContent = drive ? `phases of ${drive.transducers} transducers` : "";
    panels.spectrogram.aside.textContent = `channel ${transport.channel}`;
    panels.traces.aside.textContent = "";
    panels.traces.querySelector("h2").textContent = `${transport.channels} cells, ${facts.unit}`;
    this.control();
  }
  _footer(transport) {
    const { footer } = this.studio, overview = make("div.box");
    const bar = make("div.row");
    footer.replaceChildren(overview, bar);
    footer.hidden = false;
    controls(transport, bar);
    const key = (...words) => make("span", {}, ...words);
    bar.append(make("span.keys", {}, key(make("kbd", {}, ","), " ", make("kbd", {}, "."), " one frame"), key(make("kbd", {}, "M"), " mark"), key(make("kbd", {}, "?"), " keys"),
      make("button", { type: "button", onclick: () => this._code() }, "Show the code")));
    return overview;
  }
  _came() {
    if (!this.take?.pictures.length) return;
    const { wanted, played } = this.take, top = Math.max(wanted.top, played.top);
    this.wanted.top = top;
    if (this.played) { this.played.top = top; this.phase.top = top; }
    this.bar.top = top;
    if (this.take.problem) this.about.textContent = this.take.problem;
    this.transport.set({});
  }
  _draw(state) {
    const began = performance.now();
    for (const picture of this.take.pictures) picture.draw(state);
    this.phase?.draw({ ...state, phase: true });
    this.studio.drawing = performance.now() - began;
    this.studio.drawn = (this.studio.drawn ?? 0) + 1;
    if (!this._framed || performance.now() - this._framed > 200) this._frame();
  }
  _frame() {
    const { take } = this;
    if (!take) return;
    this._framed = performance.now();
    const { frame, channel, span } = take.transport, drive = take.facts.drive, peak = this.played?.peak ?? this.wanted?.peak;
    this.frame.replaceChildren(rows([
      ["Strength", drive?.strength[frame]?.toFixed(3) ?? "–"], ["E", drive?.error[frame] === undefined ? "–" : `${(100 * drive.error[frame]).toFixed(1)} %`],
      ["Peak", peak ? `${Math.round(peak.value)} Pa` : "–"], ["Place of peak", peak ? `${peak.x.toFixed(0)}, ${peak.y.toFixed(0)} mm` : "–"]]));
    this.panels.spectrogram.aside.textContent = `channel ${channel}, 0 to ${take.facts.rate_hz / 2} Hz`;
    this.panels.traces.aside.textContent = `${span >= 1 ? span.toPrecision(2) : span.toFixed(3)} s around the playhead; channel ${channel} chosen`;
  }
  _about() {
    const { facts } = this.take, said = [facts.source];
    if (facts.simulated) said.push("SIMULATED");
    if (facts.frames_in_all > facts.frames) said.push(`the first ${this.take.seconds} s of ${(facts.frames_in_all / facts.rate_hz).toFixed(0)} s are shown`);
    if (!facts.calibrated) said.push("not calibrated");
    said.push(...facts.report, ...facts.journal.filter((event) => event.kind !== "stroke").slice(0, 6).map((event) => event.said));
    this.about.replaceChildren(...said.map((words) => make("div", {}, words)));
  }
  _address() { if (this.take && this.transport && this.studio.room === this && !this.transport.playing) this.studio.here(this.take.name, this.transport.time); }
  _close() {
    if (!this.take) return;
    this.take.transport.stop();
    this.take.close();
    for (const picture of [...this.take.pictures, this.phase]) picture?.remove();
    for (const box of Object.values(this.boxes)) box.replaceChildren();
    this.take.pictures = [];
    this.take = null;
  }
  _solve() { return tried(this.link.order("reproduce", "solve", { take: this.take.name, ...this.made, ...(this.take.seconds > 1.5 && this.take.facts.drive ? { visible_s: Math.max(0, Math.min(this.take.seconds - 1, this.transport.time - 0.5)) } : {}) })); }
  /** A setting was changed: what is in sight is solved anew at once, if it was solved before. */
  _again() { if (this.take?.facts.drive && this.link.controls && this.link.state.player?.state !== "plays") this._solve(); }
  async _upload(file) {
    if (!file) return;
    const answer = await fetch("/upload", { method: "POST", body: file, headers: { "x-name": encodeURIComponent(file.name), "x-page": String(this.link.page) } });
    const said = await answer.json();
    if (said.error) tried(Promise.reject(new Error(said.error))); else this.studio.go("reproduce", said.ok);
  }
  _code() {
    const { name, facts } = this.take, sample = name.startsWith("sample:"), file = sample ? `${name.slice(7)}.h5` : name, stem = file.replace(/\.\w+$/, "");
    const given = [`--mode ${this.made.mode}`, this.made.mapping ? `--mapping ${this.made.mapping}` : "", `--method ${this.made.method}`, `--level ${this.made.level}`, this.made.gain ? `--gain ${this.made.gain}` : "", this.made.height_mm ? `--height ${this.made.height_mm}mm` : ""].filter(Boolean).join(" ");
    const but = [`method="${this.made.method}"`, `level=${this.made.level === "auto" ? '"auto"' : this.made.level}`, this.made.mapping ? `mapping="${this.made.mapping}"` : "", this.made.gain ? `gain=${this.made.gain}` : "", this.made.height_mm ? `height=${this.made.height_mm / 1000}` : ""].filter(Boolean).join(", ");
    const first = sample ? `midair record virtual:${name.slice(7)} ${file} --duration ${(facts.frames / facts.rate_hz).toFixed(1)}s\n` : "";
    this.studio.code("The same, as code", `${first}midair solve ${file} ${given}\nmidair play ${stem}.drive.h5\nmidair compare ${file} ${stem}.rerecorded.h5`,
      `import midair\nfrom midair.flow import felt, reproduce\nfrom midair.settings import MODES\n\ntake = ${sample ? `midair.record("virtual:${name.slice(7)}", ${(facts.frames / facts.rate_hz).toFixed(1)})` : `midair.open_take("${file}")`}\nsettings = MODES["${this.made.mode}"]().but(${but})\npressure = felt(take.recording, take.calibration, settings)\nmade = reproduce(pressure, midair.TransducerArray.autd3(), settings)\nplayed = midair.play(made.solution, "virtual")\nprint(made, played)`);
  }
}
