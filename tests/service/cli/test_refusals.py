"""What commands refuse: exit code 2, and one line that names the option; nothing is written or asked."""

import shlex
from pathlib import Path

import h5py
import numpy as np
import pytest
import trimesh

from bentray_kernels.phantoms import ONE_HOLE, sampled
from bentray_workers.files.reconstruction import write_reconstruction

from ...workers.files.reconstructions import made, truth
from .conftest import Run

RENDER = "render {volume} -o {out}/p.png"
SIMULATE = "simulate -o {out}/x.h5"
SOLID = "--phantom table7 --nodes 16 --elements 12 --refinement 4 --slices 3"
FIELD = "geometry-field {mesh} -o {out}/field --samples 4 --inner-samples 4 --divisions 2 --image-size 33"

EXPORT = "export {result} -o {out}"
COMPARE = "compare {result} {truth}"
SETTINGS = (
    ("--rays bent", "rays: found 'bent'; accepted: 'curved' or 'straight'"),
    ("--speed-bounds 1600 1400", "speed_bounds_mps: found (1600.0, 1400.0); accepted: (lowest, highest)"),
    ("--seed -1", "seed: found '-1'; accepted: no such setting: the random order"),
    ("--edge 7", "edge_mps: found '7'; accepted: no such setting: method auto tries sharp edges"),
    ("--no-coherence-factor", "coherence_factor: found False; accepted: no such setting: the"),
)

CASES = (
    *(
        (f"{command} {{scan}} -o {{out}}/r {words}", f"bentray: {said}")
        for command in ("reconstruct", "submit")
        for words, said in SETTINGS
    ),
    ("keys create --name a --tenant ../x --data {out}/data", "tenant: found"),
    ("keys create --name a --scopes read,admin --data {out}/data", "scopes: found"),
    ("keys create --name a --expires soon --data {out}/data", "expires: found"),
    ("keys create --name 'a\nb' --data {out}/data", "name: found"),
    ("keys create --name '' --data {out}/data", "name: found"),
    ("keys revoke 000000000000 --data {out}/data", "key: found"),
    (
        "worker --scheduler nonsense --no-opencl --memory-limit plenty",
        "memory_limit: found 'plenty'; accepted: a size",
    ),
    ("worker --scheduler nonsense --no-opencl --tls nowhere", "tls: found nowhere (without authority.pem)"),
    ("worker --scheduler nonsense --no-opencl", "scheduler_address: found nonsense"),
    ("download mesh-1 -o {out}/m.ply", "id: found 'mesh-1'"),
    ("download ds-0123456789abcdef0123 -o {out}/scan.mat", "a name ending in .h5"),
    ("download vol-0123456789abcdef0123 -o {out}/v.png", ".hdf5, .npy, .nii"),
    ("download ds-0123456789abcdef0123 -o {scan}", "(exists)"),
    ("submit --batch {out}/nowhere --scheduler tcp://h:1", "--batch: found"),
    ("submit x.h5 --batch {out}", "file: found x.h5 with --batch"),
    ("submit", "file: found nothing"),
    ("submit x.h5 --scheduler tcp://h:1", "scheduler: found tcp://h:1 without --batch"),
    ("submit --batch {out} --scheduler tcp://h:1 --no-wait", "scheduler: found tcp://h:1 with"),
    ("submit --batch {out} --scheduler tcp://h:1", "without any scan"),
    ("submit --batch {out} --at-once 2", "at_once: found 2; accepted: no --at-once without --scheduler"),
    ("submit {scan} -o {out} --no-wait", "there is no result to download yet"),
    ("submit {scan} --url lab:8000", "url: found 'lab:8000'"),
    ("quality {scan} -o {out}/quality --picker eye", "Invalid value for '--picker'"),
    ("reconstruct {out}/absent.h5 -o {out}/r", "no such file"),
    ("reconstruct {scan} -o {scan}", "a file is in the way"),
    ("reconstruct {scan} -o {scan}/deeper", "a file is in the way"),
    ("reconstruct {scan} -o /proc/self", "a writable folder"),
    ("render {result} -o {out}/p.png", "(a folder)"),
    ("reconstruct {broken} -o {out}/r", "bentray: acquisition/tx: found "),
    ("reconstruct {cut} -o {out}/r", "bentray: file: found "),
    (f"{COMPARE} --region 1,2", "X,Y,RADIUS"),
    (f"{COMPARE} --region 1,2,-3", "X,Y,RADIUS"),
    (f"{COMPARE} --region 90,90,3", "between all nodes"),
    (f"{COMPARE} --quantity coverage", "one of speed"),
    (f"{COMPARE} -o picture.jpg", "a name ending in .png"),
    ("compare {out}/none.h5 {truth}", "no such file"),
    ("compare {result} {out}/none.npy", "No such file"),
    (f"{EXPORT}/image.tif", "a name ending in .h5, .hdf5, .npy"),
    ("export {out}/none.h5 -o {out}/image.nii", "no such file"),
    (f"{EXPORT}/image.nii --quantity density", "one of speed, coverage, recovery"),
    (f"{EXPORT}/image.h5 --attenuation dB/cm/MHz", "Np/m, which HDF5 results hold"),
    ("export {result} -o {result}/reconstruction.h5 --force", "the same file"),
    ("geometry-field {truth} -o {out}/field", "PLY, OBJ"),
    ("geometry-field {out}/absent.ply -o {out}/field", "PLY, OBJ"),
    ("serve --port 70000 --data {out}/data", "--port: found 70000; accepted: "),
    ("serve --workers 0 --data {out}/data", "--workers: found 0; accepted: "),
    (f"{FIELD} --samples 99", "samples: found 99"),
    (f"{FIELD} --scene moon", "scene: found 'moon'"),
    (f"{SIMULATE} --refinement 1", "refinement: found "),
    (f"{SIMULATE} --noise-ns 5 --snr 10", "snr: found "),
    (f"{SIMULATE} {SOLID} --array rings", "array: found "),
    (f"{SIMULATE} --phantom table7 --waveform --frequency 2e6", "frequency_hz: found "),
    (f"{SIMULATE} --waveform --emissions 500", "emissions: found "),
    (f"{SIMULATE} --frequency 3e5", "frequency_hz: found "),
    (f"{RENDER} --iso 7", "iso: found "),
    (f"{RENDER} --iso 0.6 --index 1.1 --index 1.2", "index: found "),
    (f"{RENDER} --backdrop absent.jpg", "backdrop: found "),
    (f"{RENDER} --phantom sphere", "file: found "),
    (f"{RENDER} --shape 2 2 2", "dtype: found "),
    (f"{RENDER} --dtype uint8", "shape: found "),
    (f"{RENDER} --map {{out}}/m.npy --mode shaded", "--map: found "),
    (f"{RENDER} --spacing 1 --spacing 2", "spacing_m: found "),
    (f"{RENDER} --spacing 1 2", "spacing_m: found "),
    (f"{RENDER} -o {{out}}/p.jpg", "output: found "),
    (f"{RENDER} --map {{out}}/map.txt", "output: found "),
    (f"{RENDER} -o /proc/self/p.png", "output: found "),
    (f"{RENDER} -o {{out}}/absent/p.png", "its folder does not exist"),
    ("simulate -o {out}", "(a folder)"),
    *(
        (f"render -o {{out}}/p.png --phantom sphere --{words}", f"bentray: --{words.split()[0]}: found ")
        for words in ("shape 2 2 2", "spacing 1", "dtype uint8")
    ),
    *(
        (f"render {words} -o {{out}}/p.png", "bentray: file: found ")
        for words in ("", "{out}/absent", "{mesh}")
    ),
)


