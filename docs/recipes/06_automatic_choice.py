"""Let the data choose the method
==============================

``auto``, the default, hides a part of the pairs from several candidate models and takes the one that
predicts them best.
"""

# %%
# A scan with noise of 50 ns on each travel time.

import matplotlib.pyplot as plt
import numpy as np

import bentray

scan = bentray.simulate(elements=64, nodes=64, coupling_mps=1420.0, noise_s=5e-8)
result = bentray.reconstruct(scan, nodes=64)
print(result)

# %%
# The candidates, the best first: the misfit of the pairs that the model has not seen, and of those that it
# has.

for trial in result.trials:
    words = ", ".join(f"{key} {value}" for key, value in trial.settings.items())
    print(f"{1e9 * trial.held_out_rms_s:6.0f} ns held out {1e9 * trial.shown_rms_s:6.0f} ns shown   {words}")

# %%
# Was the choice right? For a phantom this can be told: the error of each candidate's image over its
# held-out misfit.

figure, ax = plt.subplots(figsize=(6.4, 3.8), layout="constrained")
for trial in result.trials:
    known = {k: v for k, v in trial.settings.items() if k in ("method", "rays", "penalty_strength")}
    if len(known) < len(trial.settings):
        continue
    method = known.pop("method")
    image = bentray.reconstruct(scan, method, nodes=64, **known)
    label = ", ".join([method, *map(str, known.values())])
    ax.plot(1e9 * trial.held_out_rms_s, image.compare().rms, "o", label=label)
chosen = result.compare()
ax.axhline(chosen.rms, color="grey", linestyle="--", label="auto")
ax.axhline(np.std(chosen.other[chosen.region]), color="black", linestyle=":", label="best constant")
ax.set(xlabel="misfit of held-out pairs (ns rms)", ylabel="error of the image (m/s rms)")
ax.legend(fontsize="small", loc="center left", bbox_to_anchor=(1.0, 0.5))
plt.show()
