"""The focusing sum over all pairs of antennas, for any array; and the measured error of an image.

`direct_sum` adds all terms in float64, at a few pixels: the truth with which `accuracy` compares every image.
`exact_sum` makes whole images in single precision, by looking up the range profile of each pair (`range_tables`, with
the loops of `kernels`): the total focusing method of Holmes, Drinkwater and Wilcox (NDT & E International 38, 701-711,
2005). `pair_sums` computes the sum and its adjoint by matrix products, for `FocusOperator`.
"""
