// What happened: the newest first, as it happens.

import { getLines } from "/web/api.js";
import { $, el, localTime, sentence, setText, zone } from "/web/ui.js";

const KEPT = 500;
const BRIEF = 5;
const LEVELS = { info: 0, warning: 1, error: 2 };
const MARKS = ["", "▲", "■"];

const levelOf = (event) => LEVELS[event.level] ?? (Number.isInteger(event.level) ? event.level : 0);

export class Events {
  /** @param onEvent  called with each that is new since the page was opened */
  constructor(onEvent) {
    this.onEvent = onEvent;
    this.list = []; // newest first
    this.known = new Set();
    this.level = 0;
    this.unseen = 0;
    this.last = null; // id of the newest; null: never asked
    setText($("zone"), `Times are this device's: ${zone()}. Files are named in UTC.`);
    for (const radio of document.querySelectorAll("input[name=level]"))
      radio.addEventListener("change", () => {
        this.level = LEVELS[radio.value];
        this.show();
      });
  }

  /** Those since the last time. They are asked for rather than listened to: a browser has few connections to a host. */
  async refresh() {
    const lines = await getLines(`/api/v1/events?limit=${KEPT}${this.last === null ? "" : `&after=${this.last}`}`);
    for (const event of lines) this.add(event, this.last !== null);
    this.last = lines.reduce((most, event) => Math.max(most, event.id), this.last ?? 0);
    if (lines.length || $("events-state").textContent) this.show();
  }

  /** The service began anew, and counts from 1. */
  restarted() {
    this.last = 0;
  }

  /** Ids begin anew when the service does: an event is known by its time too. */
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

  seen() {
    this.unseen = 0;
    this.show();
  }

  show() {
    const count = $("event-count");
    count.hidden = this.unseen === 0;
    setText(count, this.unseen > 99 ? "99+" : String(this.unseen));
    count.setAttribute("aria-label", `${this.unseen} new warnings or errors`);
    fill($("latest"), this.list.slice(0, BRIEF));
    if ($("panel-events").hidden) return;
    const wanted = this.list.filter((event) => levelOf(event) >= this.level);
    fill($("events"), wanted);
    setText($("events-state"), wanted.length ? "" : this.level ? "Nothing of that kind has happened." : "Nothing has happened yet.");
  }
}

/** Rows are kept where they stay the same, so that a long list costs nothing when one is added. */
function fill(list, events) {
  const key = (event) => `${event.id} ${event.time}`;
  const rows = new Map([...list.children].map((row) => [row.dataset.key, row]));
  const wanted = events.map((event) => rows.get(key(event)) ?? row(event, key(event)));
  const keep = new Set(wanted);
  for (const old of [...list.children]) if (!keep.has(old)) old.remove();
  wanted.forEach((node, i) => { if (list.children[i] !== node) list.insertBefore(node, list.children[i] ?? null); });
}

function row(event, key) {
  const level = levelOf(event);
  const name = ["", "Warning: ", "Error: "][level];
  return el("li", { dataset: { key, level: String(level) }, title: event.type },
    el("time", { datetime: event.time }, localTime(event.time)), el("i", { "aria-hidden": "true" }, MARKS[level]),
    el("span", {}, name && el("span", { class: "visually-hidden" }, name), sentence(event.message)));
}
