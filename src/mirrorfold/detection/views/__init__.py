"""What the radar sees: amplitude along straight lines of sight.

`view` is the interface that all steps use; `image_view` implements it for an image, and `volume_view` for a raster
volume. `resampling` computes the samples of an image view from the pixels of the image. `spectra` computes the spectrum
of an echo from the complex image or volume.
"""
