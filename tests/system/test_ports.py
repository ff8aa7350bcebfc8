"""A reference to a port is one type with one reader, from a scenario's text to the plan."""

import json
import pickle
from dataclasses import asdict, replace
from pathlib import Path

import pytest

from cosim.system.ports import PortRef
from cosim.system.wire import Record, Wire

SPLIT = '.partition(".")'
ROOT = Path(__file__).parents[2]
SPEAK_OF_PORTS = (*(f"cosim/{one}" for one in ("system", "master", "hardware", "sweeps")), "cosim_observatory")
SPLITS = {"ports.py": 2, "reading.py": 1}
"""The reader itself, and the number of the standard that an SSP names."""


@pytest.mark.parametrize(
    ("text", "owner", "port"),
    [
        ("plant.q", "plant", "q"),
        ("plant.bristle.z[1]", "plant", "bristle.z[1]"),
        ("noise", "noise", ""),
        ("a.", "a", ""),
    ],
)
def test_a_reference_is_its_text_and_its_two_parts(text: str, owner: str, port: str) -> None:
    found = PortRef(text)
    assert (found, found.owner, found.port, found.parts) == (text, owner, port, (owner, port))
    assert {found: 1}[text] == 1
    assert json.dumps([found]) == json.dumps([text])


def test_wires_and_records_take_texts_and_hold_references() -> None:
    wire = Wire("controller.tau", "plant.tau", gain=2.0)
    assert (wire.source.owner, wire.target.port) == ("controller", "tau")
    assert replace(wire, source="other.tau").source.owner == "other"
    assert asdict(wire)["target"] == "plant.tau"
    assert pickle.loads(pickle.dumps(wire)) == wire
    assert Record("plant.q").signal.parts == ("plant", "q")
    assert repr(Record("q")) == "Record(signal='q', mode='sample')"
    with pytest.raises(TypeError, match="target"):
        Wire("controller.tau")  # type: ignore[call-arg]


def test_no_other_module_takes_a_reference_apart_by_hand() -> None:
    for path in (path for folder in SPEAK_OF_PORTS for path in (ROOT / folder).rglob("*.py")):
        assert path.read_text("utf-8").count(SPLIT) <= SPLITS.get(path.name, 0), path
