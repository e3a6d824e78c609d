"""What importing costs and brings, the program as a module, and leaks."""

import importlib.metadata
import subprocess
import sys
import time

import kerrlight


def python(code):
    return subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=120)


def test_import_brings_nothing_else():
    code = "import sys; old = set(sys.modules); import kerrlight; kerrlight.Kerr; print(*(set(sys.modules) - old))"
    tops = {name.split(".")[0] for name in python(code).stdout.split()}
    foreign = {name for name in tops if name not in sys.stdlib_module_names}
    assert "kerrlight" in tops and foreign <= {"kerrlight", "numpy"}, foreign


def test_import_is_quick():
    code = "import time; start = time.perf_counter(); import kerrlight; print(time.perf_counter() - start)"
    seconds = min(float(python(code).stdout) for _ in range(5))
    assert seconds < 0.1, seconds


def test_version_and_names():
    assert importlib.metadata.version("kerrlight") == kerrlight.__version__
    for name in kerrlight.__all__:
        assert getattr(kerrlight, name) is not None and name in dir(kerrlight)
    assert not hasattr(kerrlight, "no_such_name")


def test_program_is_a_module():
    def run(*words):
        command = [sys.executable, "-m", "kerrlight", *words]
        return subprocess.run(command, capture_output=True, text=True, timeout=120)

    assert run("--version").stdout == f"kerrlight {kerrlight.__version__}\n"
    assert run("--help").returncode == 0
    refused = run("critical-curve", "--spin", "2", "--inclination", "60", "--points", "3")
    assert refused.returncode == 2 and "spin = 2 is not allowed" in refused.stderr
    assert run("no-such-verb").returncode == 2


def test_program_ends_at_a_signal(tmp_path):
    import signal

    command = [sys.executable, "-m", "kerrlight", "fit", "-o", str(tmp_path / "run")]
    child = subprocess.Popen(command, stderr=subprocess.PIPE, stdin=subprocess.DEVNULL, text=True)
    deadline = time.monotonic() + 60
    while not (tmp_path / "run").exists() and time.monotonic() < deadline:
        time.sleep(0.05)
    time.sleep(0.5)
    child.send_signal(signal.SIGINT)
    said = child.communicate(timeout=60)[1]
    assert child.returncode == 130, said
