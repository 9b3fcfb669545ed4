"""/v1/datasets: upload, list, download, examine, name, correct and delete scans."""

from functools import partial
from typing import Annotated, Any, Literal
from urllib.parse import urlencode

from fastapi import APIRouter, Body, Depends, Query, Response, status
from fastapi.openapi.models import Example
from pydantic import Field
from starlette.concurrency import run_in_threadpool

from bentray_kernels.requests.limits import FREQUENCY_HZ, SPEED_MPS, TEMPERATURE_C
from bentray_kernels.requests.names import DEFAULT_PICKER, PickerName
from bentray_workers.files.dataset.copy import Correction
from bentray_workers.foreign_scans.scan_metadata import FIELDS, UNITS
from bentray_workers.reconstruction.scan_views import THUMBNAIL_PX

from ..ingest.canonical import add_corrected
from ..rows.ids import new_id
from ..rows.stored_tables import RequestKey
from ..rows.tables import DatasetRow
from ..web.errors import problems
from ..wiring import Context, RequestContext
from .bodies import IdempotencyKey, Limit, SmallBody, accept_media_types, accept_upload, answer_made
from .downloads import download, download_of
from .models.job_records import DatasetList, DatasetRecord
from .models.name_changes import TEXT, DatasetChanges, ScanCorrection
from .models.quality_records import EmissionRecord, GeometryRecord, QualityRecord
from .pictures import PICTURE, check_render_rate, picture, while_connected
from .record_conversion import dataset_record
from .uploads.one_shot_uploads import body_of, receive_upload, run_in_turn
from .uploads.upload_metadata import scan_metadata

HDF5 = "application/x-hdf5"
MEDIA_TYPES = (HDF5, "application/octet-stream")
NONE: list[str] = []
# Only described to FastAPI: the errors of ``ScanMetadata`` name the accepted values.
PAIR = "^(" + "|".join(FIELDS) + ")=[A-Za-z][A-Za-z0-9_]{0,60}$"
UNIT = "^(" + "|".join(UNITS) + ")$"
JSON = [Depends(accept_media_types("application/json"))]
NAMES: dict[str, Example] = {
    "named": {"value": {"title": "Left breast", "notes": "Second visit.", "water_temperature_c": 31.2}}
}
CORRECTIONS: dict[str, Example] = {
    "times": {
        "summary": "Milliseconds were read as microseconds",
        "value": {"times_in": "ms", "times_read_as": "us"},
    },
    "positions": {
        "summary": "Millimetres were read as centimetres; another frequency",
        "value": {"positions_in": "mm", "positions_read_as": "cm", "frequency_hz": 500000},
    },
}

router = APIRouter(prefix="/v1/datasets", tags=["datasets"])
changes_router = APIRouter(prefix="/v1/datasets", tags=["datasets"], route_class=SmallBody)


