//! The pages of the site, their errors, and their layout for mdBook.

#![expect(
    clippy::disallowed_methods,
    reason = "it reads files of this repository"
)]

use std::collections::{BTreeMap, BTreeSet};
use std::fmt;
use std::fs;
use std::path::{Component, Path, PathBuf};

use nanotap_explorer::link::{link, with_changes};
use nanotap_paper::Report;

use crate::page::Page;
use crate::reference;

/// Pages in the repository's root that belong to the site.
const AT_ROOT: &[&str] = &[
    "README.md",
    "ARCHITECTURE.md",
    "CONTRIBUTING.md",
    "CHANGELOG.md",
];

/// The page on the paper's statements in the table of contents, and what stands before it: it is made
/// with the site, from a report that takes minutes.
const STATEMENTS: &str = "  - [Every statement of the paper](reference/paper.md)\n";
const BEFORE_STATEMENTS: &str = "](paper.md)\n";

/// Folder of the tutorials, and of the worked cases that they take up.
const TUTORIALS: &str = "docs/tutorials/";
const CASES: &str = "docs/cases";

/// Folder of the pictures of the report on the paper.
const PICTURES: &str = "docs/reference/paper/";

/// An error in a page.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Trouble {
    /// Path of the page, from the repository's root.
    pub page: String,
    /// Description of the error, in words.
    pub reason: String,
}

impl fmt::Display for Trouble {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "{}: {}", self.page, self.reason)
    }
}

/// Compares the pages of the reference in the repository at `root` with the program's tables; returns
/// those that differ. With `write` they are written anew.
///
/// # Errors
/// If a page cannot be written.
pub fn outdated_reference(root: &Path, write: bool) -> Result<Vec<String>, Trouble> {
    let mut outdated = Vec::new();
    for (name, page) in reference::committed() {
        let name = format!("docs/reference/{name}");
        if fs::read_to_string(root.join(&name)).is_ok_and(|there| there == page) {
            continue;
        }
        if write {
            put(root, &name, page.as_bytes())?;
        }
        outdated.push(name);
    }
    Ok(outdated)
}

/// All pages of the book, with their table of contents.
pub struct Site {
    root: PathBuf,
    /// Pages by path from the repository's root, with `/`.
    pages: BTreeMap<String, Page>,
    summary: Page,
}

impl Site {
    /// The pages of the repository at `root`, and those generated from the program's tables and
    /// from a report on the paper.
    ///
    /// # Errors
    /// If a page cannot be read.
    pub fn read(root: &Path, report: &Report) -> Result<Self, Trouble> {
        let mut pages = BTreeMap::new();
        let mut names: Vec<String> = AT_ROOT.iter().map(|&name| name.to_owned()).collect();
        find_pages(root, "docs", &mut names)?;
        for name in names {
            let mut page = text(root, &name)?;
            if name == "docs/SUMMARY.md" {
                page = page.replacen(
                    BEFORE_STATEMENTS,
                    &format!("{BEFORE_STATEMENTS}{STATEMENTS}"),
                    1,
                );
            }
            pages.insert(name, Page::read(page));
        }
        let summary = pages.remove("docs/SUMMARY.md").ok_or_else(|| Trouble {
            page: "docs/SUMMARY.md".into(),
            reason: "is not there".into(),
        })?;
        for (name, text) in reference::pages(report) {
            pages.insert(format!("docs/reference/{name}"), Page::read(text));
        }
        Ok(Self {
            root: root.to_owned(),
            pages,
            summary,
        })
    }

    /// Returns the number of pages.
    pub fn len(&self) -> usize {
        self.pages.len()
    }

    /// Whether there are no pages.
    pub fn is_empty(&self) -> bool {
        self.pages.is_empty()
    }

    /// All errors: pages that are missing in the summary or listed twice, links and anchors without
    /// target, formulas that cannot be typeset.
    pub fn troubles(&self) -> Vec<Trouble> {
        let mut troubles = Vec::new();
        let mut listed = BTreeSet::new();
        for target in self.listed() {
            if !self.pages.contains_key(&target) {
                troubles.push(wrong(
                    "docs/SUMMARY.md",
                    format!("there is no page {target}"),
                ));
            }
            if !listed.insert(target.clone()) {
                troubles.push(wrong("docs/SUMMARY.md", format!("{target} stands twice")));
            }
        }
        for (name, page) in &self.pages {
            if !listed.contains(name) {
                troubles.push(wrong(name, "is not in docs/SUMMARY.md".into()));
            }
            for (formula, error) in &page.unreadable {
                troubles.push(wrong(
                    name,
                    format!("${formula}$ cannot be typeset: {error}"),
                ));
            }
            for link in &page.links {
                if let Some(reason) = self.dead(name, page, &link.target) {
                    troubles.push(wrong(name, reason));
                }
            }
        }
        troubles
    }

    /// Writes the site below `folder`: `SUMMARY.md`, every page, and every linked file, under their
    /// paths in the repository.
    ///
    /// # Errors
    /// If a file cannot be read or written.
    pub fn write(&self, folder: &Path) -> Result<(), Trouble> {
        let summary = self.summary.written(
            |target| {
                let target = from_root("docs/SUMMARY.md", target)?;
                Some(renamed(&target).unwrap_or(target))
            },
            |_| None,
            |_| None,
        );
        put(folder, "SUMMARY.md", summary.as_bytes())?;
        for (name, page) in &self.pages {
            let text = page.written(
                renamed,
                |target| self.live(name, target),
                |block| self.step(name, block),
            );
            put(
                folder,
                &renamed(name).unwrap_or_else(|| name.clone()),
                text.as_bytes(),
            )?;
            for link in &page.links {
                let Some(target) = from_root(name, without_anchor(&link.target)) else {
                    continue;
                };
                let file = self.root.join(&target);
                if !self.pages.contains_key(&target) && file.is_file() {
                    let bytes =
                        fs::read(&file).map_err(|error| wrong(&target, error.to_string()))?;
                    put(folder, &target, &bytes)?;
                }
            }
        }
        Ok(())
    }

