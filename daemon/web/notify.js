// Notifications of the browser and a sound when something comes, as long as a page is open, also behind other windows.
// SPDX-FileCopyrightText: 2026 The sst contributors
// SPDX-License-Identifier: Apache-2.0

import { $, forbid, onUse, storage, toast } from "/web/ui.js";

const KEPT = "sst-notify";
const SOUND_S = 0.5;

/** Why this browser cannot; "": it can. */
function obstacle() {
  if (!window.isSecureContext) return "Browsers allow notifications over HTTPS or on this machine only.";
  if (!("Notification" in window)) return "This browser has no notifications.";
  return Notification.permission === "denied" ? "This browser refuses notifications of this site: allow them in its settings." : "";
}

function beep() {
  const audio = new AudioContext();
  const tone = audio.createOscillator(), gain = audio.createGain();
  tone.frequency.setValueAtTime(660, 0);
  tone.frequency.setValueAtTime(880, SOUND_S / 2);
  gain.gain.setValueAtTime(0.15, 0);
  gain.gain.linearRampToValueAtTime(0, SOUND_S);
  tone.connect(gain).connect(audio.destination);
  tone.start();
  tone.stop(SOUND_S);
  tone.addEventListener("ended", () => audio.close());
}

export class Notify {
  /** @param wanted  (visit) => bool: the filters of the panel; @param onOpen  (name) => void: a notification was clicked */
  constructor(wanted, onOpen) {
    this.wanted = wanted;
    this.onOpen = onOpen;
    this.told = new Set(); // visits
    this.source = null; // of events: a page behind others is not polled
    onUse($("notify"), () => this.toggle());
    $("notify-sound").checked = storage("sst-notify-sound") === "1";
    $("notify-sound").addEventListener("change", () => {
      storage("sst-notify-sound", $("notify-sound").checked ? "1" : "0");
      if ($("notify-sound").checked) beep();
    });
    if (storage(KEPT) === "1" && !obstacle() && Notification.permission === "granted") this.start();
    this.show();
  }

  async toggle() {
    if (this.source) {
      this.stop();
    } else {
      await Notification.requestPermission();
      if (!obstacle() && Notification.permission === "granted") this.start();
      else toast(obstacle() || "Without permission there are no notifications.");
    }
    storage(KEPT, this.source ? "1" : "0");
    this.show();
  }

  start() {
    if (this.source) return; // asked for twice
    this.source = new EventSource("/api/v1/events/stream");
    this.source.addEventListener("message", (message) => this.take(JSON.parse(message.data)));
  }

  stop() {
    this.source.close();
    this.source = null;
  }

  show() {
    const why = obstacle();
    $("notify").setAttribute("aria-pressed", String(this.source !== null));
    $("notify-sound-box").hidden = !this.source;
    forbid($("notify"), why);
  }

  take({ type, message, data }) {
    if (type === "line") this.takeLine(message, data);
    if (type !== "visit" || !data.active || this.told.has(data.visit) || !this.wanted(data)) return;
    this.told.add(data.visit); // it may enter another zone later
    if ($("notify-sound").checked) beep();
    this.notify(data.zones.length ? `${data.label || "Something"} in ${data.zones.join(", ")}` : data.label || "Something moves", message, data, data.visit);
  }

  /** Where that line is chosen, each time; else only if the visit has not been notified of. */
  takeLine(message, data) {
    const again = this.told.has(data.visit) && this.wanted({ ...data, zones: [] });
    if (again || !this.wanted({ ...data, zones: [data.zone] })) return;
    this.told.add(data.visit);
    if ($("notify-sound").checked) beep();
    this.notify(`${data.label || "Something"} crossed ${data.zone} ${data.direction}`, message, data, `${data.visit} ${data.zone}`);
  }

  notify(title, body, data, tag) {
    const note = new Notification(title, { body, tag, icon: "/web/icon.svg" });
    note.addEventListener("click", () => {
      window.focus();
      this.onOpen(data.visit);
      note.close();
    });
  }
}
