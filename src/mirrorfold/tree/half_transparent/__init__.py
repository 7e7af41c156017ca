"""Walls that let a part of the waves pass: which echoes behind them were reflected, and which passed through.

* `transparent` sorts the echoes behind a wall, where two polarizations were measured.
* `guessed` sorts them by geometry, where only one was measured.
* `panes` tells the permittivity and thickness of a wall, from the ratio of both polarizations.
* `wall_glints` tells them more sharply, from glints, whose whole spectrum bears the wall.
"""
