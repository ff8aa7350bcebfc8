"""The kinds of attack: which good file is spoilt how, and which command meets it."""

import signal
from collections.abc import Callable
from pathlib import Path
from random import Random

import attack_machines
import attack_recordings
import attack_services
from attack_mutations import NUMBERS, of_archive, of_bytes, of_json, of_member, of_text, of_xml
from attack_targets import TESTS, Target, Yard, bytes_of, recorded, same, spoke, told
from investigations import SCENARIO

from cosim.cli import main
from cosim.hardware.blackbox import HEADER, MAGIC, read_black_box, recording_of
from cosim.hardware.replay import replay

SERVED = 1.5
"""Seconds after which a command that serves until Ctrl-C gets it."""
Command = list[object]


def show(folder: Path, file: Path, dice: Random) -> Command:
    return ["show", file, "--json"]


def identify(yard: Yard) -> Callable[[Path, Path, Random], Command]:
    return lambda folder, file, dice: ["identify", file, "--card", yard.plain, "--out", folder / "out", "--starts", 1]


def run(*options: str) -> Callable[[Path, Path, Random], Command]:
    return lambda folder, file, dice: ["run", file, "--out", folder / "out", "--no-page", *options]


def run_fmu(yard: Yard) -> Callable[[Path, Path, Random], Command]:
    """Run the scenario with the spoilt FMU for the plant."""

    def command(folder: Path, file: Path, dice: Random) -> Command:
        text = yard.scenario.replace(str(yard.fmus[3]), str(file))
        (folder / "scenario.toml").write_text(text)
        return ["run", folder / "scenario.toml", "--out", folder / "out", "--no-page", "--call-timeout", 5]

    return command


def replayed(folder: Path, file: Path, dice: Random) -> Command:
    return ["hardware", "replay", file]


def on_machine(yard: Yard) -> Callable[[Path, Path, Random], Command]:
    start = ["hardware", "run", yard.folder / "session.toml", "--fast", "--out"]
    return lambda folder, file, dice: [*start, folder / "out", "--machine", file]


def black_box(folder: Path, file: Path, dice: Random) -> Callable[[], object]:
    """What `hardware run` does with a black box after a session that was killed."""
    from cosim.cli import guarded

    def read() -> None:
        kept = read_black_box(file)
        recording = recording_of(kept, "box")
        recording.write(folder / "out.parquet", True)
        print(len(recording), kept.torn, replay(recording).identical)

    return guarded(read, False)


def served(arguments: Command) -> Callable[[], object]:
    """A command that serves until Ctrl-C, which comes soon."""

    def command() -> None:
        signal.signal(signal.SIGALRM, lambda *_: signal.raise_signal(signal.SIGINT))
        signal.setitimer(signal.ITIMER_REAL, SERVED)
        try:
            main([str(one) for one in arguments])
        finally:
            signal.setitimer(signal.ITIMER_REAL, 0)

    return command


def numbers(yard: Yard) -> list[Command]:
    """Commands with a number, `<N>`, that is to be replaced."""
    out, session = "<OUT>", yard.folder / "session.toml"
    drive = ["hardware", "virtual-drive", "paper_mount"]
    identified = ["identify", yard.folder / "axis.csv", "--card", yard.plain, "--out", out]
    return [
        ["run", yard.folder / "scenario.toml", "--no-page", "--out", out, "--call-timeout", "<N>"],
        [*identified, "--starts", 1, "--cut", "<N>"],
        [*identified, "--starts", "<N>"],
        [*identified, "--starts", 1, "--seed", "<N>"],
        ["hardware", "check", session, "--seconds", "<N>"],
        [*drive, "--port", "<N>"],
        [*drive, "--port", 0, "--step", "<N>"],
        [*drive, "--port", 0, "--counts-per-turn", "<N>"],
        [*drive, "--port", 0, "--inject", "jump:<N>:1:1"],
        [*drive, "--port", 0, "--inject", "late:0:<N>:1"],
        [*drive, "--port", 0, "--inject", "late:0:1:<N>"],
        [*drive, "--host", "<N>"],
        ["hardware", "run", session, "--fast", "--out", out, "--drive", "udp://127.0.0.1:<N>"],
        ["show", yard.folder / "axis.csv", "--json", "--layout", "skip=<N>"],
        ["show", yard.folder / "axis.csv", "--json", "--units", "q=<N>"],
        ["paper", "--seeds", "<N>", "--out", out],
        ["prove", "--cases", "<N>", "--seconds", 1, "--out", out],
        ["prove", "--cases", 1, "--seconds", "<N>", "--out", out],
        ["sweep", yard.folder / "sweep.toml", "--workers", "<N>", "--out", out],
    ]


def numbered(yard: Yard) -> Callable[[Path, Path, Random], Callable[[], object]]:
    def command(folder: Path, file: Path, dice: Random) -> Callable[[], object]:
        number = file.read_text("utf-8", "surrogateescape").replace("\x00", "")
        row = [str(one).replace("<OUT>", str(folder / "out")) for one in dice.choice(numbers(yard))]
        return served([one.replace("<N>", number) for one in row])

    return command


