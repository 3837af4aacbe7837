//! The pages of the reference, generated from the tables that the program itself reads.

mod case;
mod catalogue;
mod laws;
mod observables;
mod paper;
mod schema;
mod study;

use nanotap::study::registry::STUDIES;
use nanotap_paper::Report;

/// Every page: its name in `docs/reference/` and its Markdown.
pub(crate) fn pages(report: &Report) -> Vec<(String, String)> {
    let mut pages = committed();
    pages.push(("paper.md".to_owned(), paper::page(report)));
    pages
}

/// The pages that follow from the program's tables alone, which lie in the repository: its hosts show
/// them.
pub(crate) fn committed() -> Vec<(String, String)> {
    let mut pages = vec![
        ("case.md".to_owned(), case::page()),
        ("observables.md".to_owned(), observables::page()),
        ("laws.md".to_owned(), laws::page()),
        ("catalogue.md".to_owned(), catalogue::page()),
    ];
    for entry in STUDIES {
        pages.push((format!("{}.md", entry.name), study::page(entry)));
    }
    pages
}

/// A row of a table.
fn row<C: AsRef<str>>(cells: &[C]) -> String {
    let cells: Vec<String> = cells.iter().map(|cell| in_cell(cell.as_ref())).collect();
    format!("| {} |\n", cells.join(" | "))
}

/// The header of a table.
fn head(titles: &[&str]) -> String {
    format!("{}|{}\n", row(titles), "---|".repeat(titles.len()))
}

/// Text escaped for a table cell.
fn in_cell(text: &str) -> String {
    plain(text).replace('\n', " ").replace('|', "\\|")
}

/// Text in which no character has a meaning in Markdown; code stays code.
fn plain(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    let mut code = false;
    for sign in text.chars() {
        match sign {
            '`' => code = !code,
            '*' | '_' | '$' | '<' | '[' | ']' if !code => escaped.push('\\'),
            _ => {}
        }
        escaped.push(sign);
    }
    escaped
}

/// Formats a word as Markdown code; an empty word stays empty.
fn code(word: &str) -> String {
    if word.is_empty() {
        return String::new();
    }
    format!("`{word}`")
}
