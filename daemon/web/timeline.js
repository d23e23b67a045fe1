// A day as a strip below the picture: recordings, visits, and the moment that is played. A click plays another moment.

import { get } from "/web/api.js";
import { $, complain, el, finite, setText, toast } from "/web/ui.js";

const DAY_MS = 86400000;
const LEAST_MS = 5 * 60000; // of the window
const REFRESH_MS = 10000;
const LEAD_MS = 1500; // a visit is played from a moment before it
const NEAR_PX = 5;
const DRAG_PX = 5;
const TICK_PX = 72; // of a time with AM or PM, and a gap
const TICKS = [60, 300, 600, 1800, 3600, 10800, 21600].map((s) => 1000 * s);
const MOST = 1000;

const clock = (ms, seconds = true) => new Date(ms).toLocaleTimeString(undefined,
  { hour: "2-digit", minute: "2-digit", ...(seconds ? { second: "2-digit" } : {}) });

export class Timeline {
  /** @param app  {replay, labels}; @param onPlay  async (time) */
  constructor(app, onPlay) {
    this.app = app;
    this.onPlay = onPlay;
    this.day = midnight(Date.now());
    this.from = this.day;
    this.to = this.day + DAY_MS;
    this.recordings = []; // {from, to} in ms
    this.visits = [];     // {from, to, label}
    this.cursor = NaN;
    this.shown = 0;
    this.listen();
    $("day-before").addEventListener("click", () => this.setDay(midnight(this.day - DAY_MS / 2)));
    $("day-after").addEventListener("click", () => this.setDay(midnight(this.day + 1.5 * DAY_MS)));
    setInterval(() => this.tick(), 500);
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
    this.draw();
  }

  /** @param day  ms of its beginning here */
  setDay(day) {
    if (day > Date.now()) return;
    this.day = this.from = day;
    this.to = day + DAY_MS;
    this.refresh();
  }

  async refresh() {
    this.shown = Date.now();
    const { day } = this;
    try {
      const query = new URLSearchParams({ limit: MOST, from: iso(day), to: iso(day + DAY_MS - 1) });
      const [visits, kept] = await Promise.all([get(`/api/v1/visits?${query}`), get("/api/v1/recordings")]);
      if (day !== this.day) return;
      const span = ({ from, to, label }) => ({ from: Date.parse(from), to: Date.parse(to), label });
      this.visits = visits.visits.map(span).reverse();
      this.recordings = kept.recordings.map(span).filter(({ from, to }) => to > day && from < day + DAY_MS);
    } catch (error) {
      if (error.status !== 0) complain(error);
    }
    this.draw();
  }

  // --- drawing ---

  x(ms) {
    return 100 * (ms - this.from) / (this.to - this.from);
  }

  draw() {
    const bar = ({ from, to }, what, colour) => {
      const node = el("i", { class: what });
      const left = Math.max(this.x(from), 0);
      node.style.left = `${left}%`;
      node.style.width = `${Math.min(this.x(to), 100) - left}%`;
      if (colour) node.style.background = colour;
      return node;
    };
    const inside = ({ from, to }) => to > this.from && from < this.to;
    const line = (ms, what) => (ms >= this.from && ms <= this.to ? [bar({ from: ms, to: ms }, what)] : []);
    const played = this.app.replay.open ? this.app.replay.at() : NaN;
    $("day-bars").replaceChildren(
      ...this.recordings.filter(inside).map((span) => bar(span, "recorded")),
      ...this.visits.filter(inside).map((span) => bar(span, "visited", this.app.labels.colourOf(span.label))),
      ...line(Date.now(), "now"), ...line(played, "played"), ...line(this.cursor, "cursor"));
    this.drawTicks();
    setText($("day-name"), new Date(this.day).toLocaleDateString(undefined, { weekday: "short", day: "numeric", month: "short" }));
    $("day-after").disabled = this.day + DAY_MS > Date.now();
    const at = finite(this.cursor) ? this.cursor : played;
    const there = this.visits.filter(({ from, to }) => at >= from - LEAD_MS && at <= to).map(({ label }) => label || "something");
    const recorded = this.recordings.some(({ from, to }) => at >= from && at <= to);
    const day = $("day");
    day.setAttribute("aria-valuenow", finite(at) ? Math.round((at - this.day) / 1000) : 0);
    day.setAttribute("aria-valuetext", finite(at) ? `${clock(at)}, ${[...new Set(there), recorded ? "recorded" : "not recorded"].join(", ")}`
      : `${this.visits.length} visits, ${this.recordings.length} recordings`);
    const label = $("day-cursor");
    label.hidden = !finite(this.cursor);
    if (label.hidden) return;
    setText(label, [clock(this.cursor), ...new Set(there)].join(" · "));
    label.style.left = `${Math.min(Math.max(this.x(this.cursor), 4), 96)}%`;
  }