@router.post(
    "",
    status_code=status.HTTP_201_CREATED,
    dependencies=[Depends(accept_upload(*MEDIA_TYPES))],
    openapi_extra=body_of("dataset", MEDIA_TYPES),
    responses=problems(413, 415, 422, 503, 507),
)
async def upload_dataset(
    response: Response,
    context: Context,
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
    row = await receive_upload(context, context.stores.datasets, given)
    context.background.pictures.examine(row)
    record = dataset_record(row)
    response.headers["Location"] = record.links["self"]
    return record


@router.get("", responses=problems(404, 422))
def list_datasets(
    context: Context,
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
    rows = context.stores.datasets.search(context.tenant, limit + 1, before, text)
    shown = [dataset_record(row) for row in rows[:limit]]
    if len(rows) == len(shown):
        return DatasetList(datasets=shown, next=None)
    page = {"limit": limit, "before": shown[-1].id, **({} if text is None else {"text": text})}
    return DatasetList(datasets=shown, next=f"/v1/datasets?{urlencode(page)}")


@router.get("/{dataset_id}", responses=problems(404))
def show_dataset(dataset_id: str, context: Context) -> DatasetRecord:
    """Show one dataset."""
    return dataset_record(context.stores.datasets.get(context.tenant, dataset_id))


@router.head("/{dataset_id}/file", include_in_schema=False)
@router.get(
    "/{dataset_id}/file",
    response_class=Response,
    responses={**download_of(HDF5), **problems(404, 503)},
)
def dataset_file(dataset_id: str, context: Context) -> Response:
    """Download a scan as HDF5 in the upload format.

    Interrupted downloads can be resumed with Range and If-Range.
    """
    row, files = context.stores.datasets.get(context.tenant, dataset_id), context.stores.files
    path = files.store.fetch(files.of(context.tenant).dataset(row.id))
    return download(context.request, path, repr((row.id, row.sha256)), HDF5)


@router.delete("/{dataset_id}", status_code=status.HTTP_204_NO_CONTENT, responses=problems(404, 409, 503))
def delete_dataset(dataset_id: str, context: Context) -> None:
    """Delete a scan with its jobs and their volumes; rejected while an unfinished job needs it."""
    context.delete("dataset", dataset_id)


@router.get(
    "/{dataset_id}/geometry",
    responses=problems(404, 422, 429, 503),
    dependencies=[Depends(check_render_rate)],
)
async def show_geometry(dataset_id: str, context: Context) -> GeometryRecord:
    """Show the elements, the acquisition and the water of a scan, read by a worker."""
    work = context.background.pictures.scan_geometry(await context.dataset(dataset_id))
    return GeometryRecord.model_validate(await while_connected(context.request, work))


@router.get(
    "/{dataset_id}/traces", responses=problems(404, 422, 429, 503), dependencies=[Depends(check_render_rate)]
)
async def show_traces(
    dataset_id: str,
    context: Context,
    emission: Annotated[int, Query(ge=0, description="Index of the emission, from 0.")] = 0,
    slice: Annotated[int, Query(ge=0, description="Index of the slice, from 0.")] = 0,  # noqa: A002
    quantity: Annotated[
        Literal["object", "water"], Query(description="Traces with the object, or of the water shot.")
    ] = "object",
) -> EmissionRecord:
    """Show the traces of one emission, at most 512 receivers and 1024 samples, and their picks."""
    how = {"emission": emission, "index": slice, "what": quantity}
    work = context.background.pictures.emission_traces(await context.dataset(dataset_id), how)
    return EmissionRecord.model_validate(await while_connected(context.request, work))


Picker = Annotated[
    PickerName,
    Query(description="Picker of first arrivals in traces; ignored for scans with travel times."),
]


@router.get(
    "/{dataset_id}/quality",
    responses=problems(404, 422, 429, 503),
    dependencies=[Depends(check_render_rate)],
)
async def show_quality(dataset_id: str, context: Context, picker: Picker = DEFAULT_PICKER) -> QualityRecord:
    """Check the quality of a scan on a worker: faulty elements and times, and the action taken for each."""
    work = context.background.pictures.quality(await context.dataset(dataset_id), picker)
    return QualityRecord.model_validate(await while_connected(context.request, work))


@router.head("/{dataset_id}/quality.png", include_in_schema=False)
@router.get("/{dataset_id}/quality.png", response_class=Response, responses={**PICTURE, **problems(404, 422)})
async def quality_png(dataset_id: str, context: Context, picker: Picker = DEFAULT_PICKER) -> Response:
    """The quality report as an image: gathers with picks, matrix of times, findings."""
    dataset = await context.dataset(dataset_id)
    how = {"picker": picker, "what": "quality", "water_temperature_c": dataset.water_temperature_c}
    draw = partial(context.background.pictures.quality_png, dataset, picker)
    return await picture(context, dataset, how, draw)


@router.head("/{dataset_id}/thumbnail.png", include_in_schema=False)
@router.get("/{dataset_id}/thumbnail.png", response_class=Response, responses=PICTURE)
async def thumbnail_png(dataset_id: str, context: Context) -> Response:
    """A small picture of a scan: its travel times, or the traces of its first emission."""
    dataset = await context.dataset(dataset_id)
    how = {"what": "thumbnail", "size": THUMBNAIL_PX}
    return await picture(context, dataset, how, partial(context.background.pictures.thumbnail, dataset))


@changes_router.patch("/{dataset_id}", dependencies=JSON, responses=problems(400, 404, 413, 415, 422))
def change_dataset(
    dataset_id: str, changes: Annotated[DatasetChanges, Body(openapi_examples=NAMES)], context: Context
) -> DatasetRecord:
    """Change the name, the notes or the stated water of a scan; its file stays as it is."""
    words = {"name": changes.title, "notes": changes.notes}
    given: dict[str, str | float | None] = {k: value for k, value in words.items() if value is not None}
    if "water_temperature_c" in changes.model_fields_set:
        given["water_temperature_c"] = changes.water_temperature_c
    return dataset_record(context.stores.datasets.describe(context.tenant, dataset_id, **given))


@changes_router.post(
    "/{dataset_id}/corrections",
    status_code=status.HTTP_201_CREATED,
    dependencies=JSON,
    responses=problems(400, 404, 409, 413, 415, 422, 503, 507),
)
async def correct_dataset(
    dataset_id: str,
    correction: Annotated[ScanCorrection, Body(openapi_examples=CORRECTIONS)],
    response: Response,
    context: Context,
    idempotency_key: IdempotencyKey = None,
) -> DatasetRecord:
    """Make a corrected copy of a scan whose units, sampling rate or frequency were stated wrongly.

    The copy passes the checks of an upload and is a scan of its own. The scan itself stays as it is, since
    its reconstructions were made of it; delete it when they are no longer needed.
    """
    given = correction.model_dump(exclude_none=True)
    # A correction that changes nothing is rejected before any work.
    Correction(**given)
    key = RequestKey.from_header(idempotency_key, ["correction", dataset_id, given])
    made = await run_in_threadpool(context.stores.datasets.made_by, context.tenant, key)
    if made is None:
        made = await _corrected(await context.dataset(dataset_id), given, key, context)
    record = dataset_record(made)
    answer_made(response, record.links["self"], replayed=made.replayed)
    return record


async def _corrected(
    scan: DatasetRow, given: dict[str, Any], key: RequestKey, context: RequestContext
) -> DatasetRow:
    """The row of a corrected copy, which is made in the ingest queue."""
    copy_id, stores, ingest = new_id("dataset"), context.stores, context.background.ingest
    files, reserve = stores.files.of(scan.tenant), partial(stores.quota.resize, scan.tenant, copy_id)

    def work() -> DatasetRow:
        stores.files.store.fetch(files.dataset(scan.id))
        return add_corrected(scan, given, key, copy_id, stores.datasets, files, ingest.limits, reserve)

    with ingest.upload_limits(scan.tenant):
        async with stores.quota.reserved(scan.tenant, copy_id, scan.bytes):
            return await run_in_turn(context.request, ingest.queue, scan.tenant, work)
