//! `cargo xtask dist`: everything that a release of this commit publishes for this machine.

use std::ffi::OsString;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use crate::process::{must, output};
use crate::tally::Tally;
use crate::tools::{self, PYTHON, Workspace};
use crate::wheel;

/// Shell completions, and the file names under which shells look for them.
const COMPLETIONS: [(&str, &str); 5] = [
    ("bash", "nanotap.bash"),
    ("elvish", "nanotap.elv"),
    ("fish", "nanotap.fish"),
    ("powershell", "_nanotap.ps1"),
    ("zsh", "_nanotap"),
];

/// Licences of the dependencies, as `xtask/dist.py` writes them; `pyproject.toml` names them too.
const LICENCES: [&str; 2] = ["THIRD-PARTY-LICENSES.txt", "THIRD-PARTY-LICENSES-rust.html"];

const BILL: &str = "nanotap.cdx.json";

/// Writes source archive, wheel, program archive, bill of materials and checksums.
///
/// # Errors
/// If the options are wrong, files under version control were changed, or a step fails.
pub(crate) fn run(workspace: &Workspace, options: &[String]) -> Result<Tally, String> {
    let root = &workspace.root;
    let folder = match options {
        [] => root.join("target").join("dist"),
        [flag, folder] if flag == "--out" => root.join(folder),
        _ => return Err("expected no option, or --out DIR".into()),
    };
    let git = |arguments: &[&str]| {
        output(root, Command::new("git").args(arguments))
            .map(|answer| answer.trim().to_owned())
            .ok_or_else(|| format!("git {} failed", arguments.join(" ")))
    };
    let changed = git(&["status", "--porcelain", "--untracked-files=no"])?;
    if !changed.is_empty() {
        return Err(format!(
            "a release is made of a commit; commit these changes first:\n{changed}"
        ));
    }
    let target = tools::host(root).ok_or("rustc -vV failed")?;
    let name = format!("nanotap-{}-{target}", env!("CARGO_PKG_VERSION"));
    if options.is_empty() {
        let _ = fs::remove_dir_all(&folder);
    }
    create(&folder)?;
    if fs::read_dir(&folder).is_ok_and(|mut files| files.next().is_some()) {
        return Err(format!("{} is not empty", folder.display()));
    }
    // What an earlier build left may have been compiled at another time.
    let build = workspace.target().join("dist-build");
    let _ = fs::remove_dir_all(&build);
    create(&build)?;
    let release = Release {
        time: git(&["show", "-s", "--format=%ct", "HEAD"])?,
        rust_flags: rust_flags(root, &build),
        staging: build.join("staging"),
        workspace: workspace.with_target(build),
        folder,
    };
    let written = release
        .source()
        .and_then(|()| release.compile())
        .and_then(|()| release.wheel(&target))
        .and_then(|()| release.program(&name, &target));
    for licence in LICENCES {
        let _ = fs::remove_file(root.join(licence));
    }
    written?;
    release.python(&["sums"], &[&release.folder])?;
    println!("\nwritten: {}", release.folder.display());
    Ok(Tally::check(true))
}

struct Release {
    /// Its build folder is separate, and empty at first.
    workspace: Workspace,
    /// Seconds from 1970 to the commit: compilers and archives write it instead of today's.
    time: String,
    rust_flags: OsString,
    /// Unpacked contents of the archives.
    staging: PathBuf,
    /// What is published.
    folder: PathBuf,
}

impl Release {
    /// The source archive, of committed files, with the commit in `crates/nanotap-version/COMMIT`.
    fn source(&self) -> Result<(), String> {
        let source = self.staging.join("source");
        create(&source)?;
        let archive = self.staging.join("source.tar");
        let mut command = Command::new("git");
        command.args(["archive", "--format=tar", "HEAD", "--output"]);
        self.must(command.arg(&archive))?;
        let mut command = Command::new(PYTHON);
        command.args(["-m", "tarfile", "--extract"]);
        self.must(command.arg(&archive).arg(&source))?;
        let mut command = self.workspace.python_tool("maturin")?;
        command.arg("sdist").arg("--manifest-path");
        command.arg(source.join("crates/nanotap-python/Cargo.toml"));
        self.must(command.arg("--out").arg(&self.folder))
    }

