#!/usr/bin/env python3
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
"""Memory and frames of the page with many visits, in a headless Chromium: bench_visits.py PICTURES [VISITS] [KEYS]

PICTURES is a folder of tests/page/pictures.sh, VISITS how many (500), KEYS how many are pressed a second at most (8; 0: one in
each frame). Not in the gate: figures of an idle machine. Scrolls through all cards with the wheel, reviews them with keys, and prints

- the memory of the page's renderer process (PSS: with its share of the browser's program; private: its own alone) and of its JavaScript heap, before
  and after, the most while keys were pressed, and what is left once Chromium was told to collect; how many cards the page holds;
- frames a second while it scrolls, as requestAnimationFrame counts them, the longest frame, and the processor time of the main thread for each.
"""
import sys
import time

import cdp
from page_bench import Fake

FRAMES = """window.frames = []; window.counting = true;
(function count(at) { window.frames.push(at); if (window.counting) requestAnimationFrame(count); })(performance.now());"""

EACH_FRAME = """requestAnimationFrame(function press() {
  document.activeElement.dispatchEvent(new KeyboardEvent("keydown", { key: "r", bubbles: true, cancelable: true }));
  if (--window.left) requestAnimationFrame(press);
});"""


def largest(b):
    """PSS and private memory of the largest renderer of this browser, kB."""
    return max((memory(p) for p in children(b.process.pid)), default=(0, 0))


def renderer(b, of=None):
    """The largest renderer of this browser, in words."""
    pss, private = of or largest(b)
    return f"{pss / 1024:6.1f} MB renderer, {private / 1024:6.1f} MB private,"


def children(pid):
    """Renderer processes below one."""
    found, todo = [], [pid]
    while todo:
        for task in open(f"/proc/{todo[0]}/task/{todo[0]}/children", encoding="utf8").read().split():
            todo.append(int(task))
            if "--type=renderer" in open(f"/proc/{task}/cmdline", encoding="utf8").read():
                found.append(int(task))
        todo.pop(0)
    return found


def memory(pid):
    """PSS and private memory, kB."""
    kb = {line.split(":")[0]: int(line.split()[1]) for line in open(f"/proc/{pid}/smaps_rollup", encoding="utf8") if line.endswith("kB\n")}
    return kb["Pss"], kb["Private_Clean"] + kb["Private_Dirty"]


def heap_mb(b):
    return b.call("Runtime.getHeapUsage")["usedSize"] / 1e6


WORK = ("TaskDuration", "ScriptDuration", "LayoutDuration", "RecalcStyleDuration")


def busy_s(b):
    """Processor time of the main thread so far: all, scripts, layout, styles."""
    metrics = {m["name"]: m["value"] for m in b.call("Performance.getMetrics")["metrics"]}
    return [metrics[name] for name in WORK]


def main():
    visits = int(sys.argv[2]) if len(sys.argv) > 2 else 500
    keys_s = float(sys.argv[3]) if len(sys.argv) > 3 else 8
    fake = Fake(sys.argv[1])
    fake.start()
    b = cdp.Browser()
    try:
        b.call("Accessibility.disable")  # its tree of all nodes is no part of the page
        b.size(1440, 900)
        b.go(fake.url)
        b.wait("document.readyState === 'complete' && document.querySelectorAll('#visits .visit').length > 0")
        time.sleep(3)
        before = renderer(b), heap_mb(b)
        fake.set(many=visits - len(fake.visits()))
        b.js("document.querySelector('#visits-reviewed [value=false]').click()")
        b.wait("Number(document.querySelector('#visits .visit')?.ariaSetSize) === 60")
        box = b.box("#panel-visits")
        b.call("Performance.enable", timeDomain="threadTicks")
        work = busy_s(b)
        b.js(FRAMES)
        begin = time.time()
        while b.js("Number([...document.querySelectorAll('#visits .visit')].at(-1).ariaPosInSet)") < visits and time.time() < begin + 120:
            for _ in range(10):
                b.mouse("mouseWheel", box[0], box[1], deltaX=0, deltaY=120)
                time.sleep(0.016)
        took = time.time() - begin
        frames = b.js("window.counting = false; window.frames")
        work = [1000 * (after - before) / len(frames) for after, before in zip(busy_s(b), work)]
        gaps = sorted(b - a for a, b in zip(frames, frames[1:]))
        cards = b.js("document.querySelectorAll('#visits .visit').length")
        images = b.js("document.querySelectorAll('.portrait').length")
        time.sleep(2)
        print(f"before     {before[0]} {before[1]:6.1f} MB heap")
        print(f"{visits} visits {renderer(b)} {heap_mb(b):6.1f} MB heap, {cards} cards and {images} pictures in the page")
        b.js("document.querySelector('#visits .visit-open').focus()")  # each with keys alone
        b.key("Home", 36)
        most, begin = (0, 0), time.time()
        for n in range(visits if keys_s else 0):
            b.key("r", 82, "r")
            b.js("new Promise(requestAnimationFrame)")
            most = max(most, largest(b), key=lambda of: of[1])
            time.sleep(max(begin + (n + 1) / keys_s - time.time(), 0))
        if not keys_s:
            b.js(f"window.left = {visits}; {EACH_FRAME}")
        while not keys_s and b.js("window.left"):
            most = max(most, largest(b), key=lambda of: of[1])
        rate = visits / (time.time() - begin)
        left = b.js("document.getElementById('visits-new').textContent")
        print(f"{visits} keys   {renderer(b)} {heap_mb(b):6.1f} MB heap, {left} left to review")
        print(f"most       {renderer(b, most)} {rate:.1f} keys/s")
        b.call("HeapProfiler.collectGarbage")
        print(f"collected  {renderer(b)} {heap_mb(b):6.1f} MB heap")
        print(f"scrolling  {took:.1f} s, {len(gaps) / (sum(gaps) / 1000):.1f} frames/s, median {gaps[len(gaps) // 2]:.1f} ms, "
              f"99 % within {gaps[len(gaps) * 99 // 100]:.1f} ms, longest {gaps[-1]:.1f} ms; "
              f"processor time of the main thread for each {work[0]:.1f} ms: scripts {work[1]:.1f}, layout {work[2]:.1f}, styles {work[3]:.1f}")
    finally:
        b.close()
        fake.stop()


if __name__ == "__main__":
    main()
