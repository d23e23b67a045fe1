// Small helpers: elements, messages, numbers in words.
// SPDX-FileCopyrightText: 2026 The sst contributors
// SPDX-License-Identifier: Apache-2.0

export const $ = (id) => document.getElementById(id);

/** el("p", {class: "x", onclick: f, dataset: {..}}, "text", child...) */
export function el(tag, properties = {}, ...children) {
  const node = document.createElement(tag);
  for (const [key, value] of Object.entries(properties)) {
    if (value === undefined || value === null || value === false) continue;
    if (key === "dataset") Object.assign(node.dataset, value);
    else if (key.startsWith("on")) node.addEventListener(key.slice(2), value);
    else node.setAttribute(key, value === true ? "" : value);
  }
  node.append(...children.filter((child) => child !== null && child !== undefined));
  return node;
}

/** A square of a label's colour; null without one. */
export function swatch(colour) {
  if (!colour) return null;
  const node = el("i", { class: "swatch", "aria-hidden": "true" });
  node.style.background = colour;
  return node;
}

export function icon(name) {
  const svg = document.createElementNS("http://www.w3.org/2000/svg", "svg");
  const use = document.createElementNS("http://www.w3.org/2000/svg", "use");
  svg.setAttribute("aria-hidden", "true");
  use.setAttribute("href", `#i-${name}`);
  svg.append(use);
  return svg;
}

/** Changes text only where it differs, which spares screen readers and layout. */
export function setText(node, text) {
  if (node.textContent !== text) node.textContent = text;
}

const MOST_TOASTS = 4;

/** A dialog covers and disables all but itself: messages are part of it while it is open. The last one lies over others. */
function placeToasts() {
  const place = [...document.querySelectorAll("dialog[open]")].at(-1) ?? document.body;
  if ($("toasts").parentNode !== place) place.append($("toasts"));
}

const dialogs = new MutationObserver(placeToasts);
for (const dialog of document.querySelectorAll("dialog")) dialogs.observe(dialog, { attributeFilter: ["open"] });

/** kind: "info" | "error"; action: {text, href, download}; topic: replaces an earlier one of the same topic */
export function toast(text, kind = "info", action = null, topic = text) {
  const box = $("toasts");
  const close = el("button", { type: "button", class: "icon", "aria-label": "Dismiss" }, icon("close"));
  const link = action && el("a", { href: action.href, download: action.download ?? "", class: "button small" }, action.text);
  const node = el("div", { class: `toast ${kind}`, dataset: { topic } }, el("span", {}, text), link, close);
  const same = [...box.children].find((other) => other.dataset.topic === topic);
  same?.remove();
  close.addEventListener("click", () => node.remove());
  box.append(node);
  while (box.children.length > MOST_TOASTS) box.firstChild.remove();
  setTimeout(() => node.remove(), kind === "error" ? 12000 : action ? 20000 : 6000);
}

/** A message of the service as a sentence of its own. */
export function sentence(text) {
  const whole = /^(?!sstd? )[a-z]+([ ,:.]|$)/.test(text) ? text.charAt(0).toUpperCase() + text.slice(1) : text; // not gpiochip0, sstd.yaml
  return /[.!?]$/.test(whole) || !whole ? whole : `${whole}.`;
}

export function complain(error) {
  console.warn(error.message);
  toast(sentence(error.message), "error");
}

/** A button that is disabled stays focusable and shows the reason. */
export function forbid(button, reason) {
  if ((button.dataset.reason ?? "") === reason) return;
  button.dataset.reason = reason;
  button.dataset.title ??= button.title;
  button.title = reason || button.dataset.title;
  if (reason) button.setAttribute("aria-disabled", "true");
  else button.removeAttribute("aria-disabled");
}

/** A click handler that ignores disabled buttons. */
export function onUse(button, action) {
  button.addEventListener("click", (event) => {
    if (button.dataset.reason) toast(button.dataset.reason);
    else action(event);
  });
}

/** Words to choose from, seen so far. */
export function offer(select, words) {
  const there = new Set([...select.options].map((option) => option.value));
  for (const word of new Set(words)) if (!there.has(word)) select.append(el("option", { value: word }, word));
}

/** Waits until the page is visible: hidden pages send no requests. */
export function visible() {
  return new Promise((done) => {
    if (!document.hidden) done();
    else document.addEventListener("visibilitychange", () => done(visible()), { once: true });
  });
}

function kept(place, key, value) {
  try { // private windows may refuse
    if (value === undefined) return window[place].getItem(key);
    window[place].setItem(key, value);
  } catch {
    return null;
  }
  return value;
}

/** Storage of the browser and of the tab: reads, or writes when a value is given. */
export const storage = (key, value) => kept("localStorage", key, value);
export const session = (key, value) => kept("sessionStorage", key, value);

// --- numbers ---

export const finite = (value) => typeof value === "number" && Number.isFinite(value);

const formats = []; // by digits: making one takes longer than using it

export function number(value, digits = 0) {
  formats[digits] ??= new Intl.NumberFormat(undefined, { minimumFractionDigits: digits, maximumFractionDigits: digits });
  return finite(value) ? formats[digits].format(value) : "–";
}

export function bytes(value) {
  if (!finite(value)) return "–";
  const units = ["B", "kB", "MB", "GB", "TB", "PB"];
  let i = 0;
  while (value >= 999.5 && i < units.length - 1) {
    value /= 1000;
    i++;
  }
  return `${number(value, value < 9.95 && i > 0 ? 1 : 0)} ${units[i]}`;
}

export function duration(seconds) {
  if (!finite(seconds) || seconds < 0) return "–";
  const s = Math.floor(seconds);
  if (s < 60) return `${s} s`;
  if (s < 3600) return `${Math.floor(s / 60)} min ${s % 60} s`;
  if (s < 86400) return `${Math.floor(s / 3600)} h ${Math.floor(s / 60) % 60} min`;
  return `${Math.floor(s / 86400)} d ${Math.floor(s / 3600) % 24} h`;
}

/** 02:05, 1:02:05. */
export function stopwatch(seconds) {
  const s = Math.max(0, Math.floor(seconds));
  const two = (n) => String(n).padStart(2, "0");
  return s < 3600 ? `${two(Math.floor(s / 60))}:${two(s % 60)}`
    : `${Math.floor(s / 3600)}:${two(Math.floor(s / 60) % 60)}:${two(s % 60)}`;
}

/** "Europe/Berlin, GMT+1" */
export function zone() {
  const format = new Intl.DateTimeFormat("en", { timeZoneName: "shortOffset" });
  const offset = format.formatToParts(new Date()).find((part) => part.type === "timeZoneName")?.value ?? "";
  const { timeZone } = format.resolvedOptions();
  return timeZone === offset || timeZone === "UTC" ? timeZone : `${timeZone}, ${offset}`;
}

/** Local time; with the date where it is not today, and the year where it is not this one. */
export function localTime(iso) {
  const at = new Date(iso);
  if (Number.isNaN(at.getTime())) return "–";
  const time = at.toLocaleTimeString(undefined, { hour: "2-digit", minute: "2-digit", second: "2-digit" });
  const now = new Date();
  const year = at.getFullYear() === now.getFullYear() ? {} : { year: "numeric" };
  return at.toDateString() === now.toDateString() ? time : `${at.toLocaleDateString(undefined, { day: "numeric", month: "short", ...year })} ${time}`;
}
