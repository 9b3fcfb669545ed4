"""The page /docs/formats: what files the service reads, from the readers themselves."""

from html import escape

from bentray_workers.files import mesh_formats, volume_formats
from bentray_workers.foreign_scans.conversion import READERS
from bentray_workers.foreign_scans.open_scan import Variable

from .documents import document, table

# Of the upload format, what no file may lack; the documentation has all.
REQUIRED = (
    ("/ @format, @format_version", "uct-transmission, 1.0"),
    ("/ @dimension", "2 or 3, as the positions"),
    ("/geometry/element_position_m", "positions of the elements, m: (elements, 2 or 3)"),
    ("/acquisition/tx, /acquisition/rx", "indices of emitters and of receivers, from 0"),
    ("/water @sound_speed_mps or @temperature_c", "m/s or °C"),
    ("/traveltime/delta_tof_s or /traveltime/tof_s", "travel times, s: (ntx, nrx); or traces:"),
    ("/waveform/object, /acquisition @sampling_rate_hz", "traces: (ntx, nrx, nt); their sampling rate, Hz"),
)


def formats_page(version: str) -> str:
    """The formats of scans with their variables, and those of volumes and meshes, as one HTML page."""
    own = table(("Place", "Content"), REQUIRED)
    readers = "".join(_reader(reader.title, reader.about, _variables(reader.variables)) for reader in READERS)
    return document(
        "file formats",
        version,
        f"""<h2 id="scans">Scans</h2>
<p>A format is detected by the content of a file, never by its name.</p>
{_reader("HDF5, uct-transmission 1.0", "The upload format; required are:", own)}
{readers}
<h2 id="volumes">Volumes</h2><p>Accepted is {escape(volume_formats.ACCEPTED)}.</p>
<h2 id="meshes">Meshes</h2><p>Accepted is {escape(mesh_formats.ACCEPTED)}.</p>""",
    )


def _reader(title: str, about: str, content: str) -> str:
    return f'<section class="panel"><h3>{escape(title)}</h3><p>{escape(about)}</p>{content}</section>'


def _variables(variables: tuple[Variable, ...]) -> str:
    head = ("Variable", "Shape, type", "Unit", "Content", "Required")
    return table(head, [(row.name, row.shape, row.unit, row.meaning, row.required) for row in variables])
