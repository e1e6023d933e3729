/* Create DOM elements; text is always inserted as text, never as markup. */

/** make("button.main", {onclick}, "Solve", ...) */
export function make(what, properties = {}, ...children) {
  const [tag, ...classes] = what.split("."),
    made = document.createElement(tag);
  if (classes.length) made.className = classes.join(" ");
  if (tag === "button") made.type = "button"; // unless it says otherwise: a form's own would submit
  for (const [name, value] of Object.entries(properties)) {
    if (value === undefined || value === null || value === false) continue;
    if (name.startsWith("on"))
      made.addEventListener(name.slice(2), tag === "button" ? busy(made, value) : value);
    else if (name in made && !name.includes("-") && name !== "list" && name !== "form")
      made[name] = value;
    else made.setAttribute(name, value === true ? "" : value);
  }
  made.append(...children.flat().filter(child => child !== null && child !== undefined));
  return made;
}

/** A button with its words, a line of help, its act and further properties. */
export const buttonOf = (words, title, onclick, more = {}) =>
  make("button", { title, onclick, ...more }, ...[words].flat());

/** The act of a button: until its promise ends, the button shows that it works and takes no other
    press; STOP takes every one. */
function busy(button, act) {
  return async event => {
    if (button.ariaBusy) return;
    const done = act(event);
    if (!(done instanceof Promise)) return;
    if (!button.matches(".stop")) button.ariaBusy = "true";
    try {
      await done;
    } finally {
      button.ariaBusy = null;
    }
  };
}

/** A table of texts or elements; the columns from `number` on are numbers. */
export function table(heads, lines, number = 1) {
  const line = (tag, cells, given) =>
    make(
      "tr",
      {},
      ...cells.map((cell, i) => make(tag + (i < number ? "" : ".number"), given, cell)),
    );
  return make(
    "table",
    {},
    make("thead", {}, line("th", heads, { scope: "col" })),
    make("tbody", {}, ...lines.map(cells => line("td", cells, {}))),
  );
}

/** A panel with title, an element at the right of it, and contents. */
export function panel(title, aside, ...children) {
  const right = aside instanceof Node ? aside : make("span", {}, aside ?? "");
  const made = make(
    "section.panel",
    {},
    make("header", {}, make("h2", {}, title), right),
    ...children,
  );
  made.aside = right;
  made.setAttribute("aria-label", title);
  return made;
}

/** A control with its label and one line of help, which the title shows. */
export function field(label, control, help = control.title) {
  control.id ||= `f-${++field.count}`;
  control.title = help;
  return make("div.field", {}, make("label", { htmlFor: control.id, title: help }, label), control);
}
field.count = 0;

/** A select element from [[value, text], ...]. */
export function choice(options, value, onchange) {
  const made = make(
    "select",
    { onchange },
    ...options.map(([key, words]) => make("option", { value: key }, words)),
  );
  made.value = value;
  return made;
}

/** Names and values. */
export function rows(pairs) {
  return make(
    "dl.rows",
    {},
    ...pairs.flatMap(([name, value]) => [make("dt", {}, name), make("dd", {}, String(value))]),
  );
}

/** A short message at the bottom of the page, also for screen readers. */
export function toast(words) {
  const made = make("div.toast", {}, words);
  document.getElementById("toasts").append(made);
  setTimeout(() => made.remove(), 7000);
}

/** Await a request; show its error as a message and return null. */
export async function tried(promise) {
  try {
    return await promise;
  } catch (wrong) {
    toast(wrong instanceof AggregateError ? wrong.errors[0].message : wrong.message);
    return null;
  }
}

/** Whether an array can play: one that failed is opened again by the next check. */
export const playable = player => ["ready", "failed"].includes(player?.state);

const jobs = document.getElementById("jobs");
/** Open a dialog over the page. It has the running jobs, and a STOP of its own while something
    plays, since the page behind it cannot be pressed. */
export function openModal(dialog, link) {
  dialog.addEventListener("close", () => document.body.append(jobs), { once: true });
  dialog.querySelector(".stop")?.remove();
  dialog.append(
    jobs,
    buttonOf(
      ["STOP ", make("kbd", {}, "Esc")],
      "Silences the array at once",
      () => tried(link.stop()),
      { class: "stop" },
    ),
  );
  dialog.showModal();
}
const HOLD = 600; // ms
/** Act once a button was held down, by pointer or by Enter or Space. */
export function whenHeld(button, act) {
  const begin = busy(button, act);
  let timer = 0;
  const release = () => {
      button.classList.remove("held");
      clearTimeout(timer);
      timer = 0;
    },
    press = () => {
      if (button.disabled || timer) return;
      button.classList.add("held");
      timer = setTimeout(() => {
        release();
        begin();
      }, HOLD);
    };
  button.addEventListener("pointerdown", press);
  for (const name of ["pointerup", "pointerleave", "pointercancel", "blur", "keyup"])
    button.addEventListener(name, release);
  button.addEventListener("keydown", event => {
    if ((event.key !== " " && event.key !== "Enter") || event.repeat) return;
    event.preventDefault();
    press();
  });
}
