// Visits: a card with a picture each, the newest first; one opens large, with its way.

import { get, post } from "/web/api.js";
import { $, complain, duration, el, icon, localTime, number, offer, onUse, setText, storage, toast } from "/web/ui.js";

const MOST = 60;
const MARGIN = 1.7; // of a card's part of the picture over the visitor's size
const ZOOM_MOST = 4;

const SURE_MS = 4000;
const HINT = "sst-hint-visits";
const KINDS = { seen: "See-through", camera: "Camera" };
const address = (visit, kind) => `/api/v1/visits/${encodeURIComponent(visit.visit)}/${kind}`;
const what = (visit) => visit.label || "Something";

export class Visits {
  /** @param onPlay  async (time): plays the recording of a moment; throws an ApiError, 404 if there is none */
  constructor(onPlay) {
    this.onPlay = onPlay;
    this.rows = new Map();
    this.list = [];
    this.open = null;
    this.kind = "seen";
    for (const id of ["visits-label", "visits-zone", "visits-day"])
      $(id).addEventListener("change", () => this.refresh().catch(complain));
    $("visit-close").addEventListener("click", () => $("visit").close());
    $("visit").addEventListener("close", () => { this.open = null; });
    $("visit").addEventListener("keydown", (event) => {
      const step = { ArrowLeft: 1, ArrowRight: -1 }[event.key];
      if (event.key === "k") $("visit-keep").click();
      if (event.key === "Delete") $("visit-delete").click();
      if (!step || event.target.type === "radio") return;
      const next = this.list[this.list.indexOf(this.open) + step];
      if (next) this.show(next);
    });
    for (const radio of $("visit-kind").querySelectorAll("input"))
      radio.addEventListener("change", () => {
        this.kind = radio.value;
        this.show(this.open);
      });
    $("visit-play").addEventListener("click", () => this.play());
    onUse($("visit-keep"), () => this.keep());
    onUse($("visit-export"), () => this.export());
    onUse($("visit-delete"), () => this.delete());
    $("hint-visits-close").addEventListener("click", () => this.explained());
  }

  /** The hint is shown until it was read or a card was opened, and never again. */
  explained() {
    storage(HINT, "seen");
    $("hint-visits").hidden = true;
  }

  /** Visits that the filters of the panel choose. */
  wants({ label, zones }) {
    return (!$("visits-label").value || label === $("visits-label").value) && (!$("visits-zone").value || zones.includes($("visits-zone").value));
  }

  query() {
    const day = $("visits-day").value;
    const query = new URLSearchParams({ limit: MOST });
    if ($("visits-label").value) query.set("label", $("visits-label").value);
    if ($("visits-zone").value) query.set("zone", $("visits-zone").value);
    if (day) { // of this device's time zone
      const from = new Date(`${day}T00:00:00`);
      query.set("from", from.toISOString());
      query.set("to", new Date(from.getTime() + 86400000 - 1).toISOString());
    }
    return query;
  }

  async refresh() {
    this.list = (await get(`/api/v1/visits?${this.query()}`)).visits;
    $("hint-visits").hidden = storage(HINT) === "seen" || !this.list.length;
    offer($("visits-label"), this.list.map((visit) => visit.label).filter(Boolean));
    offer($("visits-zone"), this.list.flatMap((visit) => visit.zones));
    const names = new Set(this.list.map((visit) => visit.visit));
    for (const [name, row] of this.rows)
      if (!names.has(name)) {
        row.node.remove();
        this.rows.delete(name);
      }
    this.list.forEach((visit, i) => {
      if (!this.rows.has(visit.visit)) this.rows.set(visit.visit, this.build(visit));
      const row = this.rows.get(visit.visit);
      if ($("visits").children[i] !== row.node) $("visits").insertBefore(row.node, $("visits").children[i] ?? null);
      this.showCard(row, visit);
    });
    const chosen = $("visits-label").value || $("visits-zone").value || $("visits-day").value;
    setText($("visits-state"), this.list.length ? "" : chosen ? "Nothing of that kind." : "Nothing has come into view yet. " +
      "What moves is kept here with a picture; without viewers only where `zones:` or `record_on:` ask for it.");
  }

  build() {
    const row = { picture: el("span", { class: "visit-picture" }), name: el("strong", {}), when: el("span", { class: "quiet" }),
      facts: el("span", { class: "quiet" }), shown: "" };
    row.node = el("button", { type: "button", class: "visit", onclick: () => this.show(row.visit) }, row.picture,
      el("span", { class: "visit-text" }, row.name, row.when, row.facts));
    return row;
  }

  showCard(row, visit) {
    row.visit = visit;
    const kind = visit.pictures.includes("seen") ? "seen" : visit.pictures[0];
    const shown = kind ? `${address(visit, kind)} ${visit.box}` : "";
    if (row.shown !== shown) {
      row.shown = shown;
      row.picture.replaceChildren(...(kind ? [cut(el("img", { src: address(visit, kind), alt: "", loading: "lazy" }), visit.box)] : []));
    }
    setText(row.name, what(visit));
    setText(row.when, localTime(visit.from));
    setText(row.facts, facts(visit));
    row.node.toggleAttribute("data-active", visit.active);
  }

  // --- one, large ---

