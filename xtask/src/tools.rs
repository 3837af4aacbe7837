//! Paths of the checkout and its tools; missing tools are installed.

use std::ffi::OsString;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use crate::process;

/// Name of the Python interpreter.
pub(crate) const PYTHON: &str = if cfg!(windows) { "python" } else { "python3" };

/// The checkout and the cargo that runs it.
pub(crate) struct Workspace {
    pub(crate) root: PathBuf,
    cargo: OsString,
    target: PathBuf,
    /// Path of the interpreter for PyO3.
    interpreter: Option<PathBuf>,
}

impl Workspace {
    /// The checkout from which this program was built.
    pub(crate) fn find() -> Self {
        let manifest = std::env::var_os("CARGO_MANIFEST_DIR")
            .map_or_else(|| PathBuf::from(env!("CARGO_MANIFEST_DIR")), PathBuf::from);
        let root = manifest
            .parent()
            .map_or_else(|| PathBuf::from("."), Path::to_path_buf);
        let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
        let target = std::env::var_os("CARGO_TARGET_DIR")
            .map_or_else(|| root.join("target"), |target| root.join(target));
        Self::building_in(root, cargo, target)
    }

    fn building_in(root: PathBuf, cargo: OsString, target: PathBuf) -> Self {
        let interpreter = interpreter(&root, &target);
        Self {
            root,
            cargo,
            target,
            interpreter,
        }
    }

    /// This checkout with another build folder; calls of cargo need it in `CARGO_TARGET_DIR`, too.
    pub(crate) fn with_target(&self, target: PathBuf) -> Self {
        Self::building_in(self.root.clone(), self.cargo.clone(), target)
    }

    /// Prepares a call of `cargo` with these arguments.
    pub(crate) fn cargo(&self, arguments: &[&str]) -> Command {
        let mut command = Command::new(&self.cargo);
        command.args(arguments);
        if let Some(interpreter) = &self.interpreter {
            command.env("PYO3_CONFIG_FILE", interpreter);
        }
        command
    }

    /// Path of the cargo that runs this program.
    pub(crate) fn cargo_program(&self) -> &OsString {
        &self.cargo
    }

    /// Path of Cargo's build folder.
    pub(crate) fn target(&self) -> PathBuf {
        self.target.clone()
    }

    /// A program of this workspace, compiled for release together with everything else: a package alone
    /// gives the crates that it depends on other features, so that all of them would be compiled again.
    ///
    /// # Errors
    /// If it cannot be built.
    pub(crate) fn program(&self, name: &str) -> Result<Command, String> {
        let mut build = self.cargo(&["build", "--release", "--workspace"]);
        let failure = format!("{name} could not be built");
        process::must(&self.root, &mut build, &failure)?;
        Ok(Command::new(self.target.join("release").join(name)))
    }

    /// Whether `cargo NAME` is installed.
    pub(crate) fn has_cargo_command(&self, name: &str) -> bool {
        process::output(&self.root, &mut self.cargo(&[name, "--version"])).is_some()
    }

    /// Files under version control whose names end in `.extension`.
    pub(crate) fn tracked(&self, extension: &str) -> Vec<String> {
        let pattern = format!("*.{extension}");
        process::output(
            &self.root,
            Command::new("git").args(["ls-files", "--", &pattern]),
        )
        .map(|listing| listing.lines().map(str::to_owned).collect())
        .unwrap_or_default()
    }

    /// A tool of `xtask/tools.txt`, installed into `.venv` if it is missing there.
    ///
    /// # Errors
    /// If Python or the installation fails; the message says which.
    pub(crate) fn python_tool(&self, name: &str) -> Result<Command, String> {
        let list = self.root.join("xtask").join("tools.txt");
        let environment = Environment::ensured(&self.root, self.root.join(".venv"), &list)?;
        Ok(environment.program(name))
    }

