//! The result for one figure or equation of the paper: text, tables, pictures, checks.

use nanotap_figures::{DOUBLE_COLUMN, Figure};

use super::PaperError;
use super::check::Check;
use super::expected::Computed;
use super::statements::Statement;

/// A part of the report.
#[derive(Clone, Debug)]
pub struct Section {
    /// Identifier of the section, such as `fig4`.
    pub id: &'static str,
    /// Heading of the section.
    pub title: &'static str,
    /// Paragraphs of text, in order.
    pub text: Vec<String>,
    /// Tables of results, in order.
    pub tables: Vec<Table>,
    /// Pictures with their captions, in order.
    pub pictures: Vec<Picture>,
    /// Statements of the paper with their verdicts.
    pub checks: Vec<Check>,
    findings: Vec<Finding>,
}

/// What a computation gave for a statement, in numbers and in words.
#[derive(Clone, Debug)]
struct Finding {
    id: &'static str,
    found: Computed,
    here: String,
    evidence: String,
    rerun: String,
}

impl Section {
    /// Creates a section with this identifier and heading, without contents.
    pub fn new(id: &'static str, title: &'static str) -> Self {
        Self {
            id,
            title,
            text: Vec::new(),
            tables: Vec::new(),
            pictures: Vec::new(),
            checks: Vec::new(),
            findings: Vec::new(),
        }
    }

    /// Appends a paragraph of text.
    #[must_use]
    pub fn text(mut self, text: impl Into<String>) -> Self {
        self.text.push(text.into());
        self
    }

    /// Appends a table of results.
    #[must_use]
    pub fn table(mut self, table: Table) -> Self {
        self.tables.push(table);
        self
    }

    /// Appends a picture with its caption.
    #[must_use]
    pub fn picture(mut self, picture: Picture) -> Self {
        self.pictures.push(picture);
        self
    }

    /// States what this program `found` for the statement `id`, the same in words, the evidence for
    /// the verdict, and the command line that reproduces it.
    pub(super) fn check(
        mut self,
        id: &'static str,
        found: impl Into<Computed>,
        here: impl Into<String>,
        evidence: impl Into<String>,
        rerun: impl Into<String>,
    ) -> Self {
        self.findings.push(Finding {
            id,
            found: found.into(),
            here: here.into(),
            evidence: evidence.into(),
            rerun: rerun.into(),
        });
        self
    }

    /// The section with the verdicts on its statements, in their order.
    ///
    /// # Errors
    /// If the computation gave nothing for one of them.
    pub(super) fn with_checks(mut self, statements: &[Statement]) -> Result<Self, PaperError> {
        for statement in statements {
            let mut findings = self.findings.iter();
            let finding = findings
                .find(|finding| finding.id == statement.id)
                .ok_or_else(|| PaperError::failed(statement.id)("the section has no result"))?;
            self.checks.push(Check {
                id: statement.id.to_owned(),
                paper: statement.paper.to_owned(),
                here: finding.here.clone(),
                about: statement.about,
                verdict: statement.expected.verdict(&finding.found),
                evidence: finding.evidence.clone(),
                rerun: finding.rerun.clone(),
            });
        }
        Ok(self)
    }
}

/// A table of texts with a caption.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Table {
    /// Caption above the table.
    pub caption: String,
    /// Headings of the columns.
    pub columns: Vec<String>,
    /// Rows, with one entry per column.
    pub rows: Vec<Vec<String>>,
}

impl Table {
    /// Creates a table with these columns, without rows.
    pub fn new<'a>(caption: impl Into<String>, columns: impl IntoIterator<Item = &'a str>) -> Self {
        Self {
            caption: caption.into(),
            columns: columns.into_iter().map(str::to_owned).collect(),
            rows: Vec::new(),
        }
    }

    /// Appends a row; missing cells are left empty.
    pub fn row(&mut self, cells: impl IntoIterator<Item = String>) {
        let mut row: Vec<String> = cells.into_iter().collect();
        row.resize(self.columns.len(), String::new());
        self.rows.push(row);
    }
}

/// A picture with title and caption.
#[derive(Clone, Debug)]
pub struct Picture {
    /// Name of its files, without extension.
    pub name: String,
    /// Title above the picture.
    pub title: String,
    /// Caption below the picture.
    pub caption: String,
    /// The panels, without title and caption.
    figure: Figure,
    width: f64,
    height: f64,
}

/// Letters of a caption per millimetre of its width.
const LETTERS_PER_MM: f64 = 0.92;
/// Height of a line of the caption, mm.
const LINE: f64 = 3.3;
/// Height of the title, mm.
const TITLE: f64 = 5.0;

impl Picture {
    /// A picture with the width of two columns whose panels have the height `height`, mm.
    pub fn new(
        name: impl Into<String>,
        title: impl Into<String>,
        caption: impl Into<String>,
        figure: Figure,
        height: f64,
    ) -> Self {
        Self {
            name: name.into(),
            title: title.into(),
            caption: caption.into(),
            figure: figure.width(DOUBLE_COLUMN),
            width: DOUBLE_COLUMN,
            height,
        }
    }

    /// The panels alone, for a page that shows title and caption itself.
    pub fn bare(&self) -> Figure {
        self.figure.clone().height(self.height)
    }

    /// The complete picture, with title and caption.
    pub fn whole(&self) -> Figure {
        let letters = self.caption.chars().count() as f64;
        let lines = (letters / (LETTERS_PER_MM * self.width)).ceil();
        self.figure
            .clone()
            .title(self.title.clone())
            .caption(self.caption.clone())
            .height(self.height + TITLE + LINE * lines)
    }
}
