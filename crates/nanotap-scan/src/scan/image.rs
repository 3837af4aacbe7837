//! Heights from a greyscale image.

use nanotap_error::Error;

/// Most pixels of an image.
const MAX_PIXELS: usize = 16_777_216;

/// Heights in m on a grid that covers the scan, the first row at y = 0.
#[derive(Clone, Debug)]
pub(super) struct HeightImage {
    columns: usize,
    rows: usize,
    heights: Vec<f64>,
    /// Extent in x and y in m.
    size: [f64; 2],
}

impl HeightImage {
    /// Reads the content of a PNG file, white at `height` and black at 0, stretched over `size`.
    ///
    /// # Errors
    /// When it is not a PNG image, or is too large.
    pub(super) fn read(
        (name, file): (String, Vec<u8>),
        height: f64,
        size: [f64; 2],
    ) -> Result<Self, Error> {
        let refuse =
            |what: String| Error::input(format!("{name}: {what}"), "name a greyscale image in PNG");
        let mut decoder = png::Decoder::new(std::io::Cursor::new(file));
        decoder.set_transformations(png::Transformations::EXPAND);
        let mut reader = decoder
            .read_info()
            .map_err(|error| refuse(error.to_string()))?;
        let info = reader.info();
        let (columns, rows) = (info.width as usize, info.height as usize);
        if columns.saturating_mul(rows) > MAX_PIXELS {
            let what = format!("{columns} by {rows} pixels are too many");
            return Err(refuse(what).remedy(format!("give at most {MAX_PIXELS} pixels")));
        }
        let length = reader
            .output_buffer_size()
            .ok_or_else(|| refuse("the image is too large".into()))?;
        let mut bytes = vec![0; length];
        let frame = reader
            .next_frame(&mut bytes)
            .map_err(|error| refuse(error.to_string()))?;
        let samples = frame.color_type.samples();
        let wide = frame.bit_depth == png::BitDepth::Sixteen;
        // Of colours the mean of red, green and blue; opacity does not count.
        let colours = if samples >= 3 { 3 } else { 1 };
        let width = if wide { 2 } else { 1 };
        let value = |pixel: &[u8]| {
            let channel = |k: usize| {
                let at = k * width;
                if wide {
                    f64::from(u16::from_be_bytes([pixel[at], pixel[at + 1]])) / 65535.0
                } else {
                    f64::from(pixel[at]) / 255.0
                }
            };
            height * (0..colours).map(channel).sum::<f64>() / f64::from(colours as u8)
        };
        let line = columns * samples * width;
        let heights = bytes
            .chunks_exact(frame.line_size)
            .take(rows)
            .flat_map(|row| row[..line].chunks_exact(samples * width).map(value))
            .collect();
        Ok(Self {
            columns,
            rows,
            heights,
            size,
        })
    }

    /// The height at a position in m: linear along the line, of the nearest row.
    pub(super) fn at(&self, x: f64, y: f64) -> f64 {
        let row = (y / self.size[1] * self.rows as f64).floor();
        let row = row.clamp(0.0, (self.rows - 1) as f64) as usize;
        let row = &self.heights[row * self.columns..(row + 1) * self.columns];
        let place = (x / self.size[0] * self.columns as f64 - 0.5).max(0.0);
        let left = (place.floor() as usize).min(self.columns - 1);
        let right = (left + 1).min(self.columns - 1);
        let part = (place - left as f64).min(1.0);
        row[left] * (1.0 - part) + row[right] * part
    }
}
