"""Runs are signed with real keys, and nothing that is not so passes for a signature."""

from __future__ import annotations

import hashlib
import json
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import h5py
import pytest

from campaign import signing
from campaign.archive.layout.run_status import RunStatus
from campaign.archive.layout.signature_file import signature_path
from campaign.archive.reading.open_run import open_run
from campaign.archive.verification.statement import run_statement
from campaign.archive.verification.verify_run import verify_run
from campaign.archive.writing.run_lock import RunLock
from campaign.archive.writing.writer import RunWriter
from campaign.backends import sim
from campaign.cli.prepare import Request
from campaign.cli.resume import resume_run
from campaign.cli.run import run_protocol
from campaign.cli.run_options import RunOptions
from campaign.cli.show import show_archive
from campaign.cli.sign import sign_archive
from campaign.cli.verify import verify_archives, wanted_signature
from campaign.errors import ArchiveError, ExitCode, UsageError
from campaign.recording import Ending, Outcome, SafeState
from tests.archive.conftest import make_header, make_trial, write_run, write_trial
from tests.system.user import SEA, campaign, command, environment, write

KEPT = Path(__file__).parents[1] / "archive" / "kept"

needs_ssh_keygen = pytest.mark.skipif(
    shutil.which("ssh-keygen") is None, reason="needs ssh-keygen (OpenSSH)"
)
needs_posix = pytest.mark.skipif(sys.platform == "win32", reason="needs POSIX")