@pytest.fixture(scope="module")
def inputs(tmp_path_factory: pytest.TempPathFactory, scan_file: Path) -> dict[str, Path]:
    """Sound inputs by their kind, and a scan with a wrong index and one that is cut short."""
    folder = tmp_path_factory.mktemp("inputs")
    np.save(folder / "v.npy", sampled(ONE_HOLE, 12))
    trimesh.creation.icosphere(1).export(folder / "m.ply")
    write_reconstruction(folder / "reconstruction.h5", made(48))
    np.save(folder / "truth.npy", truth(48).sound_speed_mps)
    content = scan_file.read_bytes()
    (folder / "cut.h5").write_bytes(content[:3000])
    (folder / "broken.h5").write_bytes(content)
    with h5py.File(folder / "broken.h5", "r+") as file:
        file["acquisition/tx"][2] = 9999
    named = {name: folder / f"{name}.h5" for name in ("cut", "broken")}
    named |= {"volume": folder / "v.npy", "mesh": folder / "m.ply", "truth": folder / "truth.npy"}
    return {"scan": scan_file, "result": folder, **named}


@pytest.mark.parametrize(("words", "said"), CASES, ids=[words for words, _ in CASES])
def test_it_is_refused_in_one_line(
    bentray: Run, inputs: dict[str, Path], tmp_path: Path, words: str, said: str
) -> None:
    result = bentray(*shlex.split(words.format(out=tmp_path, **inputs)), code=2)
    assert result.stdout == ""
    assert result.stderr.startswith("bentray: ")
    assert result.stderr.count("\n") == 1
    assert said in result.stderr
    # Folders may be made, and a database to look a key up.
    assert [
        path for path in tmp_path.rglob("*") if path.is_file() and tmp_path / "data" not in path.parents
    ] == []


@pytest.mark.parametrize(
    "words",
    [f"{RENDER} --width 32 --height 24", "simulate -o {out}/p.png --nodes 24 --elements 12"],
)
def test_a_file_that_exists_is_kept_without_force(
    bentray: Run, inputs: dict[str, Path], tmp_path: Path, words: str
) -> None:
    path, given = tmp_path / "p.png", shlex.split(words.format(out=tmp_path, **inputs))
    path.write_text("mine")
    assert "--force" in bentray(*given, code=2).stderr
    assert path.read_text() == "mine"
    forced = bentray(*given, "--force")
    assert forced.stdout.splitlines()[-1] == str(path)
    assert path.stat().st_size > 100
