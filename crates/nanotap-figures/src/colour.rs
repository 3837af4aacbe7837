//! Colours that readers with any colour vision can distinguish.

use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Serialize};

/// A colour with opacity, in sRGB; in JSON `"#rrggbb"`, or `"#rrggbbaa"` if it is translucent.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(into = "String", try_from = "String")]
#[must_use]
pub struct Colour {
    /// Red component in sRGB, 0 to 255.
    pub r: u8,
    /// Green component in sRGB, 0 to 255.
    pub g: u8,
    /// Blue component in sRGB, 0 to 255.
    pub b: u8,
    /// Opacity, 0 (invisible) to 255 (opaque).
    pub a: u8,
}

impl Colour {
    /// Black, the colour of axes and text.
    pub const BLACK: Colour = Colour::rgb(0, 0, 0);
    /// White, the colour of the page.
    pub const WHITE: Colour = Colour::rgb(255, 255, 255);
    /// Mid grey: undecided or secondary items.
    pub const GREY: Colour = Colour::rgb(128, 128, 128);
    /// Light grey: bands behind data.
    pub const LIGHT_GREY: Colour = Colour::rgb(226, 226, 226);
    /// Okabe–Ito blue.
    pub const BLUE: Colour = Colour::rgb(0, 114, 178);
    /// Okabe–Ito vermillion.
    pub const VERMILLION: Colour = Colour::rgb(213, 94, 0);
    /// Okabe–Ito bluish green.
    pub const GREEN: Colour = Colour::rgb(0, 158, 115);
    /// Okabe–Ito reddish purple.
    pub const PURPLE: Colour = Colour::rgb(204, 121, 167);
    /// Okabe–Ito orange.
    pub const ORANGE: Colour = Colour::rgb(230, 159, 0);
    /// Okabe–Ito sky blue.
    pub const SKY: Colour = Colour::rgb(86, 180, 233);
    /// Okabe–Ito yellow.
    pub const YELLOW: Colour = Colour::rgb(240, 228, 66);

    /// An opaque colour from its sRGB components.
    pub const fn rgb(r: u8, g: u8, b: u8) -> Colour {
        Colour { r, g, b, a: 255 }
    }

    /// A colour from its red, green, blue and opacity, from the highest byte down.
    const fn from_bytes(rgba: u32) -> Colour {
        let [r, g, b, a] = rgba.to_be_bytes();
        Colour { r, g, b, a }
    }

    /// The same colour with the opacity `alpha`, 0 to 1 (clamped; NaN is opaque).
    pub fn alpha(self, alpha: f64) -> Colour {
        let alpha = if alpha.is_nan() {
            1.0
        } else {
            alpha.clamp(0.0, 1.0)
        };
        Colour {
            a: (alpha * 255.0).round() as u8,
            ..self
        }
    }

    /// The same colour mixed with white: `share` 0 is the colour, 1 is white.
    pub(crate) fn tint(self, share: f64) -> Colour {
        let mix = |c: u8| (f64::from(c) + (255.0 - f64::from(c)) * share).round() as u8;
        Colour {
            r: mix(self.r),
            g: mix(self.g),
            b: mix(self.b),
            a: self.a,
        }
    }

    /// Opacity from 0 to 1.
    pub(crate) fn opacity(self) -> f64 {
        f64::from(self.a) / 255.0
    }
}

impl fmt::Display for Colour {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "#{:02x}{:02x}{:02x}", self.r, self.g, self.b)?;
        if self.a < 255 {
            write!(f, "{:02x}", self.a)?;
        }
        Ok(())
    }
}

impl From<Colour> for String {
    fn from(colour: Colour) -> String {
        colour.to_string()
    }
}

impl FromStr for Colour {
    type Err = String;

    fn from_str(text: &str) -> Result<Colour, String> {
        let refuse = || format!("expected a colour as #rrggbb or #rrggbbaa, got \"{text}\"");
        let digits = text.strip_prefix('#').ok_or_else(refuse)?;
        if !digits.bytes().all(|b| b.is_ascii_hexdigit()) {
            return Err(refuse());
        }
        let number = u32::from_str_radix(digits, 16).map_err(|_| refuse())?;
        match digits.len() {
            6 => Ok(Colour::from_bytes((number << 8) | 0xff)),
            8 => Ok(Colour::from_bytes(number)),
            _ => Err(refuse()),
        }
    }
}

impl TryFrom<String> for Colour {
    type Error = String;

    fn try_from(text: String) -> Result<Colour, String> {
        text.parse()
    }
}

/// Colours for lines, points and bars, in the order in which layers without a colour take them.
///
/// Okabe & Ito's palette ("Color universal design", 2008) with its strongest colours first and
/// without yellow, which a thin line on white cannot carry.
pub const LINES: [Colour; 7] = [
    Colour::BLUE,
    Colour::VERMILLION,
    Colour::GREEN,
    Colour::PURPLE,
    Colour::ORANGE,
    Colour::SKY,
    Colour::BLACK,
];

