"""Which time belongs to which channel, where a file holds several vectors of time.

In this order: the time in the channel's own group (`torque/time` of `torque/value`, `tau.time` of `tau`), the one that
is named after it (`t_tau` of `tau`, `time_torque` of `torque`), and the only one of its length. Where none of these
tells one, a channel has no time.
"""

import re
from collections.abc import Iterable, Mapping, Sequence

from cosim.data.roles import is_named
from cosim.data.text.names import SECONDS, words_of

GROUPS = re.compile(r"(.*)[./]([^./]+)")
"""A name behind that of its group."""


def owners(channels: Iterable[str], times: Sequence[str], lengths: Mapping[str, int]) -> dict[str, str]:
    """Return which of the vectors of time belongs to each channel; one that has none is missing.

    Args:
        channels: names of channels.
        times: names of vectors of time.
        lengths: how long each is.
    """
    groups = {time: grouped(time)[0] for time in times}
    named = {time: _named_after(time) for time in times}
    owned: dict[str, str] = {}
    for name in channels:
        group, words = grouped(name)[0], set(words_of(name))
        fitting = [time for time in times if lengths[time] == lengths[name]]
        ways = (
            [time for time in fitting if groups[time] and groups[time] in (group, name)],
            [time for time in fitting if named[time] and named[time] <= words],
            fitting,
        )
        owner = next((way[0] for way in ways if len(way) == 1), None)
        owned |= {name: owner} if owner else {}
    return owned


def grouped(name: str) -> tuple[str, str]:
    """Return the group of a channel, empty where it has none, and its name in it."""
    found = GROUPS.fullmatch(name)
    return (found[1], found[2]) if found else ("", name)


def _named_after(time: str) -> set[str]:
    """Return the words in the name of a time that are none of a time: those of its channel."""
    words = words_of(grouped(time)[1])
    return {word for word in words if word not in SECONDS and not is_named(word, "time")}
