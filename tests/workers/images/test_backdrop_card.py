"""The card behind glass: no side of it is like another."""

import numpy as np

from bentray_workers.images.backdrop_card import COLOURS, backdrop_card


def test_every_turn_and_mirror_image_differs():
    card = backdrop_card()
    assert (card.shape, card.dtype) == ((1024, 1024, 3), np.uint8)
    turned = [np.rot90(one, k) for one in (card, card[::-1]) for k in range(4)]
    assert all((card != other).any() for other in turned[1:])


def test_it_has_every_colour_and_words():
    card = backdrop_card()
    for colour in COLOURS:
        assert (card == colour).all(axis=-1).sum() > 5000
    words = card[360:470, 260:760].mean(axis=(1, 2))
    assert words.min() < card[20:30, 260:760].mean() - 20
