// Brightness of the picture, and day or night colours of the page; both are this browser's own.
// SPDX-FileCopyrightText: 2026 The sst contributors
// SPDX-License-Identifier: Apache-2.0

import { $, storage } from "/web/ui.js";

const STOPS = 40; // of the slider for each doubling of the exponent

export class Light {
  constructor() {
    const box = $("light-box");
    const range = $("brightness");
    range.value = storage("sst-brightness") ?? "0";
    range.addEventListener("input", () => this.brighten());
    $("brightness-reset").addEventListener("click", () => {
      range.value = "0";
      this.brighten();
    });
    $("light").addEventListener("click", () => this.open(box.hidden));
    box.addEventListener("keydown", (event) => {
      if (event.key !== "Escape") return;
      this.open(false);
      $("light").focus();
    });
    document.addEventListener("pointerdown", (event) => {
      if (!box.hidden && !event.target.closest("#light-box, #light")) this.open(false);
    });
    for (const radio of $("theme").querySelectorAll("input")) {
      radio.checked = radio.value === (storage("sst-theme") ?? "");
      radio.addEventListener("change", () => this.dress(radio.value));
    }
    this.brighten();
    this.dress(storage("sst-theme") ?? "");
  }

  open(on) {
    $("light-box").hidden = !on;
    $("light").setAttribute("aria-expanded", on);
  }

  /** A tone curve: shadows come up, and nothing is clipped. */
  brighten() {
    const value = Number($("brightness").value);
    storage("sst-brightness", String(value));
    const exponent = 2 ** (-value / STOPS);
    for (const curve of $("tone").querySelectorAll("feFuncR, feFuncG, feFuncB")) curve.setAttribute("exponent", exponent);
    $("picture").style.filter = value ? "url(#tone)" : "";
    $("light").setAttribute("aria-pressed", value !== 0);
  }

  /** "": as the system says */
  dress(theme) {
    storage("sst-theme", theme);
    document.documentElement.dataset.theme = theme;
  }
}
