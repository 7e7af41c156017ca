"""Sweeps of two arrays whose samples are in another order than the positions of the antennas.

A stage that ran the other way, one that turned around at the end of each row, or a list of pairs that was folded into
an array by rows in place of columns: echoes then add up in phase in no direction, but they do once the samples are put
into the order in which they were measured. The direct waves between the antennas would mislead: their length depends
on the distance ``|x_i - x_k|``, as that of an echo from the side does if one stage is reversed. So nothing is claimed
where direct waves hold much of the power.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from mirrorfold.diagnosis.findings import Finding
from mirrorfold.diagnosis.wavefronts import (
    FEWEST_GATES,
    GATES,
    IN_PHASE,
    PAIRS,
    Wavefronts,
    in_phase,
    wavefronts,
)
from mirrorfold.sweep.pairs import Pairs

CLEARER = 2.0
"""How many times more coherent echoes must be in the other order. In the right one they were at least 2.7 times more
coherent than with every other row reversed, which leaves half of the pairs in order, and 15 times more than with all
rows reversed."""

LEAST_SHARE = 0.25
"""Smallest share of the power of an echo that must add up in phase in the other order. Single flat faces ahead of the
array are symmetric, and reach half of this in a wrong order; direct waves reach a third."""

IN_ORDER = 0.3
"""Share of the power of an echo that adds up in phase above which no other order is tried: with every other row
reversed, half of the pairs are in order, and a quarter of the power adds up."""

DIRECT_SHARE = 0.1
"""Largest share of the power in direct waves between the antennas at which echoes decide."""

FEWEST = 8
"""Smallest number of transmitters, and of receivers, whose order is judged."""

SURE = 0.97
"""Certainty of a finding: hundreds of pairs add up in phase only in the right order, not by chance."""

Index = NDArray[np.int64]


def order_findings(pairs: Pairs, waves: Wavefronts) -> list[Finding]:
    """The finding that the samples are in another order than the antennas; empty where no other order fits.

    Parameters
    ----------
    pairs : Pairs
        All pairs of two arrays along one line.
    waves : Wavefronts
        In the order as it is.
    """
    shape = len(pairs.tx), len(pairs.rx)
    if min(shape) < FEWEST or pairs.tx_of.size != shape[0] * shape[1] or in_phase(waves) > IN_ORDER * waves.pairs:
        return []
    if _direct_share(pairs) > DIRECT_SHARE:
        return []

    def coherent(name: str, gates: int) -> float:
        tx_of, rx_of = _ORDERS[name](pairs.tx_of, pairs.rx_of, *shape)
        other = wavefronts(replace(pairs, tx_of=tx_of, rx_of=rx_of), exchange=False, gates=gates)
        return 0.0 if other is None else in_phase(other)

    # The strongest echoes tell which order may be right, in a tenth of the time that all echoes take.
    least = max(IN_PHASE, LEAST_SHARE * waves.pairs, CLEARER * in_phase(waves))
    first = {name: coherent(name, FEWEST_GATES) for name in _ORDERS}
    best = max(first, key=first.__getitem__)
    if first[best] < least or coherent(best, GATES) < least:
        return []
    what, remedy = _WHAT[best]
    return [Finding("positions-reversed" if "reversed" in best else "samples-unordered", what, SURE, remedy, False)]


def _direct_share(pairs: Pairs) -> float:
    """Share of the power in waves that go straight from antenna to antenna, whatever the length of the cables.

    Their delays are known but for that length, so that all pairs are in phase once the distances are removed.
    """
    some = np.random.default_rng(0).permutation(pairs.tx_of.size)[: PAIRS[1]]
    apart = np.linalg.norm(pairs.tx[pairs.tx_of[some]] - pairs.rx[pairs.rx_of[some]], axis=1)
    aligned = np.fft.ifft(pairs.s[:, some] * np.exp(1j * np.outer(pairs.wavenumber, apart)), axis=0)
    total = float(np.sum(np.abs(aligned) ** 2))
    return float(np.sum(np.abs(aligned.sum(axis=1)) ** 2)) / aligned.shape[1] / total if total > 0.0 else 0.0


def _reversed_rx(tx_of: Index, rx_of: Index, tx: int, rx: int) -> tuple[Index, Index]:
    return tx_of, rx - 1 - rx_of


def _reversed_tx(tx_of: Index, rx_of: Index, tx: int, rx: int) -> tuple[Index, Index]:
    return tx - 1 - tx_of, rx_of


def _to_and_fro(tx_of: Index, rx_of: Index, tx: int, rx: int) -> tuple[Index, Index]:
    return tx_of, np.where(tx_of % 2 == 0, rx_of, rx - 1 - rx_of)


def _by_columns(tx_of: Index, rx_of: Index, tx: int, rx: int) -> tuple[Index, Index]:
    number = tx_of * rx + rx_of
    return number % tx, number // tx


_ORDERS: dict[str, Callable[[Index, Index, int, int], tuple[Index, Index]]] = {
    "reversed rx": _reversed_rx,
    "reversed tx": _reversed_tx,
    "to and fro": _to_and_fro,
    "by columns": _by_columns,
}
"""Indices of transmitter and receiver of each sample in another order, from those in the order as it is."""

_SIDE = (
    "Echoes add up in phase only with the {0} in the opposite order: the positions of the {0} are reversed, or those "
    "of the {1} are, which makes the same image, left and right exchanged."
)

_WHAT = {
    "reversed rx": (_SIDE.format("receivers", "transmitters"), "import the sweep again with these positions reversed"),
    "reversed tx": (_SIDE.format("transmitters", "receivers"), "import the sweep again with these positions reversed"),
    "to and fro": (
        "Echoes add up in phase only with every other row of receivers in the opposite order: the stage measured on "
        "its way back, too.",
        "reverse the samples of every other transmitter along the receivers, and import them again",
    ),
    "by columns": (
        "Echoes add up in phase only if the pairs are counted by transmitters first: the list of pairs was folded into "
        "an array by rows in place of columns.",
        "fold the list with transmitters running fastest (order='F'), and import it again",
    ),
}
"""The sentence and the advice of a finding, by the order that fits."""
