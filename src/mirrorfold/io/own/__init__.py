"""The project's own files: sweeps, images and reconstructions in netCDF-4, and scenes in TOML.

`netcdf` reads and writes files; `checks` refuses or mends damaged images and reconstructions; `attributes` converts
attributes to what netCDF can hold; `steady` survives a full disk; `frame_folder` keeps the frames of an unfinished
recording; `scene_files` writes scenes.
"""
