//! Pixels on the page.

use std::collections::BTreeMap;

use crate::MADE_BY;
use crate::colour::Colour;
use crate::shape::Rect;

/// Resolution of pixels embedded in vector formats, dots per inch: the value that journals require
/// for line art combined with halftones.
pub(crate) const EMBEDDED_DPI: f64 = 600.0;

/// Steps of opacity at edges: enough to look smooth, few enough to compress well.
const LEVELS: f64 = 15.0;

/// The colour with an opacity from 0 to 1, in few steps.
pub(crate) fn shaded(colour: Colour, opacity: f64) -> Colour {
    colour.alpha((opacity * LEVELS).round() / LEVELS)
}

/// A picture of pixels stretched over a box.
#[derive(Debug, Clone)]
pub(crate) struct Raster {
    /// Position of the picture, mm.
    pub(crate) rect: Rect,
    /// Box outside which nothing is drawn.
    pub(crate) clip: Rect,
    pub(crate) columns: usize,
    pub(crate) rows: usize,
    /// Row by row from the top left.
    pub(crate) pixels: Vec<Colour>,
}

impl Raster {
    /// The same picture with each pixel repeated to the resolution of print, because many viewers
    /// blur the edges of large pixels.
    pub(crate) fn magnified(&self) -> Raster {
        let times = |cells: usize, length: f64| {
            let wanted = length / 25.4 * EMBEDDED_DPI;
            ((wanted / cells as f64).ceil() as usize).clamp(1, 4096)
        };
        let (across, down) = (
            times(self.columns, self.rect.width()),
            times(self.rows, self.rect.height()),
        );
        let mut pixels = Vec::with_capacity(self.pixels.len() * across * down);
        for row in self.pixels.chunks(self.columns) {
            for _ in 0..down {
                for &pixel in row {
                    pixels.extend(std::iter::repeat_n(pixel, across));
                }
            }
        }
        Raster {
            columns: self.columns * across,
            rows: self.rows * down,
            pixels,
            ..*self
        }
    }

    /// The picture as a PNG file.
    pub(crate) fn png(&self) -> Vec<u8> {
        encode(&self.pixels, self.columns, self.rows, None)
    }
}

/// Encodes pixels as PNG: with a palette if at most 256 colours occur, otherwise as RGBA or, if all
/// are opaque, as RGB. The file states `dpi`.
pub(crate) fn encode(pixels: &[Colour], columns: usize, rows: usize, dpi: Option<f64>) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, columns as u32, rows as u32);
    encoder.set_compression(png::Compression::Balanced);
    encoder.set_depth(png::BitDepth::Eight);
    if let Some(dpi) = dpi {
        // The keyword is known and in Latin letters, so it cannot be refused.
        let _ = encoder.add_text_chunk("Software".into(), MADE_BY.into());
        let per_metre = (dpi / 0.0254).round() as u32;
        encoder.set_pixel_dims(Some(png::PixelDimensions {
            xppu: per_metre,
            yppu: per_metre,
            unit: png::Unit::Meter,
        }));
    }
    let data = if let Some((palette, indices)) = palette(pixels) {
        encoder.set_color(png::ColorType::Indexed);
        // Neighbouring palette numbers are unrelated: differences between them do not compress.
        encoder.set_filter(png::Filter::NoFilter);
        encoder.set_palette(
            palette
                .iter()
                .flat_map(|c| [c.r, c.g, c.b])
                .collect::<Vec<u8>>(),
        );
        if palette.iter().any(|c| c.a < 255) {
            encoder.set_trns(palette.iter().map(|c| c.a).collect::<Vec<u8>>());
        }
        if palette.len() > 16 {
            indices
        } else {
            encoder.set_depth(png::BitDepth::Four);
            let rows = indices.chunks(columns);
            rows.flat_map(|row| row.chunks(2).map(pair)).collect()
        }
    } else {
        let opaque = pixels.iter().all(|c| c.a == 255);
        encoder.set_color(if opaque {
            png::ColorType::Rgb
        } else {
            png::ColorType::Rgba
        });
        encoder.set_filter(png::Filter::Adaptive);
        if opaque {
            pixels.iter().flat_map(|c| [c.r, c.g, c.b]).collect()
        } else {
            pixels.iter().flat_map(|c| [c.r, c.g, c.b, c.a]).collect()
        }
    };
    let written = encoder.write_header().and_then(|mut writer| {
        writer.write_image_data(&data)?;
        writer.finish()
    });
    // Writing to a Vec cannot fail, and sizes and depths agree by construction.
    debug_assert!(written.is_ok(), "{written:?}");
    bytes
}

/// The distinct colours in ascending order, and each pixel's index among them; `None` if there are
/// more than 256.
fn palette(pixels: &[Colour]) -> Option<(Vec<Colour>, Vec<u8>)> {
    let mut numbers: BTreeMap<Colour, u8> = BTreeMap::new();
    let mut last = None;
    for &pixel in pixels {
        if last != Some(pixel) {
            numbers.insert(pixel, 0);
            if numbers.len() > 256 {
                return None;
            }
            last = Some(pixel);
        }
    }
    for (number, value) in numbers.values_mut().enumerate() {
        *value = number as u8;
    }
    let mut last = (Colour::WHITE, None);
    let indices = pixels
        .iter()
        .map(|&pixel| match last {
            (colour, Some(number)) if colour == pixel => number,
            _ => {
                let number = numbers[&pixel];
                last = (pixel, Some(number));
                number
            }
        })
        .collect();
    Some((numbers.into_keys().collect(), indices))
}

/// Two palette numbers in one byte.
fn pair(indices: &[u8]) -> u8 {
    indices[0] << 4 | indices.get(1).copied().unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn decode(bytes: &[u8]) -> (u32, u32, Vec<u8>, png::ColorType) {
        let mut decoder = png::Decoder::new(std::io::Cursor::new(bytes));
        decoder.set_transformations(png::Transformations::EXPAND);
        let mut reader = decoder.read_info().unwrap();
        let mut data = vec![0; reader.output_buffer_size().unwrap()];
        let info = reader.next_frame(&mut data).unwrap();
        data.truncate(info.buffer_size());
        (info.width, info.height, data, info.color_type)
    }

    #[test]
    fn palettes_come_back() {
        for colours in [1, 2, 17, 256] {
            let pixels: Vec<Colour> = (0..37 * 19)
                .map(|i| Colour::rgb((i % colours) as u8, 7, 255 - (i % colours) as u8))
                .collect();
            let (w, h, data, kind) = decode(&encode(&pixels, 37, 19, Some(300.0)));
            assert_eq!((w, h, kind), (37, 19, png::ColorType::Rgb));
            let expected: Vec<u8> = pixels.iter().flat_map(|c| [c.r, c.g, c.b]).collect();
            assert_eq!(data, expected, "{colours} colours");
        }
    }

    #[test]
    fn many_colours_and_opacities_come_back() {
        let pixels: Vec<Colour> = (0..64 * 64)
            .map(|i| Colour {
                r: (i % 64) as u8,
                g: (i / 64) as u8,
                b: 3,
                a: (i % 251) as u8,
            })
            .collect();
        let (_, _, data, kind) = decode(&encode(&pixels, 64, 64, None));
        assert_eq!(kind, png::ColorType::Rgba);
        let expected: Vec<u8> = pixels.iter().flat_map(|c| [c.r, c.g, c.b, c.a]).collect();
        assert_eq!(data, expected);
    }
}
