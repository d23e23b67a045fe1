"""What has to be quick, on machines that are busy with other things too, or stand still for a while: as tests/quick.h.

quick.py watch PID FILE: beside a process until it ends; FILE gets a line, from and to in monotonic seconds, for each time
that the machine stood still.   quick.py judge MS LIMIT_MS FILE: of what has just ended; exit status 0: it was quick."""
import os
import sys
import time

BEAT, STILL = 0.02, 0.1


def watch(pid, path):
    last = time.monotonic()
    while os.path.isdir(f"/proc/{pid}"):
        time.sleep(BEAT)
        now = time.monotonic()
        if now - last > STILL:
            try:
                with open(path, "a", encoding="utf8") as f:
                    f.write(f"{last:.3f} {now:.3f}\n")
            except OSError:
                return  # the folder of the test is gone
        last = now


def slowness():
    begin, cpu = time.monotonic(), time.thread_time()
    while time.thread_time() - cpu < 0.1:
        pass
    return (time.monotonic() - begin) / 0.1


def enough(ms, limit_ms, path):
    """Did what took `ms` until now take at most `limit_ms`?"""
    if ms <= limit_ms:
        return True
    end = time.monotonic()
    begin = end - ms / 1000
    slow = slowness()
    time.sleep(10 * BEAT)  # until the watch has written
    stood = 0.0
    if os.path.exists(path):
        for line in open(path, encoding="utf8"):
            a, b = map(float, line.split())
            stood += b - a if a < end and b > begin else 0.0
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
