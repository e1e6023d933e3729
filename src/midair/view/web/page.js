import {
  BarPicture,
  CellsPicture,
  Colours,
  FieldPicture,
  OverviewPicture,
  PhasesPicture,
  SparseTrack,
  SpectrogramPicture,
  Track,
  TracesPicture,
  bytesOf,
  decode,
} from "./view.js";
import { Transport, controls } from "./transport.js";

/* A whole view of one take: its pictures in a grid and a transport below. `about` is the metadata
   of view/frame_encoding.py, `bytes` the sections of each track by name: samples, again, wanted,
   played, phases. */

export function mount(root, about, bytes) {
  const tracks = Object.fromEntries(
    about.tracks.map(({ name, sparse, ...rest }) => {
      const track = sparse
        ? new SparseTrack()
        : new Track({ rate: about.rate, capacity: about.frames, name, ...rest });
      for (const section of decode(bytes[name])) track.add(section);
      return [name, track];
    }),
  );
  const colours = Object.fromEntries(
    Object.entries(about.colours).map(([name, text]) => [name, new Colours(bytesOf(text))]),
  );
  const floats = text => {
    const raw = bytesOf(text);
    return new Float32Array(raw.buffer);
  };
  const still = root.dataset.start === "paused" || undefined;
  const transport = new Transport({
    frames: about.frames,
    rate: about.rate,
    first: about.first,
    still,
  });
  transport.set({ channel: about.channel, channels: about.channels, marks: about.marks });
  root.classList.add("view");
  const grid = element(root, "div", "view-grid"),
    pictures = [],
    seek = frame => transport.seek(frame),
    choose = channel => transport.set({ channel });
  let group = grid; // pictures that share a scale stay together
  const show = (title, note, kind, make) => {
    const figure = element(group, "figure", `view-${kind}`),
      caption = element(figure, "figcaption");
    element(caption, "b").textContent = title;
    const words = element(caption, "span");
    words.textContent = note;
    const picture = make(element(figure, "div", "view-box"), title);
    pictures.push(picture);
    return { picture, words };
  };
  const { samples, again, wanted, played, phases } = tracks,
    { sensor, field } = about;
  const top = Math.max(wanted?.top ?? 0, played?.top ? about.top : 0),
    maps = { colours: colours.inferno, phaseColours: colours.twilight, top };
  if (wanted || played) group = element(grid, "div", "view-group");
  if (wanted)
    show(
      "Target",
      `${field.rows} × ${field.columns}, Pa of sound`,
      "map",
      (box, label) =>
        new FieldPicture(box, { label, track: wanted, ...field, ...maps, cells: sensor }),
    );
  if (played) {
    const finer = { down: floats(field.down), across: floats(field.across) };
    const fine = (title, note, phase) =>
      show(title, note, "map", (box, label) => {
        const picture = new FieldPicture(box, {
          label,
          track: played,
          ...field,
          ...maps,
          ...finer,
          unit: "Pa",
          cells: sensor,
        });
        return phase === undefined ? picture : Object.assign(picture, { fixed: { phase } });
      });
    fine(about.played, `${4 * field.rows} × ${4 * field.columns}, Pa of sound`);
    fine("Phase of the field", "where louder than 5 %", true);
  }
  if (wanted || played)
    show(
      "Pa",
      "",
      "bar",
      (box, label) =>
        new BarPicture(box, {
          label,
          colours: colours.inferno,
          phaseColours: colours.twilight,
          top,
        }),
    );
  if (samples) {
    const most = Math.max(samples.top, again?.top ?? 0),
      place = { pitch: sensor.pitch, x: 0, y: 0 };
    group = element(grid, "div", "view-group");
    const cells = (track, title) =>
      show(
        title,
        `${sensor.rows} × ${sensor.columns} cells, ${track.unit}`,
        "map",
        (box, label) =>
          new CellsPicture(box, {
            label,
            track,
            colours: colours.inferno,
            top: most,
            rows: sensor.rows,
            columns: sensor.columns,
            place,
            unit: track.unit,
          }),
      );
    cells(samples, samples.label);
    if (again) cells(again, again.label);
    show(
      samples.unit,
      "",
      "bar",
      (box, label) =>
        new BarPicture(box, { label, colours: colours.inferno, top: most, unit: samples.unit }),
    );
  }
  group = grid;
  if (phases)
    show(
      "Array",
      `phases of ${about.positions.length / 2} transducers`,
      "map",
      (box, label) =>
        new PhasesPicture(box, {
          label,
          track: phases,
          colours: colours.twilight,
          positions: about.positions,
        }),
    );
  if (samples) {
    const legend = again ? `${samples.label} behind, ${again.label} in front` : samples.label;
    show(
      `Every channel, ${samples.unit}`,
      `${legend}; around the playhead`,
      "traces",
      (box, label) => new TracesPicture(box, { label, track: samples, over: again, seek, choose }),
    );
    const { words } = show(
      "Spectrogram",
      "",
      "spectrogram",
      (box, label) =>
        new SpectrogramPicture(box, { label, track: samples, colours: colours.inferno }),
    );
    const tell = () => {
      words.textContent = `${samples.label}, channel ${transport.channel}, Hz over time, 60 dB`;
    };
    transport.addEventListener("change", tell);
    tell();
  }
  show(
    "Whole take",
    "click or drag to move the playhead",
    "overview",
    (box, label) =>
      new OverviewPicture(box, {
        label,
        track: samples ?? played ?? wanted,
        seek,
        frames: about.frames,
      }),
  );
  const bar = controls(transport, root);
  if (colours.cividis)
    toggle(bar, "Cividis", on =>
      paintIn(
        pictures,
        on ? [colours.inferno, colours.cividis] : [colours.cividis, colours.inferno],
      ),
    );
  keys(transport, root);
  if (about.simulated) {
    root.classList.add("view-simulated");
    const mark = element(root, "span", "view-mark");
    mark.textContent = "SIMULATED";
  }
  // show a loud frame while paused
  if (!transport.playing) transport.seek(loudest(samples ?? played ?? wanted));
  const draw = state => {
    for (const picture of pictures)
      picture.draw(picture.fixed ? { ...state, ...picture.fixed } : state);
  };
  transport.run(draw);
  return { transport, pictures, tracks };
}

