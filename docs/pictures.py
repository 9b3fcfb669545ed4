"""Generate the pictures of the documentation: `.venv/bin/python docs/pictures.py [NAME …]`, a few minutes.

The pictures of the web page need Debian's Chromium.
"""

from __future__ import annotations

import io
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from itertools import count
from pathlib import Path
from textwrap import fill
from types import MappingProxyType
from typing import Any, NamedTuple

import httpx
import matplotlib.pyplot as plt
import numpy as np
import trimesh
from browser import browser
from matplotlib.figure import Figure
from matplotlib.patches import Ellipse, Polygon
from PIL import Image, ImageDraw

import bentray
from bentray_kernels import eikonal, rays
from bentray_kernels.acquisition import Dataset
from bentray_kernels.errors import InvalidInput
from bentray_kernels.phantoms import TABLE6_SIDE_M, TWO_HOLES, sampled, table6
from bentray_kernels.tomography import Reconstruction, Settings, reconstruct
from bentray_kernels.tomography.comparison import compare
from bentray_service.cli.service_process import running_service
from bentray_service.client import Client
from bentray_workers.files.dataset import read_dataset, write_dataset
from bentray_workers.files.reconstruction import read_reconstruction
from bentray_workers.files.volume_axes import LPS, Grid
from bentray_workers.images.canvas import drawing, new_figure, to_png
from bentray_workers.images.captions import LABELS, NAMES
from bentray_workers.images.maps import SPEED, draw_bar, draw_map
from bentray_workers.images.report import COLORMAPS
from bentray_workers.images.slice import usual_limits
from bentray_workers.simulation.plane import SimulationSettings
from bentray_workers.simulation.request import SAMPLE
from bentray_workers.simulation.simulation_run import simulate

# The benchmarks are a namespace package of the checkout.
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from benchmarks.shared._pictures import in_full_colour

FOLDER = Path(__file__).parent / "pictures"
# Beside the checkout, where the tests with real scans look for it.
OTHERS = FOLDER.parents[2] / "shared" / "data" / "ring_wave_a.h5"
# Alignment of the name of an axis at its end.
ENDS: dict[str, dict[str, Any]] = {
    "right": {"ha": "left", "va": "center"},
    "left": {"ha": "right", "va": "center"},
    "front": {"ha": "center", "va": "bottom"},
    "back": {"ha": "center", "va": "top"},
}
BENTRAY = [sys.executable, "-m", "bentray_service.cli"]
MM = 1e3
# Colours of the sample scan.
SAMPLE_MPS = 1430.0, 1580.0


def fronts() -> Image.Image:
    """Phantom with wave fronts and rays, in water of the speed of its fat and in faster water."""
    figure, axes = plt.subplots(1, 2, figsize=(8.6, 4.1), layout="constrained", sharey=True)
    nodes, half = 256, TABLE6_SIDE_M / 2
    spacing = TABLE6_SIDE_M / (nodes - 1)
    angle = np.radians(np.linspace(110, 250, 29))
    receivers = half + 0.092 * np.column_stack((np.cos(angle), np.sin(angle)))
    source = np.array([half + 0.092, half])
    for ax, coupling in zip(axes, (1375.0, 1500.0), strict=True):
        speed = table6(coupling).speed(nodes, TABLE6_SIDE_M)
        time = eikonal.solve(speed, spacing, source)
        extent = (-half * MM, half * MM, -half * MM, half * MM)
        look: dict[str, Any] = {"cmap": "Blues_r", "vmin": 1350, "vmax": 1570, "interpolation": "nearest"}
        shown = ax.imshow(speed.T, origin="lower", extent=extent, **look)
        ax.contour(time.T * 1e6, levels=np.arange(5, 150, 5), extent=extent, colors="white", linewidths=0.6)
        for path in rays.trace(time, spacing, receivers, source):
            ax.plot(*((path - half) * MM).T, color="#d1495b", linewidth=0.9)
        ax.plot(0.092 * MM, 0, "o", color="black", markersize=5)
        ax.set(title=f"Wave fronts and rays, water {coupling:g} m/s", xlabel="x (mm)")
    axes[0].set_ylabel("y (mm)")
    figure.colorbar(shown, ax=axes, label="sound speed (m/s)", shrink=0.85)
    return _drawn(figure)


