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
    above, _ = quad(lambda x: (1.0 - norm.cdf(x, scale=deviation)) ** 2, error, 40.0)
    assert score(np.array([error]), np.array([deviation])) == pytest.approx([below + above], rel=1e-5)


def test_the_best_constant_of_normal_errors_is_their_deviation():
    error = 7.0 * np.random.default_rng(0).standard_normal(20_000)
    constant, least = best_constant(error)
    assert constant == pytest.approx(7.0, rel=0.02)
    assert least == pytest.approx(7.0 / np.sqrt(np.pi), rel=0.02)
    near = OF_KNOWN_ERROR * np.array([0.97, 1.0, 1.03])
    scores = [score(np.ones(1), np.full(1, size))[0] for size in near]
    assert scores[1] == min(scores)


def test_rows_reward_deviations_that_follow_the_errors_and_bound_the_coverage_on_both_sides():
    random = np.random.default_rng(1)
    true = np.where(np.arange(4000) % 3, 1.0, 30.0)
    error, breast = true * random.standard_normal(4000), true > 5.0

    def rows(deviation):
        judged = [Judged("0: ring", None, error, deviation, breast, 0.0, 0.0)]
        return list(score_rows(judged, "one scan"))

    follows, *_, in_breast = rows(true)
    assert follows.value < 0.8
    assert in_breast.value == pytest.approx(1.0, abs=0.01)
    at_least, at_most = rows(true)[1:3]
    assert at_least.value == at_most.value == pytest.approx(0.954, abs=0.01)
    assert rows(np.full(4000, best_constant(error)[0]))[0].value == pytest.approx(1.0)
    assert [row.met for row in rows(3.0 * true)[1:3]] == [True, False]
    assert [row.met for row in rows(0.3 * true)[1:3]] == [False, True]
