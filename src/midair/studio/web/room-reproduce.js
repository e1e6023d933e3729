/* Panel Reproduce: target and played field in Pa, frame by frame; settings; playing. */

import {
  FieldPicture,
  TracesPicture,
  PhasesPicture,
  SpectrogramPicture,
  OverviewPicture,
  BarPicture,
} from "/web/view.js";
import { Transport, controls } from "/web/transport.js";
import {
  buttonOf,
  choice,
  field,
  make,
  openModal,
  panel,
  playable,
  rows,
  tried,
} from "/web/dom.js";
import { bringFile } from "/web/import.js";
import { solveTake } from "/web/jobs.js";
import { courseOf } from "/web/palm-film.js";
import {
  TakeView,
  chosen,
  colours,
  driveButtons,
  driveLabel,
  drivesOf,
  leadOf,
  listed,
  listening,
  otherDrive,
  palmFound,
  reached,
  rowOf,
  takeOf,
  takesList,
  verdictOf,
} from "/web/take.js";
import { askToPlay } from "/web/playing.js";
import { otherAir, warningBox } from "/web/warnings.js";

const MAPPINGS = [
  ["", "of the mode"],
  ["half-wave", "half-wave"],
  ["constant-offset", "constant offset"],
  ["slow-bias", "slow bias"],
  ["receptors", "receptors"],
];
const METHODS = [
  ["", "of the mode"],
  ["live", "live, quick"],
  ["fast", "fast"],
  ["glide", "glide"],
  ["lm", "lm, the paper's, slow"],
];
const MODES = [
  ["best", "best"],
  ["finest", "finest, slow"],
  ["quick", "quick"],
  ["paper", "paper"],
  ["quiet", "quiet ears"],
];
const some = (unit, ...values) => [
  ["", "of the mode"],
  ...values.map(value => [value, `${value} ${unit}`]),
];
const HEIGHTS = some("mm", "150", "180", "200", "230"),
  EARS = some("dB", "110", "115", "120", "125", "130");
const LEVELS = [
  ["", "of the mode"],
  ["auto", "auto"],
  ["0.3", "0.3 of full"],
  ["0.6", "0.6 of full"],
  ["1", "full"],
];
const FIELDS = [
  ["Mode", "All settings at once: best is the most accurate, paper is as published"],
  ["Mapping", "How signed pressure is made positive: sound can only push"],
  ["Solver", "Method that finds the phases"],
  ["Level", "Drive level of the transducers; auto fits the loudest frame"],
  ["Gain", "Factor on the pressure of the recording"],
  ["Height", "Height of the palm above the array"],
  ["Ears, at most", "Highest sound pressure level at ears and bystander"],
];
const USUAL = {
  mode: "best",
  mapping: "",
  method: "",
  level: "",
  gain: 1,
  height_mm: "",
  ears_db: "",
};

