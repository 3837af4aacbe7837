"""What a release states about itself and how it is packed; run by ``cargo xtask dist``.

``dist.py notices PACKAGE TARGET FOLDER`` writes the licences of all packages that are compiled into
PACKAGE, and a bill of materials in CycloneDX's format. ``dist.py pack FOLDER ARCHIVE`` packs a folder,
and ``dist.py sums FOLDER`` writes SHA256SUMS there. The same commit gives the same bytes.
"""

import gzip
import hashlib
import io
import json
import os
import re
import shutil
import subprocess
import sys
import tarfile
import time
import tomllib
from pathlib import Path

ROOT = Path(__file__).parents[1]
LICENCE_FILE = re.compile(r"(un)?licen[cs]e|copying|copyright|notice", re.IGNORECASE)
# The time of the commit, as other tools read it too.
EPOCH = int(os.environ.get("SOURCE_DATE_EPOCH", "0"))


def printed(*command: str) -> str:
    return subprocess.run(
        command, check=True, stdout=subprocess.PIPE, text=True, cwd=ROOT
    ).stdout


def cargo(*arguments: str) -> str:
    return printed(os.environ.get("CARGO", "cargo"), *arguments)


def compiled(package: str, target: str) -> list[dict]:
    """The packages that are compiled for ``package``, itself among them, as cargo describes them."""
    # `cargo metadata` has also the packages that only the features of tests need.
    options = ["--edges=normal,build", "--prefix=none", "--no-dedupe", "--locked"]
    tree = cargo("tree", f"--package={package}", f"--target={target}", *options)
    names = {tuple(line.split()[:2]) for line in tree.splitlines() if line}
    metadata = json.loads(cargo("metadata", "--format-version=1", "--locked"))
    nodes = {node["id"]: node["dependencies"] for node in metadata["resolve"]["nodes"]}
    packages = [
        of | {"needs": nodes[of["id"]]}
        for of in metadata["packages"]
        if (of["name"], "v" + of["version"]) in names
    ]
    return sorted(packages, key=lambda of: (of["name"], of["version"]))


def licence(of: dict) -> str:
    """The SPDX expression of a package; old ones have a slash for OR."""
    return (of["license"] or "see its licence file").replace("/", " OR ")


def licences(packages: list[dict]) -> str:
    """The licence texts of foreign packages, each once, under the packages that have it."""
    texts: dict[str, tuple[str, list[str]]] = {}
    lines = [
        "nanotap contains these packages of other authors. Their licence texts follow.",
        "Rust's standard library has its own file, THIRD-PARTY-LICENSES-rust.html.",
        "",
    ]
    for of in packages:
        if of["source"] is None:
            continue
        name = f"{of['name']} {of['version']}"
        folder = Path(of["manifest_path"]).parent
        files = [path for path in folder.rglob("*") if LICENCE_FILE.match(path.name)]
        files = sorted(path for path in files if path.is_file())
        for path in files:
            text = path.read_text(encoding="utf-8", errors="replace").strip("\r\n")
            owners = texts.setdefault(" ".join(text.split()), (text, []))[1]
            if name not in owners:
                owners.append(name)
        remark = "" if files else " (its archive has no licence text)"
        lines.append(f"{name}: {licence(of)}{remark}")
    for text, owners in texts.values():
        lines += ["", "=" * 80, ", ".join(owners), "-" * 80, *text.splitlines()]
    return "\n".join(lines) + "\n"


def bill(package: str, packages: list[dict]) -> dict:
    """The bill of materials in CycloneDX's format 1.6."""
    lock = tomllib.loads((ROOT / "Cargo.lock").read_text(encoding="utf-8"))
    checksums = {
        (of["name"], of["version"]): of.get("checksum") for of in lock["package"]
    }
    reference = {of["id"]: f"pkg:cargo/{of['name']}@{of['version']}" for of in packages}

    def component(of: dict) -> dict:
        entry = {
            "type": "library",
            "bom-ref": reference[of["id"]],
            "name": of["name"],
            "version": of["version"],
            "licenses": [{"expression": licence(of)}],
            "purl": reference[of["id"]],
        }
        if checksum := checksums[of["name"], of["version"]]:
            entry["hashes"] = [{"alg": "SHA-256", "content": checksum}]
        return entry

    rust = printed("rustc", "--version").split()[1]
    library = {
        "type": "library",
        "bom-ref": "rust-std",
        "name": "rust-std",
        "version": rust,
        "licenses": [{"expression": "MIT OR Apache-2.0"}],
        "purl": f"pkg:generic/rust-std@{rust}",
    }
    (program,) = (of for of in packages if of["name"] == package)
    return {
        "bomFormat": "CycloneDX",
        "specVersion": "1.6",
        "version": 1,
        "metadata": {
            "timestamp": time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime(EPOCH)),
            "component": component(program) | {"type": "application"},
        },
        "components": [component(of) for of in packages if of is not program]
        + [library],
        "dependencies": [
            {
                "ref": reference[of["id"]],
                "dependsOn": sorted(
                    {reference[need] for need in of["needs"] if need in reference}
                ),
            }
            for of in packages
        ],
    }


def notices(package: str, target: str, folder: Path) -> None:
    """Write licences and bill of materials of ``package`` into ``folder``."""
    folder.mkdir(parents=True, exist_ok=True)
    packages = compiled(package, target)
    texts = {
        "THIRD-PARTY-LICENSES.txt": licences(packages),
        "nanotap.cdx.json": json.dumps(bill(package, packages), indent=1) + "\n",
    }
    for name, text in texts.items():
        (folder / name).write_text(text, encoding="utf-8", newline="\n")
    rust = Path(printed("rustc", "--print=sysroot").strip()) / "share" / "doc" / "rust"
    shutil.copy(
        rust / "COPYRIGHT-library.html", folder / "THIRD-PARTY-LICENSES-rust.html"
    )


def pack(folder: Path, archive: Path) -> None:
    """Pack ``folder``, under its own name, as ``archive`` (.tar.gz)."""
    packed = io.BytesIO()
    with tarfile.open(fileobj=packed, mode="w", format=tarfile.PAX_FORMAT) as tar:
        for path in sorted(folder.rglob("*")):
            if not path.is_file():
                continue
            entry = tarfile.TarInfo(path.relative_to(folder.parent).as_posix())
            entry.size = path.stat().st_size
            entry.mtime = EPOCH
            # No other file of a release has an executable's name.
            entry.mode = 0o755 if path.name in ("nanotap", "nanotap.exe") else 0o644
            with path.open("rb") as content:
                tar.addfile(entry, content)
    archive.write_bytes(gzip.compress(packed.getvalue(), mtime=0))


def sums(folder: Path) -> None:
    """Write ``SHA256SUMS`` of the files in ``folder``, as ``sha256sum --check`` reads it."""
    files = sorted(path for path in folder.iterdir() if path.is_file())
    lines = [
        f"{hashlib.sha256(path.read_bytes()).hexdigest()}  {path.name}\n"
        for path in files
        if path.name != "SHA256SUMS"
    ]
    (folder / "SHA256SUMS").write_text("".join(lines), encoding="utf-8", newline="\n")


if __name__ == "__main__":
    match sys.argv[1:]:
        case ["notices", package, target, folder]:
            notices(package, target, Path(folder))
        case ["pack", folder, archive]:
            pack(Path(folder), Path(archive))
        case ["sums", folder]:
            sums(Path(folder))
        case _:
            sys.exit(__doc__)
