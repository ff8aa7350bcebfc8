"""XML files in the archive of an FMU."""

from pathlib import Path
from xml.etree import ElementTree

from cosim.fmi.description import complaint_of, first_line
from cosim.support.archive import read
from cosim.support.errors import FmuError
from cosim.support.xml_files import LARGEST, check_xml


def xml_in(path: Path, member: str) -> ElementTree.Element:
    """Read an XML file of an archive.

    Raises:
        FmuError: it is not there, or no XML that may be read.
    """
    complaint = complaint_of(path)
    content = read(path, member, complaint, LARGEST)
    check_xml(content, member, complaint)
    try:
        return ElementTree.fromstring(content)
    except ElementTree.ParseError as error:
        text = f"{path}: {member} is no XML: {first_line(error)}."
        raise FmuError(text, culprit=member) from error


def plain(element: ElementTree.Element) -> str:
    """The name of an element without its namespace."""
    return element.tag.rpartition("}")[2]
