/* The palm that a tracker reports: from above, from the side, and in words. */

import { make } from "/web/dom.js";

export const drawn = (tag, given) => {
  const made = document.createElementNS("http://www.w3.org/2000/svg", tag);
  for (const [name, value] of Object.entries(given)) made.setAttribute(name, value);
  return made;
};
const at = place => `(${place.map(value => value.toFixed(0)).join(", ")}) mm`;

/** An element that shows the palm of the state; off() ends it. */
export function palmView(link) {
  const words = make("p", { id: "palm-words" }),
    said = make("p.quiet", { id: "palm-said", role: "status" });
  const pictures = [
    ["from above", 0, 1, "y"],
    ["from the side", 0, 2, "z"],
  ].map(([name, across, up, axis]) => {
    const picture = drawn("svg", {
      viewBox: "-80 -68 160 136",
      role: "img",
      "aria-label": `palm ${name}`,
    });
    return { across, up, axis, name, picture };
  });
  const box = make(
    "div.palm",
    { id: "palm", hidden: true },
    ...pictures.map(({ name, picture }) =>
      make(
        "figure",
        {},
        picture,
        make("figcaption.quiet", {}, `${name}; dot: measured, diamond: predicted`),
      ),
    ),
    make("div", {}, words, said),
  );
  let spoken = "";
  box.off = link.on("palm", palm => {
    box.hidden = !palm;
    if (!palm) return;
    const { place, predicted, solved, inside, sure } = palm,
      follows = inside && sure;
    const refused = Object.entries(palm.refused)
      .map(([kind, count]) => `${count} ${kind}`)
      .join(", ");
    words.textContent = !place
      ? `${palm.tracker}: ${palm.state}, no palm yet`
      : `Palm at ${at(place)}, tilted ${palm.tilt.toFixed(0)}°, ` +
        `${inside ? "in the box" : "outside the box"}; predicted at ${at(predicted)}. ` +
        `Confidence ${palm.confidence.toFixed(2)}. Tracker: ${palm.state}, ${palm.rate} ` +
        `poses/s, ${palm.latency_ms.toFixed(0)} ms ` +
        `late.${refused ? ` Reported: ${refused}.` : ""}`;
    // Read aloud only when it changes, not 15 times a second.
    const now =
      palm.said ||
      (!place
        ? "waiting for a palm"
        : follows
          ? "the palm can be followed"
          : inside
            ? "not sure of the palm: silent"
            : "outside the box: silent");
    if (now !== spoken) said.textContent = spoken = now;
    words.className = follows ? "good" : "bad";
    for (const { across, up, axis, picture } of pictures) {
      const point = of => [of[across] - solved[across], solved[up] - of[up]],
        [width, height] = [palm.box[across], palm.box[up]];
      const parts = [
        drawn("rect", { class: "limit", x: -width / 2, y: -height / 2, width, height }),
        drawn("path", { class: "axis", d: "M-4 0H4M0 -4V4" }),
      ];
      for (const [name, x, y] of [
        ["x", 70, 62],
        [axis, -76, -58],
      ]) {
        const text = drawn("text", { x, y });
        text.textContent = name;
        parts.push(text);
      }
      if (place) {
        const [x, y] = point(place).map((value, i) =>
            Math.max(-76 + 12 * i, Math.min(76 - 12 * i, value)),
          ),
          [px, py] = point(predicted),
          turn = up === 2 ? palm.lean : 0;
        parts.push(
          up === 2
            ? drawn("path", {
                class: "hand",
                d: "M-18 0H18",
                transform: `translate(${x} ${y}) rotate(${turn})`,
              })
            : drawn("circle", { class: "hand", cx: x, cy: y, r: 18 }),
          drawn("circle", { class: follows ? "place" : "place lost", cx: x, cy: y, r: 3 }),
          drawn("path", { class: "ahead", d: `M${px - 5} ${py}l5 -5 5 5 -5 5z` }),
        );
      }
      picture.replaceChildren(...parts);
    }
  });
  return box;
}
