//! The figures of the documents, each drawn by the command on its page.
//!
//! A page shows `![…](PATH/NAME.svg)` and has a line `$ nanotap … --plot NAME.svg` in a `console`
//! block. The commands run in a folder with all case files and data of the documents.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use crate::process::must;
use crate::tally::Tally;
use crate::tools::Workspace;

/// Draws the figures. Options: `--program PATH` uses this program instead of building one; other
/// words select the figures whose path contains one of them.
///
/// # Errors
/// If the program cannot be built, a command fails, or a file cannot be read or written.
pub(crate) fn run(workspace: &Workspace, options: &[String]) -> Result<Tally, String> {
    let mut selected = options.to_vec();
    let program = if let Some(k) = selected.iter().position(|word| word == "--program") {
        let path = selected.get(k + 1).ok_or("--program needs a path")?.clone();
        selected.drain(k..k + 2);
        workspace.root.join(path)
    } else {
        let mut build = workspace.cargo(&["build", "--release", "--package", "nanotap-cli"]);
        must(
            &workspace.root,
            &mut build,
            "the program could not be built",
        )?;
        workspace.target().join("release").join("nanotap")
    };
    let pages = pages(&workspace.root)?;
    let folder = workspace.target().join("figures");
    prepare(&folder, &workspace.root, &pages)?;
    let mut drawn = 0;
    for page in &pages {
        let text = read(page)?;
        let pictures = pictures(&text);
        for (command, name) in commands(&text) {
            let Some(picture) = pictures.iter().find(|path| file_name(path) == name) else {
                continue;
            };
            if !selected.is_empty() && !selected.iter().any(|word| picture.contains(word)) {
                continue;
            }
            let mut figure = Command::new(&program);
            figure.args(words(command)).args(["--quiet", "--force"]);
            figure.stdout(std::process::Stdio::null());
            must(
                &folder,
                &mut figure,
                &format!("{picture} could not be drawn"),
            )?;
            let place = page.with_file_name("").join(picture);
            if let Some(parent) = place.parent() {
                fs::create_dir_all(parent).map_err(|e| format!("{}: {e}", parent.display()))?;
            }
            fs::copy(folder.join(name), &place)
                .map_err(|error| format!("cannot write {}: {error}", place.display()))?;
            drawn += 1;
        }
    }
    println!("{drawn} figures");
    Ok(Tally::check(true))
}

/// The README and every page below `docs`.
fn pages(root: &Path) -> Result<Vec<PathBuf>, String> {
    let mut pages = vec![root.join("README.md")];
    let mut folders = vec![root.join("docs")];
    while let Some(folder) = folders.pop() {
        let mut entries = entries(&folder)?;
        entries.sort();
        for path in entries {
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|ending| ending == "md") {
                pages.push(path);
            }
        }
    }
    Ok(pages)
}

/// A new folder with the case files and data next to the pages, and the cases that the README shows.
fn prepare(folder: &Path, root: &Path, pages: &[PathBuf]) -> Result<(), String> {
    let trouble = |error: std::io::Error| format!("{}: {error}", folder.display());
    if folder.exists() {
        fs::remove_dir_all(folder).map_err(trouble)?;
    }
    fs::create_dir_all(folder).map_err(trouble)?;
    let mut sources: Vec<&Path> = pages.iter().filter_map(|page| page.parent()).collect();
    sources.dedup();
    for source in sources.into_iter().filter(|source| *source != root) {
        for path in entries(source)? {
            let is_input = path
                .extension()
                .is_some_and(|ending| ending == "toml" || ending == "csv");
            if let Some(name) = path.file_name().filter(|_| is_input) {
                fs::copy(&path, folder.join(name)).map_err(trouble)?;
            }
        }
    }
    let front = read(&root.join("README.md"))?;
    for block in front.split("```toml\n# ").skip(1) {
        let text = block.split("```").next().unwrap_or_default();
        let name = text.lines().next().unwrap_or_default();
        fs::write(folder.join(name), format!("# {text}")).map_err(trouble)?;
    }
    Ok(())
}

fn entries(folder: &Path) -> Result<Vec<PathBuf>, String> {
    let trouble = |error: std::io::Error| format!("cannot read {}: {error}", folder.display());
    let entries = fs::read_dir(folder).map_err(trouble)?;
    entries
        .map(|entry| entry.map(|e| e.path()).map_err(trouble))
        .collect()
}

fn read(path: &Path) -> Result<String, String> {
    fs::read_to_string(path).map_err(|error| format!("cannot read {}: {error}", path.display()))
}

/// Paths of the pictures on a page, relative to it.
fn pictures(text: &str) -> Vec<&str> {
    let links = text.split("](").skip(1);
    let paths = links.filter_map(|rest| rest.split(')').next());
    let is_picture = |path: &&str| matches!(path.rsplit('.').next(), Some("svg" | "png"));
    paths.filter(is_picture).collect()
}

/// Arguments of each command that draws a figure, and the name of the figure's file.
fn commands(text: &str) -> Vec<(&str, &str)> {
    let lines = text
        .lines()
        .filter_map(|line| line.strip_prefix("$ nanotap "));
    lines
        .filter_map(|line| {
            let after = line.split_once("--plot ")?.1;
            Some((line, after.split(' ').next()?))
        })
        .collect()
}

fn file_name(path: &str) -> &str {
    path.rsplit('/').next().unwrap_or(path)
}

/// Words of a command line; quotes group them.
fn words(line: &str) -> Vec<String> {
    let mut words = vec![String::new()];
    let mut is_quoted = false;
    for character in line.chars() {
        match character {
            '"' => is_quoted = !is_quoted,
            ' ' if !is_quoted => words.push(String::new()),
            _ => {
                if let Some(word) = words.last_mut() {
                    word.push(character);
                }
            }
        }
    }
    words.retain(|word| !word.is_empty());
    words
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_page_names_its_pictures_and_commands() {
        let page = "```console\n$ nanotap orbit a.toml --set \"gap.tip=9 nm\" --plot a.svg --json\n\
                    ```\n![an orbit](gallery/a.svg) and [text](b.md)\n";
        assert_eq!(pictures(page), ["gallery/a.svg"]);
        let [(command, name)] = commands(page)[..] else {
            panic!("one command")
        };
        assert_eq!((name, file_name("gallery/a.svg")), ("a.svg", "a.svg"));
        let expected = [
            "orbit",
            "a.toml",
            "--set",
            "gap.tip=9 nm",
            "--plot",
            "a.svg",
            "--json",
        ];
        assert_eq!(words(command), expected);
    }
}