  drawTicks() {
    const most = Math.min(Math.max(Math.floor($("day").clientWidth / TICK_PX), 2), 9); // texts must not overlap
    const step = TICKS.find((ms) => (this.to - this.from) / ms <= most) ?? TICKS.at(-1);
    const ticks = [];
    for (let at = this.day; at < this.to; at += step)
      if (at > this.from && this.x(at) < 98) {
        const node = el("span", {}, clock(at, false));
        node.style.left = `${this.x(at)}%`;
        ticks.push(node);
      }
    $("day-ticks").replaceChildren(...ticks);
  }

  // --- pointing ---

  at(event) {
    const box = $("day").getBoundingClientRect();
    return this.from + (event.clientX - box.left) / box.width * (this.to - this.from);
  }

  listen() {
    const day = $("day");
    let drag = null;
    day.addEventListener("pointerdown", (event) => {
      drag = { x: event.clientX, from: this.from, moved: false };
      day.setPointerCapture(event.pointerId);
    });
    day.addEventListener("pointermove", (event) => {
      if (drag && Math.abs(event.clientX - drag.x) > DRAG_PX) drag.moved = true;
      if (drag?.moved) this.window(drag.from - (event.clientX - drag.x) / day.clientWidth * (this.to - this.from), this.to - this.from);
      this.cursor = this.at(event);
      this.draw();
    });
    day.addEventListener("pointerup", (event) => {
      const tapped = drag && !drag.moved;
      drag = null;
      if (tapped) this.play(this.near(this.at(event)));
    });
    for (const kind of ["pointerleave", "blur", "pointercancel"])
      day.addEventListener(kind, () => {
        drag = null;
        this.cursor = NaN;
        this.draw();
      });
    day.addEventListener("wheel", (event) => {
      event.preventDefault();
      const span = Math.min(Math.max((this.to - this.from) * 2 ** (Math.sign(event.deltaY) * 0.5), LEAST_MS), DAY_MS);
      const at = this.at(event);
      this.window(at - (at - this.from) * span / (this.to - this.from), span);
    }, { passive: false });
    day.addEventListener("keydown", (event) => this.key(event));
  }

  window(from, span) {
    this.from = Math.min(Math.max(from, this.day), this.day + DAY_MS - span);
    this.to = this.from + span;
    this.draw();
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
    if (event.key in steps) this.cursor = start + steps[event.key];
    else if (event.key === "PageUp") this.cursor = this.visits.findLast(({ from }) => from < start - 1)?.from ?? start;
    else if (event.key === "PageDown") this.cursor = this.visits.find(({ from }) => from > start + 1)?.from ?? start;
    else if (event.key === "Home") this.cursor = this.from;
    else if (event.key === "End") this.cursor = this.to;
    else if (event.key === "Enter" || event.key === " ") this.play(this.near(start));
    else return;
    event.preventDefault();
    this.cursor = Math.min(Math.max(this.cursor, this.day), this.day + DAY_MS - 1);
    if (this.cursor < this.from || this.cursor > this.to) this.window(this.cursor - (this.to - this.from) / 2, this.to - this.from);
    this.draw();
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
