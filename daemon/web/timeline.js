// A day as a strip below the picture: recordings, visits, and the moment that is played. A click plays another moment.
// SPDX-FileCopyrightText: 2026 The sst contributors
// SPDX-License-Identifier: Apache-2.0

import { get } from "/web/api.js";
import { forget, portrait } from "/web/portrait.js";
import { recordings } from "/web/recorded.js";
import { $, complain, el, finite, setText, toast } from "/web/ui.js";
import { what } from "/web/visit_words.js";

const HOUR_MS = 3600000;
const LEAST_MS = 5 * 60000; // of the window
const REFRESH_MS = 10000;
const SOON_MS = 700; // several events make one request
const LEAD_MS = 1500; // a visit is played from a moment before it
const NEAR_PX = 5;
const DRAG_PX = 5;
const TICK_PX = 72; // of a time with AM or PM, and a gap
const TICKS = [60, 300, 600, 1800, 3600, 10800, 21600].map((s) => 1000 * s);
const MOST = 1000;
const ZOOM = 2; // of a press of a button or key

const [minutes, seconds] = [{}, { second: "2-digit" }].map((more) => new Intl.DateTimeFormat(undefined, { hour: "2-digit", minute: "2-digit", ...more }));
const clock = (ms, exact = true) => (exact ? seconds : minutes).format(ms);

export class Timeline {
  /** @param app  {replay, labels}; @param onPlay  async (time) */
  constructor(app, onPlay) {
    this.app = app;
    this.onPlay = onPlay;
    this.recordings = []; // {from, to} in ms
    this.visits = [];     // {from, to, visit: as of the API}
    this.cursor = NaN;
    this.tip = null;      // visit of the tooltip
    this.shown = 0;
    this.pointers = new Map(); // on the strip, by id: x
    this.start(Date.now());
    this.open();
    this.listen();
    $("day-before").addEventListener("click", () => this.setDay(this.day - 1));
    $("day-after").addEventListener("click", () => this.setDay(this.end));
    $("day-nearer").addEventListener("click", () => this.zoom(1 / ZOOM));
    $("day-farther").addEventListener("click", () => this.zoom(ZOOM));
    setInterval(() => this.tick(), 500);
  }

  /** Of a day, which has 23 or 25 hours where clocks change. @param at  any moment of it, in ms */
  start(at) {
    this.day = midnight(at);
    this.end = new Date(this.day).setDate(new Date(this.day).getDate() + 1);
  }

  /** The last hour of today, which goes on with the clock until the window is moved; the whole of another day. */
  open() {
    const today = this.day === midnight(Date.now());
    this.follows = today;
    this.from = today ? Math.max(Date.now() - HOUR_MS, this.day) : this.day;
    this.to = today ? Math.min(this.from + HOUR_MS, this.end) : this.end;
  }

  /** @param on  a panel that is about the past is open */
  show(on) {
    this.wanted = on;
    this.tick();
  }

  tick() {
    const on = this.wanted || this.app.replay.open;
    $("timeline").hidden = !on;
    if (!on) return;
    if (Date.now() - this.shown > REFRESH_MS) this.refresh();
    if (this.follows && Date.now() > this.to) {
      this.start(Date.now());
      this.open();
      this.draw();
    }
    const played = this.app.replay.open ? this.app.replay.at() : NaN;
    if (this.follows && finite(played) && played >= this.day && played < this.end && (played < this.from || played > this.to))
      this.window(played - (this.to - this.from) / 2, this.to - this.from); // the played moment stays in sight
    this.drawMarks();
  }

  /** @param at  any moment of it, in ms */
  setDay(at) {
    if (midnight(at) > Date.now()) return;
    this.start(at);
    this.open();
    this.refresh();
  }

  /** After an event of a visit. */
  soon() {
    this.waiting ??= setTimeout(() => {
      this.waiting = null;
      this.refresh();
    }, SOON_MS);
  }

  async refresh() {
    this.shown = Date.now();
    const { day, end } = this;
    try {
      const query = new URLSearchParams({ limit: MOST, from: iso(day), to: iso(end - 1) });
      const [visits, kept] = await Promise.all([get(`/api/v1/visits?${query}`), recordings()]);
      if (day !== this.day) return;
      this.visits = visits.visits.map((visit) => ({ from: Date.parse(visit.from), to: Date.parse(visit.to), visit })).reverse();
      this.recordings = kept.map((span) => ({ ...span, to: Math.min(span.to, Date.now()) })).filter(({ from, to }) => to > day && from < end);
    } catch (error) {
      if (error.status !== 0) complain(error);
    }
    this.draw();
  }

  // --- drawing ---

  x(ms) {
    return 100 * (ms - this.from) / (this.to - this.from);
  }

  bar({ from, to }, kind, colour) {
    const node = el("i", { class: kind });
    const left = Math.max(this.x(from), 0);
    node.style.left = `${left}%`;
    node.style.width = `${Math.min(this.x(to), 100) - left}%`;
    if (colour) node.style.background = colour;
    return node;
  }

