"""What was found of an object is kept as long as the object lives, and no longer."""

from collections.abc import Callable
from functools import wraps
from typing import Any, Concatenate, ParamSpec, TypeVar
from weakref import WeakKeyDictionary

K = TypeVar("K")
P = ParamSpec("P")
R = TypeVar("R")


def kept_with(most: int = 1) -> Callable[[Callable[Concatenate[K, P], R]], Callable[Concatenate[K, P], R]]:
    """Keep what a function returns for its first argument, and for the last `most` further ones, until that is gone.

    An `lru_cache` would hold recordings of a diagnosis that has ended.
    """

    def decorate(find: Callable[Concatenate[K, P], R]) -> Callable[Concatenate[K, P], R]:
        known: WeakKeyDictionary[K, dict[Any, R]] = WeakKeyDictionary()

        @wraps(find)
        def remembered(of: K, /, *more: P.args, **named: P.kwargs) -> R:
            own, asked = known.setdefault(of, {}), (more, tuple(sorted(named.items())))
            own[asked] = own.pop(asked) if asked in own else find(of, *more, **named)
            for old in list(own)[:-most]:
                del own[old]
            return own[asked]

        return remembered

    return decorate
