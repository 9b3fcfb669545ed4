"""Models of the summary of a reconstruction."""

from typing import Literal

from pydantic import BaseModel, Field

from bentray_workers.files.quantities import QuantityName


class CandidateRecord(BaseModel):
    """A model that auto compared, reconstructed from a part of the pairs."""

    label: str = Field(description="Rays, method and regularisation.")
    held_out_rms_s: float | None = Field(
        description="Rms misfit of the held-out pairs, s; null for full waveforms."
    )
    held_out_mean_s: float | None = Field(
        description="Mean absolute misfit of the held-out pairs, s; null for full waveforms and for older "
        "results."
    )
    training_rms_s: float | None = Field(
        description="Rms misfit of the other pairs, s; null for full waveforms."
    )
    chosen: bool = Field(description="Whether it is the best by rays.")
    shown: bool = Field(description="Whether it is the image of the result.")
    outcome: str = Field(description="The same in words, or one reason why it is not the image.")


class TruthErrors(BaseModel):
    """Errors of the speed against the truth of the scan; null where they do not exist."""

    region: str = Field(description="The nodes that count, or why there are no errors.")
    nodes: int = Field(description="Number of these nodes.")
    rmse_mps: float | None = Field(None, description="Root mean square error, m/s.")
    mean_absolute_error_mps: float | None = Field(None, description="Mean absolute error, m/s.")
    ssim: float | None = Field(
        None,
        description="Structural similarity: windows of 7 by 7 nodes in the region, range of the whole truth.",
    )
    correlation: float | None = Field(None, description="Pearson's correlation coefficient.")
    mean_mps: float | None = Field(None, description="Mean speed of the image in the region, m/s.")
    spread_mps: float | None = Field(None, description="Its standard deviation there, m/s.")
    uncertainty_mps: float | None = Field(
        None, description="Uncertainty of this mean, m/s; null without uncertainty."
    )
    true_mean_mps: float | None = Field(None, description="Mean of the true speed, m/s.")
    true_spread_mps: float | None = Field(None, description="Its standard deviation, m/s.")


class GridRecord(BaseModel):
    """The grid of a quantity."""

    shape: list[int] = Field(description="Nodes per axis.")
    spacing_m: list[float | None] = Field(description="Node spacing per axis, m; null for uneven heights.")
    origin_m: list[float | None] = Field(description="Position of node 0, m.")


class CautionRecord(BaseModel):
    """Something that the reader of a result must know."""

    code: str = Field(
        description="bounds: the image is cut off by the speed bounds; residual: it does not explain the "
        "times; constant: it explains them no better than one speed; noise: they contradict each other; "
        "uncertainty: the standard deviations may be too small; attenuation: its image predicts held-out "
        "amplitudes no better than a constant; settings: settings without effect."
    )
    text: str = Field(description="Sentences with the numbers and what to do.")
    doubtful: bool = Field(description="Whether the image itself is in doubt.")


class SummaryRecord(BaseModel):
    """Contents of a reconstruction, and how its model was chosen."""

    quantities: list[Literal[QuantityName, "truth"]] = Field(
        description="Those that can be shown and downloaded."
    )
    trust: str = Field(description="How far to trust the image: deviation, detail and cautions in one line.")
    resolution_width_m: list[float] = Field(
        description="Standard deviation, m, of the Gaussian that smooths the truth like the image: one for "
        "each slice, or one of a slice or volume; the uncertainty refers to it. Empty without uncertainty."
    )
    cautions: list[CautionRecord] = Field(
        description="What the reader must know, doubts about the image first; empty without a reason."
    )
    grids: dict[str, GridRecord] = Field(
        description="Grids of quantities that are not on the grid of the volume, such as reflection."
    )
    candidates: list[CandidateRecord] = Field(
        description="The chosen one first, full waveforms last; empty unless auto chose."
    )
    criterion: Literal["held_out_rms_s", "held_out_mean_s", ""] = Field(
        description="The misfit of the candidates that decided; empty without candidates."
    )
    misfit_over_noise: float | None = Field(
        description="Where full waveforms are advised, how many times the noise the misfit of held-out data "
        "is; else null."
    )
    reason: str = Field(description="Reason of this choice; empty without candidates.")
    automatic: str = Field(
        description="What was decided automatically, and why; empty for results of earlier versions."
    )
    truth: TruthErrors | None = Field(description="Null for a scan without truth.")
