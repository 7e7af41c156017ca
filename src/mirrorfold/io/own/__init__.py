"""The project's own files: sweeps, images and reconstructions in netCDF-4, and scenes in TOML.

`netcdf` reads, checks and writes; `attributes` makes attributes that netCDF can hold; `conforming` refuses or mends
what damaged files put in their place; `steady` survives a full disk; `frame_folder` keeps the frames of an unfinished
recording; `scene_files` writes scenes.
"""
