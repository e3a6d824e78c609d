"""Reads emission.vti of the report's test with VTK and compares it with the closed form of its spots.

    KERRLIGHT_REPORT=FOLDER cargo test --release -p kerrlight report
    pip install vtk numpy
    python tests/reference/read_vti.py FOLDER/emission.vti
"""

import sys

import numpy as np
import vtk
from vtk.util.numpy_support import vtk_to_numpy

AXIS = np.array([0.5, 0.0, -np.sqrt(0.75)])
START = np.array([3.5 * np.sqrt(0.75), 0.0, 1.75])


def spots(places, sigma, peak):
    light = 0.0
    for phase in (60, 75, 105, 0):
        angle = -2 * np.pi * phase / 127
        centre = START * np.cos(angle) + np.cross(AXIS, START) * np.sin(angle)
        light = light + peak * np.exp(-((places - centre) ** 2).sum(-1) / (2 * sigma**2))
    return light


reader = vtk.vtkXMLImageDataReader()
reader.SetFileName(sys.argv[1])
reader.Update()
image = reader.GetOutput()
places = np.array([image.GetPoint(k) for k in range(image.GetNumberOfPoints())])
print("nodes", image.GetDimensions(), "bounds", image.GetBounds())
for name, sigma, peak in (("emission", 0.5, 0.8), ("emission_truth", 0.4, 1.0)):
    array = image.GetPointData().GetArray(name)
    error = np.abs(vtk_to_numpy(array) - spots(places, sigma, peak)).max()
    print(name, array.GetDataTypeAsString(), "largest difference", error)
    assert error < 1e-6
