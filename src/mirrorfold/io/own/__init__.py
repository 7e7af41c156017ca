"""The project's own files: sweeps, images and reconstructions in netCDF-4, and scenes in TOML.

`netcdf` reads and writes; `checks` refuses or mends images and reconstructions that are damaged; `attributes` makes
attributes that netCDF can hold; `steady` survives a full disk; `frame_folder` keeps the frames of a recording that is
not finished; `scene_files` writes scenes.
"""
