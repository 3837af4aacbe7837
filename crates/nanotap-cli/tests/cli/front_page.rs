//! The examples of the README: every command is run as written, and what the page shows below it is
//! what the program prints. A line `…` stands for any number of lines.

use std::path::Path;

use crate::util::Folder;
use crate::worked_cases::words;

/// The text of the README.
pub(crate) fn text() -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../README.md");
    std::fs::read_to_string(path).unwrap()
}

/// Names and texts of the case files that the page shows: blocks that begin `# NAME.toml`.
pub(crate) fn cases(page: &str) -> impl Iterator<Item = (&str, &str)> {
    let blocks = page.split("```toml\n").skip(1);
    blocks.map(|block| {
        let case = block.split("```").next().unwrap();
        (case.lines().next().unwrap().trim_start_matches("# "), case)
    })
}

/// Commands of `nanotap` whose output a page shows, with the lines that it shows below each.
pub(crate) fn examples(text: &str) -> Vec<(&str, Vec<&str>)> {
    let blocks = text.split("```console\n").skip(1);
    let blocks = blocks.map(|block| block.split("```").next().unwrap());
    let commands = blocks.flat_map(|block| block.split("$ nanotap ").skip(1));
    let all = commands.map(|block| {
        let (command, shown) = block.split_once('\n').unwrap();
        (command, shown.lines().collect::<Vec<_>>())
    });
    all.filter(|(_, shown)| !shown.is_empty()).collect()
}

/// Whether `printed` consists of the lines `shown`, `…` standing for any number of lines.
fn agrees(shown: &[&str], printed: &[&str]) -> bool {
    match shown.split_first() {
        None => printed.is_empty(),
        Some((&"…", rest)) => (0..=printed.len()).any(|k| agrees(rest, &printed[k..])),
        Some((line, rest)) => printed.first() == Some(line) && agrees(rest, &printed[1..]),
    }
}

/// Runs a command in `folder` and compares what it prints with the lines that a page shows.
pub(crate) fn prints(folder: &Folder, command: &str, shown: &[&str]) {
    let arguments = words(command);
    let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
    let outcome = folder.run(&arguments);
    assert_eq!(outcome.code, 0, "{command}: {}", outcome.stderr);
    // Progress depends on time; notes and warnings do not.
    let remarks = outcome.stderr.lines();
    let remarks = remarks.filter(|l| l.starts_with("note: ") || l.starts_with("warning: "));
    let printed: Vec<&str> = remarks.chain(outcome.stdout.lines()).collect();
    assert!(
        shown.len() > 2 && agrees(shown, &printed),
        "{command}: the page shows\n{}\nbut the program prints\n{}",
        shown.join("\n"),
        printed.join("\n")
    );
}

#[test]
fn the_readme_shows_what_the_program_prints() {
    let text = text();
    let folder = Folder::new();
    for (name, case) in cases(&text) {
        folder.write(name, case);
    }
    let examples = examples(&text);
    assert_eq!(examples.len(), 3);
    for (command, shown) in examples {
        prints(&folder, command, &shown);
    }
}
