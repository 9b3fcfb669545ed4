"""Operations per ray of the ray casters: evaluations of the spline, and nodes of the octree or cells."""

import importlib
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack, contextmanager
from unittest.mock import patch

from bentray_kernels.isosurface import crossing, roots
from bentray_kernels.refraction import Layers, RenderSettings, Scene, caster, render
from bentray_kernels.splines import Spline
from bentray_service.cli.output.benchmark_row import Row

from ._refraction_ladders import Subject

# The module; its name in the package is that of the function.
RENDER = importlib.import_module("bentray_kernels.refraction.render")

# Of the picture whose rays are counted: they are followed by the interpreter.
PIXELS = 24

# Functions that follow a ray, and those among them whose calls are counted.
FOLLOWING = {
    RENDER: ("cast",),
    caster: (
        "_trace_ray",
        "leave_interval",
        "field_at",
        "gradient_at",
        "sampled_value_and_gradient",
        "layer_at",
    ),
    crossing: ("leave_interval", "_scan", "_way_out", "_within", "_turned", "brent", "newton", "field_at"),
    roots: ("field_at", "_polished", "sampled_value_and_gradient"),
}
EVALUATIONS = ("field_at", "sampled_value_and_gradient")


@contextmanager
def counted() -> Iterator[Counter[str]]:
    """Replace the compiled functions by their Python code, whose calls are counted by name."""
    counts: Counter[str] = Counter()

    def counting(name: str, function: Callable[..., object]) -> Callable[..., object]:
        def called(*values: object) -> object:
            counts[name] += 1
            return function(*values)

        return called

    with ExitStack() as replaced:
        for module, names in FOLLOWING.items():
            for name in names:
                function = getattr(module, name)
                # The spline is evaluated by compiled code.
                plain = function if name == "sampled_value_and_gradient" else function.py_func
                replaced.enter_context(patch.object(module, name, counting(name, plain)))
        yield counts


def operations(scene: Scene, subject: Subject, structure: str, pixels: int = PIXELS) -> tuple[float, float]:
    """Evaluations of the spline, with or without its gradient, and nodes or cells, per ray."""
    settings = RenderSettings(pixels, pixels, structure=structure, supersampling="none")
    with counted() as counts:
        render(scene, subject.camera, subject.backdrop, settings)
    evaluations = sum(counts[name] for name in EVALUATIONS)
    return evaluations / pixels**2, counts["_way_out"] / 3.0 / pixels**2


def rows(subject: Subject, pixels: int = PIXELS) -> Iterable[Row]:
    """Work that remains with the octree, beside the published gain in time."""
    scene = Scene.build(
        Spline(subject.volume, smoothing=1.0), Layers((subject.iso,), (1.0, 1.5)), bound="accc"
    )
    counts = {search: operations(scene, subject, search, pixels) for search in ("steps", "dda", "octree")}
    listed = ", ".join(f"{search} {values:.1f} and {nodes:.1f}" for search, (values, nodes) in counts.items())
    yield Row(
        f"V5 {subject.name}, evaluations a ray, steps / accc octree",
        counts["steps"][0] / counts["octree"][0],
        round(subject.gain("accc octree")),
        ">=",
        "",
        f"evaluations of the spline, and cells or nodes, a ray: {listed}; the goal is their gain in time",
    )
