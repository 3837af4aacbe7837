//! Where the checkout is and where its tools are; missing ones are installed.

use std::ffi::OsString;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use crate::process;

/// The Python of this machine.
pub(crate) const PYTHON: &str = if cfg!(windows) { "python" } else { "python3" };

/// The checkout and the cargo that runs it.
pub(crate) struct Workspace {
    pub(crate) root: PathBuf,
    cargo: OsString,
}

impl Workspace {
    /// The checkout that this program was built from.
    pub(crate) fn find() -> Self {
        let manifest = std::env::var_os("CARGO_MANIFEST_DIR")
            .map_or_else(|| PathBuf::from(env!("CARGO_MANIFEST_DIR")), PathBuf::from);
        let root = manifest
            .parent()
            .map_or_else(|| PathBuf::from("."), Path::to_path_buf);
        let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
        Self { root, cargo }
    }

    /// `cargo` with `arguments`.
    pub(crate) fn cargo(&self, arguments: &[&str]) -> Command {
        let mut command = Command::new(&self.cargo);
        command.args(arguments);
        command
    }

    /// The cargo that runs this.
    pub(crate) fn cargo_program(&self) -> &OsString {
        &self.cargo
    }

    /// Where cargo builds.
    pub(crate) fn target(&self) -> PathBuf {
        std::env::var_os("CARGO_TARGET_DIR")
            .map_or_else(|| self.root.join("target"), |path| self.root.join(path))
    }

    /// Is `cargo NAME` there?
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

    /// A tool from `xtask/tools.txt`, installed into `.venv` if it is not there yet.
    ///
    /// # Errors
    /// Python or the installation failed; says which.
    pub(crate) fn python_tool(&self, name: &str) -> Result<Command, String> {
        self.ensure_environment()?;
        Ok(Command::new(self.environment_program(name)))
    }

    fn environment_program(&self, name: &str) -> PathBuf {
        let folder = if cfg!(windows) { "Scripts" } else { "bin" };
        self.root.join(".venv").join(folder).join(name)
    }

    /// Creates `.venv` and installs `xtask/tools.txt` unless this very list is in.
    fn ensure_environment(&self) -> Result<(), String> {
        let list = self.root.join("xtask").join("tools.txt");
        let wanted = fs::read_to_string(&list)
            .map_err(|error| format!("cannot read {}: {error}", list.display()))?;
        let stamp = self.root.join(".venv").join("installed-tools.txt");
        if fs::read_to_string(&stamp).is_ok_and(|installed| installed == wanted) {
            return Ok(());
        }
        let created = process::succeeds(
            &self.root,
            Command::new(PYTHON).args(["-m", "venv", ".venv"]),
        )?;
        if !created {
            return Err("python3 -m venv .venv failed".into());
        }
        let pip = [
            "-m",
            "pip",
            "install",
            "--quiet",
            "--disable-pip-version-check",
            "-r",
        ];
        let installed = process::succeeds(
            &self.root,
            Command::new(self.environment_program("python"))
                .args(pip)
                .arg(&list),
        )?;
        if !installed {
            return Err("the tools of xtask/tools.txt could not be installed".into());
        }
        fs::write(&stamp, wanted)
            .map_err(|error| format!("cannot write {}: {error}", stamp.display()))
    }
}
