// Zoom and pan of the picture. Points are fractions: of the picture, or of the frame in which a part of it is shown.
// SPDX-FileCopyrightText: 2026 The sst contributors
// SPDX-License-Identifier: Apache-2.0

import { $, number } from "/web/ui.js";

const MOST = 8;

export class Zoom {
  /** @param frame  element that holds the picture; @param onChange  () => void */
  constructor(frame, onChange) {
    this.frame = frame;
    this.onChange = onChange;
    this.scale = 1;
    this.x = 0; // of the picture's upper left corner in the frame
    this.y = 0;
    $("zoom-whole").addEventListener("click", () => {
      this.reset();
      frame.focus();
    });
  }

  toFrame([x, y]) {
    return [this.x + x * this.scale, this.y + y * this.scale];
  }

  toPicture([x, y]) {
    return [(x - this.x) / this.scale, (y - this.y) / this.scale];
  }

  /** Point of the picture in the middle of the frame. */
  middle() {
    return this.toPicture([0.5, 0.5]);
  }

  /** Point of the frame under a pointer. */
  at(clientX, clientY) {
    const box = this.frame.getBoundingClientRect();
    return [(clientX - box.left) / box.width, (clientY - box.top) / box.height];
  }

  /** Zooms about a point of the frame, which stays where it is. */
  by(factor, [x, y]) {
    const scale = Math.min(Math.max(this.scale * factor, 1), MOST);
    this.set(scale, x - (x - this.x) * scale / this.scale, y - (y - this.y) * scale / this.scale);
  }

  /** Moves the picture by px of the page. */
  pan(dx, dy) {
    const box = this.frame.getBoundingClientRect();
    this.set(this.scale, this.x + dx / box.width, this.y + dy / box.height);
  }

  /** Moves a point of the picture into sight. */
  show(point) {
    const [x, y] = this.toFrame(point);
    const within = (v) => Math.min(Math.max(v, 0.05), 0.95) - v;
    this.set(this.scale, this.x + within(x), this.y + within(y));
  }

  reset() {
    this.set(1, 0, 0);
  }

  /** The frame is always full. */
  set(scale, x, y) {
    const within = (v) => Math.min(Math.max(v, 1 - scale), 0);
    if (scale === this.scale && within(x) === this.x && within(y) === this.y) return;
    Object.assign(this, { scale, x: within(x), y: within(y) });
    $("picture").style.transform = scale > 1 ? `translate(${100 * this.x}%, ${100 * this.y}%) scale(${scale})` : "";
    this.frame.classList.toggle("zoomed", scale > 1);
    $("zoom-whole").hidden = scale === 1;
    $("zoom-scale").textContent = `${number(scale, 1)}×`;
    this.onChange();
  }
}
