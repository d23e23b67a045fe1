// Visits: a card with pictures each, the newest first, without end; reviewed one after the other or many at once, also by keys alone.
// SPDX-FileCopyrightText: 2026 The sst contributors
// SPDX-License-Identifier: Apache-2.0

import { get, post } from "/web/api.js";
import { Cards } from "/web/cards.js";
import { forget, portrait } from "/web/portrait.js";
import { recordedMoment, recordings } from "/web/recorded.js";
import { $, complain, el, forbid, icon, localTime, offer, onUse, setText, storage, toast } from "/web/ui.js";
import { LargeVisit } from "/web/visit.js";
import { act, ACTIONS } from "/web/visit_actions.js";
import { facts, KINDS, momentOf, pictures, title, what } from "/web/visit_words.js";

const PAGE = 60;
const CYCLE_MS = 800; // of the pictures of a card under the pointer
const PRESS_MS = 500; // of a finger that selects
const MOVED_PX = 10;
const SOON_MS = 700; // several events make one request
const HINT = "sst-hint-visits";

export class Visits {
  /** @param onPlay  async (visit): plays the recording of its moment; throws an ApiError, 404 if there is none
   *  @param played  () => name of the visit that is played, or "" */
  constructor(onPlay, played) {
    this.onPlay = onPlay;
    this.played = played;
    this.list = [];
    this.more = false; // older ones are not loaded
    this.turn = 0; // of filters and changes: answers to others are out of date
    this.asked = 0; // turn of the page that is awaited; 0: none
    this.loading = null;
    this.current = ""; // name, for keys
    this.chosen = new Set(); // names of the selection
    this.reviewing = new Set(); // visits with a review to be sent
    this.sending = false;
    this.anchor = ""; // where it began
    this.opening = ""; // name that was asked for last
    this.cards = new Cards($("visits"), { build: () => this.build(), show: (row, visit) => this.showCard(row, visit), drop: (row) => this.drop(row) },
      () => this.loadMore().catch(complain));
    this.large = new LargeVisit(this);
    for (const id of ["visits-label", "visits-zone", "visits-day"]) $(id).addEventListener("change", () => this.filter());
    for (const radio of $("visits-reviewed").querySelectorAll("input")) radio.addEventListener("change", () => this.filter());
    $("hint-visits-close").addEventListener("click", () => this.explained());
    $("visits-wide").addEventListener("click", () => this.widen());
    $("selection").append(...ACTIONS.filter((action) => action.many).map((action) => this.button(action, () => this.selection(), false)),
      el("button", { type: "button", class: "small", id: "selection-clear", onclick: () => this.select([]) }, "Deselect"));
  }

  /** The hint is shown until it was read or a card was opened, and never again. */
  explained() {
    storage(HINT, "seen");
    $("hint-visits").hidden = true;
  }

  /** More room for cards, less for the picture. */
  widen() {
    const on = document.querySelector(".layout").toggleAttribute("data-wide");
    $("visits-wide").setAttribute("aria-pressed", String(on));
  }

  // --- the list ---

  /** Visits that the filters of the panel choose. */
  wants({ label, zones }) {
    return (!$("visits-label").value || label === $("visits-label").value) && (!$("visits-zone").value || zones.includes($("visits-zone").value));
  }

  kinds() {
    const query = new URLSearchParams();
    for (const name of ["label", "zone"]) if ($(`visits-${name}`).value) query.set(name, $(`visits-${name}`).value);
    return query;
  }

  query() {
    const query = this.kinds();
    const day = $("visits-day").value;
    const reviewed = $("visits-reviewed").querySelector("input:checked").value;
    query.set("limit", PAGE);
    if (reviewed) query.set("reviewed", reviewed);
    if (day) { // of this device's time zone
      const from = new Date(`${day}T00:00:00`);
      query.set("from", from.toISOString());
      query.set("to", new Date(new Date(from).setDate(from.getDate() + 1) - 1).toISOString());
    }
    return query;
  }

  filter() {
    this.list = [];
    this.current = "";
    this.select([]);
    this.refresh().catch(complain);
  }

  /** After an event of a visit. */
  soon() {
    this.waiting ??= setTimeout(() => {
      this.waiting = null;
      this.refresh().catch(complain);
    }, SOON_MS);
  }

