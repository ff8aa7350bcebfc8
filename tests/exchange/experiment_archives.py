"""FMUs with experiments in their archive, as FMI-LS-REF and the format of experiments say."""

import zipfile
from pathlib import Path

import numpy as np

FOLDER = "extra/org.fmi-standard.fmi-ls-ref"
STIMULUS = "test-in.csv"
REFERENCE = "test-ref.csv"


def manifest(*related: tuple[str, str, str], version: str = "1.0.0-beta.1") -> str:
    """A manifest of files: type, source and role of each."""
    rows = "".join(f'<Related type="{kind}" source="{source}" role="{role}"/>' for kind, source, role in related)
    return (
        '<fmiReferences xmlns:fmi-ls="http://fmi-standard.org/fmi-ls-manifest" '
        f'fmi-ls:fmi-ls-name="org.fmi-standard.fmi-ls-ref" fmi-ls:fmi-ls-version="{version}">{rows}</fmiReferences>'
    )


def experiments(inside: str = "", times: str = 'startTime="0" stopTime="2" stepSize="0.01"') -> str:
    """A file of one experiment."""
    files = f'<Stimuli source="{STIMULUS}"/><References source="{REFERENCE}"/>'
    return f'<Experiments name="Tests"><Experiment name="chirp" {times}>{inside}{files}</Experiment></Experiments>'


def csv(table: dict[str, np.ndarray]) -> str:
    """A table as FMI's tools write it."""
    rows = zip(*table.values(), strict=True)
    return "\n".join([",".join(table), *(",".join(repr(float(one)) for one in row) for row in rows)]) + "\n"


def with_files(fmu: Path, path: Path, files: dict[str, str]) -> Path:
    """The same FMU with further members in the folder of the layered standard."""
    with zipfile.ZipFile(fmu) as source, zipfile.ZipFile(path, "w") as target:
        for name in source.namelist():
            target.writestr(name, source.read(name))
        for name, content in files.items():
            target.writestr(f"{FOLDER}/{name}", content)
    return path


def bundle(stimulus: dict, reference: dict, version: str = "1.0.0-beta.1", inside: str = "", **more: str) -> dict:
    """The files of one experiment."""
    return {
        "fmi-ls-manifest.xml": manifest(("application/x-ma-hs-experiments", "a.exp", "experiment"), version=version),
        "a.exp": experiments(inside, **more),
        STIMULUS: csv(stimulus),
        REFERENCE: csv(reference),
    }
