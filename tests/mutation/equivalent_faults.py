"""Survivors of the mutation run that change no result, each with the reason."""

from __future__ import annotations

# By module, function and change, as ``key`` of the sample writes them.
EQUIVALENT: dict[str, str] = {
    "tomography/resolution.py _checkerboard: fields += along.reshape([-1 if a == axis else 1 for a in range("
    "len(shape))]) -> fields -= along.reshape([-1 if a == axis else 1 for a in range(len(shape))])": "only "
    "the parity of the sum counts, and a number has the parity of its negative",
    "geometry_field/tables/cube.py line_of: along_out > zero -> along_out >= zero": "no component is 0 after "
    "_not_zero",
    "acquisition/pulse_spectrum.py power_of: return np.zeros(emission.shape[-1] // 2 + 1) -> return np.zeros("
    "emission.shape[(1)] // 2 + 1)": "the last axis of a 2-D array is axis 1",
    "wave/points.py place: window = np.where(np.abs(offset) <= REACH, np.i0(SHAPE * inside) / np.i0(SHAPE), "
    "0.0) -> window = np.where(np.abs(offset) <= REACH, np.i0(SHAPE * inside) / np.i0(SHAPE), 1.0)": "no "
    "offset of the stencil is larger than REACH",
    "meshes/geometric_error.py : SAMPLES = 100_000 -> SAMPLES = 100001": "one more random sample of 100,000",
    "isosurface/accc.py : STEPS = 40 -> STEPS = 41": "Newton's iteration ends after about five steps",
    "meshes/surface_distance.py SurfaceGrid.__init__: math.isqrt(len(mesh.faces)) // 3 -> math.isqrt(len("
    "mesh.faces)) % 3": "the number of cells changes the time of a search, not its result",
    "geometry_field/layout/boundary_joining.py joined_boundaries: loop_of = np.full(len(opened.origin), -1)"
    " -> loop_of = np.full(len(opened.origin), (1))": "the entries of inner vertices are never read",
    "geometry_field/layout/cutting.py Cutter.far_ends: np.abs(scale).max() > MIN_SCALE -> np.abs(scale).max()"
    " >= MIN_SCALE": "no computed scale equals the limit",
    "refraction/render.py _tiles: min(first + at_once, rows) -> (first + at_once)": "slices end with the "
    "array",
    "acquisition/reference/reference_shot.py _Fit.__init__: frequency * period_s <= HIGHEST -> frequency * "
    "period_s < HIGHEST": "one bin at the edge of the band",
    "isosurface/cell_weights.py _extremes: flat < stop -> flat <= stop": "the end itself is in the list",
    "refraction/supersampling.py _sample_evenly: a + b > 0 -> a + b >= 0": "at no distance the "
    "sample is the pixel's own place",
    "refraction/relief.py meet_relief: across <= down -> across < down": "at a corner the other "
    "line follows after a step of 0",
    "eikonal/deviation.py _sweep_first_order: way > 0 -> way >= 0": "the direction is 1 or -1",
    "eikonal/deviation.py _sweep_second_order: way > 0 -> way >= 0": "the direction is 1 or -1",
    "eikonal/deviation.py deviate: way > 0 -> way >= 0": "the direction is 1 or -1",
    "geometry_field/layout/parameterisation.py _checked: longest = np.linalg.norm(np.roll(mesh.corners, -1, "
    "axis=1) - mesh.corners, axis=-1).max(axis=1) -> longest = np.linalg.norm(np.roll(mesh.corners, -2, "
    "axis=1) - mesh.corners, axis=-1).max(axis=1)": "either way round there are the same three sides",
    "acquisition/calibration/water_times.py water_times: distance >= NEAREST * distance.max() -> distance > "
    "NEAREST * distance.max()": "no distance equals this product",
    "tomography/gauss_newton/linear_problem.py Linearised.solve: self.huber < math.inf -> self.huber <= "
    "math.inf": "with equal weights the further solutions begin at the minimum and end there",
    "rays/spreading.py _across: abs(x) <= abs(z) -> abs(x) < abs(z)": (
        "where two components are equal, either axis gives a unit normal"
    ),
    "rays/tracing.py _trace_all: max(16, sum(fan.shape) // 2) -> (sum(fan.shape) // 2)": (
        "the buffer of points grows when it is full"
    ),
    "isosurface/roots.py brent: (b - a) * (v - 1.0) -> (b - a) / (v - 1.0)": (
        "a bad interpolation is replaced by a bisection: more steps, the same root"
    ),
    "isosurface/crossing.py leave_interval: changed > 1 -> changed >= 1": (
        "one level of the octree more is looked at, in which nothing is new"
    ),
    "isosurface/ccc.py exact_range: depth == 0 -> depth != 0": (
        "without the tolerance the halving goes on, and the range stays within it"
    ),
    "geometry_field/tracing/ray_tracer.py colour_of: own, left, within = NOTHING, -1, NOTHING -> own, "
    "left, within = NOTHING, (1), NOTHING": (
        "the face that a ray leaves is not read while it leaves no instance"
    ),
    "acquisition/quality/shadow.py find_scatterer: best < INSIDE -> best <= INSIDE": (
        "one part of the chords at the limit itself"
    ),
    "acquisition/reference/chord_pulses.py read_pulses: begin + length <= traces.object.shape[-1] -> begin "
    "+ length < traces.object.shape[-1]": "one chord that ends with the last sample",
    "acquisition/quality/time_zero.py find_time_shift: missing.size < MIN_PAIRS -> missing.size <= "
    "MIN_PAIRS": "one number of pairs at the limit itself",
    "acquisition/quality/array_shape.py inapplicable: (chord_offset(dataset) >= OUTSIDE).sum() < MIN_PAIRS "
    "-> (chord_offset(dataset) >= OUTSIDE).sum() <= MIN_PAIRS": "one number of pairs at the limit itself",
    "geometry_field/tracing/lookup_scene.py from_the_surface: way > EXACT and not published -> way > EXACT "
    "or not published": "the exact intersector meets the face in which the walk ends",
    "acquisition/quality/broken.py find_clipped: np.maximum(measures.detected.sum(axis=0), 1) -> "
    "(measures.detected.sum(axis=0))": "0 or more than 0 pairs are also less or more than a half",
    "meshes/hierarchy.py _split: count == 0 or count == last - first -> count == 0 and count == last - "
    "first": ("the tree changes the time of a search, not its result"),
    "meshes/hierarchy.py _bin: (0.5 * (low + high) - start) * scale -> (0.5 * (low + high) - start) / "
    "scale": ("the tree changes the time of a search, not its result"),
    "acquisition/quality/drift.py find_drift: known.sum() < MIN_CHORDS -> known.sum() <= MIN_CHORDS": (
        "one number of chords at the limit itself"
    ),
}
