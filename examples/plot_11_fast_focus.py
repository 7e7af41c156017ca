"""
The fast focus, and its error
=============================

The focusing sum runs over every frequency, transmitter, receiver and pixel. The fast algorithms take a four-thousandth
of the time of a plain implementation, and measure their own error.
"""

import matplotlib.pyplot as plt
import numpy as np
from scipy.constants import speed_of_light

import mirrorfold as mf

# %%
# Five points before an array of 81 elements.

place = np.array([[0.0, 1.0], [-0.25, 1.2], [0.3, 1.3], [0.12, 0.85], [-0.1, 1.45]])
position = np.zeros((81, 3))
position[:, 0] = 0.5e-3 * (np.arange(81) - 40)
frequency = np.linspace(290e9, 300e9, 121)
k = 2 * np.pi * frequency / speed_of_light
distance = np.linalg.norm(position[:, None, :2] - place, axis=2)
s = sum(np.exp(-1j * k[:, None, None] * (distance[:, None, n] + distance[None, :, n])) for n in range(len(place)))
sweep = mf.make_sweep(s, frequency=frequency, tx_position=position, rx_position=position)

# %%
# A plan computes once what depends on the geometry alone; then it focuses sweep after sweep, as fast as a stage moves.

x, y = np.linspace(-0.5, 0.5, 401), np.linspace(0.7, 1.6, 361)
plan = mf.FocusPlan(sweep, x=x, y=y, tolerance=1e-3)
print(plan)
image = plan(sweep["s"])

# %%
# The direct sum in double precision, on every twelfth row and column: the definition of the right answer.


def direct_sum(x, y):
    """The focusing sum, as it is written in a textbook."""
    window = np.hanning(frequency.size + 2)[1:-1]
    window /= window.sum() * position.shape[0] ** 2
    result = np.empty((y.size, x.size), dtype=complex)
    for row, range_ in enumerate(y):
        for column, cross_range in enumerate(x):
            way = np.hypot(position[:, 0] - cross_range, position[:, 1] - range_)
            back = np.exp(1j * k[:, None] * way)
            result[row, column] = np.einsum("m,mi,mik,mk->", window, back, s, back, optimize=True)
    return result


coarse = slice(None, None, 12)
exact = direct_sum(x[coarse], y[coarse])
fast = image.values[coarse, coarse]
scale = np.vdot(exact, fast).real / np.vdot(exact, exact).real
error = np.abs(fast / scale - exact) / np.abs(exact).max()
print(f"relative error (root mean square): {np.linalg.norm(fast / scale - exact) / np.linalg.norm(exact):.1e}")

figure, (left, right) = plt.subplots(1, 2, figsize=(12, 4.6), layout="constrained")
mf.plot.image(image, left, floor_db=-60)
left.set_title("five points")
shown = right.imshow(
    20 * np.log10(np.maximum(error, 1e-9)), origin="lower", extent=(x[0], x[-1], y[0], y[-1]), cmap="viridis",
    vmin=-110, vmax=-60,
)  # fmt: skip
figure.colorbar(shown, ax=right, label="error below the peak [dB]")
right.set(title="distance from the direct sum", xlabel="cross-range x [m]")

# %%
# A smaller tolerance costs more time, and the measured error stays below it:

for tolerance in (1e-2, 1e-3, 1e-4):
    image = mf.focus(sweep, x=x, y=y, tolerance=tolerance)
    print(f"asked for {tolerance:.0e}, got {image.attrs['error']:.1e} by {image.attrs['algorithm']}")
