// The page's own view on the service: created when first needed, recreated when it expired or the service restarted;
// every change of settings is sent to it, the newest only.
// SPDX-FileCopyrightText: 2026 The sst contributors
// SPDX-License-Identifier: Apache-2.0

import { ApiError, get, post, source } from "/web/api.js";
import { Stream } from "/web/stream.js";

const PICK_TRIES = 6;
const PICK_AGAIN_MS = 200;

export class View {
  /**
   * @param canvas    shows it
   * @param settings  differences from the service's defaults; see docs/integrate/api.md
   * @param notify    as in Stream; and "shared" (reason) when no own view is available: the main view is shown,
   *                  until "made" (its settings, defaults included)
   */
  constructor(canvas, settings, notify) {
    this.settings = { ...settings };
    this.notify = notify;
    this.id = null;
    this.shared = false;
    this.pending = null; // settings not sent yet
    this.sending = false;
    this.creating = null;
    this.home = null; // the array's view, {id, shared}, while a recording is shown
    this.stream = new Stream(canvas, () => this.address(), (what, why) => this.onStream(what, why));
  }

  start() {
    this.stream.start();
  }

  stop() {
    this.stream.stop();
  }

  restart() {
    this.stop();
    this.start();
  }

  /** Adopts an existing view. @return its settings, or null if it is gone */
  async adopt(id) {
    const { views } = await get(`${source.base}/api/v1/views`);
    const view = views.find((other) => other.id === id);
    if (!view) return null;
    this.id = id;
    this.settings = Object.fromEntries(Object.entries(view.settings).filter(([, value]) => value !== null));
    return view.settings;
  }

  /** Discards the view and its settings; a new one is created at once. */
  renew(settings) {
    this.settings = { ...settings };
    this.id = null;
    this.pending = null;
    this.restart();
  }

  /** The pictures come from a recording now, or again from the array: there the view of before is taken up. */
  move(settings) {
    const { id, shared } = (source.base ? null : this.home) ?? { id: null, shared: false };
    this.home = source.base ? this.home ?? { id: this.id, shared: this.shared } : null;
    this.stop();
    this.stream.pictures = 0;
    this.settings = { ...settings };
    this.creating = this.pending = null;
    this.id = id;
    this.shared = shared;
    if (id && !shared) this.change(this.settings);
    this.start();
  }

  onStream(what, why) {
    if (what === "lost" && (why?.status === 404 || this.shared)) this.id = null; // gone; create another
    this.notify(what, why);
  }

  async address() {
    if (!this.id) await (this.creating ?? this.made());
    return `${source.base}/stream/${encodeURIComponent(this.id)}`;
  }

  async made() {
    const creating = this.creating = this.create(source.base);
    try {
      await creating;
    } finally {
      if (this.creating === creating) this.creating = null;
    }
  }

  async create(base) {
    const sent = { ...this.settings };
    try {
      const { id, settings } = await post(`${base}/api/v1/views`, sent);
      if (base !== source.base) return; // of the source before
      this.id = id;
      this.shared = false;
      this.notify("made", settings);
      this.pending = null;
      if (JSON.stringify(sent) !== JSON.stringify(this.settings)) this.change(this.settings); // changed meanwhile
    } catch (error) {
      if (base !== source.base) return;
      if (error.status === 400) this.forget(error);
      if (error.status !== 429) throw error;
      if (!this.shared) this.notify("shared", error);
      this.shared = true;
      this.id = "main";
      if (!this.sending) this.send(); // changes made while there was no view
    }
  }

  /** Settings that the service refuses (a label of another network ...) are dropped: they would be refused for ever. */
  forget(error) {
    const { method } = this.settings;
    this.settings = method && Object.keys(this.settings).length > 1 ? { method } : {}; // an older service may not know the method
    this.notify("refused", error);
  }

  /** The newest settings win; at most one request is under way. Failures come as "refused". */
  change(settings) {
    Object.assign(this.settings, settings);
    this.pending = { ...this.pending, ...settings };
    if (!this.sending && this.id) this.send();
  }

  async send() {
    this.sending = true;
    while (this.pending && this.id) {
      const settings = this.pending;
      this.pending = null;
      try {
        await post(`${source.base}/api/v1/views/${encodeURIComponent(this.id)}`, settings);
      } catch (error) {
        if (error.status === 404 || (error.status === 403 && !this.shared)) this.renew(this.settings); // gone, or of a session before
        else if (error.status !== 0) this.notify("refused", error);
      }
    }
    this.sending = false;
  }

  /** Surface of the picture at a point. */
  pick(x, y) {
    return this.retry((address) => get(`${address}/pick?x=${Math.floor(x)}&y=${Math.floor(y)}`));
  }

  /** Removes the thing at a point of the clear picture, or brings it back. @return {removed, objects} */
  remove(x, y) {
    return this.retry((address) => post(`${address}/remove`, { x: Math.floor(x), y: Math.floor(y) }));
  }

  /** Moving objects: {time: of their set, tracks}. */
  tracks() {
    return get(`${source.base}/api/v1/tracks`);
  }

  restore() {
    return this.retry((address) => post(`${address}/remove`, { clear: true }));
  }

  async retry(ask) {
    if (!this.id) throw new ApiError(0, "There is no picture yet.");
    for (let left = PICK_TRIES - 1; ; left--) {
      try {
        return await ask(`${source.base}/api/v1/views/${encodeURIComponent(this.id)}`);
      } catch (error) {
        if (error.status !== 409 || left === 0) throw error; // 409: busy with a set, for longer than it waited
        await new Promise((done) => setTimeout(done, PICK_AGAIN_MS));
      }
    }
  }

  /** {settings (defaults included), shown_focus_px, ...}; null while there is no view. */
  async current() {
    const { views } = await get(`${source.base}/api/v1/views`);
    return views.find((view) => view.id === this.id) ?? null;
  }
}
