/* Panel Compare: original and re-recording, their differences, perceptual metrics, and a
    correction to apply. */

import { Track, TracesPicture, OverviewPicture } from "/web/view.js";
import { Transport, controls } from "/web/transport.js";
import { buttonOf, make, panel, rows, table, tried } from "/web/dom.js";
import { solveTake } from "/web/jobs.js";
import {
  chosen,
  driveButtons,
  driveLabel,
  drivesOf,
  leadOf,
  listed,
  listening,
  otherDrive,
  palmFound,
  rowOf,
  sections,
  takeOf,
  takesList,
  verdictOf,
} from "/web/take.js";

export default class Compare {
  constructor(studio) {
    this.studio = studio;
    this.link = studio.link;
    this.name = studio.address.take;
    this._build();
    this._offs = [
      this.link.on("takes", () => this._takes()),
      this.link.on("comparisons", () => this._takes()),
      this.link.on("palms", () => this.control()),
      this.link.on("budgets", () => this.control()),
      this.link.on("jobs", () => this.control()),
    ];
  }
  leave() {
    this.left = true;
    for (const off of this._offs) off();
    this._close();
  }
  moved({ take }) {
    if (take && take !== this.name) {
      this.before = takeOf(this.name) === takeOf(take) ? this.name : "";
      this.name = take;
      this.found = null;
      this._takes();
    }
  }
  /** Key B: the other drive of the take, at the same time and with the same sound. */
  swap() {
    const other = otherDrive(this.link.state.takes, this.name, this.before);
    if (other !== this.name) this.studio.go("compare", other);
  }
  get transport() {
    return this._transport ?? null;
  }
  _build() {
    this.list = takesList();
    this.compare = buttonOf(
      "Compare again",
      "computes the figures of this drive and its re-recording again",
      () => tried(this.link.order("compare", "compare", { take: this.name })),
    );
    this.report = buttonOf(
      "Make the report",
      "writes this comparison as a page: verdict, figures, and both recordings to watch",
      () => tried(this.link.order("compare", "report", { take: this.name })),
      { id: "report" },
    );
    this.budget = buttonOf(
      "Error budget",
      "error of each stage of the reproduction, simulated for the first second; takes some seconds",
      () => tried(this.link.order("compare", "budget", { take: this.name })),
      { id: "budget" },
    );
    this.palm = buttonOf(
      "Simulate the palm",
      "pressure of the drive on a palm of 85 mm, simulated; takes some seconds",
      () => tried(this.link.order("compare", "palm", { take: this.name })),
      { id: "palm" },
    );
    this.pressed = make("div");
    this.spent = make("div", { id: "spent" });
    this.apply = buttonOf(
      "Apply",
      "solves again with the suggested gain, as another drive",
      () => this._apply(),
      { class: "main" },
    );
    this.shown = make(
      "a",
      { target: "_blank", rel: "noopener", hidden: true, id: "to-report" },
      "Open the report",
    );
    this.suggested = make("div");
    this.drives = make("div");
    this.beside = make("div", { id: "side-by-side" });
    this.listen = listening(this.link);
    this.verdict = make("section.panel.verdict", { "aria-label": "Verdict", hidden: true });
    this.traces = make("div.box");
    this.spectrum = make("div.box");
    this.card = make("div");
    this.other = make(
      "p.bad",
      { id: "other-drive", role: "status", hidden: true },
      "This re-recording was made from an earlier drive: play the current drive in Reproduce.",
    );
    this.tracesPanel = panel(
      "Cells, Pa",
      make("span.legend", {}, make("span", {}, "original"), make("span", {}, "re-recorded")),
      this.traces,
    );
    this.spectrumPanel = panel("Spectrum", "", this.spectrum);
    this.studio.main.append(
      make(
        "div.compare",
        {},
        make(
          "div.column.left",
          {},
          Object.assign(panel("Takes", null, this.list, this.drives), { className: "panel grow" }),
          this.listen.shown,
          panel("Correction", null, this.suggested, make("div.buttons", {}, this.apply)),
          panel(
            "Report",
            null,
            make("div.buttons", {}, this.compare, this.budget, this.palm, this.report),
            this.shown,
          ),
        ),
        this.verdict,
        make("div.middle", {}, this.tracesPanel, this.spectrumPanel),
        panel(
          "Differences",
          null,
          make(
            "div.card",
            { tabIndex: 0 },
            this.other,
            this.beside,
            this.spent,
            this.pressed,
            make("details", {}, make("summary", {}, "Details"), this.card),
          ),
        ),
      ),
    );
  }
  control() {
    const row = rowOf(this.link.state.takes, this.name),
      controls = this.link.controls;
    this.compare.disabled = this.report.disabled = !controls || !row?.played;
    this.palm.disabled = this.budget.disabled = !controls || !row?.solved;
    this._pressed(row);
    this.apply.disabled = !controls || !this.found?.suggested_gain;
    this.shown.hidden = !row?.report;
    this.shown.href = row?.sample
      ? `/file/${encodeURI(this.name)}.report.html`
      : `/file/${encodeURI(this.name.replace(/\.\w+(?=@|$)/, "").replace("@", "."))}.report.html`;
  }
  _takes() {
    const takes = this.link.state.takes ?? [];
    const every = takes.flatMap(row => [row, ...row.drives]);
    this.name ||=
      (
        every.find(row => row.compared) ??
        every.find(row => row.played) ??
        (takes[0] && { name: leadOf(takes[0]) })
      )?.name ?? "";
    listed(
      this.list,
      takes.map(row =>
        make(
          "li",
          {},
          make(
            "a",
            {
              href: `#compare/${encodeURI(leadOf(row))}`,
              "aria-current": row.name === takeOf(this.name) ? "true" : null,
            },
            make("span", {}, row.name.replace(/^sample:/, "").replace(/\.h5$/, "")),
            make(
              "small",
              {},
              ["compared", "played"].find(what => [row, ...row.drives].some(each => each[what])) ??
                "",
            ),
          ),
        ),
      ),
    );
    const row = rowOf(takes, this.name),
      found = row?.compared && this.link.state.comparisons?.[this.name];
    if (found && found !== this.found) this._show(found);
    if (!found) {
      this.found = null;
      this._close();
      this._empty(row);
    }
    this._drives(row);
    this.other.hidden = !found || !row.drive || found.drive === row.drive;
    this.control();
  }
  /** The drives of the take, and the figures of those that were compared, side by side. */
  _drives(row) {
    const comparisons = this.link.state.comparisons ?? {},
      label = name => driveLabel(name, comparisons[name]?.mode, comparisons[name]?.gain);
    this.drives.replaceChildren(
      ...driveButtons(this.studio, this.name, ({ name, compared, played }) => [
        label(name),
        compared && comparisons[name] ? "" : played ? "played" : "not played",
        "",
      ]),
    );
    const shown = drivesOf(rowOf(this.link.state.takes, takeOf(this.name))).filter(
      each => each.compared && comparisons[each.name],
    );
    this.beside.replaceChildren(
      ...(shown.length < 2
        ? []
        : [
            make("h3", {}, "Side by side"),
            table(
              [
                "",
                ...shown.map(each =>
                  make(each.name === this.name ? "strong" : "span", {}, label(each.name)),
                ),
              ],
              comparisons[shown[0].name].figures.map(([name], i) => [
                name,
                ...shown.map(each => comparisons[each.name].figures[i]?.[1] ?? "–"),
              ]),
            ),
          ]),
    );
    this.listen.tell(this.name);
  }
  _pressed(row) {
    const budget = this.link.state.budgets?.[this.name];
    this.spent.replaceChildren(
      ...(budget && budget.stamp === row?.drive
        ? [
            make("h3", {}, "Error budget ", make("strong.simulated", {}, "SIMULATED")),
            table(
              ["stage", "alone", "touched cells"],
              budget.rows.map(([name, alone, far, what]) => [
                make("span", { title: what }, name),
                alone,
                far,
              ]),
            ),
            make(
              "p.quiet",
              {},
              `Signal-to-distortion ratio, ${budget.band[0]} to ${budget.band[1]} Hz, first ` +
                `${budget.seconds.toPrecision(2)} s. Alone: output of the stage against its ` +
                "input. Touched cells: output against the original, later stages ideal.",
            ),
          ]
        : []),
    );
    this.pressed.replaceChildren(...palmFound(this.link, this.name));
  }
  _empty(row) {
    const words = !row
      ? this.name
        ? `${this.name}: there is no such take in the folder`
        : "no takes yet"
      : row.played
        ? "not compared in this session: press Compare again"
        : row.solved
          ? "play it in Reproduce first: the re-recording is compared here"
          : "solve it and play it in Reproduce first";
    this.traces.replaceChildren(make("div.nothing", {}, words));
    this.spectrum.replaceChildren(make("div.nothing", {}, ""));
    this.card.replaceChildren(make("p.quiet", {}, words));
    this.verdict.hidden = true;
    this.suggested.replaceChildren(make("span.quiet", {}, "available after a comparison"));
  }
  async _show(found) {
    const { frame, channel, span } = this.transport ?? {},
      same = this.transport && takeOf(this.shownOf ?? "") === takeOf(this.name);
    this.shownOf = this.name;
    this.found = found;
    this._close();
    this.card.replaceChildren(
      rows(found.figures),
      ...found.card.map(([name, value, meaning]) =>
        make("div", {}, make("h3", {}, `${name}: ${value}`), make("p.quiet", {}, meaning)),
      ),
    );
    this.verdict.hidden = false;
    this.verdict.replaceChildren(...verdictOf(this.link, this.name));
    this.suggested.replaceChildren(
      rows([
        ["gain", found.gain.toPrecision(3)],
        ["re-recorded level", `× ${found.measured_gain.toPrecision(3)}`],
        ["suggested gain", found.suggested_gain ?? "none"],
      ]),
    );
    const track = (name, label) =>
      new Track({ rate: found.rate_hz, capacity: found.frames, unit: "Pa", name, label });
    const tracks = {
      original: track("original", "original"),
      again: track("again", "re-recorded"),
    };
    const transport = (this._transport = new Transport({
      frames: found.frames,
      rate: found.rate_hz,
    }));
    transport.channels = found.channel_correlation.length;
    transport.channel = found.spectrum.channel;
    transport.span = transport.whole = Math.min(0.5, found.frames / found.rate_hz);
    if (same) {
      Object.assign(transport, { channel, span, playing: false });
      transport.seek(frame);
    }
    this.traces.replaceChildren();
    this.spectrum.replaceChildren();
    const { footer } = this.studio,
      overview = make("div.box"),
      bar = make("div.row"),
      seek = frame => transport.seek(frame);
    footer.replaceChildren(overview, bar);
    footer.hidden = false;
    controls(transport, bar);
    this.pictures = [
      new TracesPicture(this.traces, {
        label: "Original and re-recorded",
        track: tracks.original,
        over: tracks.again,
        choose: channel => transport.set({ channel }),
        seek,
      }),
      new OverviewPicture(overview, {
        label: "The whole take",
        track: tracks.original,
        seek,
        frames: found.frames,
      }),
    ];
    this._spectrum(found.spectrum);
    transport.run(state => {
      for (const picture of this.pictures) picture.draw(state);
    });
    for (let second = 0; second * found.rate_hz < found.frames; second++)
      for (const name of ["original", "again"])
        for (const section of (await tried(sections(name, this.name, second))) ?? []) {
          tracks[name].add(section);
          transport.set({});
        }
    this.control();
  }
  _spectrum({ frequency, db, channel }) {
    const canvas = make("canvas", { role: "img", tabIndex: 0 }),
      box = this.spectrum;
    canvas.setAttribute(
      "aria-label",
      `Spectrum of channel ${channel}, original and re-recorded, 10 to ${Math.round(frequency.at(-1))} Hz`,
    );
    Object.assign(canvas.style, { position: "absolute", inset: 0, width: "100%", height: "100%" });
    box.append(canvas);
    this.spectrumPanel.aside.textContent = `channel ${channel}, the strongest; dB re 1 Pa²/Hz`;
    const top = Math.max(...db.flat()),
      bottom = top - 60;
    const draw = () => {
      const ratio = devicePixelRatio || 1,
        w = (canvas.width = box.clientWidth * ratio),
        h = (canvas.height = box.clientHeight * ratio),
        pen = canvas.getContext("2d"),
        style = getComputedStyle(box),
        ink = name => style.getPropertyValue(name);
      const left = 38 * ratio,
        base = h - 20 * ratio,
        x = f =>
          left + ((f - frequency[0]) / (frequency.at(-1) - frequency[0])) * (w - left - 8 * ratio),
        y = level => ((top + 3 - level) / (top + 3 - bottom)) * base;
      pen.clearRect(0, 0, w, h);
      pen.font = `${11 * ratio}px system-ui, sans-serif`;
      pen.fillStyle = ink("--view-quiet");
      pen.strokeStyle = ink("--view-line");
      pen.lineWidth = ratio / 2;
      const widest = (64 * ratio * (frequency.at(-1) - frequency[0])) / (w - left),
        step = [10, 20, 50, 100, 200, 500, 1000, 2000].find(each => each >= widest) ?? 5000;
      for (let f = 0; f <= frequency.at(-1); f += step) {
        if (f < frequency[0]) continue;
        pen.beginPath();
        pen.moveTo(x(f), 0);
        pen.lineTo(x(f), base);
        pen.stroke();
        pen.textAlign = "center";
        pen.fillText(
          `${f}${f + step > frequency.at(-1) ? " Hz" : ""}`,
          Math.min(x(f), w - 18 * ratio),
          h - 5 * ratio,
        );
      }
      for (let level = Math.ceil(bottom / 20) * 20; level < top; level += 20) {
        pen.beginPath();
        pen.moveTo(left, y(level));
        pen.lineTo(w, y(level));
        pen.stroke();
        pen.textAlign = "right";
        pen.fillText(`${level} dB`, left - 3 * ratio, y(level) + 4 * ratio);
      }
      db.forEach((levels, i) => {
        pen.strokeStyle = ink(i ? "--view-second" : "--view-trace");
        pen.lineWidth = (i ? 2.2 : 1.4) * ratio;
        pen.setLineDash(i ? [6 * ratio, 3 * ratio] : []);
        pen.beginPath();
        levels.forEach((level, k) => {
          const at = [x(frequency[k]), y(Math.max(bottom, level))];
          if (k) pen.lineTo(...at);
          else pen.moveTo(...at);
        });
        pen.stroke();
      });
      pen.setLineDash([]);
    };
    this._watch = new ResizeObserver(draw);
    this._watch.observe(box);
    this._scheme = matchMedia("(prefers-color-scheme: dark)");
    this._scheme.onchange = draw;
  }
  async _apply() {
    const take = this.name,
      gain = this.found.suggested_gain,
      facts = await tried(this.link.order("reproduce", "open", { take }));
    const settings = facts && chosen(facts.drive?.settings ?? {}),
      answer = settings && (await solveTake(this.link, { take, ...settings, gain }));
    if (answer) this.studio.go("reproduce", answer.take);
  }
  _close() {
    this._watch?.disconnect();
    if (this._scheme) this._scheme.onchange = null;
    this._transport?.stop();
    this._transport = null;
    for (const picture of this.pictures ?? []) picture.remove();
    this.pictures = [];
    this.studio.footer.hidden = true;
  }
}
