"""Tables that cost more than they hold: Parquet, MAT 5, MDF 4, NumPy, JSON, packed text; a maker says what it does."""

import gzip
import io
import json
import struct
import zipfile
import zlib
from collections.abc import Callable
from pathlib import Path
from random import Random

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

Maker = Callable[[Random, Path], None]
ROWS = 400
T = np.arange(ROWS) * 1e-2
AXIS = {"t": T, "tau": np.cos(T), "q": np.sin(T)}


def texts_of_megabytes(dice: Random, path: Path) -> None:
    """One text of ten megabytes in each row."""
    text = "x" * dice.choice([10**6, 10**7])
    pq.write_table(pa.table(AXIS | {"s": [text] * ROWS}), path, compression="zstd", use_dictionary=True)


def repeats(dice: Random, path: Path) -> None:
    """Two hundred million rows of one value."""
    column = pa.DictionaryArray.from_arrays(pa.array(np.zeros(10**6, np.int32)), pa.array([0.5]))
    table = pa.table({name: column for name in AXIS})
    with pq.ParquetWriter(path, table.schema, compression="zstd") as writer:
        for _ in range(dice.choice([30, 200])):
            writer.write_table(table)


def list_without_end(dice: Random, path: Path) -> None:
    """One list of fifty million numbers in a row."""
    count = dice.choice([10**7, 5 * 10**7])
    lists = pa.ListArray.from_arrays(pa.array([0, count, *[count] * (ROWS - 1)], pa.int32()), pa.array(np.zeros(count)))
    pq.write_table(
        pa.table({name: pa.array(one) for name, one in AXIS.items()} | {"l": lists}), path, compression="zstd"
    )


def lists_of_texts(dice: Random, path: Path) -> None:
    """Lists of a long text, in each row a hundred."""
    text = "x" * 10**6
    kind = pa.list_(pa.string(), 10) if dice.random() < 0.5 else pa.list_(pa.string())
    column = pa.array([[text] * 10] * 20, kind)
    pq.write_table(pa.table({name: one[:20] for name, one in AXIS.items()} | {"l": column}), path, compression="zstd")


def wide_bytes(dice: Random, path: Path) -> None:
    """Cells of a megabyte of fixed length."""
    column = pa.array([bytes(10**6)] * ROWS, pa.binary(10**6))
    pq.write_table(pa.table(AXIS | {"b": column}), path, compression="zstd")


def many_columns(dice: Random, path: Path) -> None:
    """Twelve thousand columns."""
    pq.write_table(pa.table({f"c{k}": [0.0] for k in range(12_000)}), path)


def large_metadata(dice: Random, path: Path) -> None:
    """An origin of twenty megabytes."""
    text = json.dumps({"a": "x" * 2 * 10**7}) if dice.random() < 0.5 else "[" * 10**7
    pq.write_table(pa.table(AXIS).replace_schema_metadata({"cosim": text}), path)


