"""Firmware of a card: built, fed with samples, compared with the FMU, its instructions counted under qemu-arm."""

import re
import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from export_models import Driver

from cosim.cli.firmware import INPUT, OUTPUT, quantum_of
from pyfmi_models.card import Card
from pyfmi_models.export import build_library
from pyfmi_models.export.build import compile_shared
from pyfmi_models.export.firmware import FLAGS, LINK, Project, firmware, target_of
from pyfmi_models.model import Model

RESET, ENABLE = 2, 1
FAULT, OFF, ON = 0, 1, 2
PERIOD = 1e-4
EMULATOR = "qemu-arm"


def project_of(card: Card, target: str) -> Project:
    return project_of_model(card.controller_model(), quantum_of(card), target)


def project_of_model(model: Model, quantum: float, target: str) -> Project:
    machine = target_of(target)
    return firmware(model, machine, encoder=INPUT, quantum=quantum, command=OUTPUT, origin="firmware_tools")


def program_of(project: Project, target: str) -> Path:
    """The program that the README's line makes, with zig."""
    files = {name: text for name, text in project.files.items() if name.endswith((".c", ".h"))}
    machine = target_of(target)
    return compile_shared(files, "controller", machine.target, (*machine.flags, *FLAGS, *LINK, *machine.link))


def command_of(program: Path, target: str, *options: str) -> list[str]:
    return [EMULATOR, "-cpu", "cortex-a9", *options, str(program)] if target == "cortex-a9" else [str(program)]


def samples(card: Card, count: int, frequency: float = 1.0, seed: int = 1) -> np.ndarray:
    """Counts, request, edges missed, inputs: a reset, a start, then a noisy sine of 0.13 rad/s that wraps 32 bits."""
    t, w, size = PERIOD * np.arange(count), 2 * np.pi * frequency, 0.02 / frequency
    q_d, v_d, a_d = size * np.sin(w * t), size * w * np.cos(w * t), -size * w**2 * np.sin(w * t)
    noise = np.random.default_rng(seed).normal(0, 2e-8, count)
    quantum = quantum_of(card)
    start = 2**31 - 2**21  # near the end of the range of int32, so that the sine crosses it
    counts = start + np.round((q_d + 1e-6 * np.sin(7 * w * t) + noise) / quantum)
    request = np.full(count, ENABLE)
    request[0], request[1] = 0, RESET
    rows = np.column_stack((np.mod(counts, 2**32), request, np.zeros(count), counts, q_d, v_d, a_d))
    rows[:, 4] += start * quantum
    return np.ascontiguousarray(rows, float)


def answers(program: Path, target: str, rows: np.ndarray, model_outputs: int) -> np.ndarray:
    """State, torque, outputs of each cycle: what was written at the edge after it."""
    fed = np.vstack((rows, rows[-1:]))
    done = subprocess.run(command_of(program, target), input=fed.tobytes(), capture_output=True, check=True)
    return np.frombuffer(done.stdout).reshape(len(fed), 2 + model_outputs)[1:]


def fmu_answers(card: Card, rows: np.ndarray) -> np.ndarray:
    return model_answers(card.controller_model(), quantum_of(card), rows)


def model_answers(model: Model, quantum: float, rows: np.ndarray) -> np.ndarray:
    """Outputs of the FMU for the samples from the one that enables on, the position without wraps."""
    driver = Driver(model, build_library(model), 3).start()
    position = unwrapped(rows[:, 0])[2:]
    names, found = [one.name for one in model.inputs], []
    places = [names.index(one) for one in names if one != INPUT]
    for k, row in enumerate(rows[2:]):
        driver.set(INPUT, quantum * float(position[k]))
        for place in places:
            driver.set(names[place], float(row[3 + place]))
        assert driver.step(k * PERIOD, PERIOD) == "ok", driver.messages
        found.append(driver.get(*(one.name for one in model.outputs)))
    return np.array(found)


def unwrapped(counts: np.ndarray) -> np.ndarray:
    """Position in counts: the first as a number with sign, then differences modulo 2^32."""
    words = counts.astype(np.uint32)
    ways = np.diff(words).astype(np.int32).astype(np.int64)
    return np.concatenate(([np.int64(words[:1].astype(np.int32)[0])], ways)).cumsum()


def trace(program: Path, rows: np.ndarray) -> Iterator[tuple[str, int]]:
    """Function and stack pointer before each instruction on the Cortex-A9."""
    helped = subprocess.run([EMULATOR, "--help"], capture_output=True, text=True, check=False).stdout
    single = "-one-insn-per-tb" if "one-insn-per-tb" in helped else "-singlestep"
    command = command_of(program, "cortex-a9", single, "-d", "exec,cpu,nochain", "-D", "/dev/stderr")
    pipe = subprocess.PIPE
    with subprocess.Popen(command, stdin=pipe, stdout=subprocess.DEVNULL, stderr=pipe) as process:
        assert process.stdin is not None
        assert process.stderr is not None
        process.stdin.write(rows.tobytes())
        process.stdin.close()
        name = ""
        for line in process.stderr:
            if line.startswith(b"Trace"):
                name = line.rpartition(b"] ")[2].strip().decode()
            elif line.startswith(b"R12="):
                yield name, int(line.partition(b"R13=")[2][:8], 16)
    assert process.returncode == 0


def effort(project: Project, program: Path, rows: np.ndarray) -> tuple[list[int], list[int], int]:
    """Instructions of each cycle, of its step; bytes of stack from `main` down, without the C library's."""
    own = set(re.findall(r"\b(\w+)\(", b"".join(project.files.values()).decode()))
    cycles, steps, top, deepest = [0], [0], 0, 0
    stepping = in_cycle = False
    for name, pointer in trace(program, rows):
        if name == "main":
            top, in_cycle = top or pointer, False
            if steps[-1]:
                cycles.append(0)
                steps.append(0)
            cycles[-1] = 0
        in_cycle |= name == "loop_cycle"
        stepping = name == "controller_step" or (stepping and name != "loop_cycle")
        cycles[-1] += in_cycle
        steps[-1] += in_cycle and stepping
        if in_cycle and name in own:
            deepest = max(deepest, top - pointer)
    return cycles[:-1], steps[:-1], deepest


def missing_emulator() -> str:
    """Why the Cortex-A9 cannot run here; empty where it can."""
    return "" if shutil.which(EMULATOR) else f"{EMULATOR} is not installed (apt-get install qemu-user)"


def need(target: str) -> None:
    """Skip a test where programs for a target cannot run."""
    if target == "cortex-a9" and missing_emulator():
        pytest.skip(missing_emulator())
