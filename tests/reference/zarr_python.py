"""Stores as zarr-python writes them, for code_stores_of_zarr_python_are_read: python3 zarr_python.py.

Written with zarr 3 and numpy. `movie` has the codecs that zarr-python takes by default, `shards` several chunks a
file, `blosc` a codec that kerrlight does not read.
"""

from pathlib import Path

import numpy
import zarr

values = numpy.arange(24, dtype="f8").reshape(3, 2, 4) / 8
group = zarr.create_group(Path(__file__).parent / "zarr_python" / "movie.zarr", zarr_format=3, overwrite=True)
group.create_array("movie", data=values, chunks=(2, 2, 3))
whole = (8 * values).astype("i2")
group.create_array("shards", data=whole, chunks=(1, 2, 2), shards=(2, 2, 4))
group.create_array("blosc", data=whole, chunks=(3, 2, 4), compressors=zarr.codecs.BloscCodec())
