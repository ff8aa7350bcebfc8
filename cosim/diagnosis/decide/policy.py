"""Every constant of the decision, in one place: its meaning, its unit, where it comes from, how much depends on it."""

from dataclasses import dataclass

from cosim.diagnosis.answer.result import POLICY_VERSION


@dataclass(frozen=True)
class Policy:
    """Constants of evidence, search and decision. Evidence is in nats (natural logarithms of odds).

    Rules do not have numbers of their own. Those of evidence ask for one of four steps, each about three times the one
    before, those of size for one of six shares. Of 239 machines no more answers than by chance change where one of them
    is a third less or a half more (results/proof/ablation.md): a number between two would say more than is known.
    """

    version: str = POLICY_VERSION

    fair: float = 3.0
    """Evidence of odds of twenty to one: what a rival must be behind to be out of a set. Unit: nats. "Strong" in Kass
    and Raftery, Bayes factors, J. Am. Stat. Assoc. 90 (1995) 773."""
    clear: float = 10.0
    """Evidence of a first effect, of one beside others, of what held-out recordings lose without it. Unit: nats."""
    strong: float = 30.0
    """Evidence that no misfit of a friction law reaches. Unit: nats. In 180 nulls of two generators terms had 26 at
    most where held-out recordings supported them, presliding 24."""
    sure: float = 100.0
    """Evidence that stands whatever else speaks against it. Unit: nats."""

    negligible: float = 0.02
    """Share of the energy of the error that is about nothing that matters. Unit: 1."""
    slight: float = 0.05
    """Share of the friction, or of the energy, that no machine repeats. Unit: 1. Friction repeats to 5 to 20 %
    (Armstrong-Helouvry, Control of Machines with Friction, 1991)."""
    small: float = 0.15
    """Share below which an effect may imitate a corner of another one. Unit: 1. 96 nulls of three generators left .118
    of the friction at most, 167 nulls .052 of the energy in bursts."""
    considerable: float = 0.3
    """Share that is no corner of anything else. Unit: 1."""
    half: float = 0.5
    """Half of it. Unit: 1."""
    nearly_all: float = 0.9
    """Share that leaves no room for another cause. Unit: 1."""

    bands_hz: tuple[float, ...] = (2.0, 8.0, 32.0)
    """Edges [Hz] of the bands whose noise levels are estimated apart: what is slow is not judged by what is fast. From
    the second on motion is fast: a law's numbers may be others there, by `wander`."""
    coarsening: float = 400.0
    """Independent rows of a band beyond which more say nothing new: there the model's own misfit, not noise, limits
    what may be concluded. Unit: rows. Miller and Dunson, J. Am. Stat. Assoc. 114 (2019) 1113."""
    form_ways: float = 20.0
    """In how many independent ways an equation may be wrong in a band: so much evidence counts between two names.
    Unit: 1."""
    accuracy: float = 0.001
    """Least noise of a band relative to the torque in it: no model of friction is better. Unit: 1."""
    misfit: float = 0.1
    """How far a machine is from an equation (half-normal): a friction law from the friction level, a named effect from
    its torque, the base's numbers on another day from themselves. Unit: 1. Friction and loads of machines repeat their
    laws to 5 to 20 % (Armstrong-Helouvry, as above)."""
    wander: float = 0.02
    """Wander of the friction level in one recording, relative to it (half-normal). Unit: 1. No machine's friction is
    the same everywhere to two of them, so less is no physics that a card lacks ..."""
    wander_seconds: float = 10.0
    """... and its correlation time. Unit: s."""
    phase_price: float = 1.15
    """Price of a phase that is found in each recording anew. Unit: nats."""

    refitted: int = 8
    """Forms of effects that are refitted in a stage by each of the two screening statistics. Unit: 1. In eight
    stages of eight machines the best was among the first three of either, and of 18 within ten nats of it one was
    eighth. With 5 a fifth of the fits is saved and 80 fresh machines have the same names, but possible ones leave
    sets without having been asked for, and what is left is told as sure (.99 in place of .51)."""
    most_effects: int = 6
    """Different effects that one diagnosis may add."""
    least_above_noise: float = 5.0
    """Energy that a spring must remove, in those of the reading's noise, differentiated twice. Unit: 1. In nulls of
    two generators false springs removed 1.2 at most, beside other effects 4.1; true ones 6.8 and more."""

    true_beside_unknown: float = 0.2
    """What is left of the probability of a name beside something without one, unless it removes `nearly_all`. Unit: 1.
    Of 38 such names in three decks of two generators 5 were true [.06, .27], where .62 would be printed
    (results/abroad/calibration_sets.md) ..."""
    true_ahead: float = 0.75
    """... and of one that no term without a name reaches by `clear`, waves apart that are finer than any term. Unit: 1.
    Of 12 such names on development machines, many with a known effect beside an unknown one, 8 were true [.39, .86], of
    6 that were played after that 6; of 9 others 2."""

    @property
    def most_structures(self) -> int:
        """Structures beside which all effects are asked for, then what stands is taken as it is. Unit: 1.

        As many as `most_effects` need, each added and each taken out once. Of 175 answers (150 rough machines, 25
        recordings) half needed two, none more than six.
        """
        return 2 * self.most_effects

    @property
    def least_uneven(self) -> float:
        """What a friction level must differ by over position, relative to itself (amplitude), to be physics. Unit: 1.

        In 20 nulls of two generators fits of it have .036 at most; of nine true ones the smallest has .047.
        """
        return 2 * self.wander

    @property
    def fast_hz(self) -> float:
        """From here on motion is fast. Unit: Hz."""
        return self.bands_hz[1]


POLICY = Policy()
