/* A take in the page: its facts and its frames, loaded second by second. */

import { buttonOf, make, panel, rows } from "/web/dom.js";
import { Track, Colours, decode } from "/web/view.js";

const tables = new Map();
export async function colours(name) {
  if (!tables.has(name))
    tables.set(
      name,
      fetch(`/colours/${name}`)
        .then(answer => answer.arrayBuffer())
        .then(bytes => new Colours(new Uint8Array(bytes))),
    );
  return tables.get(name);
}

export class TakeView {
  constructor(name, facts, changed) {
    Object.assign(this, { name, facts, changed });
    this.given = new AbortController();
    const { frames, rate_hz: rate, unit } = facts;
    this.samples = new Track({ rate, capacity: frames, unit, name: "samples" });
    this.wanted = new Track({ rate, capacity: frames, unit: "Pa", name: "wanted" });
    this.played = new Track({ rate, capacity: frames, unit: "Pa", name: "played" });
    this.phases = new Track({ rate, capacity: frames, unit: "rad", name: "phases" });
    this.whole = this._load(Math.ceil(frames / rate));
  }
  get seconds() {
    return this.facts.frames / this.facts.rate_hz;
  }
  close() {
    this.given.abort();
  }
  async _load(seconds) {
    const streams = ["samples", "wanted", ...(this.facts.drive ? ["played", "phases"] : [])];
    try {
      for (let second = 0; second < seconds; second++)
        await Promise.all(
          streams.map(async stream => {
            for (const section of await sections(stream, this.name, second, this.given.signal))
              this[stream].add(section);
            this.changed();
          }),
        );
    } catch (wrong) {
      if (wrong.name !== "AbortError") this.problem = wrong.message;
      this.changed();
    }
  }
  /** Phases of the transducers as counts, for the picture of the array. */
  get phaseRows() {
    const { phases } = this;
    return {
      at(frame) {
        if (!phases.has(frame)) return null;
        const slot = frame % phases.capacity;
        return phases.values.subarray(slot * phases.width, (slot + 1) * phases.width);
      },
    };
  }
}

/** The name of a take without the label of one of its drives: NAME@paper is the drive of another
    mode. */
export const takeOf = name => name.replace(/@[a-z]+(-\d+)?$/, "");

/** The row of a take, or of one of its drives; a drive that does not exist yet has a row of its
    own. */
export function rowOf(takes, name = "") {
  const row = takes?.find(each => each.name === takeOf(name));
  return !row || row.name === name
    ? row
    : {
        ...row,
        solved: false,
        drive: "",
        played: false,
        compared: false,
        report: false,
        ...(row.drives.find(each => each.name === name) ?? { name, stamp: "" }),
      };
}

/** A list of takes with one stop of the Tab key: arrows, Home and End go from take to take. */
export function takesList() {
  return make("ul.takes", {
    onkeydown: event => {
      const links = [...event.currentTarget.querySelectorAll("li:not([hidden]) a")],
        at = links.indexOf(document.activeElement);
      const next = {
        ArrowDown: links[at + 1],
        ArrowUp: links[at - 1],
        Home: links[0],
        End: links.at(-1),
      }[event.key];
      if (!next) return;
      event.preventDefault();
      links[at].tabIndex = -1;
      next.tabIndex = 0;
      next.focus();
    },
  });
}

/** The one take of a list that the Tab key reaches: the chosen one, or else the first that is
    not hidden. */
export function reached(list) {
  const links = [...list.querySelectorAll("li:not([hidden]) a")],
    one = links.find(link => link.hasAttribute("aria-current")) ?? links[0];
  for (const link of list.querySelectorAll("a")) link.tabIndex = link === one ? 0 : -1;
}

/** Fill a list of takes anew; a link of it that had the focus keeps it. */
export function listed(list, items) {
  const had = list.contains(document.activeElement) && document.activeElement.hash;
  list.replaceChildren(...items);
  reached(list);
  const one = had && [...list.querySelectorAll("a")].find(link => link.hash === had);
  if (one) one.focus();
}

/** What tells the drives of a take apart: the label of its name or else its mode, and its gain. */
export function driveLabel(name, mode, gain) {
  return `${name.slice(takeOf(name).length + 1) || mode || "first"}${gain && gain !== 1 ? `, gain ${Number(gain.toPrecision(3))}` : ""}`;
}

/** Every drive of a row, and the name under which a take is opened. */
export const drivesOf = row => [...(row?.solved ? [row] : []), ...(row?.drives ?? [])];
export const leadOf = row => (drivesOf(row)[0] ?? row).name;

