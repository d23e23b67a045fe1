// Keys of the page: one table of their effects, which `?` shows, and handlers of keys that belong to no element.
// SPDX-FileCopyrightText: 2026 The sst contributors
// SPDX-License-Identifier: Apache-2.0

import { $, el } from "/web/ui.js";

const TEXT = "input:not([type=checkbox], [type=radio], [type=range]), select, textarea";

/** Keys that elements handle themselves. */
const OWN = [
  ["Picture, when it has the focus", [["Arrows", "move a cross-hair"], ["Enter", "removes what is under it, brings it back, or focuses on it"],
    ["+ −", "move the cut, or the focus"], ["Z  Shift Z  0", "zoom in, out, whole picture"]]],
  ["The day below the picture", [["← →", "another moment"], ["Page Up  Page Down", "the visit before, the next one"], ["Enter", "plays it"],
    ["+ −", "zoom in, out"], ["Home  End", "ends of the part that is shown"]]],
  ["Sliders, divider, grid of cameras", [["Arrows", "move"], ["Home  End", "to the ends"]]],
];

export class Keys {
  constructor() {
    this.groups = []; // {title, lines, when, keys}
    document.addEventListener("keydown", (event) => this.press(event));
    $("keys-open").addEventListener("click", () => this.show());
    $("keys-close").addEventListener("click", () => $("keys").close());
    this.add("Anywhere", [["?", "this list"], ["Esc", "closes what is open"], ["Tab", "to the next control"]], () => true, { "?": () => this.show() });
  }

  /** @param lines  [[keys, effect]], for the list
   *  @param when  (event) => bool: they mean something now
   *  @param keys  {"r": (event) => void}, as KeyboardEvent.key; "Shift+..." with Shift */
  add(title, lines, when, keys) {
    this.groups.push({ title, lines, when, keys });
  }

  press(event) {
    if (event.defaultPrevented || event.altKey || event.ctrlKey || event.metaKey || event.target.matches?.(TEXT)) return;
    for (const { when, keys } of this.groups) {
      const action = keys[event.shiftKey && event.key.length > 1 ? `Shift+${event.key}` : event.key];
      if (!action || !when(event)) continue;
      event.preventDefault();
      action(event);
      return;
    }
  }

  show() {
    if ($("keys").open) return;
    const groups = [...this.groups, ...OWN.map(([title, lines]) => ({ title, lines }))];
    $("key-list").replaceChildren(...groups.filter(({ lines }) => lines.length).map(({ title, lines }) => el("section", {}, el("h3", {}, title),
      el("dl", {}, ...lines.map(([keys, text]) => el("div", {}, el("dt", {}, ...keys.split("  ").map((key) => el("kbd", {}, key))), el("dd", {}, text)))))));
    $("keys").showModal();
  }
}
