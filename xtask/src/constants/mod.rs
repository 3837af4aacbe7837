//! `cargo xtask constants`: writes `docs/constants.md` from the sources; `--try` finds the tests that
//! fail if a constant is doubled or halved.

mod left_out;
mod page;
mod source;
mod trials;

use crate::tally::Tally;
use crate::tools::Workspace;
use trials::Trials;

/// The page, from the repository's root.
const PAGE: &str = "docs/constants.md";

/// Writes the page; with the options `--try CRATE [NAME…] [-- OPTIONS of cargo nextest run]` tries the
/// constants first.
///
/// # Errors
/// If an option is unknown, a trial cannot be made, or a file cannot be read or written.
pub(crate) fn run(workspace: &Workspace, options: &[String]) -> Result<Tally, String> {
    let constants = source::constants(&workspace.root)?;
    match options.split_first() {
        None => {}
        Some((option, rest)) if option == "--try" => trials::run(workspace, &constants, rest)?,
        Some((option, _)) => return Err(format!("unknown option `{option}`")),
    }
    let page = page::page(&constants, &Trials::read(&workspace.root)?);
    std::fs::write(workspace.root.join(PAGE), page)
        .map_err(|error| format!("cannot write {PAGE}: {error}"))?;
    println!("{} constants, written: {PAGE}", constants.len());
    Ok(Tally::check(true))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_page_says_what_the_sources_say() {
        let root = Workspace::find().root;
        let constants = source::constants(&root).unwrap();
        let page = page::page(&constants, &Trials::read(&root).unwrap());
        let written = std::fs::read_to_string(root.join(PAGE)).unwrap();
        assert!(written == page, "run `cargo xtask constants`");
    }

    #[test]
    fn every_constant_has_a_meaning() {
        let constants = source::constants(&Workspace::find().root).unwrap();
        let without: Vec<String> = constants
            .iter()
            .filter(|c| c.meaning.is_empty())
            .map(|c| format!("{} {}", c.file, c.name))
            .collect();
        assert!(
            without.is_empty(),
            "no comment above\n{}",
            without.join("\n")
        );
    }
}
