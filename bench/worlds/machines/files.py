"""Case folders and their truth."""

import gzip
import json

import numpy as np

from .assess import level_of, twins
from .cases import truth
from .users_card import card_text, command_name

RECORDINGS = ("train_1", "train_2", "heldout")
JUDGED = ("channel_factors", "parasite", "law_misfit", "bristles")
CASE = ("plant", "control", "wander", "torque_noise", "ground", "recorded_temperature", "recorded_q_d", "gap", "jitter",
        "history")  # fmt: skip


def write_recording(path, r, case):
    """Write one recording as the logger would."""
    columns = {"t": (r["stamps"], "%.7f"), command_name(case): (r["tau"], "%.7g"), "q": (r["q"], "%.10f")}
    columns |= {"q_d": (r["q_d"], "%.10f")} if case["recorded_q_d"] else {}
    columns |= {"temperature": (r["temperature"], "%.2f")} if case["recorded_temperature"] else {}
    columns |= {name: (x, "%.5g") for name, x in r["user"].items()}
    form = ",".join(f for _, f in columns.values())
    body = "\n".join([form % row for row in zip(*[x[r["kept"]].tolist() for x, _ in columns.values()], strict=True)])
    with gzip.GzipFile(path, "wb", compresslevel=2, mtime=0) as out:
        out.write((",".join(columns) + "\n" + body + "\n").encode())


def truth_record(name, case, recordings, numbers, seed):
    """Collect what is sealed; the first keys are those of the foreign generator."""
    m, best = case["machine"], numbers["heldout_oracle_rms"]
    found = {"case": name, "family": case["family"], "effects": case["effects"], "level": level_of(case, numbers)}
    found |= {"target": case["target"], "parameters": truth(case), "kind": case["kind"]}
    found |= {key: numbers[key] for key in ("share_train", "share_heldout", *JUDGED)}
    found["pair_partial_share"] = numbers["partial"]
    found |= {"twin_variance_ratio": numbers["twin"], "indistinguishable": twins(case, numbers)}
    found["oracle"] = {"heldout_base_rms": numbers["heldout_base_rms"], "heldout_oracle_rms": best}
    found["oracle"]["heldout_oracle_libfriction_rms"] = best
    found |= {"truth_friction": case["truth"], "base_friction": case["card"]["law"], "card": case["card"]}
    found |= {"machine": m["kind"], "motion": "linear" if m["linear"] else "rotary", "rate_hz": m["rate"]}
    found |= {"loop_hz": case["loop"], "encoder_step": m["quant"], "encoder_noise": m["noise"]}
    found |= {key: case[key] for key in CASE} | {"seed": seed}
    found["recordings"] = {n: _recording(r) for n, r in zip(RECORDINGS, recordings, strict=True)}
    return found


def _recording(r):
    return r["info"] | {"n": len(r["t"]), "q_range": [float(np.min(r["q"])), float(np.max(r["q"]))]}


def plain(x):
    """Turn numpy's numbers into Python's."""
    if isinstance(x, dict):
        return {k: plain(v) for k, v in x.items()}
    if isinstance(x, list | tuple):
        return [plain(v) for v in x]
    return x.item() if isinstance(x, np.generic) else x


def write(folder, sealed, name, made, seed):
    """Write a case and its truth."""
    case, recordings, numbers = made
    place = folder / name
    place.mkdir(parents=True, exist_ok=True)
    (place / "model.toml").write_text(card_text(case), "utf-8")
    for stem, r in zip(RECORDINGS, recordings, strict=True):
        write_recording(place / f"{stem}.csv.gz", r, case)
    found = plain(truth_record(name, case, recordings, numbers, seed))
    (sealed / f"{name}.json").write_text(json.dumps(found, indent=1), "utf-8")
    return found
