#!/usr/bin/env python3
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
"""Delay of the live picture on the page, by stage, in a headless Chromium: bench_delay.py ADDRESS [SECONDS]

ADDRESS is one that `sst demo` prints, with its token: browser and service have one clock. Not in the gate: figures of an idle machine. Prints
quantiles, in ms since the trigger of the set, of each H.264 picture: when it has come to the page, is decoded, is drawn on the canvas, and when the
frame of the browser that shows it is done; and the stages of the service's last minute, which its status has.
"""
import sys
import time

import cdp

HOOK = """(() => {
  const now = () => performance.timeOrigin + performance.now();
  const lags = window.lags = {};
  const note = (stage, taken_ms) => (lags[stage] ??= []).push(now() - taken_ms);
  const Socket = window.WebSocket, Decoder = window.VideoDecoder;
  window.WebSocket = class extends Socket {
    constructor(...args) {
      super(...args);
      this.addEventListener("message", ({data}) => typeof data !== "string" && note("come", Number(new DataView(data).getBigUint64(0)) / 1000));
    }
  };
  window.VideoDecoder = class extends Decoder {
    constructor({output, ...more}) {
      super({...more, output: (frame) => {
        const taken_ms = frame.timestamp / 1000;
        note("decoded", taken_ms);
        output(frame);
        note("drawn", taken_ms);
        requestAnimationFrame(() => setTimeout(() => note("shown", taken_ms)));
      }});
    }
  };
})()"""


def quantiles(values):
    values = sorted(values)
    at = lambda q: values[min(int(q * len(values)), len(values) - 1)]  # noqa: E731
    return f"p50 {at(0.5):6.1f}  p10 {at(0.1):6.1f}  p90 {at(0.9):6.1f}  max {values[-1]:6.1f}"


def main():
    seconds = float(sys.argv[2]) if len(sys.argv) > 2 else 30
    b = cdp.Browser()
    try:
        b.size(1440, 900)
        b.call("Page.addScriptToEvaluateOnNewDocument", source=HOOK)
        b.go(sys.argv[1])
        b.wait("window.lags?.shown?.length > 5")
        time.sleep(5)
        b.js("for (const stage in window.lags) window.lags[stage] = []")
        time.sleep(seconds)
        lags, live = b.js("window.lags"), b.js("fetch('/api/v1/status').then((r) => r.json()).then((s) => s.live)")
    finally:
        b.close()
    for stage, values in lags.items():
        print(f"{stage:12} {quantiles(values)}  of {len(values)} pictures")
    for stage, s in [("to encoded", live["latency_ms"]), *live["stages_ms"].items()]:
        print(f"{stage:12} " + (f"p50 {s['p50']:6.1f}  p99 {s['p99']:6.1f}  max {s['max']:6.1f}" if s else "-"))
    print(f"{live['rate_hz']:.1f} of {live['due_hz']:.1f} sets a second, {live['cpu_percent']:.0f} % of a core without pictures")


if __name__ == "__main__":
    main()
