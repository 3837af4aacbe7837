//! The site: the page that needs no server, and the documents, prepared by `nanotap-book` and built by
//! mdBook, in its folder `docs`.

use std::fs;
use std::path::Path;

use crate::page;
use crate::process::must;
use crate::tally::Tally;
use crate::tools::Workspace;

/// Version of mdBook, which is built from source into `.tools` if it is missing there.
const MDBOOK: &str = "0.5.4";

/// Builds the site; `options` are those of `nanotap-book`.
///
/// # Errors
/// If a tool is missing or fails; the message names it.
pub(crate) fn run(workspace: &Workspace, options: &[String]) -> Result<Tally, String> {
    let mut mdbook = workspace.cargo_tool("mdbook", MDBOOK, &["--features", "search"])?;
    let folder = workspace.target().join("book");
    let sources = folder.join("src");
    if sources.exists() {
        fs::remove_dir_all(&sources)
            .map_err(|error| format!("cannot empty {}: {error}", sources.display()))?;
    }
    fs::create_dir_all(&folder)
        .map_err(|error| format!("cannot make {}: {error}", folder.display()))?;
    for name in ["book.toml", "book.css"] {
        fs::copy(workspace.root.join("docs").join(name), folder.join(name))
            .map_err(|error| format!("cannot copy docs/{name}: {error}"))?;
    }
    let mut lay_out = workspace.program("nanotap-book")?;
    lay_out.arg(&workspace.root).arg(&sources).args(options);
    for command in [&mut lay_out, mdbook.arg("build").arg(&folder)] {
        must(&workspace.root, command, "the site could not be built")?;
    }
    let site = folder.join("site");
    let mut tally = Tally::check(true);
    match page::written(workspace)? {
        Some(page) => front(&page, &site)?,
        None => tally += page::SKIPPED,
    }
    println!("{}", site.join("docs").join("index.html").display());
    Ok(tally)
}

/// The front page of the site is the page itself, with one sentence above it.
fn front(page: &Path, site: &Path) -> Result<(), String> {
    const BODY: &str = "<body>\n";
    const SENTENCE: &str = "<p class=\"front\">nanotap computes every motion that a tapping lever can have at \
        your settings, and what you would measure. <a href=\"docs/index.html\">Documents and \
        installation</a></p>\n";
    let failed = |error: std::io::Error| format!("cannot copy the page: {error}");
    for file in fs::read_dir(page).map_err(failed)?.flatten() {
        fs::copy(file.path(), site.join(file.file_name())).map_err(failed)?;
    }
    let index = site.join("index.html");
    let text = fs::read_to_string(&index).map_err(failed)?;
    fs::write(&index, text.replacen(BODY, &format!("{BODY}{SENTENCE}"), 1)).map_err(failed)
}