  /** The newest page replaces its part of the list. */
  async refresh() {
    const turn = this.asked = ++this.turn;
    const [page] = await Promise.all([get(`/api/v1/visits?${this.query()}`), recordings().catch(() => {})]);
    if (turn !== this.turn) return;
    this.asked = 0;
    const last = page.visits.at(-1)?.visit ?? "";
    const rest = page.more ? this.list.filter(({ visit }) => visit < last) : [];
    this.more = page.more === true && (rest.length === 0 || this.more);
    this.take([...page.visits, ...rest]);
    this.showCounts().catch(() => {}); // the next time
  }

  loadMore() {
    if (!this.more || !this.list.length) return Promise.resolve();
    const { turn } = this;
    this.loading ??= this.loadPage(turn).finally(() => {
      this.loading = null;
      if (turn !== this.turn) this.cards.draw(); // it was of another list: its end may be in view, too
    });
    return this.loading;
  }

  async loadPage(turn) {
    const query = this.query();
    query.set("before", this.list.at(-1).visit);
    const page = await get(`/api/v1/visits?${query}`);
    if (turn !== this.turn) return;
    this.more = page.more === true;
    this.take([...this.list, ...page.visits]);
  }

  take(list) {
    this.list = list;
    const there = new Set(list.map(({ visit }) => visit));
    for (const name of this.chosen) if (!there.has(name)) this.chosen.delete(name);
    $("hint-visits").hidden = storage(HINT) === "seen" || !list.length;
    offer($("visits-label"), list.map((visit) => visit.label).filter(Boolean));
    offer($("visits-zone"), list.flatMap((visit) => visit.zones));
    this.draw();
  }

  draw() {
    this.cards.set(this.list);
    this.showSelection();
    const filtered = $("visits-label").value || $("visits-zone").value || $("visits-day").value || $("visits-reviewed").querySelector("input:checked").value;
    setText($("visits-state"), this.list.length ? "" : filtered ? "Nothing of that kind." : "Nothing has come into view yet. " +
      "What moves is kept here with a picture; without viewers only where `zones:` or `record_on:` ask for it.");
  }

  /** Numbers of visits of the chosen kind and day: all, to review, reviewed. */
  async showCounts() {
    const query = this.kinds();
    const day = $("visits-day").value;
    query.set("offset_min", -(day ? new Date(`${day}T12:00:00`) : new Date()).getTimezoneOffset());
    if (day) for (const end of ["from", "to"]) query.set(end, day);
    const { days } = await get(`/api/v1/visits/days?${query}`);
    const sum = (of) => days.reduce((n, one) => n + of(one), 0);
    for (const [id, n] of [["all", sum((one) => one.visits)], ["new", sum((one) => one.visits - one.reviewed)], ["done", sum((one) => one.reviewed)]])
      setText($(`visits-${id}`), String(n));
  }

  find(name) {
    return this.list.find(({ visit }) => visit === name);
  }

  /** The one so many places on, after the ones that must be loaded for it; null: there is none. */
  async next(visit, step) {
    const at = () => this.list.findIndex((other) => other.visit === visit?.visit); // newer ones may come meanwhile
    if (at() + step >= this.list.length) await this.loadMore();
    return this.list[at() + step] ?? null;
  }

  /** Why its recording cannot be played; "": it can. */
  unrecorded(visit) {
    return visit.active || recordedMoment(momentOf(visit), Date.parse(visit.from), Date.parse(visit.to)) !== null ? "" : "not recorded, or the recording is gone";
  }

  // --- cards ---

  /** @param which  () => [visit...]; @param bare  a picture without text */
  button({ name, icon: picture, text, control, danger }, which, bare) {
    const node = el("button", { type: "button", class: `${bare ? "icon" : "small"}${danger ? " danger" : ""}`, title: bare && text, dataset: { action: name, ...(control ? { control: "" } : {}) } },
      icon(picture), bare ? null : ` ${text}`);
    onUse(node, () => act(name, which(), this));
    return node;
  }