export default class Reproduce {
  constructor(studio) {
    this.studio = studio;
    this.link = studio.link;
    this.take = null;
    this.views = new Map(); // of the drives of the take, so that A/B need not load them again
    this.wish = studio.address.take;
    this._build();
    this._offs = [
      this.link.on("takes", takes => this._takes(takes)),
      this.link.on("player", () => this.control()),
      this.link.on("jobs", () => this.control()),
      this.link.on("air", () => this.control()),
      this.link.on("palms", () => this.control()),
      this.link.on("comparisons", () => this.control()),
      this.link.on("edits", () => this.control()),
      this.link.on("exported", name => this._exported(name)),
    ];
    this._clock = setInterval(() => this._address(), 500);
  }
  leave() {
    for (const off of this._offs) off();
    clearInterval(this._clock);
    this._close();
    this._forget();
    this.left = true;
  }
  get transport() {
    return this.take?.transport ?? null;
  }
  moved({ take, time }) {
    if (take && take !== this.wish) this._open(take, time);
    else if (Number.isFinite(time) && this.transport)
      this.transport.seek(time * this.transport.rate);
  }
  _build() {
    this.list = takesList();
    const file = make("input", {
      type: "file",
      accept:
        ".zip,.h5,.hdf5,.csv,.tsv,.txt,.lvm,.xml,.wav,.rf64,.flac,.aiff,.aif,.ogg,.mp3,.npz,.npy,.mat,.xdf,.tdms,.ahap,.haptic",
      hidden: true,
      "aria-label": "a recording from this computer",
      onchange: () => {
        bringFile(this.studio, file.files[0]);
        file.value = "";
      },
    });
    this.add = buttonOf(
      "Add a file",
      "A recording of this computer, or a project as ZIP of at most 4 GiB; you can also drop it on the page",
      () => file.click(),
    );
    this.sort = choice(
      [
        ["new", "newest"],
        ["name", "name"],
      ],
      "new",
      () => this._takes(this.link.state.takes ?? []),
    );
    this.sort.setAttribute("aria-label", "order of the takes");
    this.sort.title = "Order of the list";
    this.text = make("textarea", {
      rows: 3,
      maxLength: 10000,
      "aria-label": "notes on this take",
      title: "Kept in the folder beside the take",
      oninput: () => this._note(),
    });
    this.marks = make("div.column", { id: "marks" });
    this.search = make("input", {
      type: "search",
      placeholder: "search",
      "aria-label": "search the takes",
      title: "Shows the takes whose names have all of these words",
      oninput: () => this._found(),
    });
    const own = (words, title, act) =>
      buttonOf(words, title, act, { disabled: true, "data-help": title });
    this.own = [
      own("Rename", "Gives the take and its drives another name or folder", () => this._rename()),
      own("Duplicate", "Copies the take without its drives", () => tried(this._own("duplicate"))),
      own("Delete", "Moves the take and its drives to the folder bin", () => this._delete()),
    ];
    this.editing = [
      own("Edit", "Trim, gain, mask, resample or join, as another take", () => this._edit()),
      own("Undo", "Takes back the last edit: Ctrl Z", () => this.undo("undo")),
      own("Redo", "Makes the edit again: Ctrl Shift Z", () => this.undo("redo")),
      own("Export", "Writes take, drive or re-recording in a format of another program", () =>
        this._export(),
      ),
    ];
    this.solve = buttonOf(
      "Solve",
      "Computes the phases of the transducers for every frame",
      () => this._solve(),
      { class: "main" },
    );
    this.play = make("button", { onclick: () => this._play() }, "Play on array");
    this.otherAir = warningBox(
      "other-air",
      buttonOf(
        "Correct phases",
        "Turns the phases for the air of now, exact at the centre of the points",
        () => this._play(true),
      ),
      buttonOf("Solve again", "Solves a new drive for the air of now", () => this._solve()),
    );
    this.form = make("div.column");
    this.listen = listening(this.link);
    this.palm = buttonOf(
      "Simulate the palm",
      "Pressure of the drive on a palm of 85 mm, simulated; takes some seconds",
      () => tried(this.link.order("compare", "palm", { take: this.take.name })),
    );
    this.pressed = make("div");
    this.verdict = make("section.panel.verdict", { "aria-label": "Verdict", hidden: true });
    this.drives = make("div", { id: "drives" });
    this.frame = make("div");
    this.about = make("div.quiet");
    const set =
      name =>
      ({ target }) => {
        const value =
          target.value === "" || Number.isNaN(Number(target.value))
            ? target.value || USUAL[name]
            : Number(target.value);
        // The solver of one mode may not support the terms of another.
        this._fill({
          ...this.made,
          [name]: value,
          ...(name === "mode" ? { method: "", ears_db: "" } : {}),
        });
      };
    this.inputs = {
      mode: choice(MODES, "", set("mode")),
      mapping: choice(MAPPINGS, "", set("mapping")),
      method: choice(METHODS, "", set("method")),
      level: choice(LEVELS, "", set("level")),
      gain: make("input", {
        type: "number",
        min: 0.05,
        max: 100,
        step: 0.05,
        onchange: set("gain"),
      }),
      height_mm: choice(HEIGHTS, "", set("height_mm")),
      ears_db: choice(EARS, "", set("ears_db")),
    };
    this.view = make("p.quiet", { id: "in-view", role: "status" });
    this.form.append(
      ...Object.values(this.inputs).map((input, i) => field(FIELDS[i][0], input, FIELDS[i][1])),
      this.view,
    );
    const details = make("details", {}, make("summary", {}, "Details"), this.frame);
    const left = make(
      "div.column.left",
      {},
      Object.assign(
        panel(
          "Takes",
          this.add,
          make("div.found", {}, this.search, this.sort),
          this.list,
          make("div.buttons", {}, ...this.own, ...this.editing),
          file,
        ),
        { className: "panel grow" },
      ),
      panel(
        "Settings",
        null,
        this.drives,
        this.form,
        this.otherAir,
        make("div.buttons", {}, this.solve, this.play),
      ),
      panel("This take", null, this.about, details),
      this.listen.shown,
      panel("Palm", null, make("div.buttons", {}, this.palm), this.pressed),
      panel(
        "Notes and marks",
        make("span", {}, "mark ", make("kbd", {}, "M")),
        this.text,
        this.marks,
      ),
    );
    const box = name => make("div.box", { id: `box-${name}` });
    this.boxes = Object.fromEntries(
      ["wanted", "played", "bar", "traces", "phase", "array", "spectrogram", "overview"].map(
        name => [name, box(name)],
      ),
    );
    const { boxes } = this;
    this.panels = {
      wanted: panel("Target", "", boxes.wanted),
      played: panel("Played", "", boxes.played),
      traces: panel("Cells", "", boxes.traces),
      phase: panel("Phase", "where louder than 5 %", boxes.phase),
      array: panel("Array", "", boxes.array),
      spectrogram: panel("Spectrogram", "", boxes.spectrogram),
    };
    const { panels } = this;
    this.problem = make("section.panel.problem", { id: "problem", role: "alert", hidden: true });
    this.pictures = [
      make(
        "div.middle",
        {},
        make("div.pair", {}, panels.wanted, panels.played, panel("Pa", null, boxes.bar)),
        panels.traces,
      ),
      make("div.side", {}, panels.phase, panels.array, panels.spectrogram),
    ];
    const drop = {
      ondragover: event => event.preventDefault(),
      ondrop: event => {
        event.preventDefault();
        if (this.link.controls) bringFile(this.studio, event.dataTransfer.files[0]);
      },
    };
    this.studio.main.append(make("div.reproduce", drop, left, this.verdict, ...this.pictures, this.problem));
    this._fill(USUAL);
  }
  /** Show settings in the form; a value that is not among its options is added. */
  _fill(made) {
    this.made = { ...USUAL, ...made };
    for (const [name, input] of Object.entries(this.inputs)) {
      const value = String(this.made[name]);
      if (input.options && ![...input.options].some(option => option.value === value))
        input.append(
          make(
            "option",
            { value },
            name === "height_mm"
              ? `${value} mm`
              : name === "ears_db"
                ? `${value} dB`
                : name === "level"
                  ? `${value} of full`
                  : value,
          ),
        );
      input.value = value;
    }
    this.inputs.ears_db.closest(".field").hidden = this.made.mode !== "quiet";
    const able = this.link.state.studio?.methods[this.made.mode];
    for (const option of this.inputs.method.options)
      option.disabled = !!option.value && !!able && !able.includes(option.value);
    this.control();
  }
  control() {
    const controls = this.link.controls,
      player = this.link.state.player,
      row = this._row(this.take?.name);
    this.solve.disabled = !controls || !this.take;
    this.palm.disabled = !controls || !row?.solved;
    this.pressed.replaceChildren(...palmFound(this.link, this.take?.name));
    const drive = this.take?.facts.part ? null : this.take?.facts.drive;
    this.verdict.replaceChildren(...verdictOf(this.link, this.take?.name, drive));
    this.verdict.hidden = !this.verdict.childElementCount;
    this.listen.tell(this.take?.name);
    const facts = this.take?.facts,
      settings = facts?.drive?.settings,
      other =
        settings &&
        JSON.stringify(chosen({ ...USUAL, ...settings })) !== JSON.stringify(chosen(this.made));
    this.view.textContent = !facts?.drive
      ? ""
      : `Drive in view: ${settings?.line ?? "its settings are not stored in the file"}${facts.drive.array_calibration ? `, array calibration ${facts.drive.array_calibration}` : ""}${facts.part ? ", one second; the rest is being solved" : ""}.${other ? " Solve makes a new drive with the settings above." : ""}`;
    this.play.disabled = !controls || !facts || facts.part || !playable(player);
    this.play.title = facts?.part
      ? "the drive is being solved"
      : !playable(player)
        ? "the array is not ready"
        : "Checks the exposure, then plays when you hold the button";
    const [correct, again] = this.otherAir.querySelectorAll("button");
    correct.disabled = this.play.disabled;
    again.disabled = this.solve.disabled;
    this.otherAir.tell(otherAir(this.link, facts?.drive?.air_c));
    this.add.disabled = !controls;
    for (const button of this.own) {
      const stays = row?.sample && button !== this.own[1];
      button.disabled = !controls || !row || stays;
      button.title = stays ? "samples stay as they are" : button.dataset.help;
    }
    const [edit, undo, redo, out] = this.editing,
      edits = this.link.state.edits ?? {};
    edit.disabled = out.disabled = !controls || !row;
    for (const [button, name] of [
      [undo, edits.undo],
      [redo, edits.redo],
    ]) {
      button.disabled = !controls || !name;
      button.title = name || button.dataset.help;
    }
    const solving = (this.link.state.jobs ?? []).find(
      job =>
        job.room === "reproduce" &&
        ["runs", "waits"].includes(job.state) &&
        this.take &&
        job.title.endsWith(this.take.name),
    );
    if (this.nothing)
      this.nothing.textContent = solving
        ? `being solved${solving.total ? `: ${Math.round((100 * solving.done) / solving.total)} %` : " …"}`
        : "not solved yet: press Solve";
  }
  _row(name) {
    return rowOf(this.link.state.takes, name);
  }
  /** Show the drives of the take in view; their settings are read once for each state of the
      files. */
  async _drives() {
    const name = this.take?.name,
      all = drivesOf(this._row(name && takeOf(name))),
      key = name && `${takeOf(name)} ${all.map(each => each.drive)}`;
    if (all.length > 1 && this.asked !== key) {
      this.asked = key;
      this.known = (await tried(this.link.order("reproduce", "drives", { take: name }))) ?? [];
      if (this.left) return;
    }
    const shown = this.take?.name;
    this.drives.replaceChildren(
      ...(shown
        ? driveButtons(this.studio, shown, ({ name: one }) => {
            const found = this.known?.find(each => each.name === one);
            return [
              driveLabel(one, found?.mode, found?.gain),
              found?.error === undefined ? "" : `E ${(100 * found.error).toFixed(1)} %`,
              found?.made,
            ];
          })
        : []),
    );
  }
  swap() {
    const other = this.take && otherDrive(this.link.state.takes, this.take.name, this.before);
    if (other && other !== this.take.name) this.studio.go("reproduce", other);
  }
  _takes(takes) {
    const shown =
      this.sort.value === "name"
        ? takes.toSorted(
            (a, b) =>
              a.sample - b.sample || a.name.localeCompare(b.name, undefined, { numeric: true }),
          )
        : takes;
    listed(
      this.list,
      shown.map(row =>
        make(
          "li",
          {},
          make(
            "a",
            {
              href: `#reproduce/${encodeURI(leadOf(row))}`,
              "data-take": row.name,
              "aria-current": row.name === takeOf(this.wish) ? "true" : null,
              onclick: () => {
                if (row.name === takeOf(this.wish) && !this.take) {
                  this._opening = "";
                  this._open(row.name);
                }
              },
            },
            make("span", {}, row.name.replace(/^sample:/, "").replace(/\.h5$/, "")),
            make(
              "small",
              {},
              row.sample
                ? "sample"
                : (["compared", "played", "solved"].find(what =>
                    [row, ...row.drives].some(each => each[what]),
                  ) ?? ""),
            ),
          ),
        ),
      ),
    );
    this._found();
    const first = takes.find(row => row.sample) ?? takes[0],
      name = this.wish || (first && leadOf(first)),
      row = this._row(name);
    if (
      name &&
      (row
        ? this.take?.name !== name || this.take.stamp !== row.stamp
        : takes.length && !this.take && !name.startsWith("sample:"))
    )
      this._open(name, this.transport ? this.transport.time : this.studio.address.time);
    if (!takes.length) this.about.textContent = "computing the samples …";
    this.control();
    this._drives();
  }
  /** Hide the takes without the searched words. */
  _found() {
    const words = this.search.value.toLowerCase().split(/\s+/);
    for (const item of this.list.children)
      item.hidden = !words.every(word => item.textContent.toLowerCase().includes(word));
    reached(this.list);
  }
  async _own(order, given = {}) {
    const take = await this.link.order("reproduce", order, { take: this.take.name, ...given });
    this.studio.go("reproduce", take);
  }
  _rename() {
    const name = make("input", {
      type: "text",
      value: shortly(takeOf(this.take.name)),
      maxLength: 100,
      required: true,
    });
    this._ask(
      `Rename ${shortly(takeOf(this.take.name))}`,
      "A name such as wool/felt puts it into the folder wool.",
      { name: ["New name", name, "Folder and name in this studio"] },
      "Rename",
      given => this._own("rename", given),
    );
    name.select();
  }
  /** A dialog with a form; `act` is called with the values of its inputs, and a refusal keeps the
      dialog open. */
  _ask(title, words, inputs, button, act, ...more) {
    const dialog = document.getElementById("replace"),
      refused = make("p.bad", { role: "alert", id: "refused" });
    const acts = async ({ target: { form } }) => {
      if (!form.checkValidity()) return;
      try {
        await act(
          Object.fromEntries(Object.entries(inputs).map(([name, [, { value }]]) => [name, value])),
        );
        if (form.isConnected) dialog.close();
      } catch (wrong) {
        refused.textContent = wrong.message;
      }
    };
    dialog.replaceChildren(
      make("h2", { id: "replace-title" }, title),
      make(
        "form",
        { onsubmit: event => event.preventDefault() },
        make(
          "div.column",
          { id: "replace-words" },
          make("p.quiet", {}, words),
          ...Object.values(inputs).map(([label, input, help]) => field(label, input, help)),
          ...more,
          refused,
        ),
        make(
          "div.buttons",
          {},
          buttonOf(button, title, acts, { class: "main", type: "submit" }),
          buttonOf("Cancel", "Changes nothing", () => dialog.close()),
        ),
      ),
    );
    openModal(dialog, this.link);
  }
  /** Edit the chosen part of the waveform: the result is another take, and Undo goes back. */
  async part(edit) {
    const { loop, rate, last } = this.transport ?? {};
    if (!loop?.on || !this.link.controls) return;
    const seconds = frame => `${(frame / rate).toFixed(4)}s`,
      start = loop.from > 0 ? seconds(loop.from) : "",
      end = loop.to < last ? seconds(loop.to) : "";
    const given = {
      "fade in": { edit: "fade", start: end || seconds(last + 1), end: "0s" },
      "fade out": { edit: "fade", start: "0s", end: seconds(last + 1 - loop.from) },
    }[edit] ?? { edit, start, end };
    await tried(this._own("edit", given));
  }
  /** Edit a whole take: the result is another take. */
  _edit() {
    const text = value => make("input", { type: "text", value, autocomplete: "off" });
    const others = (this.link.state.takes ?? [])
      .filter(row => row.name !== takeOf(this.take.name))
      .map(row => [row.name, shortly(row.name)]);
    const inputs = {
      edit: [
        "Edit",
        choice(
          [
            ["trim", "trim silence at both ends"],
            ["gain", "gain"],
            ["mask", "mask channels: silence them"],
            ["resample", "resample"],
            ...(others.length ? [["join", "join another take to the end"]] : []),
          ],
          "trim",
          () => fit(),
        ),
        "Step that makes the other take",
      ],
      by: ["By", text("6dB"), "A factor such as 2, or 6dB; -6dB weakens"],
      channels: ["Channels", text(String(this.transport.channel)), "Numbers from 0, such as 3,7"],
      rate: ["Rate", text("1kHz"), "Frames per second, such as 1kHz"],
      other: ["Take", choice(others, others[0]?.[0] ?? ""), "Follows the end of this one"],
    };
    const shown = {
        gain: ["by"],
        trim: [],
        mask: ["channels"],
        resample: ["rate"],
        join: ["other"],
      },
      seen = make("div", { id: "edit-preview", role: "status" }),
      { take } = this;
    const given = () =>
      Object.fromEntries(Object.entries(inputs).map(([name, [, input]]) => [name, input.value]));
    let turn = 0,
      timer = 0;
    /** Show the result before it is made. */
    const preview = () => {
      const mine = ++turn;
      clearTimeout(timer);
      timer = setTimeout(async () => {
        const refused = document.getElementById("refused");
        let parts = [],
          words = "";
        try {
          const course = await this.link.order("reproduce", "look", {
            take: take.name,
            ...given(),
          });
          parts = [
            make(
              "div.course",
              {},
              ...courseOf(course, `channel ${course.channel} over ${course.seconds.toFixed(2)} s`),
            ),
            make(
              "p.quiet",
              {},
              `preview: ${course.seconds.toFixed(3)} s, channel ${course.channel}, ${[Math.min(...course.least), Math.max(...course.greatest)].map(value => value.toPrecision(3)).join(" to ")} ${take.facts.unit}`,
            ),
          ];
        } catch (wrong) {
          words = wrong.message;
        }
        if (mine !== turn) return;
        seen.replaceChildren(...parts);
        refused.textContent = words;
      }, 200);
    };
    const fit = () => {
      const what = inputs.edit[1].value;
      for (const name of Object.keys(inputs).slice(1))
        inputs[name][1].closest(".field").hidden = !shown[what].includes(name);
      preview();
    };
    this._ask(
      `Edit ${shortly(takeOf(take.name))}`,
      "The result is another take; this one stays as it is.",
      inputs,
      "Make the take",
      asked => this._own("edit", asked),
      make("div.import", {}, seen),
    );
    for (const [, input] of Object.values(inputs).slice(1))
      input.addEventListener("change", preview);
    fit();
  }
  /** Keep what is written about the take, a moment after the last letter. */
  _note() {
    const name = takeOf(this.take.name),
      notes = {
        text: this.text.value,
        marks: Object.fromEntries(
          this.transport.marks.map(mark => [
            mark / this.transport.rate,
            this.names.get(mark) ?? "",
          ]),
        ),
      };
    for (const view of this.views.values()) view.facts.written = notes;
    clearTimeout(this.noting);
    this.noting = setTimeout(() => {
      if (this.link.controls) tried(this.link.order("reproduce", "note", { take: name, ...notes }));
    }, 600);
  }
  /** Show the marks of the take: time, name, and a way to remove it. */
  _marks() {
    const { transport } = this;
    if (!transport || transport.marks === this.marked) return;
    const known = this.marked !== undefined;
    this.marked = transport.marks;
    this.marks.replaceChildren(
      ...transport.marks.map(mark => {
        const at = `${(mark / transport.rate).toFixed(3)} s`;
        return make(
          "div.mark",
          {},
          buttonOf(at, "Goes to this mark", () => transport.seek(mark)),
          make("input", {
            type: "text",
            maxLength: 100,
            value: this.names.get(mark) ?? "",
            placeholder: "name",
            "aria-label": `name of the mark at ${at}`,
            title: "Kept in the folder beside the take",
            onchange: ({ target }) => {
              this.names.set(mark, target.value);
              this._note();
            },
          }),
          buttonOf(
            "×",
            "Removes this mark",
            () => transport.set({ marks: transport.marks.filter(each => each !== mark) }),
            { "aria-label": `remove the mark at ${at}` },
          ),
        );
      }),
    );
    if (known) this._note();
  }
  async undo(which) {
    if (!this.link.state.edits?.[which]) return;
    const take = await tried(this.link.order("reproduce", which));
    if (take) this.studio.go("reproduce", take);
  }
  _export() {
    const row = this._row(this.take.name),
      of = [
        ["", "the recording"],
        ...(row?.solved ? [["drive", "the drive"]] : []),
        ...(row?.played ? [["rerecorded", "the re-recording"]] : []),
        ["folder", "the whole folder, as a project"],
      ];
    const WAVES = [
        [".html", "page with pictures"],
        [".gif", "film, GIF"],
        [".mp4", "film, MP4"],
        [".csv", "CSV"],
        [".wav", "WAV, all channels"],
        [".flac", "FLAC, the chosen channel"],
        [".npz", "NumPy"],
        [".mat", "MATLAB"],
      ],
      DRIVE = [
        ...WAVES.slice(0, 3),
        [".npz", "NumPy: phases and levels"],
        [".json", "JSON: phases and levels"],
      ];
    const ending = choice(WAVES, ".html"),
      fit = what =>
        ending.replaceChildren(
          ...(
            {
              drive: DRIVE,
              folder: [[".zip", "one file, ZIP; Add a file opens it in another folder"]],
            }[what] ?? WAVES
          ).map(([value, words]) => make("option", { value }, words)),
        );
    this._ask(
      `Export ${shortly(this.take.name)}`,
      "The file is written into the folder exports of this studio.",
      {
        of: ["Of", choice(of, "", ({ target }) => fit(target.value)), "Part of the take to write"],
        ending: ["As", ending, "Format; a page and a film have pictures"],
      },
      "Export",
      given =>
        given.of === "folder"
          ? this.link.order("reproduce", "pack")
          : this.link.order("reproduce", "export", {
              take: this.take.name,
              channel: this.transport.channel,
              ...given,
            }),
    );
  }
  _exported(name) {
    if (!name || name === this.out) return;
    this.out = name;
    const note = make(
      "div.toast",
      {},
      "written: ",
      make(
        "a",
        { href: `/file/${encodeURI(name)}`, id: "exported", download: name.split("/").at(-1) },
        name,
      ),
    );
    document.getElementById("toasts").append(note);
    setTimeout(() => note.remove(), 20000);
  }
  async _delete() {
    const name = takeOf(this.take.name),
      folder = await tried(this.link.order("reproduce", "delete", { take: name }));
    if (!folder) return;
    const undo = async () => {
      const take = await tried(this.link.order("reproduce", "restore", { take: folder }));
      if (!take) return;
      note.remove();
      this.wish = this._opening = "";
      this.studio.go("reproduce", take);
    };
    const note = make(
      "div.toast",
      {},
      `${name} and its drives are in the folder bin/${folder} `,
      buttonOf("Undo", "Moves the take and its drives back", undo, { id: "undo" }),
    );
    document.getElementById("toasts").append(note);
    setTimeout(() => note.remove(), 20000);
    this._nothing("");
    [this.wish, this.take] = ["", null];
    this.studio.go("reproduce");
    // the list without it may still be on its way
    this._takes((this.link.state.takes ?? []).filter(row => row.name !== name));
  }
  async _open(name, time) {
    const opening = `${name} ${this._row(name)?.stamp}`,
      over = () => opening !== this._opening || this.left;
    if (this.left || opening === this._opening) return;
    this._opening = opening;
    this.wish = name;
    for (const link of this.list.querySelectorAll("a"))
      if (link.dataset.take === takeOf(name)) link.setAttribute("aria-current", "true");
      else link.removeAttribute("aria-current");
    reached(this.list);
    // Never show pictures of another take, not even while the named one loads.
    const sibling = this.take && takeOf(this.take.name) === takeOf(name);
    if (!sibling) {
      this._nothing(`opening ${shortly(name)} …`);
      this._forget();
    }
    let facts,
      inferno,
      twilight,
      kept = this.views.get(name);
    if (kept && kept.stamp !== this._row(name)?.stamp) kept = null;
    try {
      facts = kept?.facts ?? (await this.link.order("reproduce", "open", { take: name }));
      [inferno, twilight] = await Promise.all([colours("inferno"), colours("twilight")]);
    } catch (wrong) {
      if (over()) return;
      if (this.link.open) this._refused(name, wrong.message);
      else this._opening = ""; // requested again with the next state
      return;
    }
    if (over()) return;
    const before = this.transport,
      same = before && sibling,
      was = JSON.stringify(this.take?.facts.drive?.settings);
    if (this.take && this.take.name !== name) this.before = this.take.name;
    this._nothing("");
    if (this.views.get(name) !== kept) this.views.get(name)?.close();
    const view = kept ?? new TakeView(name, facts, () => this._came());
    this.views.set(name, view);
    const transport = new Transport({ frames: facts.frames, rate: facts.rate_hz });
    if (same)
      Object.assign(transport, {
        playing: before.playing,
        speed: before.speed,
        loop: before.loop,
        marks: before.marks,
        channel: before.channel,
        span: before.span,
      });
    else transport.channel = facts.rows > 2 ? 10 : 0;
    transport.channels = facts.rows * facts.columns;
    this.take = Object.assign(view, { stamp: facts.stamp, transport, pictures: [] });
    if (same && !Number.isFinite(time)) ({ time } = before);
    if (Number.isFinite(time)) {
      const plays = transport.playing;
      transport.seek(time * transport.rate);
      if (!same) transport.playing = plays && !this.studio.address.time;
    }
    if (!same || (facts.drive && JSON.stringify(facts.drive.settings) !== was))
      this._fill({
        ...facts.drive?.settings,
        ...(facts.drive?.settings?.mode === "" ? USUAL : {}),
      });
    this._pictures(inferno, twilight);
    this._about();
    const { written: notes } = facts;
    if (!same) {
      this.names = new Map(
        Object.entries(notes.marks).map(([time, name]) => [
          Math.round(time * transport.rate),
          name,
        ]),
      );
      transport.marks = [...this.names.keys()].sort((a, b) => a - b);
      this.marked = undefined;
      this.text.value = notes.text;
    }
    this._marks();
    transport.addEventListener("change", () => {
      this._marks();
      if (!transport.playing) this._address();
      this._frame();
    });
    transport.run(state => this._draw(state));
    this._takes(this.link.state.takes ?? []);
    if (kept) this._came();
  }
  /** Close the loaded drives of a take. */
  _forget() {
    for (const view of this.views.values()) view.close();
    this.views.clear();
    this.before = "";
  }
  /** Remove pictures and texts of the previous take. */
  _nothing(words) {
    this._close();
    this.studio.footer.hidden = true;
    this.problem.hidden = true;
    for (const picture of this.pictures) picture.hidden = false;
    for (const part of [this.frame, this.about, ...Object.values(this.boxes)])
      part.replaceChildren();
    if (words) this.boxes.wanted.append(make("div.nothing", { role: "status" }, words));
    this.nothing = this.played = this.phase = null;
    this.control();
  }
  /** Show the reason why a take cannot be opened, in place of its pictures. */
  _refused(name, reason) {
    this._nothing("");
    for (const picture of this.pictures) picture.hidden = true;
    this.problem.hidden = false;
    this.problem.replaceChildren(
      make("h2", {}, `${shortly(name)} cannot be opened`),
      make("p", {}, reason.replace(`${this.link.state.studio?.folder}/`, "")),
      make(
        "div.buttons",
        {},
        buttonOf("Close", "Closes this message", () => this._nothing("choose a take")),
      ),
    );
  }
  _pictures(inferno, twilight) {
    const { take, boxes, panels } = this,
      { facts, transport } = take,
      drive = facts.drive;
    const seek = frame => transport.seek(frame),
      choose = channel => transport.set({ channel }),
      zoom = factor => transport.zoom(factor);
    const cells = { rows: facts.rows, columns: facts.columns, pitch: facts.pitch_mm };
    const side = drive?.rows ?? 16,
      place = { pitch: drive?.pitch_mm ?? 11 / 3, x: drive?.x_mm ?? 0, y: drive?.y_mm ?? 0 };
    const map = {
      rows: side,
      columns: drive?.columns ?? side,
      place,
      unit: "Pa",
      colours: inferno,
      phaseColours: twilight,
    };
    const fine = drive
      ? { down: Float32Array.from(drive.down), across: Float32Array.from(drive.across) }
      : {};
    this.wanted = new FieldPicture(boxes.wanted, {
      ...map,
      label: "Target sound",
      track: take.wanted,
      cells,
    });
    this.bar = new BarPicture(boxes.bar, {
      label: "Scale",
      colours: inferno,
      phaseColours: twilight,
      unit: "Pa",
    });
    take.pictures = [
      this.wanted,
      this.bar,
      new TracesPicture(boxes.traces, {
        label: "Cells",
        track: take.samples,
        choose,
        seek,
        zoom,
        show: (from, to) => {
          transport.pause();
          transport.seek((from + to) / 2);
          transport.set({ span: Math.max(16, to - from) / facts.rate_hz });
        },
      }),
      new SpectrogramPicture(boxes.spectrogram, {
        label: "Spectrogram",
        track: take.samples,
        colours: inferno,
      }),
      new OverviewPicture(this._footer(transport), {
        label: "The whole take",
        track: take.samples,
        seek,
        frames: facts.frames,
        zoom,
        select: (from, to) => transport.setLoop({ from, to, on: true }),
      }),
    ];
    this.nothing = null;
    if (drive) {
      this.played = new FieldPicture(boxes.played, {
        ...map,
        ...fine,
        label: "Played sound, simulated",
        track: take.played,
        cells,
      });
      this.phase = new FieldPicture(boxes.phase, {
        ...map,
        ...fine,
        label: "Phase of the field",
        track: take.played,
      });
      take.pictures.push(
        this.played,
        new PhasesPicture(boxes.array, {
          label: "Phases of the array",
          track: take.phaseRows,
          colours: twilight,
          positions: drive.positions_mm,
        }),
      );
    } else {
      this.played = this.phase = null;
      this.nothing = make("div.nothing", { role: "status" }, "");
      boxes.played.append(this.nothing);
      for (const name of ["phase", "array"])
        boxes[name].append(make("div.nothing", {}, "available after solving"));
    }
    panels.wanted.aside.textContent = `${map.rows} × ${map.columns}, ${facts.rows} × ${facts.columns} cells`;
    panels.played.aside.textContent = drive
      ? `simulated, ${fine.down.length / map.rows} × ${fine.across.length / map.columns}`
      : "";
    panels.array.aside.textContent = drive ? `phases of ${drive.transducers} transducers` : "";
    panels.spectrogram.aside.textContent = `channel ${transport.channel}`;
    panels.traces.aside.textContent = "";
    panels.traces.querySelector("h2").textContent = `${transport.channels} cells, ${facts.unit}`;
    this.control();
  }
  _footer(transport) {
    const { footer } = this.studio,
      overview = make("div.box");
    const bar = make("div.row");
    footer.replaceChildren(overview, bar);
    footer.hidden = false;
    controls(transport, bar);
    const key = (...words) => make("span", {}, ...words);
    const part = make(
      "div.buttons",
      { id: "part", role: "group", "aria-label": "chosen part" },
      ...[
        ["cut", "Keep", "Makes a take of the chosen part"],
        ["delete", "Delete", "Makes a take without the chosen part: key Delete"],
        ["fade in", "Fade in", "Makes a take that fades in up to the end of the part"],
        ["fade out", "Fade out", "Makes a take that fades out from the start of the part"],
      ].map(([edit, words, title]) => buttonOf(words, title, () => this.part(edit))),
    );
    const shown = () => {
      const { loop, last } = transport;
      part.hidden = !loop.on || (loop.from === 0 && loop.to >= last) || !this.link.controls;
    };
    transport.addEventListener("change", shown);
    shown();
    bar.append(
      part,
      make(
        "span.keys",
        {},
        key(make("kbd", {}, ","), " ", make("kbd", {}, "."), " one frame"),
        key(make("kbd", {}, "M"), " mark"),
        key(make("kbd", {}, "?"), " keys"),
        buttonOf("Show the code", "Commands and Python that do the same", () => this._code()),
      ),
    );
    return overview;
  }
  _came() {
    if (!this.take?.pictures.length) return;
    const { wanted, played } = this.take,
      top = Math.max(wanted.top, played.top);
    this.wanted.top = top;
    if (this.played) {
      this.played.top = top;
      this.phase.top = top;
    }
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
    const { frame, channel, span } = take.transport,
      drive = take.facts.drive,
      peak = this.played?.peak ?? this.wanted?.peak;
    const error = 100 * drive?.error[frame];
    this.frame.replaceChildren(
      rows([
        ["Strength", drive?.strength[frame]?.toFixed(3) ?? "–"],
        ["E", error >= 0 ? `${error.toFixed(1)} %` : "–"],
        ["Peak", peak ? `${Math.round(peak.value)} Pa` : "–"],
        ["Place of peak", peak ? `${peak.x.toFixed(0)}, ${peak.y.toFixed(0)} mm` : "–"],
      ]),
    );
    this.panels.spectrogram.aside.textContent = `channel ${channel}, 0 to ${Math.min(1000, take.facts.rate_hz / 2)} Hz`;
    this.panels.traces.aside.textContent =
      `${span >= 1 ? span.toPrecision(2) : span.toFixed(3)} s around the playhead; channel ` +
      `${channel} chosen`;
  }
  _about() {
    const { facts } = this.take,
      said = [facts.source];
    if (facts.simulated) said.push("SIMULATED");
    if (facts.frames_in_all > facts.frames)
      said.push(
        `the first ${this.take.seconds} s of ${(facts.frames_in_all / facts.rate_hz).toFixed(0)} s are shown`,
      );
    if (!facts.calibrated && facts.unit !== "Pa") said.push("not calibrated");
    said.push(
      ...facts.report,
      ...facts.journal
        .filter(event => event.kind !== "stroke")
        .slice(0, 6)
        .map(event => event.said),
    );
    this.about.replaceChildren(...said.map(words => make("div", {}, words)));
  }
  _address() {
    if (this.take && this.transport && this.studio.room === this && !this.transport.playing)
      this.studio.here(this.take.name, this.transport.time);
  }
  _close() {
    if (!this.take) return;
    this.take.transport.stop();
    for (const picture of [...this.take.pictures, this.phase]) picture?.remove();
    for (const box of Object.values(this.boxes)) box.replaceChildren();
    this.take.pictures = [];
    this.take = null;
  }
  async _solve() {
    const answer = await solveTake(this.link, {
      take: this.take.name,
      ...chosen(this.made),
      ...(this.take.seconds > 1.5 && this.take.facts.drive
        ? { visible_s: Math.max(0, Math.min(this.take.seconds - 1, this.transport.time - 0.5)) }
        : {}),
    });
    if (answer && this.take && answer.take !== this.take.name)
      this.studio.go("reproduce", answer.take);
  }
  _play(correct = false) {
    askToPlay(this.studio, this.take.name, correct, { take: this.take.name, ...chosen(this.made) });
  }
  /** Show the code for the drive in view or, without one, for the settings of the form. */
  async _code() {
    const { name, facts } = this.take,
      device = facts.drive?.array_calibration ? ` --device ${this.link.state.player?.device}` : "",
      take = takeOf(name),
      sample = take.startsWith("sample:"),
      file = sample ? `${take.slice(7)}.h5` : take,
      label = name.slice(take.length + 1),
      stem = file.replace(/\.\w+$/, "") + (label && `.${label}`),
      seconds = (facts.frames / facts.rate_hz).toFixed(1);
    const made =
      facts.drive?.settings ??
      (await tried(this.link.order("reproduce", "code", { take: name, ...chosen(this.made) })));
    if (!made) return;
    const first =
      take === "sample:orbit"
        ? "# Duplicate writes orbit.h5 into the folder\n"
        : sample
          ? `midair record virtual:${take.slice(7)} ${file} --duration ${seconds}s\n`
          : "";
    this.studio.code(
      "The same, as code",
      `${first}midair solve ${file}${label && ` ${stem}.drive.h5`} ${made.options || `--settings ${stem}.drive.h5`}${device}\nmidair play ${stem}.drive.h5\nmidair compare ${file} ${stem}.rerecorded.h5`,
      `import midair\nfrom midair.pipeline import calibrated_pressure, required_lead, reproduce\nfrom midair.settings import ${made.python.startsWith("MODES") ? "MODES" : "Settings"}\nfrom midair.targets import add_lead\n\ntake = ${sample && first[0] !== "#" ? `midair.record("virtual:${take.slice(7)}", ${seconds})` : `midair.open_take("${file}")`}\nsettings = ${made.python}\npressure = add_lead(calibrated_pressure(take.recording, take.calibration, settings), required_lead(settings))\nmade = reproduce(pressure, midair.TransducerArray.autd3(), settings)\nplayed = midair.play(made.solution, "virtual")\nprint(made, played)`,
    );
  }
}

const shortly = name => name.replace(/^sample:/, "").replace(/\.h5(?=@|$)/, "");
