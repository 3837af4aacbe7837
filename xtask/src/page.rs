//! The page that needs no server, in `target/page`: its files for any web server, and `nanotap.html`.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use crate::process::{check, must, output};
use crate::tally::Tally;
use crate::tools::{self, Workspace};

/// The target that browsers run.
const TARGET: &str = "wasm32-unknown-unknown";
/// What the module may use: every browser of today has 128-bit vectors; where multiply-adds are not fused,
/// the page takes the module without them.
/// The names of functions contain the crates of their types, by which the page's module is split.
const FLAGS: &str = "-Ctarget-feature=+simd128,+relaxed-simd -Csymbol-mangling-version=v0";
/// Debian's compiler of the version that its browsers are built with, and the sources of its library.
const PACKAGES: [&str; 2] = ["rustc-web", "rust-web-src"];

/// The oldest compiler that nanotap is built with.
const OLDEST: &str = env!("CARGO_PKG_RUST_VERSION");

/// Nothing was checked.
pub(crate) const SKIPPED: Tally = Tally {
    passed: 0,
    failed: 0,
    skipped: 1,
};

/// A compiler for the target.
struct Compiler {
    /// `None`: the one of the toolchain.
    rustc: Option<PathBuf>,
}

/// Builds the page and compares its answers with the program's.
///
/// # Errors
/// If something cannot be built; without a compiler for the target or without Node, that part is skipped.
pub(crate) fn run(workspace: &Workspace) -> Result<Tally, String> {
    let Some(folder) = written(workspace)? else {
        return Ok(SKIPPED);
    };
    let mut tally = Tally::check(true);
    tally += compared(workspace, &folder)?;
    Ok(tally)
}

/// Builds the page and returns its folder; `None`, with a message, without a compiler for the target.
///
/// # Errors
/// If something cannot be built.
pub(crate) fn written(workspace: &Workspace) -> Result<Option<PathBuf>, String> {
    let Some(compiler) = compiler(workspace)? else {
        println!(
            "skipped: there is no compiler for {TARGET}; `rustup target add {TARGET}` installs one"
        );
        return Ok(None);
    };
    let module = module(workspace, &compiler)?;
    let folder = workspace.target().join("page");
    let mut page = workspace.program("nanotap-bundle")?;
    page.arg("page").arg(&workspace.root);
    page.arg(module).arg(&folder);
    must(&workspace.root, &mut page, "the page could not be written")?;
    Ok(Some(folder))
}

/// Answers of the page's modules against those of the program.
fn compared(workspace: &Workspace, folder: &Path) -> Result<Tally, String> {
    if output(&workspace.root, Command::new("node").arg("--version")).is_none() {
        println!("skipped: there is no Node to run the module");
        return Ok(SKIPPED);
    }
    let answers = workspace.target().join("web").join("answers");
    fs::create_dir_all(&answers)
        .map_err(|error| format!("cannot make {}: {error}", answers.display()))?;
    let mut native = workspace.program("nanotap-bundle")?;
    native.args(["answers", "xtask/bundle/requests.json"]);
    // One thread, as in a browser's worker: the times can be compared.
    native.arg(&answers).env("RAYON_NUM_THREADS", "1");
    must(&workspace.root, &mut native, "the program did not answer")?;
    let mut compare = Command::new("node");
    compare.arg("xtask/bundle/compare.mjs").arg(&answers);
    compare.args(["nanotap.wasm", "nanotap-exact.wasm"].map(|name| folder.join(name)));
    check(&workspace.root, &mut compare)
}

/// Compiles the module.
fn module(workspace: &Workspace, compiler: &Compiler) -> Result<PathBuf, String> {
    // A separate folder: this compiler may be another one, and everything would be compiled anew each
    // time that a task uses the other.
    let target = workspace.target().join("web");
    let mut cargo = workspace.cargo(&["build", "--profile", "web", "--target", TARGET]);
    cargo.args(["--package", "nanotap-web"]);
    cargo.env("CARGO_TARGET_DIR", &target);
    cargo.env("CARGO_TARGET_WASM32_UNKNOWN_UNKNOWN_RUSTFLAGS", FLAGS);
    if let Some(rustc) = &compiler.rustc {
        let sysroot = output(
            &workspace.root,
            Command::new("rustc").args(["--print", "sysroot"]),
        );
        let host = tools::host(&workspace.root).ok_or("rustc does not say its host")?;
        let linker = Path::new(sysroot.unwrap_or_default().trim())
            .join("lib/rustlib")
            .join(host)
            .join("bin/rust-lld");
        cargo.arg("-Zbuild-std=std,panic_abort");
        cargo.env("RUSTC", rustc).env("RUSTC_BOOTSTRAP", "1");
        cargo.env("CARGO_TARGET_WASM32_UNKNOWN_UNKNOWN_LINKER", linker);
    }
    must(&workspace.root, &mut cargo, "the module could not be built")?;
    Ok(target.join(TARGET).join("web").join("nanotap_web.wasm"))
}

