//! HDF5 images of JPK (`.h5-jpk`): groups `Measurement_M/Channel_C` with the numbers of all pixels, a
//! column for each frame, and their scale among the attributes.

use super::Settings;
use super::container::Reader;
use crate::document::{Document, Image};
use crate::limits::{MAX_CHANNELS, MAX_IMAGES, at_most};
use crate::{Error, Format};

/// The place of a scale among the attributes of a channel.
const SCALE: &str = "net-encoder.scaling";
/// A dataset of a channel that is a small picture of the first frame.
const THUMBNAIL: &str = "thumbnail";

/// Reads all frames of all channels into a document.
pub(super) fn read(
    reader: &mut Reader,
    measurements: &[(String, u64)],
    document: &mut Document,
) -> Result<(), Error> {
    for (name, at) in measurements {
        if !name.starts_with("Measurement_") {
            continue;
        }
        let measurement = reader.object(*at)?;
        let settings = Settings(reader.attributes(&measurement)?);
        let grid = Raster::of(&settings)
            .ok_or_else(|| Format::Hdf5.at_key(name, "no raster of pixels", "its lengths"))?;
        let channels = reader.links(&measurement)?;
        let channels = channels
            .iter()
            .filter(|(name, _)| name.starts_with("Channel_"));
        for (_, at) in channels {
            grid.frames(reader, *at, document)?;
        }
        let prefix = format!("{name}/");
        document.settings.extend(settings.shown(&prefix));
    }
    Ok(())
}

/// The pixels of a measurement.
struct Raster {
    shape: [usize; 2],
    size: Option<[f64; 2]>,
}

impl Raster {
    fn of(settings: &Settings) -> Option<Self> {
        let both = |keys: [&str; 2]| {
            let [x, y] = keys.map(|of| settings.number(&format!("position-pattern.grid.{of}")));
            x.zip(y).map(|(x, y)| [x, y])
        };
        Some(Self {
            shape: both(["ilength", "jlength"])?.map(|of| of as usize),
            size: both(["ulength", "vlength"]),
        })
    }

    /// Reads the frames of a channel.
    fn frames(&self, reader: &mut Reader, at: u64, document: &mut Document) -> Result<(), Error> {
        let channel = reader.object(at)?;
        let settings = Settings(reader.attributes(&channel)?);
        let links = reader.links(&channel)?;
        at_most(links.len(), MAX_CHANNELS, "datasets in a channel")?;
        let name = settings.text("channel.name").unwrap_or("channel");
        let Some((_, at)) = links.iter().find(|(of, _)| of != THUMBNAIL) else {
            document
                .notes
                .push(format!("the channel `{name}` has no numbers"));
            return Ok(());
        };
        let dataset = reader.object(*at)?;
        let ([pixels, frames], numbers) = reader.table(&dataset)?;
        if pixels != self.shape[0].saturating_mul(self.shape[1]) {
            let problem = format!("{pixels} numbers");
            let expected = format!("{} × {} pixels", self.shape[0], self.shape[1]);
            return Err(Format::Hdf5.at_key(name, problem, expected));
        }
        at_most(
            document.images.len().saturating_add(frames),
            MAX_IMAGES,
            "images in a file",
        )?;
        reader.take_numbers(numbers.len())?;
        let number = |key: &str| settings.number(&format!("{SCALE}.{key}"));
        let (factor, offset) = (
            number("multiplier").unwrap_or(1.0),
            number("offset").unwrap_or(0.0),
        );
        let unit = settings.text(&format!("{SCALE}.unit.unit")).unwrap_or("");
        let direction = match settings.text("retrace") {
            Some("true") => "retrace",
            _ => "trace",
        };
        for frame in 0..frames {
            let name = match frames {
                1 => format!("{name} {direction}"),
                _ => format!("{name} {direction}, frame {frame}"),
            };
            let of_frame = numbers.iter().skip(frame).step_by(frames);
            let values = of_frame.map(|of| of * factor + offset).collect();
            // The first line in the file is the lowest.
            let image = Image::new(name, unit, self.shape, self.size, values);
            document.images.push(image.flipped());
        }
        Ok(())
    }
}
