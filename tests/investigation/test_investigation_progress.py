"""Progress of an investigation: stages count up to at most so many, the best answer is kept, the time comes down."""

import re

from cosim.api.rounds import Rounds
from cosim.investigation.story import Answered, Moved, Story

DIAGNOSIS = ("refitting the base", "Delay (1 of 2)", "proving on the recording that was not fitted")


def answer(after: float, *names: str) -> Answered:
    return Answered(0, names, (), (), 0.8, after, 0.1, 1.0)


def lines(budget: float = 60.0) -> list[str]:
    """What is told of three rounds of two motions of 10 s; each call takes 2 s."""
    said: list[str] = []
    rounds = Rounds(said.append, budget, 10.0, lambda: 2.0 * len(said))
    for number, found in enumerate((answer(0.3, "cogging"), answer(0.2, "cogging", "delay"), answer(0.5))):
        for role in ("train", "heldout"):
            rounds("moving: a sweep")
            rounds.step(Moved(number, "x.parquet", role, "sweep", "a sweep", 10.0))
        for text in DIAGNOSIS:
            rounds(text)
        rounds.step(found)
        if number < 2:
            rounds("designing the next motion")
    return said


def test_stages_count_up_to_the_most_that_the_budget_allows() -> None:
    told = [re.match(r"stage (\d+) of (?:at most )?(\d+): ", line) for line in lines()]
    numbers, most = zip(*[(int(one[1]), int(one[2])) for one in told if one], strict=True)
    assert list(numbers) == sorted(numbers)
    assert set(most) == {8}  # three rounds: move, diagnose, design; the last ends with its diagnosis
    assert numbers[-1] == 8
    assert lines()[-1].startswith("stage 8 of 8: ")
    assert "of at most 17: " in lines(120.0)[0]


def test_the_best_answer_so_far_stays_when_a_worse_one_comes() -> None:
    said = lines()
    assert "best so far" not in said[0]
    assert "best so far: cogging, validation error 0.8 -> 0.3" in said[6]
    assert "best so far: cogging, delay, validation error 0.8 -> 0.2" in said[-1]


def test_the_time_to_go_comes_down_in_later_rounds() -> None:
    said = lines()
    assert "left" not in said[0]
    left = [int(found[1]) for line in said if (found := re.search(r"at most about (\d+) s left", line))]
    assert left[-1] < left[0]
    assert 0 < left[-1] <= 6


def test_a_name_that_is_one_of_a_set_heads_nothing_alone() -> None:
    """The heading names the rivals; that a sure answer was not found twice is no rival."""
    first = answer(0.3, "cogging")
    rivals = Answered(
        1, ("cable_wrap",), ("cable wrap or gravity unbalance", "once more"), ("set", "unconfirmed"), 1, 1, 1, 1
    )
    assert Story((first, rivals), "budget spent").answer == "Cable wrap (open: cable wrap or gravity unbalance)"
    assert Story((rivals, first), "budget spent").answer == "Cogging"
