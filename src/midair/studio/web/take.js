/* A take in the page: its facts and its frames, loaded second by second. */

import { Track, Colours, decode } from "/web/view.js";

const tables = new Map();
export async function colours(name) {
  if (!tables.has(name)) tables.set(name, fetch(`/colours/${name}`).then((answer) => answer.arrayBuffer()).then((bytes) => new Colours(new Uint8Array(bytes))));
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
  get seconds() { return this.facts.frames / this.facts.rate_hz; }
  close() { this.given.abort(); }
  async _load(seconds) {
    const streams = ["samples", "wanted", ...(this.facts.drive ? ["played", "phases"] : [])];
    try {
      for (let second = 0; second < seconds; second++)
        await Promise.all(streams.map(async (stream) => {
          for (const section of await sections(stream, this.name, second, this.given.signal)) this[stream].add(section);
          this.changed();
        }));
    } catch (wrong) { if (wrong.name !== "AbortError") this.problem = wrong.message; this.changed(); }
  }
  /** Phases of the transducers as counts, for the picture of the array. */
  get phaseRows() {
    const { phases } = this;
    return { at(frame) {
      if (!phases.has(frame)) return null;
      const slot = frame % phases.capacity;
      return phases.values.subarray(slot * phases.width, (slot + 1) * phases.width);
    } };
  }
}

/** The settings that differ from the mode, as a request needs them. */
export function chosen({ mode, mapping, method, level, gain, height_mm, ears_db }) {
  return Object.fromEntries(Object.entries({ mode, mapping, method, level, gain, height_mm, ears_db }).filter(([, value]) => value !== "" && value !== undefined));
}

/** Load one second of a stream. */
export async function sections(stream, take, second, signal) {
  const answer = await fetch(`/frames/${stream}/${second}?take=${encodeURIComponent(take)}`, { signal });
  if (!answer.ok) throw new Error((await answer.text()).trim());
  return decode(await answer.arrayBuffer());
}