@pytest.fixture(autouse=True)
def alone(monkeypatch: pytest.MonkeyPatch) -> None:
    """No agent, no dialog and no terminal of whoever runs the tests."""
    for name in ("SSH_AUTH_SOCK", "SSH_ASKPASS", "SSH_ASKPASS_REQUIRE", "DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr("campaign.cli.sign.has_terminal", lambda: False)


@pytest.fixture
def sealed(tmp_path: Path) -> Path:
    return write_run(tmp_path / "results", normalised={}, fingerprint="")


def make_key(folder: Path, name: str, passphrase: str = "") -> Path:
    key = folder / name
    quiet = ["ssh-keygen", "-q", "-t", "ed25519", "-C", name, "-N", passphrase, "-f", str(key)]
    subprocess.run(quiet, check=True, stdin=subprocess.DEVNULL)
    return key


def public(key: Path) -> str:
    return key.with_name(f"{key.name}.pub").read_text(encoding="utf-8")


@pytest.fixture
def ada(tmp_path: Path) -> Path:
    return make_key(tmp_path, "ada")


@pytest.fixture
def locked(tmp_path: Path) -> Path:
    return make_key(tmp_path, "locked", "open sesame")


@pytest.fixture
def allowed(tmp_path: Path, ada: Path) -> Path:
    return write(tmp_path, f"# ours\nada@lab {public(ada)}", "allowed_signers")


@pytest.fixture
def agent(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """An agent of our own, without keys. Names of sockets have to be short."""
    with tempfile.TemporaryDirectory(prefix="agent") as folder:
        socket = Path(folder, "s")
        with subprocess.Popen(
            ["ssh-agent", "-D", "-a", str(socket)], stdout=subprocess.PIPE, text=True
        ) as process:
            assert process.stdout is not None
            process.stdout.readline()  # it listens
            monkeypatch.setenv("SSH_AUTH_SOCK", str(socket))
            yield
            process.terminate()
            process.stdout.read()


def sign(sealed: Path, key: Path, *, replace: bool = False) -> ExitCode:
    return sign_archive(str(sealed), sealed.parent, key, replace=replace)


def verify(sealed: Path, signer: str | None = None, allowed: Path | None = None) -> ExitCode:
    wanted = wanted_signature(signer, allowed)
    return verify_archives([str(sealed)], sealed.parent, as_json=False, wanted=wanted)


@needs_ssh_keygen
def test_a_signed_run_is_verified_by_name_key_and_what_that_proves(
    sealed: Path, ada: Path, allowed: Path, capsys: pytest.CaptureFixture[str]
):
    assert sign(sealed, ada) is ExitCode.DONE
    assert capsys.readouterr().out.splitlines()[-1] == f"{sealed}.sig"
    assert verify(sealed, "ada@lab", allowed) is ExitCode.DONE
    listed = subprocess.run(
        ["ssh-keygen", "-l", "-f", str(ada)], capture_output=True, text=True, check=True
    )
    fingerprint = listed.stdout.split()[1]
    sound, signed = capsys.readouterr().out.splitlines()
    assert "sound" in sound
    assert f"signed by ada@lab with the key ED25519 {fingerprint}" in signed
    assert "who, not when" in signed


@needs_ssh_keygen
def test_ssh_keygen_alone_can_check_it(sealed: Path, ada: Path, allowed: Path):
    """The recipe of docs/reading-archives.md."""
    sign(sealed, ada)
    with h5py.File(sealed) as file:
        digest = hashlib.sha256(file["run/outcome/seal"][()]).hexdigest()
    text = f"campaign-run\nrun {sealed.stem}\nseal sha256 {digest}\n"
    what = ["-n", "campaign-run@1", "-I", "ada@lab", "-f", str(allowed), "-s", f"{sealed}.sig"]
    subprocess.run(["ssh-keygen", "-Y", "verify", *what], input=text.encode(), check=True)


@needs_ssh_keygen
def test_checksums_that_were_computed_anew_are_sound_and_only_the_signature_shows_it(
    sealed: Path, ada: Path, allowed: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    sign(sealed, ada)
    forged = write_run(tmp_path / "forged", (50, 121), normalised={}, fingerprint="")
    assert forged.name == sealed.name
    shutil.copy(forged, sealed)
    capsys.readouterr()
    assert verify(sealed) is ExitCode.DONE
    said = capsys.readouterr().err
    assert f"{sealed.name}.sig was not checked" in said
    assert "a changed run can have new checksums" in said
    assert verify(sealed, "ada@lab", allowed) is ExitCode.ARCHIVE
    assert "not of this run as it is now" in capsys.readouterr().out


@needs_ssh_keygen
def test_an_unsigned_run_says_what_checksums_are_worth(
    sealed: Path, ada: Path, allowed: Path, capsys: pytest.CaptureFixture[str]
):
    assert verify(sealed) is ExitCode.DONE
    (said,) = capsys.readouterr().err.splitlines()
    assert "not signed; a changed run can have new checksums" in said
    assert verify(sealed, "ada@lab", allowed) is ExitCode.ARCHIVE
    assert "is not signed" in capsys.readouterr().out
    assert verify(KEPT / "format-3.partial", "ada@lab", allowed) is ExitCode.ARCHIVE
    assert "only a sealed run can be" in capsys.readouterr().out
    wanted = wanted_signature("ada@lab", allowed)
    code = verify_archives([str(sealed)], sealed.parent, as_json=True, wanted=wanted)
    assert code is ExitCode.ARCHIVE
    (tree,) = json.loads(capsys.readouterr().out)
    assert (tree["sound"], tree["signature"]["valid"]) == (True, False)


@needs_ssh_keygen
def test_a_renamed_run_keeps_its_signature(sealed: Path, ada: Path, allowed: Path):
    sign(sealed, ada)
    renamed = sealed.with_name("other.nxs")
    signature_path(sealed).rename(signature_path(renamed))
    sealed.rename(renamed)
    assert verify(renamed, "ada@lab", allowed) is ExitCode.DONE


def signed_by_hand(sealed: Path, key: Path, namespace: str) -> None:
    made = subprocess.run(
        ["ssh-keygen", "-Y", "sign", "-n", namespace, "-f", str(key)],
        input=run_statement(sealed).encode(),
        capture_output=True,
        check=True,
    )
    signature_path(sealed).write_bytes(made.stdout)


@needs_ssh_keygen
def test_a_signature_for_another_purpose_does_not_count(
    sealed: Path, ada: Path, allowed: Path, capsys: pytest.CaptureFixture[str]
):
    signed_by_hand(sealed, ada, "campaign-run@1")
    assert verify(sealed, "ada@lab", allowed) is ExitCode.DONE
    signed_by_hand(sealed, ada, "git")
    assert verify(sealed, "ada@lab", allowed) is ExitCode.ARCHIVE
    assert "another purpose" in capsys.readouterr().out


@needs_ssh_keygen
@pytest.mark.parametrize(
    "damage",
    [
        lambda text: "",
        lambda text: "hello\n",
        lambda text: text[: len(text) // 2],
        lambda text: text.replace("U1NIU0lH", "U1NIU0lI"),
        lambda text: text + "\x00ü",
    ],
    ids=["empty", "text", "cut", "magic", "more"],
)
def test_a_damaged_signature_is_said(
    sealed: Path, ada: Path, allowed: Path, damage, capsys: pytest.CaptureFixture[str]
):
    sign(sealed, ada)
    path = signature_path(sealed)
    whole = path.read_text(encoding="ascii")
    path.write_text(damage(whole), encoding="utf-8")
    capsys.readouterr()
    code = verify(sealed, "ada@lab", allowed)
    if damage(whole).startswith(whole):  # what follows the end is no part of it
        assert code is ExitCode.DONE
    else:
        assert code is ExitCode.ARCHIVE
        assert "is damaged, or no signature" in capsys.readouterr().out


@needs_ssh_keygen
@pytest.mark.parametrize(
    ("signer", "lines", "code", "said"),
    [
        ("bob@lab", "ada@lab {ada}\nbob@lab {bob}\n", 4, "was made by ada@lab (ED25519 SHA256:"),
        ("bob@lab", "ada@lab {ada}\n", 4, "was made by ada@lab"),
        ("ada@lab", "ada@lab {bob}\n", 4, "does not say that it is ada@lab's"),
        ("ada@lab", "bob@lab {bob}\n", 4, "does not name ada@lab"),
        ("ada@lab", "", 4, "does not name ada@lab"),
        ("ada@lab", "ada@lab rubbish\n", 2, "allowed_signers:1: missing key"),
        ("ada@lab", "\nada@lab ssh-ed25519 AAAA\n", 2, "allowed_signers:2: invalid key"),
        ("ada@lab", "ada@lab colour=red {ada}\n", 2, "allowed_signers:1: bad options"),
        ("ada@lab", 'ada@lab valid-before="20200101" {ada}\n', 4, "expired"),
        ("ada@lab", 'ada@lab namespaces="git" {ada}\n', 4, "not permitted"),
        ("ada@lab", 'ada@lab namespaces="campaign-run@1" {ada}\n', 0, "signed by ada@lab"),
        ("ada@lab", "*@lab {ada}\n", 0, "signed by ada@lab"),
        ("ada@home", "*@lab,root {ada}\n", 4, "was made by *@lab, root"),
    ],
)
def test_who_may_sign_is_the_file_s_to_say(
    sealed: Path, ada: Path, signer, lines, code, said, capsys: pytest.CaptureFixture[str]
):
    sign(sealed, ada)
    keys = {"ada": public(ada).strip(), "bob": public(make_key(ada.parent, "bob")).strip()}
    allowed = write(ada.parent, lines.format(**keys), "allowed_signers")
    capsys.readouterr()
    if code == ExitCode.USAGE:
        with pytest.raises(UsageError) as raised:
            verify(sealed, signer, allowed)
        assert said in str(raised.value)
    else:
        assert verify(sealed, signer, allowed) == code
        assert said in capsys.readouterr().out.splitlines()[-1]


def test_one_option_without_the_other_and_a_file_that_is_not_there_are_bad_usage(tmp_path: Path):
    for signer, allowed in (("ada", None), (None, tmp_path / "a"), ("", tmp_path / "a")):
        with pytest.raises(UsageError, match="belong together"):
            wanted_signature(signer, allowed)


@needs_ssh_keygen
def test_an_allowed_signers_file_that_cannot_be_read_is_bad_usage(tmp_path: Path):
    for path in (tmp_path / "none", tmp_path):
        with pytest.raises(UsageError, match="cannot be read"):
            wanted_signature("ada", path)


@needs_ssh_keygen
def test_only_what_is_sealed_sound_and_unsigned_is_signed(
    sealed: Path, ada: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    writer = RunWriter.create(tmp_path / "results", make_header("begun"), [make_trial(1)])
    writer.close()
    with pytest.raises(UsageError, match="not sealed"):
        sign(writer.folder, ada)
    sign(sealed, ada)
    first = signature_path(sealed).read_bytes()
    bob = make_key(tmp_path, "bob")
    with pytest.raises(UsageError, match="signed already; --replace"):
        sign(sealed, bob)
    assert signature_path(sealed).read_bytes() == first
    assert sign(sealed, bob, replace=True) is ExitCode.DONE
    assert Path(f"{sealed}.sig.replaced-1").read_bytes() == first
    assert signature_path(sealed).read_bytes() != first
    signature_path(sealed).unlink()
    content = bytearray(sealed.read_bytes())
    content[-5] ^= 1
    sealed.write_bytes(content)
    with pytest.raises(ArchiveError, match="not sound"):
        sign(sealed, ada)
    assert not signature_path(sealed).exists()


@needs_ssh_keygen
def test_a_run_that_somebody_goes_on_with_is_not_signed_meanwhile(sealed: Path, ada: Path):
    lock = RunLock.acquire(sealed.parent, sealed.stem)
    try:
        with pytest.raises(UsageError, match="another process"):
            sign(sealed, ada)
    finally:
        lock.release()
    sign(sealed, ada)


@needs_ssh_keygen
def test_a_replacement_that_cannot_be_made_leaves_the_old_signature(
    sealed: Path, ada: Path, locked: Path
):
    sign(sealed, ada)
    first = signature_path(sealed).read_bytes()
    with pytest.raises(UsageError, match="passphrase"):
        sign(sealed, locked, replace=True)
    assert signature_path(sealed).read_bytes() == first


@needs_ssh_keygen
@needs_posix
def test_keys_that_cannot_sign_say_why(sealed: Path, tmp_path: Path, ada: Path, locked: Path):
    rubbish = write(tmp_path, "hello\n", "rubbish")
    rubbish.chmod(0o600)
    half = shutil.copy(f"{ada}.pub", tmp_path / "half.pub")
    wide = Path(shutil.copy(ada, tmp_path / "wide"))
    wide.chmod(0o644)
    cases = {
        tmp_path / "none": "none cannot be read: No such file",
        tmp_path: "is not a file",
        rubbish: "is not a key of OpenSSH",
        wide: "chmod 600",
        half: "no agent runs",
        locked: "needs a passphrase, and there is no terminal",
    }
    for key, said in cases.items():
        with pytest.raises(UsageError, match=said):
            sign(sealed, Path(key))
        assert not signature_path(sealed).exists()


@needs_ssh_keygen
def test_the_text_that_is_signed_is_never_taken_for_a_passphrase(tmp_path: Path):
    """Without a terminal ssh-keygen would read one from its input, where the text is."""
    key = make_key(tmp_path, "key", "campaign-run")
    with pytest.raises(UsageError, match="needs a passphrase"):
        signing.sign("campaign-run\nrun x\n", key, ask=False)


@needs_ssh_keygen
@needs_posix
@pytest.mark.usefixtures("agent")
def test_an_agent_signs_for_a_public_key_and_for_a_locked_one(
    sealed: Path, tmp_path: Path, ada: Path, locked: Path, allowed: Path
):
    half = Path(shutil.copy(f"{ada}.pub", tmp_path / "half.pub"))
    with pytest.raises(UsageError, match="the agent does not have it"):
        sign(sealed, half)
    subprocess.run(["ssh-add", "-q", str(ada)], check=True, stdin=subprocess.DEVNULL)
    assert sign(sealed, half) is ExitCode.DONE
    assert verify(sealed, "ada@lab", allowed) is ExitCode.DONE
    says = write(tmp_path, "#!/bin/sh\necho open sesame\n", "says")
    says.chmod(0o700)
    asking = {**os.environ, "SSH_ASKPASS": str(says), "SSH_ASKPASS_REQUIRE": "force"}
    subprocess.run(["ssh-add", "-q", str(locked)], check=True, env=asking)
    assert sign(sealed, locked, replace=True) is ExitCode.DONE


def opened(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Grows when a backend is opened."""
    calls: list[str] = []
    kind = replace(sim.BACKEND, open=lambda options: calls.append("open"), live=True, several=False)
    monkeypatch.setattr("campaign.cli.prepare.find_backend", lambda name: kind)
    return calls


@needs_ssh_keygen
def test_a_key_that_cannot_sign_ends_a_run_before_anything_is_opened(
    tmp_path: Path, locked: Path, monkeypatch: pytest.MonkeyPatch
):
    calls = opened(monkeypatch)
    request = Request(str(write(tmp_path, SEA)))
    results = tmp_path / "results"
    for key, said in ((locked, "passphrase"), (tmp_path / "none", "cannot be read")):
        with pytest.raises(UsageError, match=said) as raised:
            run_protocol(request, results, RunOptions(workers=1, yes=True, sign=key))
        assert raised.value.exit_code is ExitCode.USAGE
    assert calls == []
    assert not results.exists()


@needs_ssh_keygen
def test_the_command_without_a_terminal_fails_at_once(tmp_path: Path, locked: Path):
    write(tmp_path, SEA)
    done = campaign(tmp_path, "run", "protocol.toml", "--sign", str(locked), code=2)
    assert "needs a passphrase" in done.err
    assert "ssh-add" in done.err
    assert not (tmp_path / "results").exists()


@pytest.mark.slow
@needs_ssh_keygen
@needs_posix
def test_a_passphrase_is_asked_for_at_the_terminal(tmp_path: Path, locked: Path):
    """The real thing: twice, before anything moves and once the run is sealed."""
    import pty

    write(tmp_path, SEA)
    terminal, theirs = pty.openpty()
    own_terminal = (
        "import fcntl, os, sys, termios; fcntl.ioctl(0, termios.TIOCSCTTY, 0); "
        "os.execv(sys.argv[1], sys.argv[1:])"
    )
    run = command("run", "protocol.toml", "--sign", str(locked))
    with subprocess.Popen(
        [sys.executable, "-c", own_terminal, *run],
        cwd=tmp_path,
        env={**environment(), "DISPLAY": ":77"},  # of a desktop without a dialog for this
        stdin=theirs,
        stdout=theirs,
        stderr=theirs,
        start_new_session=True,
    ) as process:
        os.close(theirs)
        for _ in range(2):
            read_until(terminal, b"assphrase: ")
            os.write(terminal, b"open sesame\n")
        shown = read_until(terminal, b".nxs\r\n")
        assert process.wait(timeout=120) == 0
        os.close(terminal)
    assert "signed with the key ED25519" in shown
    (sealed,) = (tmp_path / "results").glob("*.nxs")
    allowed = write(tmp_path, f"ada {public(locked)}", "allowed_signers")
    assert verify(sealed, "ada", allowed) is ExitCode.DONE


def read_until(terminal: int, wanted: bytes) -> str:
    shown = b""
    while wanted not in shown:
        shown += os.read(terminal, 1024)
    return shown.decode("utf-8", "replace")


@needs_ssh_keygen
def test_a_run_is_signed_once_it_is_sealed(
    tmp_path: Path, ada: Path, allowed: Path, capsys: pytest.CaptureFixture[str]
):
    request = Request(str(write(tmp_path, SEA)))
    results = tmp_path / "results"
    assert run_protocol(request, results, RunOptions(workers=1, sign=ada)) is ExitCode.DONE
    (sealed,) = results.glob("*.nxs")
    assert capsys.readouterr().out.splitlines()[-1] == str(sealed)
    assert verify(sealed, "ada@lab", allowed) is ExitCode.DONE
    capsys.readouterr()
    show_archive(str(sealed), results, as_json=False)
    line = f"signature:   {sealed.name}.sig (not checked; campaign verify --signer ...)"
    assert line in capsys.readouterr().out.splitlines()


@needs_ssh_keygen
@pytest.mark.parametrize(
    ("safe", "expected"),
    [(SafeState.CONFIRMED, ExitCode.ARCHIVE), (SafeState.NOT_CONFIRMED, ExitCode.NOT_SAFE)],
)
def test_a_signature_that_fails_at_the_end_costs_the_signature_only(
    tmp_path: Path,
    ada: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    safe: SafeState,
    expected: ExitCode,
):
    execute = sim.SimBackend.execute

    def lose_the_key(backend, trial, recorder, stopped):
        ada.unlink(missing_ok=True)
        return execute(backend, trial, recorder, stopped)

    monkeypatch.setattr(sim.SimBackend, "execute", lose_the_key)
    monkeypatch.setattr(sim.SimBackend, "make_safe", lambda *arguments: safe)
    request = Request(str(write(tmp_path, SEA)))
    results = tmp_path / "results"
    assert run_protocol(request, results, RunOptions(workers=1, sign=ada)) is expected
    (sealed,) = results.glob("*.nxs")
    shown = capsys.readouterr()
    assert shown.out.splitlines()[-1] == str(sealed)
    assert "NOT SIGNED" in shown.err
    assert "campaign sign" in shown.err
    assert verify_run(sealed).sound


@needs_ssh_keygen
def test_ctrl_c_while_it_is_signed_keeps_the_run_and_says_so(
    tmp_path: Path, ada: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    def interrupt(*arguments: object, **more: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(signing, "sign", interrupt)
    request = Request(str(write(tmp_path, SEA)))
    results = tmp_path / "results"
    assert run_protocol(request, results, RunOptions(workers=1, sign=ada)) is ExitCode.INTERRUPTED
    shown = capsys.readouterr()
    assert "NOT SIGNED: interrupted" in shown.err
    assert shown.out.splitlines()[-1].endswith(".nxs")


@pytest.mark.slow
@needs_ssh_keygen
def test_a_run_that_was_gone_on_with_is_signed_anew_and_its_old_signature_is_no_longer_one(
    tmp_path: Path,
    ada: Path,
    allowed: Path,
    locked: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
):
    execute = sim.SimBackend.execute
    results = tmp_path / "results"

    def stop(backend, trial, recorder, stopped):
        if trial.number == 1:
            return execute(backend, trial, recorder, stopped)
        return Ending(Outcome.INTERRUPTED, "stopped")

    def resume(key: Path) -> ExitCode:
        return resume_run(str(sealed), results, RunOptions(workers=1, sign=key))

    with monkeypatch.context() as patch:
        patch.setattr(sim.SimBackend, "execute", stop)
        request = Request(str(write(tmp_path, SEA, "sea.toml")))
        code = run_protocol(request, results, RunOptions(workers=1, sign=ada))
    (sealed,) = results.glob("*.nxs")
    assert code is ExitCode.INTERRUPTED, capsys.readouterr().err
    assert verify(sealed, "ada@lab", allowed) is ExitCode.DONE
    before = sealed.read_bytes()
    with pytest.raises(UsageError, match="passphrase"):
        resume(locked)
    assert sealed.read_bytes() == before
    capsys.readouterr()
    assert resume(ada) is ExitCode.DONE
    assert "was signed; the run changes, so the old signature is renamed" in capsys.readouterr().err
    assert verify(sealed, "ada@lab", allowed) is ExitCode.DONE
    old = Path(f"{sealed}.sig.before-resume-1")
    old.replace(signature_path(sealed))
    capsys.readouterr()
    assert verify(sealed, "ada@lab", allowed) is ExitCode.ARCHIVE
    assert "the run was changed since" in capsys.readouterr().out


@needs_ssh_keygen
def test_a_run_that_was_opened_and_sealed_again_has_lost_its_signature(
    tmp_path: Path, ada: Path, allowed: Path
):
    """Even when nothing was executed: the signature is of the bytes."""
    trials = [make_trial(number) for number in (1, 2)]
    header = make_header(normalised={}, fingerprint="")
    writer = RunWriter.create(tmp_path / "results", header, trials)
    write_trial(writer, trials[0], 20)
    sealed = writer.seal(RunStatus.INTERRUPTED, "stopped", ended="2026-11-21T09:40:00Z")
    sign(sealed, ada)
    signature = signature_path(sealed).read_bytes()
    now = {"at": "2026-11-22T08:00:00Z", "host": {}, "versions": {}, "command": []}
    again = RunWriter.resume(sealed, **now)
    again.seal(RunStatus.INTERRUPTED, "stopped", ended="2026-11-21T09:40:00Z")
    assert open_run(sealed).status is RunStatus.INTERRUPTED
    assert not signature_path(sealed).exists()
    signature_path(sealed).write_bytes(signature)
    assert verify(sealed, "ada@lab", allowed) is ExitCode.ARCHIVE


def fake(folder: Path, script: str) -> None:
    """The only ssh-keygen on the path."""
    tool = write(folder, f"#!{sys.executable}\n{script}", "ssh-keygen")
    tool.chmod(0o700)


SILENT = "import time\ntime.sleep(600)\n"
OLD = """\
import sys
sys.exit("ssh-keygen: unknown option -- Y\\nusage: ssh-keygen [-q] [-b bits]")
"""
OLDER_OPERATIONS = "import sys\nsys.exit('Unsupported operation for -Y: \"check-novalidate\"')\n"


@needs_posix
@pytest.mark.parametrize(
    ("script", "said"),
    [
        ("", "not on the PATH.*openssh-client"),
        (OLD, "too old.*8.2"),
        (OLDER_OPERATIONS, "too old"),
        (SILENT, "did not answer within 0.2 s"),
        ("raise SystemExit(3)\n", "could not sign.*does not say why"),
        ("print('rubbish')\n", "made no signature"),
    ],
    ids=["none", "old", "older", "silent", "failing", "nonsense"],
)
def test_an_ssh_keygen_that_is_of_no_use_is_said_before_anything_is_opened(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, script: str, said: str
):
    key = write(tmp_path, "a key\n", "key")
    tools = tmp_path / "tools"
    tools.mkdir()
    if script:
        fake(tools, script)
    monkeypatch.setenv("PATH", str(tools))
    monkeypatch.setattr("campaign.signing.tool.PATIENCE", 0.2 if script == SILENT else 60.0)
    calls = opened(monkeypatch)
    request = Request(str(write(tmp_path, SEA)))
    with pytest.raises(UsageError, match=said):
        run_protocol(request, tmp_path / "results", RunOptions(workers=1, yes=True, sign=key))
    assert calls == []
    assert not (tmp_path / "results").exists()


def test_verifying_needs_ssh_keygen_only_for_signatures(
    sealed: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    signature_path(sealed).write_text("x", encoding="ascii")
    monkeypatch.setenv("PATH", "")
    assert verify(sealed) is ExitCode.DONE
    with pytest.raises(UsageError, match="ssh-keygen, which is not on the PATH"):
        verify(sealed, "ada", write(tmp_path, "", "allowed"))
