// Overlays of the picture: labels or depth, with opacity, or a camera as it is.
// SPDX-FileCopyrightText: 2026 The sst contributors
// SPDX-License-Identifier: Apache-2.0

import { getBlob, source } from "/web/api.js";
import { CAMERA } from "/web/clear.js";
import { Stream } from "/web/stream.js";
import { $, complain, el, setText, swatch, visible } from "/web/ui.js";
import { View } from "/web/view.js";

const OVERLAY_MS = 500;

export class Overlays {
  /** @param app  {focus, labels, replay} */
  constructor(app) {
    this.app = app;
    this.kind = "";
    this.camera = "";    // name of the one that is shown
    this.stream = null;  // of a camera; of a recording a view, which has only the reference camera
    this.timer = null;
    for (const radio of $("overlay").querySelectorAll("input"))
      radio.addEventListener("change", () => this.set(radio.value));
    const fade = () => { $("canvas-overlay").style.opacity = Number($("opacity").value) / 100; };
    $("opacity").addEventListener("input", fade);
    fade();
  }

  /** The camera that has the picture's axes. */
  setGrid(rows, cols) {
    this.reference = `r${(rows - 1) >> 1}c${(cols - 1) >> 1}`;
  }

  /** Cameras that stand anywhere have neither labels nor depths, nor things that a click removes. */
  setLattice(lattice) {
    $("viewer").toggleAttribute("data-posed", !lattice);
    for (const radio of $("overlay").querySelectorAll("[value=labels], [value=disparity]")) radio.parentElement.hidden = !lattice;
  }

  /** Shows a camera large. */
  showCamera(name) {
    for (const radio of $("overlay").querySelectorAll("input")) radio.checked = radio.value === "camera";
    this.set("camera", name);
  }

  /** Shows the picture again, with no overlay. */
  showPicture() {
    for (const radio of $("overlay").querySelectorAll("input")) radio.checked = radio.value === "";
    this.set("");
  }

  set(kind, camera = this.reference) {
    clearTimeout(this.timer);
    this.stream?.stop();
    this.stream = null;
    this.camera = "";
    this.kind = kind;
    this.app.stage?.boxes?.show();
    if (this.app.stage) this.app.stage.delays_ms = [];
    $("canvas-overlay").hidden = $("canvas-camera").hidden = true;
    $("opacity-box").hidden = $("legend").hidden = kind === "" || kind === "camera";
    if (kind === "camera") this.startCamera(camera);
    else if (kind) this.draw(kind, 0);
    this.app.masks?.pictureChanged();
  }

  startCamera(name) {
    const replayed = this.app.replay.open;
    const canvas = $("canvas-camera");
    const notify = (what, why) => {
      if (what === "picture") {
        canvas.hidden = this.kind !== "camera";
        this.app.stage.boxes.picture();
        if (this.shown()) this.app.stage.drawn(this.shown());
        this.app.replay.picture();
      }
      if (what === "shared") complain(why);
    };
    this.camera = replayed ? this.reference : name;
    this.stream = replayed ? new View(canvas, { ...CAMERA }, notify)
      : new Stream(canvas, async () => `/stream/camera/${encodeURIComponent(name)}`, notify);
    this.stream.start();
  }

  /** The stream of the camera that is shown in place of the picture; null: none is. */
  shown() {
    return this.camera && !$("canvas-camera").hidden ? this.stream.stream ?? this.stream : null;
  }

  /** The pictures are of another source. */
  sourceChanged() {
    if (this.kind === "camera") this.set("camera");
  }

  async draw(kind, failures) {
    try {
      await visible();
      const bitmap = await createImageBitmap(await getBlob(`${source.base}/snapshot/${kind}`));
      if (this.kind !== kind) return;
      const canvas = $("canvas-overlay");
      canvas.width = bitmap.width;
      canvas.height = bitmap.height;
      canvas.getContext("2d").drawImage(bitmap, 0, 0);
      canvas.hidden = false;
      bitmap.close();
      failures = 0;
    } catch (error) {
      if (failures === 0) complain(error); // reported once, then retried
      failures++;
    }
    if (this.kind !== kind) return;
    this.showLegend(kind);
    this.timer = setTimeout(() => this.draw(kind, failures), OVERLAY_MS);
  }

  showLegend(kind) {
    const { focus, labels } = this.app;
    const legend = $("legend");
    if (kind === "disparity") {
      const text = focus.known() ? [`Near ${focus.words(focus.near_px)}`, `Far ${focus.words(focus.far_px)}`] : ["Near", "Far"];
      if (legend.dataset.now === text.join()) return;
      legend.dataset.now = text.join();
      legend.replaceChildren(el("span", {}, text[0]), el("i", { class: "scale", role: "img", "aria-label": "yellow is near, dark blue far" }),
        el("span", {}, text[1]));
    } else {
      const present = labels.present();
      legend.hidden = present.length === 0;
      const now = present.map((entry) => entry.name).join();
      if (legend.dataset.now === now) return;
      legend.dataset.now = now;
      legend.replaceChildren(...present.map((entry) => el("span", {}, swatch(labels.colour(entry.label)), entry.name)));
    }
  }
}
