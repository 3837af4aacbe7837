"""What ``cargo xtask dist`` states about a release."""

import hashlib
import importlib.util
import shutil
import subprocess
import tarfile
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
LINUX = "x86_64-unknown-linux-gnu"


def script(name: str):
    spec = importlib.util.spec_from_file_location(name, ROOT / "xtask" / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


dist = script("dist")
build_times = script("build_times")


@pytest.fixture(scope="module")
def packages() -> list[dict]:
    if shutil.which("cargo") is None:
        pytest.skip("needs cargo")
    return dist.compiled("nanotap-cli", LINUX)


def test_the_bill_has_what_is_compiled_and_nothing_else(packages):
    bill = dist.bill("nanotap-cli", packages)
    names = {entry["name"] for entry in bill["components"]}
    # Of the program, of a build script, inside a C library's crate, the compiler's own.
    assert {"clap", "cc", "libmimalloc-sys", "nanotap-flow", "rust-std"} <= names
    # Of tests, of benches, of another system, of the extension.
    assert not {"proptest", "divan", "windows-sys", "pyo3"} & names
    lock = tomllib.loads((ROOT / "Cargo.lock").read_text())["package"]
    checksums = {of["name"]: of.get("checksum") for of in lock}
    for entry in bill["components"]:
        assert entry["licenses"][0]["expression"]
        if "hashes" in entry and entry["name"] in ("clap", "libm", "notosans"):
            assert entry["hashes"][0]["content"] == checksums[entry["name"]]
    references = [entry["bom-ref"] for entry in bill["components"]]
    assert len(set(references)) == len(references)
    needed = {need for entry in bill["dependencies"] for need in entry["dependsOn"]}
    assert needed <= set(references)


def test_every_foreign_package_has_its_licence_text(packages):
    text = dist.licences(packages)
    head, *groups = text.split("=" * 80)
    for of in packages:
        name = f"{of['name']} {of['version']}"
        foreign = of["source"] is not None
        assert (f"\n{name}: " in head) == foreign
        with_text = any(name in group.split("-" * 80)[0] for group in groups)
        assert with_text == foreign, name
    # The typeface is inside a crate's folder, mimalloc inside a crate of bindings.
    assert "SIL OPEN FONT LICENSE" in text
    assert "Microsoft Corporation" in text
    bodies = [" ".join(group.split("-" * 80, 1)[1].split()) for group in groups]
    assert len(set(bodies)) == len(bodies)


def test_an_archive_is_the_same_whenever_it_is_packed(tmp_path):
    folder = tmp_path / "nanotap-1-linux"
    (folder / "man").mkdir(parents=True)
    (folder / "nanotap").write_bytes(b"program")
    (folder / "man" / "nanotap.1").write_bytes(b"page")
    dist.pack(folder, tmp_path / "a.tar.gz")
    (folder / "nanotap").touch()
    dist.pack(folder, tmp_path / "b.tar.gz")
    assert (tmp_path / "a.tar.gz").read_bytes() == (tmp_path / "b.tar.gz").read_bytes()
    with tarfile.open(tmp_path / "a.tar.gz") as archive:
        modes = {entry.name: entry.mode for entry in archive}
    assert modes == {
        "nanotap-1-linux/man/nanotap.1": 0o644,
        "nanotap-1-linux/nanotap": 0o755,
    }


def test_checksums_are_those_that_sha256sum_reads(tmp_path):
    (tmp_path / "a.whl").write_bytes(b"wheel")
    (tmp_path / "SHA256SUMS").write_text("of an earlier build")
    dist.sums(tmp_path)
    expected = f"{hashlib.sha256(b'wheel').hexdigest()}  a.whl\n"
    assert (tmp_path / "SHA256SUMS").read_text() == expected
    if program := shutil.which("sha256sum"):
        check = [program, "--check", "--strict", "--quiet", "SHA256SUMS"]
        assert subprocess.run(check, cwd=tmp_path, check=False).returncode == 0


def test_build_times_add_up():
    log = "nanotap_flow\t20.0\t0.1\nserde\t3.5\t0.1\nnanotap_flow\t1.0\t0.1\n"
    text, total = build_times.table(log, 30.3)
    assert total == pytest.approx(30.0)
    assert text.splitlines()[2:] == [
        "| nanotap_flow | 21.0 |",
        "| 1 dependencies | 3.5 |",
        "| build scripts and cargo | 5.5 |",
        "| total | 30.0 |",
    ]
