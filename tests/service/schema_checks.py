"""Checks that schemathesis loads: two in place of its own, whose right exceptions are listed by name."""

from collections.abc import Mapping
from typing import Any

import schemathesis
from schemathesis.core.parameters import ParameterLocation
from schemathesis.generation.meta import CoverageScenario
from schemathesis.openapi.checks import RejectedPositiveData
from schemathesis.specs.openapi.checks import negative_data_rejection, positive_data_acceptance

from bentray_kernels.requests.request_fields import effective_when
from bentray_kernels.tomography.settings import Settings
from bentray_workers.rendering.field_view import FieldView
from bentray_workers.rendering.refraction_view import RefractionView
from bentray_workers.simulation.request import PhantomScan

# Pieces of uploads are bytes as they are.
schemathesis.serializer.alias("application/offset+octet-stream", "application/octet-stream")

# What the description says in words, because JSON Schema has none for it: by operation, the status and the
# fields that the refusal may name. What is not here has to be taken, or the description is wrong.
VIEW = {
    # As many as iso-values, which rise and lie within the volume's range; a layer that there is.
    "iso",
    "index",
    "surroundings",
    # Only of B-splines.
    "smoothing",
    # What only some views have, as a degree of supersampling.
    *effective_when(RefractionView),
    # Rays of the whole picture.
    "width, height, degree",
    # The tests forbid OpenCL devices.
    "device",
}
# An address on the public internet.
WEBHOOK = "webhook"
# Random bytes are none of the files that are accepted, or are empty.
FILE = {"file", "body"}
SETTINGS = {
    *VIEW,
    # Pixels of all pictures together.
    "frames",
    # Settings of a reconstruction that only some have, or that exclude another; the lower speed comes first.
    *effective_when(Settings),
    *(
        "attenuation.focusing",
        "decomposition",
        "opening_angle_deg",
        "speed_bounds_mps",
    ),
    # Settings that only some simulations have, or have in a narrower range; what is too large in all.
    *effective_when(PhantomScan),
    *("coupling_mps", "elements", "nodes", "snr"),
}
DEPENDENT: Mapping[str, Mapping[int, set[str]]] = {
    # One variable for a field, and one unit of a kind.
    "POST /v1/datasets": {422: {*FILE, "map", "unit"}},
    "POST /v1/meshes": {422: FILE},
    # Of raw bytes both or none, as many as the file has; the range of a number in a text.
    "POST /v1/volumes": {422: {*FILE, "shape", "dtype", "spacing_m"}},
    # The most that an installation takes; a word in base 64.
    "POST /v1/uploads": {413: {"Upload-Length"}, 422: {"Upload-Metadata", "Upload-Metadata kind"}},
    # What is left of it; the digest of this body. Schemathesis itself sends "0", against the pattern.
    "PATCH /v1/uploads/{upload_id}": {413: {"body"}, 460: {"body"}, 400: {"Upload-Checksum"}},
    # A volume, or a mesh, that the job can be done with.
    "POST /v1/jobs": {
        422: {*(f"settings.{name}" for name in SETTINGS), "settings", "volume", "mesh", WEBHOOK}
    },
    # As those of each of its jobs; each dataset once.
    "POST /v1/batches": {422: {*(f"settings.{name}" for name in SETTINGS), "settings", "datasets", WEBHOOK}},
    # As many as a tenant may have; a member, as many as a project may have.
    "POST /v1/projects": {422: {"projects"}},
    "PUT /v1/projects/{project_id}/members": {422: {"member", "members", "role"}},
    "POST /v1/plans": {
        422: {*(f"settings.{name}" for name in SETTINGS), "settings", "volume", "mesh", WEBHOOK}
    },
    # As an upload, a scan that is plausible after the correction; what the scan has; not what it was before.
    "POST /v1/datasets/{dataset_id}/corrections": {
        422: {
            *("times_in", "times_read_as", "positions_in", "positions_read_as", "arrangement"),
            *(
                "sampling_rate_hz",
                "frequency_hz",
                "correction",
                "traveltime/delta_tof_s",
                "geometry/element_position_m",
            ),
            *("acquisition/sampling_rate_hz", "acquisition/center_frequency_hz", "acquisition/t0_s"),
        }
    },
    # An emission and a slice that the scan has; traces that it has.
    "GET /v1/datasets/{dataset_id}/traces": {422: {"emission", "slice", "quantity"}},
    "GET /v1/volumes/{volume_id}/slice.png": {
        # An axis and an index that this volume has; low below high; larger within a frame; of an upload
        # value, of a reconstruction the others.
        422: {"axis", "index", "low", "high", "size", "quantity"}
    },
    # Value of an upload, the others of a reconstruction that has them.
    "GET /v1/volumes/{volume_id}/histogram": {422: {"quantity"}},
    # Of reconstructions alone.
    "GET /v1/volumes/{volume_id}/summary": {422: {"volume"}},
    # Of a reconstruction with attenuation, and of a format with one image.
    "GET /v1/volumes/{volume_id}/data": {422: {"quantity", "attenuation", "volume"}},
    "GET /v1/volumes/{volume_id}/refraction.png": {422: VIEW},
    "GET /v1/geometry-fields/{field_id}/image.png": {
        422: {*effective_when(FieldView), "width, height, rays", "positions_m"}
    },
    # Within the volume's range; one that leaves two nodes.
    "POST /v1/volumes/{volume_id}/mesh": {422: {"iso", "step"}},
}


@schemathesis.check
def valid_data_accepted(ctx: Any, response: Any, case: Any) -> None:
    """Check ``positive_data_acceptance``, but for what ``DEPENDENT`` names."""
    try:
        positive_data_acceptance(ctx, response, case)
    except RejectedPositiveData:
        fields = DEPENDENT.get(case.operation.label, {}).get(response.status_code, ())
        if response.json().get("field") not in fields:
            raise


@schemathesis.check
def invalid_data_refused(ctx: Any, response: Any, case: Any) -> None:
    """Check ``negative_data_rejection``, but for undescribed headers, as proxies add them."""
    result = case.meta.phase.data if case.meta is not None else None
    if (
        getattr(result, "scenario", None) is not CoverageScenario.OBJECT_UNEXPECTED_PROPERTIES
        or getattr(result, "parameter_location", None) is not ParameterLocation.HEADER
    ):
        negative_data_rejection(ctx, response, case)
