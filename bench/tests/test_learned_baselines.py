"""The benchmark of learned terms beside regressions: what it records, and what its page counts."""

from bench.learned_baselines import METHODS, page


def row(seed: int, inside: float, outside: float, learned: list[str]) -> dict[str, object]:
    left = {"inside": dict.fromkeys(METHODS, inside), "outside": dict.fromkeys(METHODS, outside)}
    left["outside"] |= {"gp": None}
    return {"seed": seed, "effect": "run_in", "size": 1.0, "verdict": ["unknown"], "learned": learned, **left}


def test_the_page_counts_what_is_left_and_what_is_made_worse() -> None:
    text = page([row(1, 0.5, 1.2, ["torque"]), row(2, 0.9, 0.8, [])], "command")
    assert "All cases (2)" in text
    assert "Cases in which a term was delivered (1)" in text
    assert "| delivered | 0.70 [0.50, 0.90] | 0 % | 1.00 [0.80, 1.20] | 50 % |" in text
    assert "| gp | 0.70 [0.50, 0.90] | 0 % | - | - |" in text
    assert "| run_in | 1.0 | 1 | unknown | torque | 0.50 |" in text
