"""The FMU: description, binary, sources and documentation in one reproducible zip."""

import os
import tempfile
import xml.etree.ElementTree as ET
import zipfile
from collections.abc import Sequence
from pathlib import Path
from typing import Literal

from pyfmi_models.errors import ExportError
from pyfmi_models.export.build import FLAGS, libraries_of, sources_of, units_of
from pyfmi_models.export.codegen import Generated, generate
from pyfmi_models.export.description import fmi2_description, fmi3_description, xml_text
from pyfmi_models.export.documentation import documentation, resource
from pyfmi_models.export.platforms import PLATFORMS, host
from pyfmi_models.export.related import Related, references
from pyfmi_models.export.universal import universal_binary
from pyfmi_models.model import Model


def export_fmu(
    model: Model,
    path: Path,
    *,
    fmi: Literal[2, 3] = 3,
    force: bool = False,
    platforms: tuple[str, ...] = (),
    related: Sequence[Related] = (),
) -> Path:
    """Write the model as an FMU for model exchange and co-simulation, and return its path.

    The archive holds the binary for each of the platforms (names of `PLATFORMS`; default: the host), its sources
    and its documentation, and the related files that are given, with their manifest (see `related`). Equal models
    give equal bytes. The file appears complete or not at all.
    Raises ExportError if the file exists and `force` is not given, or the model cannot be exported.
    """
    path = Path(path)
    if path.exists() and not force:
        raise ExportError(f"{path} exists; use force to replace it")
    if fmi not in (2, 3):
        raise ExportError(f"there is no FMI {fmi} export; choose 2 or 3")
    generated = generate(model)
    platforms = platforms or (host(),)
    files = _description(generated, fmi) | _binaries(generated, fmi, platforms) | _sources(generated, fmi)
    files |= documentation(generated, platforms) | _icon(model, fmi)
    files |= references(related) if related else {}
    write_zip(path, files)
    return path


def _description(generated: Generated, fmi: int) -> dict[str, bytes]:
    units = units_of(sources_of(generated))
    text = fmi2_description(generated, units) if fmi == 2 else fmi3_description(generated)
    return {"modelDescription.xml": text}


def _binaries(generated: Generated, fmi: int, platforms: tuple[str, ...]) -> dict[str, bytes]:
    libraries = {name: path.read_bytes() for name, path in libraries_of(generated, platforms).items()}
    folders = libraries if fmi == 3 else _fmi2_folders(libraries)
    suffixes = {folder: platform.suffix for platform in PLATFORMS.values() for folder in (platform.name, platform.fmi2)}
    return {f"binaries/{f}/{generated.layout.identifier}{suffixes[f]}": content for f, content in folders.items()}


def _fmi2_folders(libraries: dict[str, bytes]) -> dict[str, bytes]:
    """Folders of FMI 2.0.5: its own names mean x86; what they do not cover lies under FMI 3's platform tuple.

    macOS has files for several processors, so `darwin64` holds all there are. Linux has none: `linux64` is x86-64
    where that is wanted, and else aarch64, because importers on aarch64 (FMPy among them) look there all the same.
    """
    groups: dict[str, list[bytes]] = {}
    for name in [name for name in PLATFORMS if name in libraries]:
        groups.setdefault(PLATFORMS[name].fmi2, []).append(libraries[name])
    found = {folder: group[0] for folder, group in groups.items()}
    if len(groups.get("darwin64", [])) > 1:
        found["darwin64"] = universal_binary(groups["darwin64"])
    if "aarch64-linux" in libraries:
        found["aarch64-linux"] = libraries["aarch64-linux"]
    return found


def _sources(generated: Generated, fmi: int) -> dict[str, bytes]:
    sources = sources_of(generated)
    found = {f"sources/{name}": content for name, content in sources.items()}
    if fmi == 3:
        found["sources/buildDescription.xml"] = _build_description(generated, units_of(sources))
    return found


def _build_description(generated: Generated, units: list[str]) -> bytes:
    root = ET.Element("fmiBuildDescription", fmiVersion="3.0")
    configuration = ET.SubElement(root, "BuildConfiguration", modelIdentifier=generated.layout.identifier)
    options = " ".join(flag for flag in FLAGS if flag.startswith(("-std", "-O", "-ff", "-fno")))
    group = ET.SubElement(configuration, "SourceFileSet", language="C11", compiler="clang", compilerOptions=options)
    for name in units:
        ET.SubElement(group, "SourceFile", name=name)
    return xml_text(root)


def _icon(model: Model, fmi: int) -> dict[str, bytes]:
    """The picture that tools show: FMI 2 knows one file, FMI 3 a folder that says how large the picture is."""
    name = "sampled" if model.period else "continuous"
    if fmi == 2:
        return {"model.png": resource(f"{name}.png")}
    corners = {"x1": "-100", "y1": "-100", "x2": "100", "y2": "100"}
    root = ET.Element("fmiTerminalsAndIcons", fmiVersion="3.0")
    picture = ET.SubElement(root, "GraphicalRepresentation")
    ET.SubElement(picture, "CoordinateSystem", {**corners, "suggestedScalingFactorTo_mm": "0.1"})
    ET.SubElement(picture, "Icon", corners)
    found = {f"icon.{kind}": resource(f"{name}.{kind}") for kind in ("png", "svg")}
    found["terminalsAndIcons.xml"] = xml_text(root)
    return {f"terminalsAndIcons/{file}": content for file, content in found.items()}


def write_zip(path: Path, files: dict[str, bytes]) -> None:
    """Write the files, name to content, as a zip that appears complete or not at all; equal files, equal bytes."""
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
    try:
        with os.fdopen(handle, "wb") as stream, zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as archive:
            for name in sorted(files):
                archive.writestr(_entry(name), files[name], compresslevel=9)
        os.chmod(temporary, 0o644)
        os.replace(temporary, path)
    except BaseException:
        Path(temporary).unlink(missing_ok=True)
        raise


def _entry(name: str) -> zipfile.ZipInfo:
    entry = zipfile.ZipInfo(name, date_time=(1980, 1, 1, 0, 0, 0))  # a fixed date: equal models, equal archives
    entry.compress_type = zipfile.ZIP_DEFLATED
    entry.create_system = 3
    entry.external_attr = (0o755 if name.startswith("binaries/") else 0o644) << 16
    return entry