  build() {
    const row = { picture: el("span", { class: "visit-picture" }), name: el("strong", {}), when: el("span", { class: "quiet" }),
      facts: el("span", { class: "quiet facts-line" }), flag: el("span", { class: "visit-flag" }), shown: "" };
    row.open = el("button", { type: "button", class: "visit-open" }, row.picture, row.flag, el("span", { class: "visit-text" }, row.name, row.when, row.facts));
    row.box = el("input", { type: "checkbox", class: "visit-check" });
    row.box.addEventListener("change", () => this.toggle(row.visit));
    row.actions = ACTIONS.filter((action) => action.card).map((action) => ({ action, node: this.button(action, () => [row.visit], true) }));
    row.node = el("div", { class: "visit", role: "listitem" }, row.open, row.box, el("div", { class: "visit-actions" }, ...row.actions.map(({ node }) => node)));
    row.open.addEventListener("click", (event) => this.click(row, event));
    row.open.addEventListener("focus", () => { this.current = row.visit.visit; });
    row.node.addEventListener("pointerenter", (event) => { if (event.pointerType === "mouse") this.cycle(row, true); });
    row.node.addEventListener("pointerleave", () => this.cycle(row, false));
    this.listenLong(row);
    return row;
  }

  showCard(row, visit) {
    row.visit = visit;
    const shown = `${visit.visit} ${visit.pictures} ${visit.box}`;
    if (row.shown !== shown) {
      row.shown = shown;
      forget(row.picture);
      row.picture.replaceChildren(...[portrait(visit)].filter(Boolean));
    }
    setText(row.name, what(visit));
    setText(row.when, localTime(visit.from));
    setText(row.facts, facts(visit));
    const lost = this.unrecorded(visit);
    setText(row.flag, lost ? "No recording" : "");
    row.node.toggleAttribute("data-active", visit.active);
    row.node.toggleAttribute("data-reviewed", visit.reviewed === true);
    row.node.toggleAttribute("data-chosen", this.chosen.has(visit.visit));
    row.box.checked = this.chosen.has(visit.visit);
    const named = title(visit);
    if (row.named !== named) {
      row.named = named;
      row.box.setAttribute("aria-label", `Select ${named}`);
      for (const { action, node } of row.actions) node.setAttribute("aria-label", `${action.text}: ${named}`);
    }
    for (const { action, node } of row.actions) {
      if (action.pressed) node.setAttribute("aria-pressed", String(action.pressed(visit) === true));
      if (action.off) forbid(node, action.off(visit, this));
    }
  }

  /** A card that leaves the page gives its pictures back at once. */
  drop(row) {
    this.cycle(row, false);
    forget(row.node);
    row.shown = "";
  }

  /** Under the pointer the pictures of a visit follow each other. */
  cycle(row, on) {
    clearInterval(row.timer);
    row.timer = null;
    if (row.other) forget(row.other);
    row.other?.remove();
    row.other = null;
    const [, other] = pictures(row.visit);
    if (!on || !other) return;
    row.other = el("span", { class: "visit-other" }, portrait(row.visit, other), el("span", { class: "visit-kind" }, KINDS[other]));
    row.other.hidden = !matchMedia("(prefers-reduced-motion: reduce)").matches;
    row.picture.append(row.other);
    if (row.other.hidden) row.timer = setInterval(() => { row.other.hidden = !row.other.hidden; }, CYCLE_MS);
  }

  click({ visit }, event) {
    if (this.pressed) return; // the finger that selected is lifted
    const touch = event.pointerType === "touch";
    if (event.shiftKey) this.selectTo(visit);
    else if (event.ctrlKey || event.metaKey || (touch && this.chosen.size)) this.toggle(visit);
    else this.show(visit);
  }

  show(visit) {
    this.explained();
    this.large.show(visit);
  }

  // --- selecting ---

  /** A finger that stays selects. */
  listenLong(row) {
    let timer, x, y;
    const end = () => clearTimeout(timer);
    row.open.addEventListener("pointerdown", (event) => {
      this.pressed = false;
      if (event.pointerType !== "touch") return;
      [x, y] = [event.clientX, event.clientY];
      timer = setTimeout(() => {
        this.pressed = true;
        this.toggle(row.visit);
      }, PRESS_MS);
    });
    row.open.addEventListener("pointermove", (event) => { if (Math.hypot(event.clientX - x, event.clientY - y) > MOVED_PX) end(); });
    for (const kind of ["pointerup", "pointercancel", "pointerleave"]) row.open.addEventListener(kind, end);
    row.open.addEventListener("contextmenu", (event) => { if (this.pressed) event.preventDefault(); });
  }

  selection() {
    return this.list.filter(({ visit }) => this.chosen.has(visit));
  }

  select(names) {
    this.chosen = new Set(names);
    this.draw();
  }

