// Pictures of visitors: the part of a visit's picture around the visitor, decoded once it comes near the view and no longer than it is in the page.
// A canvas of its size instead of an image: browsers keep the whole of an image, decoded, long after it has left the page.
// SPDX-FileCopyrightText: 2026 The sst contributors
// SPDX-License-Identifier: Apache-2.0

import { el } from "/web/ui.js";
import { address, pictures } from "/web/visit_words.js";

const MARGIN = 1.7; // of a card's part of the picture over the visitor's size
const ZOOM_MOST = 4;
const NEAR = "300px";
const STAYS_MS = 100; // pictures that are scrolled past are not fetched

const pending = new WeakMap(); // canvas: {url, box, kind}, until it is near the view
const timers = new WeakMap(); // canvas: of its drawing
const loading = new WeakMap(); // canvas: AbortController

const observer = new IntersectionObserver((entries) => {
  for (const { target, isIntersecting } of entries)
    if (isIntersecting) {
      observer.unobserve(target);
      timers.set(target, setTimeout(() => draw(target, pending.get(target)).catch(() => {}), STAYS_MS)); // gone, or out of view again
    }
}, { rootMargin: NEAR });

/** Place and size of the part, in pixels, of the shape of the canvas. */
function part({ width, height }, [x0, y0, x1, y1], ratio) {
  const zoom = Math.min(Math.max(1 / (MARGIN * Math.max(x1 - x0, y1 - y0, 0.01)), 1), ZOOM_MOST);
  const w = Math.min(width / zoom, height * ratio), h = w / ratio;
  const at = (from, to, size, whole) => Math.min(Math.max((from + to) / 2 * whole - size / 2, 0), whole - size);
  return [at(x0, x1, w, width), at(y0, y1, h, height), w, h];
}

async function draw(canvas, { url, box, kind }) {
  const stop = new AbortController();
  loading.set(canvas, stop);
  const response = await fetch(url, { signal: stop.signal });
  if (!response.ok) return;
  const bitmap = await createImageBitmap(await response.blob());
  if (!stop.signal.aborted) {
    const scale = Math.min(devicePixelRatio, 2);
    canvas.width = Math.max(Math.round(canvas.clientWidth * scale), 1);
    canvas.height = Math.max(Math.round(canvas.clientHeight * scale), 1);
    const context = canvas.getContext("2d", { alpha: false });
    context.imageSmoothingQuality = "high";
    context.drawImage(bitmap, ...part(bitmap, box, canvas.width / canvas.height), 0, 0, canvas.width, canvas.height);
    canvas.dataset.drawn = kind;
  }
  bitmap.close();
}

/** A canvas with the visitor; null where there is no picture of that kind. */
export function portrait(visit, kind = pictures(visit)[0]) {
  return kind && visit.pictures.includes(kind) ? picture(address(visit, kind), visit.box, kind) : null;
}

/** A canvas with a part of a picture, drawn when it is near the view. */
export function picture(url, box = [0, 0, 1, 1], kind = "picture") {
  const canvas = el("canvas", { width: 1, height: 1, class: "portrait", "aria-hidden": "true" });
  pending.set(canvas, { url, box, kind });
  observer.observe(canvas);
  return canvas;
}

/** The canvases below a node leave the page. */
export function forget(node) {
  for (const canvas of node.querySelectorAll(".portrait")) {
    observer.unobserve(canvas);
    clearTimeout(timers.get(canvas));
    loading.get(canvas)?.abort();
    canvas.width = canvas.height = 0;
  }
}
