"""/v1/datasets: upload, list, download, examine and delete scans."""

from __future__ import annotations

from typing import Annotated, Literal
from urllib.parse import urlencode

from fastapi import APIRouter, Depends, Query, Request, Response, status
from pydantic import Field

from bentray_kernels.requests.limits import FREQUENCY_HZ, SPEED_MPS, TEMPERATURE_C
from bentray_kernels.requests.names import DEFAULT_PICKER, PickerName
from bentray_workers.foreign_scans.scan_metadata import FIELDS, UNITS

from ..files.deletion import StoredItem
from ..web.errors import problems
from ..wiring import Access, Background, CallerTenant, FindDataset, Stores
from .bodies import Limit, accept_upload
from .downloads import download, download_of
from .models.job_records import DatasetList, DatasetRecord
from .models.name_changes import TEXT
from .models.quality_records import EmissionRecord, GeometryRecord, QualityRecord
from .pictures import PICTURE, check_render_rate, picture, while_connected
from .record_conversion import dataset_record
from .uploads.one_shot_uploads import body_of, receive_upload
from .uploads.upload_metadata import scan_metadata

HDF5 = "application/x-hdf5"
MEDIA_TYPES = (HDF5, "application/octet-stream")
NONE: list[str] = []
# Only described to FastAPI: the errors of ``ScanMetadata`` name the accepted values.
PAIR = "^(" + "|".join(FIELDS) + ")=[A-Za-z][A-Za-z0-9_]{0,60}$"
UNIT = "^(" + "|".join(UNITS) + ")$"

router = APIRouter(prefix="/v1/datasets", tags=["datasets"])


@router.post(
    "",
    status_code=status.HTTP_201_CREATED,
    dependencies=[Depends(accept_upload(*MEDIA_TYPES))],
    openapi_extra=body_of("dataset", MEDIA_TYPES),
    responses=problems(413, 415, 422, 503, 507),
)
async def upload_dataset(
    request: Request,
    response: Response,
    stores: Stores,
    background: Background,
    access: Access,
    tenant: CallerTenant,
    map: Annotated[  # noqa: A002 - the name of the query parameter
        list[Annotated[str, Field(max_length=300, json_schema_extra={"pattern": PAIR})]],
        Query(
            max_length=40,
            description="Own variables of a MATLAB, HDF5 or NumPy file: FIELD=VARIABLE, as "
            "element_position=pos; once for each.",
        ),
    ] = NONE,
    unit: Annotated[
        list[Annotated[str, Field(max_length=20, json_schema_extra={"pattern": UNIT})]],
        Query(max_length=2, description="Unit of lengths and of times in the file, as mm and us."),
    ] = NONE,
    temperature_c: Annotated[
        float | None,
        Query(ge=TEMPERATURE_C.least, le=TEMPERATURE_C.most, description="Temperature of the water, °C."),
    ] = None,
    sound_speed_mps: Annotated[
        float | None,
        Query(ge=SPEED_MPS.least, le=SPEED_MPS.most, description="Speed of sound in the water, m/s."),
    ] = None,
    frequency_hz: Annotated[
        float | None, Query(ge=FREQUENCY_HZ.least, le=FREQUENCY_HZ.most, description="Centre frequency, Hz.")
    ] = None,
) -> DatasetRecord:
    """Upload a scan. A separate process validates it and stores it in the canonical format.

    The parameters state properties that a file of another program lacks.
    """
    given = scan_metadata(map, unit, temperature_c, sound_speed_mps, frequency_hz)
    row = await receive_upload(request, stores, background, access, tenant, stores.datasets, given)
    background.pictures.examine(row)
    record = dataset_record(row)
    response.headers["Location"] = record.links["self"]
    return record


@router.get("", responses=problems(404, 422))
def list_datasets(
    stores: Stores,
    tenant: CallerTenant,
    limit: Limit = 100,
    before: Annotated[str | None, Query(description="Only datasets older than this one.")] = None,
    text: Annotated[
        str | None,
        Query(
            max_length=200,
            pattern=TEXT,
            description="Only datasets with this text in their id, name, title or notes, in capitals or "
            "small letters.",
        ),
    ] = None,
) -> DatasetList:
    """List datasets, newest first; `next` is the address of the next page."""
    rows = stores.datasets.search(tenant, limit + 1, before, text)
    shown = [dataset_record(row) for row in rows[:limit]]
    if len(rows) == len(shown):
        return DatasetList(datasets=shown, next=None)
    page = {"limit": limit, "before": shown[-1].id, **({} if text is None else {"text": text})}
    return DatasetList(datasets=shown, next=f"/v1/datasets?{urlencode(page)}")


