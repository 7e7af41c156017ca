"""Fast algorithms for whole images. Each is laid out first, so that its cost is known, then planned for many frames.

`line_array` images antennas on or near a line: far pixels in sectors of range by `mirrorfold.focusing.lines`, near ones
by the exact sum. `factorized` images planar, irregular and all other large arrays, and volumes, by factorised
back-projection (Boag, Bresler and Michielssen, IEEE Trans. Image Process. 9, 1573-1582, 2000; Ulander, Hellsten and
Stenstrom, IEEE Trans. Aerosp. Electron. Syst. 39, 760-776, 2003). `bandlimited` samples and interpolates its images;
`sides` holds what it must know of the antennas of a block.
"""
