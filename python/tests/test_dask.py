"""Cases of a comparison on workers of Dask, one of which is killed."""

import os
import signal
import threading
import time
from pathlib import Path

import pytest

import kerrlight

FIT = Path(__file__).resolve().parents[2] / "scenes/fits/scene_1.toml"
EXPERIMENT = f"""
title = "Seeds"
question = "Which?"
seeds = 4
fit = "{FIT}"
[set]
screen.pixels = 6
screen.width = 30.0
region.r_min = 3.0
region.r_max = 4.2
simulation.movie.frames = 2
output.nodes = 6
representation = {{ kind = "grid", grid.nodes = 6 }}
region.nodes = {{ equal-mino-time = {{ per_ray = 8 }} }}
training = {{ steps = 2000, log_every = 10, start = "drawn", checkpoint_seconds = 0.1 }}
"""


def test_exact_a_killed_worker_loses_no_case(tmp_path, monkeypatch):
    distributed = pytest.importorskip("distributed", reason="DASK IS NOT TESTED: pip install dask distributed")
    monkeypatch.chdir(tmp_path)
    (tmp_path / "seeds.toml").write_text(EXPERIMENT)
    experiment, killed = Path("seeds.toml"), []
    with distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster:
        with distributed.Client(cluster) as client:

            def kill():
                # In the middle of a case, which has begun and has no report.
                while not list((tmp_path / "out").glob("cases/*/log.jsonl")):
                    time.sleep(0.01)
                killed.append(next(iter(client.run(os.getpid).values())))
                os.kill(killed[0], signal.SIGKILL)

            killer = threading.Thread(target=kill)
            killer.start()
            together = kerrlight.compare(experiment, "out", client=client, progress=False, threads=1)
            killer.join()
            assert killed[0] not in client.run(os.getpid).values()
    alone = kerrlight.compare(experiment, "alone", progress=False, threads=1)
    assert [row["status"] for row in together.rows()] == ["done"] * 4
    assert [row["seed"] for row in together.rows()] == [row["seed"] for row in alone.rows()]
    for volume in sorted((tmp_path / "alone").glob("cases/*/volume.npz")):
        other = tmp_path / "out" / volume.relative_to(tmp_path / "alone")
        assert volume.read_bytes() == other.read_bytes()
