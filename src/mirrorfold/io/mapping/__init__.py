"""From the variables of a file to a sweep, by a mapping that tells which variable is what.

`model` declares the mapping file, and `strict` reports mistakes in it; `shipped/` holds mappings of well-known data
sets, one TOML file each. `quantities` reads the numbers that a mapping names, in SI units (`names` tells units from
names of variables). `samples` makes samples over frequency, with `spectral` for pulses. `arrangements` adds the places
of antennas or beams. `assembly` calls all of these.
"""
