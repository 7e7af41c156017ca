"""From the variables of a file to a sweep, by a mapping that says which variable is what.

`model` is the mapping file, and `strict` tells its mistakes; `shipped/` holds those of well-known data sets, one TOML
each. `quantities` reads the numbers it names, in SI units (`names` knows units by names of variables); `samples` makes
samples over frequency of them, with `spectral` for pulses; `arrangements` places the antennas or beams; `assembly`
calls all of these.
"""
