// One visit, large: its pictures with its way, and all that can be done with it.
// SPDX-FileCopyrightText: 2026 The sst contributors
// SPDX-License-Identifier: Apache-2.0

import { $, complain, onUse, setText } from "/web/ui.js";
import { exportOne } from "/web/visit_actions.js";
import { address, facts, KINDS, pictures, title, what } from "/web/visit_words.js";

const SURE_MS = 4000;

export class LargeVisit {
  /** @param visits  the list */
  constructor(visits) {
    this.visits = visits;
    this.open = null;
    this.kind = "seen";
    $("visit-close").addEventListener("click", () => $("visit").close());
    $("visit").addEventListener("close", () => {
      const name = this.open?.visit;
      this.open = null;
      if (location.hash === `#visit=${name}`) history.replaceState(null, "", location.pathname);
    });
    $("visit").addEventListener("keydown", (event) => this.key(event));
    for (const radio of $("visit-kind").querySelectorAll("input"))
      radio.addEventListener("change", () => {
        this.kind = radio.value;
        this.show(this.open);
      });
    $("visit-play").addEventListener("click", () => this.play());
    $("visit-reviewed").addEventListener("click", () => this.change({ reviewed: !this.open.reviewed }));
    onUse($("visit-keep"), () => this.change({ keep: this.open.keep !== true }));
    onUse($("visit-export"), () => this.export());
    onUse($("visit-delete"), () => this.delete());
  }

  key(event) {
    const step = { ArrowLeft: 1, ArrowRight: -1, j: 1, k: -1 }[event.key];
    const button = { r: "visit-reviewed", s: "visit-keep", p: "visit-play", Delete: "visit-delete" }[event.key];
    if (event.ctrlKey || event.altKey || event.metaKey) return;
    if (event.repeat && (button || event.target.id === "visit-delete")) { // a key that is held is one press
      event.preventDefault();
      return;
    }
    if (button) {
      $(button).click();
      event.preventDefault();
      return;
    }
    if (!step || (event.target.type === "radio" && event.key.startsWith("Arrow"))) return;
    const { visit: name } = this.open;
    this.visits.next(this.open, step).then((visit) => visit && this.open?.visit === name && this.show(visit)).catch(complain);
  }

  show(visit) {
    this.open = visit;
    this.sure(false);
    this.visits.current = visit.visit;
    $("visit").dataset.visit = visit.visit; // for other modules
    $("visit-reviewed").setAttribute("aria-pressed", String(visit.reviewed === true));
    $("visit-keep").setAttribute("aria-pressed", String(visit.keep === true));
    $("visit-delete").hidden = visit.active;
    const kind = visit.pictures.includes(this.kind) ? this.kind : pictures(visit)[0];
    for (const radio of $("visit-kind").querySelectorAll("input")) {
      radio.checked = radio.value === kind;
      radio.disabled = !visit.pictures.includes(radio.value);
    }
    setText($("visit-title"), title(visit));
    setText($("visit-facts"), [facts(visit), this.visits.unrecorded(visit)].filter(Boolean).join(" · "));
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
    const [x0, y0, x1, y1] = visit.box.map((v) => 100 * v);
    for (const [name, value] of Object.entries({ x: x0, y: y0, width: Math.max(x1 - x0, 0), height: Math.max(y1 - y0, 0) }))
      $("visit-box").setAttribute(name, value.toFixed(1));
    if (!$("visit").open) $("visit").showModal();
  }

  /** Deleting needs a second click. */
  sure(on) {
    clearTimeout(this.asking);
    $("visit-delete").dataset.sure = on;
    setText($("visit-delete"), on ? "Really delete?" : "Delete");
    if (on) this.asking = setTimeout(() => this.sure(false), SURE_MS);
  }

  async change(what) {
    const { visit } = this.open;
    try {
      await this.visits.change([this.open], what);
      const now = this.visits.find(visit) ?? this.open;
      if (this.open?.visit === visit) this.show(now);
    } catch (error) {
      complain(error);
    }
  }

  async delete() {
    if ($("visit-delete").dataset.sure !== "true") {
      this.sure(true);
      return;
    }
    const gone = this.open;
    this.sure(false);
    try {
      const next = await this.visits.next(gone, 1) ?? await this.visits.next(gone, -1);
      await this.visits.change([gone], { delete: true });
      if (this.open?.visit !== gone.visit || this.visits.find(gone.visit)) return; // closed meanwhile, or it could not be deleted
      if (next) this.show(next);
      else $("visit").close();
    } catch (error) {
      complain(error);
    }
  }

  async export() {
    const visit = this.open;
    try {
      const { name } = await exportOne(visit);
      if (this.open?.visit === visit.visit) setText($("visit-facts"), `${facts(visit)} · its light field is kept as ${name}, below Recordings`);
    } catch (error) {
      this.failed(error, visit);
    }
  }

  failed(error, visit) {
    if (error.status !== 404) complain(error);
    else if (this.open?.visit === visit.visit) setText($("visit-facts"), `${facts(visit)} · no recording has this moment`);
  }

  async play() {
    const visit = this.open;
    $("visit-play").setAttribute("aria-busy", "true");
    try {
      await this.visits.onPlay(visit);
      if (this.open?.visit === visit.visit) $("visit").close();
    } catch (error) {
      this.failed(error, visit);
    } finally {
      $("visit-play").removeAttribute("aria-busy");
    }
  }
}
