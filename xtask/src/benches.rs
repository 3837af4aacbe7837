//! `cargo xtask bench`: runs every bench and writes `docs/benches.md`.

use std::fmt::Write as _;
use std::path::Path;

use crate::process::shown_and_kept;
use crate::tally::Tally;
use crate::tools::Workspace;

/// The crates with benches, and headings for their tables.
const CRATES: [(&str, &str); 2] = [
    (
        "nanotap-flow",
        "Lower bound: exponentials and rotations alone",
    ),
    ("nanotap", "The exact flow and the studies that use it"),
];

/// Folder for datasets in memory, if the system has one.
const MEMORY: &str = "/dev/shm";

/// Runs the benches and writes the tables.
///
/// # Errors
/// If a bench does not build or fails, or the page cannot be written.
pub(crate) fn run(workspace: &Workspace) -> Result<Tally, String> {
    let mut page = String::from(HEAD);
    for (name, about) in CRATES {
        let mut command = workspace.cargo(&["bench", "--quiet", "--package", name]);
        command.args(["--benches", "--", "--color", "never"]);
        // A disk that has just deleted thousands of files creates new ones more slowly than their
        // contents are computed.
        if Path::new(MEMORY).is_dir() {
            command.env("TMPDIR", MEMORY);
        }
        let (lines, succeeded) = shown_and_kept(&workspace.root, &mut command)?;
        if !succeeds_with_results(&lines, succeeded) {
            return Err(format!("the benches of {name} failed"));
        }
        let _ = write!(page, "\n## {about}\n\n{}", tables(&measured(&lines)));
    }
    let path = workspace.root.join("docs").join("benches.md");
    std::fs::create_dir_all(workspace.root.join("docs"))
        .and_then(|()| std::fs::write(&path, page))
        .map_err(|error| format!("cannot write {}: {error}", path.display()))?;
    println!("\nwritten: docs/benches.md");
    Ok(Tally::check(true))
}

const HEAD: &str = "\
# Benches

<!-- Written by `cargo xtask bench`. -->

The fastest sample of each bench, on one core unless the bench says otherwise; other programs on
the machine can only add time. Datasets are in memory if the system provides a file system in memory.
`period` benches run 100 drive periods. The code in `crates/*/benches` describes each bench;
`docs/performance.md` discusses the results.
";

fn succeeds_with_results(lines: &[String], succeeded: bool) -> bool {
    succeeded && !measured(lines).is_empty()
}

/// One bench with one argument.
#[derive(Debug, PartialEq)]
struct Measured {
    /// Names of its groups, its own name, and its argument if it has one.
    path: Vec<String>,
    /// Time of the fastest sample.
    fastest: String,
}

/// Parses the output of divan: the fastest time of each benchmark.
fn measured(lines: &[String]) -> Vec<Measured> {
    let mut groups: Vec<String> = Vec::new();
    let mut found = Vec::new();
    for line in lines {
        let Some(at) = ["├─ ", "╰─ "].iter().find_map(|mark| line.find(mark)) else {
            continue;
        };
        // Each level of the tree is indented by three characters.
        let depth = line[..at].chars().count() / 3;
        let rest = line[at..].chars().skip(3).collect::<String>();
        let first_column = rest.split('│').next().unwrap_or_default();
        let mut words: Vec<&str> = first_column.split_whitespace().collect();
        groups.truncate(depth);
        // The last two words of a result are its time and unit.
        let unit = words.last().copied().unwrap_or_default();
        if words.len() >= 3 && ["ps", "ns", "µs", "ms", "s"].contains(&unit) {
            let time = words.split_off(words.len() - 2).join(" ");
            let mut path = groups.clone();
            path.push(words.join(" "));
            found.push(Measured {
                path,
                fastest: time,
            });
        } else {
            groups.push(words.join(" "));
        }
    }
    found
}

/// A table for each set of arguments, with one row per bench.
fn tables(measured: &[Measured]) -> String {
    let mut rows: Vec<(String, Vec<(&str, &str)>)> = Vec::new();
    for Measured { path, fastest } in measured {
        let Some((argument, bench)) = path.split_last() else {
            continue;
        };
        let bench = bench.join(" · ");
        match rows.last_mut() {
            Some((name, cells)) if *name == bench => cells.push((argument, fastest)),
            _ => rows.push((bench, vec![(argument, fastest)])),
        }
    }
    let mut text = String::new();
    let mut headed: Vec<&str> = Vec::new();
    for (bench, cells) in &rows {
        let arguments: Vec<&str> = cells.iter().map(|cell| cell.0).collect();
        if arguments != headed {
            if !headed.is_empty() {
                text.push('\n');
            }
            let _ = writeln!(text, "| bench | {} |", arguments.join(" | "));
            let _ = writeln!(text, "|---|{}", "---:|".repeat(arguments.len()));
            headed = arguments;
        }
        let times: Vec<&str> = cells.iter().map(|cell| cell.1).collect();
        let _ = writeln!(text, "| {bench} | {} |", times.join(" | "));
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Output of divan 0.1.21.
    const TREE: &str = "\
speed                    fastest       │ slowest       │ median        │ mean          │ samples │ iters
├─ period                              │               │               │               │         │
│  ├─ fast_drive                       │               │               │               │         │
│  │  ├─ 1               53.69 µs      │ 121.2 µs      │ 53.79 µs      │ 54.85 µs      │ 100     │ 100
│  │  │                  1.862 Mitem/s │ 824.6 Kitem/s │ 1.858 Mitem/s │ 1.823 Mitem/s │         │
│  │  ╰─ 2               54.79 µs      │ 81.75 µs      │ 55 µs         │ 55.48 µs      │ 100     │ 100
│  ╰─ grazing                          │               │               │               │         │
│     ╰─ -0.000001       130.8 µs      │ 193.2 µs      │ 133.3 µs      │ 134.9 µs      │ 100     │ 100
╰─ setup                               │               │               │               │         │
   ╰─ model                            │               │               │               │         │
      ├─ 1               4 µs          │ 5 µs          │ 4 µs          │ 4 µs          │ 100     │ 100
      ╰─ 2               5.819 µs      │ 41.55 µs      │ 6.079 µs      │ 6.478 µs      │ 100     │ 100
";

    fn lines() -> Vec<String> {
        TREE.lines().map(str::to_owned).collect()
    }

    #[test]
    fn reads_divans_tree() {
        let found = measured(&lines());
        let paths: Vec<String> = found.iter().map(|m| m.path.join("/")).collect();
        assert_eq!(
            paths,
            [
                "period/fast_drive/1",
                "period/fast_drive/2",
                "period/grazing/-0.000001",
                "setup/model/1",
                "setup/model/2"
            ]
        );
        assert_eq!(found[2].fastest, "130.8 µs");
        assert_eq!(found[3].fastest, "4 µs");
    }

    #[test]
    fn makes_a_table_of_benches_with_the_same_arguments() {
        let expected = "\
| bench | 1 | 2 |
|---|---:|---:|
| period · fast_drive | 53.69 µs | 54.79 µs |

| bench | -0.000001 |
|---|---:|
| period · grazing | 130.8 µs |

| bench | 1 | 2 |
|---|---:|---:|
| setup · model | 4 µs | 5.819 µs |
";
        assert_eq!(tables(&measured(&lines())), expected);
    }

    #[test]
    fn a_run_without_results_is_a_failure() {
        assert!(!succeeds_with_results(&[], true));
        assert!(!succeeds_with_results(&lines(), false));
    }
}
