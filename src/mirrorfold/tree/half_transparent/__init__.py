"""Half-transparent walls: which echoes behind them were reflected, and which passed through.

* `transparent` sorts the echoes behind a wall, if two polarizations were measured.
* `doubts` states how likely they passed through, if it is not known whether the wall lets waves pass.
* `guessed` sorts them by geometry, if only one was measured.
* `panes` finds the permittivity and thickness of a wall from the ratio of both polarizations.
* `wall_glints` states how likely walls are if echoes are glints, whose whole spectrum is shaped by the wall;
  `wall_posterior` finds the likeliest wall, more precisely, and samples all that are as likely for its errors.
* `misfits` and `glint_likelihoods` are the kernels of these two, which try many walls.
"""
