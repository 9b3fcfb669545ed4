"""POV-Ray's ``df3`` volume as an iso-surface of glass: its frames, and where its rays end."""

import shutil
import struct
import subprocess
import time
from pathlib import Path

import numpy as np

from ._refracting_ball import CAMERA_Z, INDEX, NODES, PIXELS, SCREEN_Z, SQUARES, WIDTH

# Places on the screen from −REACH to REACH are told by 16-bit colours.
REACH = 256.0

SCENE = """#version 3.7;
global_settings {{ assumed_gamma 1.0 max_trace_level 16 }}
camera {{ orthographic location <0, 0, {camera}> direction z right {width}*x up -{width}*y }}
#declare Field = function {{
  pattern {{ density_file df3 "ball.df3" interpolate 1 scale {scale} translate {shift} }}
}}
isosurface {{
  function {{ 0.5 - Field(x, y, z) }}
  threshold 0 accuracy 0.0001 max_gradient {steepest} all_intersections
  contained_by {{ box {{ -{half}, {half} }} }}
  pigment {{ rgbt 1 }} finish {{ ambient 0 diffuse 0 }} interior {{ ior {index} }}
}}
plane {{ z, {screen} {pigment} finish {{ ambient 0 diffuse 0 emission 1 }} }}
"""

BOARD = "pigment {{ checker rgb 1, rgb 0.15 scale {square} }}"

PLACES = """pigment {{ average pigment_map {{
  [1 function {{ (x + {reach}) / {span} }} color_map {{ [0 rgb 0] [1 rgb <2, 0, 0>] }}]
  [1 function {{ (y + {reach}) / {span} }} color_map {{ [0 rgb 0] [1 rgb <0, 2, 0>] }}]
}} }}"""


class PovRay:
    """The command ``povray``, one thread, with trilinear volumes.

    Its tricubic ones put the same ball's rays tens of nodes from where they end, by whatever shift.

    Args:
        folder: for its files.

    Raises:
        ImportError: where the command is not installed.
    """

    def __init__(self, folder: Path) -> None:
        command = shutil.which("povray")
        if command is None:
            raise ImportError("povray is not installed")
        self.command, self.folder = command, folder

    def frame(self, volume: np.ndarray) -> float:
        """Seconds of one frame before the checkerboard, those of a frame of 8 × 8 pixels taken off."""
        pigment = BOARD.format(square=WIDTH / SQUARES)
        return self._run(volume, pigment, PIXELS) - self._run(volume, pigment, 8)

    def ends(self, volume: np.ndarray) -> np.ndarray:
        """(pixels², 2) where the rays end."""
        self._run(volume, PLACES.format(reach=REACH, span=2.0 * REACH), PIXELS)
        # Pillow reads 16-bit colour as 8-bit; the raw format of POV-Ray is simple enough.
        colours = _read_ppm(self.folder / "out.ppm")
        return (colours[..., :2].reshape(-1, 2) * 2.0 - 1.0) * REACH

    def _run(self, volume: np.ndarray, pigment: str, pixels: int) -> float:
        """Render into ``out.ppm``; seconds."""
        header = struct.pack(">3H", NODES, NODES, NODES)
        # x runs fastest in a df3 file.
        (self.folder / "ball.df3").write_bytes(header + volume.transpose(2, 1, 0).astype(np.uint8).tobytes())
        steepest = max(float(np.abs(np.diff(volume, axis=axis)).max()) for axis in range(3)) / 255.0
        text = SCENE.format(
            camera=CAMERA_Z,
            width=WIDTH,
            # POV-Ray puts node i at i/n of the unit cube.
            scale=NODES,
            shift=-0.5 * (NODES - 1),
            half=0.5 * (NODES - 1),
            steepest=1.2 * steepest,
            index=INDEX,
            screen=SCREEN_Z,
            pigment=pigment,
        )
        (self.folder / "ball.pov").write_text(text)
        size = [f"+W{pixels}", f"+H{pixels}"]
        options = ["+Iball.pov", "+Oout.ppm", "+FP16", "-D", "-GA", "+WT1", "-A", "File_Gamma=1.0"]
        start = time.perf_counter()
        subprocess.run([self.command, *options, *size], cwd=self.folder, check=True, capture_output=True)
        return time.perf_counter() - start


def _read_ppm(path: Path) -> np.ndarray:
    """(rows, columns, 3) from 0 to 1 of a binary PPM."""
    fields, rest = [], path.read_bytes()
    while len(fields) < 4:
        token, rest = rest.split(maxsplit=1) if not rest.startswith(b"#") else (None, rest.split(b"\n", 1)[1])
        if token is not None:
            fields.append(token)
    columns, rows, most = (int(field) for field in fields[1:])
    numbers = np.frombuffer(
        rest[-rows * columns * 3 * (2 if most > 255 else 1) :], ">u2" if most > 255 else "u1"
    )
    return numbers.reshape(rows, columns, 3) / most
