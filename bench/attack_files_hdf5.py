"""HDF5 files that cost more than they hold, or lead to other files; each maker says in a sentence what it does."""

import os
import zlib
from collections.abc import Callable
from pathlib import Path
from random import Random
from typing import Any

import h5py
import numpy as np

Maker = Callable[[Random, Path], None]
ROWS = 400


def deflated_zeros(times: int) -> bytes:
    """Return so many times 4 MiB of zeros, deflated without deflating each: what repeats does so in its bits too."""
    packer = zlib.compressobj(9)
    first = packer.compress(bytes(1 << 22)) + packer.flush(zlib.Z_FULL_FLUSH)
    again = packer.compress(bytes(1 << 22)) + packer.flush(zlib.Z_FULL_FLUSH)
    return first + again * (times - 1) + b"\x03\x00" + bytes(4)


def _with_axis(file: Any, but: str = "") -> None:
    """Add an axis that would be read, so that the rest decides."""
    t = np.arange(ROWS) * 1e-2
    for name, values in {"t": t, "tau": np.cos(t), "q": np.sin(t)}.items():
        if name != but:
            file[name] = values


def storage_elsewhere(dice: Random, path: Path) -> None:
    """External storage."""
    target = dice.choice([str(path.parent / "secret.bin"), "secret.bin", "/etc/passwd", "/proc/self/environ"])
    with h5py.File(path, "w") as file:
        _with_axis(file, "q")
        kind, size = dice.choice([("u1", 1), ("i4", 4), ("f8", 8)])
        file.create_dataset("q", (ROWS,), kind, external=[(target, 0, size * ROWS)])


def fifo_elsewhere(dice: Random, path: Path) -> None:
    """External storage in a pipe that nobody writes to."""
    pipe = path.parent / "pipe"
    if not pipe.exists():
        os.mkfifo(pipe)
    with h5py.File(path, "w") as file:
        _with_axis(file, "q")
        file.create_dataset("q", (ROWS,), "f8", external=[(str(pipe), 0, 8 * ROWS)])


def device_elsewhere(dice: Random, path: Path) -> None:
    """External storage in a device."""
    with h5py.File(path, "w") as file:
        _with_axis(file, "q")
        device = dice.choice(["/dev/zero", "/dev/urandom", "/dev/stdin", "/dev/tty"])
        file.create_dataset("q", (ROWS,), "f8", external=[(device, 0, 8 * ROWS)])


def virtual_elsewhere(dice: Random, path: Path) -> None:
    """A virtual dataset of another file."""
    with h5py.File(path.parent / "other.h5", "w") as other:
        other["q"] = np.arange(ROWS) * 1.0
    layout = h5py.VirtualLayout((ROWS,), "f8")
    layout[:] = h5py.VirtualSource(dice.choice(["other.h5", str(path.parent / "other.h5")]), "q", (ROWS,))
    with h5py.File(path, "w") as file:
        _with_axis(file, "q")
        file.create_virtual_dataset("q", layout, fillvalue=0)


def link_elsewhere(dice: Random, path: Path) -> None:
    """An external link."""
    with h5py.File(path.parent / "other.h5", "w") as other:
        other["q"] = np.arange(ROWS) * 1.0
    with h5py.File(path, "w") as file:
        _with_axis(file, "q")
        where = dice.choice(["q", "run/q", "a/b/c/q"])
        file[where] = h5py.ExternalLink(dice.choice(["other.h5", str(path.parent / "other.h5"), "/dev/zero"]), "/q")


def soft_link_elsewhere(dice: Random, path: Path) -> None:
    """A soft link through an external one."""
    with h5py.File(path.parent / "other.h5", "w") as other:
        other["q"] = np.arange(ROWS) * 1.0
    with h5py.File(path, "w") as file:
        _with_axis(file, "q")
        file["raw"] = h5py.ExternalLink("other.h5", "/")
        file["q"] = h5py.SoftLink("/raw/q")


def virtual_of_itself(dice: Random, path: Path) -> None:
    """A virtual dataset of itself."""
    with h5py.File(path, "w") as file:
        _with_axis(file, "q")
        layout = h5py.VirtualLayout((ROWS,), "f8")
        layout[:] = h5py.VirtualSource(".", "q", (ROWS,))
        file.create_virtual_dataset("q", layout, fillvalue=0)


def unwritten(dice: Random, path: Path) -> None:
    """Numbers of which no chunk was written."""
    rows = dice.choice([8_300_000, 80_000_000, 10**12, 2**62])
    with h5py.File(path, "w") as file:
        for name in ("t", "tau", "q"):
            file.create_dataset(name, (rows,), "f8", chunks=(1 << dice.randint(10, 20),), compression="gzip")


def unwritten_small_chunks(dice: Random, path: Path) -> None:
    """Millions of chunks of one number, none written."""
    with h5py.File(path, "w") as file:
        for name in ("t", "tau", "q"):
            file.create_dataset(name, (dice.randint(1, 8) * 10**6,), "f8", chunks=(1,), maxshape=(None,))


