// The grid of cameras, and the details of one camera.
// SPDX-FileCopyrightText: 2026 The sst contributors
// SPDX-License-Identifier: Apache-2.0

import { getBlob } from "/web/api.js";
import { $, duration, el, finite, icon, number, sentence, setText, visible } from "/web/ui.js";

// state -> mark (distinguishable without colour), word, remedy
const STATES = {
  streaming: { mark: "", kind: "ok", word: "streaming" },
  ready: { mark: "R", kind: "wait", word: "ready", todo: "It waits for the trigger." },
  recovering: { mark: "↻", kind: "warn", word: "recovering", todo: "The service is bringing it back by itself." },
  absent: { mark: "×", kind: "bad", word: "absent", todo: "Check its cable, hub and power; it is taken up again as soon as it answers." },
  refused: { mark: "!", kind: "bad", word: "refused", todo: "Its settings or its binding do not fit: see the reason, then `sst cameras`." },
};
const UNKNOWN = { mark: "?", kind: "warn", word: "unknown" };
const THUMBNAIL_MS = 700;
const GRID_MS = 300; // a picture of the grid at a time
const GRID_PX = 96;
const RECENT_MS = 60000;

const stateOf = (camera) => STATES[camera.state] ?? UNKNOWN;
const drops = (camera) => camera.lost + camera.bad;

export class Cameras {
  /** @param onLarge  (name) => void: show this camera in the large place @param onMasks  (name, button) => void: and its masks */
  constructor(onLarge, onMasks) {
    this.onLarge = onLarge;
    this.onMasks = onMasks;
    this.list = [];
    this.cells = new Map();
    this.history = new Map(); // name -> [{now, drops}] of the last minute
    this.chosen = null;
    this.timer = null;
    this.turn = 0;
    this.paint();
  }

  /** The grid's pictures, one after the other, while the grid is in sight. */
  async paint() {
    for (;; await new Promise((done) => setTimeout(done, GRID_MS))) {
      await visible();
      const seen = this.list.filter((camera) => stateOf(camera).kind === "ok");
      if ($("panel-overview").hidden || !seen.length || $("grid").classList.contains("dense") || navigator.connection?.saveData) continue;
      const { name } = seen[this.turn++ % seen.length];
      const canvas = this.cells.get(name)?.querySelector("canvas");
      try {
        const bitmap = await createImageBitmap(await getBlob(`/snapshot/camera/${name}`), { resizeWidth: GRID_PX, resizeQuality: "medium" });
        if (canvas) {
          canvas.width = bitmap.width;
          canvas.height = bitmap.height;
          canvas.getContext("2d").drawImage(bitmap, 0, 0);
        }
        bitmap.close();
      } catch { /* the cell's state names the fault */ }
    }
  }

  update(body) {
    const shape = `${body.rows}x${body.cols}`;
    if (this.shape !== shape) {
      this.shape = shape;
      this.build(body.rows, body.cols);
    }
    this.list = body.cameras;
    const here = new Set();
    for (const camera of this.list) {
      here.add(camera.name);
      this.showCell(camera);
    }
    for (const [name, cell] of this.cells) cell.hidden = !here.has(name);
    this.showLegend();
    if (this.chosen) this.showCard();
  }

  build(rows, cols) {
    const grid = $("grid");
    grid.style.setProperty("--cols", cols);
    grid.classList.toggle("dense", cols > 8); // no room for names: tooltip, card and screen reader have them
    grid.replaceChildren();
    this.cells.clear();
    for (let row = 0; row < rows; row++)
      for (let col = 0; col < cols; col++) {
        const name = `r${row}c${col}`;
        const cell = el("button", { type: "button", class: "cell", dataset: { name }, hidden: true,
          tabindex: row + col ? "-1" : "0", "aria-pressed": "false", onclick: () => this.choose(name) },
        el("canvas", { "aria-hidden": "true", width: 1, height: 1 }), el("b", { "aria-hidden": "true" }), el("small", { "aria-hidden": "true" }));
        cell.style.gridArea = `${row + 1} / ${col + 1}`;
        this.cells.set(name, cell);
        grid.append(cell);
      }
    grid.onkeydown = (event) => this.walk(event, rows, cols);
  }

