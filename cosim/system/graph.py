"""What depends on each other in a ring, and in which order the rings follow each other."""

from collections.abc import Collection, Hashable, Iterator, Mapping
from typing import TypeVar

T = TypeVar("T", bound=Hashable)


def rings(before: Mapping[T, Collection[T]]) -> list[list[T]]:
    """Return the strongly connected components of a graph, each after those that it depends on.

    Args:
        before: of each node, those that it depends on, each a key itself.

    Reference: R. Tarjan, SIAM J. Comput. 1 (1972) 146; without recursion, because a chain may be long.
    """
    index: dict[T, int] = {}
    low: dict[T, int] = {}
    stack: list[T] = []
    place: dict[T, int] = {}
    done: set[T] = set()
    found: list[list[T]] = []
    for root in before:
        path: list[tuple[T, Iterator[T]]] = []
        following: T | None = root if root not in index else None
        while path or following is not None:
            if following is not None:
                index[following] = low[following] = len(index)
                place[following] = len(stack)
                stack.append(following)
                path.append((following, iter(before[following])))
            node, rest = path[-1]
            following = None
            for one in rest:
                if one not in index:
                    following = one
                    break
                if one not in done:
                    low[node] = min(low[node], index[one])
            if following is not None:
                continue
            path.pop()
            if path:
                low[path[-1][0]] = min(low[path[-1][0]], low[node])
            if low[node] == index[node]:
                found.append(stack[place[node] :][::-1])
                done.update(found[-1])
                del stack[place[node] :]
    return found
