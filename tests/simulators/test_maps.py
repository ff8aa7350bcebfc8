"""Learned terms are shown as curves and go along with an FMU as maps with breakpoints and units."""

import json
import zipfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from fmpy.validation import validate_fmu

from cosim.api.export import export
from cosim.api.show import show
from cosim.models.maps import WIDTH, curve, curves_in, maps_of
from pyfmi_models.card import read_card
from pyfmi_models.card_writer import card_text
from pyfmi_models.effects.learned import LearnedTorque

ONE = LearnedTorque(over="position", seen=(-1.0, 1.0), torque=(0.0, 0.2))
TWO = replace(ONE, by="speed", by_seen=(0.0, 2.0), waves=(1, 1), torque=(0.1, 0.0, 0.0, 0.3))


@pytest.fixture
def card(tmp_path: Path) -> Path:
    path = tmp_path / "learned.toml"
    path.write_text(card_text(replace(read_card("paper_mount"), effects=(ONE, TWO), controller=None)))
    return path


def test_a_map_has_the_values_of_the_term_at_its_breakpoints(card: Path) -> None:
    first, second = maps_of(read_card(card))
    np.testing.assert_allclose(first["value"], 0.2 * np.cos(np.pi * (np.array(first["at"]) + 1) / 2), atol=1e-12)
    assert (first["unit"], first["kind"]) == ("N.m", "torque")
    assert np.shape(second["value"]) == (len(second["at"]), len(second["by_at"]))


@pytest.mark.parametrize("content", ["[]", "{", '{"format": "mount-cosim maps 1"}', '{"format": "x", "maps": [1]}'])
def test_a_file_that_only_has_the_name_of_our_maps_draws_nothing(content: str, tmp_path: Path) -> None:
    with zipfile.ZipFile(tmp_path / "a.fmu", "w") as archive:
        archive.writestr("extra/maps.json", content)
    assert curves_in(tmp_path / "a.fmu", "extra/maps.json") == []


def test_an_fmu_carries_its_maps_is_shown_with_them_and_stays_valid(card: Path, tmp_path: Path) -> None:
    (path,) = export(card, tmp_path / "out", fmi=3).fmus
    rows = show(card).tables["learned maps"]
    assert (rows[0]["curve"][0], rows[0]["curve"][-1], rows[0]["values"]) == ("█", "▁", "-0.2 to 0.2 N.m")
    assert len(rows) == 1 + 5, "the map of two quantities at five values of the second"
    assert "learned maps" not in show("emps").tables
    assert show(path).tables["learned maps"] == rows
    assert not validate_fmu(path)
    with zipfile.ZipFile(path) as archive:
        folder = "extra/org.fmi-standard.fmi-ls-ref/"
        told = json.loads(archive.read(f"{folder}maps.json"))
        assert b"maps.json" in archive.read(f"{folder}fmi-ls-manifest.xml")
    assert [one["name"] for one in told["maps"]] == ["learned", "learned2"]


def test_a_map_is_drawn_from_end_to_end_in_one_line() -> None:
    assert curve([2.0, 2.0]) == "▁▁"
    drawn = curve([float(k) for k in range(101)])
    assert len(drawn) == WIDTH
    assert (drawn[0], drawn[-1]) == ("▁", "█")
    assert list(drawn) == sorted(drawn)
