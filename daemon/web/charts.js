// Lines over the last minutes, as SVG that takes its colours from the style sheet.
// SPDX-FileCopyrightText: 2026 The sst contributors
// SPDX-License-Identifier: Apache-2.0

const NS = "http://www.w3.org/2000/svg";
const WIDTH = 170, HEIGHT = 74, LEFT = 26, BOTTOM = 14;

function node(tag, attributes, text) {
  const made = document.createElementNS(NS, tag);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  if (text !== undefined) made.textContent = text;
  return made;
}

/** 1, 2 or 5 times a power of ten, above the value. */
function above(value) {
  const base = 10 ** Math.floor(Math.log10(Math.max(value, 1e-6)));
  return [1, 2, 5, 10].map((step) => step * base).find((step) => step >= value) ?? 10 * base;
}

export class Chart {
  /** @param lines  CSS classes, one per value of a point */
  constructor(svg, lines, span_s) {
    this.svg = svg;
    this.lines = lines;
    this.span_ms = span_s * 1000;
    this.points = []; // {t, values}
    svg.setAttribute("viewBox", `0 0 ${WIDTH} ${HEIGHT}`);
    this.draw();
  }

  /** NaN is a gap. */
  add(values, t = Date.now()) {
    this.points.push({ t, values });
    while (this.points[0].t < t - this.span_ms) this.points.shift();
    this.draw();
  }

  draw() {
    const now = this.points.at(-1)?.t ?? 0;
    const all = this.points.flatMap((point) => point.values).filter(Number.isFinite);
    const top = above(Math.max(...all, 1));
    const x = (t) => LEFT + (1 - (now - t) / this.span_ms) * (WIDTH - LEFT - 2);
    const y = (v) => HEIGHT - BOTTOM - Math.max(0, v) / top * (HEIGHT - BOTTOM - 6);
    const minutes = Math.round(this.span_ms / 60000);
    this.svg.replaceChildren(
      ...[0, 0.5, 1].map((share) => node("line", { class: "rule", x1: LEFT, x2: WIDTH, y1: y(share * top), y2: y(share * top) })),
      node("text", { x: LEFT - 4, y: y(top) + 4, "text-anchor": "end" }, top >= 1000 ? `${top / 1000}k` : String(top)),
      node("text", { x: LEFT - 4, y: y(0) + 3, "text-anchor": "end" }, "0"),
      node("text", { x: LEFT, y: HEIGHT - 2 }, `${minutes} min ago`),
      node("text", { x: WIDTH - 1, y: HEIGHT - 2, "text-anchor": "end" }, "now"),
      ...this.lines.map((name, i) => node("path", { class: `line ${name}`, d: this.path(i, x, y) })));
  }

  path(i, x, y) {
    let pen = "M";
    let d = "";
    for (const { t, values } of this.points) {
      if (Number.isFinite(values[i])) d += `${pen}${x(t).toFixed(1)} ${y(values[i]).toFixed(1)}`;
      pen = Number.isFinite(values[i]) ? "L" : "M";
    }
    return d;
  }
}

/** Shares of a whole as one bar: parts [{name, value}]; class part-0, part-1 ... */
export function drawBar(box, parts) {
  const sum = parts.reduce((total, part) => total + part.value, 0);
  while (box.children.length > parts.length) box.lastChild.remove();
  while (box.children.length < parts.length) box.append(document.createElement("i"));
  parts.forEach((part, i) => {
    const bar = box.children[i];
    bar.className = `part-${i % 9}`;
    bar.style.flexGrow = sum > 0 ? part.value / sum : 0;
    bar.title = part.name;
  });
}
