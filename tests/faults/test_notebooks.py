"""A sweep in a cell of a notebook is interrupted, and its kernel is killed."""

from contextlib import contextmanager

import psutil
import pytest
from common.commands import until, workers_of
from common.places import SWEPT

pytestmark = [pytest.mark.faults, pytest.mark.filterwarnings("ignore")]  # of the server of notebooks

#: Longest wait (s) for an answer, on a busy machine too.
LONG = 90.0
SWEEP = """
from vibroplat import load_config, sweep
scene = load_config("c.yaml")
def told(points, known):
    if points == 3:
        open("running", "w").close()
table = sweep(scene, jobs=2, progress=told).sweep
"""
BITS = "print(table.drop(columns='wall_s').to_csv())"


@contextmanager
def kernel(place):
    manager = pytest.importorskip("jupyter_client", reason="pip install '.[test]'").KernelManager()
    manager.start_kernel(cwd=str(place))
    client = manager.client()
    client.start_channels()
    try:
        client.wait_for_ready(timeout=LONG)
        yield manager, client
    finally:
        client.stop_channels()
        manager.shutdown_kernel(now=True)


def test_sweep_in_a_cell_is_interrupted_and_repeated_and_no_worker_outlives_a_killed_kernel(here, kernels):
    (here / "c.yaml").write_text(SWEPT)
    with kernel(here) as (manager, client):
        printed = []

        def cell(code):
            def take(message):
                printed.append(message["content"].get("text", ""))

            reply = client.execute_interactive(code, timeout=LONG, output_hook=take)["content"]
            return reply.get("ename", reply["status"])

        asked = client.execute(SWEEP)
        until((here / "running").exists, LONG)
        manager.interrupt_kernel()
        reply = client.get_shell_msg(timeout=LONG)
        while reply["parent_header"]["msg_id"] != asked:  # one asked twice whether it is ready says so twice
            reply = client.get_shell_msg(timeout=LONG)
        assert reply["content"]["ename"] == "KeyboardInterrupt"
        assert (cell(SWEEP), cell(BITS)) == ("ok", "ok")
        assert (cell("table = sweep(scene).sweep"), cell(BITS)) == ("ok", "ok")
        tables = [text for text in printed if text.startswith(",supply")]
        assert tables[0] == tables[1]
        (here / "running").unlink()
        client.execute(SWEEP)
        until((here / "running").exists, LONG)
        workers = workers_of(manager.provisioner.pid)
        assert workers
        psutil.Process(manager.provisioner.pid).kill()
        _, alive = psutil.wait_procs(workers, timeout=LONG)
        assert alive == []
