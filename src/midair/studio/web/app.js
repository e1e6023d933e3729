/* The page: header, current panel, address, dialogs. */

import { Link } from "/web/socket.js";
import { TABLE, listen } from "/web/keys.js";
import { buttonOf, make, openModal, toast, tried } from "/web/dom.js";
import { jobsShown } from "/web/jobs.js";
import { colours } from "/web/take.js";
import { airShown, heatWarning } from "/web/warnings.js";

const by = id => document.getElementById(id);
const link = new Link();
// requested early: the first picture needs them
for (const name of ["inferno", "twilight"]) colours(name);
/** The class of each panel, the default export of its script; a panel that cannot be loaded has
    no tab. */
const ROOMS = Object.fromEntries(
  (
    await Promise.all(
      [...by("rooms").children].map(async tab => {
        try {
          return [[tab.dataset.room, (await import(tab.dataset.script)).default]];
        } catch (wrong) {
          tab.remove();
          toast(`${tab.textContent}: ${wrong.message}`);
          return [];
        }
      }),
    )
  ).flat(),
);
const main = by("main"),
  footer = by("transport");
let handled = ""; // the address that was handled last

export const studio = {
  link,
  main,
  footer,
  room: null,
  name: "",
  /** Panel, take and time of the address. */
  get address() {
    const [path, query = ""] = decoded(location.hash.slice(1)).split("?"),
      [room, ...rest] = path.split("/");
    return {
      room: room in ROOMS ? room : "start",
      take: rest.join("/"),
      time: Number(new URLSearchParams(query).get("t") ?? NaN),
    };
  },
  /** Put take and time into the address, without an entry in the history. */
  here(take, time) {
    // A new address whose event is still pending must not be overwritten.
    if (location.hash !== handled) return;
    const query = Number.isFinite(time) ? `?t=${Number(time.toFixed(4))}` : "";
    keep(take);
    history.replaceState(null, "", `#${this.name}/${encodeURI(take)}${query}`);
    handled = location.hash;
  },
  go(room, take = "") {
    location.hash = take ? `${room}/${encodeURI(take)}` : room;
  },
  code(title, commands, python) {
    showCode(title, commands, python);
  },
};

/** An address as text; one that was typed may have a % of its own. */
function decoded(address) {
  try {
    return decodeURI(address);
  } catch {
    return address;
  }
}

/** The tabs of the panels of one take lead to the chosen one. */
function keep(take) {
  for (const tab of by("rooms").children)
    if (["reproduce", "compare", "calibrate"].includes(tab.dataset.room))
      tab.hash = `#${tab.dataset.room}/${encodeURI(take)}`;
}

function show() {
  const { room, take } = studio.address;
  if (take && room !== "study") keep(take);
  handled = location.hash;
  if (studio.name === room && studio.room) {
    studio.room.moved?.(studio.address);
    return;
  }
  studio.room?.leave?.();
  main.replaceChildren();
  footer.replaceChildren();
  footer.hidden = true;
  studio.name = room;
  for (const link of by("rooms").children)
    if (link.dataset.room === room) link.setAttribute("aria-current", "page");
    else link.removeAttribute("aria-current");
  document.title = `${room[0].toUpperCase()}${room.slice(1)} · midair studio`;
  studio.room = new ROOMS[room](studio);
}

async function stop() {
  by("stop").classList.add("pressed");
  const began = performance.now();
  try {
    await link.stop();
    studio.silent = performance.now() - began;
    if (link.state.player?.state === "plays") toast("STOP: silent");
  } catch {
    toast("STOP was not confirmed: run midair stop in a terminal, or switch the array off");
  }
  by("stop").classList.remove("pressed");
}

link.addEventListener("close", () =>
  banner("The studio does not respond. Nothing plays. Check that it still runs in its terminal."),
);
link.addEventListener("open", () => {
  banner("");
  studio.room?.reopened?.();
});

function banner(words, ...buttons) {
  const shown = by("banner");
  shown.hidden = !words;
  shown.replaceChildren(make("span", {}, words), ...buttons);
}

