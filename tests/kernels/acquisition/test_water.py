"""Speed of sound in water: published values, and back again."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bentray_kernels.acquisition import speed_from_temperature, temperature_from_speed
from bentray_kernels.acquisition.water import APERTURE, THERMOMETER_C, stated_deviation
from bentray_kernels.errors import InvalidInput


# Del Grosso and Mader, J. Acoust. Soc. Am. 52 (1972) 1442, which Marczak's fit follows to 0.02 m/s.
@pytest.mark.parametrize(
    ("temperature", "speed"),
    [(0.0, 1402.388), (20.0, 1482.343), (25.0, 1496.687), (40.0, 1528.863), (74.0, 1555.147)],
)
def test_the_published_speeds(temperature, speed):
    assert speed_from_temperature(temperature) == pytest.approx(speed, abs=0.05)


@given(st.floats(0.0, 73.0))
def test_the_inverse_gives_the_temperature_back(temperature):
    assert temperature_from_speed(speed_from_temperature(temperature)) == pytest.approx(temperature, abs=1e-6)


@pytest.mark.parametrize("temperature", [-1.0, 96.0, float("nan")])
def test_a_temperature_outside_the_fit_is_rejected(temperature):
    with pytest.raises(InvalidInput, match="water@temperature_c"):
        speed_from_temperature(temperature)


@pytest.mark.parametrize("speed", [1375.0, 1600.0, float("nan")])
def test_a_speed_that_water_does_not_have_is_rejected(speed):
    with pytest.raises(InvalidInput, match="water@sound_speed_mps"):
        temperature_from_speed(speed)


@pytest.mark.parametrize("temperature", [0.6, 20.0, 60.0, 94.4])
def test_a_stated_speed_is_off_by_a_degree_at_its_temperature_and_by_the_size_of_the_array(temperature):
    """At 60 °C a degree changes the speed by a third of what it does at 20 °C."""
    rise = 50.0 * (speed_from_temperature(temperature + 0.01) - speed_from_temperature(temperature - 0.01))
    expected = ((THERMOMETER_C * rise) ** 2 + (APERTURE * 1500.0) ** 2) ** 0.5
    assert stated_deviation(1500.0, temperature) == pytest.approx(expected, rel=1e-3)


@pytest.mark.parametrize("temperature", [None, 0.2, 94.8, 120.0])
def test_without_a_temperature_of_water_the_rise_is_the_usual_one(temperature):
    assert stated_deviation(1000.0, temperature) == pytest.approx(13.0**0.5)