def large_chunk(dice: Random, path: Path) -> None:
    """A chunk of gigabytes for a few numbers."""
    with h5py.File(path, "w") as file:
        _with_axis(file, "q")
        cells = dice.choice([2**26, 2**28, 2**29 - 1])
        file.create_dataset("q", (ROWS,), "f8", chunks=(cells,), maxshape=(None,), compression="gzip")
        file["q"].id.write_direct_chunk((0,), zlib.compress(bytes(1 << 20), 9) * dice.randint(1, 4))


def chunk_bomb(dice: Random, path: Path) -> None:
    """A chunk of some kB that unpacks to gigabytes."""
    with h5py.File(path, "w") as file:
        _with_axis(file, "q")
        file.create_dataset("q", (ROWS,), "f8", chunks=(ROWS,), compression="gzip", shuffle=dice.random() < 0.5)
        file["q"].id.write_direct_chunk((0,), deflated_zeros(dice.choice([256, 1024])))


def chunk_bomb_lzf(dice: Random, path: Path) -> None:
    """A chunk that LZF unpacks to gigabytes."""
    with h5py.File(path, "w") as file:
        _with_axis(file, "q")
        file.create_dataset("q", (ROWS,), "f8", chunks=(ROWS,), compression="lzf")
        file["q"].id.write_direct_chunk((0,), b"\x00\x00" + b"\xe0\xff\x00" * dice.choice([1, 4]) * 10**6)


def packed_twice(dice: Random, path: Path) -> None:
    """A bomb in a bomb: a chunk that is packed twice."""
    plan = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
    plan.set_chunk((ROWS,))
    plan.set_deflate(9)
    plan.set_deflate(9)
    with h5py.File(path, "w") as file:
        _with_axis(file, "q")
        kind, space = h5py.h5t.IEEE_F64LE, h5py.h5s.create_simple((ROWS,))
        made = h5py.h5d.create(file.id, b"q", kind, space, plan)
        made.write_direct_chunk((0,), zlib.compress(deflated_zeros(64), 9))


def many_groups(dice: Random, path: Path) -> None:
    """Groups by the hundred thousand beside each other."""
    with h5py.File(path, "w", libver="latest") as file:
        _with_axis(file)
        for number in range(dice.choice([20_000, 100_000])):
            file.create_group(f"g{number}")


def many_datasets(dice: Random, path: Path) -> None:
    """Datasets by the ten thousand."""
    with h5py.File(path, "w", libver="latest") as file:
        for number in range(dice.choice([9_900, 30_000])):
            file.create_dataset(f"x{number}", data=np.zeros(2))


def deep_groups(dice: Random, path: Path) -> None:
    """Groups within each other by the ten thousand."""
    with h5py.File(path, "w", libver="latest") as file:
        _with_axis(file)
        group = file
        for _ in range(dice.choice([101, 5_000, 50_000])):
            group = group.create_group("g")


def circles(dice: Random, path: Path) -> None:
    """Groups that hold each other."""
    with h5py.File(path, "w") as file:
        _with_axis(file)
        groups = [file.create_group(f"g{number}") for number in range(30)]
        for one in groups:
            for other in groups:
                one[f"to {other.name[1:]}"] = other


def large_attribute(dice: Random, path: Path) -> None:
    """A unit of megabytes, many times over."""
    with h5py.File(path, "w", libver="latest") as file:
        _with_axis(file)
        for name in ("t", "tau", "q"):
            file[name].attrs["unit"] = dice.choice(
                [np.zeros(2_000_000), "m" * 5_000_000, [f"{k}" for k in range(10**5)]]
            )


def compound(dice: Random, path: Path) -> None:
    """Rows of a thousand fields, unwritten."""
    with h5py.File(path, "w") as file:
        _with_axis(file)
        kind = np.dtype([(f"f{number}", "f8") for number in range(dice.choice([100, 1000]))])
        file.create_dataset("table", (10**7,), kind, chunks=(100,), compression="gzip")


def arrays_in_cells(dice: Random, path: Path) -> None:
    """A dataset whose cells are arrays of a million numbers."""
    with h5py.File(path, "w") as file:
        _with_axis(file, "q")
        file.create_dataset("q", (ROWS,), np.dtype(("f8", (10**6,))), chunks=(1,), compression="gzip")


def lengths_that_vary(dice: Random, path: Path) -> None:
    """Cells of varying length that all are the same ten million numbers."""
    with h5py.File(path, "w") as file:
        _with_axis(file)
        made = file.create_dataset("v", (ROWS,), h5py.vlen_dtype(np.dtype("f8")))
        made[0] = np.zeros(1_000_000)


def plain(dice: Random, path: Path) -> None:
    """Nothing wrong."""
    with h5py.File(path, "w") as file:
        _with_axis(file)
        for name in ("t", "tau", "q"):
            file[name].attrs["unit"] = {"t": "s", "tau": "N.m", "q": "rad"}[name]


MAKERS = (
    storage_elsewhere, fifo_elsewhere, device_elsewhere, virtual_elsewhere, link_elsewhere, soft_link_elsewhere,
    virtual_of_itself, unwritten, unwritten_small_chunks, large_chunk, chunk_bomb, chunk_bomb_lzf, packed_twice,
    many_groups, many_datasets, deep_groups, circles, large_attribute, compound, arrays_in_cells, lengths_that_vary,
    plain,
)  # fmt: skip
KINDS = {"hdf5": (".h5", MAKERS)}
