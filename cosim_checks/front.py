"""`cosim.check_effect`, `cosim.check_law`: a class of physics to the checks that it must pass."""

from cosim.support.errors import InputError
from cosim_checks.plant import example_of
from cosim_checks.suite import Checks
from pyfmi_models import plugins
from pyfmi_models.effects import Effect
from pyfmi_models.friction import FrictionLaw


def check_effect(effect: type[Effect] | Effect, hypothesis: type | None = None) -> Checks:
    """List the checks of an effect of your own, in the manner of scikit-learn's `check_estimator`::

        cosim.check_effect(WindLoad).run()                    # a table; CheckError where something fails

        @pytest.mark.parametrize(("name", "check"), cosim.check_effect(WindLoad))
        def test_wind_load(name, check):
            check()

    Words, units, finite equations, derivatives against differences, that it acts, that friction resists, bounds that a
    card refuses to cross, the FMU against the equations in Python, a fit that comes back to its numbers, a diagnosis
    that finds it in recordings whose card conceals it (where there is a hypothesis).

    Args:
        effect: a subclass of `pyfmi_models.effects.Effect`, or an object of one with numbers of your choice; for a
            class numbers from inside the bounds are taken.
        hypothesis: the class by which a diagnosis asks for the effect, where it is defined outside the packages too.

    Returns:
        `Checks`: pairs of name and callable; nothing has run yet. `run()` runs all, `frame()` gives their table.

    Raises:
        InputError: what is given is no effect, or numbers cannot be guessed for it.
        PluginError: its id is that of an effect of this package.
    """
    _check_kind(effect, Effect, "id", "effect")
    from cosim_checks.effect import checks_of

    made: Effect = example_of(effect)
    plugins.register(type(made))
    if hypothesis is not None:
        import cosim.diagnosis.effects  # noqa: F401  # it follows what is registered

        plugins.register(hypothesis)
    return checks_of(made)


def check_law(law: type[FrictionLaw] | FrictionLaw) -> Checks:
    """List the checks of a friction law of your own, in the manner of scikit-learn's `check_estimator`::

        cosim.check_law(HerschelBulkley).run()

    Words, units, odd in the speed, finite equations, derivatives against differences, passivity, steady sliding, the
    closed form `advance`, bounds that a card refuses to cross, the FMU against the equations in Python, a fit that
    comes back to its numbers.

    Args:
        law: a subclass of `pyfmi_models.friction.FrictionLaw`, or an object of one with numbers of your choice.

    Returns:
        `Checks`, as `check_effect`.

    Raises:
        InputError: what is given is no law, or numbers cannot be guessed for it.
        PluginError: its key is that of a law of this package.
    """
    _check_kind(law, FrictionLaw, "key", "friction law")
    from cosim_checks.law import checks_of

    made: FrictionLaw = example_of(law)
    plugins.register(type(made))
    return checks_of(made)


def _check_kind(given: object, base: type, word: str, called: str) -> None:
    """Refuse what is no law or effect (raises InputError)."""
    kind = given if isinstance(given, type) else type(given)
    if not issubclass(kind, base):
        text = f"{given!r} is no {called}; give a class derived from {base.__module__}.{base.__name__}."
        raise InputError(text, culprit=str(given))
    if not hasattr(kind, word):
        text = f'{kind.__name__} has no {word}; write {word}: ClassVar[str] = "..." in it, the word used in a card.'
        raise InputError(text, culprit=kind.__name__)