  show(visit) {
    this.explained();
    this.open = visit;
    this.sure(false);
    $("visit").dataset.visit = visit.visit;
    $("visit-keep").setAttribute("aria-pressed", String(visit.keep === true));
    $("visit-delete").hidden = visit.active;
    const kind = visit.pictures.includes(this.kind) ? this.kind : visit.pictures[0];
    for (const radio of $("visit-kind").querySelectorAll("input")) {
      radio.checked = radio.value === kind;
      radio.disabled = !visit.pictures.includes(radio.value);
    }
    setText($("visit-title"), `${what(visit)}, ${localTime(visit.from)}`);
    setText($("visit-facts"), facts(visit));
    const image = $("visit-image");
    image.hidden = !kind;
    if (kind) {
      image.src = address(visit, kind);
      image.alt = `${what(visit)}, ${KINDS[kind].toLowerCase()}`;
      $("visit-save").href = image.src;
      $("visit-save").download = `${visit.visit}-${kind}.jpg`;
    }
    $("visit-save").hidden = !kind;
    const way = visit.path.map(([, x, y]) => `${(100 * x).toFixed(1)},${(100 * y).toFixed(1)}`);
    $("visit-way").setAttribute("points", way.join(" "));
    if (!$("visit").open) $("visit").showModal();
  }

  // --- keeping, exporting, deleting ---

  /** Deleting needs a second click. */
  sure(on) {
    clearTimeout(this.asking);
    $("visit-delete").dataset.sure = on;
    setText($("visit-delete"), on ? "Really delete?" : "Delete");
    if (on) this.asking = setTimeout(() => this.sure(false), SURE_MS);
  }

  async change(what) {
    const { visit } = this.open;
    await post(`/api/v1/visits/${encodeURIComponent(visit)}`, what);
    await this.refresh();
    return this.list.find((other) => other.visit === visit);
  }

  async keep() {
    try {
      const visit = await this.change({ keep: this.open.keep !== true });
      if (visit && this.open?.visit === visit.visit) this.show(visit);
    } catch (error) {
      complain(error);
    }
  }

  async delete() {
    if ($("visit-delete").dataset.sure !== "true") {
      this.sure(true);
      return;
    }
    const at = this.list.indexOf(this.open);
    try {
      await this.change({ delete: true });
      if (this.list.length) this.show(this.list[Math.min(Math.max(at, 0), this.list.length - 1)]);
      else $("visit").close();
    } catch (error) {
      complain(error);
    }
  }

  /** The light field of the moment at which it was nearest. */
  async export() {
    const visit = this.open;
    const nearest = visit.path.reduce((best, point) => ((point[3] ?? Infinity) < (best[3] ?? Infinity) ? point : best), visit.path[visit.path.length >> 1]);
    try {
      const { name } = await post("/api/v1/export", { time: new Date(Date.parse(visit.from) + 1000 * (nearest?.[0] ?? 0)).toISOString() });
      setText($("visit-facts"), `${facts(visit)} · its light field is kept as ${name}, below Recordings`);
    } catch (error) {
      this.failed(error, visit);
    }
  }

  failed(error, visit) {
    if (error.status === 404) setText($("visit-facts"), `${facts(visit)} · no recording has this moment`);
    else complain(error);
  }

  /** Opens one by its name, which begins with its time in UTC. */
  async openByName(name) {
    const [, day, h, m, s, ms] = /^(\d+-\d+-\d+)T(\d+)-(\d+)-(\d+)-(\d+)Z/.exec(name) ?? [];
    const from = `${day}T${h}:${m}:${s}.${ms}Z`;
    const found = day ? (await get(`/api/v1/visits?${new URLSearchParams({ from, to: from })}`)).visits.find((visit) => visit.visit === name) : null;
    if (found) this.show(found);
    else toast("This visit is no longer kept.");
  }

  async play() {
    const visit = this.open;
    try {
      await this.onPlay(visit);
      $("visit").close();
    } catch (error) {
      this.failed(error, visit);
    }
  }
}

/** "gate, crossed drive forward" */
function places({ zones, crossed = [] }) {
  const lines = crossed.map(({ zone }) => zone);
  return [...zones.filter((zone) => !lines.includes(zone)), ...crossed.map(({ zone, direction }) => `crossed ${zone} ${direction}`)].join(", ");
}

function facts(visit) {
  return [visit.active ? "there now" : duration(visit.seconds), visit.direction,
    visit.nearest_m === null ? "" : `nearest ${number(visit.nearest_m, 1)} m`, visit.hidden ? "behind the foreground" : "", places(visit), visit.keep ? "kept" : ""].filter(Boolean).join(" · ");
}

/** The part of a picture around the visitor, in a frame that hides the rest. */
function cut(image, [x0, y0, x1, y1]) {
  const zoom = Math.min(Math.max(1 / (MARGIN * Math.max(x1 - x0, y1 - y0, 0.01)), 1), ZOOM_MOST);
  const at = (from, to) => `${(50 - 100 * Math.min(Math.max((from + to) / 2, 0.5 / zoom), 1 - 0.5 / zoom) * zoom).toFixed(1)}%`;
  image.style.width = `${100 * zoom}%`;
  image.style.left = at(x0, x1);
  image.style.top = at(y0, y1);
  return image;
}