def kinds(yard: Yard) -> list[Target]:
    """All of them; the shares are parts of a thousand."""
    files, folder = yard.recordings, TESTS / "samples"
    samples = [bytes_of(one) for one in sorted(folder.iterdir()) if one.is_file() and one.suffix != ".py"]
    for name, content in files.items():
        (yard.folder / name).write_bytes(content)
    text, packed = [("axis.csv", files["axis.csv"])], [(name, files[name]) for name in ("axis.csv.gz", "axis.mat")]
    table, sealed = [("axis.parquet", files["axis.parquet"])], [bytes_of(yard.session / "recording.parquet")]
    fmus, ssp = [bytes_of(one) for one in yard.fmus.values()], [yard.ssp()]
    scenario, card = [("scenario.toml", yard.scenario.encode())], [bytes_of(yard.card)]
    machines = [bytes_of(one) for one in sorted((TESTS.parent / "cosim/hardware/machines").glob("*.toml"))]
    machine = [(name, content) for name, content in machines if b"simulated" in content]
    sweep = [("sweep.toml", SWEEP.format(scenario=yard.folder / "scenario.toml").encode())]
    (yard.folder / "sweep.toml").write_bytes(sweep[0][1])
    xml, code = "modelDescription.xml", r"\.so$"
    return [
        Target("recording, text", 125, text, of_text, show, told),
        Target("recording, others' text", 90, samples, of_text, show, told),
        Target("recording, packed", 70, packed, of_bytes, show, told),
        Target("recording, Parquet", 70, table, of_bytes, show, told),
        Target("recording, numbers", 60, table, yard.of_cells, show, told),
        Target("recording, identified", 5, text, of_text, identify(yard), spoke),
        Target("origin", 60, sealed, yard.of_origin, show, told),
        Target("origin, replayed", 40, sealed, yard.of_origin, replayed, same),
        Target("session, replayed", 50, sealed, yard.of_cells, replayed, same),
        Target("session's bytes, replayed", 20, sealed, of_bytes, replayed, same),
        Target("black box", 50, [bytes_of(yard.session / "black_box.bin")], of_bytes, black_box, spoke),
        Target("black box's head", 20, [bytes_of(yard.session / "black_box.bin")], of_head, black_box, spoke),
        Target("card", 100, card, of_text, show, told),
        Target("scenario", 60, scenario, of_text, run("--no-isolate"), recorded),
        Target("scenario, shown", 40, scenario, of_text, show, told),
        Target("FMU, XML", 60, fmus, of_member(xml, of_xml), show, told),
        Target("FMU, archive", 50, fmus, of_archive, show, told),
        Target("FMU, XML, run", 20, fmus[1:], of_member(xml, of_xml), run_fmu(yard), recorded),
        Target("FMU, binary, run", 20, fmus[1:], of_member(code, of_bytes), run_fmu(yard), recorded),
        Target("SSP, XML", 40, ssp, of_member(r"\.ssd$", of_xml), show, told),
        Target("SSP, archive", 30, ssp, of_archive, show, told),
        Target("SSP, XML, run", 20, ssp, of_member(r"\.ssd$", of_xml), run(), recorded),
        Target("machine file", 40, machine, of_text, on_machine(yard), recorded),
        Target("sweep", 10, sweep, of_text, swept, spoke),
        Target("number on the command line", 50, [("number", b"1")], number, numbered(yard), spoke),
        *services(text),
        *machines_and_files(yard),
    ]


def services(text: list[tuple[str, bytes]]) -> list[Target]:
    """What answers over a network; spoilt are files that are dropped, and requests."""
    element, put = [("indi.xml", attack_services.ASKED)], [("alpaca.txt", attack_services.PUT)]
    request = [("request.txt", attack_services.request_of_page())]
    well = attack_services.served_well
    return [
        Target("page, requests", 150, text, of_text, attack_services.page, well),
        Target("page, bytes", 60, request, untouched, attack_services.page_bytes, well),
        Target("Alpaca", 120, put, untouched, attack_services.alpaca, well),
        Target("INDI", 80, element, untouched, attack_services.indi, well),
    ]


def machines_and_files(yard: Yard) -> list[Target]:
    """Investigations, FMUs that fail, binary recordings that are spoilt or were made to cost much."""
    begun, whole = attack_machines.investigated, attack_machines.failed_or_whole
    made = attack_recordings.crafted_kinds()
    return [
        Target(
            "investigation",
            110,
            [("scenario.txt", b"[]\n" + SCENARIO.encode())],
            attack_machines.investigation,
            begun,
            spoke,
        ),
        Target(
            "FMU, failing", 60, [("fmu.json", b"")], attack_machines.behaviour, attack_machines.behaving(yard), whole
        ),
        Target("recording, NumPy and JSON", 90, attack_recordings.arrays(), of_bytes, show, told),
        Target("recording, binary", 60, attack_recordings.binaries(), of_bytes, show, told),
        *(
            Target(f"crafted, {kind}", 6, [(f"run{suffix}", b"")], attack_recordings.crafted(kind), show, told)
            for kind, suffix in made.items()
        ),
    ]


def untouched(dice: Random, raw: bytes) -> tuple[str, bytes]:
    """Spoil nothing."""
    return "nothing", raw


SWEEP = """scenario = "{scenario}"
[vary]
"controller.k" = [4.0, 5.0]
[statistics]
end = {{ signal = "q", kind = "final" }}
"""


def swept(folder: Path, file: Path, dice: Random) -> Command:
    return ["sweep", file, "--workers", 1, "--out", folder / "out"]


def number(dice: Random, raw: bytes) -> tuple[str, bytes]:
    return "number", dice.choice(NUMBERS).encode()


def of_head(dice: Random, raw: bytes) -> tuple[str, bytes]:
    """Spoil the line of JSON in front of the records; it keeps its place."""
    end = raw.index(b"\n", len(MAGIC))
    how, text = of_json(dice, raw[len(MAGIC) : end])
    return how, (MAGIC + text + b"\n").ljust(HEADER, b"\n")[:HEADER] + raw[HEADER:]
