"""What has to be quick, on machines that are busy with other things too, or stand still for a while: as tests/quick.h.

quick.py watch PID FILE: beside a process until it ends; FILE gets a line, from and to in monotonic seconds, for each time
that the machine, or one of its processors, stood still, and FILE.load one for how many threads wanted to run, when.
quick.py judge MS LIMIT_MS FILE: of what has just ended; exit status 0: it was quick."""
import os
import sys
import time

BEAT, STILL, LOOK = 0.02, 0.1, 0.2


def runnable():
    """How many threads want to run, without this one."""
    try:
        with open("/proc/loadavg", encoding="ascii") as f:
            return int(f.read().split()[3].split("/")[0]) - 1
    except (OSError, ValueError, IndexError):
        return 0


def watch_processor(pid, spans, looks):
    last = looked = time.monotonic()
    while os.path.isdir(f"/proc/{pid}"):
        time.sleep(BEAT)
        now = time.monotonic()
        if now - last > STILL:
            spans.write(f"{last:.3f} {now:.3f}\n")
        if looks and now - looked >= LOOK:
            looks.write(f"{now:.3f} {runnable()}\n")
            looked = now
        last = now


def watch(pid, path):
    # Open from the start to the end: a folder that is being removed gets no new files. Lines are written one by one.
    spans, looks = (open(p, "a", buffering=1, encoding="utf8") for p in (path, path + ".load"))
    processors = sorted(os.sched_getaffinity(0))
    for processor in processors[1:16]:
        if os.fork() == 0:
            os.sched_setaffinity(0, [processor])
            watch_processor(pid, spans, None)
            return
    os.sched_setaffinity(0, processors[:1])
    watch_processor(pid, spans, looks)


def read(path):
    """Pairs of numbers, of lines that are whole."""
    if not os.path.exists(path):
        return []
    with open(path, encoding="utf8") as f:
        return [tuple(map(float, line.split())) for line in f if line.endswith("\n")]


def stood_still(begin, end, spans):
    """What several processors saw counts once."""
    total, until = 0.0, begin
    for a, b in sorted(spans):
        a, b = max(a, until), min(b, end)
        if b > a:
            total += b - a
            until = b
    return total


def slowness():
    begin, cpu = time.monotonic(), time.thread_time()
    while time.thread_time() - cpu < 0.1:
        pass
    return (time.monotonic() - begin) / 0.1


def load(begin, end, looks):
    """How many threads wanted to run on each processor, on average; at least 1."""
    seen = [n for t, n in looks if begin <= t <= end]
    return max(1.0, sum(seen) / len(seen) / (os.cpu_count() or 1)) if seen else 1.0


def enough(ms, limit_ms, path):
    """Did what took `ms` until now take at most `limit_ms`?"""
    if ms <= limit_ms:
        return True
    end = time.monotonic()
    begin = end - ms / 1000
    slow = slowness()
    time.sleep(10 * BEAT)  # until the watch has written
    stood = stood_still(begin, end, read(path))
    slow = max(slow, load(begin, end, read(path + ".load")))
    if "address" in os.environ.get("SST_BUILD", "") or "thread" in os.environ.get("SST_BUILD", ""):
        slow *= 4
    took = ms - 1000 * stood
    print(f"took {took:.0f} ms and {1000 * stood:.0f} ms in which the machine stood still, the limit is {limit_ms:.0f} ms, "
          f"the machine is {slow:.1f} times slower than idle", flush=True)
    return took <= limit_ms or (slow > 1.3 and took <= 3 * slow * limit_ms)


if __name__ == "__main__":
    if sys.argv[1] == "watch":
        watch(int(sys.argv[2]), sys.argv[3])
    else:
        sys.exit(not enough(float(sys.argv[2]), float(sys.argv[3]), sys.argv[4]))