    /// A program of the crate registry, built from source into `.tools` if this version is missing
    /// there.
    ///
    /// # Errors
    /// If it cannot be built.
    pub(crate) fn cargo_tool(
        &self,
        name: &str,
        version: &str,
        features: &[&str],
    ) -> Result<Command, String> {
        let tools = self.root.join(".tools");
        let program = tools.join("bin").join(name);
        let there = process::output(&self.root, Command::new(&program).arg("--version"));
        if !there.is_some_and(|answer| answer.trim().ends_with(version)) {
            let mut install = self.cargo(&["install", name, "--locked", "--force"]);
            install.args(["--version", version, "--no-default-features"]);
            install.args(features).arg("--root").arg(&tools);
            process::must(&self.root, &mut install, &format!("cannot build {name}"))?;
        }
        Ok(Command::new(program))
    }
}

/// A Python virtual environment.
pub(crate) struct Environment {
    folder: PathBuf,
}

impl Environment {
    /// Creates an environment in `folder` and installs the packages of `list`, unless the same list
    /// is installed.
    ///
    /// # Errors
    /// If Python or the installation fails; the message says which.
    pub(crate) fn ensured(root: &Path, folder: PathBuf, list: &Path) -> Result<Self, String> {
        Self::with(root, folder, list, |environment, _| {
            let failure = format!("cannot install the packages of {}", list.display());
            process::must(root, environment.pip().arg("-r").arg(list), &failure)
        })
    }

    /// An environment in `folder` that `install` fills, unless it was filled for the same `list`.
    ///
    /// # Errors
    /// If Python or the installation fails; the message says which.
    pub(crate) fn with(
        root: &Path,
        folder: PathBuf,
        list: &Path,
        install: impl FnOnce(&Self, &str) -> Result<(), String>,
    ) -> Result<Self, String> {
        let wanted = fs::read_to_string(list)
            .map_err(|error| format!("cannot read {}: {error}", list.display()))?;
        let stamp = folder.join("installed-tools.txt");
        let environment = Self { folder };
        if fs::read_to_string(&stamp).is_ok_and(|installed| installed == wanted) {
            return Ok(environment);
        }
        let environment = Self::empty(root, environment.folder)?;
        install(&environment, &wanted)?;
        fs::write(&stamp, wanted)
            .map_err(|error| format!("cannot write {}: {error}", stamp.display()))?;
        Ok(environment)
    }

    /// A new environment in `folder`, with nothing but Python itself.
    ///
    /// # Errors
    /// If Python fails.
    pub(crate) fn empty(root: &Path, folder: PathBuf) -> Result<Self, String> {
        let mut venv = Command::new(PYTHON);
        venv.args(["-m", "venv", "--clear"]).arg(&folder);
        process::must(root, &mut venv, "python -m venv failed")?;
        Ok(Self { folder })
    }

    /// Prepares a call of `pip install`, without its arguments.
    pub(crate) fn pip(&self) -> Command {
        let mut command = self.program("python");
        command.args(["-m", "pip", "install", "--quiet"]);
        command.arg("--disable-pip-version-check");
        command
    }

    /// A program of the environment.
    pub(crate) fn program(&self, name: &str) -> Command {
        let folder = if cfg!(windows) { "Scripts" } else { "bin" };
        Command::new(self.folder.join(folder).join(name))
    }
}

/// The file with which maturin describes the interpreter to PyO3. It is passed to every other cargo
/// too, so that all share one build of PyO3; otherwise each would rebuild what the other has built.
fn interpreter(root: &Path, target: &Path) -> Option<PathBuf> {
    const CONTENT: &str = "implementation=CPython\nversion=3.11\n\
        target_abi=CPython-abi3-3.11\nshared=true\nbuild_flags=\n\
        suppress_build_script_link_lines=false";
    let host = host(root)?;
    let folder = target.join("maturin");
    let path = folder.join(format!("pyo3-config-{host}-3.11-abi3.txt"));
    if !path.exists() {
        fs::create_dir_all(folder).ok()?;
        fs::write(&path, CONTENT).ok()?;
    }
    Some(path)
}

/// The target triple of this machine.
pub(crate) fn host(root: &Path) -> Option<String> {
    let version = process::output(root, Command::new("rustc").arg("-vV"))?;
    let mut lines = version.lines();
    let host = lines.find_map(|line| line.strip_prefix("host: "))?;
    Some(host.to_owned())
}
