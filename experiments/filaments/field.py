#!/usr/bin/env python3
# SPDX-License-Identifier: MIT OR Apache-2.0
"""Filaments: a log-normal random field in a torus about the hole, as a volume that scenes read.

    python field.py          # writes filaments.npz with nothing but Python 3

The logarithm of the emission is 160 plane waves of random phase, sqrt(2/160) times SPREAD each, so that its standard
deviation is SPREAD. Components of the wave vectors are normal with the standard deviation 1/LENGTH, which makes its
covariance exp(-d^2/(2 LENGTH^2)). The torus is exp(-((R - RADIUS)/WIDTH)^2/2 - (z/HEIGHT)^2/2) with R the distance from the
axis; below exp(-12) of its ridge it is dark. Lengths are in M.
"""

import array
import cmath
import math
import random
import struct
import zipfile

NODES, HALF = 48, 9.0
WAVES, SPREAD, LENGTH = 160, 0.96, 1.2
RADIUS, WIDTH, HEIGHT, LEAST = 5.7, 1.1, 0.8, -12.0


def waves():
    """Wave vectors with their phases."""
    random.seed(7)
    vector = lambda: [random.gauss(0, 1 / LENGTH) for _ in range(3)]
    return [(vector(), random.uniform(0, 2 * math.pi)) for _ in range(WAVES)]


def column(at, x, y, along_z):
    """Emission at all z above a point of the plane; `at` has the waves there."""
    envelope = -0.5 * ((math.hypot(x, y) - RADIUS) / WIDTH) ** 2
    for k, z in enumerate(places()):
        torus = envelope - 0.5 * (z / HEIGHT) ** 2
        if envelope <= LEAST or torus < LEAST:
            yield 0.0
        else:
            field = sum((a * b[k]).real for a, b in zip(at, along_z))
            yield math.exp(field + torus)


def places():
    return [-HALF + 2 * HALF * k / (NODES - 1) for k in range(NODES)]


def emission():
    """Emission at the nodes, z fastest."""
    amplitude, drawn = SPREAD * math.sqrt(2 / WAVES), waves()
    along = lambda axis: [[cmath.exp(1j * k[axis] * x) for x in places()] for k, _ in drawn]
    phases, (along_x, along_y, along_z) = [cmath.exp(1j * p) for _, p in drawn], map(along, range(3))
    values = array.array("d")
    for i, x in enumerate(places()):
        for j, y in enumerate(places()):
            at = [amplitude * p * a[i] * b[j] for p, a, b in zip(phases, along_x, along_y)]
            values.extend(column(at, x, y, along_z))
    return values


def npy(shape, values):
    head = repr({"descr": "<f8", "fortran_order": False, "shape": shape})
    head += " " * (-(11 + len(head)) % 64) + "\n"
    return b"\x93NUMPY\x01\x00" + struct.pack("<H", len(head)) + head.encode() + values.tobytes()


with zipfile.ZipFile("filaments.npz", "w") as archive:
    archive.writestr("emission.npy", npy((NODES,) * 3, emission()))
    for name, corner in [("low", [-HALF] * 3), ("high", [HALF] * 3), ("axis", [0.0, 0.0, 1.0])]:
        archive.writestr(name + ".npy", npy((3,), array.array("d", corner)))