def coupling() -> Image.Image:
    """Phantom in water of four speeds, with its images by straight and bent rays."""
    waters = (1375.0, 1425.0, 1475.0, 1500.0)
    figure, axes = plt.subplots(3, 4, figsize=(10, 7.2), layout="constrained", sharex=True, sharey=True)
    bent = Settings(method="sart", rays="curved", nodes=96)
    ways = {"Straight rays": replace(bent, rays="straight"), "Bent rays": bent}
    half = TABLE6_SIDE_M / 2 * MM
    for column, water in zip(axes.T, waters, strict=True):
        scan = simulate(SimulationSettings(nodes=96, elements=128, coupling_mps=water), lambda _: None)
        assert scan.truth is not None
        images = {"Phantom": scan.truth.sound_speed_mps}
        images |= {name: reconstruct(scan, settings).speed for name, settings in ways.items()}
        for ax, (name, image) in zip(column, images.items(), strict=True):
            shown = ax.imshow(image.T, origin="lower", extent=(-half, half) * 2, vmin=1350, vmax=1570)
            ax.set_title(f"{name}, {water:g} m/s", fontsize="medium")
        column[-1].set_xlabel("x (mm)")
    for row in axes:
        row[0].set_ylabel("y (mm)")
    figure.suptitle("2-D breast phantom in water of four speeds")
    figure.colorbar(shown, ax=axes, label="sound speed (m/s)", shrink=0.6)
    return _drawn(figure)


def mistakes() -> Image.Image:
    """Times of a scan as they should be and with five mistakes; below, the image or the refusal."""
    scan = simulate(SimulationSettings(nodes=64, elements=64, coupling_mps=1500.0), lambda _: None)
    assert scan.delta_tof_s is not None
    right, place = scan.delta_tof_s, scan.element_position_m
    water = np.linalg.norm(place[:, None] - place[None], axis=2) / scan.water_speed_mps
    half = len(place) // 2
    failed = np.random.default_rng(1).random(right.shape) < 0.3
    order = np.arange(len(place)) ^ 1
    first, second = np.arange(half), np.arange(half, 2 * half)
    cases = {
        "right": {"delta_tof_s": right},
        "arrival times\nas differences": {"delta_tof_s": water + right},
        "samples at 20 MHz\nas seconds": {"delta_tof_s": 20e6 * right},
        "one direction, tx\nand rx exchanged": {
            "delta_tof_s": right[:half, half:].T,
            "tx": first,
            "rx": second,
            "valid": None,
        },
        "neighbouring elements\nexchanged": {"delta_tof_s": right[order][:, order]},
        "failed picks as\ndifferences of 0": {"delta_tof_s": np.where(failed, 0.0, right)},
    }
    figure, axes = plt.subplots(2, 6, figsize=(12.6, 4.7), layout="constrained")
    side = TABLE6_SIDE_M / 2 * MM
    for (above, below), (name, changes) in zip(axes.T, cases.items(), strict=True):
        delta = changes["delta_tof_s"]
        known = MM**2 * delta[np.isfinite(delta)]
        above.imshow(delta, cmap="RdBu_r", vmin=-5e-6, vmax=5e-6)
        above.set_title(name, fontsize="medium")
        above.set(xlabel=f"{known.min():.2g} to {known.max():.3g} µs", xticks=[], yticks=[])
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "scan.h5"
            try:
                write_dataset(path, replace(scan, **changes))
                result = bentray.reconstruct(bentray.read(path), "sart", nodes=64, progress=False)
            except InvalidInput as error:
                below.axis("off")
                below.text(0, 1, fill(f"rejected: {error}", 27), va="top", fontsize=7)
                continue
        speed = result.speed.T
        shown = below.imshow(speed, origin="lower", extent=(-side, side) * 2, vmin=1350, vmax=1570)
        below.set_xlabel("x (mm)")
    axes[0, 0].set_ylabel("emitter over receiver")
    axes[1, 0].set_ylabel("y (mm)")
    figure.colorbar(shown, ax=axes, label="sound speed (m/s)")
    return _drawn(figure)