  toggle({ visit }) {
    this.anchor = this.current = visit;
    this.select(this.chosen.has(visit) ? [...this.chosen].filter((name) => name !== visit) : [...this.chosen, visit]);
  }

  /** From where the selection began, to here. */
  selectTo({ visit }) {
    const names = this.list.map((one) => one.visit);
    const from = Math.max(names.indexOf(this.anchor || this.current), 0), to = names.indexOf(visit);
    this.current = visit;
    this.select([...this.chosen, ...names.slice(Math.min(from, to), Math.max(from, to) + 1)]);
  }

  showSelection() {
    const n = this.chosen.size;
    $("selection").hidden = n === 0;
    $("visits").toggleAttribute("data-choosing", n > 0);
    setText($("selection-count"), `${n} selected`);
    const list = this.selection();
    for (const action of ACTIONS.filter((one) => one.many && one.pressed))
      $("selection").querySelector(`[data-action=${action.name}]`).setAttribute("aria-pressed", String(n > 0 && list.every(action.pressed)));
  }

  // --- changes ---

  /** @param change  {reviewed}, {keep} or {delete: true}; throws as post() does */
  async change(list, change) {
    const names = list.map(({ visit }) => visit);
    for (let at = 0; at < names.length; at += 1000) {
      const { failed } = await post("/api/v1/visits", { visits: names.slice(at, at + 1000), ...change });
      for (const { visit, error } of failed.slice(0, 1)) {
        complain(new Error(failed.length > 1 ? `${failed.length} visits are not changed: ${error}` : error));
        if (names.length === 1) return;
        names.splice(names.indexOf(visit), 1);
      }
    }
    await this.changed(new Set(names), change);
  }

  /** The cards follow at once; cards that the filter hides now go. */
  async changed(names, change) {
    const reviewed = $("visits-reviewed").querySelector("input:checked").value;
    const leaves = ({ visit }) => names.has(visit) && (change.delete || (reviewed && "reviewed" in change && String(change.reviewed) !== reviewed));
    const at = this.list.findIndex(({ visit }) => visit === this.current);
    const on = this.list.slice(Math.max(at, 0)).find((visit) => !leaves(visit)) ?? this.list.slice(0, Math.max(at, 0)).findLast((visit) => !leaves(visit));
    if (at >= 0 && leaves(this.list[at])) this.current = on?.visit ?? "";
    if (!change.delete) for (const visit of this.list) if (names.has(visit.visit)) Object.assign(visit, change);
    const late = this.asked !== 0; // an answer that is awaited does not know
    this.turn++;
    this.take(this.list.filter((visit) => !leaves(visit)));
    if (late || (!this.list.length && this.more)) await this.refresh();
    else await this.showCounts().catch(() => {});
  }

  async play(visit) {
    const why = this.unrecorded(visit);
    if (why) toast(`${title(visit)}: ${why}.`);
    else await this.onPlay(visit).catch((error) => {
      if (error.status === 404) toast(`No recording has the moment of ${title(visit)}.`);
      else throw error;
    });
  }

  /** Opens one by its name, which begins with its time. */
  async openByName(name) {
    const before = this.large.open;
    this.opening = name;
    const near = new URLSearchParams({ after: name.replace(/-[^-]*$/, ""), before: `${name}-` });
    const found = this.find(name) ?? (/^[\d-]+T[\d-]+Z-\d+$/.test(name) ? (await get(`/api/v1/visits?${near}`)).visits.find((visit) => visit.visit === name) : null);
    if (this.opening !== name || (this.large.open && this.large.open !== before)) return; // another one was opened meanwhile
    if (found) this.show(found);
    else toast("This visit is no longer kept.");
  }

  // --- keys ---

  /** Moves the focus to the card so many places on. */
  async go(step) {
    const at = this.list.findIndex(({ visit }) => visit === this.current);
    const to = at < 0 ? 0 : Math.max(at + step, 0);
    if (to >= this.list.length) await this.loadMore();
    this.focus(this.list[Math.min(to, this.list.length - 1)]?.visit);
  }

  focus(name) {
    if (!name) return;
    this.current = name;
    this.cards.reveal(name)?.open.focus({ focusVisible: true });
  }

  /** The selection, else the card with the focus. */
  meant() {
    return this.chosen.size ? this.selection() : [this.find(this.current)].filter(Boolean);
  }

