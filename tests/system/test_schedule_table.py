"""`cosim show SCENARIO --schedule` tells the order in a step, how old inputs are, and what FMUs offer besides."""

import json
from pathlib import Path
from typing import Any

import pytest
from commands import call
from small_loop import text_of
from tiny_fmu import described, description

from cosim.api.show import show
from cosim.support.errors import InputError


def scenario(folder: Path, fmu: Path, every: int = 1, **algorithm: Any) -> str:
    both = {"mass": {"fmu": fmu}, "spring": {"fmu": fmu, "every": every}}
    given = {"name": "loop", "step": 0.1, "stop": 2.0, "components": both, "record": {"signals": ["mass.y"]}}
    path = folder / "loop.toml"
    path.write_text(
        text_of({"mass.b": "spring.y", "spring.a": "mass.y"}, **given, algorithm={"kind": "jacobi"} | algorithm)
    )
    return str(path)


def test_jacobi_gathers_all_before_any_steps_and_values_are_a_step_old(tiny: dict[int, Path], tmp_path: Path) -> None:
    tables = show(scenario(tmp_path, tiny[3]), schedule=True).tables
    told = [(row["stage"], row["what"], row["component"]) for row in tables["order"]]
    assert (told[0], told[-1]) == ((1, "take their inputs", "mass"), (2, "step", "spring"))
    assert {row["age"] for row in tables["inputs"]} == {"1 tick, 100 ms"}
    assert {row["over the step"] for row in tables["inputs"]} == {"held"}


def test_gauss_seidel_hands_on_what_is_new(tiny: dict[int, Path], tmp_path: Path) -> None:
    file = scenario(tmp_path, tiny[3], kind="gauss-seidel", order=["spring", "mass"])
    tables = show(file, schedule=True).tables
    assert [row["component"] for row in tables["order"]] == ["spring", "spring", "mass", "mass"]
    ages = {row["input"]: row["age"] for row in tables["inputs"]}
    assert ages == {"mass.b": "at once", "spring.a": "1 tick, 100 ms"}


def test_a_slower_component_says_when_it_looks_and_when_it_shows(tiny: dict[int, Path], tmp_path: Path) -> None:
    tables = show(scenario(tmp_path, tiny[3], every=4), schedule=True).tables
    when = [row["when"] for row in tables["order"] if row["component"] == "spring"]
    assert when == ["in the first of 4 steps (0.4 s)", "in the last of 4 steps (0.4 s)"]


PIECES = "extrapolated to the middle of each of up to 64 pieces"


@pytest.mark.parametrize(
    ("algorithm", "told"),
    [
        ({"kind": "iterated"}, "held at 0.5 of its start + 0.5 of its end"),
        ({"kind": "energy", "bonds": [["mass.y", "spring.y"]]}, PIECES),
    ],
)
def test_coupled_inputs_say_what_they_are_over_the_step(
    algorithm: dict[str, Any], told: str, tiny: dict[int, Path], tmp_path: Path
) -> None:
    tables = show(scenario(tmp_path, tiny[3], **algorithm), schedule=True).tables
    assert {row["over the step"] for row in tables["inputs"]} == {told}


def test_what_an_fmu_offers_and_nobody_uses_is_told(tiny: dict[int, Path], tmp_path: Path) -> None:
    marks = 'hasEventMode="true" mightReturnEarlyFromDoStep="true" providesIntermediateUpdate="true" modelIdentifier'
    rich = described(tiny[3], tmp_path / "rich.fmu", description(3).replace("modelIdentifier", marks, 1))
    (first, _) = show(scenario(tmp_path, rich), schedule=True).tables["offered"]
    assert first["offered, not used"] == "event mode, early return by itself, intermediate update"
    (plain, _) = show(scenario(tmp_path, tiny[2]), schedule=True).tables["offered"]
    assert plain["offered, not used"] == "nothing"


def test_the_command_prints_tables_and_json(capsys: pytest.CaptureFixture[str]) -> None:
    for more in ([], ["--json"]):
        assert call("show", "sidereal", "--schedule", *more) == 0
    out = capsys.readouterr().out
    assert "take their inputs" in out
    assert json.loads(out[out.index("{") :])["order"][0]["component"] == "mount"


@pytest.mark.parametrize("other", ["paper_mount", "nothing.toml"])
def test_what_has_no_schedule_is_refused_in_a_sentence(other: str) -> None:
    with pytest.raises(InputError, match=other):
        show(other, schedule=True)