    /// The program and the extension, in one call: each alone gives the crates that both use other
    /// features, so that everything would be compiled twice.
    fn compile(&self) -> Result<(), String> {
        let mut command = self.workspace.cargo(&["build", "--release", "--locked"]);
        command.args(["--package", "nanotap-cli", "--package", "nanotap-python"]);
        self.must(&mut command)
    }

    /// The wheel, with the licences of everything that is compiled into it and its bill of materials.
    fn wheel(&self, target: &str) -> Result<(), String> {
        let notices = self.staging.join("wheel");
        self.python(&["notices", "nanotap-python", target], &[&notices])?;
        for licence in LICENCES {
            copy(&notices.join(licence), &self.workspace.root.join(licence))?;
        }
        let mut command = wheel::maturin(&self.workspace, &self.folder)?;
        self.must(command.arg("--sbom-include").arg(notices.join(BILL)))
    }

    /// The archive of the program with its documents, and its bill of materials.
    fn program(&self, name: &str, target: &str) -> Result<(), String> {
        let folder = self.staging.join(name);
        self.python(&["notices", "nanotap-cli", target], &[&folder])?;
        for document in ["README.md", "CHANGELOG.md", "LICENSE-MIT", "LICENSE-APACHE"] {
            copy(&self.workspace.root.join(document), &folder.join(document))?;
        }
        let file = format!("nanotap{}", std::env::consts::EXE_SUFFIX);
        let program = folder.join(&file);
        copy(
            &self.workspace.target().join("release").join(file),
            &program,
        )?;
        let completions = folder.join("completions");
        create(&completions)?;
        for (shell, file) in COMPLETIONS {
            let text = output(&folder, Command::new(&program).args(["generate", shell]));
            let text = text.ok_or_else(|| format!("nanotap generate {shell} failed"))?;
            write(&completions.join(file), &text)?;
        }
        let mut pages = Command::new(&program);
        pages.args(["generate", "man", "--out"]);
        self.must(pages.arg(folder.join("man")))?;
        copy(
            &folder.join(BILL),
            &self.folder.join(format!("{name}.cdx.json")),
        )?;
        let archive = self.folder.join(format!("{name}.tar.gz"));
        self.python(&["pack"], &[&folder, &archive])
    }

    /// Runs `xtask/dist.py` with these words and paths.
    fn python(&self, words: &[&str], paths: &[&Path]) -> Result<(), String> {
        let mut command = Command::new(PYTHON);
        command.arg(self.workspace.root.join("xtask").join("dist.py"));
        self.must(command.args(words).args(paths))
    }

    fn must(&self, command: &mut Command) -> Result<(), String> {
        command
            .env("CARGO", self.workspace.cargo_program())
            .env("CARGO_TARGET_DIR", self.workspace.target())
            .env("CARGO_ENCODED_RUSTFLAGS", &self.rust_flags)
            .env("SOURCE_DATE_EPOCH", &self.time);
        must(&self.workspace.root, command, "the step above failed")
    }
}

/// Flags without which a build differs from machine to machine: they replace paths in messages, and
/// remove symbols, whose names depend on paths too. Cargo does not obey `strip` in the profile for a
/// package with an override there, such as `nanotap-cli`.
fn rust_flags(root: &Path, build: &Path) -> OsString {
    let home = std::env::var_os("CARGO_HOME").map(PathBuf::from);
    let home = home.or_else(|| Some(std::env::home_dir()?.join(".cargo")));
    // The last that matches counts.
    let paths = [
        (Some(root), "/nanotap"),
        (Some(build), "/build"),
        (home.as_deref(), "/cargo"),
    ];
    let mut flags = OsString::from("-Cstrip=symbols");
    for (path, name) in paths {
        let Some(path) = path else { continue };
        flags.push("\u{1f}--remap-path-prefix=");
        flags.push(path);
        flags.push("=");
        flags.push(name);
    }
    flags
}

fn create(folder: &Path) -> Result<(), String> {
    fs::create_dir_all(folder)
        .map_err(|error| format!("cannot create {}: {error}", folder.display()))
}

fn copy(from: &Path, to: &Path) -> Result<(), String> {
    fs::copy(from, to)
        .map(|_| ())
        .map_err(|error| format!("cannot copy {}: {error}", from.display()))
}

fn write(path: &Path, text: &str) -> Result<(), String> {
    fs::write(path, text).map_err(|error| format!("cannot write {}: {error}", path.display()))
}
