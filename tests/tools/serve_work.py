"""Work in place of a diagnosis: functions of a light module, because another process imports it for each."""

import os
import subprocess
import sys
import time
from typing import Any

from cosim.support.child import tell
from cosim.support.errors import InputError

ANSWER = {"heading": "One effect is missing from the model", "findings": [], "check": [], "verdict": ["cogging"]}
NOTE = "pids"
"""File beside the recordings into which work writes its process numbers."""
CARD = "[mount]\ninertia = 1.0\n"


def quickly(order: Any) -> dict[str, Any]:
    order.out.mkdir()
    (order.out / "report.html").write_text("<title>Report</title>", "utf-8")
    (order.out / "card.toml").write_text(CARD, "utf-8")
    tell("step", "Cogging (1 of 2)")
    return ANSWER


def for_ever(order: Any) -> dict[str, Any]:
    order.out.mkdir()
    (order.out / "half").write_text("half", "utf-8")
    child = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(600)"])
    tell("step", "Friction asymmetry (2 of 5)")
    tell("answer", ANSWER)
    (order.recordings.parent / NOTE).write_text(f"{os.getpid()} {child.pid}", "utf-8")
    time.sleep(600)
    return ANSWER


def refusing(order: Any) -> dict[str, Any]:
    raise InputError("run1.csv does not move.", culprit="run1.csv")


def crashing(order: Any) -> dict[str, Any]:
    os.abort()


def comparing(order: Any) -> dict[str, Any]:
    """Write what a diagnosis of two effects, or without any where it has one recording, is compared by."""
    from report_example import diagnosis

    from cosim_serve import comparison
    from cosim_serve.work import in_words

    found = diagnosis("two" if order.uploads[1:] else "none")
    quickly(order)
    comparison.write(found, order.out)
    return in_words(found)
