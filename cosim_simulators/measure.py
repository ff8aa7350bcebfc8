"""What a simulator cannot hold of a card, as a torque along a motion.

    missing(part) = RMS of T(card) - T(card with the part as the simulator has it)

with T the torque that a motion needs, low-passed at 30 Hz as in a diagnosis. The whole is measured the same way, with
every part as the simulator has it; where the torque was recorded, the errors of both against it stand beside.
"""

from dataclasses import dataclass, replace

from cosim.estimation.prepare import Array
from cosim.support.plain import JsonObject
from cosim.support.statistics import rms
from cosim_simulators.format import Format, Written
from cosim_simulators.friction import HeldFriction, held_friction, torque, without_friction_effects
from cosim_simulators.motion import Compared
from pyfmi_models.effects import Effect, FrictionEffect, TorqueOffset
from pyfmi_models.mount import Mount


@dataclass(frozen=True)
class Row:
    """A part of a card: where a simulator's file has it ("" nowhere), the RMS torque that is lost [N m; N], and a note.

    `lost` is None where no torque along a motion tells it.
    """

    part: str
    where: str
    lost: float | None
    note: str = ""


@dataclass(frozen=True)
class Held:
    """A card in a simulator: the mount that it holds, what each part loses, and all of them together."""

    format: Format
    mount: Mount
    unit: str
    motion: str
    rows: tuple[Row, ...]
    lost: float
    needed: float
    """RMS of the card's torque along the motion."""
    card_error: float | None = None
    held_error: float | None = None
    """RMS error against the recorded torque, of the card (the FMU's equations) and of what is held."""

    @property
    def ratio(self) -> float | None:
        """Error on the recording, as a multiple of the card's."""
        if not self.card_error or self.held_error is None:
            return None
        return self.held_error / self.card_error

    def __str__(self) -> str:
        """The table of what is held and what is lost, RMS along the motion."""
        cells = [("part", "in the file as", f"lost [{self.unit}]", ""), *(_cells(row) for row in self.rows)]
        cells.append(
            ("all together", "", f"{self.lost:.3g}", f"of {self.needed:.3g} {self.unit} that the motion needs")
        )
        widths = [max(len(row[k]) for row in cells) for k in range(3)]
        lines = [f"{a:<{widths[0]}}  {b:<{widths[1]}}  {c:>{widths[2]}}  {d}".rstrip() for a, b, c, d in cells]
        return "\n".join([f"{self.format.title}, RMS along {self.motion}", *lines, *_errors(self)])

    def as_json(self) -> JsonObject:
        """Return everything as plain data."""
        return {
            "simulator": self.format.key,
            "motion": self.motion,
            "unit": self.unit,
            "parts": [{"part": r.part, "where": r.where, "lost": r.lost, "note": r.note} for r in self.rows],
            "lost": self.lost,
            "needed": self.needed,
            "card_error": self.card_error,
            "held_error": self.held_error,
            "ratio": self.ratio,
        }


def _cells(row: Row) -> tuple[str, str, str, str]:
    lost = "?" if row.lost is None else "0" if row.lost == 0 else f"{row.lost:.3g}"
    return row.part, row.where or "not held", lost, row.note


def _errors(held: Held) -> list[str]:
    if held.card_error is None or held.held_error is None or held.ratio is None:
        return []
    card, file = f"{held.card_error:.3g}", f"{held.held_error:.3g} {held.unit}"
    return [f"RMS error on the recording: FMU {card}, this file {file} ({held.ratio - 1:+.1%})"]