  /** Arrow keys move inside the grid, which is one tab stop. */
  walk(event, rows, cols) {
    const steps = { ArrowLeft: [0, -1], ArrowRight: [0, 1], ArrowUp: [-1, 0], ArrowDown: [1, 0] };
    const at = /^r(\d+)c(\d+)$/.exec(event.target.dataset?.name ?? "");
    if (!at || !steps[event.key]) return;
    event.preventDefault();
    const row = Math.min(Math.max(Number(at[1]) + steps[event.key][0], 0), rows - 1);
    const col = Math.min(Math.max(Number(at[2]) + steps[event.key][1], 0), cols - 1);
    const next = this.cells.get(`r${row}c${col}`);
    if (next.hidden) return;
    event.target.tabIndex = -1;
    next.tabIndex = 0;
    next.focus();
  }

  /** Frames lost in the last minute; older losses are not shown. */
  recent(camera) {
    const now = Date.now();
    const past = (this.history.get(camera.name) ?? []).filter((entry) => now - entry.now < RECENT_MS && entry.drops <= drops(camera));
    if (past.at(-1)?.drops === drops(camera)) past.pop(); // the counter restarted
    past.push({ now, drops: drops(camera) });
    this.history.set(camera.name, past);
    return drops(camera) - past[0].drops;
  }

  showCell(camera) {
    const cell = this.cells.get(camera.name);
    if (!cell) return;
    const state = stateOf(camera);
    const lost = this.recent(camera);
    if (cell.dataset.kind !== state.kind) cell.dataset.kind = state.kind;
    setText(cell.children[1], state.mark);
    setText(cell.lastChild, camera.name);
    const text = [`${camera.name}: ${state.word}`, camera.reason, state.kind === "ok" && `${number(camera.rate_hz, 1)} Hz`,
      state.kind === "ok" && finite(camera.skew_us) && `skew ${number(camera.skew_us)} µs`, lost > 0 && `${number(lost)} frames lost or bad within a minute`]
      .filter(Boolean).join(", ");
    if (cell.title !== text) {
      cell.title = text;
      cell.setAttribute("aria-label", text);
    }
    cell.classList.toggle("lossy", lost > 0 && state.kind === "ok");
  }

  showLegend() {
    const counts = new Map();
    for (const camera of this.list) counts.set(stateOf(camera), (counts.get(stateOf(camera)) ?? 0) + 1);
    const text = [...counts].map(([state, count]) => `${count} ${state.word}`).join(" · ");
    const lossy = this.list.filter((camera) => this.recent(camera) > 0).length;
    setText($("grid-legend"), text + (lossy ? ` · ${lossy} lost frames within a minute (dotted)` : ""));
  }

  choose(name) {
    for (const [other, cell] of this.cells)
      cell.setAttribute("aria-pressed", String(other === name && this.chosen !== name));
    this.chosen = this.chosen === name ? null : name;
    clearTimeout(this.timer);
    const card = $("camera");
    card.hidden = !this.chosen;
    if (!this.chosen) return;
    this.parts = this.buildCard(card, name);
    this.showCard();
    this.thumbnail(name, false);
    card.scrollIntoView({ block: "nearest" });
  }

  buildCard(card, name) {
    const parts = {
      state: el("span", { class: "badge" }), picture: el("canvas", { width: 320, height: 240, role: "img",
        "aria-label": `Picture of camera ${name}` }),
      none: el("p", { class: "quiet none" }, "Its picture follows …"), reason: el("p", { class: "reason" }), facts: el("dl", { class: "facts" }),
    };
    const close = el("button", { type: "button", class: "icon", "aria-label": "Close", onclick: () => this.choose(name) },
      icon("close"));
    const large = el("button", { type: "button", class: "small", onclick: () => this.onLarge(name) }, "Large");
    const masks = el("button", { type: "button", class: "small", title: "Parts of its frames that are black", onclick: () => this.onMasks(name, masks) }, "Masks");
    card.replaceChildren(el("div", { class: "card-head" }, el("h2", {}, name), parts.state, large, masks, close),
      el("div", { class: "thumbnail" }, parts.picture, parts.none), parts.reason, parts.facts);
    card.setAttribute("aria-label", `Camera ${name}`);
    return parts;
  }

