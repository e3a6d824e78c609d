"""Cases of a comparison on workers of Dask, one of which is killed."""

import os
import signal
import threading
import time

import pytest

import kerrlight

def test_exact_a_killed_worker_loses_no_case(tmp_path, monkeypatch):
    distributed = pytest.importorskip("distributed", reason="DASK IS NOT TESTED: pip install dask distributed")
    monkeypatch.chdir(tmp_path)
    options = dict(quick=True, seeds=4, only={"scene": 1}, progress=False, threads=1)
    with distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster:
        with distributed.Client(cluster) as client:

            def kill():
                while not list((tmp_path / "out").glob("cases/*.lock")):
                    time.sleep(0.01)
                os.kill(next(iter(client.run(os.getpid).values())), signal.SIGKILL)

            killer = threading.Thread(target=kill)
            killer.start()
            together = kerrlight.compare("representations", "out", client=client, **options)
            killer.join()
    alone = kerrlight.compare("representations", "alone", **options)
    assert len(together.rows()) == len(alone.rows())
    for volume in sorted((tmp_path / "alone").glob("cases/*/volume.npz")):
        other = tmp_path / "out" / volume.relative_to(tmp_path / "alone")
        assert volume.read_bytes() == other.read_bytes()
