"""Random calls of the C interface: a sample of what bench/fuzz.py does for long and under sanitizers."""

from functools import cache

import fuzz_models
import pytest
from fuzz_calls import functions

from pyfmi_models.export.build import compile_shared, sources_of
from pyfmi_models.export.platforms import PLATFORMS, host

EXAMPLES = 25


@cache
def facts(name, fmi, planted=None):
    machine, generated = PLATFORMS[host()], fuzz_models.code_of(name)
    sources = sources_of(generated)
    sources = planted(sources) if planted else sources
    library = compile_shared(sources, f"played{machine.suffix}", machine.target)
    return fuzz_models.facts_of(generated, library, fmi, shrink=not planted)


@pytest.mark.parametrize("fmi", [2, 3])
@pytest.mark.parametrize("name", fuzz_models.MODELS)
def test_no_call_crashes_and_every_answer_keeps_the_rules(name, fmi, tmp_path):
    played = fuzz_models.play(facts(name, fmi), tmp_path, EXAMPLES, seed=20, timeout=120)
    assert played.code == 0, played.reason
    assert played.counts["calls"] > played.counts["granted"] > 300
    assert len({*functions(fmi)} - {*played.counts["functions"]}) <= len(functions(fmi)) / 3


def test_the_same_seed_gives_the_same_calls(tmp_path):
    digests = [fuzz_models.play(facts("root", 3), tmp_path, 3, seed).counts["digest"] for seed in (1, 1, 2)]
    assert digests[0] == digests[1] != digests[2]


def test_a_planted_error_is_found(tmp_path):
    """The others of fuzz_models.PLANTED are found by the long runs."""
    planted = next(one for one in fuzz_models.PLANTED if one.what == "half of a step")
    played = fuzz_models.play(facts(planted.model, 3, planted), tmp_path, 150, seed=20, timeout=120)
    assert "a refusal has changed the instance" in played.text
