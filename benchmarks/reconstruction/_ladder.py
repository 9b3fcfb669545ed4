"""The ladder of chapter 6: straight rays, then what each way to propagate in the image gains."""

from ._phantom_scan import PhantomScan, ReconstructionError

FAT_MPS, WATER_MPS = 1375.0, 1500.0

# What the dissertation's ladder of R3 is made of, the worst first.
LADDER = {
    "straight": {"rays": "straight"},
    "fixed": {"eikonal": "hafmm"},
    "FMM data-driven": {"eikonal": "fmm"},
    "HAFMM data-driven": {"eikonal": "hafmm"},
}
# Rungs that the dissertation timed and did not compare.
BESIDE = {
    "FSM": {"eikonal": "fsm"},
    "FIM": {"eikonal": "fim"},
}
THEIRS = {"straight": 25.0, "fixed": 19.0, "FMM data-driven": 10.0, "HAFMM data-driven": 3.0}

# The phantom has flat parts, which ``edge_mps`` states; strength and iterations were chosen on it.
TUNED: dict[str, object] = {
    "method": "gauss-newton",
    "iterations": 12,
    "edge_mps": 7.0,
    "penalty_strength": 1.0,
}


def ladder_step(scan: PhantomScan, name: str) -> ReconstructionError:
    """One rung of R3, with four iterations of SART as the dissertation has."""
    changes: dict[str, object] = {"iterations": 4, **{**LADDER, **BESIDE}[name]}
    if name.endswith("data-driven"):
        changes["speed_range_mps"] = scan.speed_range
    return scan.run(name, **changes)