  /** All of it: the window or its content has changed. */
  draw() {
    const inside = ({ from, to }) => to > this.from && from < this.to;
    $("day-bars").replaceChildren(...this.recordings.filter(inside).map((span) => this.bar(span, "recorded")),
      ...this.visits.filter(inside).map((span) => this.bar(span, "visited", this.app.labels.colourOf(span.visit.label))));
    this.drawTicks();
    setText($("day-name"), new Date(this.day).toLocaleDateString(undefined, { weekday: "short", day: "numeric", month: "short" }));
    $("day-after").disabled = this.end > Date.now();
    $("day-nearer").disabled = this.to - this.from <= LEAST_MS;
    $("day-farther").disabled = this.to - this.from >= this.end - this.day;
    this.drawMarks();
  }

  /** Marks of now, of the played moment, and under the pointer. */
  drawMarks() {
    const line = (ms, kind) => (ms >= this.from && ms <= this.to ? [this.bar({ from: ms, to: ms }, kind)] : []);
    const played = this.app.replay.open ? this.app.replay.at() : NaN;
    $("day-marks").replaceChildren(...line(Date.now(), "now"), ...line(played, "played"), ...line(this.cursor, "cursor"));
    const at = finite(this.cursor) ? this.cursor : played;
    const there = this.visits.filter(({ from, to }) => at >= from - LEAD_MS && at <= to).map(({ visit }) => visit);
    const recorded = this.recordings.some(({ from, to }) => at >= from && at <= to);
    const words = [...new Set(there.map((visit) => what(visit).replace("Something", "something")))];
    const day = $("day");
    day.setAttribute("aria-valuemax", (this.end - this.day) / 1000);
    day.setAttribute("aria-valuenow", finite(at) ? Math.round((at - this.day) / 1000) : 0);
    day.setAttribute("aria-valuetext", finite(at) ? `${clock(at)}, ${[...words, recorded ? "recorded" : "not recorded"].join(", ")}`
      : `${clock(this.from, false)} to ${clock(this.to, false)}: ${this.visits.length} visits, ${this.recordings.length} recordings`);
    const under = finite(this.cursor) ? this.under(this.cursor) : undefined;
    $("day-cursor").hidden = !finite(this.cursor);
    if (finite(this.cursor)) this.drawTip([clock(this.cursor), ...(words.length || !under ? words : [`${what(under)}, ${clock(Date.parse(under.from))}`])].join(" · "), under);
  }

  /** The picture of the visit under the pointer, and the time. */
  drawTip(text, visit) {
    const tip = $("day-cursor");
    setText($("day-cursor-text"), text);
    if (this.tip !== visit?.visit) {
      this.tip = visit?.visit;
      forget($("day-cursor-picture"));
      $("day-cursor-picture").replaceChildren(...[visit && portrait(visit)].filter(Boolean));
      $("day-cursor-picture").hidden = !visit?.pictures.length;
    }
    const box = $("day").getBoundingClientRect();
    const half = tip.offsetWidth / 2;
    const at = box.left + this.x(this.cursor) / 100 * box.width;
    tip.style.left = `${Math.min(Math.max(at, half + 4), innerWidth - half - 4) - box.left}px`;
  }

  drawTicks() {
    const most = Math.min(Math.max(Math.floor($("day").clientWidth / TICK_PX), 2), 9); // texts must not overlap
    const edge = 50 * TICK_PX / Math.max($("day").clientWidth, 1);
    const step = TICKS.find((ms) => (this.to - this.from) / ms <= most) ?? TICKS.at(-1);
    const ticks = [];
    for (let at = this.day; at < this.to; at += step)
      if (at > this.from && this.x(at) > edge && this.x(at) < 100 - edge) {
        const node = el("span", {}, clock(at, false));
        node.style.left = `${this.x(at)}%`;
        ticks.push(node);
      }
    $("day-ticks").replaceChildren(...ticks);
  }

  // --- pointing ---

  at(clientX) {
    const box = $("day").getBoundingClientRect();
    return this.from + (clientX - box.left) / box.width * (this.to - this.from);
  }