/** Buttons for the drives of a take, with a figure each; none for a single one. */
export function driveButtons(studio, name, figure) {
  const row = rowOf(studio.link.state.takes, takeOf(name)),
    all = drivesOf(row);
  return all.length < 2
    ? []
    : [
        make("p.quiet", {}, "Drives of this take ", make("kbd", {}, "B")),
        make(
          "div.drives",
          { role: "group", "aria-label": "Drives of this take" },
          ...all.map(each => {
            const [label, said, title] = figure(each);
            return buttonOf(
              [make("strong", {}, label), ...(said ? [` ${said}`] : [])],
              title,
              () => studio.go(studio.name, each.name),
              { "aria-pressed": each.name === name ? "true" : "false" },
            );
          }),
        ),
      ];
}

/** The drive that was in view before, or else the next one: the other side of A/B. */
export function otherDrive(takes, name, before) {
  const all = drivesOf(rowOf(takes, takeOf(name))).map(each => each.name),
    at = all.indexOf(name);
  return all.includes(before) && before !== name ? before : (all[(at + 1) % all.length] ?? name);
}

/** The settings that differ from the mode, as a request needs them. */
export function chosen({ mode, mapping, method, level, gain, height_mm, ears_db }) {
  return Object.fromEntries(
    Object.entries({ mode, mapping, method, level, gain, height_mm, ears_db }).filter(
      ([, value]) => value !== "" && value !== undefined,
    ),
  );
}

/** Load one second of a stream. */
export async function sections(stream, take, second, signal) {
  const answer = await fetch(`/frames/${stream}/${second}?take=${encodeURIComponent(take)}`, {
    signal,
  });
  if (!answer.ok) throw new Error((await answer.text()).trim());
  return decode(await answer.arrayBuffer());
}

/** A panel with players of the sum of the cells: of a recording, and of what a drive came to. */
export function listening(link) {
  const sounds = Object.fromEntries(
      ["original", "re-recorded"].map(words => [
        words === "original" ? words : "again",
        make("audio", {
          controls: true,
          preload: "none",
          "aria-label": `sum of the cells, ${words}`,
        }),
      ]),
    ),
    lines = Object.entries(sounds).map(([name, audio]) =>
      make("div", {}, make("span.quiet", {}, name === "again" ? "re-recorded" : name), audio),
    ),
    shown = panel("Listen", "sum of the cells, one level", ...lines);
  const tell = name => {
    const row = rowOf(link.state.takes, name);
    shown.hidden = !row;
    lines[1].hidden = !row?.compared;
    for (const [stream, audio] of Object.entries(sounds)) {
      const src =
          row && (row.compared || stream === "original")
            ? `/sound/${stream}?take=${encodeURIComponent(name)}&stamp=${row.stamp}`
            : "",
        { currentTime, paused } = audio;
      if ((audio.getAttribute("src") ?? "") === src) continue;
      if (!src) {
        audio.removeAttribute("src");
        audio.load();
        continue;
      }
      audio.src = src;
      audio.currentTime = currentTime; // both sides of A/B go on from the same moment
      if (!paused) audio.play().catch(() => {});
    }
  };
  return { sounds, shown, tell };
}

/** The lines of the verdict on a take that was compared, or else those predicted for a drive. */
export function verdictOf(link, name, drive) {
  const found = rowOf(link.state.takes, name)?.compared && link.state.comparisons?.[name],
    lines = (found || drive)?.verdict?.map(([name, text]) =>
      make("div", {}, make("small.quiet", {}, name), make("strong", {}, text)),
    );
  return found?.simulated ? [...lines, make("strong.simulated", {}, "SIMULATED")] : (lines ?? []);
}

/** What a simulation of the whole palm found for a drive; nothing once the drive is replaced. */
export function palmFound(link, name) {
  const palm = link.state.palms?.[name];
  return palm && palm.stamp === rowOf(link.state.takes, name)?.drive
    ? [
        make("h3", {}, "Pressure on the whole palm ", make("strong.simulated", {}, "SIMULATED")),
        rows(palm.rows),
        make(
          "p.quiet",
          {},
          `${palm.palm}, ${palm.seconds.toPrecision(2)} s; signal-to-distortion ratio on ` +
            "flat model skins, soft and stiff, on bone and deep: a simulation, without " +
            "participants",
        ),
      ]
    : [];
}
