"""What the radar sees: amplitude along straight lines of sight.

`view` is the interface that all steps ask, `image_view` an image behind it and `volume_view` a raster volume.
`resampling` looks up pixels for the first; `spectra` tells what the complex image or volume holds at a place.
"""
