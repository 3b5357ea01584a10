"""`./run` from outside, with the programs it calls replaced: no network, no root, no Debian is made here."""

from __future__ import annotations

import os
import shutil
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

CHECKOUT = Path(__file__).resolve().parents[2]
REAL = "/usr/local/bin:/usr/bin:/bin:/usr/sbin:/sbin"

# A private Debian of one file. Each call of mmdebstrap is counted; ENTER=slow gives time to collide.
MMDEBSTRAP = """
echo called >>"$STUBS/made"
for part; do case $part in *.part) break ;; esac; done
sleep "${SLOW:-0}"
[ "${BROKEN-}" ] && { echo 'E: no such mirror' >&2; exit 1; }
mkdir -p "$part/etc" "$part/usr"
"""
# No namespace is entered: bash's arguments are -c, script, debian, owner, cwd, PATH, count, mounts, CMD.
UNSHARE = """
while [ "$1" != -- ]; do shift; done
shift
[ "$1" = mount ] && exit "${NO_NAMESPACE:-0}"
shift 3
debian=$1 cwd=$3 count=$5
shift 5
for i in $(seq "$count"); do echo "$1" >>"$STUBS/mounts"; shift; done
[ "$1 $2 $3" = "python3 -m venv" ] && { mkdir -p "$5/bin"; exit; }
[ "$1 $2 $3" = "python3 -m pip" ] && { echo "${PIP_SAYS-}"; exit "${NO_PIP:-0}"; }
cd "$cwd" && exec "$@"
"""


class Outside:
    """A machine without DOLFINx: a cache, and stubs that come first on PATH."""

    def __init__(self, folder: Path) -> None:
        self.cache, self.stubs = folder / "cache", folder / "stubs"
        self.stubs.mkdir()
        self.stub("mmdebstrap", MMDEBSTRAP)
        self.stub("unshare", UNSHARE)
        self.stub("timeout", "exit 1")  # how ./run asks for the network
        self.free_gigabytes(50)
        inside = ("DRILLFEM_", "PYTHONPATH", "NUMBA_CACHE_DIR", "OMP_NUM_THREADS")
        self.env = {k: v for k, v in os.environ.items() if not k.startswith(inside)} | {
            "PATH": f"{self.stubs}:{REAL}",
            "STUBS": str(self.stubs),
            "DRILLFEM_CACHE": str(self.cache),
            "DRILLFEM_WAY": "private",
        }
        for proxy in ("http_proxy", "https_proxy", "HTTP_PROXY", "HTTPS_PROXY"):
            self.env.pop(proxy, None)

    def stub(self, name: str, script: str) -> None:
        path = self.stubs / name
        path.write_text(f"#!/bin/bash\n{script}\n")
        path.chmod(0o755)

    def free_gigabytes(self, number: int) -> None:
        self.stub("df", f"echo head; echo disk 1 1 {number * 1048576} 1% /")

    def start(self, *command: str, checkout: Path = CHECKOUT, **env: str) -> subprocess.Popen[str]:
        return subprocess.Popen(
            [str(checkout / "run"), *command],
            env=self.env | env,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )

    def run(self, *command: str, checkout: Path = CHECKOUT, **env: str) -> tuple[int, str, str]:
        process = self.start(*command, checkout=checkout, **env)
        out, err = process.communicate(timeout=60)
        return process.returncode, out, err

    @property
    def made(self) -> int:
        """How often a private Debian has been made."""
        calls = self.stubs / "made"
        return calls.read_text().count("called") if calls.exists() else 0


@pytest.fixture
def outside(tmp_path: Path) -> Iterator[Outside]:
    if shutil.which("flock", path=REAL) is None:
        pytest.skip("needs flock")
    yield Outside(tmp_path)


def refusal(result: tuple[int, str, str]) -> str:
    """The last line of a set-up that failed with code 3, ran nothing, and wrote but progress before it."""
    code, out, err = result
    *progress, line = err.splitlines()
    assert (code, out) == (3, "")
    assert line.startswith("drillfem: ")
    assert all(text.startswith("drillfem: [") for text in progress)
    return line


def test_first_call_sets_up_and_the_second_only_enters(outside: Outside) -> None:
    code, out, err = outside.run("echo", "a  b", "*")
    assert (code, out) == (0, "a  b *\n")
    assert "private Debian 13" in err and err.splitlines()[-1].endswith("ready")
    assert outside.run("echo", "again") == (0, "again\n", "")
    assert outside.made == 1


def test_exit_code_environment_and_folder_pass(outside: Outside, tmp_path: Path) -> None:
    assert outside.run("bash", "-c", "exit 7")[0] == 7
    _, out, _ = outside.run("bash", "-c", "echo $PYTHONPATH $NUMBA_CACHE_DIR $OMP_NUM_THREADS $PWD")
    assert out.split() == [str(CHECKOUT), f"{outside.cache}/numba", "1", os.getcwd()]
    assert outside.run("bash", "-c", "echo $OMP_NUM_THREADS", OMP_NUM_THREADS="2")[1] == "2\n"


