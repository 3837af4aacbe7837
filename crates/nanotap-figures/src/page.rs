//! A figure laid out on its page, and its output in every format.

use std::ffi::OsString;
use std::fs;
use std::hash::{BuildHasher as _, RandomState};
use std::path::{Path, PathBuf};

use crate::draw;
use crate::error::FigureError;
use crate::figure::Figure;
use crate::layout::{self, Grid};
use crate::map::{AxisMap, PanelMap};
use crate::pdf;
use crate::pixels;
use crate::prepared::Prepared;
use crate::resolve;
use crate::scene::Scene;
use crate::shape::{Point, Rect};
use crate::style::{EDGE, INK, Style};
use crate::svg;
use crate::text::{Across, Upright, Words};

/// Resolution of PNG files, dots per inch.
pub const DPI: f64 = 300.0;
/// Largest number of pixels of a picture.
const MAX_PIXELS: f64 = 2e8;

impl Figure {
    /// Writes the figure in the format given by the path's extension: `.svg`, `.png` (300 dots per
    /// inch) or `.pdf`. The file is written completely or not at all.
    ///
    /// # Errors
    /// If the extension is not supported, the figure cannot be drawn, or the file cannot be
    /// written.
    pub fn write(&self, path: impl AsRef<Path>) -> Result<(), FigureError> {
        let path = path.as_ref();
        let bytes = self.file(path)?;
        write_whole(path, &bytes).map_err(|source| FigureError::Write {
            path: path.to_path_buf(),
            source,
        })
    }

    /// The bytes that [`write`](Self::write) writes into the file of that name.
    ///
    /// # Errors
    /// If the extension is not supported, or the figure cannot be drawn.
    pub fn file(&self, path: &Path) -> Result<Vec<u8>, FigureError> {
        let ending = path
            .extension()
            .map(|e| e.to_string_lossy().to_ascii_lowercase());
        match ending.as_deref() {
            Some("svg") => Ok(self.to_svg()?.into_bytes()),
            Some("png") => self.to_png(DPI),
            Some("pdf") => self.to_pdf(),
            _ => Err(FigureError::UnknownEnding {
                path: path.to_path_buf(),
            }),
        }
    }

    /// The figure as SVG. Several may be embedded in one HTML page.
    ///
    /// # Errors
    /// If the figure cannot be drawn.
    pub fn to_svg(&self) -> Result<String, FigureError> {
        Ok(svg::write(&self.scene()?.0))
    }

    /// The figure as SVG, with the positions of its panels and axes. A page needs them to find the
    /// data under the pointer, or to request another range.
    ///
    /// # Errors
    /// If the figure cannot be drawn.
    pub fn to_svg_with_map(&self) -> Result<(String, Vec<PanelMap>), FigureError> {
        let (scene, map) = self.scene()?;
        Ok((svg::write(&scene), map))
    }

    /// The figure as JSON, with everything resolved that does not depend on its size: the range of
    /// each axis, the colour of each layer, the letter of each panel. Another program that draws it
    /// draws the same figure. It can be read back as a [`Figure`].
    ///
    /// # Errors
    /// If the figure cannot be drawn.
    pub fn to_json(&self) -> Result<String, FigureError> {
        self.check()?;
        serde_json::to_string(&resolve::figure(self)).map_err(FigureError::Json)
    }

    /// A figure from JSON: that of [`Figure::to_json`], or a shorter one, since most keys are
    /// optional.
    ///
    /// # Errors
    /// If the text is not JSON, or does not describe a figure.
    pub fn from_json(text: &str) -> Result<Figure, FigureError> {
        serde_json::from_str(text).map_err(FigureError::Json)
    }

    /// The figure as PNG of `dpi` dots per inch.
    ///
    /// # Errors
    /// If the figure cannot be drawn, or not at this resolution.
    pub fn to_png(&self, dpi: f64) -> Result<Vec<u8>, FigureError> {
        let (scene, _) = self.scene()?;
        let count = scene.width * scene.height * (dpi / 25.4).powi(2);
        if !(10.0..=2400.0).contains(&dpi) || count > MAX_PIXELS {
            return Err(FigureError::Resolution { dpi });
        }
        pixels::png(&scene, dpi).ok_or(FigureError::Resolution { dpi })
    }

