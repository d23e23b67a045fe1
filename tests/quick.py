"""What has to be quick, on machines that are busy with other things too, or stand still for a while: as tests/quick.h.

quick.py watch PID FILE: beside a process until it ends; FILE gets a line, from and to in monotonic seconds, for each time
that a processor stood "still", and for each half second how many threads wanted one.
quick.py judge MS LIMIT_MS FILE: of what has just ended; exit status 0: it was quick."""
import os
import sys
import time

BEAT, STILL, BUSY = 0.02, 0.1, 0.5


def runnable():
    """How many threads want a processor, this one left out."""
    with open("/proc/loadavg", encoding="utf8") as f:
        return int(f.read().split()[3].partition("/")[0]) - 1


def watch_one(pid, path, processor, busy):
    os.sched_setaffinity(0, {processor})
    last = since = time.monotonic()
    wanted = looks = 0
    while os.path.isdir(f"/proc/{pid}"):
        time.sleep(BEAT)
        now = time.monotonic()
        lines = f"{last:.3f} {now:.3f} still\n" if now - last > STILL else ""
        wanted, looks = wanted + (runnable() if busy else 0), looks + 1
        if busy and now - since > BUSY:
            lines += f"{since:.3f} {now:.3f} {wanted / looks:.2f}\n"
            wanted = looks = 0
            since = now
        if lines:
            try:
                with open(path, "a", encoding="utf8") as f:
                    f.write(lines)
            except OSError:
                return  # the folder of the test is gone
        last = now


def watch(pid, path):
    """A virtual machine's processors stand still one by one, too: each is watched."""
    first, *others = sorted(os.sched_getaffinity(0))
    for processor in others:
        if os.fork() == 0:
            watch_one(pid, path, processor, False)
            os._exit(0)
    watch_one(pid, path, first, True)


def slowness():
    begin, cpu = time.monotonic(), time.thread_time()
    while time.thread_time() - cpu < 0.1:
        pass
    return (time.monotonic() - begin) / 0.1


def look_back(path, begin, end):
    """For how long a processor stood still meanwhile, and how many times slower than idle the machine was."""
    still, wanted, over = [], 0.0, 0.0
    if os.path.exists(path):
        for line in open(path, encoding="utf8"):
            a, b, what = line.split()
            a, b = max(float(a), begin), min(float(b), end)
            if b > a and what == "still":
                still.append((a, b))
            elif b > a:
                wanted, over = wanted + (b - a) * float(what), over + b - a
    stood, until = 0.0, begin
    for a, b in sorted(still):
        stood += max(0.0, b - max(a, until))
        until = max(until, b)
    return stood, max(1.0, (wanted / over + 1) / len(os.sched_getaffinity(0))) if over else 1.0


def enough(ms, limit_ms, path):
    """Did what took `ms` until now take at most `limit_ms`?"""
    if ms <= limit_ms:
        return True
    end = time.monotonic()
    slow = slowness()
    time.sleep(BUSY + 10 * BEAT)  # until the watch has written
    stood, was_slow = look_back(path, end - ms / 1000, end)
    slow = max(slow, was_slow)  # what kept it busy may have ended before
    if "address" in os.environ.get("SST_BUILD", "") or "thread" in os.environ.get("SST_BUILD", ""):
        slow *= 4
    took = ms - 1000 * stood
    print(f"took {took:.0f} ms and {1000 * stood:.0f} ms in which the machine stood still, the limit is {limit_ms:.0f} ms, "
          f"the machine was {slow:.1f} times slower than idle", flush=True)
    return took <= limit_ms or (slow > 1.3 and took <= 3 * slow * limit_ms)


if __name__ == "__main__":
    if sys.argv[1] == "watch":
        watch(int(sys.argv[2]), sys.argv[3])
    else:
        sys.exit(not enough(float(sys.argv[2]), float(sys.argv[3]), sys.argv[4]))