def fresnel() -> Image.Image:
    """Width of the first Fresnel zone over the frequency."""
    figure, ax = plt.subplots(figsize=(7.6, 3.6), layout="constrained")
    frequency = np.geomspace(0.2e6, 5e6, 200)
    for length, colour in ((0.2, "#1d6996"), (0.1, "#73a5c6")):
        width = np.sqrt(1500.0 / frequency * length)
        ax.plot(frequency / 1e6, width * MM, color=colour, label=f"path of {length * MM:g} mm")
    ax.set_xscale("log", base=10)
    ax.set_xticks([0.2, 0.5, 1, 2, 5], ["0.2", "0.5", "1", "2", "5"])
    ax.minorticks_off()
    ax.set(xlabel="frequency (MHz)", ylabel="width (mm)", ylim=(0, 40))
    ax.set_title("Width of the first Fresnel zone in water of 1500 m/s")
    ax.grid(alpha=0.3)
    figure.legend(loc="outside right upper", frameon=False)
    return _drawn(figure)


def axes() -> Image.Image:
    """One node in scan axes and in those of DICOM and MetaImage, seen from the head."""
    figure, panels = plt.subplots(1, 2, figsize=(9.2, 4.1), layout="constrained", sharex=True, sharey=True)
    grid = Grid((0.01, 0.01, 0.01), (-0.06, -0.04, 0.02))
    node = np.array([10, 7, 0, 1])
    place = MM * (grid.affine() @ node)[:3]
    kinds = {
        "RAS: HDF5, NIfTI, NRRD, VTI, OME-Zarr": (np.eye(4), ("right", "front")),
        "LPS: DICOM, MetaImage": (LPS, ("left", "back")),
    }
    for panel, (title, (change, ways)) in zip(panels, kinds.items(), strict=True):
        panel.add_patch(Ellipse((0, 0), 200, 130, facecolor="#eef3f6", edgecolor="#8aa1ad"))
        panel.add_patch(Polygon([(-9, 64), (9, 64), (0, 78)], facecolor="#eef3f6", edgecolor="#8aa1ad"))
        for name, way, sign, row in zip("xy", ways, np.diag(change), np.eye(2), strict=False):
            tip = 36 * sign * row
            arrow = {"arrowstyle": "-|>", "color": "#1d6996", "linewidth": 2}
            panel.annotate("", tip, (0, 0), arrowprops=arrow)
            panel.text(*(tip + 8 * sign * row), f"{name}, {way}", **ENDS[way], color="#1d6996")
        panel.plot(0, 0, "o", markersize=9, markerfacecolor="white", color="#1d6996")
        panel.plot(0, 0, ".", color="#1d6996")
        beside = {"x": -6, "ha": "right"} if change[0, 0] > 0 else {"x": 6, "ha": "left"}
        panel.text(**beside, y=0, s="z, head", va="center", color="#1d6996")
        panel.plot(*place[:2], "s", color="#d1495b", markersize=10)
        numbers = ", ".join(f"{value + 0:g}" for value in np.round(change[:3, :3] @ place, 6))
        panel.text(place[0], place[1] + 8, f"({numbers}) mm", ha="center", color="#d1495b")
        sides = {"right": (112, 0), "left": (-112, 0), "front": (0, 90), "back": (0, -80)}
        for side, (x, y) in sides.items():
            panel.text(x, y, side, ha="center", va="center", rotation=90 if y == 0 else 0, color="#5c6f7a")
        panel.set(title=title, xlim=(-125, 125), ylim=(-90, 100), aspect="equal")
        panel.axis("off")
    figure.suptitle("One node of one volume, seen from the head: the numbers differ, the place does not")
    return _drawn(figure)


def glass() -> Image.Image:
    """Two phantoms as glass and one lit."""
    views = {
        "Sphere, refractive index 1.2": ("--phantom", "sphere", "--index", "1.2"),
        "Ball with two holes, index 1.3": (
            "--phantom",
            "two-holes",
            "--index",
            "1.3",
            "--backdrop",
            "picture",
        ),
        "Iso-surface, shaded": ("--phantom", "two-holes", "--mode", "shaded"),
    }
    with tempfile.TemporaryDirectory() as folder:
        paths = (Path(folder) / f"{number}.png" for number in count())
        return _titled({title: _rendered(next(paths), *view) for title, view in views.items()})


