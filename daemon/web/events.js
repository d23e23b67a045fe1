// The event log, newest first, updated live.
// SPDX-FileCopyrightText: 2026 The sst contributors
// SPDX-License-Identifier: Apache-2.0

import { clock, get, getLines } from "/web/api.js";
import { portrait } from "/web/portrait.js";
import { $, el, localTime, offer, sentence, setText, zone } from "/web/ui.js";

const KEPT = 500;
const BRIEF = 5;
const LEVELS = { info: 0, warning: 1, error: 2 };
const MARKS = ["", "▲", "■"];

const levelOf = (event) => LEVELS[event.level] ?? (Number.isInteger(event.level) ? event.level : 0);

export class Events {
  /** @param onEvent  called with each event that arrives after the page was opened */
  constructor(onEvent) {
    this.onEvent = onEvent;
    this.list = []; // newest first
    this.known = new Set();
    this.level = 0;
    this.unseen = 0;
    this.visits = new Map(); // by name, of the events; null: not kept any more
    this.last = null; // id of the newest event; null before the first request
    setText($("zone"), `Times are this device's: ${zone()}. Files are named in UTC.`);
    for (const radio of document.querySelectorAll("input[name=level]"))
      radio.addEventListener("change", () => {
        this.level = LEVELS[radio.value];
        this.show();
      });
    for (const name of ["since", "label", "zone"]) $(`events-${name}`).addEventListener("change", () => this.show());
  }

  /** Events that the filters choose. */
  wants(event) {
    const { label, zone, zones = [] } = event.data ?? {};
    const [since, what, where] = ["since", "label", "zone"].map((name) => $(`events-${name}`).value);
    return levelOf(event) >= this.level && (!since || Date.parse(event.time) >= clock.now() - 1000 * Number(since))
      && (!what || label === what) && (!where || zone === where || zones.includes(where));
  }

  /** Fetches the events since the last call; polled rather than streamed because a browser has few connections per host. */
  async refresh() {
    const lines = await getLines(`/api/v1/events?limit=${KEPT}${this.last === null ? "" : `&after=${this.last}`}`);
    for (const event of lines) this.add(event, this.last !== null);
    this.last = lines.reduce((most, event) => Math.max(most, event.id), this.last ?? 0);
    if (lines.length || $("events-state").textContent) this.show();
    if (lines.length && !$("panel-events").hidden) await this.know();
  }

  /** The service restarted; its event ids start at 1 again. */
  restarted() {
    this.last = 0;
  }

  /** Ids restart with the service: an event is identified by id and time. */
  add(event, isNew) {
    const key = `${event.id} ${event.time}`;
    if (this.known.has(key)) return;
    this.known.add(key);
    this.list.unshift(event);
    if (this.list.length > KEPT) {
      const gone = this.list.pop();
      this.known.delete(`${gone.id} ${gone.time}`);
    }
    if (!isNew) return;
    if ($("panel-events").hidden && levelOf(event) > 0) this.unseen++;
    this.onEvent(event);
  }

  async seen() {
    this.unseen = 0;
    this.show();
    await this.know();
  }

  /** Visits of the events that are shown, with their pictures. */
  async know() {
    const events = this.list.filter((event) => event.data?.visit);
    const unknown = events.filter((event) => !this.visits.has(event.data.visit) || (this.visits.get(event.data.visit)?.pictures.length === 0));
    if (!unknown.length) return;
    for (const { data } of unknown) this.visits.set(data.visit, null);
    const { visits } = await get(`/api/v1/visits?${new URLSearchParams({ limit: 1000, after: unknown.at(-1).data.visit.slice(0, 10) })}`).catch((error) => {
      for (const { data } of unknown) if (this.visits.get(data.visit) === null) this.visits.delete(data.visit); // the next time
      throw error;
    });
    for (const visit of visits) this.visits.set(visit.visit, visit);
    const there = new Set(events.map((event) => event.data.visit));
    for (const name of this.visits.keys()) if (!there.has(name)) this.visits.delete(name);
    this.show();
  }

  show() {
    const count = $("event-count");
    count.hidden = this.unseen === 0;
    setText(count, this.unseen > 99 ? "99+" : String(this.unseen));
    count.setAttribute("aria-label", `${this.unseen} new warnings or errors`);
    fill($("latest"), this.list.slice(0, BRIEF), new Map());
    if ($("panel-events").hidden) return;
    offer($("events-label"), this.list.map((event) => event.data?.label).filter(Boolean));
    offer($("events-zone"), this.list.flatMap((event) => [event.data?.zone, ...(event.data?.zones ?? [])]).filter(Boolean));
    const wanted = this.list.filter((event) => this.wants(event));
    fill($("events"), wanted, this.visits);
    setText($("events-state"), wanted.length ? "" : this.list.length ? "Nothing of that kind has happened." : "Nothing has happened yet.");
  }
}

/** Unchanged rows are reused, so adding one to a long list is cheap. */
function fill(list, events, visits) {
  const key = (event) => `${event.id} ${event.time} ${visits.get(event.data?.visit) === null ? "gone" : visits.get(event.data?.visit)?.pictures ?? ""}`;
  const rows = new Map([...list.children].map((row) => [row.dataset.key, row]));
  const wanted = events.map((event) => rows.get(key(event)) ?? row(event, key(event), visits.get(event.data?.visit)));
  const keep = new Set(wanted);
  for (const old of [...list.children]) if (!keep.has(old)) old.remove();
  wanted.forEach((node, i) => { if (list.children[i] !== node) list.insertBefore(node, list.children[i] ?? null); });
}

/** Address of the visit or recording that an event is of; "": none, or it is not kept any more. */
function address({ data }, visit) {
  if (data?.visit) return visit === null ? "" : `#visit=${encodeURIComponent(data.visit)}`;
  return data?.recording ? `#recording=${encodeURIComponent(data.recording)}` : "";
}

/** @param visit  undefined: not known; null: not kept any more */
function row(event, key, visit) {
  const level = levelOf(event);
  const name = ["", "Warning: ", "Error: "][level];
  const href = address(event, visit);
  const picture = visit && portrait(visit);
  return el("li", { dataset: { key, level: String(level) }, title: event.type },
    el("time", { datetime: event.time }, localTime(event.time)), el("i", { "aria-hidden": "true" }, MARKS[level]),
    el("span", {}, name && el("span", { class: "visually-hidden" }, name), href ? el("a", { href }, sentence(event.message)) : sentence(event.message)),
    picture && el("a", { href, class: "visit-picture", tabindex: "-1", "aria-hidden": "true" }, picture));
}