  listen() {
    const day = $("day");
    let drag = null;
    day.addEventListener("pointerdown", (event) => {
      this.pointers.set(event.pointerId, event.clientX);
      drag = { x: event.clientX, from: this.from, moved: this.pointers.size > 1 };
      day.setPointerCapture(event.pointerId);
    });
    day.addEventListener("pointermove", (event) => {
      if (this.pointers.size > 1) {
        this.pinch(event);
        return;
      }
      if (drag && Math.abs(event.clientX - drag.x) > DRAG_PX) drag.moved = true;
      if (drag?.moved) this.window(drag.from - (event.clientX - drag.x) / day.clientWidth * (this.to - this.from), this.to - this.from);
      this.cursor = this.at(event.clientX);
      this.drawMarks();
    });
    const lift = (event) => {
      this.pointers.delete(event.pointerId);
      if (drag && this.pointers.size) [drag.x, drag.from, drag.moved] = [[...this.pointers.values()][0], this.from, true];
    };
    day.addEventListener("pointerup", (event) => {
      lift(event);
      if (this.pointers.size) return;
      const tapped = drag && !drag.moved;
      drag = null;
      if (tapped) this.play(this.near(this.at(event.clientX)));
    });
    for (const kind of ["pointerleave", "blur", "pointercancel"])
      day.addEventListener(kind, (event) => {
        if (event.pointerId !== undefined) lift(event);
        if (this.pointers.size) return;
        drag = null;
        this.cursor = NaN;
        this.drawMarks();
      });
    day.addEventListener("wheel", (event) => {
      event.preventDefault();
      this.zoom(2 ** (Math.sign(event.deltaY) * 0.5), this.at(event.clientX));
    }, { passive: false });
    day.addEventListener("keydown", (event) => this.key(event));
  }

  /** Two fingers: the moments below them stay below them. */
  pinch(event) {
    if (!this.pointers.has(event.pointerId)) return;
    const other = [...this.pointers].find(([id]) => id !== event.pointerId)[1];
    const before = this.pointers.get(event.pointerId);
    const held = this.at(other);
    this.pointers.set(event.pointerId, event.clientX);
    if (Math.abs(before - other) < 20 || Math.abs(event.clientX - other) < 20) return;
    this.zoom(Math.abs(before - other) / Math.abs(event.clientX - other), held);
  }

  /** @param at  the moment that keeps its place; without it the cursor, the played moment, or now */
  zoom(factor, at = NaN) {
    const span = Math.min(Math.max((this.to - this.from) * factor, LEAST_MS), this.end - this.day);
    const inside = (ms) => finite(ms) && ms >= this.from && ms <= this.to;
    const held = [at, this.cursor, this.app.replay.open ? this.app.replay.at() : NaN, Date.now()].find(inside) ?? (this.from + this.to) / 2;
    this.window(held - (held - this.from) * span / (this.to - this.from), span);
  }

  window(from, span) {
    this.follows = false;
    this.from = Math.min(Math.max(from, this.day), this.end - span);
    this.to = this.from + span;
    this.draw();
  }

  /** The visit under a moment, or next to it as far as a pointer is exact; undefined: none. */
  under(at) {
    const reach = NEAR_PX * (this.to - this.from) / $("day").clientWidth;
    return this.visits.find(({ from, to }) => at >= from - reach && at <= to + reach)?.visit;
  }

  /** A visit under the pointer, from just before it; else the moment itself. */
  near(at) {
    const reach = NEAR_PX * (this.to - this.from) / $("day").clientWidth;
    const visit = this.visits.find(({ from, to }) => at >= from - reach && at <= to + reach);
    return visit && at < visit.from + reach ? visit.from - LEAD_MS : at;
  }

  key(event) {
    const start = finite(this.cursor) ? this.cursor : this.app.replay.open ? this.app.replay.at() : Math.min(Date.now(), this.to);
    const step = (this.to - this.from) / 100;
    const steps = { ArrowLeft: -step, ArrowRight: step, ArrowDown: -step, ArrowUp: step };
    if (event.ctrlKey || event.altKey || event.metaKey) return;
    if (event.key in steps) this.cursor = start + steps[event.key];
    else if (event.key === "PageUp") this.cursor = this.visits.findLast(({ from }) => from < start - 1)?.from ?? start;
    else if (event.key === "PageDown") this.cursor = this.visits.find(({ from }) => from > start + 1)?.from ?? start;
    else if (event.key === "Home") this.cursor = this.from;
    else if (event.key === "End") this.cursor = this.to;
    else if (event.key === "+" || event.key === "=") this.zoom(1 / ZOOM);
    else if (event.key === "-") this.zoom(ZOOM);
    else if (event.key === "Enter" || event.key === " ") this.play(this.near(start));
    else return;
    event.preventDefault();
    if (!finite(this.cursor)) return;
    this.cursor = Math.min(Math.max(this.cursor, this.day), this.end - 1);
    if (this.cursor < this.from || this.cursor > this.to) this.window(this.cursor - (this.to - this.from) / 2, this.to - this.from);
    this.drawMarks();
  }

  /** A click in a gap looks a moment later, where a visit's recording may begin. */
  async play(at) {
    const recorded = this.recordings.find(({ from, to }) => at >= from - LEAD_MS && at <= to);
    try {
      this.cursor = NaN;
      await this.onPlay(iso(recorded ? Math.max(at, recorded.from) : at));
    } catch (error) {
      if (error.status === 404) toast(`Nothing was recorded at ${clock(at)}.`, "info", null, "timeline");
      else complain(error);
    }
  }
}

function midnight(ms) {
  return new Date(ms).setHours(0, 0, 0, 0);
}

function iso(ms) {
  return new Date(ms).toISOString();
}
