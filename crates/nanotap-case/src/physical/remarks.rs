//! Assumptions and warnings about the mapping of a case.

use super::reader::Reader;
use super::remark::Remark;
use super::tip::TipMass;
use super::view::{Physical, USUAL_TIP_HEIGHT};
use crate::key::{Key, plausible};
use crate::quantity::Kind;
use crate::stated::Value;
use nanotap_model::drive_form::Actuation;
use nanotap_model::exact_beam;
use nanotap_model::parameter::Parameter;

impl Physical {
    /// All remarks, in the order in which the case is read.
    pub(crate) fn remarks(&self, reader: Reader<'_>) -> Vec<Remark> {
        let mut remarks = Vec::new();
        if let Ok(Some(known)) = reader.lever() {
            remarks.push(Remark::note(format!(
                "lever \"{}\" from the catalogue: {}",
                known.name, known.source
            )));
        }
        let is_beam = self.lever_modes().is_empty();
        if is_beam && self.tip.mass.is_none() && !reader.has(Key::LeverF2) {
            remarks.push(Remark::note(
                "no tip mass is given: taken as zero (cantilever.f2, tip.mass, tip.mass_ratio \
                 or tip.shape would tell it)",
            ));
        }
        if !matches!(self.data.tip_mass, TipMass::SecondMode(_))
            && let Ok(Some(f2)) = reader.number(Key::LeverF2)
            && let Ok(beam) = exact_beam::frequencies(self.cantilever.alpha1, 0.0, 2)
        {
            let share = f2 * beam[0] / (self.lever.f0 * beam[1]);
            let why = if self.tip.mass.is_some() {
                "f2 and the tip mass are both given"
            } else if reader.has(Key::LeverK2) {
                "f2 and k2 together state the second mode, and no tip mass follows"
            } else {
                "f2/f1 lies below that of a beam without a tip, and no tip mass follows"
            };
            remarks.push(Remark::note(format!(
                "{why}: the second mode has the frequency f2, {} of the uniform beam's",
                Kind::Number.format_digits(share, 4)
            )));
        }
        let modes = self.lever_modes().iter().take(self.cantilever.modes);
        let unknown = modes.filter(|mode| mode.participation.is_none()).count();
        let drive = match self.cantilever.actuation {
            Actuation::Base => "the motion of the base",
            Actuation::Distributed => "a force spread over the lever",
            Actuation::Tip => "",
        };
        let is_assumed = match self.cantilever.actuation {
            Actuation::Base => unknown > 0,
            Actuation::Distributed => true,
            Actuation::Tip => false,
        };
        if !is_beam && is_assumed {
            remarks.push(Remark::note(format!(
                "the measured modes take part in {drive} like those of a uniform beam"
            )));
        }
        remarks.extend(self.lever.remarks(&self.data));
        remarks.extend(self.sample.remarks(reader, &self.tip));
        if !reader.has(Key::GapTip) {
            remarks.push(Remark::note(
                "gap.tip is not given: it follows from the setpoint",
            ));
        }
        if !reader.has(Key::GapBeam) && self.tip.height.is_none() {
            remarks.push(Remark::note(format!(
                "neither gap.beam nor tip.height is given: the tip counts as {} high, which \
                 matters only for whether the beam touches",
                Kind::Length.format(USUAL_TIP_HEIGHT)
            )));
        }
        remarks.extend(self.clearance_remarks());
        remarks.extend(Self::plausibility_remarks(reader));
        remarks
    }

    /// Values that no lever or sample has: most likely numbers without their unit, or with another
    /// prefix.
    fn plausibility_remarks(reader: Reader<'_>) -> impl Iterator<Item = Remark> {
        Key::all().filter_map(move |key| {
            let Value::Number(value, kind) = reader.stated.get(key)? else {
                return None;
            };
            let meant = plausible::meant(key, key.section(), *kind, *value)?;
            let shown = kind.format(*value);
            Some(Remark::warning(format!(
                "{key} is {shown}; did you mean {meant}?"
            )))
        })
    }

    /// Whether another part of the beam would touch. The trajectory decides in the end; what
    /// can be said beforehand is how deep the tip sinks when it brings its energy along,
    /// ½kA₀² = ½K₁δ², but no deeper than it swings.
    fn clearance_remarks(&self) -> Vec<Remark> {
        let mut remarks = Vec::new();
        let base = match self.cantilever.actuation {
            Actuation::Base => {
                self.parameters.get(Parameter::Alpha2)
                    + self.parameters.get(Parameter::Tone2Amplitude)
            }
            Actuation::Tip | Actuation::Distributed => 0.0,
        };
        if base >= self.scales.length {
            remarks.push(Remark::warning(format!(
                "the drive moves the clamped end by {}, further than its gap of {}: the beam \
                 would touch the sample",
                Kind::Length.format(base),
                Kind::Length.format(self.scales.length)
            )));
        }
        let softness = (self.lever.k / self.sample.stiffness).sqrt().min(1.0);
        let static_depth = (-self.parameters.get(Parameter::Alpha5)).max(0.0) * self.lever.k
            / (self.lever.k + self.sample.stiffness);
        let depth = (self.free_amplitude + base) * softness + static_depth;
        if depth >= self.tip_height {
            remarks.push(Remark::warning(format!(
                "on so soft a sample the tip may sink by {}, more than its height of {}: \
                 another part of the beam would touch",
                Kind::Length.format_digits(depth, 2),
                Kind::Length.format(self.tip_height)
            )));
        }
        if let Some(hertz) = self.sample.hertz
            && hertz.indentation >= self.tip_height
        {
            remarks.push(Remark::warning(format!(
                "the indentation of {} is more than the tip's height of {}: another part of \
                 the beam would touch",
                Kind::Length.format(hertz.indentation),
                Kind::Length.format(self.tip_height)
            )));
        }
        remarks
    }
}
