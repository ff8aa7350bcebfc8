"""What a form on the page can ask for: each takes the desk, a job and the form, and returns where to go."""

from collections.abc import Callable, Mapping

from cosim.support.errors import InputError
from cosim_serve.desk import Desk
from cosim_serve.form import card_of

Form = Mapping[str, str]
Action = Callable[[Desk, str, Form], str]


def correct(desk: Desk, name: str, form: Form) -> str:
    """Read a recording as the form says."""
    desk.correct(name, form.get("file", ""), form)
    return f"/jobs/{name}"


def role(desk: Desk, name: str, form: Form) -> str:
    """Use a recording for what the form says."""
    desk.set_role(name, form.get("file", ""), form.get("role", ""))
    return f"/jobs/{name}"


def accept(desk: Desk, name: str, form: Form) -> str:
    """Take the example that answers the question of a recording."""
    desk.accept(name, form.get("file", ""))
    return f"/jobs/{name}"


def drop(desk: Desk, name: str, form: Form) -> str:
    """Remove a recording."""
    desk.drop(name, form.get("file", ""))
    return f"/jobs/{name}"


def card(desk: Desk, name: str, form: Form) -> str:
    """Take the text of a card, or a shipped one."""
    if form.get("shipped"):
        desk.give_shipped(name, form["shipped"])
    else:
        desk.give_card(name, form.get("text", ""), desk.store.get(name).card or "card.toml")
    return f"/jobs/{name}"


def estimate(desk: Desk, name: str, form: Form) -> str:
    """Take a card that is estimated from the recordings (InputError: they do not tell it)."""
    desk.estimate_card(name)
    return f"/jobs/{name}"


def write(desk: Desk, name: str, form: Form) -> str:
    """Write a card from the fields of a form (InputError: a field is wrong, or the card is)."""
    desk.give_card(name, card_of(form), desk.store.get(name).card or "card.toml")
    if problem := desk.card_view(desk.store.get(name))["problem"]:
        raise InputError(problem)
    return f"/jobs/{name}"


def start(desk: Desk, name: str, form: Form) -> str:
    """Diagnose (InputError: something is missing)."""
    desk.start(name)
    return f"/jobs/{name}"


def cancel(desk: Desk, name: str, form: Form) -> str:
    """Take a diagnosis out of the queue, or end it."""
    desk.queue.cancel(name)
    return f"/jobs/{name}"


def again(desk: Desk, name: str, form: Form) -> str:
    """Change a job and try again; one that is done is kept, and copied."""
    return f"/jobs/{desk.again(name).id}"


def remove(desk: Desk, name: str, form: Form) -> str:
    """Remove a job with its files."""
    desk.remove(name)
    return "/"


LOOKING = ("correct", "accept", "card", "estimate", "write")
"""Actions that look at files, which takes long."""
ACTIONS: dict[str, Action] = {
    one.__name__: one for one in (correct, role, accept, drop, card, estimate, write, start, cancel, again, remove)
}