    /// The figure as PDF of one page, to be included in a paper.
    ///
    /// # Errors
    /// If the figure cannot be drawn.
    pub fn to_pdf(&self) -> Result<Vec<u8>, FigureError> {
        Ok(pdf::write(&self.scene()?.0))
    }

    fn scene(&self) -> Result<(Scene, Vec<PanelMap>), FigureError> {
        self.check()?;
        let style = Style::scaled(self.text_scale);
        let figure = resolve::figure(self);
        let panels: Vec<Prepared> = figure
            .panels
            .iter()
            .enumerate()
            .map(|(index, panel)| {
                let below = index + self.cols < self.panels.len();
                Prepared::new(panel, !(self.share_x && below))
            })
            .collect();
        let mut scene = Scene {
            width: self.width,
            height: self.full_height(),
            title: Words::set(&self.title, style.title, true).plain,
            items: Vec::new(),
        };
        let mut area = Rect {
            left: EDGE,
            top: EDGE,
            right: self.width - EDGE,
            bottom: scene.height - EDGE,
        };
        if !self.title.is_empty() {
            let words = Words::set(&self.title, style.title, true);
            let centre = Point::new(self.width / 2.0, area.top);
            area.top += words.cap_height() + words.descent() + 2.0 * style.pad;
            scene.words(words.place(centre, Across::Centre, Upright::Top, INK));
        }
        let lines = wrapped(&self.caption, area.width(), &style);
        if !lines.is_empty() {
            area.bottom -= lines.len() as f64 * style.line() + style.pad;
        }
        for (number, line) in lines.into_iter().enumerate() {
            let top = area.bottom + style.pad + (number as f64 + 0.2) * style.line();
            let at = Point::new(area.left, top);
            scene.words(line.place(at, Across::Left, Upright::Top, INK));
        }
        let shares = |given: &[f64], count: usize| {
            if given.is_empty() {
                vec![1.0; count]
            } else {
                given.to_vec()
            }
        };
        let grid = Grid {
            rows: self.rows,
            cols: self.cols,
            widths: &shares(&self.column_widths, self.cols),
            heights: &shares(&self.row_heights, self.rows),
            area,
        };
        let spots = layout::spots(&panels, &grid, &style)?;
        for (panel, spot) in panels.iter().zip(&spots) {
            draw::panel(&mut scene, panel, spot, &style);
        }
        let map = panels.iter().zip(&spots).map(|(panel, spot)| PanelMap {
            letter: panel.panel.letter.clone().unwrap_or_default(),
            title: panel.panel.title.clone(),
            left: spot.rect.left,
            top: spot.rect.top,
            width: spot.rect.width(),
            height: spot.rect.height(),
            x: AxisMap::new(&panel.panel.x, panel.x),
            y: AxisMap::new(&panel.panel.y, panel.y),
        });
        Ok((scene, map.collect()))
    }
}

/// Breaks a text into lines of at most `width` mm.
fn wrapped(text: &str, width: f64, style: &Style) -> Vec<Words> {
    let set = |line: &str| Words::set(line, style.legend, false);
    let mut lines: Vec<String> = Vec::new();
    for word in text.split_whitespace() {
        match lines.last_mut() {
            // A line must not end between two dollar signs.
            Some(line)
                if line.matches('$').count() % 2 == 1
                    || set(&format!("{line} {word}")).width <= width =>
            {
                line.push(' ');
                line.push_str(word);
            }
            _ => lines.push(word.to_string()),
        }
    }
    lines.iter().map(|line| set(line)).collect()
}

/// Writes under a temporary name in the same folder, then renames.
fn write_whole(path: &Path, bytes: &[u8]) -> std::io::Result<()> {
    let mut name = OsString::from(".");
    name.push(path.file_name().unwrap_or_default());
    // Two runs, even on two machines, may write the same picture; the hasher has a random seed.
    let unique = RandomState::new().hash_one(std::process::id());
    name.push(format!(".{unique:016x}.tmp"));
    let temporary: PathBuf = path.with_file_name(name);
    fs::write(&temporary, bytes)
        .and_then(|()| fs::rename(&temporary, path))
        .inspect_err(|_| {
            // A partly written file is useless, and it may not exist.
            let _ = fs::remove_file(&temporary);
        })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn captions_are_broken_into_lines_that_fit() {
        let style = Style::scaled(1.0);
        let lines = wrapped(&"word ".repeat(60), 80.0, &style);
        assert!(lines.len() > 2 && lines.iter().all(|l| l.width <= 80.0));
    }
}