  async review() {
    if (this.chosen.size) {
      const list = this.selection();
      await act("reviewed", list, this);
      this.select([...this.chosen].filter((name) => !list.some(({ visit }) => visit === name)));
      return;
    }
    const visit = this.find(this.current);
    if (!visit) {
      await this.go(0);
      return;
    }
    const next = this.list[this.list.indexOf(visit) + 1] ?? await this.next(visit, 1);
    this.focus((next ?? visit).visit); // before the answer: the next press is of the next one
    if (!visit.reviewed) this.reviewing.add(visit);
    await this.sendReviewed();
  }

  /** One request at a time: keys that repeat faster than the service answers are of the next one. */
  async sendReviewed() {
    if (this.sending || !this.reviewing.size) return;
    const list = [...this.reviewing].filter((visit) => !visit.reviewed); // by the request before
    this.reviewing.clear();
    if (!list.length) return;
    this.sending = true;
    await act("reviewed", list, this);
    this.sending = false;
    await this.sendReviewed();
  }

  /** @param pause  () => void: playing */
  listenKeys(keys, pause) {
    const shown = () => !$("panel-visits").hidden && !document.querySelector("dialog[open]");
    const inList = ({ target }) => shown() && (target === document.body || target === $("panel-visits") || target.closest("#visits") !== null);
    const onCard = (event) => inList(event) && !event.target.closest("button:not(.visit-open), input");
    const play = (event) => {
      const visit = this.find(this.current);
      if (visit && event.key === " " && this.played() === visit.visit) pause();
      else act("play", [visit].filter(Boolean), this);
    };
    keys.add("Visits", [["J  K", "the next card, the one before"], ["Arrows", "to the cards beside"], ["Enter", "plays the recording of the card"],
      ["Space", "plays it, pauses"], ["O", "opens the card large"], ["R", "reviewed, and to the next"], ["X", "selects the card"],
      ["Shift ↓  Ctrl A", "selects more, all loaded ones"], ["S", "keeps it for good, or no longer"], ["Del", "deletes it, or the selection, after a question"],
      ["U", "all, to review, reviewed"], ["W", "more room for cards"], ["Esc", "ends the selection"]], shown, {
      j: () => this.go(1), k: () => this.go(-1), r: () => this.review(), w: () => this.widen(),
      x: () => (this.find(this.current) ? this.toggle(this.find(this.current)) : this.go(0)),
      o: () => (this.find(this.current) ? this.show(this.find(this.current)) : this.go(0)), s: () => act("keep", this.controlled("keep"), this),
      u: () => this.nextFilter(), Delete: () => act("delete", this.controlled("delete"), this),
    });
    keys.add("", [], inList, { ArrowRight: () => this.go(1), ArrowLeft: () => this.go(-1), ArrowDown: () => this.go(this.cards.columns()), ArrowUp: () => this.go(-this.cards.columns()),
      Home: () => this.focus(this.list[0]?.visit), End: () => this.focus(this.list.at(-1)?.visit), Escape: () => this.select([]),
      "Shift+ArrowDown": () => this.extend(this.cards.columns()), "Shift+ArrowUp": () => this.extend(-this.cards.columns()),
      "Shift+ArrowRight": () => this.extend(1), "Shift+ArrowLeft": () => this.extend(-1) });
    keys.add("", [], onCard, { Enter: play, " ": play });
    keys.add("One visit, large", [["J  K  ← →", "the next one, the one before"], ["R", "reviewed"], ["S", "keep"], ["P", "plays its recording"], ["Del", "deletes it, after a second press"]], () => false, {});
    document.addEventListener("keydown", (event) => {
      if (event.key !== "a" || !(event.ctrlKey || event.metaKey) || !inList(event)) return;
      event.preventDefault();
      this.select(this.list.map(({ visit }) => visit));
    });
  }

  async extend(step) {
    const from = this.find(this.current);
    if (!from) return;
    if (!this.chosen.size) this.anchor = from.visit;
    await this.go(step);
    this.selectTo(this.find(this.current));
  }

  /** The visits that are meant, if the token may change them. */
  controlled(name) {
    const { reason } = $("selection").querySelector(`[data-action=${name}]`).dataset;
    if (reason) toast(reason);
    return reason ? [] : this.meant();
  }

  nextFilter() {
    const radios = [...$("visits-reviewed").querySelectorAll("input")];
    radios[(radios.findIndex((radio) => radio.checked) + 1) % radios.length].click();
  }
}
