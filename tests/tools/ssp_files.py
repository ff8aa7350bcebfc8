"""SSP archives written by hand around the tiny FMU."""

import zipfile
from collections.abc import Callable
from pathlib import Path

import pytest

from cosim.system.scenario import Scenario, read_scenario

NAMES = {
    "ssd": "Description",
    "ssc": "Common",
    "ssv": "ParameterValues",
    "ssm": "ParameterMapping",
    "ssb": "SignalDictionary",
}
SPACES = (
    " ".join(f'xmlns:{key}="http://ssp-standard.org/SSP1/SystemStructure{name}"' for key, name in NAMES.items())
    + ' xmlns:osp="http://opensimulationplatform.com/SSP/OSPAnnotations"'
)
CONNECTORS = "".join(
    f'<ssd:Connector name="{name}" kind="{kind}"><ssc:Real/></ssd:Connector>'
    for name, kind in {"a": "input", "b": "input", "y": "output"}.items()
)
EXPERIMENT = """<ssd:DefaultExperiment stopTime="0.01"><ssd:Annotations>
<ssc:Annotation type="com.opensimulationplatform"><osp:Algorithm><osp:FixedStepAlgorithm baseStepSize="0.001"/>
</osp:Algorithm></ssc:Annotation></ssd:Annotations></ssd:DefaultExperiment>"""


def component(name: str, bindings: str = "", source: str = "resources/tiny%202.fmu", kind: str = "") -> str:
    return (
        f'<ssd:Component name="{name}" source="{source}" {kind}><ssd:Connectors>{CONNECTORS}</ssd:Connectors>'
        f"<ssd:ParameterBindings>{bindings}</ssd:ParameterBindings></ssd:Component>"
    )


def values(inside: str, attributes: str = "") -> str:
    """A binding with values inline."""
    return (
        f"<ssd:ParameterBinding {attributes}><ssd:ParameterValues>{parameter_set(inside)}</ssd:ParameterValues>"
        "</ssd:ParameterBinding>"
    )


def parameter_set(inside: str) -> str:
    parameters = f"<ssv:Parameters>{inside}</ssv:Parameters>"
    return f'<ssv:ParameterSet {SPACES} version="1.0" name="s">{parameters}</ssv:ParameterSet>'


def real(name: str, value: object, unit: str = "") -> str:
    unit = f'unit="{unit}"' if unit else ""
    return f'<ssv:Parameter name="{name}"><ssv:Real value="{value}" {unit}/></ssv:Parameter>'


DRIVEN = values(real("mode", 1) + real("a", 0.5))
"""Settings that make y = 0.5 at the end of each step."""
FOLLOWS = values(real("mode", 1))
"""Settings that make y = a at the end of each step."""
BOOLEANS = (
    '<ssc:BooleanMappingTransformation><ssc:MapEntry source="true" target="false"/>'
    '<ssc:MapEntry source="false" target="true"/></ssc:BooleanMappingTransformation>'
)


def linear(**numbers: float | str) -> str:
    told = " ".join(f'{name}="{number}"' for name, number in numbers.items())
    return f"<ssc:LinearTransformation {told}/>"


def mapped(binding: str, *pairs: tuple[str, str], inside: str = "") -> str:
    """The binding with a mapping of sources to targets, which transform what is inside."""
    tag = "ssm:MappingEntry"
    entries = "".join(f'<{tag} source="{source}" target="{target}">{inside}</{tag}>' for source, target in pairs)
    inline = f'<ssm:ParameterMapping {SPACES} version="1.0">{entries}</ssm:ParameterMapping>'
    mapping = f"<ssd:ParameterMapping>{inline}</ssd:ParameterMapping></ssd:ParameterBinding>"
    return binding.replace("</ssd:ParameterBinding>", mapping)


def wire(start: str, end: str, inside: str = "", attributes: str = "") -> str:
    """A connection; an end without a dot is a connector of the system itself."""
    said = attributes
    for side, one in (("start", start), ("end", end)):
        element, _, connector = one.rpartition(".")
        said += (f' {side}Element="{element}"' if element else "") + f' {side}Connector="{connector}"'
    return f"<ssd:Connection {said}>{inside}</ssd:Connection>"


def system(elements: str, wires: str = "", name: str = "s", connectors: str = "", bindings: str = "") -> str:
    return (
        f'<ssd:System name="{name}"><ssd:Connectors>{connectors}</ssd:Connectors>'
        f"<ssd:ParameterBindings>{bindings}</ssd:ParameterBindings>"
        f"<ssd:Elements>{elements}</ssd:Elements><ssd:Connections>{wires}</ssd:Connections></ssd:System>"
    )


def connector(name: str, kind: str) -> str:
    return f'<ssd:Connector name="{name}" kind="{kind}"><ssc:Real/></ssd:Connector>'


def pack(
    path: Path, fmu: Path, inside: str, *, experiment: str = EXPERIMENT, version: str = "1.0", **files: str
) -> Path:
    root = "ssd:SystemStructureDescription"
    text = f'<{root} {SPACES} version="{version}" name="t">{inside}{experiment}</{root}>'
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("SystemStructure.ssd", text)
        archive.write(fmu, "resources/tiny 2.fmu")
        for name, content in files.items():
            archive.writestr(f"resources/{name.replace('_', '.')}", content)
    return path


@pytest.fixture
def read(tiny: dict[int, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., Scenario]:
    """Pack an archive around the tiny FMU or another and read it, with a cache of its own."""
    monkeypatch.setenv("MOUNT_COSIM_CACHE", str(tmp_path / "cache"))
    return lambda inside, fmu=tiny[2], **more: read_scenario(pack(tmp_path / "t.ssp", fmu, inside, **more))
