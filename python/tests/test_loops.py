"""Many renders, several threads, interruptions, and arrays that change meanwhile."""

import os
import resource
import signal
import subprocess
import sys
import textwrap
import threading
import time

import numpy as np
import pytest

import spherule


@pytest.mark.skipif(not os.path.exists("/proc/self/statm"), reason="measures memory as Linux shows it")
def test_memory_stays_flat_over_many_renders(ball):
    count = int(os.environ.get("SPHERULE_RENDERS", "200"))
    resident = []
    for _ in range(count):
        image = spherule.render(ball, radius=0.2, size=(96, 54), samples=1, channels=["Z", "N", "P"], threads=2)
        image.to_exr()
        with open("/proc/self/statm") as statm:
            resident.append(int(statm.read().split()[1]) * resource.getpagesize())
    # Threads come and go, so that single values differ by some MiB. A leak raises the lowest ones as well; one of each
    # picture would be 96 * 54 * 44 bytes or more, and half of that is too much.
    quarter = count // 4
    grown = min(resident[-quarter:]) - min(resident[quarter : 2 * quarter])
    assert grown < 2 * quarter * 96 * 54 * 22


def test_threads_render_at_the_same_time(ball, small):
    expected = spherule.render(ball, radius=0.3, **small).to_exr()
    results, ticks = [], 0
    work = lambda: results.append(spherule.render(ball, radius=0.3, **small).to_exr())
    threads = [threading.Thread(target=work) for _ in range(4)]
    for thread in threads:
        thread.start()
    while any(thread.is_alive() for thread in threads):
        ticks += 1
        time.sleep(0.001)
    assert results == [expected] * 4 and ticks > 0


def test_arrays_that_change_meanwhile_never_crash(small):
    array = np.random.default_rng(1).random((200_000, 3), dtype=np.float32)
    ended = threading.Event()

    def change():
        while not ended.is_set():
            array[::7] = np.nan
            array[::7] = 0.5

    thread = threading.Thread(target=change)
    thread.start()
    try:
        for _ in range(3):
            try:
                spherule.render(array, radius=0.01, **small)
            except spherule.Error:
                pass
    finally:
        ended.set()
        thread.join()


def test_arrays_that_nobody_else_holds_live_as_long_as_the_render(small):
    spherule.render(np.random.default_rng(1).random((50_000, 3), dtype=np.float32), radius=0.01, **small)


@pytest.mark.skipif(os.name == "nt", reason="sends a signal of Unix")
def test_ctrl_c_stops_a_render():
    code = textwrap.dedent(
        """
        import numpy, signal, spherule
        # Programs that were started in the background of a script ignore the signal
        signal.signal(signal.SIGINT, signal.default_int_handler)
        print("started", flush=True)
        positions = numpy.random.default_rng(1).random((1000, 3), dtype="float32")
        spherule.render(positions, radius=0.02, size=(3840, 2160), samples=4096)
        """
    )
    process = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    assert process.stdout.readline() == b"started\n"
    time.sleep(1)
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=60)
    assert b"KeyboardInterrupt" in errors and process.returncode != 0


def test_a_forked_child_can_render(ball, small):
    expected = spherule.render(ball, radius=0.3, **small).to_exr()
    child = os.fork()
    if child == 0:
        os._exit(0 if spherule.render(ball, radius=0.3, **small).to_exr() == expected else 1)
    assert os.waitpid(child, 0)[1] == 0