/// Motions that are periodic after 1, 2, … 16 drive periods: Okabe & Ito's colours that do not stand
/// for a class of motions, then those of moderate chroma that are farthest from all others, from
/// white, and from the classes' colours (exchange search over a grid of sRGB, distances in Oklab as
/// seen with normal vision, protanopia, deuteranopia and tritanopia). Frequent periods have the
/// stronger colours.
const PERIODS: [Colour; 16] = [
    Colour::BLUE,
    Colour::ORANGE,
    Colour::PURPLE,
    Colour::SKY,
    Colour::rgb(0x60, 0x00, 0x00),
    Colour::rgb(0xfc, 0xd8, 0x00),
    Colour::rgb(0x3c, 0x3c, 0xb4),
    Colour::rgb(0x84, 0x18, 0x54),
    Colour::rgb(0x84, 0xb4, 0x78),
    Colour::rgb(0x60, 0x48, 0x00),
    Colour::rgb(0x90, 0x78, 0xf0),
    Colour::rgb(0x90, 0x54, 0x54),
    Colour::rgb(0x00, 0x18, 0x84),
    Colour::rgb(0x78, 0xe4, 0xfc),
    Colour::rgb(0x48, 0x0c, 0x54),
    Colour::rgb(0xb4, 0xf0, 0xa8),
];

/// Kind of a motion, as far as its colour is concerned.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[allow(missing_docs)]
pub enum Motion {
    /// Periodic after this number of drive periods.
    Periodic(usize),
    QuasiPeriodic,
    Chaotic,
    Unbounded,
    Undecided,
}

impl fmt::Display for Motion {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Motion::Periodic(period) => write!(f, "period {period}"),
            Motion::QuasiPeriodic => f.write_str("quasi-periodic"),
            Motion::Chaotic => f.write_str("chaotic"),
            Motion::Unbounded => f.write_str("unbounded"),
            Motion::Undecided => f.write_str("undecided"),
        }
    }
}

impl Motion {
    /// The colours of motions of which several may be of one kind, such as two of period 1: the
    /// first of a kind has the colour of the kind, the others have tints of it.
    pub fn colours(motions: impl IntoIterator<Item = Motion>) -> Vec<Colour> {
        let mut before: Vec<Motion> = Vec::new();
        motions
            .into_iter()
            .map(|motion| {
                let alike = before.iter().filter(|other| **other == motion).count();
                before.push(motion);
                motion.colour().tint([0.0, 0.4, 0.65][alike.min(2)])
            })
            .collect()
    }

    /// The colour of this motion, the same in every figure. Periods from 1 to 16 and the classes
    /// can be distinguished by every reader; longer periods repeat these sixteen colours, mixed
    /// with white.
    pub fn colour(self) -> Colour {
        match self {
            Motion::Periodic(period) => {
                let place = period.max(1) - 1;
                let round = (place / PERIODS.len()).min(2);
                PERIODS[place % PERIODS.len()].tint([0.0, 0.45, 0.7][round])
            }
            Motion::QuasiPeriodic => Colour::GREEN,
            Motion::Chaotic => Colour::VERMILLION,
            Motion::Unbounded => Colour::BLACK,
            Motion::Undecided => Colour::rgb(190, 190, 190),
        }
    }
}

/// The colour of the `index`-th filled category: Okabe & Ito's palette, then lighter tints of it.
pub fn category(index: usize) -> Colour {
    const FILLS: [Colour; 7] = [
        Colour::BLUE,
        Colour::ORANGE,
        Colour::GREEN,
        Colour::PURPLE,
        Colour::SKY,
        Colour::VERMILLION,
        Colour::YELLOW,
    ];
    let round = (index / FILLS.len()) % 3;
    FILLS[index % FILLS.len()].tint([0.0, 0.45, 0.7][round])
}

/// A continuous colour scale, from the smallest to the largest value.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[must_use]
pub enum Colourmap {
    /// Perceptually uniform, dark blue to yellow.
    #[default]
    Viridis,
    /// Perceptually uniform and the same to readers with colour-vision deficiency.
    Cividis,
    /// Perceptually uniform, black through red to pale yellow.
    Inferno,
    /// Blue through white to red, for quantities with a meaningful middle.
    Diverging,
}

