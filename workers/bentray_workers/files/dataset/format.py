"""Fields of the upload format, for reader and writer."""

FORMAT = "uct-transmission"
VERSION = "1.0"

# Arrays over (ntx, nrx), with a leading nz axis for slices: path in the file, field of Dataset.
PAIR_ARRAYS = {
    "traveltime/tof_s": "tof_s",
    "traveltime/delta_tof_s": "delta_tof_s",
    "traveltime/sigma_s": "sigma_s",
    "amplitude/log_ratio_np": "log_ratio_np",
}

# Number attributes: (group, name, unit, field of Dataset).
NUMBERS = (
    ("geometry", "radius_m", "m", "radius_m"),
    ("acquisition", "center_frequency_hz", "Hz", "center_frequency_hz"),
    ("acquisition", "sampling_rate_hz", "Hz", "sampling_rate_hz"),
    ("water", "attenuation_np_m", "Np/m", "water_attenuation_np_m"),
    ("amplitude", "frequency_hz", "Hz", "amplitude_frequency_hz"),
)

# Text attribute of the travel times: numbers of impossible ones that became NaN, by kind, as JSON.
IMPOSSIBLE = "impossible_times"

# Text attributes of the root, by the same names in Dataset.
TEXTS = ("title", "source", "license")
