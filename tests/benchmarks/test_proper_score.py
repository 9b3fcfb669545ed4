"""The score of standard deviations is that of the textbook, and the best constant is the least."""

import numpy as np
import pytest
from benchmarks.uncertainty._judged_image import Judged
from benchmarks.uncertainty._proper_score import OF_KNOWN_ERROR, best_constant, score, score_rows
from scipy.integrate import quad
from scipy.stats import norm


@pytest.mark.parametrize(("error", "deviation"), [(0.0, 1.0), (3.0, 2.0), (-5.0, 0.7)])
def test_the_score_is_the_integral_of_the_squared_difference_of_distributions(error, deviation):
    below, _ = quad(lambda x: norm.cdf(x, scale=deviation) ** 2, -40.0, error)
    above, _ = quad(lambda x: norm.sf(x, scale=deviation) ** 2, error, 40.0)
    assert score(np.array([error]), np.array([deviation])) == pytest.approx([below + above], rel=1e-5)
    assert score(np.ones(3), OF_KNOWN_ERROR * np.array([0.97, 1.0, 1.03])).argmin() == 1


def test_rows_reward_deviations_that_follow_the_errors_and_bound_the_coverage_on_both_sides():
    true = np.where(np.arange(20_000) % 3, 1.0, 30.0)
    error, breast = true * np.random.default_rng(1).standard_normal(true.size), true > 5.0

    def values(deviation):
        image = Judged("0: ring", None, error, deviation, breast, 0.0, 0.0)
        rows = list(score_rows([image], "one scan"))
        return [row.value for row in rows], [row.met for row in rows]

    (follows, covered, *_, in_breast), met = values(true)
    assert follows < 0.8
    assert covered == pytest.approx(0.954, abs=0.01)
    assert in_breast == pytest.approx(1.0, abs=0.01)
    assert met == [True, True, True, False]
    assert best_constant(error[breast])[0] == pytest.approx(30.0, rel=0.03)
    assert [values(times * true)[1][1:3] for times in (3.0, 0.3)] == [[True, False], [False, True]]
