"""Ten lines from a scan to an image
=================================

Simulate a scan of a breast phantom, reconstruct it along straight and along bent rays, and compare both
with the phantom.
"""

# %%
# ``bentray.read("scan.h5")`` reads a scan of your own; here one is simulated. A notebook shows it as a
# table.

import bentray

scan = bentray.simulate(elements=64, nodes=64, coupling_mps=1375.0)
scan

# %%
# Two images from the same travel times. On a terminal and in a notebook a progress bar is shown.

straight = bentray.reconstruct(scan, "gauss-newton", rays="straight", nodes=64)
bent = bentray.reconstruct(scan, "gauss-newton", nodes=64)
axes = bent.plot()  # of Matplotlib

# %%
# The phantom is known, so that errors can be stated. The water has the speed of the fat, 1375 m/s, which is
# the easy case: see :doc:`/gallery/05_coupling_speed`.

print(f"straight rays: {straight.compare().rms:.1f} m/s rms")
print(f"bent rays: {bent.compare().rms:.1f} m/s rms")
bent.compare()

# %%
# Save the image for other programs: NIfTI, NRRD, NumPy, MATLAB, VTK, DICOM and more by the suffix.

bent.save("speed.nii.gz")
