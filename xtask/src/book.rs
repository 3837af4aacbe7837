//! The site of the documents: prepared by `nanotap-book`, built by mdBook into `target/book/site`.

use std::fs;

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
    let mut lay_out = workspace.cargo(&["run", "--release", "--package", "nanotap-book", "--"]);
    lay_out.arg(&workspace.root).arg(&sources).args(options);
    for command in [&mut lay_out, mdbook.arg("build").arg(&folder)] {
        must(&workspace.root, command, "the site could not be built")?;
    }
    println!("{}", folder.join("site").join("index.html").display());
    Ok(Tally::check(true))
}
