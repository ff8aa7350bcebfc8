"""Every constant of the decision, in one place: its meaning, its unit, where it comes from, how much depends on it."""

from dataclasses import dataclass

from cosim.diagnosis.answer.result import POLICY_VERSION


@dataclass(frozen=True)
class Policy:
    """Constants of evidence, search and decision. Evidence is in nats (natural logarithms of odds)."""

    version: str = POLICY_VERSION
    bands_hz: tuple[float, ...] = (2.0, 8.0, 32.0)
    """Edges [Hz] of the bands whose noise levels are estimated apart: what is slow is not judged by what is fast."""
    coarsening: float = 400.0
    """Independent rows of a band beyond which more say nothing new: there the model's own misfit, not noise, limits
    what may be concluded. Unit: rows. Miller and Dunson, J. Am. Stat. Assoc. 114 (2019) 1113."""
    form_ways: float = 20.0
    """In how many independent ways an equation may be wrong in a band: so much evidence counts between two names.
    Unit: 1."""
    form: float = 0.1
    """How far a machine is from the equation of a named effect, relative to its torque (half-normal): beside others an
    effect must explain more than that. Unit: 1. Friction and loads of machines repeat their laws to 5 to 20 %
    (Armstrong-Helouvry, Control of Machines with Friction, 1991)."""
    accuracy: float = 0.001
    """Least noise of a band relative to the torque in it: no model of friction is better. Unit: 1."""
    fast_hz: float = 8.0
    """From here on motion is fast: a law's numbers may be others there. Unit: Hz."""
    fast_prior: float = 0.03
    """How far, relative to each number (half-normal). Unit: 1. Beside a true weight of .96 of the energy evidence is
    291, 270, 266 nats at .03, .1, .3, and -260 at nothing; of three others it is the same within half a nat."""
    shape_prior: float = 0.1
    """What a friction law may lack, relative to the friction level (half-normal). Unit: 1."""
    wander_prior: float = 0.02
    """Wander of the friction level, relative to it (half-normal). Unit: 1."""
    least_uneven: float = 0.04
    """What a friction level must differ by over position, relative to itself (amplitude): no machine's is the same
    everywhere to two standard deviations of what it wanders by, so less is no physics that a card lacks. Unit: 1. In 20
    nulls of two generators fits of it have .036 at most, 18 of them .021; of nine true ones the smallest has .047, the
    others .25 and more."""
    wander_seconds: float = 10.0
    """Correlation time of that wander. Unit: s."""
    moved_prior: float = 0.1
    """How far the base's numbers are from those of training on a recording that was not fitted, relative to themselves
    (half-normal): friction repeats to 10 to 20 % (Armstrong-Helouvry, Control of Machines with Friction, 1991).
    Unit: 1. With 0.3 the same verdicts in six cases that it decides."""
    small_gain: float = 0.15
    """Share of the plain residual energy below which an effect is small: it may imitate a corner of the missing ..."""
    small_evidence: float = 100.0
    """... and must have this evidence. Unit: nats. One that is alone and has less is taken if it halves the held-out
    error (`halved`) and predicts: of 19 such in 200 nulls of two generators none did, one without predicting."""
    least_bent: float = 36.0
    """Evidence that presliding must have. Unit: nats. Beside it what laws may lack at stops stands aside; laws that are
    smooth in speed differ there from one that is not: in nulls by 24, true ones have 180 and more, one that removes .95
    of the energy at rest 48."""
    phase_price: float = 1.15
    """Price of a phase that is found in each recording anew. Unit: nats."""
    refitted: int = 8
    """Forms of effects that are refitted in a stage by each of the two screening statistics."""
    least_evidence: float = 15.0
    """Evidence that the first effect must have. Unit: nats ..."""
    large_gain: float = 0.25
    """... unless it removes this share of the plain residual energy. Unit: 1. What is slow has few independent rows,
    and so little evidence, but it is large or no one would miss it ..."""
    evidence_if_large: float = 9.0
    """... then it needs so much. Unit: nats. In 76 nulls what removes a fifth has 5 at most, or 19 and more and then
    predicts nothing."""
    least_plain_gain: float = 0.02
    """Share of the plain residual energy that an effect must remove: less is about nothing that matters. Unit: 1."""
    least_above_noise: float = 5.0
    """Energy that a spring must remove, in those of the reading's noise, differentiated twice. Unit: 1. In nulls of
    two generators false springs removed 1.2 at most, beside other effects 4.1; true ones 6.8 and more."""
    least_away: float = 0.08
    """Share of what an effect of timing removes that it must remove away from turns: an axis that sticks within a step
    of its encoder turns late. Unit: 1. In three such nulls .007 at most, where friction alone is ahead at turns .07,
    true ones have .19 and more, and one of 2,020 nats .093: turns are where a lag shows most."""
    keep_evidence: float = 8.0
    """Evidence below which an accepted effect goes when others came after it. Unit: nats."""
    further_share: float = 0.4
    """Evidence that an effect beside others must have, relative to theirs: an equation is never quite the machine's,
    and what it lacks looks like another effect. Unit: 1. False ones beside true ones had .33 to .37, true ones .53 and
    more ..."""
    further_evidence: tuple[float, float] = (8.0, 75.0)
    """... but at least the first and at most the second. Unit: nats."""
    least_wave: float = 5.0
    """Evidence that a further wave of a ripple must have. Unit: nats."""
    most_effects: int = 6
    """Different effects that one diagnosis may add."""
    set_margin: float = 3.0
    """Evidence by which a rival must be beaten to be out of the set. Unit: nats."""
    margin_beside_unknown: float = 0.3
    """Share of a margin that counts where something without a name is left, which no likelihood has: there ten nats
    exclude what three do elsewhere. Unit: 1. A stated principle: none of 162 cases of three worlds needs it, of 25 on
    measured machines two are a set by it and else only possible."""
    least_predicted: float = 3.0
    """What held-out recordings must lose without what is small but halves the error, or holds at rest. Unit: nats."""
    clearly_predicted: float = 10.0
    """What they must lose without an effect where the plain error does not tell. Unit: nats, as of what excludes beside
    something unknown. Of 165 names abroad and 90 at home true ones have 9.5 and more, or a third of the plain error,
    two have 3.5 and 3.6; false ones had 4.9, 6.2 and 7.9 (seeds 560194608, 1494289175)."""
    halved: float = 0.5
    """Share of the plain held-out error energy that an effect may remove instead. Unit: 1."""
    sure_predicted: float = 30.0
    """The same, from which an effect may be small. Unit: nats."""
    most_raised: float = 0.03
    """Share by which the plain held-out error energy may rise in one of two bands. Unit: 1."""
    least_share: float = 0.02
    """Energy that an effect must remove, relative to what the base leaves: less may be the form of another effect.
    Unit: 1."""
    floor: float = 26.0
    """Evidence of a flexible term that no misfit of a friction law reaches and held-out recordings support ... Unit:
    nats."""
    supported: float = 0.05
    """... by this share of the held-out residual that it predicts. Unit: 1. It falls to `least_followed` where they
    agree as much as `follows`, in proportion: in 200 nulls of two generators one term of more than 10 nats had a share
    above .1, at turns alone ..."""
    floor_alone: float = 40.0
    """... or that has this evidence, and they do not contradict it. Unit: nats. A level that wanders follows anything
    slow by chance: nulls have 36 to 49 ..."""
    contradicted: float = 0.05
    """... by this share that it adds to the held-out residual, Unit: 1 ..."""
    denied: float = 5.0
    """... or by so many times the evidence there against it. Unit: 1. Of seven nulls with 31 to 77 nats two added .7
    and 10 to the residual, two lost 7 and 8 times as much; where something is missing it was 3 times at most ..."""
    sure_floor: float = 100.0
    """... or that none reaches whatever held-out recordings say, where a motion of another kind may hide it. Unit:
    nats ..."""
    least_followed: float = 10.0
    """... or this where it predicts the share `follows` there. Unit: nats."""
    least_away_unnamed: float = 0.33
    """Share of what a term removes that it must remove away from turns, where laws lack most. Unit: 1. In nulls of two
    generators .06 to .32, where something is missing .46 and more."""
    imitation: float = 0.3
    """Evidence of what is left, relative to a name's, from which the name may imitate what is missing. Unit: 1."""
    follows: float = 0.3
    """Share of the held-out residual that a quantity must predict for it to be said to follow that ... Unit: 1."""
    sure_beside_unknown: float = 0.9
    """Share of the residual energy that a name must remove, in training or held out, to be sure where something unknown
    is left. Unit: 1. Beside it 15 names of 19 in the own generator were false, with .03 to .89; true ones had .19,
    .95 and .997 there, .95 to .98 on two measured machines. Of the energy at rest: the share from which a contact
    surely holds the axis (`stages.holds_at_rest`)."""
    true_beside_unknown: float = 0.2
    """What is left of the probability of any other name there. Unit: 1. Of 38 such names in three decks of two
    generators 5 were true [.06, .27], where .62 would be printed (results/abroad/calibration_sets.md) ..."""
    true_ahead: float = 0.75
    """... and of one that no term without a name reaches by what excludes a rival there (`least_followed`), waves apart
    that are finer than any term. Unit: 1. Of 12 such names on development machines, many with a known effect beside an
    unknown one, 8 were true [.39, .86], of 6 that were played after that 6; of 9 others 2."""
    large_residual: float = 0.12
    """Slow part of the residual, relative to the friction torque, above which something is missing, whatever it
    follows. Unit: 1. 96 nulls of three generators left at most .118."""
    large_residual_there: float = 0.3
    """The same on held-out recordings, to which no number was fitted."""
    large_residual_beside: float = 0.06
    """The same, in training or held out, beside what friction laws cannot agree on and a level that wanders, noise
    taken out. Unit: 1. 180 nulls of two generators left at most .032."""
    large_in_bursts: float = 0.16
    """Share of the energy of the residual that comes in bursts, above which something shakes the machine now and then.
    Unit: 1. 167 nulls of two generators have .052 at most, of 100 others two .10 and .12; ten machines on a trembling
    floor .21 to .81."""
    large_broadband: float = 0.05
    """Level of a random disturbance at any motion, relative to the friction, from which something shakes the machine
    all the time. Unit: 1. Friction repeats no better (Armstrong-Helouvry, Control of Machines with Friction, 1991); 60
    nulls of three worlds have .02 at most, twelve trembling floors .09 and more."""


POLICY = Policy()
