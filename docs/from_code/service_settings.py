"""Table of all environment variables: settings of the service, and those of clients and libraries."""

from typing import Any

from annotated_types import Ge, Gt, Le
from pydantic_core import PydanticUndefined

from bentray_service.settings import ServiceSettings

from .tables import table

# Variables, default and meaning of what is no setting of the service. A test compares them with the code.
OTHERS = (
    ("BENTRAY_KEY", "none", "API key of the Python client and the commands that use a service."),
    ("BENTRAY_PROJECT", "none", "Id of the project in which they work."),
    ("BENTRAY_WORKER_MEMORY", "the machine's", "Memory limit of `bentray worker`, such as `8GiB`."),
    (
        "BENTRAY_DEVICE",
        "`auto`",
        "`auto`, `cpu` or `opencl`: what `auto` of a request means on this machine.",
    ),
    (
        "BENTRAY_OPENCL_DEVICE",
        "GPUs first",
        "Number or part of the name of an OpenCL device; `none` hides all.",
    ),
    (
        "OCL_ICD_VENDORS, OPENCL_VENDOR_PATH",
        "`/etc/OpenCL/vendors`",
        "Folder of the system's OpenCL drivers.",
    ),
    (
        "NUMBA_CACHE_DIR",
        "beside the sources, else in the cache folder",
        "Folder of compiled kernels. If it cannot be written, new ones go to the cache folder.",
    ),
    ("NUMBA_NUM_THREADS", "1 in workers", "Left at 1: workers compute several tasks side by side."),
    (
        "XDG_CACHE_HOME",
        "`~/.cache`",
        "Cache folder: `bentray` in it holds self-tests and benchmarks of devices, and kernels without "
        "another place; PoCL and matplotlib use it, too. If it cannot be written, `bentray-UID` in the "
        "temporary folder takes its place.",
    ),
    (
        "POCL_CACHE_DIR",
        "`pocl` in `XDG_CACHE_HOME`",
        "Folder of PoCL's programs; the cache folder if it cannot be written.",
    ),
    ("XDG_CONFIG_HOME", "`~/.config`", "Folder of matplotlib's settings."),
    (
        "MPLCONFIGDIR",
        "`matplotlib` in `XDG_CONFIG_HOME`",
        "The same; the cache folder if it cannot be written.",
    ),
    (
        "TMPDIR",
        "`/tmp`",
        "Temporary folder: scans and results of running commands, and Dask's scratch space unless "
        "`DASK_TEMPORARY_DIRECTORY` names a folder. It must be writable.",
    ),
    ("HTTP_PROXY, HTTPS_PROXY, ALL_PROXY, NO_PROXY", "none", "[Proxies](#proxies-and-certificates)."),
    (
        "SSL_CERT_FILE, SSL_CERT_DIR",
        "the system's and certifi's",
        "[Certificate authorities](#proxies-and-certificates).",
    ),
    (
        "AWS_ACCESS_KEY_ID, AWS_SECRET_ACCESS_KEY, AWS_SESSION_TOKEN, AWS_DEFAULT_REGION, AWS_ENDPOINT_URL",
        "the files of AWS",
        "Access to the bucket of `BENTRAY_STORAGE_URL`.",
    ),
    (
        "AWS_PROFILE, AWS_SHARED_CREDENTIALS_FILE, AWS_CONFIG_FILE",
        "`default` in `~/.aws`",
        "The files of AWS.",
    ),
    (
        "OTEL_EXPORTER_OTLP_ENDPOINT, OTEL_EXPORTER_OTLP_TRACES_ENDPOINT, OTEL_SDK_DISABLED",
        "none",
        "Where OpenTelemetry traces go, with the extra `otel`.",
    ),
)

LIMITS = {Ge: ("ge", "≥"), Gt: ("gt", ">"), Le: ("le", "≤")}


def settings_table() -> str:
    """Variable, default, limits and meaning of each field of `ServiceSettings`, and of the others."""
    rows = [_row(name, field) for name, field in ServiceSettings.model_fields.items()]
    others = [
        (", ".join(f"`{one}`" for one in names.split(", ")), default, "", text)
        for names, default, text in OTHERS
    ]
    return table(("variable", "default", "accepted", "meaning"), rows + others)


def _row(name: str, field: Any) -> tuple[str, str, str, str]:
    aliases = getattr(field.validation_alias, "choices", [f"BENTRAY_{name}"])
    default = "none" if field.default in (None, PydanticUndefined) else f"`{field.default}`"
    return f"`{aliases[-1].upper()}`", default, _accepted(field), field.description or ""


def _accepted(field: Any) -> str:
    values = getattr(field.annotation, "__args__", ())
    if values and all(isinstance(value, str) for value in values):
        return ", ".join(f"`{value}`" for value in values)
    limits = (
        f"{sign} {getattr(limit, name)}"
        for limit in field.metadata
        for kind, (name, sign) in LIMITS.items()
        if isinstance(limit, kind)
    )
    return ", ".join(limits)
