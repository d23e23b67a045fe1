// The event log, newest first, updated live.

import { clock, getLines } from "/web/api.js";
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
    offer($("events-label"), this.list.map((event) => event.data?.label).filter(Boolean));
    offer($("events-zone"), this.list.flatMap((event) => [event.data?.zone, ...(event.data?.zones ?? [])]).filter(Boolean));
    const wanted = this.list.filter((event) => this.wants(event));
    fill($("events"), wanted);
    setText($("events-state"), wanted.length ? "" : this.list.length ? "Nothing of that kind has happened." : "Nothing has happened yet.");
  }
}

/** Unchanged rows are reused, so adding one to a long list is cheap. */
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
