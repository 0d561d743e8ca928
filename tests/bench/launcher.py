"""Starts programs for the bench and measures them: JSON requests on standard input, a JSON answer a line.

    {"command": ["povray", …], "stdin": "/…", "stdout": "/…", "stderr": "/…", "folder": null} → {"status": 0, "wall": 1.2, "cpu": 1.1, "rss": 17000000}

A process's peak memory as the kernel counts it begins with that of the process that started it, so whoever has imported
NumPy can't measure small programs. This process imports next to nothing.
"""

import json
import os
import sys
import time


def launch(request: dict) -> dict:
    flags = os.O_WRONLY | os.O_CREAT | os.O_TRUNC
    start = time.perf_counter()
    pid = os.fork()
    if pid == 0:
        try:
            os.dup2(os.open(request["stdin"] or os.devnull, os.O_RDONLY), 0)
            os.dup2(os.open(request["stdout"], flags, 0o600), 1)
            os.dup2(os.open(request["stderr"], flags, 0o600), 2)
            if request["folder"]:
                os.chdir(request["folder"])
            os.execvp(request["command"][0], request["command"])
        except OSError as error:
            os.write(2, str(error).encode())
        os._exit(127)
    _, status, usage = os.wait4(pid, 0)
    return {
        "status": os.waitstatus_to_exitcode(status),
        "wall": time.perf_counter() - start,
        "cpu": usage.ru_utime + usage.ru_stime,
        "rss": usage.ru_maxrss * 1024,
    }


if __name__ == "__main__":
    for line in sys.stdin:
        print(json.dumps(launch(json.loads(line))), flush=True)
