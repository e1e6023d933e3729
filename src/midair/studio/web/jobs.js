/* Running jobs: progress bar, frames per second, remaining time, and a button to cancel. */

import { buttonOf, make, openModal, tried } from "/web/dom.js";

/** Solve a take. If a drive exists, ask the user before it is replaced; null if nothing was
    solved. */
export async function solveTake(link, given) {
  let answer = await tried(link.order("reproduce", "solve", given));
  while (answer?.asks) {
    const said = await mayReplace(link, answer.asks);
    answer = said
      ? await tried(
          link.order("reproduce", "solve", {
            ...given,
            ...(said === "both" ? { beside: true } : { replaces: answer.asks.replaces }),
          }),
        )
      : null;
  }
  return answer;
}

const mayReplace = (link, { files: [first, again], made, new: settings }) =>
  askToReplace(
    link,
    made ? `Replace ${first}?` : `Remove ${first}?`,
    [
      `${first} exists, ${made || "made from a drive that no longer exists"}.`,
      ...(again ? [`${again}, its re-recording, is removed with it.`] : []),
      `The new drive: ${settings}.`,
    ],
    [
      ...(made ? [["both", "Keep both", "The new drive gets another name"]] : []),
      ["yes", made ? "Replace" : "Remove and solve", "Cannot be undone"],
    ],
  );

/** Ask whether files may be replaced; resolves to the value of a button, or "". */
export function askToReplace(link, title, words, buttons) {
  const dialog = document.getElementById("replace"),
    button = ([value, text, title], autofocus = false) =>
      buttonOf(text, title, () => dialog.close(value), { autofocus });
  if (dialog.open) dialog.close("");
  dialog.returnValue = "";
  dialog.replaceChildren(
    make("h2", { id: "replace-title" }, title),
    make("div", { id: "replace-words" }, ...words.map(each => make("p", {}, each))),
    make(
      "div.buttons",
      {},
      ...buttons.map(each => button(each)),
      button(["", "Cancel", "Changes nothing"], true),
    ),
  );
  openModal(dialog, link);
  return new Promise(resolve =>
    dialog.addEventListener("close", () => resolve(dialog.returnValue), { once: true }),
  );
}

export function jobsShown(link) {
  const aside = document.getElementById("jobs"),
    shown = new Map(),
    gone = new Set();
  link.on("jobs", jobs => {
    for (const job of jobs) {
      if (gone.has(job.number)) continue;
      const over = !["waits", "runs"].includes(job.state);
      let entry = shown.get(job.number);
      if (!entry) {
        if (over) continue;
        entry = build(link, job);
        shown.set(job.number, entry);
        aside.append(entry.root);
      }
      entry.tell(job);
      if (over) {
        shown.delete(job.number);
        gone.add(job.number);
        setTimeout(() => entry.root.remove(), job.state === "failed" ? 12000 : 2500);
      }
    }
    // Of the jobs that have ended only the last are told.
    for (const [number, entry] of shown)
      if (!jobs.some(job => job.number === number) && shown.delete(number)) entry.root.remove();
  });
}

function build(link, { number, title }) {
  const bar = make("progress", { max: 1, "aria-label": title }),
    words = make("span.quiet"),
    state = make("span");
  const cancel = buttonOf(
    "Cancel",
    "Ends this job; nothing unfinished is kept",
    () => tried(link.order("jobs", "cancel", { number })),
    { "aria-label": `cancel: ${title}` },
  );
  const root = make(
    "div.job",
    { role: "group", "aria-label": title },
    make("div.row", {}, make("strong", {}, title), cancel),
    bar,
    make("div.row", {}, words, state),
  );
  return {
    root,
    tell(job) {
      // Without a first step, the bar shows only that something goes on.
      if (job.done && job.state === "runs") bar.value = job.done / job.total;
      else if (job.state === "done") bar.value = 1;
      words.textContent =
        job.state === "failed"
          ? job.error
          : job.state === "waits"
            ? "waiting"
            : job.state === "runs"
              ? job.stage
              : job.state;
      words.className = job.state === "failed" ? "bad" : "quiet";
      state.textContent =
        job.state === "runs" && job.rate
          ? `${said(job.rate)}/s${job.left_s === null ? "" : `, ${said(job.left_s)} s left`}`
          : "";
      cancel.hidden = !["waits", "runs"].includes(job.state);
    },
  };
}

const said = value => (value >= 10 ? Math.round(value) : Math.round(value * 10) / 10);
