"""Descriptions of each kind of task for plans and errors."""

from types import MappingProxyType

TASK_WORDS = MappingProxyType(
    {
        "measure_traces": "measuring traces",
        "examine_slice": "examining the traces of a slice",
        "find_chords": "finding paths through water alone",
        "read_chords": "reading pulses through water alone",
        "estimate_slice_water": "estimating the water shot",
        "pick_emissions": "picking arrivals",
        "finish_slice": "checking the times of a slice",
        "write_picked": "writing the picked times",
        "trace_rays": "tracing rays",
        "update_sart": "updating the image by SART",
        "update_sart_slices": "updating slices by SART on a device",
        "sweep_block": "computing travel times in a block",
        "trace_rays_in_block": "tracing rays in a block",
        "back_project_in_block": "back-projecting residuals in a block",
        "update_block": "updating a block of the image by SART",
        "update_gauss_newton": "updating the image by Gauss-Newton",
        "trace_attenuation_rays": "tracing rays for the attenuation",
        "solve_attenuation": "reconstructing the attenuation",
        "trace_final_rays": "tracing rays for the resolution",
        "check_resolution": "checking the resolution",
        "trace_uncertainty_rays": "tracing rays for the uncertainty",
        "estimate_uncertainty": "estimating the uncertainty",
        "start_band": "preparing a frequency band",
        "evaluate_emitter": "simulating the waves of an emitter",
        "update_image": "updating the image by full waveforms",
        "validate_image": "comparing the image with unused traces",
        "solve_element_times": "computing travel times to the pixels",
        "measure_scan_pulse": "measuring the pulse",
        "sum_emissions": "summing echoes",
        "make_part": "simulating a part of the scan",
        "write_scan": "writing the scan",
        "draw_frame_tile": "drawing rows of a frame",
        "write_frame": "writing a frame",
    }
)


def task_in_words(name: str) -> str:
    """Description of a task, by the name of its function."""
    return TASK_WORDS.get(name, name.replace("_", " "))