@router.get("/{dataset_id}", responses=problems(404))
def show_dataset(dataset_id: str, stores: Stores, tenant: CallerTenant) -> DatasetRecord:
    """Show one dataset."""
    return dataset_record(stores.datasets.get(tenant, dataset_id))


@router.head("/{dataset_id}/file", include_in_schema=False)
@router.get(
    "/{dataset_id}/file",
    response_class=Response,
    responses={**download_of(HDF5), **problems(404, 503)},
)
def dataset_file(dataset_id: str, request: Request, stores: Stores, tenant: CallerTenant) -> Response:
    """Download a scan as HDF5 in the upload format.

    Interrupted downloads can be resumed with Range and If-Range.
    """
    row = stores.datasets.get(tenant, dataset_id)
    path = stores.files.store.fetch(stores.files.of(tenant).dataset(row.id))
    return download(request, path, repr((row.id, row.sha256)), HDF5)


@router.delete("/{dataset_id}", status_code=status.HTTP_204_NO_CONTENT, responses=problems(404, 409, 503))
def delete_dataset(dataset_id: str, stores: Stores, tenant: CallerTenant) -> None:
    """Delete a scan with its jobs and their volumes; rejected while an unfinished job needs it."""
    stores.deletion.delete(StoredItem(tenant, "dataset", dataset_id))


@router.get(
    "/{dataset_id}/geometry",
    responses=problems(404, 422, 429, 503),
    dependencies=[Depends(check_render_rate)],
)
async def show_geometry(find: FindDataset, request: Request, background: Background) -> GeometryRecord:
    """Show the elements, the acquisition and the water of a scan, read by a worker."""
    dataset = await find()
    work = background.pictures.scan_geometry(dataset)
    return GeometryRecord.model_validate(await while_connected(request, work))


@router.get(
    "/{dataset_id}/traces", responses=problems(404, 422, 429, 503), dependencies=[Depends(check_render_rate)]
)
async def show_traces(
    find: FindDataset,
    request: Request,
    background: Background,
    emission: Annotated[int, Query(ge=0, description="Index of the emission, from 0.")] = 0,
    slice: Annotated[int, Query(ge=0, description="Index of the slice, from 0.")] = 0,  # noqa: A002
    quantity: Annotated[
        Literal["object", "water"], Query(description="Traces with the object, or of the water shot.")
    ] = "object",
) -> EmissionRecord:
    """Show the traces of one emission, at most 512 receivers and 1024 samples, and their picks."""
    dataset = await find()
    how = {"emission": emission, "index": slice, "what": quantity}
    work = background.pictures.emission_traces(dataset, how)
    return EmissionRecord.model_validate(await while_connected(request, work))


Picker = Annotated[
    PickerName,
    Query(description="Picker of first arrivals in traces; ignored for scans with travel times."),
]


@router.get(
    "/{dataset_id}/quality",
    responses=problems(404, 422, 429, 503),
    dependencies=[Depends(check_render_rate)],
)
async def show_quality(
    find: FindDataset,
    request: Request,
    background: Background,
    picker: Picker = DEFAULT_PICKER,
) -> QualityRecord:
    """Check the quality of a scan on a worker: faulty elements and times, and the action taken for each."""
    dataset = await find()
    work = background.pictures.quality(dataset, picker)
    return QualityRecord.model_validate(await while_connected(request, work))


@router.head("/{dataset_id}/quality.png", include_in_schema=False)
@router.get("/{dataset_id}/quality.png", response_class=Response, responses={**PICTURE, **problems(404, 422)})
async def quality_png(
    find: FindDataset,
    request: Request,
    background: Background,
    picker: Picker = DEFAULT_PICKER,
) -> Response:
    """The quality report as an image: gathers with picks, matrix of times, findings."""
    dataset = await find()
    how = {"picker": picker, "what": "quality", "water_temperature_c": dataset.water_temperature_c}
    return await picture(request, dataset, how, lambda: background.pictures.quality_png(dataset, picker))