def hold(mount: Mount, form: Format, compared: Compared) -> Held:
    """Reduce a mount to what a simulator holds, and measure what is lost along a motion."""
    if form.whole:
        return _whole(mount, form, compared)
    pieces = compared.prepared.pieces
    told = replace(mount, effects=tuple(one for one in mount.effects if one.is_determined))
    written = {name: _written(form, one, told) for name, one in told.of_kind(Effect)}
    friction = held_friction(told, form.bristle, TorqueOffset in form.effects, pieces)
    kept = tuple(one.effect for one in written.values() if one)
    held = replace(told, friction=friction.law, effects=(*kept, *friction.beside))
    needed, has = torque(told, pieces), torque(held, pieces)
    rows = (
        Row("inertia", "inertia", 0.0),
        _limit_row(form, mount),
        _friction_row(form, told, friction, needed, compared),
        *_effect_rows(told, written, needed, compared),
        *(Row(one.id, "", None, "by chance or with a memory: no torque to compare") for one in _untold(mount)),
    )
    found = Held(form, held, _unit(mount), compared.name, rows, rms(needed - has), rms(needed))
    return _with_errors(found, compared, needed, has)


def _whole(mount: Mount, form: Format, compared: Compared) -> Held:
    """What has the equations of the FMU: nothing is lost."""
    told = replace(mount, effects=tuple(one for one in mount.effects if one.is_determined))
    needed = torque(told, compared.prepared.pieces)
    parts = [
        "inertia",
        "torque limit",
        f"friction ({mount.friction.key})",
        *(name for name, _ in mount.of_kind(Effect)),
    ]
    rows = tuple(Row(part, "equations of the FMU", 0.0) for part in parts)
    found = Held(form, mount, _unit(mount), compared.name, rows, 0.0, rms(needed))
    return _with_errors(found, compared, needed, needed)


def _unit(mount: Mount) -> str:
    return "N m" if mount.motion == "rotary" else "N"


def _with_errors(held: Held, compared: Compared, needed: Array, has: Array) -> Held:
    if not compared.measured:
        return held
    tau = compared.prepared.stacked("tau")
    return replace(held, card_error=rms(tau - needed), held_error=rms(tau - has))


def _written(form: Format, effect: Effect, mount: Mount) -> Written | None:
    holding = form.effects.get(type(effect))
    return holding(effect, mount) if holding else None


def _untold(mount: Mount) -> list[Effect]:
    return [one for one in mount.effects if not one.is_determined]


def _limit_row(form: Format, mount: Mount) -> Row:
    limit = float(mount.axis.torque_limit)
    return Row("torque limit", form.limit, 0.0 if form.limit else None, f"acts above {limit:g}")


def _friction_row(form: Format, mount: Mount, held: HeldFriction, needed: Array, compared: Compared) -> Row:
    effects = [one.id for one in mount.effects if isinstance(one, FrictionEffect)]
    name = ", ".join([f"friction ({mount.friction.key})", *effects])
    if mount.friction.key == "none" and not effects:
        return Row(name, "none", 0.0)
    where = form.friction[held.law.key]
    if held.exact:
        return Row(name, where, 0.0)
    plain = without_friction_effects(mount)
    other = replace(plain, friction=held.law, effects=(*plain.effects, *held.beside))
    lost = rms(needed - torque(other, compared.prepared.pieces))
    return Row(
        name, where, lost, f"nearest {held.law.key} law{' and a constant' if held.beside else ''} along the motion"
    )


def _effect_rows(
    mount: Mount, written: dict[str, Written | None], needed: Array, compared: Compared
) -> tuple[Row, ...]:
    rows = []
    for name, effect in mount.of_kind(Effect):
        if isinstance(effect, FrictionEffect):
            continue
        found = written[name]
        if found and found.effect == effect:
            rows.append(Row(name, found.where, 0.0, f"without {found.lost}" if found.lost else ""))
            continue
        instead = (found.effect,) if found else ()
        parts = [instead if one is effect else (one,) for one in mount.effects]
        other = replace(mount, effects=tuple(one for part in parts for one in part))
        lost = rms(needed - torque(other, compared.prepared.pieces))
        rows.append(Row(name, found.where if found else "", lost, _note(effect, found, compared)))
    return tuple(rows)


def _note(effect: Effect, found: Written | None, compared: Compared) -> str:
    """Say in words what is lost of an effect."""
    if found:
        return f"without {found.lost}"
    recorded = compared.prepared.pieces[0].extras
    unknown = [one.name for one in effect.inputs() if one.name not in recorded]
    return f"acts by {', '.join(unknown)}, which this motion does not have" if unknown else ""
