"""The few lines that a design prints."""

from vibroplat.designs.answer import _of_keys


def test_keys_of_one_exciter_have_its_number_and_equal_ones_are_told_once():
    moments = {"exciters.0.static_moment_kg_m": 0.5601, "exciters.1.static_moment_kg_m": 0.5602}
    assert _of_keys(moments | {"body.mass_kg": -1.0}) == ["static_moment_kg_m 0.56 each", "mass_kg −1.0"]
    unlike = {"exciters.1.rated_power_w": 0.4, "exciters.0.rated_power_w": 0.2}
    assert _of_keys(unlike) == ["rated_power_w (2) 0.40", "rated_power_w (1) 0.20"]