    /// The link that opens a case file in the page, after a link to it.
    fn live(&self, name: &str, target: &str) -> Option<String> {
        let link = self.opens(name, &from_root(name, target)?)?;
        Some(format!(" ([open this case]({link}))"))
    }

    /// The link that opens the case of the first command of a tutorial's step, with what `--set` changes.
    fn step(&self, name: &str, block: &str) -> Option<String> {
        if !name.starts_with(TUTORIALS) {
            return None;
        }
        block.lines().find_map(|line| {
            let words = words(line.strip_prefix("$ nanotap ")?);
            let places = |file: &String| [from_root(name, file), Some(format!("{CASES}/{file}"))];
            let mut paths = words.iter().flat_map(places).flatten();
            let link = paths.find_map(|path| self.opens(name, &path))?;
            let pairs = words.windows(2).filter(|pair| pair[0] == "--set");
            let set: Vec<(&str, &str)> = pairs.filter_map(|pair| pair[1].split_once('=')).collect();
            Some(format!("[Open this case]({})", with_changes(&link, &set)))
        })
    }

    /// The link from the page `name` that opens the case file at a path from the repository's root.
    fn opens(&self, name: &str, path: &str) -> Option<String> {
        let path = self.root.join(path);
        path.extension().filter(|ending| *ending == "toml")?;
        let case = fs::read_to_string(path).ok()?;
        // The explorer is one folder above the documents.
        let page = "../".repeat(name.matches('/').count() + 1);
        Some(link(&page, &case))
    }

    /// The pages in the summary, from the repository's root.
    fn listed(&self) -> impl Iterator<Item = String> {
        let links = self.summary.links.iter();
        links.filter_map(|link| from_root("docs/SUMMARY.md", &link.target))
    }

    /// Why a link of a page has no target; `None` if it has one.
    fn dead(&self, name: &str, page: &Page, target: &str) -> Option<String> {
        let (path, anchor) = match target.split_once('#') {
            Some((path, anchor)) => (path, Some(anchor)),
            None => (target, None),
        };
        if path.contains("://") {
            return None;
        }
        let there = if path.is_empty() {
            Some(page)
        } else {
            let Some(path) = from_root(name, path) else {
                return Some(format!("{target} leads out of the repository"));
            };
            let there = self.pages.get(&path);
            let made = path.starts_with(PICTURES);
            if there.is_none() && !made && !self.root.join(&path).is_file() {
                return Some(format!("{target} leads nowhere"));
            }
            there
        };
        let (there, anchor) = (there?, anchor?);
        let found = there.anchors.iter().any(|heading| heading == anchor);
        (!found).then(|| format!("{target} names no heading"))
    }
}

fn wrong(page: &str, reason: String) -> Trouble {
    Trouble {
        page: page.to_owned(),
        reason,
    }
}

fn text(root: &Path, name: &str) -> Result<String, Trouble> {
    fs::read_to_string(root.join(name)).map_err(|error| wrong(name, error.to_string()))
}

/// Every Markdown file below `folder`.
fn find_pages(root: &Path, folder: &str, names: &mut Vec<String>) -> Result<(), Trouble> {
    let entries = fs::read_dir(root.join(folder)).map_err(|e| wrong(folder, e.to_string()))?;
    for entry in entries {
        let entry = entry.map_err(|e| wrong(folder, e.to_string()))?;
        let name = format!("{folder}/{}", entry.file_name().to_string_lossy());
        if entry.path().is_dir() {
            find_pages(root, &name, names)?;
        } else if entry
            .path()
            .extension()
            .is_some_and(|ending| ending == "md")
        {
            names.push(name);
        }
    }
    Ok(())
}

fn put(folder: &Path, name: &str, bytes: &[u8]) -> Result<(), Trouble> {
    let path = folder.join(name);
    let parent = path.parent().unwrap_or(folder);
    fs::create_dir_all(parent)
        .and_then(|()| fs::write(&path, bytes))
        .map_err(|error| wrong(name, error.to_string()))
}

/// The words of a command, in which quotation marks hold blanks.
fn words(line: &str) -> Vec<String> {
    let mut quoted = false;
    let ends = |c: char| {
        quoted ^= c == '"';
        c == ' ' && !quoted
    };
    line.split(ends).map(|word| word.replace('"', "")).collect()
}

fn without_anchor(target: &str) -> &str {
    target.split_once('#').map_or(target, |(path, _)| path)
}

/// The target of a link in the page `name`, as a path from the repository's root; `None` if it is
/// outside, or on the network.
fn from_root(name: &str, target: &str) -> Option<String> {
    if target.is_empty() || target.contains("://") {
        return None;
    }
    let mut parts: Vec<String> = name.split('/').map(str::to_owned).collect();
    parts.pop();
    for part in Path::new(target).components() {
        match part {
            Component::Normal(part) => parts.push(part.to_string_lossy().into_owned()),
            Component::ParentDir => {
                parts.pop()?;
            }
            Component::CurDir => {}
            Component::RootDir | Component::Prefix(_) => return None,
        }
    }
    Some(parts.join("/"))
}

/// A folder's front page is `README.md` for repository hosts and `index.md` for mdBook.
fn renamed(target: &str) -> Option<String> {
    if target.contains("://") {
        return None;
    }
    let path = without_anchor(target);
    let front = path == "README.md" || path.ends_with("/README.md");
    front.then(|| target.replacen("README.md", "index.md", 1))
}