link.on("player", player => {
  const pill = by("state-array"),
    plays = player.state === "plays";
  pill.textContent =
    player.state === "failed"
      ? `array: ${player.said}`
      : player.state === "starts" || player.state === "opens"
        ? `opening ${player.device}`
        : plays
          ? `${player.device} plays`
          : player.device;
  pill.title = player.count ? `${player.count} transducers; ${player.units}` : "";
  pill.className = `pill ${plays ? "loud" : player.state === "ready" ? "on" : player.state === "failed" ? "bad" : ""}`;
  by("simulated").hidden = !player.simulated;
  document.body.classList.toggle("playing", plays);
});
link.on("record", record => {
  const pill = by("state-sensor"),
    bad = record.state === "lost";
  pill.textContent = bad ? `${record.sensor} lost` : record.sensor;
  pill.title = record.about
    ? `${record.about.rate_hz} Hz, ${record.about.rows} × ${record.about.columns} cells`
    : "not open";
  pill.className = `pill ${bad ? "bad" : record.state === "listening" || record.state === "recording" || record.state === "waiting" ? "on" : ""}`;
});
link.on("exposure", found => {
  const ear = found.places.find(place => place.name.includes("ear")) ?? found.places[0];
  const loudest = Math.max(
    ...found.places.filter(place => place.name.includes("ear")).map(place => place.peak_db),
    ear?.peak_db ?? 0,
  );
  by("state-ear").textContent = ear ? `ear ${loudest} / ${ear.limit_db} dB` : "ear: not checked";
  by("state-ear").classList.toggle("bad", found.excess_db > 0);
});
link.on("control", control => {
  document.body.classList.toggle("watching", !link.controls);
  if (!link.page) return;
  if (control.asking && link.controls) {
    banner(
      `Page ${control.asking} requests control.`,
      buttonOf("Give control", "This page then only watches", () =>
        tried(link.order("control", "give")),
      ),
      buttonOf("Keep control", "The other page goes on watching", () =>
        tried(link.order("control", "refuse")),
      ),
    );
  } else if (!link.controls) {
    banner(
      control.holder
        ? "This page may only watch: another page has control. STOP works here too."
        : "No page has control.",
      buttonOf(
        "Take control",
        "Asks the other page first while something plays",
        async () => {
          if ((await tried(link.order("control", "take"))) === false)
            toast("Something plays: the other page must consent first");
        },
        { id: "take-control" },
      ),
    );
  } else banner("");
  studio.room?.control?.();
});
jobsShown(link);
airShown(link);
by("banner").after(heatWarning(link, "hot"));

function dialogOf(id, title, ...children) {
  const dialog = by(id);
  dialog.replaceChildren(
    make("h2", { id: `${id}-title` }, title),
    ...children,
    make(
      "div.buttons",
      {},
      buttonOf("Close", "Back to the panel", () => dialog.close()),
    ),
  );
  openModal(dialog, link);
  return dialog;
}
function help() {
  dialogOf(
    "help",
    "Keys",
    make(
      "table",
      {},
      make(
        "tbody",
        {},
        ...TABLE.map(([key, does]) =>
          make("tr", {}, make("th", { scope: "row" }, key), make("td", {}, does)),
        ),
      ),
    ),
  );
}
function showCode(title, commands, python) {
  const part = (name, text) => [
    make("h3", {}, name),
    make("pre", { tabIndex: 0 }, text),
    buttonOf(`Copy ${name.toLowerCase()}`, "For a terminal or a script", () =>
      navigator.clipboard.writeText(text).then(() => toast("copied")),
    ),
  ];
  dialogOf("code", title, ...part("Commands", commands), ...part("Python", python));
}

by("stop").addEventListener("click", stop);
/** The help of the control that has the focus, beside it; a title is a description for screen
    readers. */
function hinted() {
  const hint = by("hint"),
    target = document.activeElement;
  hint.textContent = target?.matches(":is(button, input, select, textarea, summary):focus-visible")
    ? target.title
    : "";
  hint.hidePopover();
  if (!hint.textContent) return;
  hint.showPopover(); // above an open dialog
  const { left, top, bottom } = target.getBoundingClientRect(),
    { offsetWidth: wide, offsetHeight: high } = hint;
  hint.style.left = `${Math.max(8, Math.min(left, innerWidth - wide - 8))}px`;
  hint.style.top = `${bottom + 6 + high < innerHeight ? bottom + 6 : top - 6 - high}px`;
}
for (const kind of ["focusin", "focusout", "scroll"])
  addEventListener(kind, () => setTimeout(hinted), true); // after the focus has moved
listen({
  stop,
  help,
  room: index => {
    const name = Object.keys(ROOMS)[index];
    if (name) location.hash = [...by("rooms").children].find(tab => tab.dataset.room === name).hash;
  },
  part: edit => studio.room?.part?.(edit),
  undo: which => studio.room?.undo?.(which),
  swap: () => studio.room?.swap?.(),
  record: () => studio.room?.record?.(),
  transport: () => studio.room?.transport,
});
addEventListener("hashchange", show);
// a command may have written files
addEventListener("focus", () => tried(link.order("reproduce", "list")));
show();
export { stop };
globalThis.studio = studio; // for the browser's developer tools
