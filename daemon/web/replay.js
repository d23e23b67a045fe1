// A recording in the large place: from a moment on, with the same controls as the picture of now. Until it is closed all
// requests about pictures are for the recording.

import { post, source } from "/web/api.js";
import { $, complain, finite, icon, session, setText, stopwatch, toast } from "/web/ui.js";

const POLL_MS = 500; // and a sign of life: the service closes a recording that no page asks about
const KEPT = "sst-replay";

const ms = (iso) => Date.parse(iso ?? "");

export class Replay {
  /** @param onChange  (open) => void: the pictures are of another source now
   *  @param onState   (state) => void: as GET /api/v1/replay answers */
  constructor(onChange, onState) {
    this.onChange = onChange;
    this.onState = onState;
    this.id = null; // of the service's replay; null: the picture is that of now
    this.state = null;
    this.turn = 0; // of requests
    this.pending = 0;
    this.goal = NaN;
    this.held = false; // the slider is being moved
    $("replay-live").addEventListener("click", () => this.close());
    $("replay-play").addEventListener("click", () => this.toggle());
    $("replay-speed").addEventListener("change", () => this.order({ speed: Number($("replay-speed").value) }));
    for (const [id, seconds] of [["replay-back", -5], ["replay-on", 5]])
      $(id).addEventListener("click", () => this.step(seconds));
    $("replay-at").addEventListener("input", () => {
      this.held = true;
      this.showTime(this.from() + Number($("replay-at").value));
    });
    $("replay-at").addEventListener("change", () => {
      this.held = false;
      this.seek(this.from() + Number($("replay-at").value));
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

  /** The moment that is shown, or that was asked for last. */
  at() {
    return finite(this.goal) ? this.goal : ms(this.state?.time);
  }

  /** Opens {recording} from its beginning, or {time}, and plays it. Throws as post() does; 404: no recording has it. */
  async start(what) {
    await this.post({ ...what, playing: true });
  }

  /** Answers to requests that another one has followed are out of date. */
  async post(what) {
    const turn = ++this.turn;
    this.pending++;
    try {
      const state = await post("/api/v1/replay", this.open ? { ...what, replay: this.id } : what);
      if (turn !== this.turn) return;
      this.goal = NaN;
      this.take(state);
    } catch (error) {
      if (turn === this.turn) throw error;
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
    session(KEPT, JSON.stringify({ time: this.state.time ?? this.state.from }));
    fetch("/api/v1/replay", { method: "POST", keepalive: true, headers: { "Content-Type": "application/json" },
      body: JSON.stringify({ replay: this.id, close: true }) }).catch(() => {});
  }

  close() {
    if (!this.open) return;
    const id = this.id;
    this.end();
    post("/api/v1/replay", { replay: id, close: true }).catch(() => {}); // it ends by itself
  }

  end() {
    this.turn++;
    this.id = this.state = null;
    this.goal = NaN;
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
    this.showTime(at_ms);
    return this.order({ time: new Date(at_ms).toISOString() });
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
    this.id = null; // it ended while the page was hidden: once more
    this.start({ time }).catch((why) => {
      complain(why);
      this.end();
    });
  }

  async poll() {
    for (;;) {
      await new Promise((done) => setTimeout(done, POLL_MS));
      if (this.open && !document.hidden && !this.pending) await this.order({});
    }
  }

  take(state) {
    const other = state.replay !== this.id;
    this.id = state.replay;
    this.state = state;
    this.show();
    this.onState(state);
    if (state.error) toast(state.error, "error");
    if (!other) return;
    source.base = "/replay";
    this.onChange(true);
  }

  show() {
    const { state } = this;
    $("replay").hidden = !state;
    $("viewer").classList.toggle("replayed", state !== null);
    if (!state) return;
    const slider = $("replay-at");
    const at = this.at();
    slider.max = String(Math.max(0, ms(state.to) - this.from()) || 0);
    if (!this.held && finite(at)) {
      slider.value = String(at - this.from());
      this.showTime(at);
    }
    $("replay-play").setAttribute("aria-label", state.playing ? "Pause" : "Play");
    if ($("replay-play").dataset.playing !== String(state.playing)) {
      $("replay-play").dataset.playing = state.playing;
      $("replay-play").replaceChildren(icon(state.playing ? "pause" : "play"));
    }
    $("replay-speed").value = String(state.speed);
  }

  showTime(at_ms) {
    const at = new Date(at_ms);
    const text = Number.isNaN(at.getTime()) ? "–" : at.toLocaleString(undefined,
      { weekday: "short", day: "numeric", month: "short", hour: "2-digit", minute: "2-digit", second: "2-digit" });
    setText($("replay-time"), text);
    $("replay-at").setAttribute("aria-valuetext", `${text}, ${stopwatch((at_ms - this.from()) / 1000)} after its beginning`);
  }
}