/// The toolchain's own compiler, if it has the library of the target; else Debian's.
fn compiler(workspace: &Workspace) -> Result<Option<Compiler>, String> {
    let library = output(
        &workspace.root,
        Command::new("rustc").args(["--print", "target-libdir", "--target", TARGET]),
    );
    if library.is_some_and(|folder| Path::new(folder.trim()).exists()) {
        return Ok(Some(Compiler { rustc: None }));
    }
    let folder = workspace.target().join("rustc-web");
    let rustc = folder.join("rustc");
    if !rustc.exists() && !unpacked(&folder, &rustc)? {
        return Ok(None);
    }
    let release = output(&workspace.root, Command::new(&rustc).arg("--version"));
    let release = release.as_deref().and_then(|text| text.split(' ').nth(1));
    if release.is_none_or(|release| version(release) < version(OLDEST)) {
        println!(
            "Debian's compiler is {}, and nanotap needs {OLDEST}: `apt-get update` renews the list of packages",
            release.unwrap_or("none that runs")
        );
        fs::remove_dir_all(&folder)
            .map_err(|error| format!("cannot remove {}: {error}", folder.display()))?;
        return Ok(None);
    }
    Ok(Some(Compiler { rustc: Some(rustc) }))
}

/// The numbers of a version, to compare it.
fn version(text: &str) -> Vec<u32> {
    let parts = text.split(['.', '-', '+']);
    parts.map_while(|part| part.parse().ok()).collect()
}

/// Downloads Debian's compiler and unpacks it in a folder: it is not installed, and nothing else on the
/// machine changes.
fn unpacked(folder: &Path, rustc: &Path) -> Result<bool, String> {
    let depends = Command::new("apt-cache")
        .args(["depends", "--recurse", "--no-recommends", "--no-suggests"])
        .args([
            "--no-conflicts",
            "--no-breaks",
            "--no-replaces",
            "--no-enhances",
        ])
        .args(PACKAGES)
        .output();
    let Ok(depends) = depends else {
        return Ok(false);
    };
    let text = String::from_utf8_lossy(&depends.stdout);
    let ours = |name: &&str| {
        PACKAGES.contains(name)
            || ["libstd-rust-web", "libllvm"]
                .iter()
                .any(|start| name.starts_with(start))
    };
    let names: Vec<&str> = text.lines().filter(ours).collect();
    if !PACKAGES.iter().all(|package| names.contains(package)) {
        return Ok(false);
    }
    let failed = |error: std::io::Error| format!("cannot write {}: {error}", folder.display());
    fs::create_dir_all(folder).map_err(failed)?;
    let mut download = Command::new("apt-get");
    download.arg("download").args(&names);
    must(
        folder,
        &mut download,
        "the compiler could not be downloaded",
    )?;
    for file in fs::read_dir(folder).map_err(failed)?.flatten() {
        let path = file.path();
        if path.extension().is_some_and(|ending| ending == "deb") {
            let mut unpack = Command::new("dpkg");
            unpack.arg("-x").arg(&path).arg(folder);
            must(folder, &mut unpack, "the compiler could not be unpacked")?;
            fs::remove_file(&path).map_err(failed)?;
        }
    }
    let library = folder
        .join("usr/lib")
        .join(format!("{}-linux-gnu", std::env::consts::ARCH));
    let script = format!(
        "#!/bin/sh\nLD_LIBRARY_PATH='{}' exec '{}' \"$@\"\n",
        library.display(),
        folder.join("usr/bin/rustc").display()
    );
    fs::write(rustc, script).map_err(failed)?;
    let mut executable = Command::new("chmod");
    must(folder, executable.arg("+x").arg(rustc), "chmod failed")?;
    Ok(true)
}
