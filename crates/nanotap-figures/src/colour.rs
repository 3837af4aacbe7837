//! Colours that every reader can tell apart.

/// A colour with opacity, in sRGB.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[must_use]
pub struct Colour {
    /// Red, 0 to 255.
    pub r: u8,
    /// Green, 0 to 255.
    pub g: u8,
    /// Blue, 0 to 255.
    pub b: u8,
    /// Opacity, 0 (invisible) to 255 (opaque).
    pub a: u8,
}

impl Colour {
    /// Black: axes and text.
    pub const BLACK: Colour = Colour::rgb(0, 0, 0);
    /// White: the paper.
    pub const WHITE: Colour = Colour::rgb(255, 255, 255);
    /// Mid grey: what is undecided or secondary.
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

    /// The same colour mixed with white: 0 leaves it, 1 is white.
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

    /// Relative luminance of WCAG 2, 0 (black) to 1 (white).
    #[cfg(test)]
    pub(crate) fn luminance(self) -> f64 {
        let linear = |c: u8| {
            let c = f64::from(c) / 255.0;
            if c <= 0.04045 {
                c / 12.92
            } else {
                ((c + 0.055) / 1.055).powf(2.4)
            }
        };
        0.2126 * linear(self.r) + 0.7152 * linear(self.g) + 0.0722 * linear(self.b)
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

/// A continuous colour scale.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
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

    #[test]
    fn sequential_maps_grow_lighter_all_the_way() {
        for map in [Colourmap::Viridis, Colourmap::Cividis, Colourmap::Inferno] {
            let light: Vec<f64> = (0..=32)
                .map(|i| map.at(f64::from(i) / 32.0).luminance())
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
            let contrast = 1.05 / (colour.luminance() + 0.05);
            assert!(contrast > 2.0, "{colour:?} has contrast {contrast}");
        }
    }

    #[test]
    fn categories_differ() {
        let all: std::collections::BTreeSet<_> = (0..21).map(category).collect();
        assert_eq!(all.len(), 21);
    }
}
