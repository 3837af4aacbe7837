//! Which test fails if a constant is doubled or halved: the trials and their table.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};

use super::source::Constant;
use crate::process::{output, shown_and_kept};
use crate::tools::Workspace;

/// The table of the trials, from the repository's root.
const TABLE: &str = "xtask/constants.toml";

/// The result of a trial whose value the compiler refuses.
pub(super) const NOT_COMPILED: &str = "does not compile";

/// Begins the result of a trial in which only a test that took too long failed.
const STOPPED: &str = "stopped: ";

/// A test that takes longer than this, in s, is stopped: another value may cause an endless search.
const LONGEST_TEST: u32 = 300;

/// The first test that fails with each value: empty if none does.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Trial {
    /// The value of the source that was doubled and halved.
    value: String,
    pub(super) doubled: String,
    pub(super) halved: String,
}

impl Trial {
    /// Whether a test fails with either value.
    pub(super) fn is_noticed(&self) -> bool {
        let fails = |result: &String| !result.is_empty() && !result.starts_with(STOPPED);
        fails(&self.doubled) && fails(&self.halved)
    }
}

/// All trials by file and name of the constant.
#[derive(Debug, Default, PartialEq)]
pub(super) struct Trials(BTreeMap<String, BTreeMap<String, Trial>>);

impl Trials {
    /// Reads the table in the repository at `root`.
    ///
    /// # Errors
    /// If it cannot be read, or a line was not written by [`write`](Self::write).
    pub(super) fn read(root: &Path) -> Result<Self, String> {
        let text = fs::read_to_string(root.join(TABLE))
            .map_err(|error| format!("cannot read {TABLE}: {error}"))?;
        Self::parse(&text)
    }

    fn parse(text: &str) -> Result<Self, String> {
        let mut trials = Self::default();
        let mut file = String::new();
        for line in text
            .lines()
            .filter(|l| !l.is_empty() && !l.starts_with('#'))
        {
            // Neither values nor names of tests contain quotes.
            let parts: Vec<&str> = line.split('"').collect();
            match parts[..] {
                ["[", path, "]"] => path.clone_into(&mut file),
                ["", name, _, value, _, doubled, _, halved, _] => {
                    let [value, doubled, halved] = [value, doubled, halved].map(str::to_owned);
                    let trial = Trial {
                        value,
                        doubled,
                        halved,
                    };
                    let of_file = trials.0.entry(file.clone()).or_default();
                    of_file.insert(name.to_owned(), trial);
                }
                _ => return Err(format!("{TABLE}: `{line}` is not a line of this table")),
            }
        }
        Ok(trials)
    }

    fn text(&self) -> String {
        let mut text =
            "# Written by `cargo xtask constants --try`: the first test that fails.\n".to_owned();
        for (file, constants) in &self.0 {
            let _ = write!(text, "\n[\"{file}\"]\n");
            for (
                name,
                Trial {
                    value,
                    doubled,
                    halved,
                },
            ) in constants
            {
                let _ = writeln!(
                    text,
                    "\"{name}\" = {{ value = \"{value}\", doubled = \"{doubled}\", halved = \"{halved}\" }}"
                );
            }
        }
        text
    }

    fn write(&self, root: &Path) -> Result<(), String> {
        fs::write(root.join(TABLE), self.text())
            .map_err(|error| format!("cannot write {TABLE}: {error}"))
    }

    /// The trial of `constant`, if its present value was tried.
    pub(super) fn of(&self, constant: &Constant) -> Option<&Trial> {
        let trial = self.0.get(&constant.file)?.get(&constant.name)?;
        (trial.value == constant.value).then_some(trial)
    }

    /// Removes the trials of constants that no longer exist.
    fn forget_others(&mut self, constants: &[Constant]) {
        for (file, trials) in &mut self.0 {
            trials.retain(|name, _| constants.iter().any(|c| c.file == *file && c.name == *name));
        }
        self.0.retain(|_, trials| !trials.is_empty());
    }
}

/// Tries the constants of a crate: `CRATE [NAME…] [-- OPTIONS of cargo nextest run]`. Without names it
/// goes on with those that were not tried yet. The table is written after each trial.
///
/// # Errors
/// If the sources cannot be copied, the tests fail without a change, or a file cannot be read or
/// written.
pub(super) fn run(
    workspace: &Workspace,
    constants: &[Constant],
    options: &[String],
) -> Result<(), String> {
    let mut parts = options.splitn(2, |word| word == "--");
    let (words, further) = (parts.next().unwrap_or(&[]), parts.next().unwrap_or(&[]));
    let (package, names) = words
        .split_first()
        .ok_or("--try needs the name of a crate")?;
    let mut trials = Trials::read(&workspace.root)?;
    trials.forget_others(constants);
    let chosen: Vec<&Constant> = constants
        .iter()
        .filter(|c| c.package == *package)
        .filter(|c| match names {
            [] => trials.of(c).is_none(),
            names => names.contains(&c.name),
        })
        .collect();
    let copy = Copy::new(workspace, package, further)?;
    let failing = copy.failing_test(workspace)?;
    if !failing.is_empty() {
        return Err(format!("without a change, {failing}"));
    }
    for (index, constant) in chosen.iter().enumerate() {
        println!(
            "\n── {} of {}: {} {}",
            index + 1,
            chosen.len(),
            constant.file,
            constant.name
        );
        let [doubled, halved] =
            [true, false].map(|double| copy.result(workspace, constant, double));
        let trial = Trial {
            value: constant.value.clone(),
            doubled: doubled?,
            halved: halved?,
        };
        println!("doubled: {}\nhalved: {}", trial.doubled, trial.halved);
        let of_file = trials.0.entry(constant.file.clone()).or_default();
        of_file.insert(constant.name.clone(), trial);
        trials.write(&workspace.root)?;
    }
    Ok(())
}

