"""A change of the house changes no number: what a shipped scenario records and a shipped card exports, held by hash.

Where physics, generated C or a default changes on purpose, the hash here changes with it, and CHANGELOG says so.
"""

import hashlib
import json
import os
import re
import subprocess
import sys
import zipfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import cosim
from cosim.system.scenario import read_scenario
from pyfmi_models.card import read_card
from pyfmi_models.export import export_fmu

TICKS = 5_000
RECORDED = {
    "sidereal": "eba360c55796575d3f971b0f8328220e92319051a34e6d1657d14c2fda7ce3e5",
    "two_axis": "32ff574022b6bd4ecd2e0361bd703410749b359db76ce8fddd5715107d679124",
}
"""SHA-256 of the columns t, and all others in their order, float64, over the first 5,000 ticks, a row a tick."""
EXPORTED = {
    "plant": "4f309d35c64e779c520e217352c07ac1ce730e3a3b8993f6e16123598c32a568",
    "controller": "ce7cdd736efde0c8f4260a796ea7144fed9c07197365a6e91383a0f1e0205635",
}
"""SHA-256 of the C and the description in the FMI 3.0 archive of `paper_mount`; the version and date are left out."""
SET_POINTS = [
    {"kind": "sine", "frequency": 0.7, "amplitude": 0.3, "phase": 0.4, "smooth_start": 0.8},
    {"kind": "multisine", "frequencies": [0.3, 1.1, 2.9], "amplitudes": 1.0, "seed": 4},
    {"kind": "chirp", "start": 0.1, "stop": 3.0, "duration": 4.0, "amplitude": 0.2},
    {"kind": "star", "latitude_deg": 49.0, "declination_deg": 45.0, "hour_angle_h": -0.01},
    {"kind": "ramp", "velocity": 0.4, "smooth_start": 0.5},
]
STREAMED = """
import hashlib, json, sys
import numpy as np
from pydantic import TypeAdapter
from cosim.data.signals import Generator
signals = map(TypeAdapter(Generator).validate_python, json.loads(sys.argv[1]))
print(*(hashlib.sha256(one.stream(1e-3)(np.arange(30_000)).tobytes()).hexdigest() for one in signals))
"""
PASSING = rb'generationTool="[^"]*"|generationDateAndTime="[^"]*"|version="[^"]*"'


def digest(parts: list[bytes]) -> str:
    return hashlib.sha256(b"\n".join(parts)).hexdigest()


@pytest.mark.parametrize("name", RECORDED)
def test_a_shipped_scenario_records_the_same_bits(name: str) -> None:
    recording = cosim.run(replace(read_scenario(name), ticks=TICKS, decimation=1)).recording
    assert digest([f"{key}".encode() + recording[key].tobytes() for key in recording]) == RECORDED[name]


def streamed(**environment: str) -> list[str]:
    command = [sys.executable, "-c", STREAMED, json.dumps(SET_POINTS)]
    done = subprocess.run(command, env=os.environ | environment, capture_output=True, text=True, check=True)
    return done.stdout.split()


def test_a_processor_without_the_newest_instructions_gives_the_same_set_points() -> None:
    """What numpy and glibc take for a sine depends on the processor; here they are told that it can do little."""
    found = np.show_config(mode="dicts")["SIMD Extensions"].get("found", [])
    poor = {
        "NPY_DISABLE_CPU_FEATURES": " ".join(found),
        "GLIBC_TUNABLES": "glibc.cpu.hwcaps=-AVX512F,-AVX2,-FMA,-FMA4,-AVX2_Usable,-FMA_Usable",
    }
    assert streamed(**poor) == streamed()


@pytest.mark.parametrize("part", EXPORTED)
def test_a_shipped_card_exports_the_same_model(part: str, tmp_path: Path) -> None:
    card = read_card("paper_mount")
    model = card.plant().model() if part == "plant" else card.controller_model()
    with zipfile.ZipFile(export_fmu(model, tmp_path / "one.fmu", fmi=3)) as archive:
        names = [
            name for name in sorted(archive.namelist()) if re.fullmatch(r"sources/.*\.[ch]|modelDescription.xml", name)
        ]
        texts = [re.sub(PASSING, b"", archive.read(name)) for name in names]
    assert len(texts) > 2
    assert digest([name.encode() + text for name, text in zip(names, texts, strict=True)]) == EXPORTED[part]
