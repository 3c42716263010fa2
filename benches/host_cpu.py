#!/usr/bin/env python3
"""CPU time of a command by kind of thread: host_cpu.py COMMAND...

Reads /proc while the command runs and prints CSV: the seconds of a software device's own threads, and of all others, which
are the host's on any device. The threads of llvmpipe have the name of the one that owns the device, which is the first of
that name. Compare two sample sizes: what does not grow is start and compilation.
"""
import collections
import os
import subprocess
import sys
import time

OWNER = "lanesweep devic"
DEVICE = ("llvmpipe", "Thread<", "marl", OWNER)


def main():
    command = subprocess.Popen(sys.argv[1:], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    spent = {}
    begin = time.perf_counter()
    while command.poll() is None:
        try:
            for thread in os.listdir(f"/proc/{command.pid}/task"):
                folder = f"/proc/{command.pid}/task/{thread}"
                with open(f"{folder}/comm") as name, open(f"{folder}/schedstat") as time_of:
                    spent[thread] = (name.read().strip(), int(time_of.read().split()[0]) / 1e9)
        except OSError:
            pass
        time.sleep(0.01)
    wall = time.perf_counter() - begin
    kinds = collections.Counter(host=0.0, device=0.0)
    owners = [int(thread) for thread, (name, _) in spent.items() if name == OWNER]
    for thread, (name, seconds) in spent.items():
        is_owner = name == OWNER and int(thread) == min(owners)
        kinds["device" if name.startswith(DEVICE) and not is_owner else "host"] += seconds
    print("threads,cpu_seconds")
    for kind, seconds in sorted(kinds.items()):
        print(f"{kind},{seconds:.3f}")
    print(f"wall,{wall:.3f}")
    return command.returncode


if __name__ == "__main__":
    sys.exit(main())
