"""Goals V2, V3 and V6: refraction against other volume renderers, and supersampling after refraction."""

import tempfile
import time
from collections.abc import Callable, Iterable
from pathlib import Path

import numpy as np

from bentray_kernels.refraction import Picture, RenderSettings, Scene, render
from bentray_kernels.splines import Spline
from bentray_service.cli.output.benchmark_context import BenchmarkContext
from bentray_service.cli.output.benchmark_row import Row

from ..shared._available import available
from ..shared._timing import alternate
from ._refracting_ball import (
    DISTANCE_RADIUS,
    RIM_RADIUS,
    board,
    camera,
    eight_bit,
    errors,
    photograph,
    scene,
    signed_distance,
)
from ._refraction_mitsuba import Mitsuba
from ._refraction_opencl import rows as opencl_rows
from ._refraction_picture import picture as picture_of_balls
from ._refraction_povray import PovRay

REPEATS = 9
# Frames with and without supersampling after refraction, which differ by a few percent.
MANY_REPEATS = 120

# Times below the error of Mitsuba with distances, with 8 bits, and of POV-Ray with 8 bits.
DISTANCE, EIGHT_BIT, POVRAY = 50.0, 3.0, 8.0

# Times the speed of POV-Ray, of a frame of Mitsuba, and of one of its 16 samples.
FRAME_POVRAY, FRAME_MITSUBA, SAMPLE_MITSUBA = 30.0, 2.0, 1.1


def rows(context: BenchmarkContext) -> Iterable[Row]:
    """V2, V3 and V6, with a picture."""
    steps: list[Callable[[bool], Iterable[Row]]] = [mitsuba_rows, povray_rows, supersampling_rows]
    for k, step in enumerate(steps):
        context.progress(k, len(steps), step.__name__)
        yield from step(context.quick)
    yield from opencl_rows(context)
    context.save_picture("refraction.png", picture_of_balls)
    context.progress(len(steps), len(steps), "done")


def picture(made: Scene, **settings) -> Picture:
    """A frame before the checkerboard, one thread."""
    return render(made, camera(), board(), RenderSettings(**settings))


def ends(made: Scene) -> np.ndarray:
    """(pixels², 2) where our rays end."""
    return picture(made, supersampling="none").position_m.reshape(-1, 2)


def eight_bit_scene() -> Scene:
    """The 8-bit ball, read as the dissertation reads it: by the smoothing cubic B-spline with λ = 1."""
    return scene(Spline(eight_bit(), smoothing=1.0), 127.5)


def summary(name: str, values: np.ndarray) -> str:
    lost = int(np.isnan(values).sum())
    return f"{name} {np.nanmean(values):.2g} (median {np.nanmedian(values):.2g}, {lost} lost)"


def error_row(label: str, goal: float, ours: np.ndarray, name: str, theirs: np.ndarray) -> Row:
    detail = f"mean distance on the backdrop, nodes: {summary('ours', ours)}, {summary(name, theirs)}"
    return Row(label, float(np.nanmean(theirs) / np.nanmean(ours)), goal, ">=", "", detail)


def mitsuba_rows(quick: bool) -> Iterable[Row]:
    """V2 and V3 against Mitsuba 3."""
    peers, missing = available({"Mitsuba": ("mitsuba", Mitsuba)})
    goals = {
        "V2 distances, Mitsuba": DISTANCE,
        "V2 8 bits, Mitsuba": EIGHT_BIT,
        "V3 frame, Mitsuba": FRAME_MITSUBA,
        "V3 sample of 16, Mitsuba": SAMPLE_MITSUBA,
    }
    if not peers:
        yield from (Row(label, None, goal, ">=", "", missing["Mitsuba"]) for label, goal in goals.items())
        return
    mitsuba = peers["Mitsuba"]
    labels = iter(goals.items())
    distances = scene(Spline(signed_distance()), 0.0)
    theirs = mitsuba.scene(signed_distance(), 0.0, 1.0)
    theirs_off = errors(mitsuba.ends(theirs), DISTANCE_RADIUS)
    yield error_row(*next(labels), errors(ends(distances), DISTANCE_RADIUS), "Mitsuba", theirs_off)
    rounded = mitsuba.scene(eight_bit(), 127.5, 1.0 / 24.0)
    theirs_off = errors(mitsuba.ends(rounded), RIM_RADIUS)
    yield error_row(*next(labels), errors(ends(eight_bit_scene()), RIM_RADIUS), "Mitsuba", theirs_off)
    runs = {
        "ours": lambda: picture(distances),
        "a sample of ours": lambda: picture(distances, supersampling="none"),
        "Mitsuba": mitsuba.frame(theirs, 1),
    }
    seconds = alternate(runs, 5 if quick else REPEATS) | alternate({"16": mitsuba.frame(theirs, 16)}, 5)
    detail = (
        f"ms, one thread: ours with PRSS {seconds['ours'] * 1e3:.1f}, 1 sample {seconds['Mitsuba'] * 1e3:.1f}"
    )
    yield Row(next(labels)[0], seconds["Mitsuba"] / seconds["ours"], FRAME_MITSUBA, ">=", "", detail)
    sample = seconds["16"] / 16.0
    detail = f"ms a sample: ours {seconds['a sample of ours'] * 1e3:.1f}, theirs {sample * 1e3:.1f}"
    yield Row(next(labels)[0], sample / seconds["a sample of ours"], SAMPLE_MITSUBA, ">=", "", detail)


