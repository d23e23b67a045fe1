// Cards without end in a grid: only the ones near the view are in the page, at their places.
// SPDX-FileCopyrightText: 2026 The sst contributors
// SPDX-License-Identifier: Apache-2.0

const ROWS_BEYOND = 2; // above and below the view
const SPARE = 24; // cards that have left, for others

export class Cards {
  /** @param box  the grid: all cards are as high as the first
   *  @param card  {build() => {node}, show(row, item), drop(row): it leaves the page}
   *  @param onEnd  the last card is near the view */
  constructor(box, card, onEnd) {
    this.box = box;
    this.card = card;
    this.onEnd = onEnd;
    this.items = []; // {visit: key, ...}
    this.rows = new Map();
    this.spare = [];
    this.height = 0; // of a row of cards with its gap
    this.across = 0; // cards in a row
    this.range = ""; // of the rows in the page
    this.width = 0;
    const later = () => { this.frame ??= requestAnimationFrame(() => this.draw(false)); };
    document.addEventListener("scroll", later, { capture: true, passive: true });
    new ResizeObserver(() => {
      if (box.clientWidth === this.width) return; // it is as high as its cards
      this.width = box.clientWidth;
      this.height = this.across = 0;
      this.range = "";
      later();
    }).observe(box);
  }

  set(items) {
    this.items = items;
    this.draw();
  }

  columns() {
    return Math.max(getComputedStyle(this.box).gridTemplateColumns.split(" ").length, 1);
  }

  /** Draws the cards near the view, and moves to none. @param all  also cards that are there already: their items may have changed */
  draw(all = true) {
    cancelAnimationFrame(this.frame);
    this.frame = null;
    if (!this.box.checkVisibility()) return;
    if (!this.height && this.items.length) this.measure();
    const columns = this.across || this.columns();
    const rows = Math.ceil(this.items.length / columns);
    const top = this.box.getBoundingClientRect().top;
    const first = Math.min(Math.max(Math.floor(-top / this.height) - ROWS_BEYOND, 0), Math.max(rows - 1, 0)) || 0;
    const last = Math.min(Math.ceil((innerHeight - top) / this.height) + ROWS_BEYOND, rows) || 0;
    const range = `${first} ${last} ${rows}`;
    if (this.items.length && last >= rows - ROWS_BEYOND) this.onEnd();
    if (!all && range === this.range) return;
    this.range = range;
    this.fill(first * columns, Math.max(last, first + 1) * columns, all);
    this.box.style.paddingTop = `${first * this.height}px`;
    this.box.style.paddingBottom = `${Math.max(rows - Math.max(last, first + 1), 0) * this.height}px`;
  }

  measure() {
    if (!this.rows.size) this.fill(0, this.columns(), true);
    const node = this.box.firstElementChild;
    this.height = node.offsetHeight + parseFloat(getComputedStyle(this.box).rowGap || 0);
    this.across = this.columns();
  }

  /** Cards of items from one place to before another. */
  fill(from, to, all) {
    const shown = this.items.slice(from, to);
    const wanted = new Set(shown.map((item) => item.visit));
    for (const [key, row] of this.rows)
      if (!wanted.has(key)) {
        this.card.drop(row);
        row.node.remove();
        this.rows.delete(key);
        if (this.spare.length < SPARE) this.spare.push(row);
      }
    shown.forEach((item, i) => {
      let row = this.rows.get(item.visit);
      const there = row !== undefined;
      if (!there) this.rows.set(item.visit, row = this.spare.pop() ?? this.card.build());
      if (this.box.children[i] !== row.node) this.box.insertBefore(row.node, this.box.children[i] ?? null);
      for (const [name, value] of [["aria-posinset", from + i + 1], ["aria-setsize", this.items.length]])
        if (row.node.getAttribute(name) !== String(value)) row.node.setAttribute(name, value);
      if (all || !there) this.card.show(row, item);
    });
  }

  /** The card of an item, scrolled into view; null: there is none. */
  reveal(key) {
    const at = this.items.findIndex((item) => item.visit === key);
    if (at < 0) return null;
    if (!this.rows.has(key)) {
      const place = this.box.getBoundingClientRect().top + Math.floor(at / this.columns()) * this.height;
      const panel = this.box.closest(".panel");
      const scroller = panel.scrollHeight > panel.clientHeight && getComputedStyle(panel).overflowY !== "visible" ? panel : document.scrollingElement;
      scroller.scrollTop += place - innerHeight / 2;
      this.draw();
    }
    const row = this.rows.get(key) ?? null;
    row?.node.scrollIntoView({ block: "nearest" });
    return row;
  }
}
