// A recording in the large place: from a moment on, with the same controls as the picture of now. Until it is closed all
// requests about pictures are for the recording.
// SPDX-FileCopyrightText: 2026 The sst contributors
// SPDX-License-Identifier: Apache-2.0

import { post, source } from "/web/api.js";
import { $, complain, finite, icon, session, setText, stopwatch, toast } from "/web/ui.js";

const POLL_MS = 500; // and a sign of life: the service closes a recording that no page asks about
const WAIT_MS = 200; // while a picture is awaited
const EARLY_MS = 10; // times of the state have fewer digits than times of pictures
const LATE_MS = 1000; // of playing, between two states
const NEAR_MS = 500; // a picture that was recorded of a moment may be this far from it
const KEPT = "sst-replay";

const ms = (iso) => Date.parse(iso ?? "");

export class Replay {
  /** @param onChange  (open) => void: the pictures are of another source now
   *  @param onState   (state) => void: as GET /api/v1/replay answers
   *  @param drawn     () => time of the picture that is drawn; NaN: none of the recording yet */
  constructor(onChange, onState, drawn) {
    this.onChange = onChange;
    this.onState = onState;
    this.drawn = drawn;
    this.id = null; // of the service's replay; null: the picture is live
    this.opening = null; // promise of the id of one that is being opened: the service plays one at a time
    this.state = null;
    this.turn = 0; // of requests
    this.pending = 0;
    this.goal = NaN; // the moment that was asked for, until its picture is drawn
    this.awaits = false; // the picture of another moment
    this.first = NaN; // time of its set
    this.held = false; // the slider is being moved
    $("replay-live").addEventListener("click", () => this.close());
    $("replay-play").addEventListener("click", () => this.toggle());
    $("replay-speed").addEventListener("change", () => this.order({ speed: Number($("replay-speed").value) }));
    for (const [id, seconds] of [["replay-back", -5], ["replay-on", 5]])
      $(id).addEventListener("click", () => this.step(seconds));
    $("replay-at").addEventListener("input", () => {
      this.held = true;
      this.goal = this.from() + Number($("replay-at").value);
      this.show();
    });
    for (const kind of ["change", "pointerup", "pointercancel"]) // back where it was: no change
      $("replay-at").addEventListener(kind, () => {
        if (!this.held) return;
        this.held = false;
        this.seek(this.goal);
      });
    addEventListener("pagehide", () => this.leave());
    this.poll();
  }

  get open() {
    return this.id !== null;
  }

  from() {
    return ms(this.state?.from);
  }

  /** The moment that was asked for last, or that is shown. */
  at() {
    return [this.goal, this.awaits ? NaN : this.drawn(), ms(this.state?.time)].find(finite) ?? NaN;
  }

  /** A recorded picture of the awaited moment is drawn, while its own is being computed. */
  get recorded() {
    return this.awaits && Math.abs(this.drawn() - this.first) <= NEAR_MS;
  }

  /** A picture was drawn. */
  picture() {
    if (!this.open) return;
    const { awaits } = this;
    this.settle();
    this.show();
    if (awaits !== this.awaits || this.recorded) this.onState(this.state);
  }

  /** Until a picture of the moment that was asked for is drawn, the one before stays, under its own time. */
  settle() {
    const { computing, time, speed } = this.state;
    const at = this.drawn();
    if (computing || !(at >= this.first - EARLY_MS && at <= Math.max(this.first, ms(time)) + LATE_MS * speed)) return;
    this.awaits = false;
    if (!this.held) this.goal = NaN;
  }

  /** Opens {recording} from its beginning, or {time}, and plays it. Throws as post() does; 404: no recording has it. */
  async start(what) {
    await this.post({ ...what, playing: true });
  }

  /** Answers to requests that another one has followed are out of date. */
  async post(what) {
    const turn = ++this.turn;
    this.pending++;
    if (what.time || what.recording) {
      this.awaits = true;
      this.first = NaN;
    }
    try {
      const replay = this.id ?? await this.opening;
      if (turn !== this.turn) return;
      const answer = post("/api/v1/replay", replay ? { ...what, replay } : what);
      if (!replay) this.opening = answer.then((state) => state.replay, () => null);
      const state = await answer;
      if (turn === this.turn) this.take(state);
    } catch (error) {
      if (turn !== this.turn) return;
      if (error.status !== 0) {
        this.awaits = false;
        this.goal = NaN;
      }
      throw error;
    } finally {
      this.pending--;
    }
  }

