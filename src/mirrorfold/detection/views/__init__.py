"""What the radar sees: amplitude along straight lines of sight.

`view` is the interface that all steps use; `image_view` implements it for an image, and `volume_view` for a raster
volume. `image_to_view` makes the view of an image, whose samples `resampling` computes from the pixels. `spectra`
computes the spectrum of an echo from the complex image or volume, `image_lobes` bounds the side lobes of echoes.
"""
