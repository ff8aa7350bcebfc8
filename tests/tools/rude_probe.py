"""Run scenarios in this process and say what they changed in it: python rude_probe.py SCENARIO... > JSON

Prints for each scenario what differs in the process after it, and the notes of its run. Reads the process by itself.
"""

import ctypes
import json
import os
import resource
import signal
import sys
from pathlib import Path
from typing import Any

C = ctypes.CDLL(None)
M = ctypes.CDLL("libm.so.6")
C.setlocale.restype = C.getenv.restype = ctypes.c_char_p
NUMBERS = ("SIGINT", "SIGTERM", "SIGPIPE", "SIGUSR1", "SIGALRM")


def state() -> dict[str, Any]:
    """Read what belongs to the process."""
    registers = ctypes.create_string_buffer(64)
    M.fegetenv(registers)
    return {
        "directory": os.getcwd(),
        "umask": [line for line in Path("/proc/self/status").read_text().splitlines() if line.startswith("Umask")],
        "locale": C.setlocale(6, None).decode(),
        "environment": [str(C.getenv(b"RUDE")), str(C.getenv(b"KIND")), os.environ.get("KIND")],
        "handlers": [address_of(getattr(signal, name)) for name in NUMBERS],
        "alarm": signal.getitimer(signal.ITIMER_REAL)[0] > 0,
        "blocked": sorted(signal.pthread_sigmask(signal.SIG_BLOCK, ())),
        "streams": [stream_of(number) for number in (0, 1, 2)],
        "limit": resource.getrlimit(resource.RLIMIT_NOFILE),
        "cores": sorted(os.sched_getaffinity(0)),
        "registers": [registers.raw[:2].hex(), (int.from_bytes(registers.raw[28:32], "little") & ~63)],
    }


def address_of(number: int) -> int:
    action = ctypes.create_string_buffer(256)
    C.sigaction(int(number), None, action)
    return int.from_bytes(action.raw[:8], "little")


def stream_of(number: int) -> list[int]:
    try:
        found = os.fstat(number)
    except OSError:
        return []
    return [found.st_dev, found.st_ino]


def main() -> None:
    import cosim

    C.setlocale(6, b"C.UTF-8")
    answers, here, said = [], state(), os.dup(1)
    for one in sys.argv[1:]:
        try:
            notes = list(cosim.run(one).statistics["notes"])
        except cosim.CosimError as error:
            notes = [str(error)]
        now = state()
        answers.append({"changed": [name for name in here if here[name] != now[name]], "notes": notes})
    os.write(said, json.dumps(answers).encode())


if __name__ == "__main__":
    main()
