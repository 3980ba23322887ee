"""Test that points are measured though workers die, here and on a cluster, and that workers end."""

import json
import os
import signal
import subprocess
import sys
import threading
import time
from concurrent.futures import CancelledError, ThreadPoolExecutor
from dataclasses import replace

import pytest
from fragile import fragile
from paths import ROOT
from sweep_cases import GRID, files

from serpent_twin.errors import SerpentError
from serpent_twin.reservoir.sweep_run import Sweep, sweep
from serpent_twin.runs import cluster, worker_pool
from serpent_twin.runs.processes import processes
from serpent_twin.runs.worker_pool import Pool


def test_jobs_of_a_dead_worker_are_done_again_and_deadly_ones_given_up(tmp_path):
    jobs = [
        ("done", 1),
        ("deadly", 2),
        ("once", str(tmp_path / "x")),
        *(("done", n) for n in range(3, 9)),
    ]
    kept = []
    with processes(2) as pool:
        given_up = worker_pool.execute(
            jobs, fragile, pool, lambda job, result: kept.append((job, result))
        )
    assert given_up == [("deadly", 2)]
    assert sorted(map(str, kept)) == sorted(str((j, j[1])) for j in jobs if j[0] != "deadly")


def test_an_error_of_a_job_is_raised_and_lost_workers_are_said():
    def work(job):
        raise job

    with ThreadPoolExecutor(1) as threads:
        pool = Pool(lambda: threads, lambda: 1)
        with pytest.raises(ZeroDivisionError):
            worker_pool.execute([ZeroDivisionError()], work, pool, lambda job, result: None)
        with pytest.raises(SerpentError, match="workers were lost"):
            worker_pool.execute([CancelledError()], work, pool, lambda job, result: None)


def test_after_an_error_jobs_at_work_are_kept_and_no_further_one_begins():
    began, failed, kept = [], threading.Event(), []

    def work(job):
        began.append(job)
        if job == "bad":
            failed.set()
            raise ZeroDivisionError
        assert failed.wait(10)
        time.sleep(0.1)  # done after the error was taken back

    with ThreadPoolExecutor(2) as threads, pytest.raises(ZeroDivisionError):
        pool = Pool(lambda: threads, lambda: 2)
        worker_pool.execute(["good", "bad", "late"], work, pool, lambda job, _: kept.append(job))
    assert sorted(began) == ["bad", "good"]
    assert kept == ["good"]


def test_processes_end_with_their_parent_at_once():
    script = (
        "import signal\nfrom fragile import fragile\nfrom serpent_twin.runs.processes import processes\n"
        "signal.signal(signal.SIGINT, signal.default_int_handler)  # ignored where tests run behind\n"
        "if __name__ == '__main__':\n"
        "    with processes(1) as pool:\n"
        "        pool.submit(fragile, ('say', 'at work')).result()\n"
        "        pool.submit(fragile, ('sleep', 60)).result()\n"
    )
    for end in (signal.SIGINT, signal.SIGKILL):
        where = {"cwd": ROOT / "tests" / "shared", "stderr": subprocess.DEVNULL}
        with subprocess.Popen([sys.executable, "-c", script], stdout=-1, text=True, **where) as run:
            assert run.stdout and run.stdout.readline() == "at work\n"
            run.send_signal(end)
            run.communicate(timeout=20)  # ends with the last process that may write
            assert run.returncode in (-end, 1)


def wait_until(true, seconds):
    until = time.monotonic() + seconds
    while not true():
        assert time.monotonic() < until, "waited in vain"
        time.sleep(0.05)


def test_a_cluster_that_is_not_there_is_refused_by_a_sentence(tmp_path, monkeypatch):
    monkeypatch.setattr(cluster, "PATIENCE", 1.0)
    config = Sweep(tmp_path / "out", **GRID)
    began = time.monotonic()
    with pytest.raises(
        SerpentError, match=r"No Dask scheduler answered at tcp://127.0.0.1:9 within"
    ):
        sweep(replace(config, cluster="tcp://127.0.0.1:9"))
    assert time.monotonic() - began < 5
    with pytest.raises(SerpentError, match=r"--cluster is here; .* tcp://HOST:8786"):
        sweep(replace(config, cluster="here"))
    assert not config.out.exists()


def test_a_cluster_without_dask_is_refused(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(
        SerpentError, match=r"needs distributed: pip install 'serpent-twin\[cluster\]'"
    ):
        sweep(Sweep(tmp_path / "out", cluster="tcp://127.0.0.1:9", **GRID))


@pytest.mark.slow
def test_a_cluster_that_loses_a_worker_writes_the_same_bytes(tmp_path):
    grid = GRID | {"seeds": (0, 1, 2, 3), "rigid": False}
    here, there = (Sweep(tmp_path / name, workers=2, **grid) for name in ("here", "there"))
    sweep(here)
    started = []
    try:
        address = scheduler(started, tmp_path)
        workers = [worker(started, address, tmp_path) for _ in range(2)]
        killer = threading.Thread(target=kill_at_work, args=(workers[0], there.out))
        killer.start()
        sweep(replace(there, workers=0, cluster=address))
        killer.join()
        assert workers[0].poll() == -signal.SIGKILL and workers[1].poll() is None
    finally:
        for process in reversed(started):
            process.kill()
            process.wait()
    assert files(there.out) == files(here.out)
    assert len(files(there.out)) == 4


def kill_at_work(process, out):
    """Kill a worker when the first point is there and others are in flight."""
    wait_until(lambda: (out / "points").exists() and files(out), 60)
    process.kill()
    process.wait()


def dask(started, folder, *arguments):
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL, "cwd": folder}
    command = [sys.executable, "-m", "distributed.cli." + arguments[0], *arguments[1:]]
    started.append(subprocess.Popen(command, env=os.environ | {"OMP_NUM_THREADS": "1"}, **quiet))
    return started[-1]


def scheduler(started, folder):
    about = folder / "scheduler.json"
    options = (
        "--host",
        "127.0.0.1",
        "--port",
        "0",
        "--no-dashboard",
        "--scheduler-file",
        str(about),
    )
    dask(started, folder, "dask_scheduler", *options)
    wait_until(lambda: about.exists() and about.read_text().endswith("}"), 60)
    return json.loads(about.read_text())["address"]


def worker(started, address, folder):
    return dask(
        started, folder, "dask_worker", address, "--nthreads", "1", "--no-nanny", "--no-dashboard"
    )
