//! The report's files: `report.html`, `report.md`, `checks.json`, and each picture as
//! SVG and PNG.

use std::fs;
use std::path::{Path, PathBuf};

use nanotap::dataset::files;
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::Serialize;

use super::section::Picture;
use super::{About, Check, PaperError, Report, Verdict, html, markdown};

/// Paths of the written files.
#[derive(Clone, Debug)]
pub struct Written {
    /// The page with the whole report.
    pub html: PathBuf,
    /// Path of the Markdown table of all statements.
    pub markdown: PathBuf,
    /// Path of the checks as JSON.
    pub checks: PathBuf,
    /// Pictures, SVG and PNG alternately.
    pub pictures: Vec<PathBuf>,
}

/// Counts of the report and paths of its files, for the terminal's JSON.
#[derive(Debug, Serialize, JsonSchema)]
pub struct Document<'a> {
    /// Folder of the report.
    out: &'a Path,
    /// Path of the page with the whole report.
    html: &'a Path,
    /// Path of the Markdown table of all statements.
    markdown: &'a Path,
    /// Paths of the pictures, SVG and PNG alternately.
    pictures: &'a [PathBuf],
    /// Whether fewer starts and parameter values were used.
    quick: bool,
    /// Number of statements that hold.
    reproduced: usize,
    /// Number of statements that do not hold.
    differs: usize,
    /// Number of statements for which the paper's information is insufficient or contradictory.
    ambiguous: usize,
    /// Number of differing formulas, numbers and captions as printed.
    differs_in_print: usize,
    /// Number of differing statements about motions.
    differs_in_motion: usize,
    /// The statements with their verdicts.
    checks: Vec<&'a Check>,
}

impl Report {
    /// The JSON document of the report, `written` into the folder `out`.
    pub fn document<'a>(&'a self, out: &'a Path, written: &'a Written) -> Document<'a> {
        Document {
            out,
            html: &written.html,
            markdown: &written.markdown,
            pictures: &written.pictures,
            quick: self.quick,
            reproduced: self.count(Verdict::Reproduced),
            differs: self.count(Verdict::Differs),
            ambiguous: self.count(Verdict::Ambiguous),
            differs_in_print: self.differing(About::Print),
            differs_in_motion: self.differing(About::Motion),
            checks: self.checks().collect(),
        }
    }

    /// Writes the report into `folder`, which is created if necessary. Other files in it are not
    /// changed.
    ///
    /// # Errors
    /// If a picture cannot be drawn or a file cannot be written.
    pub fn write(&self, folder: &Path) -> Result<Written, PaperError> {
        fs::create_dir_all(folder).map_err(|source| PaperError::Write {
            path: folder.to_path_buf(),
            source,
        })?;
        let pictures: Vec<&Picture> = self.sections.iter().flat_map(|s| &s.pictures).collect();
        let pictures: Vec<PathBuf> = pictures
            .par_iter()
            .flat_map(|picture| ["svg", "png"].map(|ending| draw(picture, folder, ending)))
            .collect::<Result<_, PaperError>>()?;
        let checks: Vec<&Check> = self.checks().collect();
        let json =
            serde_json::to_string_pretty(&checks).map_err(PaperError::failed("checks.json"))?;
        Ok(Written {
            html: put(folder.join("report.html"), &html::page(self)?)?,
            markdown: put(folder.join("report.md"), &markdown::document(self))?,
            checks: put(folder.join("checks.json"), &(json + "\n"))?,
            pictures,
        })
    }
}

fn draw(picture: &Picture, folder: &Path, ending: &str) -> Result<PathBuf, PaperError> {
    let path = folder.join(format!("{}.{ending}", picture.name));
    picture
        .whole()
        .write(&path)
        .map_err(PaperError::failed(picture.name.clone()))?;
    Ok(path)
}

/// Writes a file completely or not at all.
fn put(path: PathBuf, text: &str) -> Result<PathBuf, PaperError> {
    files::write(&path, text.as_bytes()).map_err(|source| PaperError::Write {
        path: path.clone(),
        source,
    })?;
    Ok(path)
}
