"""Measured recordings are let pass as they are; a slip put into them is called by its name.

Where the measured ones are not beside the checkout, recordings made of the same machines' numbers take their place.
"""

from itertools import product

import pytest
from measured_like import read
from test_sanity_recordings import REFUSED, SLIPS, Change, said

from cosim.data.recording import Recording
from cosim.support.errors import RecordingError
from pyfmi_models.card import Card, parse_card


def refusal(card: Card, recordings: tuple[Recording, ...], change: Change) -> str:
    """The message of the refusal, or what is said instead and blocks names."""
    try:
        return " ".join(one[1] for one in said(card, recordings, change) if one[2])
    except RecordingError as error:
        return str(error)


MEASURED = {
    "quasi_direct_pendulum": ("ddp", "direct_collocation", "energy_shaping", 0.15, 0.15),
    "anticogging_motor": ("acc_a", "sp1_off", "acc_b", 4.8e-6, 2e-3),
}
"""Two machines that share nothing with what makes recordings here: two recordings to train, one held out, and the
inertia [kg m2] and Coulomb friction [N m] that an owner writes into a card."""
DIFFICULT = {
    ("quasi_direct_pendulum", "late"): "its own lag is 18 ms and two thirds are left at 38: said; its gravity is named",
    ("anticogging_motor", "gear"): "without gravity an inertia of a sixth is all that shows",
    ("anticogging_motor", "twice"): "an inertia of half the card's is all that shows",
}
"""Slips that are said, but may not be certain enough to block names, and why."""
UNTOLD = {("anticogging_motor", "late"): "turns at nearly constant speed do not tell a lag from friction"}
"""Slips of which nothing is said, and why."""


class TestMeasured:
    def given(self, machine: str) -> tuple[Card, tuple[Recording, ...]]:
        *names, inertia, friction = MEASURED[machine]
        card = parse_card(
            f'[mount]\ninertia = {inertia}\n[friction]\nmodel = "coulomb"\nFc = {friction}\nsigma2 = 0.0\n', "card.toml"
        )
        return card, tuple(read(machine, name) for name in names)

    @pytest.mark.parametrize("machine", MEASURED)
    def test_the_recordings_as_they_are_are_let_pass(self, machine: str) -> None:
        """The pendulum's position comes 16 ms after its torque, which is said and blocks nothing."""
        assert [one for one in said(*self.given(machine)) if one[2] or one[0] != "clocks"] == []

    @pytest.mark.parametrize(("machine", "slip"), [one for one in product(MEASURED, SLIPS) if one not in UNTOLD])
    def test_a_slip_is_called_by_its_name(self, machine: str, slip: str) -> None:
        change, finding, words = SLIPS[slip]
        found = said(*self.given(machine), change)
        assert set(finding.split("|")) & {one[0] for one in found}
        assert any(words in one[1] for one in found)
        assert any(one[2] for one in found) or (machine, slip) in DIFFICULT

    @pytest.mark.parametrize(("machine", "slip"), list(product(MEASURED, REFUSED)))
    def test_a_wrong_unit_is_refused_or_blocks(self, machine: str, slip: str) -> None:
        change, option = REFUSED[slip]
        assert f"Use {option}." in refusal(*self.given(machine), change)
