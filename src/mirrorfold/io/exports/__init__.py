"""Results for other programs: `results` chooses by the suffix and writes.

`clouds` makes points (PLY, PCD, VTP, CSV, XYZ), `vtk` pictures, volumes and walls (VTI, VTS, VTP), `scan_folder` a
folder of Touchstone files; floor plans (DXF, GeoJSON) are read and written by `mirrorfold.io.plans`. A new format of
points is a function in `clouds.WRITERS`.
"""
