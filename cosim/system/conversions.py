"""What a wire may carry: a value arrives as it is, or the wire is refused in a sentence before anything runs."""

from collections.abc import Iterable, Mapping, Sequence

from cosim.fmi.component import Port
from cosim.fmi.types import FLOATS, OPAQUE, WIDE, article, castable, refusal
from cosim.support.errors import WiringError
from cosim.system.wire import Record, Wire

_TRUTH = {"true": 1.0, "false": 0.0}


def check_wire(wire: Wire, source: Port | None, target: Port | None) -> None:
    """Refuse a wire whose target does not hold what its source may give; `source` is None for a signal.

    Raises:
        WiringError: names the wire, both types, and what would do.
    """
    assert target is not None  # the wiring knows its inputs
    kind = source.type if source else "Float64"
    if target.type in OPAQUE or kind in OPAQUE:
        _check_opaque(wire, source, target)
    elif wire.table:
        _check_table(wire, source, target)
    elif wire.cast and castable(kind, target.type):
        return
    elif source is not None and (reason := refusal(kind, target.type, (source.items, target.items))):
        raise _error(wire, source, target, reason)


def check_record(column: str, record: Record, port: Port | None) -> None:
    """Refuse the mean of what is no number.

    Raises:
        WiringError: names the column.
    """
    if record.mode == "mean" and port is not None and (port.type in OPAQUE or port.items):
        what = f'"{record.signal}", which is {article(port.type)}'
        raise WiringError(f'The column "{column}" shall be the mean of {what}; sample it.', culprit=column)


def check_fault(name: str, port: Port | None) -> None:
    """Refuse a fault on what is no number.

    Raises:
        WiringError: names the input.
    """
    if port is not None and port.type in OPAQUE:
        message = f'A fault is on "{name}", which is {article(port.type)}; faults act on numbers.'
        raise WiringError(message, culprit=name)


def check_smooth(wires: Iterable[Wire], ports: Mapping[str, Mapping[str, Port]]) -> None:
    """Refuse wires of other than reals between components that are taken over a tick together.

    Raises:
        WiringError: names the wire.
    """
    for wire in wires:
        for name in (wire.source, wire.target):
            port = ports[name.owner].get(name.port)
            if port is not None and port.type not in FLOATS:
                rule = "values that components agree on within a tick must be real numbers"
                message = f'The wire from "{wire.source}" to "{wire.target}" carries {article(port.type)}; {rule}.'
                raise WiringError(message, culprit=wire.target, value=port.type)


def table_of(wire: Wire, source: Port | None, target: Port) -> tuple[tuple[float, float], ...]:
    """Return the pairs of a wire's table as numbers: names of items become their values.

    Raises:
        WiringError: an entry is none of the source's or the target's.
    """
    items = source.items if source else {}
    return tuple(
        (_value(wire, key, items, wire.source), _value(wire, value, target.items, wire.target))
        for key, value in wire.table.items()
    )


def exact(
    wires: Sequence[Wire], records: Mapping[str, Record], ports: Mapping[str, Port], spoilt: set[str]
) -> set[str]:
    """Name the integers of 64 bits that go from end to end untouched, and so stay exact beyond 2^53.

    Args:
        wires: all of them.
        records: all of them.
        ports: the variables of components by full name.
        spoilt: inputs whose wires do more than carry.
    """
    wide = {name for name, port in ports.items() if port.type in WIDE}
    bad = {record.signal for record in records.values() if record.mode == "mean"} & wide
    joined = [(wire.source, wire.target) for wire in wires]
    kept = {wire.target for wire in wires if wire.straight and not wire.cast and wire.target not in spoilt}
    for source, target in joined:
        same = source in wide and target in wide and ports[source].type == ports[target].type
        if not same or target not in kept:
            bad |= {source, target} & wide
    while True:
        spread = {one for pair in joined if bad & set(pair) for one in pair} & wide
        if spread <= bad:
            return wide - bad
        bad |= spread


def _check_opaque(wire: Wire, source: Port | None, target: Port) -> None:
    if source is None:
        rule = f"is {article(target.type)}, and the signal is a number"
        raise WiringError(f'"{wire.target}" {rule} ("{wire.source}").', culprit=wire.target)
    if source.type != target.type:
        raise _error(wire, source, target, refusal(source.type, target.type))
    if not wire.straight or wire.cast:
        raise _error(wire, source, target, f"{article(target.type)} is carried as it is: no gain, map or noise")


def _check_table(wire: Wire, source: Port | None, target: Port) -> None:
    pairs = dict(table_of(wire, source, target))
    if target.items and source is not None and source.items:
        for value, name in source.items.items():
            if pairs.get(float(value), float(value)) not in target.items:
                raise _error(wire, source, target, f"its map leaves {value} ({name}), which the target does not know")


def _value(wire: Wire, said: float | bool | str, items: Mapping[int, str], name: str) -> float:
    named = {text: float(number) for number, text in items.items()} | _TRUTH
    if isinstance(said, str) and said in named:
        return named[said]
    try:
        return float(said)
    except ValueError as error:
        choices = tuple(items.values())
        message = f'The map of the wire to "{wire.target}" names "{said}", which "{name}" does not have'
        listed = f"; there are: {', '.join(choices)}" if choices else "; write a number"
        raise WiringError(f"{message}{listed}.", culprit=wire.target, value=said, choices=choices) from error


def _error(wire: Wire, source: Port, target: Port, reason: str) -> WiringError:
    ends = f'"{wire.target}" ({target.type}) cannot be fed by "{wire.source}" ({source.type})'
    return WiringError(f"{ends}: {reason}.", culprit=wire.target, value=source.type)
