#!/usr/bin/env python3
"""Visibilities and closure phases of a formula's image, by eht-imaging 1.3.2 (pip install ehtim).

    python3 ehtim_visibilities.py

writes ehtim_visibilities.csv (every 20th visibility of EHT2017, every 150th of ngEHT) and
ehtim_closure_phases.csv (all triangles of EHT2017 at one time, degrees) beside this file.
"""
import os
import re
import tempfile

import ehtim
import numpy as np

HERE = os.path.dirname(os.path.abspath(__file__))
RA, DEC, FREQUENCY, MJD = 17.761121055553343, -29.00784305556, 226191789062.5, 57850
N, FIELD_UAS = 64, 160.0


def arrays():
    """The tables of the Rust source, so that both sides use the same digits."""
    source = open(os.path.join(HERE, "../../vlbi/src/array/built_in.rs")).read()
    source = re.sub(r"\bboth\(([\d.]+)\)", r"[\1, \1]", source)
    number = r"(-?[\d.]+)"
    single = dict(re.findall(r"const (\w+): \[f64; 3\] = \[(.*?)\];", source))
    shared = dict(re.findall(r"const (\w+): Row =\s*\((.*?)\);", source, re.S))
    tables = {}
    for name, key in (("EHT2017", "EHT2017"), ("ngEHT", "NG_EHT")):
        body = re.search(r"const %s: \[Row; \d+\] =\s*\[(.*?)\];\n" % key, source, re.S).group(1)
        for word, value in shared.items():
            body = re.sub(r"(?<![\"\w])%s(?![\"\w])" % word, "(%s)" % value, body)
        for word, value in single.items():
            body = re.sub(r"(?<![\"\w])%s(?![\"\w])" % word, "[%s]" % value, body)
        row = r'"(\w+)",\s*\[%s,\s*%s,\s*%s,?\s*\],\s*\[%s,\s*%s\]' % ((number,) * 5)
        tables[name] = re.findall(row, body)
    assert [len(t) for t in tables.values()] == [8, 23]
    return tables


def image():
    """Jy/pixel; the Rust test has the same formula."""
    row, column = np.mgrid[0:N, 0:N]
    x, y = (column - 31.5) / 31.5, (row - 31.5) / 31.5
    ring = np.exp(-((np.sqrt(x * x + y * y) - 0.4) / 0.1) ** 2)
    return (ring * (1.0 + 0.5 * x - 0.3 * y) + 0.01 * ((7 * row + 3 * column) % 5)) / 150.0


def observe(table):
    with tempfile.NamedTemporaryFile("w", suffix=".txt") as file:
        # SEFDs of both feeds; no rotation of feeds, no leakage.
        file.write("\n".join(" ".join(row) + 7 * " 0" for row in table))
        file.flush()
        array = ehtim.array.load_txt(file.name)
    pixel = FIELD_UAS * ehtim.RADPERUAS / N
    picture = ehtim.image.Image(image(), pixel, RA, DEC, rf=FREQUENCY, mjd=MJD)
    step = 11.5 * 3600 / 128
    empty = array.obsdata(RA, DEC, FREQUENCY, 1.856e9, 60, step, 4.0, 15.5 - 1e-9, mjd=MJD)
    return picture.observe_same_nonoise(empty, ttype="direct")


with open(os.path.join(HERE, "ehtim_visibilities.csv"), "w") as out:
    out.write("array,count,time_utc_h,t1,t2,u,v,re,im,sigma\n")
    for (name, table), every in zip(arrays().items(), (20, 150)):
        observation = observe(table)
        data = observation.data
        for d in data[::every]:
            v = complex(d["vis"])
            numbers = [d["u"], d["v"], v.real, v.imag, d["sigma"]]
            cells = [name, len(data), repr(float(d["time"])), d["t1"], d["t2"]]
            out.write(",".join(map(str, cells + [repr(float(x)) for x in numbers])) + "\n")
        if name == "EHT2017":
            phases = observation.c_phases(count="max")

time = sorted(set(phases["time"]), key=lambda t: abs(t - 12.0))[0]
with open(os.path.join(HERE, "ehtim_closure_phases.csv"), "w") as out:
    out.write("time_utc_h,t1,t2,t3,closure_phase_deg\n")
    for p in phases[phases["time"] == time]:
        out.write(f"{float(p['time'])!r},{p['t1']},{p['t2']},{p['t3']},{float(p['cphase'])!r}\n")