def povray_rows(quick: bool) -> Iterable[Row]:
    """V2 and V3 against POV-Ray, whose volumes have whole numbers."""
    labels = "V2 8 bits, POV-Ray", "V3 frame, POV-Ray"
    with tempfile.TemporaryDirectory() as folder:
        try:
            povray = PovRay(Path(folder))
        except ImportError as error:
            yield Row(labels[0], None, POVRAY, ">=", "", str(error))
            yield Row(labels[1], None, FRAME_POVRAY, ">=", "", str(error))
            return
        ours = eight_bit_scene()
        theirs_off = errors(povray.ends(eight_bit()), RIM_RADIUS)
        yield error_row(labels[0], POVRAY, errors(ends(ours), RIM_RADIUS), "POV-Ray", theirs_off)
        seconds, theirs = np.inf, np.inf
        for _ in range(5):
            seconds = min(seconds, alternate({"ours": lambda: picture(ours)}, 1)["ours"])
            theirs = min(theirs, povray.frame(eight_bit()))
        detail = f"ms, one thread, start-up taken off: ours {seconds * 1e3:.1f}, theirs {theirs * 1e3:.0f}"
        yield Row(labels[1], theirs / seconds, FRAME_POVRAY, ">=", "", detail)


def supersampling_rows(quick: bool) -> Iterable[Row]:
    """V6: PSNR towards 64 rays a pixel, and what it costs."""
    made = eight_bit_scene()
    truth = picture(made, supersampling="real", degree=8).image.astype(float)

    def psnr(**settings) -> float:
        return float(10.0 * np.log10(255.0**2 / ((picture(made, **settings).image - truth) ** 2).mean()))

    none, post = psnr(supersampling="none"), psnr(supersampling="prss")
    real = psnr(supersampling="real", degree=3)
    runs = {
        "none": lambda: picture(made, supersampling="none"),
        "prss": lambda: picture(made, supersampling="prss"),
    }
    seconds = alternate(runs, 5 if quick else MANY_REPEATS, time.process_time)
    runs = {"real": lambda: picture(made, supersampling="real", degree=3)}
    seconds |= alternate(runs, 5 if quick else REPEATS, time.process_time)
    listed = ", ".join(f"{name} {least * 1e3:.1f}" for name, least in seconds.items())
    detail = f"PSNR {none:.1f} dB without, {post:.1f} dB after refraction, {real:.1f} dB with 9 rays a pixel"
    yield Row("V6 gain", post - none, 6.0, ">=", "dB", detail)
    extra = 100.0 * (seconds["prss"] / seconds["none"] - 1.0)
    yield Row(
        "V6 extra time",
        extra,
        5.0,
        "<=",
        "%",
        f"ms a frame of processor time: {listed}; theirs below 2 % of 6.65 s",
    )
    yield photograph_row(made, quick)
    extra = 100.0 * (seconds["real"] / seconds["none"] - 1.0)
    detail = f"ms a frame of processor time: {listed}; theirs over 300 %, number of rays not told (table 1)"
    yield Row("V6 extra time of 9 rays a pixel", extra, 300.0, ">=", "%", detail)


def photograph_row(made: Scene, quick: bool) -> Row:
    """V6 in front of a photograph: all pixels differ from their neighbours and are refined."""
    behind = photograph()

    def frame(**settings) -> np.ndarray:
        return render(made, camera(), behind, RenderSettings(**settings)).image.astype(float)

    truth = frame(supersampling="real", degree=8)
    psnr = {
        way: 10.0 * np.log10(255.0**2 / ((frame(supersampling=way) - truth) ** 2).mean())
        for way in ("none", "prss")
    }
    runs = {way: lambda way=way: frame(supersampling=way) for way in ("none", "prss")}
    seconds = alternate(runs, 5 if quick else MANY_REPEATS, time.process_time)
    listed = ", ".join(f"{name} {1e3 * least:.1f}" for name, least in seconds.items())
    extra = 100.0 * (seconds["prss"] / seconds["none"] - 1.0)
    detail = (
        f"ms a frame of processor time, detail at every scale: {listed}; PSNR {psnr['none']:.1f} dB without, "
        f"{psnr['prss']:.1f} dB after refraction, nine samples a pixel"
    )
    return Row("V6 extra time, photograph", extra, 5.0, "<=", "%", detail)