/** Mount the data of a page of view/pages.py into its element. */
export function mountInlined(root) {
  const held = name => root.querySelector(`script[data-name="${name}"]`).textContent;
  const about = JSON.parse(held("about"));
  return mount(
    root,
    about,
    Object.fromEntries(about.tracks.map(({ name }) => [name, bytesOf(held(name))])),
  );
}

/** Replace the colour table in every picture that uses the first of the two. */
function paintIn(pictures, [before, after]) {
  for (const picture of pictures) {
    if (picture.colours !== before) continue;
    picture.colours = after;
    picture.columns?.clear?.(); // the spectrogram caches its columns as colours
    picture.draw();
  }
}

function toggle(bar, label, act) {
  const made = element(bar, "button");
  made.type = "button";
  made.textContent = label;
  made.setAttribute("aria-pressed", false);
  made.addEventListener("click", () => {
    const on = made.getAttribute("aria-pressed") === "false";
    made.setAttribute("aria-pressed", on);
    act(on);
  });
}

function loudest(track) {
  let at = track.first;
  for (let frame = track.first; frame < track.last; frame++)
    if (track.loudness(frame) > track.loudness(at)) at = frame;
  return at;
}

function keys(transport, root) {
  root.tabIndex = -1;
  // the whole page, or one element of a page
  const alone = root.dataset.keys === "page" ? root.ownerDocument : root;
  alone.addEventListener("keydown", event => {
    const { target } = event;
    if (
      event.defaultPrevented ||
      target.closest?.("input, textarea, select, [contenteditable]") ||
      (event.key === " " && target.closest?.("button, summary, a, audio, video"))
    )
      return;
    if (transport.press(event)) {
      event.preventDefault();
      event.stopPropagation();
    }
  });
}

function element(parent, name, className = "") {
  const made = parent.ownerDocument.createElement(name);
  if (className) made.className = className;
  parent.append(made);
  return made;
}
