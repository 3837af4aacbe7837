//! Channels of JPK: integers, scaled by an encoder and then, slot by slot, to physical units.

use super::properties::Header;
use crate::Error;
use crate::bytes::{Encoding, Number};
use crate::document::Channel;

/// Conversions in sequence.
const MAX_CONVERSIONS: usize = 8;
/// Heights that a sensor measured, by preference.
pub(super) const MEASURED: [&str; 3] = [
    "capacitiveSensorHeight",
    "measuredHeight",
    "strainGaugeHeight",
];
/// Commanded heights, by preference.
pub(super) const COMMANDED: [&str; 3] = ["height", "head-height", "cellhesion-height"];
/// The deflection.
pub(super) const DEFLECTION: &str = "vDeflection";

/// How the numbers of a channel become values.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Scale {
    pub(super) encoding: Encoding,
    pub(super) factor: f64,
    pub(super) offset: f64,
    pub(super) unit: String,
    /// m/V, from the slot `distance` of the deflection.
    pub(super) sensitivity: Option<f64>,
    /// N/m, from the slot `force` of the deflection.
    pub(super) spring_constant: Option<f64>,
}

/// A slot: value = factor · number + offset.
#[derive(Clone, Debug)]
struct Slot {
    factor: f64,
    offset: f64,
    unit: String,
    /// The last step of its chain.
    multiplier: f64,
}

/// Reads the scale of a channel; `None` if its encoder is not known.
pub(super) fn scale(header: &Header, name: &str) -> Result<Option<Scale>, Error> {
    let channel = Reader { header, name };
    let Some((encoding, base)) = channel.encoder()? else {
        return Ok(None);
    };
    let conversions = "conversion-set.conversions";
    let base_name = channel.text(&format!("{conversions}.base")).unwrap_or("");
    let slot = |of: &str| channel.slot(of, base_name, &base, 0);
    let distance = slot("distance")?;
    let mut sensitivity = None;
    let mut spring_constant = None;
    let is_deflection = name == DEFLECTION;
    if is_deflection {
        sensitivity = match (base_name, &distance) {
            ("distance", _) => slot("volts")?.map(|of| 1.0 / of.multiplier),
            (_, Some(of)) => Some(of.multiplier),
            _ => None,
        };
        sensitivity = sensitivity.filter(|of| of.is_finite());
        spring_constant = slot("force")?
            .filter(|_| distance.is_some())
            .map(|of| of.multiplier);
    }
    let default = channel.text(&format!("{conversions}.default"));
    let wanted: &[&str] = if is_deflection {
        &["distance", "volts"]
    } else if MEASURED.contains(&name) {
        &["nominal"]
    } else if COMMANDED.contains(&name) {
        &["calibrated"]
    } else {
        &[]
    };
    let mut chosen = None;
    for of in wanted.iter().copied().chain(default) {
        chosen = slot(of)?;
        if chosen.is_some() {
            break;
        }
    }
    let chosen = chosen.unwrap_or_else(|| base.clone());
    Ok(Some(Scale {
        encoding,
        factor: chosen.factor,
        offset: chosen.offset,
        unit: chosen.unit,
        sensitivity,
        spring_constant,
    }))
}

impl Scale {
    pub(super) fn channel(&self, name: &str, bytes: &[u8]) -> Channel {
        let numbers = self.encoding.all(bytes);
        let values = numbers.map(|of| of * self.factor + self.offset).collect();
        Channel::new(name, &self.unit, values)
    }
}

/// The properties of one channel.
struct Reader<'a> {
    header: &'a Header<'a>,
    name: &'a str,
}

impl Reader<'_> {
    fn text(&self, key: &str) -> Option<&str> {
        self.header.get(&format!("channel.{}.{key}", self.name))
    }

    fn number(&self, key: &str) -> Result<Option<f64>, Error> {
        self.header.number(&format!("channel.{}.{key}", self.name))
    }

    /// Older files name the unit itself.
    fn unit(&self, scaling: &str) -> String {
        self.text(&format!("{scaling}.unit.unit"))
            .or_else(|| self.text(&format!("{scaling}.unit")))
            .unwrap_or("")
            .to_owned()
    }

    /// Kind of the numbers, and the slot that the encoder scales them to.
    fn encoder(&self) -> Result<Option<(Encoding, Slot)>, Error> {
        // Older files name the encoder of the data, newer ones that of the channel.
        let found = ["data.encoder", "encoder"]
            .into_iter()
            .find_map(|of| Some((of, self.text(&format!("{of}.type"))?)));
        let Some((encoder, kind)) = found else {
            let kind = self.text("data.type").or_else(|| self.text("type"));
            let number = match kind {
                Some("float-data" | "float") => Number::Float(4),
                Some("double-data" | "double") => Number::Float(8),
                _ => return Ok(None),
            };
            let unit = self.text("unit.unit").unwrap_or("").to_owned();
            return Ok(Some((Encoding::big(number), Slot::new(1.0, 0.0, unit))));
        };
        let number = match kind {
            "signedshort" => Number::Signed(2),
            "unsignedshort" => Number::Unsigned(2),
            "signedinteger" => Number::Signed(4),
            "unsignedinteger" => Number::Unsigned(4),
            "signedlong" => Number::Signed(8),
            _ => return Ok(None),
        };
        let scaling = format!("{encoder}.scaling");
        let factor = self
            .number(&format!("{scaling}.multiplier"))?
            .unwrap_or(1.0);
        let offset = self.number(&format!("{scaling}.offset"))?.unwrap_or(0.0);
        let slot = Slot::new(factor, offset, self.unit(&scaling));
        Ok(Some((Encoding::big(number), slot)))
    }

    /// A slot, through those below it down to the base; `None` if one of them is not defined, or if
    /// they run in a circle.
    fn slot(
        &self,
        name: &str,
        base_name: &str,
        base: &Slot,
        depth: usize,
    ) -> Result<Option<Slot>, Error> {
        if name == base_name {
            return Ok(Some(base.clone()));
        }
        let key = |of: &str| format!("conversion-set.conversion.{name}.{of}");
        if depth == MAX_CONVERSIONS || self.text(&key("defined")) == Some("false") {
            return Ok(None);
        }
        let Some(multiplier) = self.number(&key("scaling.multiplier"))? else {
            return Ok(None);
        };
        let added = self.number(&key("scaling.offset"))?.unwrap_or(0.0);
        let Some(below) = self.text(&key("base-calibration-slot")) else {
            return Ok(None);
        };
        let below = self.slot(below, base_name, base, depth + 1)?;
        Ok(below.map(|below| Slot {
            factor: below.factor * multiplier,
            offset: below.offset * multiplier + added,
            unit: self.unit(&key("scaling")),
            multiplier,
        }))
    }
}

impl Slot {
    fn new(factor: f64, offset: f64, unit: String) -> Self {
        Self {
            factor,
            offset,
            unit,
            multiplier: factor,
        }
    }
}
