"""What the experiment on few channels teaches, in words."""

from __future__ import annotations

import xarray as xr


def in_a_word(text: str) -> str:
    """A name in the form that the names of numbers need: without commas and spaces."""
    return text.replace(",", "").replace(" ", "_")


def learnt(data: xr.Dataset, numbers: dict[str, float], iterations: int) -> tuple[str, ...]:
    """What can be learnt, paragraph by paragraph."""
    left = [
        f"{100 * numbers[f'{in_a_word(family)}_unexplained']:.0f} % of the amplitude in the family {family!r}"
        for family in map(str, data["family"].values)
    ]
    paragraphs = [
        "Sparse imaging looks for the fewest reflectivities that explain what was measured: it minimises "
        "|y - A x|^2 / 2 + t |x|_1, with A from pixels to samples (mirrorfold.FocusOperator) and t 60 dB below the "
        f"brightest pixel of A^H y, in {iterations} iterations of FISTA (PyLops). Delay and sum is the "
        "matched filter A^H y of the same measurement, with a Hann taper over frequency. In the second half of the "
        f"iterations the cost still fell by {100 * numbers['cost_still_falls']:.0f} %, in the mean over a scene, "
        "where most: glints tens of decibels above the rest are removed slowly.",
        f"In a sparse image {100 * numbers['pixels_not_zero']:.0f} % of the pixels are not zero, in the mean. Folding "
        "takes the noise from the median of the image, which then says nothing of it, and fits mirrors to ridges as "
        "wide as a resolution cell, which single pixels are not. The image is therefore "
        "restored as radio astronomers restore the components of CLEAN (Hogbom 1974): x predicts the samples of all "
        "channels, measured ones keep their values, and the completed sweep is focused as usual. That is the model "
        "seen with the system's own beam, plus the residual; with all channels it is delay and sum itself. What modes "
        "leave unexplained is added by their matched filter. Besides the image folding is given the samples that were "
        "measured, which tell what left and arrived by different ways; the image that is not restored has none.",
        "How few channels suffice is a matter of where their side lobes lie. Any channels at random spread the side "
        "lobes of a glint evenly over the image, which sparse imaging then removes with the glint. All frequencies of "
        "random elements keep them at the glint's range, all elements at random frequencies in its direction, where "
        "they are higher: a glint is tens of decibels brighter than what is hidden, and is to be removed as exactly.",
        f"No reflectivities explain {' and '.join(left)}, noise apart. Paths that leave and arrive by different ways, "
        "such as those between the legs of a corner, are of this kind, as no point reflector makes them; other causes "
        "were not told apart. This part stays in the residual, with its side lobes. Whoever wants fewer elements or "
        "modes than it allows has to model it.",
    ]
    lost = int((data["full_f_cells"] == 0.0).sum())
    if lost:
        paragraphs.append(
            f"Of {data['full_f_cells'].size} scenes {lost} show nothing even with all channels: to waves of 4 mm these "
            "walls are so smooth that what they scatter is some 40 dB below the glints, and where glints fill many "
            "directions the threshold, which follows the usual brightness of a direction, rises above the walls. Fewer "
            "elements, with wider beams, may lower it again."
        )
    if "unexplained_against_elements_correlation" in numbers:
        paragraphs.append(
            "Over the scenes the share that is unexplained and what sparse imaging loses with few elements have a "
            f"correlation of {numbers['unexplained_against_elements_correlation']:.2f}."
        )
    return tuple(paragraphs)