def test_signals_reach_the_command(outside: Outside) -> None:
    outside.run("true")
    process = outside.start("bash", "-c", "trap 'exit 9' TERM; echo up; while :; do sleep 0.05; done")
    assert process.stdout is not None and process.stdout.readline() == "up\n"
    process.terminate()
    process.communicate(timeout=20)
    assert process.returncode == 9


def test_nested_call_enters_nothing(outside: Outside) -> None:
    run = str(CHECKOUT / "run")
    outside.run("true")
    (outside.stubs / "mounts").unlink(missing_ok=True)
    assert outside.run(run, run, "echo", "in")[1] == "in\n"
    mounts = (outside.stubs / "mounts").read_text().splitlines()
    assert mounts.count(mounts[0]) == 2  # source and target, once


def test_two_first_calls_make_one_debian(outside: Outside) -> None:
    calls = [outside.start("echo", name, SLOW="1") for name in "ab"]
    outputs = [call.communicate(timeout=60) for call in calls]
    assert [out for out, _ in outputs] == ["a\n", "b\n"]
    assert outside.made == 1
    assert sum("waiting for it" in err for _, err in outputs) == 1


def test_interrupted_set_up_is_done_again(outside: Outside) -> None:
    call = outside.start("echo", SLOW="2")
    deadline = time.monotonic() + 20
    while outside.made == 0 and time.monotonic() < deadline:
        time.sleep(0.02)
    call.kill()
    call.communicate(timeout=20)
    assert not list(outside.cache.glob("state-*"))
    assert outside.run("echo", "done")[:2] == (0, "done\n")
    assert not list(outside.cache.glob("*.part"))
    assert outside.made == 2


def test_a_half_made_venv_is_made_again(outside: Outside) -> None:
    outside.run("true")
    (venv,) = outside.cache.glob("venv-*")
    (venv / ".complete").unlink()
    (venv / "rubbish").touch()
    assert outside.run("echo", "x")[:2] == (0, "x\n")
    assert (venv / ".complete").exists() and not (venv / "rubbish").exists()
    assert outside.made == 1


def test_a_fresh_clone_shares_and_other_lists_do_not(outside: Outside, tmp_path: Path) -> None:
    outside.run("true")
    clone = tmp_path / "clone"
    clone.mkdir()
    for name in ("run", "packages.txt", "requirements.txt"):
        shutil.copy(CHECKOUT / name, clone / name)
    assert outside.run("true", checkout=clone) == (0, "", "")
    with (clone / "packages.txt").open("a") as packages:
        packages.write("less\n")
    assert outside.run("true", checkout=clone)[0] == 0
    assert outside.made == 2


def test_no_network(outside: Outside) -> None:
    line = refusal(outside.run("true", BROKEN="1"))
    assert "no network: deb.debian.org cannot be reached" in line
    assert "mirror.local cannot" in refusal(
        outside.run("true", BROKEN="1", DRILLFEM_MIRROR="https://mirror.local/debian")
    )


def test_no_package_index(outside: Outside) -> None:
    assert "no network: pypi.org" in refusal(outside.run("true", NO_PIP="1"))


def test_certificate_of_a_network_that_looks_inside(outside: Outside) -> None:
    outside.stub("timeout", "exit 0")
    assert "set PIP_CERT" in refusal(outside.run("true", NO_PIP="1", PIP_SAYS="SSL: CERTIFICATE_VERIFY_FAILED"))


def test_other_failures_name_the_log(outside: Outside) -> None:
    outside.stub("timeout", "exit 0")
    assert f"see the end of {outside.cache}/setup.log" in refusal(outside.run("true", BROKEN="1"))
    assert "no such mirror" in (outside.cache / "setup.log").read_text()


def test_no_disk(outside: Outside) -> None:
    outside.free_gigabytes(2)
    assert "6 GB of disk are needed" in refusal(outside.run("true"))
    assert outside.made == 0


def test_neither_root_nor_namespaces(outside: Outside) -> None:
    outside.stub("id", "echo 1000")
    assert "no root and no user namespaces" in refusal(outside.run("true", NO_NAMESPACE="1"))
    outside.stub("id", "echo 0")
    assert "may not mount" in refusal(outside.run("true", NO_NAMESPACE="1"))


def test_cache_that_cannot_be_written(outside: Outside) -> None:
    assert "set DRILLFEM_CACHE" in refusal(outside.run("true", DRILLFEM_CACHE="/proc/none"))


def test_unknown_way(outside: Outside) -> None:
    assert "must be python, apt or private" in refusal(outside.run("true", DRILLFEM_WAY="magic"))


def test_usage() -> None:
    run = str(CHECKOUT / "run")
    nothing = subprocess.run([run], capture_output=True, text=True)
    asked = subprocess.run([run, "--help"], capture_output=True, text=True)
    assert (nothing.returncode, asked.returncode) == (2, 0)
    assert nothing.stderr.startswith("usage: ./run CMD") and asked.stderr == nothing.stderr
