"""Progress of a diagnosis: stages count up to their number, and the time to go comes down."""

import re

from cosim.api.progress import Staged, stages_of

TOLD = (
    "refitting the base",
    "Delay (1 of 2)",
    "Cogging (2 of 2)",
    "proving on the recording that was not fitted",
    "Delay",
    "building the improved FMU",
    "closing the loop",
    "writing the report",
)


def lines(has_card: bool = True, writes_all: bool = True, pace: float = 3.0) -> list[str]:
    said: list[str] = []
    clock = iter(pace * k for k in range(100))
    staged = Staged(said.append, stages_of(has_card, writes_all), lambda: next(clock))
    for text in TOLD if writes_all else TOLD[:5]:
        staged(text)
    return said


def test_stages_count_up_and_never_back() -> None:
    numbers = [re.match(r"stage (\d) of 6: ", line)[1] for line in lines()]  # type: ignore[index]
    assert numbers == ["1", "2", "2", "3", "3", "4", "5", "6"]
    assert lines(writes_all=False)[-1].startswith("stage 3 of 3: Delay")
    assert lines(has_card=False)[0].startswith("stage 2 of 7: refitting the base")


def test_the_time_to_go_comes_down() -> None:
    said = lines()
    assert "left" not in said[0]  # nothing is known yet
    left = [float(re.search(r"about (\d+) s left", line)[1]) for line in said[3:]]  # type: ignore[index]
    assert left[-1] < left[0]
    assert left[-1] <= 3
