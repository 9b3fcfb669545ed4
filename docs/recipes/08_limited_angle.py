"""Limited angle: an arc instead of a ring
=======================================

An arc has no paths in some directions. Edges parallel to these directions are blurred, however many
elements there are.
"""

# %%
# The scan of a ring, and the same without the elements of one side: their pairs are ``NaN``.

import h5py
import matplotlib.pyplot as plt
import numpy as np

import bentray

ring = bentray.simulate(elements=64, nodes=64, coupling_mps=1375.0)
ring.save("ring.h5")


def arc_of(degrees, target):
    """The scan of the elements within an arc."""
    kept = np.arange(64) < 64 * degrees // 360
    with h5py.File("ring.h5") as source, h5py.File(target, "w") as file:
        source.copy("/", file, name="scan")
        for name in list(file["scan"]):
            file.move(f"scan/{name}", name)
        file.attrs.update(source.attrs)
        delta = file["traveltime/delta_tof_s"]
        delta[...] = np.where(np.logical_and.outer(kept, kept), delta[...], np.nan)
    return bentray.read(target)


figure, axes = plt.subplots(1, 3, figsize=(10, 3.4), layout="constrained", sharey=True)
for ax, degrees in zip(axes, (360, 270, 200), strict=True):
    scan = ring if degrees == 360 else arc_of(degrees, f"arc{degrees}.h5")
    result = bentray.reconstruct(scan, "gauss-newton", nodes=64)
    found = result.compare()
    result.plot(low=1360, high=1570, ax=ax)
    ax.set_title(f"{degrees}°: {found.rms:.0f} m/s rms")
    x, y = 1e3 * scan.position_m[: 64 * degrees // 360].T
    ax.plot(x, y, ".", color="black", markersize=2)
print(f"constant: {np.std(found.other[found.region]):.0f} m/s rms")

# %%
# The result says so itself:

print(result.attributes.get("geometry", "see provenance.geometry of the result"))