  showCard() {
    const camera = this.list.find((other) => other.name === this.chosen);
    if (!camera) return;
    const state = stateOf(camera);
    const { parts } = this;
    parts.state.dataset.kind = state.kind;
    setText(parts.state, state.word);
    const reason = [sentence(camera.reason), state.todo].filter(Boolean).join(" ").replaceAll("`", "");
    setText(parts.reason, reason);
    parts.reason.hidden = !reason;
    const buckets = Object.entries(camera.buckets ?? {}).filter(([key, count]) => key !== "set" && count > 0);
    const rungs = Object.entries(camera.recovery ?? {}).filter(([, count]) => count > 0);
    facts(parts.facts, [
      ["Rate", `${number(camera.rate_hz, 1)} Hz`],
      ["Skew", finite(camera.skew_us) ? `${number(camera.skew_us)} µs` : "–"],
      ["Last frame", finite(camera.last_s) && camera.last_s >= 0 ? `${duration(camera.last_s)} ago`.replace(/^0 s ago$/, "now") : "–"],
      ["Frames", `${number(camera.frames)}${drops(camera) ? `, ${number(camera.lost)} lost, ${number(camera.bad)} bad` : ", none lost"}`],
      ["Not in a set", buckets.length ? buckets.map(([key, count]) => `${number(count)} ${key}`).join(", ") : "none"],
      ["Recovery", rungs.length ? rungs.map(([key, count]) => `${number(count)} ${key.replace("_", " ")}`).join(", ") : "never needed"],
      ...(camera.packets_missing || camera.packets_resent ?
        [["Packets", `${number(camera.packets_missing)} missing, ${number(camera.packets_resent)} sent again`]] : []),
      ...(camera.ptp_role ? [["Clock", `PTP ${camera.ptp_role.toLowerCase()}${finite(camera.ptp_offset_us) ? `, ${number(camera.ptp_offset_us, 1)} µs off` : ""}`]] : []),
      ["Serial", camera.serial || "–"], ["Port", camera.port || "–"],
    ]);
  }

  async thumbnail(name, shown) {
    const state = stateOf(this.list.find((other) => other.name === name) ?? {});
    await visible();
    try {
      if (state.kind !== "ok") throw new Error(`the camera is ${state.word}.`);
      const bitmap = await createImageBitmap(await getBlob(`/snapshot/camera/${name}`));
      if (this.chosen !== name) return;
      const canvas = this.parts.picture;
      canvas.width = bitmap.width;
      canvas.height = bitmap.height;
      canvas.getContext("2d").drawImage(bitmap, 0, 0);
      bitmap.close();
      shown = true;
      this.parts.none.hidden = true;
    } catch (error) {
      if (this.chosen !== name) return;
      this.parts.none.hidden = false;
      setText(this.parts.none, shown ? `Not live: ${error.message}` : `No picture: ${error.message}`);
    }
    this.timer = setTimeout(() => this.thumbnail(name, shown), THUMBNAIL_MS);
  }
}

/** Fills a <dl>, changing only different entries. */
export function facts(list, rows) {
  if (list.children.length !== rows.length)
    list.replaceChildren(...rows.map(([name]) => el("div", {}, el("dt", {}, name), el("dd", {}))));
  rows.forEach(([name, value, kind], i) => {
    const row = list.children[i];
    setText(row.firstChild, name);
    setText(row.lastChild, value);
    row.lastChild.dataset.kind = kind ?? "";
  });
}
