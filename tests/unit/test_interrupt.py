"""A signal during a run waits for the end of the step, whatever code it meets."""

from __future__ import annotations

import os
import signal

import pytest

from drillfem.solve.interrupt import Interrupts


def test_a_signal_waits_for_the_check_and_a_second_one_does_not():
    before = signal.getsignal(signal.SIGINT)
    with pytest.raises(KeyboardInterrupt), Interrupts() as interrupts:
        interrupts.check()
        os.kill(os.getpid(), signal.SIGINT)
        reached = True
        interrupts.check()
    assert reached and signal.getsignal(signal.SIGINT) is before
    with pytest.raises(KeyboardInterrupt), Interrupts():
        os.kill(os.getpid(), signal.SIGINT)
        os.kill(os.getpid(), signal.SIGINT)
        raise AssertionError("the second signal must not wait")


@pytest.mark.dolfinx
def test_ctrl_c_inside_a_petsc_callback_leaves_a_folder_that_resumes(tmp_path, monkeypatch):
    """The signal comes from within the residual, below PETSc's C code."""
    import drillfem
    from drillfem.models.rod import Rod

    scene = drillfem.load_scene("vertical-c1-cd4", {"model": "axial-torsional", "time.engine": "petsc"})
    calls, residual = [], Rod.residual

    def interrupted(self, *args):
        calls.append(1)
        if len(calls) == 20:
            os.kill(os.getpid(), signal.SIGINT)
        residual(self, *args)

    monkeypatch.setattr(Rod, "residual", interrupted)
    with pytest.raises(KeyboardInterrupt):
        drillfem.simulate(scene, out=tmp_path / "run", until=0.05)
    stored = drillfem.open_result(tmp_path / "run")
    assert stored.summary["reason"].startswith("interrupted at t = ") and len(stored.history["time"]) > 3
    assert drillfem.resume(tmp_path / "run", until=0.05).summary["converged"]
