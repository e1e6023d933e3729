/* The keyboard: Esc is STOP everywhere; letters work outside text fields only, and none of them
    starts playing. */

export const TABLE = [
  ["Esc", "STOP, everywhere, also in text fields"],
  ["Space", "play, pause; live: freeze (Enter continues)"],
  ["J K L", "slower or back, stop, faster"],
  ["1 2 3", "full speed, 1/10, 1/100"],
  [", .", "one frame back, forward; with Shift ten; repeats while held"],
  ["Home End", "to the start, to the end"],
  ["I O \\", "loop start, loop end, loop on or off"],
  ["M, Shift M", "mark, next mark"],
  ["R", "record, stop; live: keep the last 60 s"],
  ["arrows", "channel and frame; on a map: the cell"],
  ["F P", "magnitude, phase"],
  ["B", "the other drive of the take (A/B)"],
  ["+ - 0", "time zoom, all; also the wheel, and a drag over the cells"],
  ["drag", "over the whole take: choose a part, as I and O do; with Shift: move through it"],
  ["Delete", "removes the chosen part; the result is another take"],
  ["Ctrl Z, Ctrl Shift Z", "undo, redo an edit of a take"],
  ["Alt 1 … 9", "panels"],
  ["?", "this table"],
];

/** `acts`: {stop(), room(index), help(), record(), swap(), undo(which), part(edit), transport()}. */
export function listen(acts) {
  addEventListener(
    "keydown",
    event => {
      if (event.key === "Escape") {
        acts.stop();
        return;
      } // Escape also closes dialogs
      if (event.altKey && /^[1-9]$/.test(event.key)) {
        event.preventDefault();
        acts.room(Number(event.key) - 1);
        return;
      }
      if (
        (event.ctrlKey || event.metaKey) &&
        event.key.toLowerCase() === "z" &&
        !event.target.closest?.("input, textarea, dialog")
      ) {
        event.preventDefault();
        acts.undo(event.shiftKey ? "redo" : "undo");
        return;
      }
      if (event.ctrlKey || event.metaKey || event.altKey || event.isComposing) return;
      const { target } = event,
        within = target.closest?.("input, select, textarea, [contenteditable], dialog");
      if (within) return;
      if (event.key === " " && target.closest?.("button, a")) return; // the button's own key
      if (target.closest?.(".takes") && ["ArrowUp", "ArrowDown", "Home", "End"].includes(event.key))
        return; // the list's own keys
      if (event.key === "?") {
        event.preventDefault();
        acts.help();
        return;
      }
      if (event.key === "Delete") {
        acts.part("delete");
        return;
      }
      if (event.key.toLowerCase() === "b" && !event.repeat) {
        acts.swap();
        return;
      }
      if (event.key.toLowerCase() === "r" && !event.repeat) {
        acts.record();
        return;
      }
      if (acts.transport()?.press(event)) event.preventDefault();
    },
    true,
  );
}