def mesh() -> Image.Image:
    """A torus as glass and as a mirror, and its geometry image."""
    with tempfile.TemporaryDirectory() as folder:
        torus, made = Path(folder) / "torus.ply", Path(folder) / "made"
        shape = trimesh.creation.torus(1.0, 0.4, major_sections=96, minor_sections=48)
        shape.apply_transform(trimesh.transformations.rotation_matrix(0.6, (1, 0, 0)))
        shape.export(torus)
        pictures = {}
        for mode, title in {"refract": "Torus of glass", "reflect": "Torus as a mirror"}.items():
            line = ["geometry-field", torus, "-o", made, "--mode", mode, "--rays", 2]
            _run(*line, "--width", 320, "--height", 320)
            pictures[title] = _opened(made / "image.png")
        positions = _opened(made / "geometry-image.png").resize((320, 320))
        return _titled({**pictures, "Geometry image: (x, y, z) as RGB": positions})


def quantities() -> Image.Image:
    """Speed, attenuation, reflection and uncertainty of a scan that another team simulated."""
    with tempfile.TemporaryDirectory() as folder:
        extras = ("--amplitudes", "ratio", "--reflection", "--uncertainty")
        _run("reconstruct", OTHERS, "-o", folder, "--workers", 1, *extras)
        made = read_reconstruction(Path(folder) / "reconstruction.h5")
    with drawing():
        figure = new_figure(17.2, 4.2)
        draw_quantities(figure, made)
        # The fine lines of the reflection take more than a committed file may have.
        drawn = Image.open(io.BytesIO(to_png(figure))).convert("RGB")
        return drawn.resize((1500, round(1500 * drawn.height / drawn.width)), Image.Resampling.LANCZOS)


def draw_quantities(figure: Figure, made: Reconstruction) -> None:
    """The quantities of a result side by side, each with its colours and unit."""
    shown = {
        "speed": SPEED,
        **{name: COLORMAPS[name] for name in ("attenuation", "reflection", "uncertainty")},
    }
    for axes, (name, colormap) in zip(figure.subplots(1, len(shown)), shown.items(), strict=True):
        one = made.image(name)
        assert one is not None
        limits = usual_limits(name, one.values, None if name == "reflection" else made.coverage)
        drawn = draw_map(
            axes, one.values, one.spacing_m, one.origin_m, limits, colormap=colormap, title=NAMES[name]
        )
        draw_bar([drawn], LABELS[name])


def overview() -> Image.Image:
    """The page of the image by full waveforms of the sample, beside truth and straight rays."""
    with _service() as service, browser((900, 968)) as page:
        client, folder = service.client, service.folder
        scan = client.wait(client.simulate(SAMPLE).id).dataset
        jobs = {
            name: client.wait(client.submit(scan, settings).id)
            for name, settings in (
                ("Straight rays", {"method": "sart", "rays": "straight"}),
                ("Full waveform", {"method": "waveform"}),
            )
        }
        results = {
            name: read_reconstruction(client.download(job.volume, "hdf5", folder / f"{job.id}.h5"))
            for name, job in jobs.items()
        }
        sample = read_dataset(client.download_dataset(scan, folder / "scan.h5"), traces=False)
        page.goto(f"{service.url}/#/jobs/{jobs['Full waveform'].id}?profile=-45,8,45,8")
        page.locator(".readout").filter(has_text="m/s").wait_for()
        shown = _shot(page)
    assert sample.truth is not None
    made = {name: compare(result, sample.truth, sample.roi) for name, result in results.items()}
    finest = made["Full waveform"]
    panels = [("Truth", finest.other, finest)]
    panels += [(f"{name}: {one.rms:.1f} m/s rms", one.image, one) for name, one in made.items()]
    figure, axes = plt.subplots(3, 1, figsize=(4.4, 8.8), layout="constrained", sharex=True)
    for ax, (name, image, one) in zip(axes, panels, strict=True):
        drawn = draw_map(ax, image, one.spacing_m, one.origin_m, SAMPLE_MPS, colormap=SPEED, title=name)
    figure.colorbar(drawn, ax=axes, label=LABELS["speed"], shrink=0.5)
    return _beside([shown.convert("RGB"), _drawn(figure).convert("RGB")])