/// A copy of the sources in `target/constants` whose tests are run.
struct Copy {
    folder: PathBuf,
    package: String,
    /// Further options of `cargo nextest run`.
    options: Vec<String>,
}

impl Copy {
    fn new(workspace: &Workspace, package: &str, options: &[String]) -> Result<Self, String> {
        let folder = workspace.target().join("constants").join("sources");
        let trouble = |error: std::io::Error| format!("cannot copy the sources: {error}");
        if folder.exists() {
            fs::remove_dir_all(&folder).map_err(trouble)?;
        }
        let mut list = std::process::Command::new("git");
        list.args(["ls-files", "--cached", "--others", "--exclude-standard"]);
        let files = output(&workspace.root, &mut list).ok_or("git ls-files failed")?;
        for file in files.lines().filter(|f| workspace.root.join(f).is_file()) {
            let place = folder.join(file);
            fs::create_dir_all(place.with_file_name("")).map_err(trouble)?;
            fs::copy(workspace.root.join(file), place).map_err(trouble)?;
        }
        let limit = format!(
            "[profile.default]\nslow-timeout = {{ period = \"{LONGEST_TEST}s\", terminate-after = 1 }}\n"
        );
        fs::write(folder.join("limit.toml"), limit).map_err(trouble)?;
        Ok(Self {
            folder,
            package: package.to_owned(),
            options: options.to_vec(),
        })
    }

    /// The first test that fails with the scaled value of `constant`.
    fn result(
        &self,
        workspace: &Workspace,
        constant: &Constant,
        double: bool,
    ) -> Result<String, String> {
        let path = self.folder.join(&constant.file);
        let trouble = |error: std::io::Error| format!("{}: {error}", path.display());
        let text = fs::read_to_string(&path).map_err(trouble)?;
        let mut changed = text.clone();
        changed.replace_range(constant.place.clone(), &constant.scaled(double));
        fs::write(&path, changed).map_err(trouble)?;
        let failing = self.failing_test(workspace);
        fs::write(&path, text).map_err(trouble)?;
        failing
    }

    /// The first test that fails; empty if none does.
    fn failing_test(&self, workspace: &Workspace) -> Result<String, String> {
        let mut command =
            workspace.cargo(&["nextest", "run", "--release", "--config-file", "limit.toml"]);
        command
            .args(["--package", &self.package])
            .args(&self.options);
        command.env(
            "CARGO_TARGET_DIR",
            workspace.target().join("constants").join("build"),
        );
        command
            .env("CARGO_INCREMENTAL", "1")
            .env("PROPTEST_RNG_SEED", "1");
        let (lines, succeeded) = shown_and_kept(&self.folder, &mut command)?;
        if succeeded {
            return Ok(String::new());
        }
        Ok(failed_test(&lines).unwrap_or_else(|| NOT_COMPILED.to_owned()))
    }
}

/// The first test that nextest reports as failed. One that was stopped is named as such: the value
/// may cause an endless search, or the machine may be busy.
fn failed_test(lines: &[String]) -> Option<String> {
    let name = |words: &[&str]| {
        let is_one = |line: &&String| words.iter().any(|word| line.trim_start().starts_with(word));
        lines.iter().find(is_one)?.split_whitespace().last()
    };
    let failed = name(&["FAIL [", "SIGABRT [", "SIGSEGV [", "SIGKILL ["]).map(str::to_owned);
    failed.or_else(|| Some(format!("{STOPPED}{}", name(&["TIMEOUT ["])?)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_is_read_as_it_is_written() {
        let trial = Trial {
            value: "[0.3, 2.2]".to_owned(),
            doubled: "range::is_wide".to_owned(),
            halved: String::new(),
        };
        let constants = BTreeMap::from([
            ("RANGE".to_owned(), trial.clone()),
            ("RANGE#2".to_owned(), trial),
        ]);
        let trials = Trials(BTreeMap::from([(
            "crates/a/src/b.rs".to_owned(),
            constants,
        )]));
        assert_eq!(Trials::parse(&trials.text()), Ok(trials));
        assert!(Trials::parse("RANGE = 3\n").is_err());
    }

    #[test]
    fn the_first_failed_test_is_found() {
        // Output of nextest 0.9.143.
        let lines = [
            "        PASS [   0.003s] (1/3) a::b c",
            "        FAIL [   0.008s] (2/3) a::b range::is_wide",
            "  stderr ───",
            "     TIMEOUT [ 300.0s] (3/3) a::b d",
        ];
        let lines = lines.map(str::to_owned);
        assert_eq!(failed_test(&lines).as_deref(), Some("range::is_wide"));
        assert_eq!(failed_test(&lines[2..]).as_deref(), Some("stopped: d"));
        assert_eq!(failed_test(&lines[..1]), None);
    }
}