impl Colourmap {
    /// The colour at `t` from 0 to 1 (clamped).
    pub fn at(self, t: f64) -> Colour {
        let t = t.clamp(0.0, 1.0);
        let colour = match self {
            Colourmap::Viridis => colorous::VIRIDIS.eval_continuous(t),
            Colourmap::Cividis => colorous::CIVIDIS.eval_continuous(t),
            Colourmap::Inferno => colorous::INFERNO.eval_continuous(t),
            // The original runs from red to blue.
            Colourmap::Diverging => colorous::RED_BLUE.eval_continuous(1.0 - t),
        };
        Colour::rgb(colour.r, colour.g, colour.b)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Linear intensities of red, green and blue.
    fn linear(colour: Colour) -> [f64; 3] {
        [colour.r, colour.g, colour.b].map(|c| {
            let c = f64::from(c) / 255.0;
            if c <= 0.04045 {
                c / 12.92
            } else {
                ((c + 0.055) / 1.055).powf(2.4)
            }
        })
    }

    /// Relative luminance of WCAG 2, 0 (black) to 1 (white).
    fn luminance(colour: Colour) -> f64 {
        let [r, g, b] = linear(colour);
        0.2126 * r + 0.7152 * g + 0.0722 * b
    }

    fn times(matrix: [[f64; 3]; 3], v: [f64; 3]) -> [f64; 3] {
        matrix.map(|row| row.iter().zip(v).map(|(m, x)| m * x).sum())
    }

    /// Oklab coordinates of linear intensities (B. Ottosson, "A perceptual color space for image
    /// processing", 2020).
    fn oklab(rgb: [f64; 3]) -> [f64; 3] {
        let cones = times(
            [
                [0.412_221_470_8, 0.536_332_536_3, 0.051_445_992_9],
                [0.211_903_498_2, 0.680_699_545_1, 0.107_396_956_6],
                [0.088_302_461_9, 0.281_718_837_6, 0.629_978_700_5],
            ],
            rgb.map(|c| c.clamp(0.0, 1.0)),
        );
        times(
            [
                [0.210_454_255_3, 0.793_617_785_0, -0.004_072_046_8],
                [1.977_998_495_1, -2.428_592_205_0, 0.450_593_709_9],
                [0.025_904_037_1, 0.782_771_766_2, -0.808_675_766_0],
            ],
            cones.map(f64::cbrt),
        )
    }

    /// Linear intensities as seen with normal vision, protanopia, deuteranopia and tritanopia
    /// (Machado, Oliveira & Fernandes, IEEE Trans. Vis. Comput. Graph. 15, 1291 (2009), severity
    /// 1).
    const EYES: [[[f64; 3]; 3]; 4] = [
        [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
        [
            [0.152286, 1.052583, -0.204868],
            [0.114503, 0.786281, 0.099216],
            [-0.003882, -0.048116, 1.051998],
        ],
        [
            [0.367322, 0.860646, -0.227968],
            [0.280085, 0.672501, 0.047413],
            [-0.011820, 0.042940, 0.968881],
        ],
        [
            [1.255528, -0.076749, -0.178779],
            [-0.078411, 0.930809, 0.147602],
            [0.004733, 0.691367, 0.303900],
        ],
    ];

    #[test]
    fn every_reader_tells_periods_and_classes_apart() {
        // A just noticeable difference is about 0.02 in Oklab.
        let motions: Vec<Motion> = (1..=16)
            .map(Motion::Periodic)
            .chain([
                Motion::QuasiPeriodic,
                Motion::Chaotic,
                Motion::Unbounded,
                Motion::Undecided,
            ])
            .collect();
        for (i, a) in motions.iter().enumerate() {
            for b in &motions[..i] {
                for eye in EYES {
                    let [a, b] = [a, b].map(|m| oklab(times(eye, linear(m.colour()))));
                    let apart = a
                        .iter()
                        .zip(b)
                        .map(|(x, y)| (x - y).powi(2))
                        .sum::<f64>()
                        .sqrt();
                    assert!(apart > 0.07, "{a:?} {b:?}: {apart}");
                }
            }
        }
    }

    #[test]
    fn colours_are_written_and_read() {
        for (colour, text) in [
            (Colour::BLUE, "#0072b2"),
            (Colour::BLACK.alpha(0.2), "#00000033"),
        ] {
            assert_eq!(colour.to_string(), text);
            assert_eq!(text.parse::<Colour>(), Ok(colour));
        }
        for text in ["", "red", "#12345", "#+12345", "#12345é"] {
            assert!(text.parse::<Colour>().unwrap_err().contains("#rrggbb"));
        }
    }

    #[test]
    fn sequential_maps_grow_lighter_all_the_way() {
        for map in [Colourmap::Viridis, Colourmap::Cividis, Colourmap::Inferno] {
            let light: Vec<f64> = (0..=32)
                .map(|i| luminance(map.at(f64::from(i) / 32.0)))
                .collect();
            assert!(light.windows(2).all(|w| w[1] > w[0]), "{map:?}: {light:?}");
        }
    }

    #[test]
    fn diverging_map_is_blue_below_and_red_above() {
        let (low, high) = (Colourmap::Diverging.at(0.1), Colourmap::Diverging.at(0.9));
        assert!(low.b > low.r && high.r > high.b);
    }

    #[test]
    fn line_colours_stand_out_from_paper() {
        for colour in LINES {
            let contrast = 1.05 / (luminance(colour) + 0.05);
            assert!(contrast > 2.0, "{colour:?} has contrast {contrast}");
        }
    }

    #[test]
    fn categories_differ() {
        let all: std::collections::BTreeSet<_> = (0..21).map(category).collect();
        assert_eq!(all.len(), 21);
    }
}