  /** Of the page before it was reloaded. */
  async resume() {
    const kept = JSON.parse(session(KEPT) || "null");
    session(KEPT, "");
    if (kept) await this.start(kept).catch(() => {}); // it is gone: the picture of now is shown
  }

  leave() {
    if (!this.open) return;
    session(KEPT, JSON.stringify({ time: this.moment(this.at()) ?? this.state.from }));
    fetch("/api/v1/replay", { method: "POST", keepalive: true, headers: { "Content-Type": "application/json" },
      body: JSON.stringify({ replay: this.id, close: true }) }).catch(() => {});
  }

  close() {
    if (!this.state) return; // also while one that ended is opened once more
    const { id, opening } = this;
    this.end();
    Promise.resolve(id ?? opening).then((replay) => replay && post("/api/v1/replay", { replay, close: true })).catch(() => {}); // it ends by itself
  }

  end() {
    this.turn++;
    this.id = this.opening = this.state = null;
    this.goal = NaN;
    this.awaits = this.held = false;
    this.show();
    source.base = "";
    this.onChange(false);
  }

  toggle() {
    const { playing, time, to } = this.state;
    const over = !playing && ms(time) >= ms(to);
    this.order(over ? { playing: true, time: this.state.from } : { playing: !playing });
  }

  step(seconds) {
    const at = Math.min(Math.max(this.at() + 1000 * seconds, this.from()), ms(this.state.to));
    if (finite(at)) this.seek(at);
  }

  seek(at_ms) {
    this.goal = at_ms;
    this.awaits = true;
    this.show();
    return this.order({ time: this.moment(at_ms) });
  }

  /** A moment as the service writes it; null: not known. */
  moment(at_ms) {
    return finite(at_ms) ? new Date(at_ms).toISOString() : null;
  }

  async order(what) {
    try {
      await this.post(what);
    } catch (error) {
      this.fail(error);
    }
  }

  fail(error) {
    if (error.status === 0) return; // the status request reports it
    const time = this.state?.time;
    if (error.status !== 404 || !time) {
      complain(error);
      return;
    }
    this.id = this.opening = null; // it ended while the page was hidden: once more
    this.start({ time }).catch((why) => {
      complain(why);
      this.end();
    });
  }

  async poll() {
    for (;;) {
      await new Promise((done) => setTimeout(done, this.awaits ? WAIT_MS : POLL_MS));
      if (this.open && !document.hidden && !this.pending) await this.order({});
    }
  }

  take(state) {
    const other = state.replay !== this.id;
    this.id = state.replay;
    this.state = state;
    if (state.computing || !finite(this.first)) this.first = ms(state.time);
    if (other) {
      source.base = "/replay";
      this.onChange(true); // pictures drawn from now on are of the recording
    }
    this.settle();
    this.show();
    this.onState(state);
    if (state.error) toast(state.error, "error");
  }

  show() {
    const { state } = this;
    $("replay").hidden = !state;
    $("viewer").classList.toggle("replayed", state !== null);
    if (!state) return;
    const slider = $("replay-at");
    const at = this.at();
    slider.max = String(Math.max(0, ms(state.to) - this.from()) || 0);
    if (!this.held && finite(at)) slider.value = String(at - this.from());
    setText($("replay-time"), this.words(this.drawn()));
    slider.setAttribute("aria-valuetext", `${this.words(at)}, ${stopwatch((at - this.from()) / 1000)} after its beginning`);
    $("replay-play").setAttribute("aria-label", state.playing ? "Pause" : "Play");
    if ($("replay-play").dataset.playing !== String(state.playing)) {
      $("replay-play").dataset.playing = state.playing;
      $("replay-play").replaceChildren(icon(state.playing ? "pause" : "play"));
    }
    $("replay-speed").value = String(state.speed);
  }

  /** A moment; of one that is asked for, `short`. */
  words(at_ms, short = false) {
    if (!finite(at_ms)) return "–";
    const time = { hour: "2-digit", minute: "2-digit", second: "2-digit" };
    return new Date(at_ms).toLocaleString(undefined, short ? time : { weekday: "short", day: "numeric", month: "short", ...time });
  }
}