def _mat(path: Path, elements: bytes, times: int) -> None:
    """Write a MAT 5 file of one packed variable `c`, a cell of so many equal elements."""
    name = struct.pack("<HH4s", 1, 1, b"c")
    head = struct.pack("<IIII", 6, 8, 1, 0) + struct.pack("<IIii", 5, 8, times, 1) + name
    size = len(head) + times * len(elements)
    packer = zlib.compressobj(9)
    body = [packer.compress(struct.pack("<II", 14, size) + head)]
    body += [packer.compress(elements * min(1000, times)) for _ in range(max(1, times // 1000))]
    packed = b"".join(body) + packer.flush()
    path.write_bytes(b"MATLAB 5.0 MAT-file".ljust(124) + b"\x00\x01IM" + struct.pack("<II", 15, len(packed)) + packed)


def _matrix(count: int) -> bytes:
    """An element of MAT 5: a vector of so many zeros."""
    inside = struct.pack("<IIII", 6, 8, 6, 0) + struct.pack("<IIii", 5, 8, 1, count) + struct.pack("<II", 1, 0)
    inside += struct.pack("<II", 9, 8 * count) + bytes(8 * count)
    return struct.pack("<II", 14, len(inside)) + inside


def cells_of_zeros(dice: Random, path: Path) -> None:
    """A cell of a thousand vectors of a hundred thousand zeros."""
    _mat(path, _matrix(dice.choice([10**4, 10**5])), 1000)


def many_cells(dice: Random, path: Path) -> None:
    """A cell of a million numbers, one each."""
    _mat(path, _matrix(1), dice.choice([10**5, 10**6]))


def zeros_in_one(dice: Random, path: Path) -> None:
    """Three vectors of eighty million zeros."""
    whole = _matrix(10**6)
    packer = zlib.compressobj(9)
    tag = struct.pack("<II", 14, len(whole) - 8 + 8 * 79 * 10**6)
    head = whole[8:56].replace(struct.pack("<i", 10**6), struct.pack("<i", 80 * 10**6), 1)
    body = [packer.compress(tag + head)] + [packer.compress(bytes(8 * 10**6)) for _ in range(80)]
    packed = b"".join(body) + packer.flush()
    path.write_bytes(b"MATLAB 5.0 MAT-file".ljust(124) + b"\x00\x01IM" + struct.pack("<II", 15, len(packed)) + packed)


def many_variables(dice: Random, path: Path) -> None:
    """Variables by the hundred thousand."""
    from scipy.io import savemat

    savemat(path, {f"v{k}": np.zeros(1) for k in range(2000)} | AXIS, do_compression=True)
    data = path.read_bytes()
    path.write_bytes(data + data[128:] * dice.choice([20, 100]))


def packed_blocks(dice: Random, path: Path) -> None:
    """An MDF of fifty million zeros in packed blocks."""
    from asammdf import MDF, Signal

    rows = dice.choice([10**7, 3 * 10**7])
    t, zeros = np.arange(rows) * 1e-3, np.zeros(rows)
    with MDF() as made:
        made.append([Signal(zeros, t, name="q", unit="rad"), Signal(zeros, t, name="tau", unit="N.m")])
        made.save(path, compression=2, overwrite=True)


def blocks_that_claim(dice: Random, path: Path) -> None:
    """An MDF whose packed blocks claim to be a hundred times as large, or as small, as they are."""
    from asammdf import MDF, Signal

    t = np.arange(200_000) * 1e-3
    with MDF() as made:
        made.append([Signal(np.sin(t), t, name="q", unit="rad"), Signal(np.cos(t), t, name="tau", unit="N.m")])
        made.save(path, compression=1, overwrite=True)
    data = bytearray(path.read_bytes())
    claimed = dice.choice([2**40, 2**31, 10])
    place = data.find(b"##DZ")
    while place >= 0:
        data[place + 32 : place + 40] = claimed.to_bytes(8, "little")
        place = data.find(b"##DZ", place + 4)
    path.write_bytes(bytes(data))


def cycles_that_claim(dice: Random, path: Path) -> None:
    """An MDF whose group claims a million million records."""
    from asammdf import MDF, Signal

    t = np.arange(2000) * 1e-3
    with MDF() as made:
        made.append([Signal(np.sin(t), t, name="q", unit="rad"), Signal(np.cos(t), t, name="tau", unit="N.m")])
        made.save(path, overwrite=True)
    data = path.read_bytes()
    path.write_bytes(
        data.replace((2000).to_bytes(8, "little"), dice.choice([10**12, 10**7, 2**63]).to_bytes(8, "little"))
    )


def _npz(path: Path, members: dict[str, tuple[bytes, int]]) -> None:
    """Write an archive of members, each a head and a number of zeros."""
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED, compresslevel=9) as archive:
        for name, (head, zeros) in members.items():
            with archive.open(f"{name}.npy", "w", force_zip64=True) as file:
                file.write(head)
                for _ in range(zeros // 10**6):
                    file.write(bytes(10**6))


def _head(shape: tuple[int, ...], kind: str = "<f8") -> bytes:
    out = io.BytesIO()
    np.lib.format.write_array_header_1_0(out, {"shape": shape, "fortran_order": False, "descr": kind})
    return out.getvalue()


def zeros_in_archive(dice: Random, path: Path) -> None:
    """Arrays of zeros in an archive."""
    count = dice.choice([8, 20, 60]) * 10**6
    _npz(path, {name: (_head((count,)), 8 * count) for name in AXIS})


def heads_that_claim(dice: Random, path: Path) -> None:
    """Arrays whose heads claim more than there is."""
    shape = dice.choice([(2**62,), (10**9,), (2**31, 2**31), (1, 10**9), (0, 2**62), (-1,)])
    _npz(path, {name: (_head(shape), 10**6) for name in AXIS})


def many_members(dice: Random, path: Path) -> None:
    """An archive of fifty thousand arrays."""
    with zipfile.ZipFile(path, "w") as archive:
        for number in range(50_000):
            archive.writestr(f"a{number}.npy", _head((1,)) + bytes(8))


def wide_cells(dice: Random, path: Path) -> None:
    """Texts of a million letters each, by the type of the array."""
    _npz(path, {"names": (_head((100,), "<U250000"), 10**8)})


def zeros_as_text(dice: Random, path: Path) -> None:
    """A packed text of gigabytes."""
    row = dice.choice([b"0,0,0\n", b"0\n", b"0," * 5000 + b"0\n", b"x" * 1000, b"\n", b'"'])
    packer = zlib.compressobj(9, wbits=31)
    head = packer.compress(b"t,tau,q\n")
    block = row * (10**6 // len(row))
    path.write_bytes(head + b"".join(packer.compress(block) for _ in range(dice.choice([150, 2000]))) + packer.flush())


def many_layers(dice: Random, path: Path) -> None:
    """A text packed again and again."""
    data = b"t,tau,q\n" + b"0.01,1,2\n" * 10**6
    for _ in range(dice.choice([2, 10])):
        data = gzip.compress(data)
    path.write_bytes(data)


def deep_lists(dice: Random, path: Path) -> None:
    """Lists in lists, or objects in objects, without end."""
    path.write_bytes(dice.choice([b"[" * 10**7, b'{"a":' * 10**6, b"[" * 10**6 + b"]" * 10**6]))


def many_objects(dice: Random, path: Path) -> None:
    """Millions of small objects."""
    one = dice.choice([b"{}", b"[]", b'{"t":1}', b"[[]]", b"1", b'""'])
    path.write_bytes(b"[" + b",".join([one] * (2 * 10**7 // len(one))) + b"]")


def long_numbers(dice: Random, path: Path) -> None:
    """Numbers of a million digits."""
    digits = b"1" * dice.choice([5000, 10**6])
    path.write_bytes(b'[{"t":%s,"tau":1,"q":1},{"t":1,"tau":1,"q":1e%s}]' % (digits, digits))


def many_keys(dice: Random, path: Path) -> None:
    """Records of which each has another name."""
    path.write_bytes(b"[" + b",".join(b'{"k%d":1}' % number for number in range(10**6)) + b"]")


PARQUET = (texts_of_megabytes, repeats, list_without_end, lists_of_texts, wide_bytes, many_columns, large_metadata)
MAT = (cells_of_zeros, many_cells, zeros_in_one, many_variables)
MDF = (packed_blocks, blocks_that_claim, cycles_that_claim)
NPZ = (zeros_in_archive, heads_that_claim, many_members, wide_cells)
JSON = (deep_lists, many_objects, long_numbers, many_keys)
KINDS = {
    "parquet": (".parquet", PARQUET),
    "mat": (".mat", MAT),
    "mdf": (".mf4", MDF),
    "npz": (".npz", NPZ),
    "packed text": (".csv.gz", (zeros_as_text, many_layers)),
    "json": (".json", JSON),
}
