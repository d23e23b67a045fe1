// A month with a dot on each day on which visits came: full where some are to be reviewed, hollow where all are reviewed.
// SPDX-FileCopyrightText: 2026 The sst contributors
// SPDX-License-Identifier: Apache-2.0

import { get } from "/web/api.js";
import { $, complain, el, setText } from "/web/ui.js";

const two = (n) => String(n).padStart(2, "0");
const nameOf = (date) => `${date.getFullYear()}-${two(date.getMonth() + 1)}-${two(date.getDate())}`;

/** 1: Monday ... 7: Sunday, as the locale has it. */
function firstWeekday() {
  const locale = new Intl.Locale(navigator.language);
  return (locale.getWeekInfo?.() ?? locale.weekInfo)?.firstDay ?? 1;
}

export class Calendar {
  /** @param onChoose  ("2026-11-21", or "" for all days) => void */
  constructor(onChoose) {
    this.onChoose = onChoose;
    this.box = $("calendar");
    this.month = new Date();
    for (const id of ["calendar-open", "day-name"]) $(id).addEventListener("click", () => this.toggle($(id)));
    for (const [id, step] of [["calendar-before", -1], ["calendar-after", 1]]) $(id).addEventListener("click", () => this.turn(step));
    $("calendar-today").addEventListener("click", () => this.choose(nameOf(new Date())));
    $("calendar-all").addEventListener("click", () => this.choose(""));
    $("calendar-days").addEventListener("keydown", (event) => this.key(event));
  }

  toggle(button) {
    if (this.box.matches(":popover-open")) {
      this.box.hidePopover();
      return;
    }
    const chosen = $("visits-day").value;
    this.month = chosen ? new Date(`${chosen}T12:00:00`) : new Date();
    this.day = nameOf(this.month);
    this.box.showPopover();
    this.draw(new Map());
    const at = button.getBoundingClientRect(), own = this.box.getBoundingClientRect();
    this.box.style.left = `${Math.max(Math.min(at.left, innerWidth - own.width - 8), 8)}px`;
    this.box.style.top = `${at.bottom + own.height + 8 < innerHeight ? at.bottom + 4 : Math.max(at.top - own.height - 4, 8)}px`;
    this.load();
    this.box.querySelector("[tabindex='0']")?.focus();
  }

  turn(step) {
    const { month } = this;
    const days = new Date(month.getFullYear(), month.getMonth() + step + 1, 0).getDate();
    this.month = new Date(month.getFullYear(), month.getMonth() + step, Math.min(Number(this.day.slice(8)), days), 12);
    this.day = nameOf(this.month);
    this.draw(new Map());
    this.load();
  }

  choose(day) {
    this.box.hidePopover();
    this.onChoose(day);
  }

  ends() {
    const { month } = this;
    return [new Date(month.getFullYear(), month.getMonth(), 1, 12), new Date(month.getFullYear(), month.getMonth() + 1, 0, 12)];
  }

  /** Counts by days: one request for each offset from UTC that the month has, where clocks change within it. */
  async load() {
    const [first, last] = this.ends();
    const { month } = this;
    const spans = new Map(); // offset: [first day, last day]
    for (const at = new Date(first); at <= last; at.setDate(at.getDate() + 1)) {
      const offset = -at.getTimezoneOffset();
      spans.set(offset, [spans.get(offset)?.[0] ?? nameOf(at), nameOf(at)]);
    }
    try {
      const answers = await Promise.all([...spans].map(([offset_min, [from, to]]) => get(`/api/v1/visits/days?${new URLSearchParams({ offset_min, from, to })}`)));
      if (month === this.month) this.draw(new Map(answers.flatMap(({ days }) => days).map((day) => [day.day, day])));
    } catch (error) {
      complain(error);
    }
  }

  draw(counts) {
    const focused = this.box.contains(document.activeElement) && document.activeElement.dataset.day;
    const [first, last] = this.ends();
    const start = firstWeekday() % 7;
    const lead = (first.getDay() - start + 7) % 7;
    const weekday = (i) => new Date(2026, 10, 1 + start + i); // a Sunday, and so on
    setText($("calendar-month"), first.toLocaleDateString(undefined, { month: "long", year: "numeric" }));
    $("calendar-after").disabled = last > new Date();
    const head = [...Array(7)].map((_, i) => el("th", { scope: "col", abbr: weekday(i).toLocaleDateString(undefined, { weekday: "long" }) },
      weekday(i).toLocaleDateString(undefined, { weekday: "short" })));
    const cells = [...Array(lead)].map(() => el("td"));
    for (let n = 1; n <= last.getDate(); n++) cells.push(el("td", {}, this.cell(new Date(first.getFullYear(), first.getMonth(), n, 12), counts)));
    const rows = [];
    for (let i = 0; i < cells.length; i += 7) rows.push(el("tr", {}, ...cells.slice(i, i + 7)));
    $("calendar-days").replaceChildren(el("thead", {}, el("tr", {}, ...head)), el("tbody", {}, ...rows));
    if (focused) this.focus();
  }

  cell(date, counts) {
    const day = nameOf(date);
    const { visits = 0, reviewed = 0 } = counts.get(day) ?? {};
    const said = [date.toLocaleDateString(undefined, { weekday: "long", day: "numeric", month: "long" }), visits === 1 ? "1 visit" : visits ? `${visits} visits` : "no visits",
      visits > reviewed ? `${visits - reviewed} to review` : visits ? "all reviewed" : ""].filter(Boolean).join(", ");
    return el("button", { type: "button", "aria-label": said, title: said, tabindex: day === this.day ? "0" : "-1", disabled: date > new Date() && day !== nameOf(new Date()),
      "aria-pressed": String($("visits-day").value === day), "aria-current": day === nameOf(new Date()) ? "date" : null, onclick: () => this.choose(day), dataset: { day } },
    String(date.getDate()), el("i", { "aria-hidden": "true", dataset: { dot: visits > reviewed ? "new" : visits ? "done" : "" } }));
  }

  focus() {
    this.box.querySelector(`[data-day="${this.day}"]`)?.focus();
  }

  key(event) {
    const step = { ArrowLeft: -1, ArrowRight: 1, ArrowUp: -7, ArrowDown: 7 }[event.key];
    if (event.key === "PageUp" || event.key === "PageDown") this.turn(event.key === "PageUp" ? -1 : 1);
    else if (step) {
      const to = new Date(`${this.day}T12:00:00`);
      to.setDate(to.getDate() + step);
      if (to > new Date()) return;
      const other = to.getMonth() !== this.month.getMonth();
      this.day = nameOf(to);
      if (other) {
        this.month = to;
        this.draw(new Map());
        this.load();
      }
      for (const button of this.box.querySelectorAll("[data-day]")) button.tabIndex = button.dataset.day === this.day ? 0 : -1;
    } else return;
    event.preventDefault();
    this.focus();
  }
}