def demo() -> Image.Image:
    """The images of `bentray demo`, smaller: the upper half of its picture."""
    with tempfile.TemporaryDirectory() as folder:
        _run("demo", "-o", folder)
        drawn = _opened(Path(folder) / "comparison.png")
    images = drawn.crop((0, 0, drawn.width, round(0.49 * drawn.height)))
    return images.resize((1500, round(1500 * images.height / images.width)), Image.Resampling.LANCZOS)


def viewer(
    scan: Dataset | None = None,
    settings: Mapping[str, Any] = MappingProxyType({"method": "sart", "nodes": 96}),
    size: tuple[int, int] = (1200, 1360),
) -> Image.Image:
    """The page of a result, with a profile and a region."""
    marks = "profile=-75,0,75,0&ellipse=-12,12,18,44"
    return _page(scan, [settings], size, lambda jobs: f"#/jobs/{jobs[0]}?{marks}")


def comparison() -> Image.Image:
    """The page that compares straight with bent rays."""
    ways: list[Mapping[str, Any]] = [
        {"method": "sart", "nodes": 96, "rays": rays} for rays in ("straight", "curved")
    ]
    return _page(None, ways, (1200, 1080), lambda jobs: f"#/compare/{','.join(jobs)}?profile=-75,0,75,0")


def scan_page() -> Image.Image:
    """The page of a scan with traces: elements, quality, the traces of an emission."""
    with _service() as service, browser((1400, 1650)) as page:
        made = service.client.wait(service.client.simulate(SAMPLE).id).dataset
        page.goto(f"{service.url}/#/scans/{made}")
        page.get_by_label("Emission number").fill("8")
        page.keyboard.press("Tab")
        page.locator("#shot-facts").filter(has_text="Emission 8").wait_for()
        page.locator("#quality").get_by_text("pairs").first.wait_for()
        return _shot(page)


def live_page() -> Image.Image:
    """The page of a running job, after some iterations."""
    with _service() as service, browser((1400, 1240)) as page:
        slow = {"method": "sart", "nodes": 128, "iterations": 60}
        job = service.client.submit(service.uploaded(), slow)
        page.goto(f"{service.url}/#/jobs/{job.id}")
        page.wait_for_function("() => document.querySelector('.misfit svg')?.dataset.points >= 8")
        page.locator(".live-time").filter(has_text="left").wait_for()
        return _shot(page)


def jobs_page() -> Image.Image:
    """The table of jobs: some succeeded, one under way, one cancelled."""
    with _service() as service, browser((1400, 640)) as page:
        client, scan = service.client, service.uploaded()
        for rays, name in {"straight": "Straight rays", "curved": "Bent rays"}.items():
            job = client.wait(client.submit(scan, {"method": "sart", "nodes": 64, "rays": rays}).id)
            httpx.patch(f"{service.url}/v1/jobs/{job.id}", json={"name": name}).raise_for_status()
        client.wait(client.simulate(SAMPLE).id)
        long = {"method": "sart", "nodes": 128, "iterations": 200}
        for _ in range(2):
            job = client.submit(scan, long)
        client.cancel(job.id)
        page.goto(f"{service.url}/#/jobs")
        for state in ("running", "cancelled"):
            page.locator(".job-table .state").get_by_text(state, exact=True).first.wait_for()
        return _shot(page)


def rendering_page() -> Image.Image:
    """The page of volume rendering, with a ball with two holes as glass."""
    with _service() as service, browser((1400, 1160)) as page:
        volume = io.BytesIO()
        np.save(volume, np.round(255.0 * sampled(TWO_HOLES, 96)).astype(np.uint8))
        made = _stored(service, "/v1/volumes?title=Ball with two holes", volume.getvalue())
        page.goto(f"{service.url}/#/rendering/{made}?mode=refract")
        page.locator("#glass[data-quality=full]").wait_for()
        page.locator(".histogram").wait_for()
        return _shot(page)


def surface_page() -> Image.Image:
    """The page of surface rendering, with two rings and a mirror ball, and the errors of the field."""
    with _service() as service, browser((1240, 1080)) as page:
        ring = trimesh.creation.torus(1.0, 0.4, major_sections=96, minor_sections=48)
        mesh = _stored(service, "/v1/meshes?title=Torus", ring.export(file_type="ply"))
        asked = {"kind": "geometry-field", "mesh": mesh, "settings": {}}
        job = httpx.post(f"{service.url}/v1/jobs", json=asked).raise_for_status().json()
        service.client.wait(job["id"])
        page.goto(f"{service.url}/#/surfaces/{mesh}?scene=mirror-ball&mode=self")
        page.locator("#field-picture[data-quality=full]").wait_for()
        page.locator("#accuracy table").wait_for()
        return _shot(page)


