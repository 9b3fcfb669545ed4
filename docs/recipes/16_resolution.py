"""What can this ring resolve?
===========================

Coverage, residuals and a checkerboard show how much of an image the data support.
"""

# %%
# The same phantom with 24 and with 64 elements, both with a resolution check.

import matplotlib.pyplot as plt
import numpy as np

import bentray

figure, axes = plt.subplots(2, 3, figsize=(10.5, 6.2), layout="constrained", sharex=True, sharey=True)
for row, elements in zip(axes, (24, 64), strict=True):
    scan = bentray.simulate(elements=elements, nodes=64, coupling_mps=1375.0)
    result = bentray.reconstruct(scan, "gauss-newton", nodes=64, resolution_check=True)
    for ax, quantity in zip(row, ("speed", "coverage", "recovery"), strict=True):
        result.plot(quantity, ax=ax)
    inside = result.coverage > 0
    found = result.compare()
    row[0].set_title(f"{elements} elements: {found.rms:.0f} m/s rms")
    print(
        f"{elements} elements: {np.mean(result.recovery[inside]):.0%} of the checkerboard recovered", end=", "
    )
    print(f"residual {1e9 * result.history[-1].residual_rms_s:.0f} ns rms")
print(f"constant: {np.std(found.other[found.region]):.0f} m/s rms")
plt.show()

# %%
# The recovery is near 1 where fields of four nodes are resolved, and near 0 where the rays cannot tell them
# apart. The check assumes perfect data; noise makes it worse.
