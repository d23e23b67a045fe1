// Notifications of this browser when no page is open: Web Push by the service worker push-worker.js.
// SPDX-FileCopyrightText: 2026 The sst contributors
// SPDX-License-Identifier: Apache-2.0

import { get, post } from "/web/api.js";
import { $, complain, storage, toast } from "/web/ui.js";

const KEPT = "sst-push";

/** Why this browser cannot; "": it can. */
function obstacle() {
  if (!window.isSecureContext) return "Browsers allow this over HTTPS or on this machine only.";
  if (!("serviceWorker" in navigator) || !("PushManager" in window)) return "This browser has no notifications without a page; on an iPhone add the page to the home screen first.";
  return Notification.permission === "denied" ? "This browser refuses notifications of this site: allow them in its settings." : "";
}

const bytesOf = (base64) => Uint8Array.from(atob(base64.replaceAll("-", "+").replaceAll("_", "/")), (c) => c.charCodeAt(0));

export class Push {
  /** @param onOpen  (name) => void: a notification of a visit was clicked while this page is open */
  constructor(onOpen) {
    this.last = Promise.resolve(); // of changes, one after the other
    this.box = $("notify-push");
    this.box.checked = storage(KEPT) === "1" && !obstacle();
    this.box.addEventListener("change", () => this.change());
    for (const id of ["visits-label", "visits-zone"]) $(id).addEventListener("change", () => this.renew());
    navigator.serviceWorker?.addEventListener("message", ({ data }) => {
      const name = new URLSearchParams(new URL(data.open ?? "/", location.href).hash.slice(1)).get("visit");
      if (name) onOpen(name);
    });
    this.renew();
  }

  after(step) {
    const mine = this.last.then(step);
    this.last = mine.catch(() => {});
    return mine;
  }

  async change() {
    const on = this.box.checked;
    try {
      await this.after(() => (on ? this.subscribe(true) : this.unsubscribe()));
      storage(KEPT, on ? "1" : "0");
    } catch (error) {
      if (this.box.checked === on) this.box.checked = !on; // else it was changed again meanwhile
      complain(error);
    }
  }

  /** Again with the filters of the panel: they may have changed, and the service may have lost them. */
  renew() {
    if (this.box.checked) this.after(() => this.box.checked && this.subscribe(false)).catch((error) => console.warn(error.message));
  }

  async subscribe(test) {
    const why = obstacle();
    if (why) throw new Error(why);
    if (await Notification.requestPermission() !== "granted") throw new Error("Without permission there are no notifications.");
    const { supported, reason, key } = await get("/api/v1/push");
    if (!supported) throw new Error(reason);
    const registration = await navigator.serviceWorker.register("/push-worker.js");
    const subscription = await this.current(registration, bytesOf(key));
    const { endpoint, keys } = subscription.toJSON();
    const chosen = (id) => ($(id).value ? [$(id).value] : []);
    await post("/api/v1/push", { endpoint, p256dh: keys.p256dh, auth: keys.auth, labels: chosen("visits-label"), zones: chosen("visits-zone") });
    if (!test) return;
    await post("/api/v1/push", { endpoint, test: true });
    toast("A notification is on its way. What is chosen above counts, also when no page is open.");
  }

  /** One of another key cannot be used: the service has got a new one. */
  async current(registration, key) {
    const old = await registration.pushManager.getSubscription();
    const same = old && new Uint8Array(old.options.applicationServerKey ?? []).every((byte, i) => byte === key[i]);
    if (old && same) return old;
    await old?.unsubscribe();
    return registration.pushManager.subscribe({ userVisibleOnly: true, applicationServerKey: key });
  }

  async unsubscribe() {
    const registration = await navigator.serviceWorker.getRegistration("/");
    const subscription = await registration?.pushManager.getSubscription();
    if (!subscription) return;
    await post("/api/v1/push", { endpoint: subscription.endpoint, delete: true }).catch((error) => {
      if (error.status !== 404) throw error;
    });
    await subscription.unsubscribe();
  }
}