def _stored(service: _Service, address: str, content: bytes) -> str:
    """The id of a volume or mesh that is uploaded."""
    headers = {"Content-Type": "application/octet-stream"}
    sent = httpx.post(service.url + address, content=content, headers=headers, timeout=60.0)
    return str(sent.raise_for_status().json()["id"])


def _page(
    scan: Dataset | None,
    ways: Sequence[Mapping[str, Any]],
    size: tuple[int, int],
    address_of: Callable[[list[str]], str],
) -> Image.Image:
    """The web page with the results of a scan in these ways."""
    with _service() as service, browser(size) as page:
        client, uploaded = service.client, service.uploaded(scan)
        jobs = [client.wait(client.submit(uploaded, dict(one)).id).id for one in ways]
        page.goto(f"{service.url}/{address_of(jobs)}")
        page.locator(".readout").filter(has_text="m/s").wait_for()
        return _shot(page)


class _Service(NamedTuple):
    """A running service, and a folder for its files."""

    url: str
    client: Client
    folder: Path

    def uploaded(self, scan: Dataset | None = None) -> str:
        """The id of a scan, by default of the phantom in slow water."""
        usual = SimulationSettings(nodes=96, elements=64, coupling_mps=1375.0)
        write_dataset(self.folder / "phantom.h5", scan or simulate(usual, lambda _: None))
        return self.client.upload(self.folder / "phantom.h5").id


@contextmanager
def _service() -> Iterator[_Service]:
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        with running_service(folder / "data", folder / "log") as url, Client(url) as client:
            yield _Service(url, client, folder)


def _shot(page: Any) -> Image.Image:
    page.get_by_text("ready, ").wait_for()
    return Image.open(io.BytesIO(page.screenshot()))


def _run(*words: object) -> None:
    subprocess.run([*BENTRAY, *map(str, words)], check=True, stdout=subprocess.DEVNULL)  # noqa: S603


def _rendered(path: Path, *words: str) -> Image.Image:
    _run("render", "-o", path, "--width", 320, "--height", 320, *words)
    return _opened(path)


def _opened(path: Path) -> Image.Image:
    with Image.open(path) as image:
        return image.convert("RGB")


def _beside(images: list[Image.Image]) -> Image.Image:
    """Pictures of equal height in a row."""
    row = Image.new("RGB", (sum(one.width for one in images), images[0].height))
    left = 0
    for one in images:
        row.paste(one, (left, 0))
        left += one.width
    return row


def _titled(images: Mapping[str, Image.Image]) -> Image.Image:
    """Renderings in a row, each below its title, pixel for pixel."""
    width, height, band = 320, 320, 26
    row = Image.new("RGB", (width * len(images), height + band), "white")
    draw = ImageDraw.Draw(row)
    for k, (title, one) in enumerate(images.items()):
        row.paste(one, (k * width, band))
        draw.text((k * width + width / 2, band / 2), title, fill="black", anchor="mm", font_size=16)
    return row


def _drawn(figure: Figure) -> Image.Image:
    buffer = io.BytesIO()
    figure.savefig(buffer, dpi=110)
    plt.close(figure)
    return Image.open(buffer)


PICTURES: dict[str, Callable[[], Image.Image]] = {
    one.__name__: one
    for one in (
        overview,
        demo,
        fronts,
        coupling,
        mistakes,
        fresnel,
        axes,
        glass,
        mesh,
        quantities,
        viewer,
        comparison,
        scan_page,
        live_page,
        jobs_page,
        rendering_page,
        surface_page,
    )
}


def main(names: list[str]) -> None:
    """Generate the named pictures, or all."""
    FOLDER.mkdir(exist_ok=True)
    for name in names or PICTURES:
        buffer = io.BytesIO()
        PICTURES[name]().save(buffer, "png")
        (FOLDER / f"{name}.png").write_bytes(in_full_colour(buffer.getvalue()))


if __name__ == "__main__":
    main(sys.argv[1:])
