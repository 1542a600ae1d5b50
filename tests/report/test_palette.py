"""Entrants can be told apart, also in grey and whatever their number."""

from luenberger.report.palette import COLOURS, TRUTH, faded, styles


def test_every_entrant_has_a_style_of_its_own() -> None:
    names = [f"n{k}" for k in range(2 * len(COLOURS))]
    looks = styles(names)
    assert len({(s.colour, s.dash) for s in looks.values()}) == len(names)
    assert TRUTH not in {s.colour for s in looks.values()}
    # Marks and bars show the colour alone; a comparison of ten entrants is the largest that is drawn.
    assert len({s.colour for s in styles(names[:10]).values()}) == 10


def test_colours_are_dark_enough_on_white() -> None:
    for colour in COLOURS:
        red, green, blue = (int(colour[k : k + 2], 16) / 255 for k in (1, 3, 5))
        # Relative luminance of white is 1; 0.5 leaves a line of 1.4 px visible, yellow has 0.85.
        assert 0.2126 * red**2.2 + 0.7152 * green**2.2 + 0.0722 * blue**2.2 < 0.5


def test_faded() -> None:
    assert faded("#ff0080", 0.25) == "rgba(255,0,128,0.25)"
