"""Wide vectors and reused memory leave gradients as they are."""

import llvmlite.binding as llvm
import numpy as np
import pytest
from numba import njit

from bentray_kernels.wave import adjoint
from bentray_kernels.wave.vector_width import use_widest_vectors

from .emissions_scan import EMITTERS, RECEIVERS, WAVELET, medium


def test_loops_take_512_bits_where_the_processor_has_them():
    if not llvm.get_host_cpu_features().get("avx512f"):
        pytest.skip("the processor has no vectors of 512 bits")

    @njit
    def add(into, other):
        use_widest_vectors()
        for k in range(into.shape[0]):
            into[k] += other[k]

    numbers = np.arange(3, dtype=np.float32)
    add(numbers, np.ones_like(numbers))
    assert numbers.tolist() == [1.0, 2.0, 3.0]
    assert "zmm" in next(iter(add.inspect_asm().values()))


def test_a_gradient_does_not_depend_on_the_one_before_it():
    def gradient(emitter, misfit):
        # Each emitter has its own cone: where it stores nothing, the fields of the other one are left.
        until = np.full(len(RECEIVERS), 120)
        gradients = adjoint.misfit_gradient(medium(), emitter, RECEIVERS, WAVELET, misfit, 4, until=until)
        return gradients.gradient.tobytes(), gradients.illumination.tobytes()

    def energy(traces):
        return float((traces**2).sum()), traces

    def nested(traces):
        gradient(EMITTERS[1], energy)
        return energy(traces)

    adjoint._kept.fields = None
    fresh = gradient(EMITTERS[0], energy)
    gradient(EMITTERS[1], energy)
    kept = adjoint._kept.fields
    assert gradient(EMITTERS[0], energy) == fresh
    assert adjoint._kept.fields is kept
    assert gradient(EMITTERS[0], nested) == fresh
