"""Export of results for other programs: `results` chooses the format by the suffix, and writes the file.

`clouds` makes files of points (PLY, PCD, VTP, CSV, XYZ), `vtk` of pictures, volumes and walls (VTI, VTS, VTP),
`scan_folder` a folder of Touchstone files. Floor plans (DXF, GeoJSON) are read and written by `mirrorfold.io.plans`. A
new format of points is a function in `clouds.WRITERS`.
"""
